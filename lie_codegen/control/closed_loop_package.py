"""A law for flight as a C package, with closed_loop.c: the law, its reference and the body it controls in one small program."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.control.loop_ports import LoopLaw, read_law
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.control.reference_motion import Reference
from lie_codegen.control.second_order_step import check_loop, held_force_step
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.element_pattern import packed_size, varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.renaming import in_namespace
from lie_codegen.mechanics.states import initial_states

_SHOWN = 50


@dataclass(frozen=True)
class OwnView:
    """A state of the law: a vector with a rate, or one that is held and jumps."""

    name: str
    size: int
    rate: str
    is_held: bool
    is_scalar: bool
    start: tuple[str, ...]


@dataclass(frozen=True)
class LoopView:
    """What closed_loop.c.jinja sees."""

    namespace: str
    law: str
    reference: str
    plant: str
    energy: str
    outputs: tuple[tuple[str, int], ...]
    own: tuple[OwnView, ...]
    entries: int
    matrix_size: int
    dim: int
    places: tuple[int, ...]
    identity: tuple[str, ...]
    state: tuple[str, ...]
    step: str
    steps: int
    shown: int


def generate_closed_loop(
    group: GroupLike,
    folder: str | Path,
    *,
    inertia: Any,
    law: Kernel,
    reference: Reference | None = None,
    X0: ArrayLike | None = None,
    xi0: ArrayLike | None = None,
    duration: float = 20.0,
    step: float = 0.01,
    name: str | None = None,
) -> Path:
    """The C package of the law (and its reference and body), with closed_loop.c; returns the folder.

    Args:
        group: the group.
        folder: where to write.
        inertia, law, reference, X0, xi0: as `closed_loop`.
        duration: [s] that closed_loop.c simulates.
        step: [s] from one call of the law to the next; its force, and the rates of states of its own, are held between.
        name: C identifier of the header, the source and the target, which begins the symbols of the body and of the reference; the
            group's if None. So two such packages, with laws of names of their own, go into one program.

    Raises:
        IdentifierError: the name is no C identifier.
        InputError: as `closed_loop`; a duration or step that is not positive.
        OutputFolderError: the folder cannot be written, or holds files that are not ours.
    """
    group = as_group(group, "generate_closed_loop")
    from lie_codegen.codegen.package import render_package
    from lie_codegen.codegen.templates import render
    from lie_codegen.codegen.write import write_package

    for value, what in ((duration, "duration"), (step, "step")):
        positive_number(value, what)
    check_loop(law, reference)
    own = [held_force_step(group, inertia)]
    own += [] if reference is None else [reference_kernel(reference)]
    kernels = [law, *in_namespace(own, name)]
    start, many = initial_states(group, X0, xi0)
    if many:
        raise InputError("closed_loop.c runs from one initial state: give one X0 and one xi0")
    namespace = group.name if name is None else name
    view = _view(group, law, reference, start[0], duration, step, namespace)
    extra = {"closed_loop.c": render("closed_loop.c.jinja", loop=view)}
    return write_package(render_package(namespace, kernels, extra=extra), folder)


def _view(
    group: MatrixGroup,
    law: Kernel,
    reference: Reference | None,
    state: Any,
    duration: float,
    step: float,
    namespace: str,
) -> LoopView:
    read = read_law(law)
    parts = 2 if group.is_complex else 1
    d = group.degree
    places = tuple(parts * (i * d + j) + part for i, j in varying_entries(group) for part in range(parts))
    eye = np.eye(d, dtype=complex if group.is_complex else float).view(float).ravel()
    names = [port.name for port in law.outputs]
    energy = next((name for name in ("W", "V", "phi") if name in names), "")
    steps = round(duration / step)
    return LoopView(
        namespace=namespace,
        law=law.symbol,
        reference="" if reference is None else "reference",
        plant="held_force_step",
        energy=energy,
        outputs=tuple((port.name, port.size) for port in law.outputs),
        own=() if read is None else _own(read),
        entries=packed_size(group),
        matrix_size=parts * d * d,
        dim=group.dim,
        places=places,
        identity=tuple(repr(float(x)) for x in eye),
        state=tuple(repr(float(x)) for x in state),
        step=repr(float(step)),
        steps=steps,
        shown=max(1, steps // _SHOWN),
    )


def _own(law: LoopLaw) -> tuple[OwnView, ...]:
    """The law's states, where they start as the law says.

    Raises:
        InputError: a state on the group, which closed_loop.c does not move.
    """
    made = []
    for each in law.states:
        if each.kind == "group":
            raise InputError(
                f"closed_loop.c does not move states on a group, as {each.name} of {law.kernel.name} is one"
            )
        start = np.broadcast_to(np.asarray(law.start.get(each.name, 0.0), dtype=float).ravel(), (each.port.size,))
        values = tuple(repr(float(x)) for x in start)
        made.append(OwnView(each.name, each.port.size, each.rate, each.kind == "held", not each.port.shape, values))
    return tuple(made)
