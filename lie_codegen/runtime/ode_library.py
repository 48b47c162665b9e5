"""The compiled loops of templates/ode.c: their records, and the library."""

from __future__ import annotations

import ctypes
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.pair_headers import dense_headers, pair_headers
from lie_codegen.runtime.sources import build_source

CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)


class FieldRecord(ctypes.Structure):
    """`Field` of templates/ode.c."""

    _fields_ = [("call", ctypes.c_void_p), ("other", ctypes.c_void_p)] + [
        (n, ctypes.c_ssize_t) for n in ("size", "inputs", "state", "time", "outputs")
    ] + [("in_", ctypes.c_void_p), ("out", ctypes.c_void_p)]  # fmt: skip


class Rules(ctypes.Structure):
    """`Rules` of templates/ode.c."""

    _fields_ = [
        ("rtol", ctypes.c_double),
        ("atol", ctypes.c_void_p),
        ("first", ctypes.c_double),
        ("longest", ctypes.c_double),
        ("direction", ctypes.c_void_p),
        ("events", ctypes.c_ssize_t),
    ]


def pointers(*arrays: Array | NDArray[np.intp]) -> list[ctypes.c_void_p]:
    """Where the entries of the arrays are."""
    return [ctypes.c_void_p(np.ascontiguousarray(each).ctypes.data) for each in arrays]


@lru_cache(maxsize=1)
def ode_library() -> ctypes.CDLL | None:
    """The compiled loops; None where there is no compiler."""

    def files() -> dict[str, str]:
        return {"ode.c": (template_folder() / "ode.c").read_text(encoding="utf-8"), **pair_headers(), **dense_headers()}

    try:
        path = build_source(files, "ode.c", namespace="lie_codegen_ode", definition="ode")
    except CompileError:
        return None
    if path is None:
        return None
    library = load_library(path)
    for name in ("run", "at", "fixed"):
        library[f"lie_codegen_ode_{name}"].restype = ctypes.c_int
    library.lie_codegen_ode_work.restype = ctypes.c_ssize_t
    library.lie_codegen_ode_work.argtypes = [ctypes.c_ssize_t, ctypes.c_ssize_t]
    return library
