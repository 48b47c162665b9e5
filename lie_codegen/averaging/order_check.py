"""lc.order_check: the order of an average, measured against the true system over [0, b / eps]."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.averaged import average
from lie_codegen.averaging.chart_limit import chart_end
from lie_codegen.door import warn_caller
from lie_codegen.errors import AssumptionWarning, InputError
from lie_codegen.flow.attitude_metrics import METRICS, distances
from lie_codegen.flow.reference_flow import ReferenceFlow, reference_flow
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import shown
from lie_codegen.kernel.saved import Saved
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic

#: state(eps, t) -> (k, d, d)
State = Callable[[float, Array], Array]

#: Bounds of what is simulated: beyond them there is nothing to see, and it would take for ever.
_LARGEST, _LARGEST_EPS, _PERIODS = 1e6, 100.0, 1e5
#: A measured order may fall short of p by this much at the smallest eps.
SHORTFALL = 0.15
_FLOOR = 2e-13


@dataclass(frozen=True, eq=False, repr=False)
class OrderCheck(Saved):
    """sup over [0, b / eps] of the error of an average, for several eps, and the order it shows.

    Attributes:
        group, form, order: what was checked.
        metric: how the error was measured, see `lie_codegen.flow.attitude_metrics`.
        horizon: b.
        eps, errors: (k,) decreasing, and the error for each.
        slopes: (k-1,) log(errors[i] / errors[i+1]) / log(eps[i] / eps[i+1]); NaN where an error is rounding.
        whole_period_errors, whole_period_slopes: the same at whole periods alone.
        constant: max errors / eps^order: error <= constant eps^order at the eps measured.
        exact: whether every error is rounding.
        next_rate_vanishes: whether F_{p+1} = 0, so that the secular error is one order better.
        nilpotent: whether the algebra is nilpotent and the average of this order its exact solution.
        slope: the slope of the least-squares line through log errors; NaN where fewer than two are above rounding.
        chart_end: first time at which the theorem's chart ends for the largest eps (see `chart_limit`); None if it does not.
        passed: exact, or the last slope or the fitted one is at least order - 0.15.
    """

    group: str
    form: str
    order: int
    metric: str
    horizon: float
    eps: tuple[float, ...]
    errors: tuple[float, ...]
    slopes: tuple[float, ...]
    whole_period_errors: tuple[float, ...]
    whole_period_slopes: tuple[float, ...]
    constant: float
    exact: bool
    next_rate_vanishes: bool
    nilpotent: bool
    slope: float
    chart_end: float | None
    passed: bool

    @property
    def statement(self) -> str:
        """One sentence for documentation and generated headers."""
        what = f"{self.form} average of order {self.order} on {self.group}"
        if self.exact:
            return f"{what}: exact (largest error {max(self.errors):.1e} for eps up to {max(self.eps):g})"
        return (
            f"{what}: error <= {self.constant:.4g} eps^{self.order} ({self.metric}) on [0, {self.horizon:g}/eps], measured "
            f"for eps = {', '.join(f'{e:g}' for e in self.eps)}; slope {self.slope:.3f}"
        )


def order_check(
    group: GroupLike,
    u: PeriodicLike,
    order: int = 2,
    form: str = "floquet",
    *,
    eps: Sequence[float] = (0.2, 0.1, 0.05, 0.025),
    horizon: float = 2.5,
    metric: str = "frobenius",
) -> OrderCheck:
    """Simulate X' = eps X hat(u) for each eps and fit the order of the average's error over [0, horizon / eps].

    Args:
        group, u, order, form: as for `average`.
        eps: two or more positive values, sorted here to decrease.
        horizon: b.
        metric: "frobenius", "product", "single", or "angle" on rotations of space.

    Raises:
        InputError: bad eps, horizon or metric; AssumptionError as `average`.
        ChartError: the coordinates of the metric reach the edge of their chart.
    """
    group, u = as_group(group, "order_check"), as_periodic(u, "order_check")
    values = different_scales("order_check", float(u.period), eps, horizon)
    if metric not in METRICS:
        raise InputError(f"order_check: no metric {metric!r}; choose one of {', '.join(METRICS)}")
    averaged = average(group, u, order, form)
    end = chart_end(averaged, values[0], horizon)
    if end is not None:
        warn_caller(
            f"order_check: for eps = {values[0]:g} the secular exponent of the {form} form leaves its chart at t = {end:.4g}, "
            f"before b / eps = {horizon / values[0]:.4g}; the theorem claims nothing beyond (the numbers below are measured)",
            AssumptionWarning,
        )
    sup, whole = measure(group, u, averaged.state, values, horizon, metric)
    return order_report(
        group.name, form, order, metric, horizon, values, sup, whole,
        end=end, next_rate_vanishes=averaged.next_rate_vanishes, exact_flow=averaged.exact_flow,
    )  # fmt: skip


def measure(
    group: MatrixGroup, u: PeriodicInput, state: State, eps: Sequence[float], horizon: float, metric: str = "frobenius"
) -> tuple[list[float], list[float]]:
    """sup of the error of any approximation state(eps, t), over all times and over whole periods, for each eps."""
    sup, whole = [], []
    for value in eps:
        flow: ReferenceFlow = reference_flow(group, u, value, horizon / value)
        error = distances(group, flow.X, state(value, flow.t), metric)
        sup.append(float(np.max(error)))
        whole.append(float(np.max(error[flow.whole])))
    return sup, whole


def different_scales(where: str, period: float, eps: Sequence[float], horizon: float) -> tuple[float, ...]:
    """Two or more different eps, decreasing.

    Raises:
        InputError: as `checked_scales`, or they are not.
    """
    values = tuple(sorted(checked_scales(where, period, eps, horizon), reverse=True))
    if len(set(values)) < max(2, len(values)):
        raise InputError(f"{where}: eps must hold two or more different positive numbers, got {values}")
    return values


def checked_scales(where: str, period: float, eps: Sequence[float], horizon: float) -> tuple[float, ...]:
    """eps as floats.

    Raises:
        InputError: eps or horizon are no positive numbers, eps is so large that nothing is averaged, or horizon / eps is more periods than
            are simulated.
    """
    if isinstance(eps, str | bytes) or not isinstance(eps, Sequence | np.ndarray) or not len(eps):
        raise InputError(f"{where}: eps must hold positive numbers, got {shown(eps)}")
    for value in (*eps, horizon):
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0 < value <= _LARGEST:
            raise InputError(f"{where}: eps and horizon are positive numbers up to {_LARGEST:g}, got {shown(value)}")
    periods = horizon / min(eps) / period
    if not periods <= _PERIODS or not max(eps) <= _LARGEST_EPS:
        raise InputError(
            f"{where}: horizon / eps is {periods:.3g} periods; at most {_PERIODS:g} are simulated, for eps up to {_LARGEST_EPS:g}"
        )
    return tuple(float(value) for value in eps)


def slopes(eps: Sequence[float], errors: Sequence[float]) -> list[float]:
    """Logarithmic slopes between neighbours; NaN where an error is rounding."""
    result = []
    for (e0, x0), (e1, x1) in zip(zip(eps, errors, strict=True), list(zip(eps, errors, strict=True))[1:], strict=False):
        rounding = min(x0, x1) <= _FLOOR
        result.append(float("nan") if rounding else float(np.log(x0 / x1) / np.log(e0 / e1)))
    return result


def _fit(eps: Sequence[float], errors: Sequence[float]) -> float:
    above = [(np.log(e), np.log(x)) for e, x in zip(eps, errors, strict=True) if x > _FLOOR]
    if len(above) < 2:
        return float("nan")
    return float(np.polyfit([e for e, _ in above], [x for _, x in above], 1)[0])


def order_report(
    group: str,
    form: str,
    order: int,
    metric: str,
    horizon: float,
    eps: tuple[float, ...],
    sup: list[float],
    whole: list[float],
    *,
    end: float | None = None,
    next_rate_vanishes: bool = False,
    exact_flow: bool = False,
) -> OrderCheck:
    """What the errors of an average for several eps say of its order."""
    measured = slopes(eps, sup)
    exact = all(error <= 50 * _FLOOR for error in sup)
    usable = [slope for slope in measured if np.isfinite(slope)]
    fitted = _fit(eps, sup)
    best = max([fitted, usable[-1]]) if usable else float("-inf")
    return OrderCheck(
        group=group,
        form=form,
        order=order,
        metric=metric,
        horizon=horizon,
        eps=eps,
        errors=tuple(sup),
        slopes=tuple(measured),
        whole_period_errors=tuple(whole),
        whole_period_slopes=tuple(slopes(eps, whole)),
        constant=max(error / e**order for error, e in zip(sup, eps, strict=True)),
        exact=exact,
        next_rate_vanishes=next_rate_vanishes,
        nilpotent=exact_flow,
        slope=fitted,
        chart_end=end,
        passed=exact or best >= order - SHORTFALL,
    )
