"""The C headers that lane bodies need: lanes of doubles, and lanes of floats, whose records are the text of those of doubles."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from lie_codegen.codegen.lane_coefficients import (
    FLOAT_POLYNOMIALS,
    HALF_PI,
    HALF_PI_FLOATS,
    HALF_PI_PARTS,
    LOG2_PARTS,
    POLYNOMIALS,
)
from lie_codegen.codegen.lane_networks import networks
from lie_codegen.codegen.opcodes import c_float_literal, c_literal, in_single
from lie_codegen.codegen.templates import render

_Table = dict[str, tuple[str, tuple[float, ...], float]]


@dataclass(frozen=True)
class _Polynomial:
    about: str
    coefficients: tuple[str, ...]
    error: str


@cache
def lanes_header() -> str:
    """lie_codegen_lanes.h; the same for all kernels."""
    constants = {
        "two_over_pi": c_literal(2 / np.pi),
        "one_over_log2": c_literal(1 / np.log(2)),
        "half_pi": _literals(HALF_PI),
        "pi": _literals([2 * part for part in HALF_PI]),
        "quarter_pi": _literals([part / 2 for part in HALF_PI]),
        "half_pi_parts": _literals(HALF_PI_PARTS),
        "log2_parts": _literals(LOG2_PARTS),
    }
    return render("lanes.h.jinja", polynomials=_polynomials(POLYNOMIALS), constants=constants, **_records(8, "movntpd"))


@cache
def lanes_float_header() -> str:
    """lie_codegen_lanes_float.h, which includes the other."""
    constants = {
        "two_over_pi": c_float_literal(2 / np.pi),
        "half_pi": _literals(HALF_PI_FLOATS, c_float_literal),
    }
    records = in_floats(render("lanes_records.h.jinja", **_records(16, "movntps")))
    polynomials = _polynomials(FLOAT_POLYNOMIALS, c_float_literal)
    return render("lanes_float.h.jinja", polynomials=polynomials, constants=constants, records=records)


def in_floats(text: str) -> str:
    """C over lanes of doubles, written over lanes of floats."""
    return re.sub(r"\b(?:lcg|LCG)_", lambda found: {"lcg_": "lcf_", "LCG_": "LCF_"}[found.group()], in_single(text))


def _records(lanes: int, streaming: str) -> dict[str, object]:
    return {"networks": [networks(lanes >> k) for k in range(3)], "streaming": streaming, "item": 64 // lanes}


def _polynomials(table: _Table, literal: Callable[[float], str] = c_literal) -> list[tuple[str, _Polynomial]]:
    return [
        (name, _Polynomial(about, _literals(coefficients, literal), repr(error)))
        for name, (about, coefficients, error) in table.items()
    ]


def _literals(values: Sequence[float], literal: Callable[[float], str] = c_literal) -> tuple[str, ...]:
    return tuple(literal(float(value)) for value in values)
