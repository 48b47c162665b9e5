"""A closed loop as C: the law for flight, and a program that flies it against the plant that it was simulated with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.codegen.opcodes import REALS
from lie_codegen.codegen.parts import PackageParts
from lie_codegen.codegen.templates import render
from lie_codegen.control.loop_kernels import loop_control, loop_motion, loop_step
from lie_codegen.control.loop_model import SIGMAS
from lie_codegen.control.loop_run import Run
from lie_codegen.control.reference_kernels import motion_kernel
from lie_codegen.errors import CodegenError, InputError
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.kernel import Kernel

_TOLERANCES = {"double": 1e-9, "float": 1e-3}
_MARKS = 10
#: Fewer steps in single precision: their error grows 4096 times, from 1e-10 to half of the rounding of a float.
_COARSER = 8


@dataclass(frozen=True)
class NumberView:
    """A number of the loop that is compiled in."""

    name: str
    size: int
    values: tuple[str, ...]


def loop_parts(run: Run, reference: Any, parts: int, name: str | None, real: str) -> PackageParts:
    """The kernels of a loop, and <name>_loop.c, which runs the first one without noise.

    Args:
        run: as `closed_loop` ran it.
        reference: or None.
        parts: steps between two times, or between two samples.
        name: of the package.
        real: "double" or "float".

    Raises:
        CodegenError: no such real type.
        InputError: an uncontrolled body, which has no law to take home.
    """
    if real not in REALS:
        raise CodegenError(f"real is one of {', '.join(REALS)}, given {real!r}")
    loop = run.loop
    if loop.law is None:
        raise InputError("generate: a loop without a law has nothing to take home; give closed_loop a law")
    quiet = _quiet(run)
    if real == "float" and not run.sample:
        parts = -(-parts // _COARSER)  # steps as short as double wants them would only gather rounding
    package = check_identifier(name or loop.plant.namespace, "name")
    sampled = bool(run.sample)
    kernels: list[Kernel] = [loop.law.kernel]
    moving: list[Kernel] = []
    if reference is not None:
        moving = [motion_kernel(reference)]
    own = [loop_control(loop), loop_motion(loop)] if sampled else [loop_step(loop)]
    view = _view(quiet, parts, package, real, own, moving)
    files = {f"{package}_loop.c": render("loop_replay.c.jinja", loop=view)}
    starts = {each.symbol: _start(quiet, each) for each in own}
    gap = run.sample if sampled else float(run.times[1] - run.times[0])
    schedule = {
        "step": own[-1].symbol,
        "control": own[0].symbol if sampled else "",
        "reference": moving[0].symbol if moving else "",
        "stages": 1 if sampled else 3,
        "period": gap / parts,
        "sample": run.sample if sampled else 0.0,
        "delay": run.delay if sampled else 0,
        "command": loop.plant.sizes[2],
        "input": "noise",
    }
    return PackageParts(package, (*kernels, *moving, *own), files, starts, schedule)


def _start(run: Run, kernel: Kernel) -> dict[str, tuple[float, ...]]:
    """State, time and numbers at the first instant, a state's places beyond those of the plant at rest."""
    found = {}
    for port in kernel.inputs:
        if port.name == "state":
            state = np.zeros(port.size)
            state[: run.start.shape[1]] = run.start[0]
            found["state"] = tuple(state.tolist())
        elif port.name == "t":
            found["t"] = (float(run.times[0]),)
        elif port.name == "noise":
            found["noise"] = (0.5,) * port.size  # the median: no noise
        elif port.name in run.numbers:
            found[port.name] = tuple(np.ravel(run.numbers[port.name]).tolist())
    return found


def _quiet(run: Run) -> Run:
    """The first loop alone, without noise."""
    ranks = {port.name: len(port.shape) for port in run.loop.number_ports(noisy=True)}
    numbers = {}
    for name, value in run.numbers.items():
        first = value[0] if value.ndim > ranks[name] else value
        numbers[name] = np.zeros_like(first) if name in SIGMAS.values() else first
    return run._replace(start=np.ascontiguousarray(run.start[:1]), numbers=numbers, many=False)


def _view(run: Run, parts: int, package: str, real: str, own: list[Kernel], moving: list[Kernel]) -> dict[str, Any]:
    literal, loop, sampled = REALS[real].literal, run.loop, bool(run.sample)

    def row(values: Any) -> tuple[str, ...]:
        return tuple(literal(float(x)) for x in np.ravel(values))

    times = run.times
    states = np.asarray(run.states(parts))
    spans = len(times) - 1
    gap = float(times[1] - times[0])
    each = round(gap / run.sample) if sampled else parts
    period = run.sample if sampled else gap / parts
    chosen = np.unique(np.linspace(1, spans, min(_MARKS, spans)).astype(int))
    extent = states.shape[-1]
    start = np.zeros(extent)
    start[: run.start.shape[1]] = run.start[0]
    values: dict[str, Any] = dict(run.numbers)
    if loop.noise:
        values["noise"] = np.full(loop.noise_width, 0.5)  # times a deviation of zero
    used = {port.name: port for kernel in own for port in kernel.inputs if port.name in values}
    shape = loop.plant.ports[0]
    law = loop.law
    calls = {kernel.name: kernel for kernel in own}
    step = literal(period / parts)
    view: dict[str, Any] = {
        "law": law.kernel.symbol if law is not None else "",
        "flight": law.kernel.symbol if law is not None else "",
        "about": f"called every {run.sample:g} s and held" if sampled else "",
        "package": package,
        "group": moving[0].namespace if moving else loop.plant.namespace,
        "real": real,
        "zero": literal(0.0),
        "tolerance": repr(_TOLERANCES[real]),
        "size": extent,
        "command": loop.plant.sizes[2],
        "delay": run.delay,
        "numbers": [NumberView(f"number_{key}", port.size, row(values[key])) for key, port in used.items()],
        "places": [str(int(k) * each - 1) for k in chosen],
        "marks": [row(states[k]) for k in chosen],
        "state": row(start),
        "moving": bool(moving),
        "rows": 1 if sampled else 3,
        "element": shape.size,
        "velocity": loop.plant.ports[1].size,
        "sampled": sampled,
        "first": literal(float(times[0])),
        "last": literal(float(times[-1])),
        "steps": spans * each,
        "period": literal(period),
        "half": literal(period / 2),
        "parts": parts,
    }
    if sampled:
        h = literal(run.sample)
        view["control"] = _call(calls["loop_control"], values, literal(float(times[0])), h)
        view["again"] = _call(calls["loop_control"], values, "t", h)
        view["motion"] = _call(calls["loop_motion"], values, f"begin + (real)part * {step}", step)
    else:
        view["step"] = _call(calls["loop_step"], values, "begin", literal(period))
    return view


def _call(kernel: Kernel, values: Mapping[str, Any], t: str, h: str) -> str:
    """The call of a kernel on `state`; scalars go by value."""
    told = {"state": "state", "t": t, "h": h}
    arguments = []
    for port in kernel.inputs:
        if port.name in values:
            arguments.append(f"number_{port.name}{'' if port.shape else '[0]'}")
        else:
            arguments.append(told.get(port.name, port.name))
    return f"{kernel.symbol}({', '.join([*arguments, 'state'])})"
