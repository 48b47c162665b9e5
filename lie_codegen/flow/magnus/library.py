"""The compiled Magnus steps of a group, and how they are called."""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.steps import Steps
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.sources import build_source

#: Plain C, beside the header that is made for the group.
_FILES = ("magnus.c", "magnus_lanes.h", "magnus_input.h", "magnus_exponent.h", "magnus_move.h")
_LANES = 8


class _Input(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_void_p if kind == "p" else ctypes.c_ssize_t)
        for name, kind in (
            ("rates", "z"), ("wave_stride", "z"), ("rate_stride", "z"), ("rate", "p"), ("rate_low", "p"), ("cosines", "p"), ("sines", "p"),
            ("times", "p"), ("left", "p"), ("right", "p"), ("line_stride", "z"), ("terms", "z"), ("series", "p"),
            ("nodes", "z"), ("table_stride", "z"), ("table", "p"), ("projection", "p"), ("tangents", "z"),
            ("tangent_stride", "z"), ("tangent", "p"), ("factor", "p"), ("factor_stride", "z"),
        )
    ]  # fmt: skip


class _Grid(ctypes.Structure):
    _fields_ = [("spans", ctypes.c_ssize_t)] + [
        (n, ctypes.c_void_p) for n in ("knots", "parts", "first", "piece", "slot")
    ]


class MagnusLibrary:
    """magnus.c of one group, loaded."""

    def __init__(self, group: MatrixGroup, library: ctypes.CDLL) -> None:
        size = ctypes.c_ssize_t
        self.group = group
        self._work = library.magnus_work
        self._work.restype, self._work.argtypes = size, (size, size, size)
        self._one, self._many = library.magnus_one, library.magnus_many
        self._tangents, self._tangents_work = library.magnus_tangents, library.magnus_tangents_work
        pointer = ctypes.c_void_p
        self._one.restype = self._many.restype = ctypes.c_double
        self._tangents.restype, self._tangents_work.restype = None, size
        self._tangents_work.argtypes = (size,)
        self._tangents.argtypes = (pointer, ctypes.c_double, size, pointer, pointer, pointer)
        self._one.argtypes = (pointer, pointer, size, size, size, pointer, size, pointer, pointer, pointer)
        self._many.argtypes = (pointer, pointer, size, size, pointer, size, size, pointer, pointer)

    def one(self, drive: Drive, steps: Steps, order: int, X0: Array, first: int, last: int) -> tuple[Array, Array]:
        """One trajectory over steps first .. last - 1 from X0: X where a span ends whose slot is not negative, and at the end.

        Slots whose span does not end within these steps are left as they are: zero.
        """
        u, grid, _kept = self._arguments(drive, steps, 0)
        X, end = np.zeros((steps.slots, *X0.shape), X0.dtype), np.empty_like(X0)
        space = np.empty(self._work(drive.rates.shape[-1], drive.terms, steps.slots) + _LANES)
        self._one(
            ctypes.addressof(u), ctypes.addressof(grid), order, first, last, X0.ctypes.data, steps.slots,
            space.ctypes.data, X.ctypes.data, end.ctypes.data,
        )  # fmt: skip
        return X, end

    def many(self, drive: Drive, steps: Steps, order: int, X0: Array, first: int, last: int) -> Array:
        """Trajectories first .. last - 1 over all steps: (last - first, slots, d, d). X0: (d, d), or (N, d, d)."""
        u, grid, _kept = self._arguments(drive, steps, first)
        stride = X0[0].size * (2 if X0.dtype.kind == "c" else 1) if X0.ndim == 3 else 0
        X = np.zeros((last - first, steps.slots, *X0.shape[-2:]), X0.dtype)
        space = np.empty(self._work(drive.rates.shape[-1], drive.terms, 0) + _LANES)
        self._many(
            ctypes.addressof(u), ctypes.addressof(grid), order, last - first, X0.ctypes.data + 8 * stride * first, stride,
            steps.slots, space.ctypes.data, X.ctypes.data,
        )  # fmt: skip
        return X

    def tangents(self, values: Array, tangents: Array, projection: Array, length: float) -> tuple[Array, Array]:
        """X over equal steps from the identity, and its exact derivatives (m, d, d).

        Args:
            values: (steps, nodes, n) u at the nodes of every step.
            tangents: (steps, nodes, m, n) its derivatives.
            projection: (4, nodes) from values at the nodes to generators over h.
            length: of all steps together.
        """
        count, nodes, m, _ = tangents.shape
        d, kind = self.group.degree, complex if self.group.is_complex else float
        factor = np.ones(1)
        u = _Input(
            nodes=nodes, table=values.ctypes.data, projection=projection.ctypes.data, tangents=m,
            tangent=tangents.ctypes.data, factor=factor.ctypes.data,
        )  # fmt: skip
        X, dX = np.empty((d, d), kind), np.empty((m, d, d), kind)
        space = np.empty(self._tangents_work(m) + _LANES)
        self._tangents(ctypes.addressof(u), length, count, space.ctypes.data, X.ctypes.data, dX.ctypes.data)
        return X, dX

    def _arguments(self, drive: Drive, steps: Steps, who: int) -> tuple[_Input, _Grid, tuple[Any, ...]]:
        formula = drive.formula

        def table(values: Array) -> tuple[int, int]:
            stride = values[0].size if values.ndim == 3 else 0
            return values.ctypes.data + 8 * who * stride, stride

        (cosines, waves), (sines, _) = table(formula.cosines), table(formula.sines)
        (left, lines), (right, _) = table(formula.left), table(formula.right)
        rate_stride = drive.rates.shape[-1] if drive.rates.ndim == 2 else 0
        factor_stride = int(len(drive.factor) > 1)
        times = drive.times
        u = _Input(
            rates=drive.rates.shape[-1], wave_stride=waves, rate=drive.rates.ctypes.data + 8 * who * rate_stride,
            rate_low=drive.rates_low.ctypes.data + 8 * who * rate_stride,
            rate_stride=rate_stride, cosines=cosines, sines=sines,
            times=times.ctypes.data if len(times) else None, left=left, right=right, line_stride=lines,
            terms=drive.terms, series=drive.series.ctypes.data, factor=drive.factor.ctypes.data + 8 * who * factor_stride,
            factor_stride=factor_stride,
        )  # fmt: skip
        grid = _Grid(
            len(steps.parts), steps.knots.ctypes.data, steps.parts.ctypes.data, steps.first.ctypes.data,
            steps.piece.ctypes.data, steps.slot.ctypes.data,
        )  # fmt: skip
        return u, grid, (drive, steps)


@lru_cache(maxsize=32)
def magnus_library(group: MatrixGroup) -> MagnusLibrary | None:
    """The compiled steps of a group; None where there is no compiler."""

    def files() -> dict[str, str]:
        from lie_codegen.codegen.templates import render
        from lie_codegen.flow.magnus.group_view import group_view

        plain = {name: (template_folder() / name).read_text(encoding="utf-8") for name in _FILES}
        return {**plain, "magnus_group.h": render("magnus_group.h.jinja", group=group_view(group))}

    try:
        path = build_source(
            files, "magnus.c", namespace=f"{group.name}_magnus", definition=f"magnus\n{group.definition_text}"
        )
    except CompileError:
        return None
    return None if path is None else MagnusLibrary(group, load_library(path))
