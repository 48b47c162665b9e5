"""Steering tasks with bounds and drift that are feasible by construction, and gates with published values."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import group as catalogue_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.pauli import pauli


@dataclass(frozen=True, eq=False)
class BoundedCase:
    """Reach a target from the identity with |u_i| <= bound, X' = X hat(drift + sum u_i b_i).

    Attributes:
        group, directions, drift: the system; directions (m, n).
        duration, bound, pieces: of the controls.
        targets: (k, d, d).
        up_to_phase: whether any phase of a target will do.
    """

    name: str
    group: MatrixGroup = field(repr=False)
    directions: Array = field(repr=False)
    drift: Array = field(repr=False)
    duration: float
    bound: float
    pieces: int
    targets: Array = field(repr=False)
    up_to_phase: bool = False

    @property
    def unitary(self) -> bool:
        """Whether the group is one of unitary matrices."""
        return self.group.is_complex


def bounded_cases(targets: int, seed: int) -> list[BoundedCase]:
    """The tasks; random targets are the ends of random bounded controls on a grid that nobody uses, gates come once a seed."""
    rng = np.random.default_rng(seed)
    made = [
        _random("SO(3), one control and drift", "so3", ("w1",), (0, 0, 1), targets, rng),
        _random("SE(2), a car that cannot stop", "se2", ("omega",), (0, 1, 0), targets, rng),
        _random("SE(3), three rates and drift", "se3", ("w1", "w2", "w3"), (0, 0, 0, 1, 0, 0), targets, rng),
        _random("SU(2), one control and drift", "su2", ("sx",), (0, 0, 1), targets, rng),
    ]
    two = pauli(2)
    if not isinstance(two, MatrixGroup):
        raise InputError("pauli(2) is a group")
    cnot = np.eye(4, dtype=complex)[[0, 1, 3, 2]]
    local = np.eye(15)[[two.labels.index(label) for label in ("XI", "YI", "IX", "IY")]]
    coupling = np.eye(15)[two.labels.index("ZZ")]
    for duration, bound in ((6.0, 4.0), (6.0, 1.0), (3.0, 4.0), (2.0, 8.0)):
        name = f"CNOT, T = {duration:g}, |u| <= {bound:g}"
        made.append(
            BoundedCase(name, two, local, coupling, duration, bound, 30, np.repeat(cnot[None], targets, 0), True)
        )
    return made


def _random(
    name: str,
    group_name: str,
    controls: tuple[str, ...],
    drift: tuple[float, ...],
    count: int,
    rng: np.random.Generator,
) -> BoundedCase:
    group = catalogue_group(group_name)
    directions = np.eye(group.dim)[[group.labels.index(label) for label in controls]]
    velocity = np.array(drift, dtype=float)
    ends = []
    for _ in range(count):
        X = np.eye(group.degree, dtype=group.basis.dtype)
        for step in expm(group.hat(5.0 / 37 * (velocity + rng.uniform(-1, 1, (37, len(controls))) @ directions))):
            X = X @ step
        ends.append(X)
    return BoundedCase(name, group, directions, velocity, 5.0, 1.0, 48, np.array(ends))
