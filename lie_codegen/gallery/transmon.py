"""A NOT gate of a transmon: its drive reaches a third level, which a pulse made for two levels fills.

In the frame of the drive H = alpha |2><2| + u_x (a + a')/2 + u_y i (a' - a)/2 with a|n> = sqrt n |n-1>, n = 0, 1, 2, and the
anharmonicity alpha < 0. A pulse u_x of area pi flips two levels exactly. Derivative removal (DRAG: Motzoi, Gambetta, Rebentrost and
Wilhelm, Phys. Rev. Lett. 103 (2009) 110501) adds u_y in proportion to -u_x'/alpha; here its share, the amplitude and a detuning are tuned
for the least error. Ours is the pulse of least energy whose three levels end at the gate, nothing outside.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import group
from lie_codegen.on_demand import scipy
from lie_codegen.pictures.quantum_path import draw_populations
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.steering_loops import COLOURS
from lie_codegen.pictures.steering_path import draw_path
from lie_codegen.pictures.style import caption
from lie_codegen.steering.direct.report import leakage
from lie_codegen.steering.front import steer
from lie_codegen.steering.goals import UpToPhase

#: rad/ns: -300 MHz; ns.
ANHARMONICITY, DURATION = -2 * np.pi * 0.3, 6.0
NOT = np.array([[0, 1], [1, 0]])
_STEPS = 600

_LOWER = np.diag([1, np.sqrt(2)], 1).astype(complex)
_X, _Y = (_LOWER + _LOWER.T) / 2, 1j * (_LOWER.T - _LOWER) / 2
_COUNT = np.diag([0.0, 1.0, 2.0])


def transmon_gate(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """The pulses, where the population goes, and the Bloch vectors of the two levels."""
    progress("tuning the derivative pulse")
    t = (np.arange(_STEPS) + 0.5) * DURATION / _STEPS
    gauss, slope = _gaussian(t)
    first = np.column_stack([gauss, 0 * gauss])
    amplitude, share, detuning = _tuned(gauss, slope)
    drag = np.column_stack([amplitude * gauss, -share * slope / ANHARMONICITY])
    progress("least energy on three levels")
    su3 = group("su3")
    x, y, drift = (_traceless(H) for H in (_X, _Y, ANHARMONICITY * np.diag([0.0, 0, 1])))
    plan = steer(su3, UpToPhase(NOT, levels=(0, 1)), (x, y), DURATION, drift=drift, bounds=2, equation="right")
    numbers: dict[str, Any] = {"duration_ns": DURATION, "anharmonicity_MHz": 1e3 * ANHARMONICITY / (2 * np.pi)}
    ends = {"gaussian": _played(first), "drag": _played(drag, detuning), "least_energy": _played(plan.inputs(t))}
    for name, X in ends.items():
        numbers[f"{name}_infidelity"], numbers[f"{name}_leakage"] = _infidelity(X), leakage(X, (0, 1))
    numbers |= {"drag_amplitude": amplitude, "drag_share": share, "drag_detuning_rad_per_ns": detuning}
    numbers |= {"plan_infidelity": 1 - plan.details["fidelity"], "plan_leakage": plan.details["leakage"]}
    figure = new_figure(13, 4.6)
    left, middle, right = figure.add_gridspec(1, 3)
    pulses = figure.add_subplot(left)
    for (name, u), colour in zip(
        (("Gauss", first), ("Gauss with derivative", drag), ("least energy", plan.inputs(t))), COLOURS, strict=False
    ):
        pulses.plot(t, u[:, 0], color=colour, label=f"{name}: in phase")
        pulses.plot(t, u[:, 1], "--", color=colour, label="in quadrature")
    pulses.set(title="pulses", xlabel="t [ns]", ylabel="drive [rad/ns]", xlim=(0, DURATION), ylim=(-0.5, 1.7))
    pulses.legend(frameon=False, fontsize=7.5, ncols=2, loc="upper center")
    s = np.linspace(0, DURATION, 401)
    X = plan.X(s)
    draw_populations(figure.add_subplot(middle), plan, s, X)
    draw_path(figure, right, plan, s, X, ())
    figure.axes[1].set_xlabel("t [ns]")
    figure.suptitle("A NOT gate of a transmon in 6 ns: nothing stays in the third level")
    words = {"gaussian": "Gauss", "drag": "Gauss with derivative, tuned", "least_energy": "least energy on SU(3)"}
    told = "; ".join(f"{words[name]} {numbers[f'{name}_infidelity']:.1e}" for name in ends)
    caption(figure, f"Infidelity of the two levels, played in {_STEPS} steps: {told}.")
    return save("transmon_gate", folder, figure, numbers)


def _gaussian(t: Array) -> tuple[Array, Array]:
    """A Gaussian of area pi that begins and ends at zero, and its derivative."""
    sigma = DURATION / 4
    bell = np.exp(-((t - DURATION / 2) ** 2) / (2 * sigma**2))
    scale = np.pi / (np.sum(bell - bell[0]) * DURATION / _STEPS)
    return scale * (bell - bell[0]), -scale * bell * (t - DURATION / 2) / sigma**2


def _tuned(gauss: Array, slope: Array) -> tuple[float, float, float]:
    """Amplitude, share of the derivative and detuning of least error."""

    def error(x: Array) -> float:
        drag = np.column_stack([x[0] * gauss, -x[1] * slope / ANHARMONICITY])
        return _infidelity(_played(drag, float(x[2])))

    options = {"xatol": 1e-6, "fatol": 1e-12, "maxfev": 400}
    found = scipy.optimize.minimize(error, [1.0, 0.5, 0.0], method="Nelder-Mead", options=options).x
    return float(found[0]), float(found[1]), float(found[2])


def _played(u: Array, detuning: float = 0.0) -> Array:
    """U (3, 3) of U' = -i H U under controls held in each step."""
    H = ANHARMONICITY * np.diag([0.0, 0, 1]) + detuning * _COUNT + np.tensordot(u, np.array([_X, _Y]), 1)
    U = np.eye(3, dtype=complex)
    for step in expm(-1j * DURATION / len(u) * H):
        U = step @ U
    return U


def _infidelity(U: Array) -> float:
    """1 - |tr(NOT' U_01)|^2 / 4 with the block of the two levels."""
    return float(1 - np.abs(np.vdot(NOT, U[:2, :2])) ** 2 / 4)


def _traceless(H: Array) -> Array:
    """(8,) the velocity of -i H on SU(3)."""
    return group("su3").project(-1j * (H - np.trace(H) / 3 * np.eye(3)))
