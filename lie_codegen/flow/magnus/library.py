"""The compiled Magnus steps of a group, and how they are called."""

from __future__ import annotations

import ctypes
from functools import cached_property, lru_cache
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
from lie_codegen.values import settle

#: Plain C, beside the header that is made for the group.
_HEADERS = tuple(f"magnus_{name}.h" for name in ("words", "lanes", "given", "input", "exponent", "move", "space"))
_MORE = {"magnus": ("magnus_step.h", "magnus_solve.h"), "magnus_single": ("magnus_step.h",)}
#: What Python gives stays in doubles where the lanes hold floats; the rest is written in floats.
_IN_DOUBLES = ("magnus_single.c", "magnus_given.h", "magnus_lanes.h")
#: Up to this dimension loops over coordinates are worth unrolling (a third faster); beyond, it only takes longer to compile.
_SMALL = 8


class Input(ctypes.Structure):
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


class Solve(ctypes.Structure):
    _fields_ = [
        ("u", Input), ("pieces", ctypes.c_ssize_t), *((n, ctypes.c_void_p) for n in ("norms", "times", "X0")),
        *((n, ctypes.c_ssize_t) for n in ("count", "order", "most", "block")), ("rtol", ctypes.c_double), ("atol", ctypes.c_double),
        *((n, ctypes.c_void_p) for n in ("knots", "parts", "first", "piece", "slot", "space", "coarse", "fine", "end")),
        *((n, ctypes.c_ssize_t) for n in ("spans", "multiple", "steps")),
        *((n, ctypes.c_double) for n in ("estimate", "longest", "shortest")),
    ]  # fmt: skip


