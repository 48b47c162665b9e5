"""The page of an average: the system and its average side by side, for any amplitude and phase on sliders."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.averaged import Averaged
from lie_codegen.errors import InputError
from lie_codegen.flow.simulate import simulate
from lie_codegen.pictures.scene import Curves, Scene, distance_curve, motion_of

_STEPS = 64
_EPS, _LARGEST, _PERIODS = 0.2, 1.0, 12
_GAUSS = 0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6


def average_scene(averaged: Averaged, samples: int) -> Scene:
    """The scene at eps = 0.2, and what the page needs to integrate it for other amplitudes.

    Raises:
        InputError: parameters without values.
    """
    if averaged.parameters:
        raise InputError(
            f"view: give the parameters of the average values first: average.at({', '.join(map(str, averaged.parameters))})"
        )
    group, u = averaged.group, averaged.u
    period = float(u.period)
    t = np.linspace(0.0, _PERIODS * period, samples)
    actual = simulate(group, u, t=t, eps=_EPS, X0=averaged.X0).X
    mean = averaged.state(_EPS, t)
    nodes = (np.arange(_STEPS)[:, None] + np.array(_GAUSS)) * (period / _STEPS)
    grid = np.arange(_STEPS + 1) * (period / _STEPS)
    motion = motion_of(group, actual)
    solver = {
        "kind": "average", "eps": _EPS, "largest": _LARGEST, "period": period, "periods": _PERIODS, "steps": _STEPS,
        "F": [f.tolist() for f in averaged.F], "u": u(nodes.reshape(-1)).tolist(),
        "Lambda": [np.asarray(each(grid)).tolist() for each in averaged.Lambda[: averaged.order - 1]],
        **_acting(averaged, motion.kind),
    }  # fmt: skip
    return Scene(
        f"{group.name}: an average of order {averaged.order}",
        "The system X' = eps X hat(u(t)) and its average; the page integrates both for the amplitude and the phase on the sliders.",
        t,
        [motion, motion_of(group, mean)],
        [
            Curves("input u", "", group.labels, u(t)),
            Curves(
                "distance of the average",
                "",
                [""],
                distance_curve(group, np.linalg.solve(mean, actual), np.eye(group.degree), "").values,
            ),
        ],
        [(f"F_{q}", ", ".join(f"{value:.6g}" for value in f)) for q, f in enumerate(averaged.F, start=1)],
        ["the system", "its average"],
        solver=solver if averaged.form == "floquet" and motion.kind != "point" else {},
    )


def _acting(averaged: Averaged, kind: str) -> dict[str, object]:
    """The matrices by which the page moves what is seen: those of the basis, or of ad for the Bloch sphere, for Ad_X' = Ad_X ad(u)."""
    group = averaged.group
    basis: Array = group.basis
    start = averaged.X0
    if group.is_complex:
        basis = np.array(
            [
                [group.vee(group.hat(a) @ group.hat(b) - group.hat(b) @ group.hat(a)) for b in np.eye(3)]
                for a in np.eye(3)
            ]
        )
        basis = np.swapaxes(basis, 1, 2)
        start = motion_of(group, averaged.X0[None]).R[0]
    return {"basis": np.real(basis).tolist(), "start": np.real(start).tolist(), "plane": kind == "plane"}
