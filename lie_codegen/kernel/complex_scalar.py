"""Complex numbers over any real arithmetic, as pairs (re, im)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Complex:
    """re + i im, where re and im are scalars of one `Arithmetic` (or plain Python numbers)."""

    re: Any
    im: Any = 0

    @staticmethod
    def of(value: Any) -> Complex:
        """A Complex from a Complex, a Python complex, or a real scalar."""
        if isinstance(value, Complex):
            return value
        if isinstance(value, complex):
            return Complex(value.real, value.imag)
        return Complex(value, 0)

    def __add__(self, other: Any) -> Complex:
        o = Complex.of(other)
        return Complex(self.re + o.re, self.im + o.im)

    __radd__ = __add__  # addition commutes, entry by entry

    def __neg__(self) -> Complex:
        return Complex(-self.re, -self.im)

    def __sub__(self, other: Any) -> Complex:
        return self + (-Complex.of(other))

    def __rsub__(self, other: Any) -> Complex:
        return Complex.of(other) + (-self)

    def __mul__(self, other: Any) -> Complex:
        o = Complex.of(other)
        return Complex(self.re * o.re - self.im * o.im, self.re * o.im + self.im * o.re)

    __rmul__ = __mul__  # and so does the product of pairs of commuting scalars

    def __truediv__(self, other: Any) -> Complex:
        o = Complex.of(other)
        norm = o.re * o.re + o.im * o.im
        return Complex((self.re * o.re + self.im * o.im) / norm, (self.im * o.re - self.re * o.im) / norm)

    def __rtruediv__(self, other: Any) -> Complex:
        return Complex.of(other) / self

    def conjugate(self) -> Complex:
        """re - i im."""
        return Complex(self.re, -self.im)