class MagnusLibrary:
    """magnus.c of one group, loaded; the derivatives are a library of their own, opened when they are asked for."""

    def __init__(self, group: MatrixGroup, library: ctypes.CDLL) -> None:
        size, pointer = ctypes.c_ssize_t, ctypes.c_void_p
        self.group = group
        self._work = library.magnus_work
        self._work.restype, self._work.argtypes = size, (size, size, size)
        self._one, self._many, self.solve = library.magnus_one, library.magnus_many, library.magnus_solve
        self._one.restype = self._many.restype = None
        self._one.argtypes = (pointer, pointer, size, size, size, pointer, size, pointer, pointer, pointer)
        self._many.argtypes = (pointer, pointer, size, size, pointer, size, size, pointer, pointer)
        self.solve.restype, self.solve.argtypes = size, (pointer,)

    def work(self, rates: int, terms: int, slots: int) -> int:
        """Doubles of the workspace of one trajectory, with its alignment."""
        return int(self._work(rates, terms, slots))

    @cached_property
    def _derivatives(self) -> ctypes.CDLL:
        size, pointer = ctypes.c_ssize_t, ctypes.c_void_p
        library = _opened(self.group, "magnus_tangents")
        if library is None:
            raise CompileError(
                f"{self.group.name}: the derivatives of its Magnus steps do not compile, though the steps do"
            )
        library.magnus_tangents_work.restype, library.magnus_tangents_work.argtypes = size, (size,)
        library.magnus_tangents.restype = None
        library.magnus_tangents.argtypes = (pointer, ctypes.c_double, size, pointer, pointer, pointer)
        return library

    @cached_property
    def _single(self) -> ctypes.CDLL:
        size, pointer = ctypes.c_ssize_t, ctypes.c_void_p
        library = _opened(self.group, "magnus_single")
        if library is None:
            raise CompileError(f"{self.group.name}: its Magnus steps do not compile in single precision")
        library.magnus_single_work.restype, library.magnus_single_work.argtypes = size, (size, size)
        library.magnus_many_single.restype = None
        library.magnus_many_single.argtypes = (pointer, pointer, size, size, pointer, size, size, pointer, pointer)
        return library

    @cached_property
    def _reverse(self) -> ctypes.CDLL:
        size, pointer = ctypes.c_ssize_t, ctypes.c_void_p
        library = _opened(self.group, "magnus_pullback")
        if library is None:
            raise CompileError(f"{self.group.name}: the reverse derivatives of its Magnus steps do not compile")
        for each in (library.magnus_lane_products, library.magnus_pullback):
            each.restype = None
        library.magnus_lanes.restype, library.magnus_lanes.argtypes = size, ()
        library.magnus_lane_products.argtypes = (pointer, pointer, size, pointer)
        library.magnus_pullback.argtypes = (pointer, pointer, size, pointer, pointer)
        return library

    def lane_products(self, values: Array, lengths: Array, projection: Array) -> Array:
        """(lanes, d, d) the products of the steps in as many runs, u given by its (steps, nodes, n) values at nodes."""
        u, d = _table_input(values, projection), self.group.degree
        X = np.empty((self._reverse.magnus_lanes(), d, d), complex if self.group.is_complex else float)
        self._reverse.magnus_lane_products(ctypes.addressof(u), lengths.ctypes.data, len(lengths), X.ctypes.data)
        return X

    def pullback(self, values: Array, lengths: Array, projection: Array, covectors: Array) -> Array:
        """(steps, nodes, n): what the (lanes, d, d) covectors after the runs of `lane_products` are on the values."""
        u, slopes = _table_input(values, projection), np.empty_like(values)
        self._reverse.magnus_pullback(
            ctypes.addressof(u), lengths.ctypes.data, len(lengths), covectors.ctypes.data, slopes.ctypes.data
        )
        return slopes

    def one(self, drive: Drive, steps: Steps, order: int, X0: Array, first: int, last: int) -> tuple[Array, Array]:
        """One trajectory over steps first .. last - 1 from X0: X where a span ends whose slot is not negative, and at the end.

        Slots whose span does not end within these steps are left as they are: zero.
        """
        u, grid = read_by(drive, 0), grid_of(steps)
        X, end = np.zeros((steps.slots, *X0.shape), X0.dtype), np.empty_like(X0)
        space = _space(self.work(drive.rates.shape[-1], drive.terms, steps.slots))
        self._one(
            ctypes.addressof(u), ctypes.addressof(grid), order, first, last, X0.ctypes.data, steps.slots,
            space.ctypes.data, X.ctypes.data, end.ctypes.data,
        )  # fmt: skip
        return X, end

    def many(self, drive: Drive, steps: Steps, order: int, X0: Array, first: int, last: int) -> Array:
        """Trajectories first .. last - 1 over all steps: (last - first, slots, d, d). X0: (d, d), or (N, d, d)."""
        u, grid = read_by(drive, first), grid_of(steps)
        stride = X0[0].size * (2 if X0.dtype.kind == "c" else 1) if X0.ndim == 3 else 0
        X = np.zeros((last - first, steps.slots, *X0.shape[-2:]), X0.dtype)
        space = _space(self.work(drive.rates.shape[-1], drive.terms, 0))
        self._many(
            ctypes.addressof(u), ctypes.addressof(grid), order, last - first, X0.ctypes.data + 8 * stride * first, stride,
            steps.slots, space.ctypes.data, X.ctypes.data,
        )  # fmt: skip
        return X

    def many_single(self, drive: Drive, steps: Steps, order: int, X0: Array, first: int, last: int) -> Array:
        """As `many`, in single precision; X0 and the result are float32 or complex64."""
        u, grid = read_by(drive, first), grid_of(steps)
        stride = X0[0].nbytes // 4 if X0.ndim == 3 else 0
        X = np.zeros((last - first, steps.slots, *X0.shape[-2:]), X0.dtype)
        space = _space(self._single.magnus_single_work(drive.rates.shape[-1], drive.terms), np.float32)
        self._single.magnus_many_single(
            ctypes.addressof(u), ctypes.addressof(grid), order, last - first, X0.ctypes.data + 4 * stride * first, stride,
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
        u = Input(
            nodes=nodes, table=values.ctypes.data, projection=projection.ctypes.data, tangents=m,
            tangent=tangents.ctypes.data, factor=factor.ctypes.data,
        )  # fmt: skip
        X, dX = np.empty((d, d), kind), np.empty((m, d, d), kind)
        space = _space(self._derivatives.magnus_tangents_work(m))
        self._derivatives.magnus_tangents(
            ctypes.addressof(u), length, count, space.ctypes.data, X.ctypes.data, dX.ctypes.data
        )
        return X, dX


def _space(size: int, kind: type[np.floating[Any]] = np.float64) -> Array:
    """The workspace of one call; compiled code says its size, by the width of its vectors."""
    return np.empty(size, kind)


def _table_input(values: Array, projection: Array) -> Input:
    """u by its values at the nodes of every step; the arrays have to stay."""
    return Input(nodes=values.shape[1], table=values.ctypes.data, projection=projection.ctypes.data)


def read_by(drive: Drive, who: int) -> Input:
    """The drive of trajectory `who` as the C reads it; the drive's arrays have to stay. That of the first is kept beside it: nobody writes to it."""
    kept: Input | None = None if who else vars(drive).get("_read")
    if kept is not None:
        return kept
    formula = drive.formula
    rate, rate_low, cosines, sines, left, right = formula.addresses
    if drive.rates is not formula.rates:
        rate, rate_low = drive.rates.ctypes.data, drive.rates_low.ctypes.data
    waves, lines = (table[0].size if table.ndim == 3 else 0 for table in (formula.cosines, formula.left))
    rate_stride = drive.rates.shape[-1] if drive.rates.ndim == 2 else 0
    factor_stride = int(len(drive.factor) > 1)
    times = drive.times
    made = Input(
        rates=drive.rates.shape[-1], wave_stride=waves, rate=rate + 8 * who * rate_stride,
        rate_low=rate_low + 8 * who * rate_stride,
        rate_stride=rate_stride, cosines=cosines + 8 * who * waves, sines=sines + 8 * who * waves,
        times=times.ctypes.data if len(times) else None, left=left + 8 * who * lines, right=right + 8 * who * lines,
        line_stride=lines, terms=drive.terms, series=drive.series.ctypes.data if drive.terms else None, factor=drive.factor.ctypes.data + 8 * who * factor_stride,
        factor_stride=factor_stride,
    )  # fmt: skip
    if not who:
        settle(drive, _read=made)
    return made


def grid_of(steps: Steps) -> _Grid:
    """The steps as the C reads them."""
    return _Grid(
        len(steps.parts), steps.knots.ctypes.data, steps.parts.ctypes.data, steps.first.ctypes.data,
        steps.piece.ctypes.data, steps.slot.ctypes.data,
    )  # fmt: skip


@lru_cache(maxsize=32)
def magnus_library(group: MatrixGroup) -> MagnusLibrary | None:
    """The compiled steps of a group; None where there is no compiler."""
    library = _opened(group, "magnus")
    return None if library is None else MagnusLibrary(group, library)


def magnus_files(group: MatrixGroup, stem: str) -> dict[str, str]:
    """File name -> C text of a library of the group: magnus, magnus_single, magnus_tangents or magnus_pullback."""
    from lie_codegen.codegen.opcodes import in_single
    from lie_codegen.codegen.templates import render
    from lie_codegen.flow.magnus.group_view import group_view, reverse_view

    view = (reverse_view if stem == "magnus_pullback" else group_view)(group)
    names = (f"{stem}.c", *_HEADERS, *_MORE.get(stem, ()))
    texts = {name: (template_folder() / name).read_text(encoding="utf-8") for name in names}
    texts["magnus_group.h"] = render("magnus_group.h.jinja", group=view)
    if stem == "magnus_single":
        return {name: text if name in _IN_DOUBLES else in_single(text) for name, text in texts.items()}
    return texts


def _opened(group: MatrixGroup, stem: str) -> ctypes.CDLL | None:
    """A C file with the headers of the Magnus steps and the one made for the group, compiled."""

    try:
        path = build_source(
            lambda: magnus_files(group, stem), f"{stem}.c", namespace=f"{group.name}_{stem}", definition=f"{stem}\n{group.definition_text}",
            more_flags=("-O3",) if group.dim <= _SMALL else (),
        )  # fmt: skip
    except CompileError:
        return None
    return None if path is None else load_library(path)
