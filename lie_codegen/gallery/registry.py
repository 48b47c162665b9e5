"""The gallery targets by name; a target's module is imported when it is run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.pictures.result import GalleryResult, file_ending
from lie_codegen.pictures.style import style


@dataclass(frozen=True)
class Target:
    """A figure that `lie-codegen reproduce NAME` makes: the function `name` of gallery module `module`."""

    name: str
    module: str
    about: str


_FOLDER = "lie_codegen.gallery"
TARGETS = (
    Target("satellite", "satellite", "TR 93-59, Figures 2 and 3: two wheels, three axes"),
    Target(
        "periodic_controls",
        "leonard_periodic_controls",
        "TR 93-59, Figure 1: periodic controls and the areas of their loops",
    ),
    Target("momentum_wheels", "leonard_momentum_wheels", "TR 93-59, Figure 4: momentum wheels at any axes"),
    Target(
        "point_mass_oscillator",
        "leonard_oscillator",
        "TR 93-59, Figure 5: a point-mass oscillator and the drift it causes",
    ),
    Target("averaging_orders", "leonard_orders", "every form of average, its order measured; the erratum of (45)-(46)"),
    Target("averaging_growth", "leonard_growth", "what exact averages cost, against order and harmonics"),
    Target(
        "steering_star_tracker",
        "steering_star_tracker",
        "two wheels, bounded rates, a cone kept out of: optimal steering under constraints",
    ),
    Target(
        "steering_trailer",
        "steering_trailer",
        "a tractor with a trailer moved sideways: the Engel group and a figure of eight",
    ),
    Target("open_quadrotor", "open_control", "a quadrotor around a cylinder: plan, and the loop in noise"),
    Target("open_satellite", "open_control", "a satellite with three wheels and a star tracker that keeps off the sun"),
    Target("open_parking", "open_control", "a car parked one metre sideways"),
    Target("open_underwater", "open_control", "an underwater vehicle in a current, which is a parameter"),
    Target("open_qubit", "open_control", "a gate of a detuned qubit by a bounded drive"),
    Target("transmon_gate", "transmon", "a NOT gate of a transmon: Gauss, DRAG, and least energy without leakage"),
    Target(
        "hessian_errors",
        "hessian_errors",
        "accuracy near the identity: exp and log with two derivatives, ours and the neighbours'",
    ),
    Target("propagation_speed", "propagation_speed", "time and error of propagation, ours beside general solvers"),
    Target(
        "tracking_certificates",
        "tracking_certificates",
        "constants, rates and regions promised, beside simulated loops",
    ),
    Target(
        "tracking_global", "tracking_certificates", "the hybrid law from half turns; an observer and its covariance"
    ),
    Target("attitude_trajectory", "attitude_trajectory", "Geyer, Figure 1: the second-order attitude law"),
    Target("attitude_region", "attitude_region", "10^4 initial states of the satellite law beside the proved region"),
    Target(
        "tracking_sphere", "tracking_sphere", "Bullo and Murray, Figures 1 and 2: charts and transport on the sphere"
    ),
    Target(
        "tracking_rotations", "tracking_rotations", "Bullo and Murray, Figures 3 and 4: left and right velocity errors"
    ),
    Target("tracking_planar_flows", "tracking_planar_flows", "Bullo and Murray, Figure 5: gradient flows on SE(2)"),
    Target("tracking_rows", "tracking_rows", "Bullo and Murray, Table 1: six error functions, one vehicle"),
    Target("rigid_body_boom", "rigid_body_boom", "Coppola, Figure 1: boom deployment, actual, averaged and algebraic"),
    Target("rigid_body_thruster", "rigid_body_thruster", "Coppola, Figure 2: a thruster on a tumbling body"),
    Target("rigid_body_limit_cycle", "rigid_body_limit_cycle", "Coppola, Figure 3: limit cycle by linear feedback"),
    Target("tumbling_debris", "tumbling_debris", "a debris object under sunlight for sixty days, averaged and direct"),
    Target("tumbling_separatrix", "tumbling_debris", "a body despun through its separatrix: event and continuations"),
    Target("rigid_body_cost", "rigid_body_cost", "cost and error of averaging over 1/eps; elliptic kernels and SciPy"),
    Target("vibrational_kapitza", "vibrational_kapitza", "Kapitza's pendulum: average, threshold, a tilt held in C"),
    Target("vibrational_examples", "vibrational_examples", "cart and two-link arm, actual against averaged, orders"),
    Target("inverted_body", "inverted_body", "a rigid body upside down on a shaken pivot: threshold against Floquet"),
    Target(
        "vehicle_by_three_forces", "vehicle_by_three_forces", "an underwater vehicle steered by three of six forces"
    ),
    Target("swimmer_gait", "swimmer_gait", "a three-link swimmer's best gait on its height functions"),
    Target("falling_cat", "falling_cat", "two bodies on a joint turn over without angular momentum"),
    Target(
        "vibrational_dumbbell", "vibrational_dumbbell", "Sanyal, Figure 3: what reproduces, and the corrected design"
    ),
)


def target(name: str) -> Target:
    """The target of that name.

    Raises:
        InputError: if there is none; lists those there are.
    """
    for candidate in TARGETS:
        if candidate.name == name:
            return candidate
    raise InputError(f"no figure {name!r}; there are {', '.join(each.name for each in TARGETS)}")


def reproduce(
    name: str,
    folder: Path,
    progress: Callable[[str], None],
    formats: Sequence[str] = ("png",),
    themes: Sequence[str] = ("light",),
) -> GalleryResult:
    """Runs a target; its numbers and its light PNG are written to the folder always, each format in each theme where asked.

    Raises:
        InputError: no such target, format or theme, told before anything is computed.
    """
    chosen = target(name)
    asked = [(format, theme) for theme in themes for format in formats]
    for format, theme in asked:
        file_ending(format, theme)
    function: Any = getattr(import_module(f"lie_codegen.gallery.{chosen.module}"), name)
    with style():
        result: GalleryResult = function(folder, progress)
        for format, theme in asked:
            if (format, theme) != ("png", "light"):
                result.write(format, theme)
    return result
