"""The controls of a plan as numbers: Chebyshev polynomials piece by piece, or a Fourier series where they are one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.steering.plan import Plan

#: Degree of the polynomials of a piece; their last coefficients, relative to the largest control, when they stand for it.
_DEGREE, _RESOLVED = 12, 1e-11
#: What may be left out at the end of a series, and what a term must exceed to be kept.
_NEGLIGIBLE = 1e-14
#: A piece is halved so often at most; smooth controls need three or four.
_DEPTH = 12
_MOST_PIECES, _MOST_HARMONICS = 4096, 64
FORMS = ("auto", "table", "fourier")


@dataclass(frozen=True)
class PlanTable:
    """u(t) of the driven components.

    Attributes:
        places: (m,) which components of u are driven.
        edges: (p + 1,) where pieces begin and end.
        coefficients: (p, m, terms) of Chebyshev polynomials over each piece, or (1, m, 1 + 2 K): mean, cos, sin, cos 2, ...
        is_fourier: which of the two.
        error: largest difference from the plan where both were compared.
    """

    places: tuple[int, ...]
    edges: Array
    coefficients: Array
    is_fourier: bool
    error: float

    def piece(self, number: int, t: Array) -> Array:
        """(k, m) the formula of one piece."""
        if self.is_fourier:
            angle = 2 * np.pi / self.edges[-1] * np.asarray(t, dtype=float)
            waves = [np.ones_like(angle)]
            for k in range(1, (self.coefficients.shape[2] + 1) // 2):
                waves += [np.cos(k * angle), np.sin(k * angle)]
            return np.asarray(np.stack(waves, axis=-1) @ self.coefficients[0].T)
        first, last = self.edges[number : number + 2]
        s = (2 * np.asarray(t, dtype=float) - first - last) / (last - first)
        return np.asarray(chebyshev.chebval(s, self.coefficients[number].T).T)


def plan_table(plan: Plan, form: str = "auto") -> PlanTable:
    """The table of a plan, within 1e-11 of the largest control.

    Args:
        plan: whose u(t) is smooth between its breakpoints.
        form: "table"; "fourier", for controls that are a Fourier series over the duration; "auto" for the shorter one.

    Raises:
        InputError: no such form; "fourier" of controls that are no such series of 64 harmonics.
        ComputationError: the controls are not smooth between their breakpoints.
    """
    if form not in FORMS:
        raise InputError(f"form is one of {', '.join(FORMS)}, got {form!r}")
    sampled = plan.u(np.linspace(0, plan.duration, 257))
    # a component with no control has zeros everywhere; one with a control may have them by accident, and is kept
    named = {plan.group.labels.index(label) for label in plan.controls if label in plan.group.labels}
    places = tuple(i for i in range(plan.group.dim) if i in named or np.any(sampled[:, i]))
    size = float(np.max(np.abs(sampled), initial=0.0)) or 1.0
    series = None if form == "table" else _fourier(plan, places, size)
    if form == "fourier" and series is None:
        raise InputError("the controls are no Fourier series of 64 harmonics over the duration: take form='table'")
    table = None if form == "fourier" else _pieces(plan, places, size, best=series)
    found = [each for each in (table, series) if each is not None]
    return min(found, key=lambda each: each.coefficients.size)


def _fourier(plan: Plan, places: tuple[int, ...], size: float) -> PlanTable | None:
    """By the discrete transform, exact for a series; a series has no jumps but those that nothing tells from none."""
    count = 4 * _MOST_HARMONICS
    t = plan.duration * np.arange(count) / count
    spectrum = np.fft.rfft(plan.u(t)[:, list(places)], axis=0) / count
    strong = np.flatnonzero(np.max(np.abs(spectrum), axis=1) > _RESOLVED * size)
    harmonics = int(strong[-1]) if strong.size else 0
    if harmonics > _MOST_HARMONICS:
        return None
    kept = spectrum[1 : harmonics + 1]
    columns = np.stack([2 * kept.real, -2 * kept.imag], axis=1).reshape(2 * harmonics, len(places))
    coefficients = np.concatenate([spectrum[:1].real, columns]).T[None]
    coefficients[np.abs(coefficients) < _NEGLIGIBLE * size] = 0.0
    table = PlanTable(places, np.array([0.0, plan.duration]), coefficients, True, 0.0)
    # between the nodes of the transform: there controls that are no series differ
    others = plan.duration * np.linspace(0, 1, 1009)
    error = float(np.max(np.abs(table.piece(0, others) - plan.u(others)[:, list(places)])))
    return None if error > 10 * _RESOLVED * size else PlanTable(places, table.edges, coefficients, True, error)


def _pieces(plan: Plan, places: tuple[int, ...], size: float, best: PlanTable | None) -> PlanTable | None:
    marks = np.asarray(plan.u.breakpoints, dtype=float)
    inner = np.unique(marks[(marks > 1e-12 * plan.duration) & (marks < plan.duration * (1 - 1e-12))])
    # twin breakpoints, one rounding apart, are one
    inner = inner[np.concatenate([[True], np.diff(inner) > 1e-12 * plan.duration])] if inner.size else inner
    ends = np.concatenate([[0.0], inner, [plan.duration]])
    pairs, rows, worst = [], [], 0.0
    waiting = [(float(a), float(b), 0) for a, b in pairwise(ends)][::-1]
    s = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
    check = np.linspace(-0.995, 0.995, 2 * _DEGREE + 1)
    inverse = np.linalg.inv(chebyshev.chebvander(s, _DEGREE))
    while waiting:
        first, last, depth = waiting.pop()
        middle, half = (first + last) / 2, (last - first) / 2
        found = inverse @ plan.u(middle + half * s)[:, list(places)]
        missed = chebyshev.chebval(check, found).T - plan.u(middle + half * check)[:, list(places)]
        error = float(np.max(np.abs(missed), initial=0.0))
        if error <= _RESOLVED * size:
            pairs.append((first, last))
            rows.append(found)
            worst = max(worst, error)
        elif depth < _DEPTH and len(pairs) + len(waiting) < _MOST_PIECES:
            waiting += [(middle, last, depth + 1), (first, middle, depth + 1)]
        elif best is not None:
            return None
        else:
            raise ComputationError(
                f"the controls are not smooth near t = {middle:g} between their breakpoints: name those in plan.u.breakpoints"
            )
    coefficients = np.array(rows).swapaxes(1, 2)
    large = np.max(np.abs(coefficients), axis=(0, 1)) > 1e-13 * size
    terms = 1 + int(np.flatnonzero(large)[-1]) if np.any(large) else 1
    edges = np.array([0.0, *(last for _, last in pairs)])
    return PlanTable(places, edges, np.ascontiguousarray(coefficients[:, :, :terms]), False, worst)
