"""The free asymmetric rigid body in exact form: Euler's coefficients, the paper's axes, amplitudes, momentum.

    w1' = J1 w2 w3,  w2' = -J2 w3 w1,  w3' = J3 w1 w2,                      (3)
    J1 = (I2 - I3) / I1,  J2 = (I1 - I3) / I2,  J3 = (I1 - I2) / I3,        (4)
    w = (s1 G13 k Omega cn u, s2 G23 k Omega sn u, s3 Omega dn u),          (9), (10)
    u' = G13 G23 J3 Omega,  G_nk = +sqrt(J_n / J_k),  s1 s2 s3 = -1.        (11)

V. T. Coppola, The method of averaging for Euler's equations of rigid body motion; the root printed in Gamma_nk
as a fourth root is the positive square root.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeAlias

from lie_codegen.errors import InputError
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.formulas import formula, quantity
from lie_codegen.on_demand import sympy as sp
from lie_codegen.shapes import entries_of

#: The slow time eps t, on which moments of inertia and perturbations may depend.
TAU = sp.Symbol("tau", real=True)
#: Two moments of inertia closer than this, relative to the middle one, make a symmetric body.
SYMMETRY_MARGIN = 1e-3

Triple: TypeAlias = "tuple[sp.Expr, sp.Expr, sp.Expr]"


@dataclass(frozen=True, eq=False, repr=False)
class PrincipalBody(Saved):
    """Principal moments of inertia in the user's axes, and the choice of the paper's axes and signs.

    Attributes:
        inertia: (I_1, I_2, I_3) [kg m^2] in the user's axes; constants or expressions in tau.
        axes: for the paper's axis n = 1, 2, 3 (user's index 0..2, sign): w_n = sign * omega[index], right-handed;
            the middle moment is the paper's second.
        signs: (s1, s2, s3) of (9), each +1 or -1, product -1.

    Raises:
        InputError: moments that are not positive, violate the triangle inequality or belong to a (nearly) symmetric
            body; signs whose product is not -1.
    """

    inertia: Triple
    axes: tuple[tuple[int, int], tuple[int, int], tuple[int, int]]
    signs: tuple[int, int, int]

    def __post_init__(self) -> None:
        if (
            len(self.signs) != 3
            or any(s not in (1, -1) for s in self.signs)
            or self.signs[0] * self.signs[1] * (self.signs[2]) != -1
        ):
            raise InputError(f"signs {self.signs}: three of +1 and -1 whose product is -1, as in (1, -1, 1)")
        check_moments([float(value.subs(TAU, 0)) for value in self.inertia])

    @cached_property
    def moments(self) -> Triple:
        """(I1, I2, I3) along the paper's axes."""
        first, second, third = (self.inertia[index] for index, _ in self.axes)
        return first, second, third

    @cached_property
    def coefficients(self) -> Triple:
        """(J1, J2, J3), all of one sign, (4)."""
        a, b, c = self.moments
        return (b - c) / a, (a - c) / b, (a - b) / c

    def gamma(self, n: int, k: int) -> sp.Expr:
        """Gamma_nk = sqrt(J_n / J_k)."""
        return sp.sqrt(sp.cancel(self.coefficients[n - 1] / self.coefficients[k - 1]))

    def small_gamma(self, n: int, k: int) -> sp.Expr:
        """gamma_nk = (I_n / I_k) Gamma_nk, (14) with the positive square root."""
        return self.moments[n - 1] / self.moments[k - 1] * self.gamma(n, k)

    def gamma_rate(self, n: int, k: int) -> sp.Expr:
        """d ln(Gamma_nk) / dtau, zero for constant inertia."""
        ratio = sp.cancel(self.coefficients[n - 1] / self.coefficients[k - 1])
        return sp.cancel(sp.diff(ratio, TAU) / ratio / 2)

    @property
    def is_constant(self) -> bool:
        """Whether the moments of inertia do not depend on tau."""
        return not any(value.has(TAU) for value in self.inertia)

    def to_paper(self, vector: Sequence[Any]) -> list[Any]:
        """Components along the paper's axes."""
        return [_signed(sign, vector[index]) for index, sign in self.axes]

    def to_user(self, vector: Sequence[Any]) -> list[Any]:
        """Components along the user's axes."""
        result: list[Any] = [None, None, None]
        for (index, sign), component in zip(self.axes, vector, strict=True):
            result[index] = _signed(sign, component)
        return result

    def unperturbed_acceleration(self, omega: Sequence[Any]) -> list[Any]:
        """(J1 w2 w3, -J2 w3 w1, J3 w1 w2) along the paper's axes."""
        j, w = self.coefficients, omega
        return [j[0] * w[1] * w[2], -j[1] * w[2] * w[0], j[2] * w[0] * w[1]]


