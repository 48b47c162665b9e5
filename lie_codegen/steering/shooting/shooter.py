"""Minimum energy, exactly: shooting on the Lie-Poisson equations, in generated C.

    minimise int_0^T sum_i w_i u_i^2 dt   subject to   X' = X sum_i u_i A_i,  X(0) = I,  X(T) = target

Every extremal is u_i(t) = <mu(t), A_i> / w_i with mu' = ad*_u mu, so that the n numbers mu(0) are all there is to find. Each
start is a first guess from the area rule, turned into the nearest costate, and Levenberg-Marquardt on X(1) = target;
the starts run side by side in the lanes of vectors. Without a compiler the same algorithm runs in numpy.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.algebra.controllability import control_indices, require_controllable
from lie_codegen.arrays import Array
from lie_codegen.door import on_behalf
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.sources import build_source
from lie_codegen.runtime.threads import CALLS, in_parts, interruptible
from lie_codegen.steering.shooting.extremal import Extremal
from lie_codegen.steering.shooting.extremals import Extremals
from lie_codegen.steering.task import reach

_NODES = 32


@dataclass(frozen=True)
class Shooter:
    """The solver of one group and its controls.

    Attributes:
        group, controls: controls are positions.
        starts: the default number of first guesses.
        compiled: False where numpy stands in for C.
    """

    group: MatrixGroup
    controls: tuple[int, ...]
    starts: int
    compiled: bool
    _machine: Any

    def solve(
        self, targets: ArrayLike, *, weights: ArrayLike | None = None, starts: int | None = None, threads: int = 1
    ) -> Extremals:
        """Steers to one target (d, d) or to each of K targets (K, d, d); elements of the group, not checked again.

        Raises:
            ShapeError, NotFiniteError: about the targets or the weights.
            InputError: weights that are not positive, starts or threads below 1.
        """
        elements = self._elements(targets)
        w = self.check_weights(weights)
        count = self.starts if starts is None else int(starts)
        if count < 1 or threads < 1:
            raise InputError(
                f"shooting({self.group.name}): starts and threads must be at least 1, got {count} and {threads}"
            )
        if threads == 1 or len(elements) <= 1:
            only: Extremals = self._machine.solve(elements, w, count)
            return only
        from concurrent.futures import ThreadPoolExecutor

        chunks = np.array_split(elements, min(threads, len(elements)))
        with ThreadPoolExecutor(len(chunks)) as pool:
            parts = list(pool.map(on_behalf(lambda chunk: self._machine.solve(chunk, w, count)), chunks))
        names = Extremals.__dataclass_fields__
        return Extremals(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    def extremal(self, mu0: ArrayLike, *, weights: ArrayLike | None = None, nodes: int | None = None) -> Extremal:
        """The extremal of a costate, to be evaluated at any time; `nodes` intervals, as many as it needs if not given."""
        w = self.check_weights(weights)
        costate = np.array(mu0, dtype=float)
        if nodes is None:
            nodes = int(np.clip(4 * float(np.linalg.norm(costate)), _NODES, 4096))
        return Extremal(self.group, self.controls, w, costate, self._machine.sample(costate, w, nodes + 1))

    def check_weights(self, weights: ArrayLike | None) -> Array:
        """The weights as an array, ones if not given."""
        m = len(self.controls)
        if weights is None:
            return np.ones(m)
        w = np.array(weights, dtype=float)
        if w.shape != (m,):
            raise ShapeError(
                f"shooting({self.group.name}): weights have shape {w.shape}; give one for each of {m} controls"
            )
        if not np.all(np.isfinite(w)) or np.any(w <= 0):
            raise InputError(f"shooting({self.group.name}): weights must be positive, got {w.tolist()}")
        return w

    def _elements(self, targets: ArrayLike) -> Array:
        d = self.group.degree
        array = np.ascontiguousarray(targets, dtype=complex if self.group.is_complex else float)
        if array.ndim not in (2, 3) or array.shape[-2:] != (d, d):
            raise ShapeError(f"shooting({self.group.name}): targets have shape {array.shape}; give (..., {d}, {d})")
        if not np.isfinite(array).all():
            raise NotFiniteError(f"shooting({self.group.name}): a target holds NaN or infinity")
        return array.reshape(-1, d, d)


def shooter(group: GroupLike, controls: Sequence[int | str]) -> Shooter:
    """The solver of a group and its controls, compiled once and cached.

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
        InputError: an unknown or repeated control.
        CompileError: with the command and the compiler's own words.
    """
    return _shooter(as_group(group, "shooter"), tuple(controls))


@lru_cache(maxsize=16)
def _shooter(group: MatrixGroup, controls: tuple[int | str, ...]) -> Shooter:
    report = reach(group, control_indices(group.algebra, controls))
    if not report.controllable:
        require_controllable(group.algebra, controls)

    def files() -> dict[str, str]:
        from lie_codegen.steering.shooting.source import render_steering, steering_view

        return render_steering(steering_view(group, report.controls, report.depth))

    from lie_codegen.steering.shooting.defaults import Defaults

    defaults = Defaults.of(group.dim, report.depth)
    name = f"{group.name}_steer"
    definition = f"{group.definition_text}\ncontrols {report.controls} depth {report.depth}"
    library = build_source(files, f"{name}.c", namespace=name, definition=definition)
    if library is None:
        from lie_codegen.steering.shooting.numpy_solver import NumpyShooting

        machine: Any = NumpyShooting(group, report.controls, report.depth, defaults)
    else:
        machine = _CompiledShooting(load_library(library), group, len(report.controls))
    return Shooter(group, report.controls, defaults.starts, library is not None, machine)


#: Starts in one call of compiled code, some tenths of a second; between two calls Python looks whether somebody pressed Ctrl-C.
_STARTS = 1024


class _Options(ctypes.Structure):
    _fields_ = (
        ("starts", ctypes.c_int),
        ("search_steps", ctypes.c_int),
        ("search_iterations", ctypes.c_int),
        ("polish_steps", ctypes.c_int),
        ("polish_iterations", ctypes.c_int),
        ("search_tolerance", ctypes.c_double),
        ("tolerance", ctypes.c_double),
    )


class _CompiledShooting:
    """The functions of the generated library; the interpreter lock is released while they run."""

    def __init__(self, library: ctypes.CDLL, group: MatrixGroup, controls: int) -> None:
        prefix = f"{group.name}_steer"
        n = group.dim
        self._group = group
        self._controls = controls
        self._defaults = library[f"{prefix}_defaults"]
        self._defaults.argtypes, self._defaults.restype = (), _Options
        self._solve = library[f"{prefix}_solve"]
        self._solve.argtypes = (ctypes.c_int, *[ctypes.c_void_p] * 4)
        self._solve.restype = None
        self._sample = library[f"{prefix}_sample"]
        self._sample.argtypes = (*[ctypes.c_void_p] * 2, ctypes.c_int, *[ctypes.c_void_p] * 2)
        self._sample.restype = None
        counts = [(name, np.intc) for name in ("status", "starts", "converged", "agreeing", "linearisations")]
        numbers = [("mu0", float, (n,)), ("cost", float), ("residual", float), ("jacobian", float, (n, n))]
        self._result = np.dtype([*numbers, *counts], align=True)

    def solve(self, targets: Array, weights: Array, starts: int) -> Extremals:
        options = self._defaults()
        options.starts = starts
        results = np.zeros(len(targets), self._result)

        def some(first: int, last: int) -> None:
            mine = targets[first:last], results[first:last]
            self._solve(
                last - first, mine[0].ctypes.data, weights.ctypes.data, ctypes.addressof(options), mine[1].ctypes.data
            )

        if starts > _STARTS:
            for k in range(len(targets)):
                interruptible(lambda k=k: some(k, k + 1))  # type: ignore[misc]
        else:
            in_parts(some, len(targets), 1, CALLS * starts // _STARTS)
        return Extremals(**{name: results[name] for name in Extremals.__dataclass_fields__})

    def sample(self, mu0: Array, weights: Array, count: int) -> Array:
        d = self._group.degree
        X = np.empty((count, d, d), dtype=complex if self._group.is_complex else float)
        self._sample(mu0.ctypes.data, weights.ctypes.data, count, None, X.ctypes.data)
        return X


def positions(group: MatrixGroup, controls: Sequence[str | int]) -> tuple[int, ...]:
    """Positions of controls given by label or position."""
    return tuple(group.algebra.index(control) for control in controls)
