"""The search in C: templates/direct_core.c and its headers with the sizes of a group, built once and cached; nothing is built per problem."""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.sources import build_source
from lie_codegen.runtime.threads import interruptible
from lie_codegen.steering.direct.numpy_search import NumpySearch
from lie_codegen.steering.direct.programme import Goal, Machine, Programme, Reached, Settings

_CORE = "direct_core.c"
_HEADERS = (
    "lane_vectors.h",
    "direct_lanes.h",
    "direct_algebra.h",
    "direct_chain.h",
    "direct_steps.h",
    "direct_newton.h",
)
_SIZES = "direct_sizes.h"
_ALIGNED = 64


@lru_cache(maxsize=32)
def machine(group: MatrixGroup, controls: int) -> Machine:
    """What searches for a group with that many controls: compiled, or numpy where there is no compiler.

    Groups of the same sizes share one library.

    Raises:
        CompileError: with the command and the compiler's own words.
    """
    parts = 2 if group.is_complex else 1
    sizes = (
        f"/* Sizes of a group: D x D matrices, PARTS doubles an entry, dimension N, M controls. */\n"
        f"#define PARTS {parts}\nenum {{ D = {group.degree}, N = {group.dim}, M = {controls} }};\n"
    )

    def files() -> dict[str, str]:
        from lie_codegen.codegen.templates import template_folder

        texts = {name: (template_folder() / name).read_text(encoding="utf-8") for name in (_CORE, *_HEADERS)}
        return {**texts, _SIZES: sizes}

    library = build_source(files, _CORE, namespace="direct_core", definition=sizes)
    return NumpySearch() if library is None else CompiledSearch(load_library(library), group, controls)