def principal_body(
    inertia: Sequence[Any], *, axis: str | None = None, signs: Sequence[int] = (1, -1, 1), rates: Any = None
) -> PrincipalBody:
    """A body from moments of inertia (numbers or formulas in tau) and the axis the motion circles.

    Args:
        inertia: three moments in the user's axes, all different.
        axis: "max" or "min": the axis of largest or of smallest inertia is the paper's third (Table 1: "max" if
            I = L^2 / 2T exceeds the middle moment). None takes the given order where the middle moment is the second
            (the third axis is then the paper's third), and "max" otherwise.
        signs: (s1, s2, s3) with product -1; s3 is the sign of the spin about the third axis.
        rates: dI/dtau, added to the moments as rates * tau.

    Raises:
        InputError: for another axis, and as `PrincipalBody`.
        ShapeError: moments, signs or rates that are not three.
    """
    given = entries_of(inertia, 3, "inertia")
    moments = [formula(value, {"tau": TAU}, f"inertia {n + 1}") for n, value in enumerate(given)]
    if rates is not None:
        moments = [
            m + quantity(rate, f"rate {n + 1}") * TAU
            for n, (m, rate) in enumerate(zip(moments, entries_of(rates, 3, "rates"), strict=True))
        ]
    start = [float(value.subs(TAU, 0)) for value in moments]
    check_moments(start)
    if axis not in (None, "max", "min"):
        raise InputError(f"axis {axis!r}: expected 'max' or 'min' (the axis of inertia that the motion circles)")
    middle = sorted(range(3), key=start.__getitem__)[1]
    third = 2 if axis is None and middle == 1 else start.index(min(start) if axis == "min" else max(start))
    first = 3 - middle - third
    # a signed permutation of determinant +1 keeps the axes right-handed
    even = (first, middle, third) in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    axes = ((first, 1), (middle, 1 if even else -1), (third, 1))
    a, b, c = moments
    return PrincipalBody((a, b, c), axes, tuple(int(s) for s in entries_of(signs, 3, "signs")))  # type: ignore[arg-type]


def check_moments(moments: Sequence[float]) -> None:
    """Refuse moments of no body, and of a symmetric one, with the reason.

    Raises:
        InputError: as said.
    """
    low, middle, high = sorted(moments)
    if not (low > 0 and high < float("inf")):
        raise InputError(f"moments of inertia {tuple(moments)}: all must be positive and finite")
    if high > (low + middle) * (1 + 1e-12):
        raise InputError(f"moments of inertia {tuple(moments)}: no body has one above the sum of the other two")
    for lower, upper in pairwise((low, middle, high)):
        if upper - lower < SYMMETRY_MARGIN * middle:
            raise InputError(
                f"moments of inertia {tuple(moments)}: {lower:g} and {upper:g} differ by less than "
                f"{SYMMETRY_MARGIN:g} of the middle one; for a (nearly) symmetric body the unperturbed motion is a "
                "harmonic oscillator and the amplitude ratios sqrt(J_n / J_k) degenerate: average with trigonometric "
                "functions instead"
            )


def _signed(sign: int, value: Any) -> Any:
    return value if sign == 1 else -value
