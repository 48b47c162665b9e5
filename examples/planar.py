"""A hovercraft on SE(2): a parking manoeuvre planned, tracked 500 times with noise, delay and limits, taken home as C."""

import sys

import numpy as np

import lie_codegen as lc

plan = lc.steer("se2", (np.pi / 2, 1.0, 1.0), ("omega", "vx"), 8.0, method="optimal")
gains = {"K_1": 4, "K_2": 4, "K_d": 5}
law = lc.tracking_law("se2", inertia=(1, 2, 2), error=lc.error_names("se2")[0], gains=gains)
t = np.linspace(0, 8, 81)
noise = {"X": 2e-3, "xi": 2e-3}
loops = lc.closed_loop(
    "se2", law=law, inertia=(1, 2, 2), reference=lc.reference("se2", plan), t=t,
    sample=0.05, delay=1, limits=8, noise=noise, runs=500,
)  # fmt: skip
lc.plot_loops(loops, f"{sys.argv[1]}/planar.png")
lc.generate([plan, loops], f"{sys.argv[1]}/planar", name="hover")
