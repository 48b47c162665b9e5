"""lc.average: the averaged system of X' = eps X hat(u(t)), of any order, as an object with exact coefficients."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.algebra.brackets import bracket
from lie_codegen.arrays import Array
from lie_codegen.averaging.areas import areas, moments
from lie_codegen.averaging.nilpotent import nilpotency_step
from lie_codegen.door import warn_caller
from lie_codegen.errors import AssumptionError, AssumptionWarning, InputError, NotFiniteError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.floquet_magnus import floquet_magnus
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic
from lie_codegen.signals.time_series import expressions_of, functions_of

#: form -> the orders it has.
FORMS = {"floquet": None, "product": (1, 2), "single": (1, 2, 3)}
_THEOREMS = {"product": "Theorem 3 (area rule)", "single": "Theorem 4 (single-exponential area rule)"}
_MOST = 32
#: Operations of the formulas that a notebook shows.
_SHOWN = 200


@dataclass(frozen=True, eq=False, repr=False)
class Averaged(Saved):
    """The average of X' = eps X hat(u(t)), X(0) = X0, with error O(eps^order) on [0, b / eps].

    floquet, any order p and any mean:  X0 exp(t sum_{q<=p} eps^q F_q) exp(sum_{q<p} eps^q Lambda_q(t)).
    product, u_av = 0:  X0 exp(g_1 A_1) .. exp(g_n A_n), g = eps^2 t F_2 + eps ut  (TR 93-59, Theorem 3).
    single, u_av = 0:  X0 exp(Z), Z = eps ut + eps^2 t F_2 (Theorem 4); with order 3, Z = eps ut + eps^2 a(t)
        + eps^3 t F_3 + eps^3 t/2 [F_2, ut], a = 1/2 int_0^t [ut, u]  (area-moment rule).
    Every form of order 1 is X0 exp(eps t u_av) (Theorem 2).

    Attributes:
        group, u, order, form: what was averaged and how.
        X0: (d, d) initial element.
        exact_F: F_1 .. F_p, each (n, 1), exact where the input is; F_1 = u_av, F_2 = sum Area_ij Gamma_ij / T if u_av = 0.
        exact_Lambda: () -> Lambda_1 .. Lambda_{p-1}, each (n, 1) in t; periodic, zero at t = 0.
    """

    group: MatrixGroup
    u: PeriodicInput
    order: int
    form: str
    X0: Array
    exact_F: tuple[sp.ImmutableMatrix, ...] = field(repr=False, compare=False, metadata={"derived": True})
    _calculus: Any = field(repr=False, compare=False, metadata={"derived": True})
    _signals: tuple[Any, ...] = field(repr=False, compare=False, metadata={"derived": True})

    @classmethod
    def restored(cls, group: MatrixGroup, u: PeriodicInput, order: int, form: str, X0: Array) -> Averaged:
        """The average of the same input again; what was warned of was warned of when it was first made."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AssumptionWarning)
            return average(group, u, order, form, X0=X0)

    def __reduce__(self) -> tuple[Any, ...]:
        return Averaged.restored, (self.group, self.u, self.order, self.form, self.X0)

    def _repr_latex_(self) -> str | None:
        """In a notebook: the mean velocity sum_q eps^q F_q, exact; None where it fills more than a line or two."""
        terms = [(sp.Symbol("varepsilon") ** q, sp.ImmutableMatrix(f)) for q, f in enumerate(self.exact_F, start=1)]
        if sum(sp.count_ops(f) for _, f in terms) > _SHOWN:
            return None
        text = " + ".join(f"{sp.latex(power)} {sp.latex(f)}" for power, f in terms)
        return rf"$\displaystyle \bar u = {text}$"

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """The symbolic amplitudes and phases that still have no value."""
        return self.u.symbols

    @cached_property
    def F(self) -> list[Array]:
        """[F_1, .., F_p], each (n,): log X(T) = T sum eps^q F_q + O(eps^{p+1}). [u unit^q time unit^(q-1)]

        Raises:
            InputError: if parameters have no values; see `at`.
        """
        self._need_values()
        return [np.array([float(value) for value in f]) for f in self.exact_F]

    @cached_property
    def exact_Lambda(self) -> tuple[sp.ImmutableMatrix, ...]:
        """Lambda_1 .. Lambda_{p-1}, each (n, 1), as expressions in t.

        Raises:
            InputError: for a sampled input; evaluate `Lambda` instead.
        """
        return expressions_of(self.u, self._calculus, self._signals)

    @cached_property
    def Lambda(self) -> list[Callable[[ArrayLike], Array]]:
        """[Lambda_1, .., Lambda_{p-1}]: functions of t, (...,) -> (..., n)."""
        return functions_of(self.u, self._calculus, self._signals)

    @cached_property
    def exact_areas(self) -> sp.ImmutableMatrix:
        """(n, n) Area_ij(T), TR 93-59, (21)."""
        return areas(self.u)

    @property
    def areas(self) -> Array:
        """(n, n) Area_ij = 1/2 int_0^T (ut_i u_j - ut_j u_i) dt."""
        self._need_values()
        return np.array(self.exact_areas.tolist(), dtype=float)

    @cached_property
    def exact_moments(self) -> sp.ImmutableDenseNDimArray:
        """(n, n, n) m_ijk(T)."""
        return moments(self.u)

    @property
    def moments(self) -> Array:
        """(n, n, n) m_ijk = 1/3 int_0^T (ut_i u_j - ut_j u_i) ut_k dt."""
        self._need_values()
        return np.array(self.exact_moments.tolist(), dtype=float)

    def rate(self, eps: ArrayLike) -> Array:
        """The mean velocity sum_q eps^q F_q: (...,) -> (..., n)."""
        scale = np.asarray(eps, dtype=float)[..., None]
        return sum((scale**q * f for q, f in enumerate(self.F, start=1)), np.zeros(self.group.dim))

    def coordinates(self, eps: float, t: ArrayLike) -> Array:
        """The exponents of the product (g) or single (Z) form: (...,) -> (..., n).

        Raises:
            InputError: for the floquet form of order 2 and more, which has two exponentials.
        """
        times = _finite(t, "t")[..., None]
        if self.form == "floquet" and self.order > 1:
            raise InputError("Averaged.coordinates: the floquet form has two exponentials; see F and Lambda")
        if self.order == 1:
            return np.asarray(times * eps * self.F[0])
        tilde = self.Lambda[0](times[..., 0])
        value = eps * tilde + eps**2 * times * self.F[1]
        if self.order == 2:
            return np.asarray(value)
        crossed = bracket(self.group.algebra, self.F[1], tilde)
        return np.asarray(value + eps**2 * self.Lambda[1](times[..., 0]) + eps**3 * times * (self.F[2] + crossed / 2))

    def state(self, eps: float, t: ArrayLike) -> Array:
        """The approximation of X(t): scalar t -> (d, d), (...,) -> (..., d, d).

        Raises:
            InputError: if parameters have no values; see `at`.
            NotFiniteError: if eps or t is NaN or infinite.
        """
        small, times = float(_finite(eps, "eps")), _finite(t, "t")
        hat = self.group.hat
        if self.form == "floquet" and self.order > 1:
            mean = expm(hat(times[..., None] * self.rate(small)))
            terms = [small**q * wave(times) for q, wave in enumerate(self.Lambda, start=1)]
            return np.asarray(self.X0 @ mean @ expm(hat(sum(terms, np.zeros(self.group.dim)))))
        exponents = self.coordinates(small, times)
        if self.form != "product" or self.order == 1:
            return np.asarray(self.X0 @ expm(hat(exponents)))
        result = self.X0
        for i, matrix in enumerate(self.group.basis):
            result = result @ expm(exponents[..., i, None, None] * matrix)
        return np.asarray(result)

    def at(self, **values: Any) -> Averaged:
        """The same average with numbers in place of parameters.

        Raises:
            InputError: for a name that is not a parameter.
        """
        return average(self.group, self.u.at(**values), self.order, self.form, X0=self.X0)

    @cached_property
    def next_rate_vanishes(self) -> bool:
        """Whether F_{p+1} = 0: the secular error, seen at whole periods, is then one order better."""
        further = _recursion(self.group, self.u, self.order + 1)
        return bool(self.u.waveform.vanishes(further[0], further[1][-1]))

    @cached_property
    def exact_flow(self) -> bool:
        """Whether the floquet form of this order is the solution itself: the algebra is nilpotent of step below p."""
        step = nilpotency_step(self.group.algebra)
        return self.form == "floquet" and step is not None and step < self.order

    def _need_values(self) -> None:
        if self.parameters:
            names = ", ".join(map(str, self.parameters))
            raise InputError(f"average: the parameters {names} have no values; see .exact_F, or .at({names}=...)")


