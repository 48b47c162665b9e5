"""Ten thousand initial states of the satellite law beside the region of attraction that is proved for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.second_order_step import second_order_step
from lie_codegen.gallery.attitude_style import quiet, tidy
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, ORANGE, RED, caption
from lie_codegen.runtime.build import build_kernels

_INERTIA = (6.0, 4.0, 3.0)
_K_P = 4.0
_SAMPLES = 10_000
_STEP = 0.05
#: Cells of the picture along the angle and along the speed.
_CELLS = (16, 20)


def attitude_region(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """The share of states that pass 180 degrees before they converge, cell by cell, and those not settled in the time given."""
    figure = new_figure(11.5, 5.4)
    unsettled = passed = 0
    numbers: dict[str, Any] = {"samples": _SAMPLES, "inertia": list(_INERTIA), "k_p": _K_P}
    for number, (axes, k_d, horizon) in enumerate(zip(figure.subplots(1, 2), (6.0, 1.5), (40.0, 100.0), strict=True)):
        progress(f"{_SAMPLES} initial states, k_d = {k_d:g}")
        study = monte_carlo(k_d, horizon, seed=number)
        numbers[f"k_d_{k_d:g}"] = {key: value for key, value in study.items() if not isinstance(value, np.ndarray)}
        unsettled += int(np.sum(~study["converged"]))
        passed += study["inside_passed_180"]
        field = _draw(axes, study, k_d)
    figure.colorbar(field, ax=figure.axes, label="share that passes 180 degrees before it converges", aspect=30)
    figure.suptitle("Region of attraction of the law (18) of Geyer: proved (below the arc) and simulated")
    caption(
        figure,
        f"{_SAMPLES} random initial states a panel, about {_SAMPLES // (_CELLS[0] * _CELLS[1])} a cell. Of those below the "
        f"arc {passed} pass 180 degrees (cells cut by the arc are mixed); {unsettled} of all are unsettled in the time given.",
    )
    return save("attitude_region", folder, figure, numbers)


def monte_carlo(k_d: float, horizon: float, seed: int, samples: int = _SAMPLES) -> dict[str, Any]:
    """Fates of random states: |theta| and sqrt(omega' I omega/k_p) uniform in [0, pi] x [0, 2 pi]."""
    so3 = group("so3")
    law = attitude_law("pd", inertia=_INERTIA, k_p=_K_P, k_d=k_d)
    logarithm = attitude_law("p", k_p=1)
    kernels = [second_order_step(so3, _INERTIA, law=law), law, logarithm, group_kernel(so3, "exp")]
    lib = build_kernels(lambda: kernels, namespace="so3")
    rng = np.random.default_rng(seed)
    angle, speed = rng.uniform(0, np.pi, samples), rng.uniform(0, 2 * np.pi, samples)
    axis, spin = (_units(rng, samples) for _ in range(2))
    omega = speed[:, None] * np.sqrt(_K_P) * spin / np.sqrt(_INERTIA)
    state, _ = initial_states(so3, lib.exp.batch(angle[:, None] * axis), omega)
    began = perf_counter()
    passed = np.zeros(samples, bool)
    theta = lib.attitude_p.batch(split_states(so3, state)[0]).omega
    steps = int(horizon / _STEP)
    for _ in range(steps):
        state = lib.second_order_step.batch(state=state, t=0.0, h=_STEP)
        moved = lib.attitude_p.batch(split_states(so3, state)[0]).omega
        passed |= np.einsum("ki,ki->k", theta, moved) < -1
        theta = moved
    seconds = perf_counter() - began
    X, xi = split_states(so3, state)
    converged = lib.attitude_pd.batch(X, xi).V < 1e-4
    inside = angle**2 + speed**2 < np.pi**2
    return {
        "angle": angle,
        "speed": speed,
        "passed": passed,
        "converged": converged,
        "seconds": seconds,
        "steps": steps,
        "ns_per_trajectory_step": 1e9 * seconds / steps / samples,
        "inside": int(inside.sum()),
        "inside_converged": int((inside & converged).sum()),
        "inside_passed_180": int((inside & passed).sum()),
        "outside": int((~inside).sum()),
        "outside_converged": int((~inside & converged).sum()),
        "outside_passed_180": int((~inside & passed).sum()),
    }


def _units(rng: np.random.Generator, count: int) -> NDArray[Any]:
    x = rng.normal(size=(count, 3))
    values: NDArray[Any] = x / np.linalg.norm(x, axis=1)[:, None]
    return values


def _draw(axes: Any, study: dict[str, Any], k_d: float) -> Any:
    from matplotlib.colors import LinearSegmentedColormap

    angle, speed, passed, converged = (study[key] for key in ("angle", "speed", "passed", "converged"))
    edges = [np.linspace(0, end, cells + 1) for end, cells in zip((np.pi, 2 * np.pi), _CELLS, strict=True)]
    total, hits = (np.histogram2d(x, y, bins=edges)[0] for x, y in ((angle, speed), (angle[passed], speed[passed])))
    share = np.ma.masked_equal(total, 0)
    colours = LinearSegmentedColormap.from_list("share", ["#eaf1fb", "#7fa6d9", BLUE, "#8a6f5a", ORANGE])
    field = axes.pcolormesh(*edges, (hits / share).T, cmap=colours, vmin=0, vmax=1)
    if not converged.all():
        axes.plot(angle[~converged], speed[~converged], "x", color=RED, ms=4, label="not settled in the time given")
    arc = np.linspace(0, np.pi / 2, 100)
    axes.plot(np.pi * np.cos(arc), np.pi * np.sin(arc), color="black", lw=1.8, label="edge of the proved region")
    axes.legend(loc="lower left")
    title = rf"$k_p = {_K_P:g}$ N m/rad, $k_d = {k_d:g}$ N m s/rad"
    tidy(axes, title, r"$|\theta_0|$ [rad]", r"$(\omega_0^T I\, \omega_0 / k_p)^{1/2}$ [rad]")
    axes.grid(False)
    axes.set(xlim=(0, np.pi), ylim=(0, 2 * np.pi))
    return field
