"""The orders of all averages, measured: every form on several groups, and the erratum of (45)-(46) of TR 93-59."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.averaging.order_check import OrderCheck, measure, order_check, slopes
from lie_codegen.averaging.printed_form import printed_state
from lie_codegen.gallery.leonard_style import SEQUENCE, eps_axis, plain
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, RED, caption
from lie_codegen.signals.periodic_input import PeriodicInput

_ZERO = (
    "cos(t)",
    "sin(t) + 3/10*cos(2*t)",
    "1/2*cos(t + 1)",
    "1/2*sin(2*t)",
    "1/3*cos(3*t)",
    "0",
    "1/4*sin(t)",
    "1/5*cos(2*t)",
)
_MEANS = (" + 1/3", " - 1/5", " + 1/10", " + 1/4", " - 1/6", " + 1/7", " - 1/9", " + 1/8")
_MIXED = ("1/2 + cos(t)", "-3/10 + sin(t) + 3/10*cos(2*t)", "4/10 + 1/2*cos(t + 1)")
_EPS = (0.4, 0.2, 0.1, 0.05, 0.025)
_GROUPS = ("so3", "se2", "se3", "su2", "sl2", "h3", "engel", "su3")


def averaging_orders(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Errors against eps on logarithmic axes: orders 1 to 6, the area rules, eight groups, and the erratum."""
    so3 = group("so3")
    progress("orders 1 to 6 and the area rules on SO(3)")
    rising = [order_check(so3, _input(3, True), p, eps=_EPS) for p in range(1, 7)]
    rules = [
        order_check(so3, _input(3, False), p, form, eps=_EPS, metric="angle")
        for form, p in (("product", 1), ("product", 2), ("single", 2), ("single", 3))
    ]
    groups = []
    for name in _GROUPS:
        progress(f"order 3 on {name}")
        chosen = group(name)
        groups.append(order_check(chosen, _input(chosen.dim, True), 3, eps=_EPS, horizon=1.5))
    u = PeriodicInput(_MIXED, "2*pi")
    printed, _ = measure(so3, u, lambda eps, t: printed_state(so3, u, eps, t), _EPS, 0.8 * np.pi)
    right = order_check(so3, u, 2, eps=_EPS, horizon=0.8 * np.pi)
    numbers: dict[str, Any] = {
        "eps": list(_EPS),
        "floquet_so3": [_row(check) for check in rising],
        "area_rules_so3": [_row(check) for check in rules],
        "order_3_by_group": [_row(check) for check in groups],
        "lemma_4_as_printed": {"errors": printed, "slopes": slopes(_EPS, printed)},
        "lemma_4_corrected": _row(right),
    }
    return save("averaging_orders", folder, _draw(rising, rules, groups, printed, right), numbers)


def _input(dim: int, mean: bool) -> PeriodicInput:
    return PeriodicInput([z + (m if mean else "") for z, m in zip(_ZERO, _MEANS, strict=True)][:dim], "2*pi")


def _row(check: OrderCheck) -> dict[str, Any]:
    finite = [slope if np.isfinite(slope) else None for slope in check.slopes]
    return {
        "group": check.group,
        "form": check.form,
        "order": check.order,
        "errors": list(check.errors),
        "slopes": finite,
        "constant": check.constant,
        "exact": check.exact,
        "passed": check.passed,
    }


def _draw(
    rising: list[OrderCheck], rules: list[OrderCheck], groups: list[OrderCheck], printed: list[float], right: OrderCheck
) -> Any:
    figure = new_figure(12, 9)
    panels = figure.subplots(2, 2)
    figure.suptitle(
        "Averages on Lie groups: the largest error over [0, b/$\\epsilon$] against $\\epsilon$", fontsize=13
    )
    for check, colour in zip(rising, SEQUENCE, strict=False):
        _line(panels[0, 0], check, colour, f"order {check.order}: slope {check.slopes[-1]:.2f}")
    panels[0, 0].set(
        title="SO(3), non-zero mean, b = 2.5: Floquet-Magnus averages", ylabel="sup $|\\bar X^{-1}X - I|_F$"
    )
    names = (
        "first order (Theorem 2)",
        "area rule, product (Theorem 3)",
        "area rule, single (Theorem 4)",
        "area-moment rule",
    )
    for check, colour, name in zip(rules, SEQUENCE, names, strict=False):
        _line(panels[0, 1], check, colour, f"{name}: {check.slopes[-1]:.2f}")
    panels[0, 1].set(title="SO(3), zero mean, b = 2.5: the area rules", ylabel="attitude error [rad]")
    for check, colour in zip(groups, SEQUENCE, strict=False):
        label = f"{check.group}: exact" if check.exact else f"{check.group}: {check.slopes[-1]:.2f}"
        _line(panels[1, 0], check, colour, label)
    panels[1, 0].set(title="order 3 on eight groups, b = 1.5", ylabel="sup $|\\bar X^{-1}X - I|_F$")
    erratum = panels[1, 1]
    erratum.loglog(
        _EPS, printed, "o-", color=RED, mfc="none", label=f"(45)-(46) as printed: {slopes(_EPS, printed)[-1]:.2f}"
    )
    erratum.loglog(_EPS, right.errors, "o-", color=BLUE, mfc="none", label=f"two exponentials: {right.slopes[-1]:.2f}")
    erratum.set(title="Lemma 4 when the mean is not zero, b = 0.8 $\\pi$", ylabel="sup $|\\bar X^{-1}X - I|_F$")
    for axes in panels.ravel():
        eps_axis(axes, _EPS)
        axes.legend(frameon=False, fontsize=8)
    plain(*panels.ravel())
    caption(figure, "Numbers in the legends: the slope between the two smallest eps, which is the order of the error.")
    return figure


def _line(axes: Any, check: OrderCheck, colour: str, label: str) -> None:
    axes.loglog(check.eps, np.maximum(check.errors, 1e-16), "o-", color=colour, mfc="none", ms=4, label=label)
