"""Certificates beside simulated loops: what is promised, and what happens."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.certificate import certificate
from lie_codegen.control.certificate_record import Certificate
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.control.error_samples import random_elements
from lie_codegen.control.hybrid_law import hybrid_law
from lie_codegen.control.observer import observer
from lie_codegen.control.reference_motion import formula_reference
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.gallery.attitude_style import quiet, tidy
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import COLOURS, caption

_BODY = ((2, 0.3, -0.2), (0.3, 1.5, 0.1), (-0.2, 0.1, 1))
_SO3: dict[str, Any] = {"inertia": _BODY, "error": "so3_right", "gains": {"K_p": [4, 5, 6], "K_d": [3, 4, 5]}}
_SE3: dict[str, Any] = {
    "inertia": (2, 3, 4, 5, 6, 8),
    "gains": {"K_1": [8, 10, 12], "K_2": [6, 7, 8], "K_d": [6, 7, 8, 10, 11, 12]},
}


def tracking_certificates(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """(a) W of loops on SO(3) below their bound; (b) rate against overshoot; (c) the rows on SE(3): rates promised and seen inside."""
    figure = new_figure(14, 4.6)
    left, middle, right = figure.subplots(1, 3)
    numbers: dict[str, Any] = {}
    progress("loops on SO(3)")
    cert = certificate("so3", **_SO3, level=4.5, overshoot=2.6)
    t, W, inside = _loops(cert)
    bound = cert.k * W[0] * np.exp(-cert.rate * t)[:, None]
    numbers["above_the_bound"] = float(np.max((W / bound)[:, inside]))
    left.semilogy(t, W[:, inside][:, :40], color=COLOURS[0], alpha=0.35)
    shown = cert.level * np.exp(-cert.rate * t)
    left.semilogy(t, cert.k * shown, color="k", label=rf"$k\,W(0)\,e^{{-{cert.rate:.2f}\,t}}$, $W(0)$ at the level")
    left.semilogy(
        t, cert.theorem_k * cert.level * np.exp(-cert.theorem_rate * t), "k--", label="Theorem 4.2 by suprema"
    )
    left.set_ylim(1e-8, 30)
    left.legend(frameon=False, fontsize=8)
    tidy(left, "(a) $W$ of 40 loops inside, SO(3)", y="$W$ [J]")
    progress("rate against overshoot")
    ks = [1.2, 1.5, 2, 2.6, 3.5, 5, 7]
    rates = [certificate("so3", **_SO3, level=4.5, overshoot=k, prove=False).rate for k in ks]
    middle.plot(ks, rates, "o-", color=COLOURS[1])
    middle.axhline(cert.limit_rate, color="k", linestyle=":", label="limit, by the linearisation")
    middle.axhline(cert.theorem_rate, color="k", linestyle="--", label="Theorem 4.2 by suprema")
    middle.set_xlabel("overshoot $k$")
    middle.set_ylabel("rate of $W$ [1/s]")
    middle.set_title("(b) rate against overshoot, level 4.5")
    middle.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(0.02, 0.92))
    numbers["rates"] = rates
    for row in range(1, 7):
        progress(f"row {row}")
        numbers[f"row_{row}"] = made = _row(row)
        for place, key in ((row - 0.2, "promised"), (row, "seen"), (row + 0.2, "limit")):
            colour = COLOURS[("promised", "seen", "limit").index(key)]
            right.bar(place, made[key], 0.2, color=colour, label=key if row == 1 else None)
        right.text(row, 1.03 * max(made["limit"], made["seen"]), f"$L = {made['L']:.3g}$", ha="center", fontsize=7.5)
    right.set_xlabel("row of Table 1")
    right.set_ylabel("rate of $W$ [1/s]")
    right.set_ylim(0, 1.5 * max(numbers[f"row_{row}"]["limit"] for row in range(1, 7)))
    right.set_title("(c) rows on SE(3), level $L/4$")
    right.legend(frameon=False, fontsize=8)
    figure.suptitle("Certificates of tracking loops beside simulated ones (Bullo and Murray, Theorem 4.2 sharpened)")
    caption(
        figure,
        "(a), (b): promised by interval arithmetic, against 150 random starts at rest. (c): the slowest loop seen and the rate of the linearisation.",
    )
    return save("tracking_certificates", folder, figure, numbers)


def _loops(cert: Certificate, count: int = 150) -> tuple[Array, Array, Array]:
    """Times, W and which starts are inside, from random starts at rest about a reference at rest."""
    space, rng = cert.group, np.random.default_rng(0)
    zero = np.zeros(space.dim)
    X = random_elements(space, count, rng, 1.2)
    one = np.eye(space.degree)
    inside = np.array([cert.inside(each, zero, one, zero) is True for each in X])
    law = tracking_law(
        space,
        inertia=cert.inertia.tolist(),
        error=cert.error,
        gains={"K_d": cert.K_d.tolist()},
        feedforward=cert.feedforward,
    )
    still = formula_reference(space, ["0"] * space.dim)
    t = np.linspace(0, 12, 61)
    run = closed_loop(space, inertia=cert.inertia, law=law, reference=still, X0=X, t=t, step=0.02)
    return t, run.outputs["W"], inside


def _row(row: int) -> dict[str, float]:
    error = f"se3_{row}"
    cert = certificate("se3", error=error, **_SE3, level=4.5, overshoot=3, reach=1, prove=False)
    t, W, inside = _loops(cert, 60)
    late = slice(20, 50)
    slopes = [np.polyfit(t[late], np.log(np.maximum(w[late], 1e-300)), 1)[0] for w in W[:, inside].T]
    return {
        "L": cert.L,
        "promised": cert.rate,
        "seen": float(-np.max(slopes)) if slopes else float("nan"),
        "limit": cert.limit_rate,
        "inside": int(np.sum(inside)),
    }


def tracking_global(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """(a) the hybrid law beside the smooth one from the three half turns; (b) an observer's errors and their steady deviations."""
    figure = new_figure(11, 4.6)
    left, right = figure.subplots(1, 2)
    numbers: dict[str, Any] = {}
    so3 = group("so3")
    still = formula_reference(so3, ["0", "0", "0"])
    halves = np.array([np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])])
    t = np.linspace(0, 30, 151)
    laws = {
        "smooth": tracking_law("so3", **_SO3, feedforward="levi_civita"),
        "hybrid": hybrid_law("so3", inertia=_BODY, K_p=[4, 5, 6], K_d=[3, 4, 5]),
    }
    for (name, law), style in zip(laws.items(), ("--", "-"), strict=True):
        progress(name)
        run = closed_loop("so3", law=law, inertia=_BODY, reference=still, X0=halves, t=t, sample=0.02, step=0.02)
        numbers[f"{name}_end"] = [float(x) for x in run.error[-1]]
        for k in range(3):
            label = (
                f"{name}, half turn about axis {k + 1}"
                if name == "hybrid"
                else ("smooth, all three" if k == 0 else None)
            )
            left.plot(
                t, np.degrees(run.error[:, k]), style, color=COLOURS[k] if name == "hybrid" else "0.4", label=label
            )
    left.legend(frameon=False, fontsize=8)
    tidy(left, "(a) from half turns exactly, at rest", y="distance from the reference [deg]")
    progress("observer")
    watching = observer("so3", directions=[[0, 0, 1], [0.6, 0, 0.8]], weights=[1, 0.5], k_p=1.2, k_i=0.3)
    deviation = np.sqrt(np.diag(watching.covariance(step=0.02, direction_noise=0.02, rate_noise=0.01)))
    t = np.linspace(0, 200, 501)
    run = closed_loop(
        "so3", law=laws["smooth"], inertia=_BODY, reference=still, observer=watching, t=t, sample=0.02, step=0.02,
        noise={"y": 0.02, "xi": 0.01}, runs=60, seed=3,
    )  # fmt: skip
    E = np.swapaxes(run.X, -1, -2) @ run.states["X_hat"]
    angles = (
        np.stack([E[..., 2, 1] - E[..., 1, 2], E[..., 0, 2] - E[..., 2, 0], E[..., 1, 0] - E[..., 0, 1]], axis=-1) / 2
    )
    seen = np.std(angles[250:], axis=(0, 1))
    numbers["deviation_over_theory"] = (seen / deviation[:3]).tolist()
    for k in range(3):
        right.plot(t, 1e3 * angles[:, 0, k], color=COLOURS[k], lw=0.7, label=f"axis {k + 1}, one of 60 loops")
        right.axhspan(-1e3 * deviation[k], 1e3 * deviation[k], color=COLOURS[k], alpha=0.12)
    right.legend(frameon=False, fontsize=8)
    tidy(right, "(b) observer in the loop, and its steady deviations", y="error of the estimate [mrad]")
    figure.suptitle("Attitude from everywhere, and an observer in the loop")
    caption(
        figure,
        "(a): the smooth law stays on its critical points, the hybrid one leaves them. (b): bands are one deviation, from the covariance.",
    )
    return save("tracking_global", folder, figure, numbers)
