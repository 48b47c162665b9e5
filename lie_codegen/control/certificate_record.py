"""What is known of one tracking loop on one level of W, and what it says of a state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.critical_points import CriticalPoints
from lie_codegen.control.descent import comes_home
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.control.error_samples import error_samples
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.shapes import shaped


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Saved):
    """The constants of one loop on one level.

    Attributes:
        error, inertia, K_d, feedforward: the loop.
        L: least critical value of phi other than at the reference, or the smaller constant that was claimed; (A1).
        L_component: least value of a mountain pass out of the component of the reference; L or above it.
        level: of W; every constant below holds on phi <= level.
        speed: V, the largest |nu|_I of the transported reference velocity.
        reach: largest entry of X_d and its inverse, where phi is not left-invariant; infinite where it is.
        b_1, b_2: extreme values of phi/|d phi|^2 that were found.
        b_1_proved, b_2_proved: bounds of these proved in interval arithmetic; NaN where there is no proof.
        hessian, hessian_proved: h = sup |H - d phi . nabla|_I, and a proved bound of it.
        transport, transport_proved: t = sup |nabla_Z X|_I over unit vectors, and a proved bound of it.
        epsilon, rate, k: of the pointwise certificate: W(t) <= k W(0) exp(-rate t).
        theorem_epsilon, theorem_rate, theorem_k: of Theorem 4.2, by suprema one by one; NaN for other feedforwards than levi_civita.
        theorem_rate_proved: its rate with the four proved bounds; NaN where one is missing.
        P, Q: (2, 2) its matrices there, P the upper one; P_low proves that W is positive.
        damping_share: the least s of f_D = -s K_d xi_e on the level, for a law with `damping_limits`; 1 without.
        proportional: (n,) largest |d phi_a| that was found on the level, what f_P asks of each actuator.
        limit_rate: of W by the linearisation about a reference at rest: twice that of its slowest mode.
        critical_points: of phi.
        status: how each of these is known.
    """

    error: ErrorFunction
    inertia: Array
    K_d: Array
    feedforward: str
    L: float
    L_component: float
    level: float
    speed: float
    reach: float
    b_1: float
    b_2: float
    b_1_proved: float
    b_2_proved: float
    hessian: float
    hessian_proved: float
    transport: float
    transport_proved: float
    epsilon: float
    rate: float
    k: float
    theorem_epsilon: float
    theorem_rate: float
    theorem_rate_proved: float
    theorem_k: float
    P: Array
    P_low: Array
    Q: Array
    damping_share: float
    proportional: Array
    limit_rate: float
    critical_points: CriticalPoints
    status: str

    @property
    def group(self) -> MatrixGroup:
        """The group."""
        return self.error.group

    def W(self, X: ArrayLike, xi: ArrayLike, X_d: ArrayLike, xi_d: ArrayLike) -> float:
        """W = phi + |xi_e|_I^2/2 at a state, xi_e = xi less the transported xi_d.

        Args:
            X, xi: (d, d) and (n,), the configuration and its body velocity.
            X_d, xi_d: (d, d) and (n,), those of the reference.

        Raises:
            ShapeError, NotOnGroupError: an element or a velocity that is none.
        """
        return self._state(X, xi, X_d, xi_d).W

    def inside(self, X: ArrayLike, xi: ArrayLike, X_d: ArrayLike, xi_d: ArrayLike) -> bool | None:
        """Whether the certificate covers a loop that starts here, the reference staying within `speed` (and `reach`).

        True: W <= level, and all conditions of Theorem 4.2 hold. False: W >= L, and no path downhill from X leads to the reference below a
        mountain pass. None where nothing is known: between, for a faster or farther reference, or where critical points may be missing.

        Args:
            X, xi, X_d, xi_d: as in `W`.

        Raises:
            ShapeError, NotOnGroupError: an element or a velocity that is none.
        """
        W, speed, far, E = self._state(X, xi, X_d, xi_d)
        if speed > self.speed * (1 + 1e-9) + 1e-12 or far > self.reach * (1 + 1e-9):
            return None
        if self.critical_points.status not in ("complete", "degenerate", "cut"):
            return None
        if self.level >= W:
            return True
        if self.L > W or (self.L_component > W and comes_home(error_samples(self.error), E)):
            return None
        return False

    def _state(self, X: ArrayLike, xi: ArrayLike, X_d: ArrayLike, xi_d: ArrayLike) -> LoopState:
        return loop_state(self.error, self.inertia, X, xi, X_d, xi_d)


class LoopState(NamedTuple):
    """W, |nu|_I, the largest entry of X_d and X_d^-1, and a configuration as far from the identity as X is from X_d."""

    W: float
    speed: float
    far: float
    E: Array


def loop_state(
    pair: ErrorFunction, inertia: Array, X: ArrayLike, xi: ArrayLike, X_d: ArrayLike, xi_d: ArrayLike
) -> LoopState:
    """Of a state and its reference.

    Raises:
        ShapeError, NotOnGroupError: an element or a velocity that is none.
    """
    here, there = (admitted(pair.group, each, name).X for each, name in ((X, "X"), (X_d, "X_d")))
    samples = error_samples(pair)
    phi, _ = samples.first(here[None], there[None])
    P, _ = samples.transport(here[None], there[None])
    nu = P[0] @ shaped(xi_d, (pair.group.dim,), "xi_d")
    error = shaped(xi, (pair.group.dim,), "xi") - nu
    back = np.linalg.inv(there)
    E = here @ back if pair.transport == "left" else back @ here
    far = float(max(np.max(np.abs(there)), np.max(np.abs(back))))
    return LoopState(float(phi[0] + error @ inertia @ error / 2), float(np.sqrt(nu @ inertia @ nu)), far, E)
