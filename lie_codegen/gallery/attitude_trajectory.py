"""Figure 1 of Geyer, The Attitude Control Problem: the second-order law in exponential coordinates."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.errors import InertiaWarning
from lie_codegen.gallery.attitude_style import bare_3d, quiet, sphere, tidy
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, COLOURS, GREY, caption
from lie_codegen.runtime.build import build_kernels

_INERTIA, _K_P, _K_D = (6, 3, 1), 4, 6
_THETA, _OMEGA = (1.2, -0.8, 1.0), (0.3, -0.4, 0.5)
_PUBLISHED = (0.0101356443745298, 7.72832249593381e-05, 7.32487101341846e-04)


def attitude_trajectory(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """theta(t) and omega(t) of one run, and many runs from the sphere |theta| = 3 in two views for the stereo pair."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InertiaWarning)  # diag(6, 3, 1) is the paper's and no rigid body's
        law = attitude_law("pd", inertia=_INERTIA, k_p=_K_P, k_d=_K_D, gyroscopic="cancel")
    so3 = group("so3")
    logarithm = build_kernels(lambda: [attitude_law("p", k_p=1)], namespace="so3").attitude_p
    t = np.linspace(0, 10, 401)
    start = _rotations(np.array([_THETA]))[0]
    run = closed_loop(so3, inertia=_INERTIA, law=law, X0=start, xi0=_OMEGA, t=t, tolerance=1e-11)
    theta = -logarithm.batch(run.X).omega
    progress("many runs from the sphere |theta| = 3")
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(24, 3))
    many = closed_loop(
        so3, inertia=_INERTIA, law=law, X0=_rotations(3 * directions / np.linalg.norm(directions, axis=1)[:, None]),
        xi0=rng.normal(size=(24, 3)) * 0.4, t=np.linspace(0, 14, 281), step=0.01,
    )  # fmt: skip
    paths = -logarithm.batch(many.X.reshape(-1, 3, 3)).omega.reshape(*many.X.shape[:2], 3)
    numbers = {
        "theta_10": [float(x) for x in theta[-1]],
        "theta_10_error": float(np.max(np.abs(theta[-1] - _PUBLISHED))),
        "V_0": float(run.outputs["V"][0]),
        "V_10": float(run.outputs["V"][-1]),
        "V_increases": int(np.sum(np.diff(run.outputs["V"]) > 0)),
        "integration_steps": run.steps,
        "largest_final_angle_of_24": float(np.max(np.linalg.norm(paths[-1], axis=1))),
    }
    return save("attitude_trajectory", folder, _draw(t, theta, run.xi, paths), numbers)


def _rotations(theta: NDArray[Any]) -> NDArray[Any]:
    lib = build_kernels(lambda: [_exponential()], namespace="so3")
    values: NDArray[Any] = lib.exp.batch(np.ascontiguousarray(theta))
    return values


def _exponential() -> Any:
    from lie_codegen.groups.kernels import group_kernel

    return group_kernel(group("so3"), "exp")


def _draw(t: NDArray[Any], theta: NDArray[Any], omega: NDArray[Any], paths: NDArray[Any]) -> Any:
    figure = new_figure(11, 9)
    figure.suptitle(
        "Attitude by the law (18) of Geyer, gyroscopic torque cancelled: $I = $diag(6, 3, 1), $k_p = 4$, $k_d = 6$"
    )
    left, right = figure.add_subplot(2, 2, 1), figure.add_subplot(2, 2, 2)
    for axes, values, name, unit in ((left, theta, r"\theta", "rad"), (right, omega, r"\omega", "rad/s")):
        for component, colour in zip(range(3), COLOURS, strict=False):
            axes.plot(t, values[:, component], color=colour, label=f"${name}_{'xyz'[component]}$")
        axes.axhline(0, color=GREY, lw=0.6)
        axes.legend(frameon=False)
        tidy(axes, f"({'a' if axes is left else 'b'}) ${name}$", y=unit)
    for place, azimuth in ((3, 32), (4, 38)):
        axes = figure.add_subplot(2, 2, place, projection="3d")
        sphere(axes)
        for path in np.moveaxis(paths / np.pi, 1, 0):
            axes.plot(*path.T, color=BLUE, lw=0.9, alpha=0.8)
            axes.scatter(*path[0], s=8, color=COLOURS[1])
        bare_3d(axes, 0.8)
        axes.view_init(elev=18, azim=azimuth)
        axes.set_title(
            f"({'cd'[place - 3]}) 24 runs in exponential coordinates, " + ("left eye" if place == 3 else "right eye")
        )
    caption(
        figure,
        "(a), (b): Figure 1's run. (c), (d): rotation vectors in the ball of radius $\\pi$; squint to see them in space.",
    )
    return figure
