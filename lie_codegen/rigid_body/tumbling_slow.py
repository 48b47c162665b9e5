"""The slow flow of a tumbling body in (H, D) alone: its field as a kernel, and its equilibria."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.averaging.orbit_kernels import kernel_orbit_kernels
from lie_codegen.errors import ComputationError
from lie_codegen.groups.build import build
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import doubles, kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import call_routine
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.relative_equilibria import NewtonMethod
from lie_codegen.rigid_body.mean_motion import squared_modulus
from lie_codegen.rigid_body.torque_model import TorqueModel
from lie_codegen.rigid_body.torques import Torque
from lie_codegen.rigid_body.tumbling_routines import average_routine

NAMESPACE = "tumbling_slow"
#: Phases of the field, by k at the start: one number throughout, so that it has no jumps.
_PHASES, _PHASES_NEAR = 64, 96
#: |D| / H.H below which a motion is pure spin.
_SPIN = 1e-14


@kernel_factory(J=doubles, paper=doubles, inertia=doubles)
def slow_kernels(
    J: Array, torques: Sequence[Torque], paper: Array, inertia: Array, k: float, namespace: str = NAMESPACE
) -> tuple[Kernel, ...]:
    """slow_field: ((H, D), t) -> (H', D') of motions about one axis; without t where no direction depends on it.

    Args:
        J: (3, 3) inertia, in the user's axes.
        torques: none with a direction that is a Python function.
        paper, inertia: the axes of the motions, and the moments along them.
        k: a modulus of theirs, which says how many phases are needed.
        namespace: of the C symbols.
    """
    model = TorqueModel(J, torques)
    routine = average_routine(model, namespace)
    frame, moments = np.asarray(paper, dtype=float), np.asarray(inertia, dtype=float)
    phases = _PHASES if k < 0.9 else _PHASES_NEAR

    def slow_field(ops: Arithmetic, y: Any, *rest: Any) -> tuple[Any, ...]:
        e = model.environment(ops, rest[0] if rest else ops.constant(0), ())
        held = [ops.constant(float(each)) for each in (*frame.ravel(), *moments, phases)]
        return (call_routine(ops, routine, [*y, *e, *held])[:4],)

    def sample(rng: random.Random) -> tuple[Any, ...]:
        w = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(0.8, 1.2)])
        D = float(np.sum(moments * (moments - moments[2]) * w**2))
        h = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.5, 1)])
        y = [*(float(each) for each in h * np.linalg.norm(moments * w) / np.linalg.norm(h)), D]
        return (y, rng.uniform(0, 1)) if any(each.is_driven for each in torques) else (y,)

    y = Port("y", (4,), description="H [N m s], D = H.H - 2 I3 T [(N m s)^2]")
    time = (Port("t", (), "s"),) if any(each.is_driven for each in torques) else ()
    return (
        Kernel("slow_field", namespace, (y, *time), (Port("y_dot", (4,)),), slow_field, "H' = <X N>, D' = 2 <sum (I_n - I3) w_n N_n>",
               "Benson and Scheeres, J. Guidance Control Dynamics 44 (2021)", sample),
    )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class TumblingEquilibrium(Saved):
    """A zero of the averaged (H', D'), the directions held.

    Attributes:
        H: (3,) [N m s].
        energy, dynamic_inertia, k: T [J], L^2 / 2T [kg m^2], modulus.
        mode: "SAM" or "LAM".
        eigenvalues: (4,) of the slow flow in (H, D) there [1/s], largest real part first.
        residual: |(H', D')| there over |H|, |H|^2 [1/s].
    """

    H: Array
    energy: float
    dynamic_inertia: float
    k: float
    mode: str
    eigenvalues: NDArray[np.complex128]
    residual: float

    @property
    def stable(self) -> bool:
        """Whether all eigenvalues have negative real parts, beyond rounding: neighbours approach it exponentially."""
        real = self.eigenvalues.real
        return bool(real.max() < -1e-9 * np.abs(self.eigenvalues).max())


def equilibrium_of(
    kernel: Kernel, start: Array, scale: Array, inertia: Array, mode: str, t: float
) -> TumblingEquilibrium:
    """Newton's method from a start (H, D), in units of `scale`.

    Raises:
        ComputationError: it ends at none, or at a motion that does not tumble.
    """
    library = build(kernel_orbit_kernels(kernel, {}, scale=scale.tolist()))
    here = start / scale
    # the unit of time is that of the flow, or a slow flow would be at rest everywhere
    unit = 1 / max(float(np.abs(library["jacobian"](here, t)).max()), 1e-300)
    run = NewtonMethod(
        lambda y: np.asarray(library["rate"](y, t)) * unit, lambda y: np.asarray(library["jacobian"](y, t)) * unit
    )
    found = run.from_guess(here)
    if found is None:
        raise ComputationError(
            "tumbling_average: Newton's method ends at no equilibrium of the slow flow from there; start nearer, or follow "
            ".solve: an equilibrium may lie at pure spin or beyond the separatrix, where this flow ends"
        )
    # D = 0 is pure spin, where D has a square root in the way of derivatives: a point beside it stands for it
    spin = _SPIN * float(found[:3] @ found[:3]) * (1 if inertia[2] < inertia[0] else -1)
    found[3] = spin if abs(found[3]) < abs(spin) else found[3]
    H, D = found[:3] * scale[:3], float(found[3] * scale[3])
    square = float(H @ H)
    energy = (square - D) / (2 * inertia[2])
    k2 = squared_modulus(inertia, square, D)
    if not 0 < k2 < 1:
        raise ComputationError(
            f"tumbling_average: Newton's method left the tumbling motions (k^2 = {k2:.4g}); start nearer"
        )
    values = np.linalg.eigvals(np.asarray(library["jacobian"](found, t))).astype(complex)
    residual = float(np.abs(library["rate"](found, t)).max())
    return TumblingEquilibrium(
        H, energy, square / (2 * energy), float(np.sqrt(k2)), mode, values[np.argsort(-values.real)], residual
    )
