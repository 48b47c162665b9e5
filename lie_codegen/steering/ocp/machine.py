"""The solver of a problem, compiled: its workspace as a numpy record, its functions through ctypes."""

from __future__ import annotations

import ctypes
import hashlib
import threading
from collections import OrderedDict
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.sources import build_source
from lie_codegen.steering.ocp.machine_base import Machine
from lie_codegen.steering.ocp.model_sizes import Sizes
from lie_codegen.steering.ocp.problem_data import ProblemData
from lie_codegen.steering.ocp.source import render_solver, solver_view


class CompiledMachine(Machine):
    """Functions of the generated library; the interpreter lock is released while they run."""

    def __init__(self, library: ctypes.CDLL, data: ProblemData, sizes: Sizes, row_names: tuple[str, ...]) -> None:
        super().__init__(data, sizes, row_names, compiled=True)
        void, real, integer, stride = ctypes.c_void_p, ctypes.c_double, ctypes.c_int, ctypes.c_ssize_t
        name = data.name
        self._solve = _function(
            library, f"{name}_solve", integer, void, void, stride, real, real, real, integer, integer
        )
        self._gains = _function(library, f"{name}_gains", real, void, void, stride, real)
        self._first_guess = _function(library, f"{name}_first_guess", None, void, void, real)
        self._advance = _function(library, f"{name}_advance", None, void, void, void, real, real, integer, void)
        self._running_cost = _function(library, f"{name}_running_cost", real, void, void, void, real)
        self._plan_cost = _function(library, f"{name}_plan_cost", real, void, void, stride, real)
        self.raw_step = _function(library, f"{name}_step", integer, void, void, void, void, stride, real, integer, void)

    def solve(
        self, space: Array, rows: Array, t0: float, tolerance: float, allowed: float, outer: int, most: int
    ) -> None:
        self._solve(space.ctypes.data, rows.ctypes.data, stride_of(rows), t0, tolerance, allowed, outer, most)

    def gains(self, space: Array, rows: Array, t0: float) -> float:
        return float(self._gains(space.ctypes.data, rows.ctypes.data, stride_of(rows), t0))

    def first_guess(self, space: Array, rows: Array, t0: float) -> None:
        self._first_guess(space.ctypes.data, rows.ctypes.data, t0)

    def advance(self, x: Array, u: Array, p: Array, t: float, h: float, parts: int) -> Array:
        following = np.empty(len(x))
        self._advance(x.ctypes.data, u.ctypes.data, p.ctypes.data, t, h, parts, following.ctypes.data)
        return following

    def running_cost(self, x: Array, u: Array, p: Array, t: float) -> float:
        return float(self._running_cost(x.ctypes.data, u.ctypes.data, p.ctypes.data, t))

    def plan_cost(self, space: Array, rows: Array, t0: float) -> float:
        return float(self._plan_cost(space.ctypes.data, rows.ctypes.data, stride_of(rows), t0))

    def step(self, space: Array, X: Array, z: Array, rows: Array, t0: float, iterations: int, u: Array) -> int:
        return int(
            self.raw_step(
                space.ctypes.data,
                X.ctypes.data,
                z.ctypes.data,
                rows.ctypes.data,
                stride_of(rows),
                t0,
                iterations,
                u.ctypes.data,
            )
        )


def stride_of(rows: Array) -> int:
    """From one stage's parameters to the next; 0 where they are constant."""
    return rows.shape[1] if len(rows) > 1 else 0


_LOCK = threading.RLock()
#: Solvers of this process by the identity of their problem: two kernels may look alike and differ in their bodies.
_BUILT: OrderedDict[tuple[int, bool], tuple[ProblemData, Machine]] = OrderedDict()
_MOST = 64
#: The core's small dense products: a sixth of the time less on a body with four rotors than vectorised alone (gcc 12; -O3 gains half of that).
_FLAGS = ("-ftree-vectorize", "-funroll-loops")


def machine_of(data: ProblemData, *, second_order: bool) -> Machine:
    """The solver of a problem, made when first asked for.

    Raises:
        CompileError: with the command and the compiler's own words.
    """
    key = (id(data), second_order)
    with _LOCK:
        if key not in _BUILT or _BUILT[key][0] is not data:
            _BUILT[key] = (data, build_machine(data, second_order=second_order))
            while len(_BUILT) > _MOST:
                _BUILT.popitem(last=False)
        return _BUILT[key][1]


def loop_machine(data: ProblemData) -> Machine:
    """A solver for a loop: the one that plans, if it is there already or the duration is free; else one without second order, which
    builds faster."""
    planned = _BUILT.get((id(data), True))
    second_order = data.free_duration is not None or (planned is not None and planned[0] is data)
    return machine_of(data, second_order=second_order)


def build_machine(data: ProblemData, *, second_order: bool) -> Machine:
    """A solver: compiled, or interpreted where there is no compiler.

    Raises:
        CompileError: with the command and the compiler's own words.
    """
    view, model = solver_view(data, second_order=second_order)
    files = render_solver(view)
    # the text itself is the key: a user's kernel is code of which nothing else is known
    text = "".join(f"{name}\n{files[name]}" for name in sorted(files))
    definition = hashlib.sha256(text.encode()).hexdigest()
    path = build_source(lambda: files, f"{data.name}.c", namespace=data.name, definition=definition, more_flags=_FLAGS)
    if path is not None:
        return CompiledMachine(load_library(path), data, model.sizes, model.row_names)
    from lie_codegen.steering.ocp.interpreted import InterpretedMachine

    return InterpretedMachine(data, model)


def _function(library: ctypes.CDLL, name: str, result: Any, *arguments: Any) -> Any:
    function = library[name]
    function.argtypes = arguments
    function.restype = result
    return function
