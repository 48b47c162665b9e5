"""Cart with pendulum and two-link arm under vibration: actual against averaged, with the orders measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.mechanics.lagrangian import LagrangianSystem, lagrangian_system
from lie_codegen.mechanics.routh import RouthReduction, routh_reduce
from lie_codegen.mechanics.vibrational_average import vibrational_average
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, RED, caption
from lie_codegen.signals.periodic_input import PeriodicInput

_EPSILONS = (0.004, 0.002, 0.001, 0.0005)


def cart_pendulum() -> RouthReduction:
    """A pendulum on a free cart, turned by a torque at the joint; the cart's momentum is zero."""
    full = lagrangian_system(
        coordinates=("th", "x"),
        lagrangian="(M+m)*dx^2/2 + m*l*cos(th)*dx*dth + m*l^2*dth^2/2 - m*g*l*cos(th)",
        forces={"th": "u"},
        dissipation="c*dth^2/2",
        parameters={"M": 2, "m": 1, "l": "1/2", "g": 9.81, "c": "1/20"},
    )
    return routh_reduce(full, momentum={"x": 0})


def two_link_arm() -> LagrangianSystem:
    """A two-link arm in a horizontal plane: the first joint held by PD and vibrated, the second free with friction."""
    return lagrangian_system(
        coordinates=("a", "b"),
        lagrangian="(i1 + i2 + 2*h*cos(b))*da^2/2 + (i2 + h*cos(b))*da*db + i2*db^2/2",
        forces={"a": "u - 40*a - 8*da"},
        dissipation="c*db^2/2",
        parameters={"i1": 2, "i2": "1/2", "h": "7/10", "c": "1/10"},
    )


def vibrational_examples(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Trajectories at eps = 0.01 and the errors of orders 1 and 2 at stroboscopic times."""
    cases: tuple[tuple[str, Any, PeriodicInput, Array, int, float], ...] = (
        ("cart with pendulum, cart cyclic", cart_pendulum(), PeriodicInput(["4*cos(t) + sin(2*t)"], period="2*pi"),
         np.array([1.2, 0.0]), 0, 4.0),
        ("two-link arm, free second joint", two_link_arm(), PeriodicInput(["12*cos(t) + 3*sin(2*t)"], period="2*pi"),
         np.array([0.0, 0.8, 0.0, 0.0]), 1, 6.0),
    )  # fmt: skip
    figure = new_figure(11, 7.5)
    axes: Any = figure.subplots(2, 2)
    figure.suptitle("Vibrated systems: the actual motion and the one that an average reconstructs")
    caption(
        figure,
        r"Left: $y = \Phi(\tau) P(\tau) z$ of the averaged state $z$. Right: errors at a whole number of periods near t = 0.5 s.",
    )
    numbers: dict[str, Any] = {"eps": list(_EPSILONS)}
    for row, (name, system, u, y0, shown, horizon) in enumerate(cases):
        progress(name)
        models = [vibrational_average(system, u, order=order, gauge="pull_back") for order in (1, 2)]
        periods = round(horizon / (2 * np.pi * 0.01))
        t = 2 * np.pi * 0.01 * np.linspace(0, periods, 12 * periods + 1)
        axes[row, 0].plot(
            t, models[0].solve_actual(y0, t, 0.01, rtol=1e-9)[:, shown], color="0.75", lw=2.2, label="actual"
        )
        for model, colour, label in zip(models, (RED, BLUE), ("order 1", "order 2"), strict=True):
            z = model.solve(model.start(y0, 0.01), t, 0.01)
            y = model.reconstruct(z, t / 0.01, 0.01)
            axes[row, 0].plot(t, y[:, shown], color=colour, lw=0.8, label=f"reconstructed, {label}")
        axes[row, 0].set(
            title=f"{name}, $\\epsilon = 0.01$",
            xlabel="t [s]",
            ylabel=("pendulum angle [rad]", "second joint [rad]")[row],
        )
        axes[row, 0].legend(loc="upper right")
        errors: list[list[float]] = [[], []]
        for eps in _EPSILONS:
            end = 2 * np.pi * eps * round(0.5 / (2 * np.pi * eps))
            exact = models[0].solve_actual(y0, [0, end], eps)[-1]
            for kept, model in zip(errors, models, strict=True):
                kept.append(float(np.abs(model.solve(y0, [0, end], eps)[-1] - exact).max()))
        slopes = [float(np.log(e[-2] / e[-1]) / np.log(_EPSILONS[-2] / _EPSILONS[-1])) for e in errors]
        for kept, slope, colour, order in zip(errors, slopes, (RED, BLUE), ("order 1", "order 2"), strict=True):
            axes[row, 1].loglog(_EPSILONS, kept, "o-", color=colour, label=f"{order}, slope {slope:.2f}")
        axes[row, 1].set(title="error of the average", xlabel="$\\epsilon$", ylabel="largest component")
        axes[row, 1].set_xticks(_EPSILONS, [str(e) for e in _EPSILONS])
        axes[row, 1].minorticks_off()
        axes[row, 1].legend()
        numbers[name] = {"errors": errors, "slopes": slopes}
    return save("vibrational_examples", folder, figure, numbers)
