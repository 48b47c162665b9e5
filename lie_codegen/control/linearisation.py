"""The linearised closed loop of a tracking law about a reference at rest: I x'' + K_d x' + H x = 0, H the Hessian of phi."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.control.attitude import gains_for_response
from lie_codegen.control.compatibility import check_compatibility
from lie_codegen.control.error_catalogue import as_error, gain
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import as_floats, positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved


@dataclass(frozen=True, eq=False, repr=False)
class LinearLoop(Saved):
    """The loop near its reference.

    Attributes:
        stiffness: (n, n) H.
        eigenvalues: (2 n,) of the first-order form.
        frequencies, damping: natural frequency [rad/s] and damping ratio of each, from |lambda| and -Re
        lambda/|lambda|.
    """

    stiffness: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    frequencies: NDArray[np.float64]
    damping: NDArray[np.float64]


def linear_loop(group: GroupLike, *, inertia: Any, error: Any, gains: Mapping[str, Any]) -> LinearLoop:
    """The linearisation I xi_e' = -K_d xi_e - H eta at rest of `tracking_law` with the same arguments; every feedforward has the same.

    Args:
        group: object, catalogue name or file.
        inertia: symmetric positive definite: a number, (n,) or (n, n).
        error: as in `tracking_law`; H is its Hessian at the reference.
        gains: K_d and those of the error function.

    Raises:
        InputError: as `tracking_law`.
    """
    group = as_group(group, "linear_loop")
    n = group.dim
    metric = as_floats(positive_matrix(inertia, n, "inertia"))
    K_d = as_floats(positive_matrix(gain(gains, "K_d", "a tracking law"), n, "K_d"))
    H = np.array(check_compatibility(as_error(group, error, gains)).hessian)
    lower = -np.linalg.solve(metric, np.hstack([H, K_d]))
    values = np.linalg.eigvals(np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower]))
    size = np.abs(values)
    return LinearLoop(H, values, size, -values.real / size)


def rigid_gains(group: GroupLike, inertia: Any, *, bandwidth: Any, damping: Any = 0.7) -> dict[str, Any]:
    """K_1, K_2 and K_d for rows 1 to 3 on SE(3), or K_p and K_d on SO(3), with every mode at the wanted bandwidth.

    Args:
        group: SO(3), or SE(3) with labels in the order w, v.
        inertia: without coupling between rotation and translation on SE(3).
        bandwidth: [rad/s].
        damping: damping ratio.

    Raises:
        InputError: another group, a coupled inertia, a bandwidth or damping that is not positive.
    """
    group = as_group(group, "rigid_gains")
    if (group.degree, group.dim) == (3, 3):
        found = gains_for_response(inertia, bandwidth=bandwidth, damping=damping)
        return {"K_p": found.K_p, "K_d": found.K_d}
    if (group.degree, group.dim) != (4, 6):
        raise InputError(f"gains for a wanted response are known for SO(3) and SE(3), not for {group.name}")
    found = gains_for_response(inertia, bandwidth=bandwidth, damping=damping, size=6)
    if np.any(found.stiffness[:3, 3:]):
        raise InputError("the inertia couples rotation and translation: put the body origin at the centre of mass")
    turning = found.stiffness[:3, :3]
    return {"K_1": np.trace(turning) * np.eye(3) - 2 * turning, "K_2": found.stiffness[3:, 3:], "K_d": found.K_d}
