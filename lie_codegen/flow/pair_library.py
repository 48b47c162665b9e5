"""The compiled loops of templates/pair853.c: their arguments as C reads them, and the library."""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError, ComputationError
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.pair_headers import group_headers
from lie_codegen.runtime.sources import build_source

#: Of the pair 8(5,3).
STAGES = 12
#: Results of a run: reached the end, more steps are wanted, no step is short enough, a state is no longer finite, too many steps.
DONE, FULL, STUCK, LOST, MANY = range(5)


def refuse(status: int, t: float, atol: float, most: int, where: str) -> None:
    """Say why a run cannot go on.

    Raises:
        ComputationError: it cannot.
    """
    if status == MANY:
        raise ComputationError(
            f"{where}: {most} steps do not bring the error below {atol:g} beyond t = {t:.9g}, or the state grows without bound; "
            "shorten the time, loosen the tolerance, or check the gains"
        )
    if status == LOST:
        raise ComputationError(
            f"{where}: the state is no longer finite behind t = {t:.9g}; check the gains, or shorten the time"
        )
    if status == STUCK:
        raise ComputationError(f"{where}: no step is short enough at t = {t:.9g}; is the force smooth there?")


class Pair(ctypes.Structure):
    """`struct pair` of templates/pair853.c."""

    _fields_ = [
        *((n, ctypes.c_void_p) for n in ("rate", "move", "lift")),
        *((n, ctypes.c_ssize_t) for n in ("packed", "group", "front", "quaternions", "size", "numbers")), ("number", ctypes.c_void_p),
        *((n, ctypes.c_double) for n in ("t", "t_low", "h", "rtol", "atol", "reach", "longest")),
        *((n, ctypes.c_void_p) for n in ("X", "y", "times")),
        *((n, ctypes.c_ssize_t) for n in ("count", "next")),
        *((n, ctypes.c_void_p) for n in ("X_out", "y_out", "knot_t", "knot_h", "knot_X", "knot_y", "knot_slope", "knot_theta")),
        *((n, ctypes.c_ssize_t) for n in ("room", "knots")), ("work", ctypes.c_void_p),
        *((n, ctypes.c_ssize_t) for n in ("steps", "rejected", "evaluations", "algebra", "brackets")),
        *((n, ctypes.c_void_p) for n in ("bracket_index", "bracket_c", "dense", "both")),
    ]  # fmt: skip


class Twice(ctypes.Structure):
    """`Twice` of templates/pair853.c."""

    _fields_ = [
        ("pair", ctypes.c_void_p), ("start", ctypes.c_void_p), ("tolerance", ctypes.c_double * 4),
        ("shorter", ctypes.c_double), ("most", ctypes.c_double), ("apart", ctypes.c_ssize_t),
        *((n, ctypes.c_void_p) for n in ("other", "knots", "found")),
    ]  # fmt: skip


@lru_cache(maxsize=1)
def pair_library() -> Any:
    """pair853.c, loaded; None where there is no compiler."""

    def files() -> dict[str, str]:
        text = (template_folder() / "pair853.c").read_text(encoding="utf-8")
        return {
            "pair853.c": text,
            **group_headers(),
            **{
                name: (template_folder() / name).read_text(encoding="utf-8")
                for name in ("pair_hermite.h", "pair_two.h")
            },
        }

    try:
        path = build_source(files, "pair853.c", namespace="pair853", definition="pair853", more_flags=("-O3",))
    except CompileError:
        return None
    if path is None:
        return None
    library, size, pointer = load_library(path), ctypes.c_ssize_t, ctypes.c_void_p
    library.pair_run.restype, library.pair_run.argtypes = size, (pointer, size)
    library.gauss_run.restype, library.gauss_run.argtypes = size, (pointer, size, size)
    library.pair_twice.restype, library.pair_twice.argtypes = size, (pointer,)
    library.between_size.restype, library.between_size.argtypes = size, (size, size)
    library.pair_between.restype, library.pair_between.argtypes = (
        ctypes.c_double,
        (pointer, size, ctypes.c_double),
    )
    library.pair_lift.restype, library.pair_lift.argtypes = None, (pointer,)
    library.pair_within.restype, library.pair_within.argtypes = (
        None,
        (pointer, size, pointer, pointer, pointer, pointer),
    )
    return library


def compiled_pair() -> Any:
    """pair853.c, loaded.

    Raises:
        CompileError: there is no compiler.
    """
    library = pair_library()
    if library is None:
        raise CompileError("the pair 8(5,3) needs a C compiler")
    return library
