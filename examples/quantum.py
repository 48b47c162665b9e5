"""A Hadamard gate on a qubit with a constant drift: planned, tracked under noisy drives 500 times, taken home as C."""

import sys

import numpy as np

import lie_codegen as lc

gate = lc.UpToPhase(np.array([[1, 1], [1, -1]]) / np.sqrt(2))
plan = lc.steer("su2", gate, ("sx", "sy"), 6.0, drift=[0, 0, 1], bounds=2)
log = next(kernel for kernel in lc.group_kernels("su2") if kernel.name == "log")
X, u = lc.Port("X", (2, 2), is_complex=True), lc.Port("velocity", (3,))
law = lc.Kernel(
    "hold", "su2", (X,), (u,), lambda ops, X: ([-2 * x for x in log.evaluate(ops, X)[0]],), sampler=log.sample
)
t = np.linspace(0, 6, 61)
loops = lc.closed_loop(
    "su2", law=law, reference=lc.reference("su2", plan), t=t, sample=0.02, noise={"u": 0.05}, runs=500
)
lc.plot_loops(loops, f"{sys.argv[1]}/quantum.png")
lc.generate([plan, loops], f"{sys.argv[1]}/quantum", name="gate")