def average(
    group: GroupLike, u: PeriodicLike, order: int = 2, form: str = "floquet", *, X0: ArrayLike | None = None
) -> Averaged:
    """Average X' = eps X hat(u(t)), X(0) = X0, with error O(eps^order) on [0, b / eps].

    Args:
        group: the group.
        u: n components, one for each basis element: a `PeriodicInput`, or a list of formulas of t.
        order: p; "product" has 1 and 2, "single" 1 to 3, "floquet" any.
        form: "floquet" (any mean), "product" (Theorem 3) or "single" (Theorem 4; both need u_av = 0 from order 2).
        X0: (d, d) initial element, the identity if not given; by left invariance it multiplies from the left.

    Raises:
        AssumptionError: a non-zero mean in an area rule.
        InputError: no such form or order.
        ShapeError: if u has not n components.
    """
    group, u = as_group(group, "average"), as_periodic(u, "average")
    if u.dim != group.dim:
        raise ShapeError(f"average: u has {u.dim} components, {group.name} has {group.dim}: {', '.join(group.labels)}")
    _check_form(form, order)
    if form != "floquet" and order > 1 and not u.zero_mean:
        raise AssumptionError(
            f"average: {_THEOREMS[form]} requires u_av = 0, and u_av = {list(u.exact_mean)}; use form='floquet', whose "
            "order holds with any mean (the printed form (45)-(46) is then only first order)"
        )
    _warn_of_jumps(u, form)
    calculus, rates, logarithms = _recursion(group, u, order)
    waveform = u.waveform
    exact = tuple(
        waveform.expressions(calculus, f, group.dim, time_symbol()) * waveform.omega ** (1 - q)
        for q, f in enumerate(rates, start=1)
    )
    return Averaged(group, u, order, form, _initial(group, X0), exact, calculus, tuple(logarithms))


