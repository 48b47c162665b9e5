"""What a loop feeds to a law: every input of the law has a kind, read off its name and the law's outputs.

    configuration   X, q                      as it is measured or estimated
    velocity        xi, omega, q_dot          likewise
    reference       X_d, xi_d, xi_d_dot       (r, r_dot, r_ddot; omega_d, omega_d_dot) at the same time
    direction       y                         X^-1 c of fixed c, one row each: what a sensor in the body sees
    time            t                         [s]
    period          h                         from one call to the next [s]
    vector          z beside an output z_dot: a state of the law, z' = z_dot
    group           X_hat beside u_hat (or X_hat_dot), (n,): a state on the group, X_hat' = X_hat hat(u_hat)
    held            q beside q_next: a state that jumps, at every call
    number          anything else: a gain, an inertia, given with `gains=`

The first output is the command: a body velocity in a loop of order 1, a body force in one of order 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lie_codegen.control.guarded_law import evaluated_within
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import shown
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, matvec, number
from lie_codegen.kernel.plain_data import Definition, made_from
from lie_codegen.on_demand import sympy as sp

CONFIGURATION, VELOCITY = ("X", "q"), ("xi", "omega", "q_dot")
REFERENCE = (("X_d", "r"), ("xi_d", "omega_d", "r_dot"), ("xi_d_dot", "omega_d_dot", "r_ddot"))
STATES = ("vector", "group", "held")
#: First outputs that say of which order the loop is.
_COMMANDS = {1: ("omega", "velocity", "xi"), 2: ("force", "torque", "moment")}


@dataclass(frozen=True)
class LoopPort:
    """An input of a law.

    Attributes:
        port: as the kernel has it.
        kind: one of those above.
        rate: of a state, the output that changes it; of a reference, which of the three it is; else "".
    """

    port: Port
    kind: str
    rate: str = ""

    @property
    def name(self) -> str:
        return self.port.name


@dataclass(frozen=True)
class LoopLaw:
    """A law, ready for a loop.

    Attributes:
        kernel: the law.
        ports: its inputs.
        directions: (k) the c of y = X^-1 c, exact; none where the law has no input y.
        start: values of its states at the start, by name; those not named are zero, or the identity.
        told: the order that the user said, where the ports do not; 0 for none.
    """

    kernel: Kernel
    ports: tuple[LoopPort, ...]
    directions: tuple[tuple[Any, ...], ...]
    start: Mapping[str, Any]
    told: int = 0

    @cached_property
    def states(self) -> tuple[LoopPort, ...]:
        """Those that are states of the law."""
        return tuple(each for each in self.ports if each.kind in STATES)

    @cached_property
    def numbers(self) -> tuple[Port, ...]:
        """Those that are numbers of the law."""
        return tuple(each.port for each in self.ports if each.kind == "number")

    @property
    def command(self) -> Port:
        """The first output."""
        return self.kernel.outputs[0]

    def has(self, kind: str) -> bool:
        """Whether an input is of that kind."""
        return any(each.kind == kind for each in self.ports)

    @cached_property
    def order(self) -> int | None:
        """1 or 2, as the names of its ports say, or as was told; None where neither does."""
        if self.has("velocity"):
            return 2
        named = [order for order, names in _COMMANDS.items() if self.command.name in names]
        return named[0] if named else self.told or None

    def values(self, ops: Any, given: Mapping[str, Any], *, within: bool = False) -> dict[str, Any]:
        """The outputs by name, from what the loop has: by the kind (of a reference and a state: by the name) of each input.

        With `within` the law is not asked to refuse matrices off the group.
        """
        arguments = [
            given[each.name if each.kind in (*STATES, "number") else each.rate or each.kind] for each in self.ports
        ]
        found = evaluated_within(self.kernel, ops, *arguments) if within else self.kernel.evaluate(ops, *arguments)
        return dict(zip((port.name for port in self.kernel.outputs), found, strict=True))


def read_law(law: Any, *, directions: Any = None, observer: bool = False, where: str = "closed_loop") -> LoopLaw | None:
    """A law for a loop: a Kernel, or something that has one as `kernel`, perhaps beside `start` and `directions`.

    An observer is read in the same way: its states are held, and its input `u` is the measured velocity.

    Raises:
        InputError: it is none, or one of its inputs is of no kind.
    """
    if law is None:
        return None
    kernel = law if isinstance(law, Kernel) else getattr(law, "kernel", None)
    if not isinstance(kernel, Kernel):
        raise InputError(
            f"{where}: law is a Kernel, as lc.tracking_law or lc.attitude_law makes it, or has one as .kernel, got {shown(law)}"
        )
    ports = tuple(
        LoopPort(port, "velocity") if observer and port.name == "u" else _kind(kernel, port) for port in kernel.inputs
    )
    start = dict(getattr(law, "start", None) or {})
    given = _parameters(kernel).get("start")
    own = [each.name for each in ports if each.kind in STATES]
    if given is not None and not start and own:
        start = dict(given) if isinstance(given, Mapping) else {own[0]: given}
    first = kernel.outputs[0]
    if not observer and (len(first.shape) != 1 or first.name in {each.rate for each in ports if each.kind in STATES}):
        raise InputError(
            f"{where}: the first output of the law {kernel.name} is its command, a vector; it is {first.name} {first.shape}"
        )
    return LoopLaw(kernel, ports, _directions(directions, law, kernel, ports, where), start)


def _kind(law: Kernel, port: Port) -> LoopPort:
    outputs = {each.name: each for each in law.outputs}
    name = port.name
    for what in ("dot", "next"):
        change = outputs.get(f"{name}_{what}")
        if change is not None and change.shape == port.shape:
            return LoopPort(port, "held" if what == "next" or len(port.shape) == 2 else "vector", change.name)
    turn = outputs.get(f"{name}_dot") or outputs.get("u" + name.removeprefix("X"))
    if len(port.shape) == 2 and turn is not None and len(turn.shape) == 1 and name not in CONFIGURATION:
        return LoopPort(port, "group", turn.name)
    for kind, names in (("configuration", CONFIGURATION), ("velocity", VELOCITY)):
        if name in names:
            return LoopPort(port, kind)
    for names in REFERENCE:
        if name in names:
            return LoopPort(port, "reference", names[0])
    for kind, word in (("direction", "y"), ("time", "t"), ("period", "h")):
        if name == word:
            return LoopPort(port, kind)
    if law.definition is None or _is_parameter(law, port):
        return LoopPort(port, "number")
    raise InputError(
        f"the law {law.name} has the inputs {', '.join(each.name for each in law.inputs)}; a closed loop knows no {name}: it "
        "gives X, omega or X, xi, X_d, xi_d, xi_d_dot, and beside them states of the law (vectors z with an output z_dot "
        'of their size, q with an output q_next), y, t, h and parameters that are inputs ("input")'
    )


def _parameters(law: Kernel) -> Mapping[str, Any]:
    return {} if law.definition is None else law.definition["parameters"]


def _is_parameter(law: Kernel, port: Port) -> bool:
    """By what the law is defined by: a number of that name, there or among its gains."""
    return _letters(port.name) in _names(_parameters(law))


def _names(given: Mapping[str, Any]) -> set[str]:
    """Of all numbers in a definition: its own, of its gains, and of the laws, vehicles and error functions among its parameters."""
    inner = [_names(value) for value in given.values() if isinstance(value, Mapping)]
    return {_letters(key) for key in given}.union(*inner)


def _letters(name: str) -> str:
    """K_d, Kd and k_d are one gain."""
    return name.replace("_", "").lower()


def _directions(
    directions: Any, law: Any, kernel: Kernel, ports: Sequence[LoopPort], where: str
) -> tuple[tuple[Any, ...], ...]:
    """The c of y = X^-1 c: of the law object, or a parameter `z` or `directions` of the kernel's definition."""
    y = next((each.port for each in ports if each.kind == "direction"), None)
    if y is None:
        return ()
    given = getattr(law, "directions", None) if directions is None else directions
    for name in ("directions", "points", "z"):
        given = _parameters(kernel).get(name) if given is None else given
    if given is None:
        raise InputError(f"{where}: the law {kernel.name} sees y = X^-1 c, and says of no c; give it as law.directions")
    rows = np.array(given, dtype=object)
    rows = rows[None] if rows.ndim == 1 else rows
    count = y.shape[0] if len(y.shape) == 2 else 1
    if rows.ndim != 2 or len(rows) != count:
        raise ShapeError(f"{where}: y has shape {y.shape}, the directions {rows.shape}; give one row each")
    exact = [[real_number(made_from(entry), "directions") for entry in row] for row in rows]
    if "z" in _parameters(kernel):  # of any length there; the sensor sees its direction
        exact = [[entry / sp.sqrt(sum(each**2 for each in row)) for entry in row] for row in exact]
    return tuple(map(tuple, exact))


