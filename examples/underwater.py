"""An underwater vehicle with added mass, buoyancy and a current: three thrusters' manoeuvre, tracked 200 times with noise, as C."""

import sys

import numpy as np

import lie_codegen as lc

plan = lc.steer("se3", (0.3, 0.2, -0.4, 1.0, 0.5, -0.3), ("w1", "w2", "v3", "v1"), 12.0, method="optimal")
boat = lc.underwater_vehicle(
    "se3", inertia=(2, 4, 4, 30, 30, 30), added=(1, 2, 2, 5, 20, 20), linear_damping=(1, 2, 2, 10, 20, 20), weight=300
)  # fmt: skip
gains = {"K_1": (8, 8, 8), "K_2": 40, "K_d": (12, 12, 12, 80, 80, 80)}
law = lc.tracking_law("se3", inertia=boat.inertia, error="se3_2", gains=gains)
t = np.linspace(0, 12, 61)
loops = lc.closed_loop(
    "se3", law=lc.compensated(law, boat), inertia=boat.inertia, external=lc.underwater_forces(boat),
    reference=lc.reference("se3", plan), t=t, sample=0.05, noise={"X": 1e-3, "xi": 1e-3}, runs=200,
)  # fmt: skip
lc.plot_loops(loops, f"{sys.argv[1]}/underwater.png")
lc.generate([plan, loops], f"{sys.argv[1]}/underwater", name="boat")