def _recursion(group: MatrixGroup, u: PeriodicInput, order: int) -> tuple[Any, list[Any], list[Any]]:
    calculus, signal = u.waveform.calculus(group.algebra.table, group.dim)
    rates, logarithms = floquet_magnus(calculus, signal, order)
    return calculus, rates, logarithms


def _check_form(form: str, order: int) -> None:
    if form not in FORMS:
        raise InputError(f"average: no form {form!r}; choose one of {', '.join(map(repr, FORMS))}")
    if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= _MOST:
        raise InputError(f"average: order must be an integer from 1 to {_MOST}, got {order!r}")
    allowed = FORMS[form]
    if allowed is not None and order not in allowed:
        raise InputError(
            f"average: the form {form!r} has the orders {', '.join(map(str, allowed))}; use form='floquet' for {order}"
        )


def _warn_of_jumps(u: PeriodicInput, form: str) -> None:
    if u.jumps:
        theorem = _THEOREMS.get(form, "Theorem 2 (first order)")
        times = ", ".join(f"{b:g}" for b in u.jumps[:4])
        warn_caller(
            f"{theorem} of TR 93-59 asks for continuous derivatives; this input jumps or bends at t = {times}. The "
            "averages are those of the bounded, piecewise smooth input; check their order with order_check",
            AssumptionWarning,
        )


def _initial(group: MatrixGroup, X0: ArrayLike | None) -> Array:
    d = group.degree
    if X0 is None:
        return np.eye(d, dtype=complex if group.is_complex else float)
    start = _finite(X0, "X0", complex if group.is_complex else float)
    if start.shape != (d, d):
        raise ShapeError(f"average: X0 has shape {start.shape}; {group.name} needs ({d}, {d})")
    return start


def _finite(value: ArrayLike, name: str, kind: type = float) -> Array:
    try:
        array: Array = np.asarray(value, dtype=kind)
    except (TypeError, ValueError):
        raise InputError(f"average: {name} must be numbers, got {value!r}") from None
    if not np.all(np.isfinite(array)):
        raise NotFiniteError(f"average: {name} holds NaN or infinity")
    return array
