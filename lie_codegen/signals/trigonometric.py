"""Trigonometric polynomials with exact coefficients: sum_k a_k cos(k . theta) + b_k sin(k . theta).

theta = (tau, phi_1, .., phi_r): the scaled time tau = 2 pi t / T and symbolic phases. A wave vector k is packed in one
signed integer, frequency + sum_j m_j BASE^j, so that products add and subtract keys; only keys >= 0 are kept
(cos(-x) = cos x, sin(-x) = -sin x), which makes the form unique.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from lie_codegen.signals.coefficients import Coefficient

#: Room for frequencies and phase multiples of magnitude below 2^23.
BITS = 24
_HALF = 1 << (BITS - 1)
_BASE = 1 << BITS

#: packed wave vector -> [cosine coefficient, sine coefficient]
Wave = dict[int, list[Coefficient]]
Multiply = Callable[[Coefficient, Coefficient], Coefficient]


def pack(frequency: int, phases: tuple[int, ...] = ()) -> int:
    """The key of a wave vector; it may be negative."""
    return frequency + sum(m << (BITS * (j + 1)) for j, m in enumerate(phases))


def frequency_of(key: int) -> int:
    """The multiple of tau in a key."""
    return ((key + _HALF) & (_BASE - 1)) - _HALF


def unpack(key: int, phases: int) -> tuple[int, ...]:
    """(frequency, multiples of the phases)."""
    numbers = []
    for _ in range(phases + 1):
        low = frequency_of(key)
        numbers.append(low)
        key = (key - low) >> BITS
    return tuple(numbers)


def add_term(wave: Wave, key: int, cosine: Coefficient, sine: Coefficient) -> None:
    """wave += cosine cos(key) + sine sin(key), whatever the sign of the key."""
    if key < 0:
        key, sine = -key, -sine
    entry = wave.get(key)
    if entry is None:
        wave[key] = [cosine, sine if key else 0]
    else:
        entry[0] = entry[0] + cosine
        if key:
            entry[1] = entry[1] + sine


def clean(wave: Wave) -> Wave:
    """The wave without zero terms."""
    return {key: entry for key, entry in wave.items() if entry[0] or entry[1]}


def products(x: Wave, y: Wave) -> int:
    """How many products of terms x y takes."""
    return _terms(x) * _terms(y)


def _terms(wave: Wave) -> int:
    return sum(1 if isinstance(part, int) else len(part) for entry in wave.values() for part in entry if part)


def add_scaled(target: Wave, wave: Wave, factor: Coefficient, multiply: Multiply) -> None:
    """target += factor wave."""
    for key, (cosine, sine) in wave.items():
        add_term(target, key, multiply(factor, cosine) if cosine else 0, multiply(factor, sine) if sine else 0)


def add_twice_product(target: Wave, x: Wave, y: Wave, sign: int, multiply: Multiply) -> None:
    """target += 2 sign x y (the factor 2 keeps integers integers)."""
    for k, (a, b) in x.items():
        if sign < 0:
            a, b = -a, -b
        for m, (c, d) in y.items():
            _add_pair(target, k, a, b, m, c, d, multiply)


def add_twice_product_mean(target: Wave, x: Wave, y: Wave, sign: int, multiply: Multiply) -> None:
    """target += 2 sign (mean over tau of x y)."""
    by_frequency: dict[int, list[tuple[int, list[Coefficient]]]] = {}
    for m, entry in y.items():
        by_frequency.setdefault(abs(frequency_of(m)), []).append((m, entry))
    product: Wave = {}
    for k, (a, b) in x.items():
        if sign < 0:
            a, b = -a, -b
        for m, (c, d) in by_frequency.get(abs(frequency_of(k)), ()):
            _add_pair(product, k, a, b, m, c, d, multiply)
    for key, (cosine, sine) in product.items():
        if frequency_of(key) == 0:
            add_term(target, key, cosine, sine)


def _add_pair(target: Wave, k: int, a: Any, b: Any, m: int, c: Any, d: Any, multiply: Multiply) -> None:
    """(a cos k + b sin k)(c cos m + d sin m), doubled, into target."""
    ac = multiply(a, c) if a and c else 0
    bd = multiply(b, d) if b and d else 0
    ad = multiply(a, d) if a and d else 0
    bc = multiply(b, c) if b and c else 0
    add_term(target, k + m, ac - bd, ad + bc)
    add_term(target, k - m, ac + bd, bc - ad)


def mean(wave: Wave) -> Wave:
    """The terms without tau."""
    return {key: list(entry) for key, entry in wave.items() if frequency_of(key) == 0}


def frequencies(wave: Wave) -> Iterator[int]:
    """The nonzero multiples of tau that occur."""
    return (abs(frequency_of(key)) for key in wave if frequency_of(key))