def seen_directions(
    ops: Arithmetic, group: MatrixGroup, inverse: Matrix, directions: Sequence[Sequence[Any]]
) -> list[Vector]:
    """X^-1 c, one row each, from the matrix X^-1; a c one entry shorter than the matrix is a direction: (c, 0).

    On a complex group the c are vectors of the algebra, and Ad_(X^-1) c is what is seen: on SU(2), R(X)^T c.
    """
    if group.is_complex:
        matrices = GroupMatrices(ops, derivation_of(group).real)
        X = matrices.inverse(inverse)
        return [matrices.Ad(inverse, X, [number(ops, entry) for entry in c]) for c in directions]
    size = len(inverse)
    full = [[number(ops, entry) for entry in c] + [0] * (size - len(c)) for c in directions]
    return [matvec(inverse, c)[: len(short)] for c, short in zip(full, directions, strict=True)]


def moving_law(law: LoopLaw) -> LoopLaw:
    """The same law for a reference that moves, where its factory makes it so (`tracking=`); else the law itself."""
    definition = law.kernel.definition
    if law.has("reference") or definition is None or definition["parameters"].get("tracking") is not False:
        return law
    changed = Definition({**definition, "parameters": Definition({**definition["parameters"], "tracking": True})})
    made = read_law(made_from(changed))
    return law if made is None else made