class _Sparse(ctypes.Structure):
    """As `sparse` in the C text."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in ("first", "j", "k", "value"))


class _Programme(ctypes.Structure):
    """As `programme` in the C text."""

    _fields_ = (
        *[
            (name, ctypes.c_int)
            for name in (
                "exponentials", "slots", "rows", "entry_lanes", "free_phase", "fuel", "reach_iterations", "descend_iterations", "wanted",
                "unitary",
            )
        ],
        *[(name, ctypes.c_double) for name in ("enough", "damping", "relative")],
        *[
            (name, ctypes.c_void_p)
            for name in (
                "start", "right", "value", "drifts", "directions", "share", "low", "high", "weight", "mass",
                "entry", "slot",
            )
        ],
        *[(name, _Sparse) for name in ("basis", "matrix", "dual", "bracket")],
    )  # fmt: skip


#: Multiplications of a call that may take a tenth of a second, two matrix products of an exponential and of each derivative.
_LONG = 2**26


class CompiledSearch:
    """The functions of the library; the interpreter lock is released while they run."""

    compiled = True

    def __init__(self, library: ctypes.CDLL, group: MatrixGroup, controls: int) -> None:
        self._degree, self._dim = group.degree, group.dim
        self._kind: Any = complex if group.is_complex else float
        self._products = (1 + controls) * group.degree**3 * (4 if group.is_complex else 1)
        rows = _numbers(np.ascontiguousarray(group.basis, dtype=self._kind)).reshape(group.dim, -1)
        self._dual = np.linalg.pinv(rows).T
        # entries that are rounding would cost as much as others
        self._dual[np.abs(self._dual) < 1e-14 * np.max(np.abs(self._dual))] = 0.0
        tables = {
            "basis": rows[:, None],
            "matrix": rows.T[:, None],
            "dual": self._dual[:, None],
            "bracket": np.moveaxis(group.algebra.structure_constants, 2, 0),
        }
        self._tables = {name: _Table(table) for name, table in tables.items()}
        self._unitary = bool(np.allclose(group.basis, -np.conj(np.swapaxes(group.basis, 1, 2)), rtol=0, atol=1e-14))
        void, count = ctypes.c_void_p, ctypes.c_int
        self._memory = library["direct_memory"]
        self._memory.argtypes, self._memory.restype = (void,), ctypes.c_size_t
        self._functions = {}
        for name, arrays in (("reach", 5), ("linearise", 5), ("descend", 6)):
            function = library[f"direct_{name}"]
            function.argtypes, function.restype = (void, count, *[void] * arrays), None
            self._functions[name] = function

    def reach(self, programme: Programme, goal: Goal, u: Array, settings: Settings) -> Reached:
        """See `Machine`."""
        controls, size, used = _copied(u), np.empty(len(u)), np.zeros(len(u), np.intc)
        phase = np.zeros(len(u))
        self._run("reach", programme, goal, settings, controls, size, phase, used)
        return Reached(controls, size, np.full(len(u), np.nan), np.zeros((len(u), self._dim)), used, phase)

    def descend(self, programme: Programme, goal: Goal, u: Array, settings: Settings) -> Reached:
        """See `Machine`."""
        controls, size, used = _copied(u), np.empty(len(u)), np.zeros(len(u), np.intc)
        cost, multipliers = np.empty(len(u)), np.zeros((len(u), self._dim))
        self._run("descend", programme, goal, settings, controls, size, cost, multipliers, used)
        return Reached(controls, size, cost, multipliers, used, np.zeros(len(u)))

    def linearise(self, programme: Programme, goal: Goal, u: Array) -> tuple[Array, Array, Array]:
        """See `Machine`."""
        lanes = len(u)
        size, r = np.empty(lanes), np.empty((lanes, self._dim))
        J = np.empty((lanes, self._dim, programme.low.size))
        self._run("linearise", programme, goal, Settings(), _copied(u), size, r, J)
        return size, r, J

    def _run(
        self, name: str, programme: Programme, goal: Goal, settings: Settings, controls: Array, *others: Array
    ) -> None:
        record, kept = self._record(programme, goal, settings)
        address = ctypes.addressof(record)
        memory = np.empty(self._memory(address) + _ALIGNED // 8)
        lent = memory.ctypes.data + -memory.ctypes.data % _ALIGNED
        pointers = [a.ctypes.data for a in (controls, *others)]
        iterations = max(settings.reach_iterations, settings.descend_iterations)
        work = len(controls) * record.exponentials * iterations * self._products

        def run() -> tuple[Any, ...]:
            self._functions[name](address, len(controls), *pointers, lent)
            return record, kept, memory, controls, others  # alive as long as the call

        if work > _LONG:
            interruptible(run)
        else:
            run()

    def _record(self, p: Programme, goal: Goal, settings: Settings) -> tuple[_Programme, dict[str, Array]]:
        """The C record, and the arrays it points to: goals are padded to square matrices, which changes no residual."""
        arrays: dict[str, Any] = {
            "start": self._square(goal.left @ p.start),
            "right": self._square(goal.right),
            "value": self._square(goal.value),
            **{name: self._coordinates(getattr(p, name)) for name in ("drifts", "directions")},
            **{name: _copied(getattr(p, name)) for name in ("share", "low", "high", "weight", "mass")},
            "entry": np.ascontiguousarray(p.entry, dtype=np.intc),
            "slot": np.ascontiguousarray(p.slot, dtype=np.intc),
        }
        record = _Programme(
            exponentials=len(p.slot),
            slots=len(p.mass),
            rows=len(p.drifts),
            entry_lanes=len(p.entry),
            free_phase=int(goal.free_phase),
            fuel=int(settings.fuel),
            reach_iterations=settings.reach_iterations,
            descend_iterations=settings.descend_iterations,
            wanted=settings.wanted,
            enough=settings.enough,
            damping=settings.damping,
            relative=settings.relative,
            unitary=int(self._unitary),
            **{name: array.ctypes.data for name, array in arrays.items()},
            **{name: table.record for name, table in self._tables.items()},
        )
        return record, arrays

    def _coordinates(self, matrices: Array) -> Array:
        """(..., d, d) matrices of the algebra -> (..., n)."""
        whole = np.ascontiguousarray(matrices, dtype=self._kind)
        return np.ascontiguousarray(_numbers(whole).reshape(*whole.shape[:-2], -1) @ self._dual.T)

    def _square(self, matrices: Array) -> Array:
        d = self._degree
        padded = np.zeros((*matrices.shape[:-2], d, d), dtype=self._kind)
        padded[..., : matrices.shape[-2], : matrices.shape[-1]] = matrices
        return padded


class _Table:
    """The entries (i, j, k) of a table that are not zero, by i, as the C text reads them."""

    def __init__(self, table: Array) -> None:
        i, j, k = np.nonzero(table)
        self._arrays = {
            "first": np.searchsorted(i, np.arange(len(table) + 1)).astype(np.intc),
            "j": j.astype(np.intc),
            "k": k.astype(np.intc),
            "value": np.ascontiguousarray(table[i, j, k], dtype=float),
        }
        self.record = _Sparse(**{name: array.ctypes.data for name, array in self._arrays.items()})


def _numbers(matrices: Array) -> Array:
    """Complex entries as pairs of numbers, real ones as they are."""
    return matrices.view(float) if np.iscomplexobj(matrices) else matrices


def _copied(values: Array) -> Array:
    return np.array(values, dtype=float, order="C")
