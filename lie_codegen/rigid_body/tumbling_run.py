"""What runs of a tumbling body give: averaged, and direct."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.saved import Saved


@dataclass(frozen=True, eq=False, repr=False)
class TumblingEvent(Saved):
    """What ended an averaged run before its time.

    Attributes:
        kind: "separatrix" (k = .999), or "tumbling stops" (|H| below 1e-9 of the start).
        t: when [s].
        H: (3,) there.
        mode_left, mode_entered: "SAM" or "LAM".
        continuations: sign of H along the new axis -> (X, omega), a mean state just beyond; averaging does not know which comes.
    """

    kind: str
    t: float
    H: Array
    mode_left: str
    mode_entered: str
    continuations: dict[str, tuple[Array, Array]] = field(repr=False)


@dataclass(frozen=True, eq=False, repr=False)
class Resonance(Saved):
    """n1 2 pi Lambda + n2 m = 0 on the way.

    Attributes:
        t: when [s].
        n1, n2: of the phase and of the precession.
        harmonic: size of that harmonic of H' over the mean.
    """

    t: float
    n1: int
    n2: int
    harmonic: float


@dataclass(frozen=True, eq=False, repr=False)
class TumblingRun(Saved):
    """An averaged run; every array is of mean values, but the osculating ones.

    Attributes:
        t: (n,) [s]; fewer than were asked for where an event ended the run.
        H: (n, 3) mean angular momentum, inertial [N m s].
        energy, dynamic_inertia, k: (n,) T [J], L^2 / 2T [kg m^2], modulus.
        phi, alpha: (n,) phases to first order [1], [rad], alpha the uniform precession angle.
        osculating_H, osculating_energy: (n, 3), (n,) with the periodic part on the torus added.
        mode: n times "SAM" or "LAM".
        status: "ok", "separatrix", ..., with remarks on resonances.
        event: what ended it, or None.
        resonances: those crossed, |n1| <= 12, |n2| <= 4.
        dropped: (n1, n2) left out of the map at the start for small divisors.
        torque_ratio: largest |N| Tn / |H| at the start.
        evaluations: of the averaged rates.
        end: (X, omega) of a motion with the mean H and energy of the last time, from which `start="osculating"`, `rate`, `equilibrium` and
            `lc.floquet` go on; its phases are to first order, or arbitrary without osculating=True.
    """

    t: Array
    H: Array
    energy: Array
    dynamic_inertia: Array
    k: Array
    phi: Array
    alpha: Array
    osculating_H: Array
    osculating_energy: Array
    mode: tuple[str, ...]
    status: str
    event: TumblingEvent | None
    resonances: tuple[Resonance, ...]
    dropped: tuple[tuple[int, int], ...]
    torque_ratio: float
    evaluations: int
    end: tuple[Array, Array] = field(repr=False)


@dataclass(frozen=True, eq=False, repr=False)
class DirectRun(Saved):
    """The true motion.

    Attributes:
        t: (n,) [s].
        X: (n, 3, 3) body to inertial.
        omega: (n, 3) [rad/s], body axes.
        H: (n, 3) inertial [N m s].
        energy: (n,) [J].
        steps: taken.
    """

    t: Array
    X: Array
    omega: Array
    H: Array
    energy: Array
    steps: int

    @property
    def dynamic_inertia(self) -> Array:
        """(n,) L^2 / 2T [kg m^2]."""
        return np.asarray(np.sum(self.H**2, axis=-1) / (2 * self.energy))
