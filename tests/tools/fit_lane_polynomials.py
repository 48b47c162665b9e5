"""Fits the polynomials of the lane mathematics and writes lie_codegen/codegen/lane_coefficients.py.

    python tests/tools/fit_lane_polynomials.py [--check]

Remez's exchange in 60 digits minimises the largest weighted error; then the coefficients become doubles one by one,
from the most important, and the rest is fitted again around what the rounding left (on intervals that start at 0).
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np

OUTPUT = Path(__file__).resolve().parents[2] / "lie_codegen" / "codegen" / "lane_coefficients.py"
Function = Callable[[Any], Any]


@dataclass(frozen=True)
class Fit:
    """p(z) ~ value(z) on [low, high] with `count` coefficients; weight(z) times the error counts. `real` rounds a coefficient."""

    name: str
    about: str
    value: Function
    weight: Function
    low: Any
    high: Any
    count: int
    real: Function = float


def single(value: Any) -> float:
    """The float nearest, in the digits that tell it."""
    return float(str(np.float32(float(value))))


def series(terms: Sequence[Any]) -> Function:
    return lambda z: mp.polyval(list(reversed(terms)), z)


def fits() -> list[Fit]:
    def terms(rule: Function, count: int = 40) -> Function:
        return series([rule(k) for k in range(count)])

    quarter = (mp.pi / 4 * mp.mpf("1.0001")) ** 2
    half_log2 = mp.log(2) / 2 * mp.mpf("1.0001")
    eighth = mp.tan(mp.pi / 8) ** 2 * mp.mpf("1.0001")
    sine = terms(lambda k: (-1) ** (k + 1) / mp.factorial(2 * k + 3))
    cosine = terms(lambda k: (-1) ** k / mp.factorial(2 * k + 4))
    growth = terms(lambda k: 1 / mp.factorial(k + 2))
    logarithm = terms(lambda k: mp.mpf(2) / (2 * k + 3), 60)
    arctangent = terms(lambda k: mp.mpf((-1) ** (k + 1)) / (2 * k + 3), 90)
    arcsine = terms(lambda k: mp.binomial(2 * k + 2, k + 1) / mp.mpf(4) ** (k + 1) / (2 * k + 3), 120)
    return [
        Fit("SIN", "sin r = r + r z p(z), z = r^2, |r| <= pi/4", sine, lambda z: z / (1 + z * sine(z)), 0, quarter, 6),
        Fit(
            "COS",
            "cos r = 1 - z/2 + z^2 p(z), z = r^2, |r| <= pi/4",
            cosine,
            lambda z: z * z / (1 - z / 2 + z * z * cosine(z)),
            0,
            quarter,
            6,
        ),
        Fit(
            "EXPM1",
            "e^r - 1 = r + r^2 p(r), |r| <= log(2)/2",
            growth,
            lambda r: 1 / (1 + r * growth(r)),
            -half_log2,
            half_log2,
            11,
        ),
        Fit(
            "LOG",
            "log((1+s)/(1-s)) = 2 s + s z p(z), z = s^2, |s| <= 3 - sqrt(8)",
            logarithm,
            lambda z: z / (2 + z * logarithm(z)),
            0,
            eighth**2,
            7,
        ),
        Fit(
            "ATAN",
            "atan t = t + t z p(z), z = t^2, |t| <= tan(pi/8)",
            arctangent,
            lambda z: z / (1 + z * arctangent(z)),
            0,
            eighth,
            12,
        ),
        Fit(
            "ASIN",
            "asin t = t + t z p(z), z = t^2, |t| <= 1/2",
            arcsine,
            lambda z: z / (1 + z * arcsine(z)),
            0,
            mp.mpf("0.2501"),
            14,
        ),
    ]


def float_fits() -> list[Fit]:
    """Sine and cosine for floats: their own products are rounded at 2^-24."""
    return [replace(fit, count=3, real=single) for fit in fits() if fit.name in ("SIN", "COS")]


def remez(value: Function, weight: Function, low: Any, high: Any, count: int) -> list[Any]:
    """The coefficients, lowest first, that minimise max |weight (value - p)|."""
    middle, radius = (mp.mpf(low) + high) / 2, (mp.mpf(high) - low) / 2
    nodes = [middle - radius * mp.cos(mp.pi * (2 * i + 1) / (2 * count + 2)) for i in range(count + 1)]
    grid = [middle - radius * mp.cos(mp.pi * i / (24 * count)) for i in range(24 * count + 1)]
    coefficients: list[Any] = []
    for _ in range(6):
        rows = mp.matrix(count + 1, count + 1)
        right = mp.matrix(count + 1, 1)
        for i, x in enumerate(nodes):
            for k in range(count):
                rows[i, k] = weight(x) * x**k
            rows[i, count] = (-1) ** i
            right[i] = weight(x) * value(x)
        coefficients = list(mp.lu_solve(rows, right))[:count]
        errors = [weight(x) * (value(x) - mp.polyval(coefficients[::-1], x)) for x in grid]
        nodes = exchange(grid, errors, count + 1) or nodes
    return coefficients


def exchange(grid: Sequence[Any], errors: Sequence[Any], count: int) -> list[Any] | None:
    """The extremes of an alternating error; None if there are too few."""
    peaks: list[int] = []
    for i, error in enumerate(errors):
        if peaks and (errors[peaks[-1]] > 0) == (error > 0):
            if abs(error) > abs(errors[peaks[-1]]):
                peaks[-1] = i
        elif error != 0:
            peaks.append(i)
    while len(peaks) > count:
        peaks.pop(0 if abs(errors[peaks[0]]) < abs(errors[peaks[-1]]) else -1)
    return [grid[i] for i in peaks] if len(peaks) == count else None


def rounded(fit: Fit) -> tuple[list[float], float]:
    """Doubles, lowest first, and log2 of the largest weighted error."""
    done: list[float] = []
    value, weight = fit.value, fit.weight
    for count in range(fit.count, 0, -1):
        best = remez(value, weight, fit.low, fit.high, count)
        if fit.low != 0:
            done = [fit.real(each) for each in best]
            break
        first = fit.real(best[0])
        done.append(first)
        value = shifted(value, first)
        weight = times(weight)
    grid = [fit.low + (mp.mpf(fit.high) - fit.low) * i / 2000 for i in range(2001)]
    worst = max(abs(fit.weight(x) * (fit.value(x) - mp.polyval(done[::-1], x))) for x in grid)
    return done, float(mp.log(worst, 2))


def shifted(value: Function, first: float) -> Function:
    return lambda z: (value(z) - first) / (z if z != 0 else mp.mpf(10) ** -30)


def times(weight: Function) -> Function:
    return lambda z: weight(z) * (z if z != 0 else mp.mpf(10) ** -30)


def split(name: str, value: Any, bits: Sequence[int]) -> str:
    """A constant as a sum of doubles, the first parts of so many bits each."""
    parts = []
    for width in bits:
        exponent = mp.floor(mp.log(abs(value), 2)) + 1 - width
        part = mp.floor(value / mp.mpf(2) ** exponent) * mp.mpf(2) ** exponent if width < 53 else mp.mpf(float(value))
        parts.append(float(part))
        value -= part
    return f"{name}: tuple[float, ...] = ({', '.join(repr(part) for part in parts)})"


def text() -> str:
    """The Python file."""
    lines = [
        '"""Coefficients of the lane mathematics, lowest first; written by tests/tools/fit_lane_polynomials.py."""',
        "",
        "from __future__ import annotations",
        "",
        "#: name -> (what it approximates, coefficients, log2 of the largest relative error).",
        *table("POLYNOMIALS", fits()),
        "",
        "#: For lanes of floats.",
        *table("FLOAT_POLYNOMIALS", float_fits()),
        "",
        "#: pi/2 and log 2 as sums: full doubles where products are fused, else parts whose multiples are exact.",
        split("HALF_PI", mp.pi / 2, (53, 53, 53)),
        split("HALF_PI_PARTS", mp.pi / 2, (33, 33, 33, 53)),
        split("LOG2_PARTS", mp.log(2), (32, 53)),
        "#: pi/2 as a sum of floats.",
        split("HALF_PI_FLOATS", mp.pi / 2, (24, 24, 24)),
        "",
    ]
    return "\n".join(lines)


def table(name: str, wanted: Sequence[Fit]) -> list[str]:
    """The lines of a dictionary."""
    lines = [f"{name}: dict[str, tuple[str, tuple[float, ...], float]] = {{"]
    for fit in wanted:
        coefficients, error = rounded(fit)
        lines += [f'    "{fit.name}": (', f'        "{fit.about}",', "        ("]
        lines += [f"            {coefficient!r}," for coefficient in coefficients]
        lines += ["        ),", f"        {error:.1f},", "    ),"]
    return [*lines, "}"]


def main() -> int:
    mp.mp.dps = 60
    fresh = text()
    if "--check" in sys.argv[1:]:
        return int(ast.dump(ast.parse(OUTPUT.read_text(encoding="utf-8"))) != ast.dump(ast.parse(fresh)))
    OUTPUT.write_text(fresh, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
