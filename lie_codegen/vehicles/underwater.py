"""What water adds to a rigid body on SE(3): added mass, damping, weight and buoyancy, and a current.

With body velocity xi = (Omega, V), world axes with e_3 down, xi_r = xi - (0, R' c) the velocity through a steady
uniform current c, r_G and r_B from the body origin to the centres of gravity and buoyancy:

    I = I_body + I_added,   f = -D xi_r - D_q |xi_r| xi_r + (r_G x W R' e_3 - r_B x B R' e_3, (W - B) R' e_3)

    f_current = ad*_{xi_r} I_a xi_r - ad*_xi I_a xi + I_a c_b',  c_b' = (0, (R' c) x Omega)

where f_current turns the added mass of Kirchhoff's equations for xi into that for xi_r. Leonard's and Fossen's terms
in the convention of Bullo and Murray, CIT-CDS 97-003, (27).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from lie_codegen.control.second_order_step import ForceBody
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import eigenvalues, positive_matrix, real_number, symmetric_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory, record_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, ad_star, constant_matrix, cross, dot, matvec, minus, number, plus, scaled
from lie_codegen.on_demand import sympy as sp

_RIGID = ("w1", "w2", "w3", "v1", "v2", "v3")


@dataclass(frozen=True)
class UnderwaterVehicle:
    """A vehicle; made by `underwater_vehicle`.

    Attributes:
        group: SE(3) with labels w1 w2 w3 v1 v2 v3.
        inertia: (6, 6) body and added inertia.
        added: (6, 6) added inertia.
        linear, quadratic: (6, 6) symmetric and (6,) damping.
        weight, buoyancy: [N].
        r_G, r_B: (3) centres of gravity and of buoyancy [m].
        current: (3) velocity of the water in the world [m/s].
    """

    group: MatrixGroup
    inertia: sp.ImmutableMatrix
    added: sp.ImmutableMatrix
    linear: sp.ImmutableMatrix
    quadratic: tuple[sp.Expr, ...]
    weight: sp.Expr
    buoyancy: sp.Expr
    r_G: tuple[sp.Expr, ...]
    r_B: tuple[sp.Expr, ...]
    current: tuple[sp.Expr, ...]


@record_factory(group=as_group)
def underwater_vehicle(
    group: GroupLike,
    *,
    inertia: Any,
    added: Any = 0,
    linear_damping: Any = 0,
    quadratic_damping: Any = 0,
    weight: Any = 0,
    buoyancy: Any = None,
    r_G: Sequence[Any] = (0, 0, 0),
    r_B: Sequence[Any] = (0, 0, 0),
    current: Sequence[Any] = (0, 0, 0),
) -> UnderwaterVehicle:
    """A vehicle from its parameters; buoyancy is the weight if not given (neutral).

    Raises:
        InputError: the group is not SE(3) in the order w, v; the total inertia is indefinite; a damping is negative.
    """
    group = as_group(group, "underwater_vehicle")
    if group.labels != _RIGID or group.degree != 4:
        raise InputError(f"an underwater vehicle moves on se3 with labels {', '.join(_RIGID)}; reorder {group.name}")
    extra = symmetric_matrix(added, 6, "added")
    total = positive_matrix((symmetric_matrix(inertia, 6, "inertia") + extra).tolist(), 6, "inertia + added")
    quadratic = _vector(quadratic_damping, 6, "quadratic_damping")
    linear = symmetric_matrix(linear_damping, 6, "linear_damping")
    if any(value < 0 for value in quadratic) or eigenvalues(linear)[0] < -1e-12:
        raise InputError("damping must not be negative: it would drive the vehicle")
    W = real_number(weight, "weight")
    B = W if buoyancy is None else real_number(buoyancy, "buoyancy")
    centres = (_vector(r_G, 3, "r_G"), _vector(r_B, 3, "r_B"), _vector(current, 3, "current"))
    return UnderwaterVehicle(group, total, extra, linear, quadratic, W, B, *centres)


def underwater_forces(vehicle: UnderwaterVehicle) -> ForceBody:
    """The body force (ops, t, X, xi) -> (6,), for `closed_loop(external=...)`; I is `vehicle.inertia`."""

    def force(ops: Arithmetic, _t: Scalar, X: Any, xi: Vector) -> Vector:
        return _forces(ops, vehicle, X, xi)

    return force


@kernel_factory()
def underwater_kernel(vehicle: UnderwaterVehicle, name: str = "underwater_forces") -> Kernel:
    """(X, xi) -> force, to be cancelled by a law or added to a simulation."""
    return Kernel(
        name=name,
        namespace=vehicle.group.name,
        inputs=(
            Port("X", (4, 4), description="body to world, e_3 down"),
            Port("xi", (6,), "rad/s, rad/s, rad/s, m/s, m/s, m/s", description="body velocity (Omega, V)"),
        ),
        outputs=(Port("force", (6,), "N m, N m, N m, N, N, N"),),
        body=lambda ops, X, xi: (_forces(ops, vehicle, X, xi),),
        formula="damping of the velocity through the water, weight and buoyancy, added mass in a current",
        source="Bullo and Murray, CIT-CDS 97-003, section 5.4; terms after Fossen and Leonard",
    )


@kernel_factory()
def compensated(law: Kernel, vehicle: UnderwaterVehicle, name: str | None = None) -> Kernel:
    """A tracking law on SE(3) with the vehicle's forces taken off: force - f(X, xi), so that the loop sees none of them."""

    def body(ops: Arithmetic, X: Any, xi: Vector, *reference: Any) -> tuple[Any, ...]:
        force, *others = law.evaluate(ops, X, xi, *reference)
        return minus(force, _forces(ops, vehicle, X, xi)), *others

    return replace(law, name=name or law.name, body=body, formula=f"{law.formula}; less the forces of the water")


def _forces(ops: Arithmetic, vehicle: UnderwaterVehicle, X: Any, xi: Sequence[Scalar]) -> Vector:
    down = [X[2][j] for j in range(3)]  # R' e_3
    flow_world = [number(ops, c) for c in vehicle.current]
    flow = [dot([X[i][j] for i in range(3)], flow_world) for j in range(3)]
    relative = minus(xi, [0, 0, 0, *flow])
    drag = matvec(constant_matrix(ops, vehicle.linear), relative)
    if any(vehicle.quadratic):
        pairs = zip(vehicle.quadratic, relative, strict=True)
        drag = plus(drag, [0 if q == 0 else number(ops, q) * ops.fabs(v) * v for q, v in pairs])
    W, B = number(ops, vehicle.weight), number(ops, vehicle.buoyancy)
    arm = minus(scaled(W, [number(ops, r) for r in vehicle.r_G]), scaled(B, [number(ops, r) for r in vehicle.r_B]))
    restoring = [*cross(arm, down), *scaled(number(ops, vehicle.weight - vehicle.buoyancy), down)]
    total = minus(restoring, drag)
    if any(vehicle.current) and any(vehicle.added.flat()):
        added, algebra = constant_matrix(ops, vehicle.added), vehicle.group.algebra
        turning = [0, 0, 0, *cross(flow, list(xi[:3]))]
        through = ad_star(ops, algebra, relative, matvec(added, relative))
        still = ad_star(ops, algebra, xi, matvec(added, xi))
        total = plus(total, through, scaled(-1, still), matvec(added, turning))
    return total


def _vector(value: Any, size: int, what: str) -> tuple[sp.Expr, ...]:
    rows = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(rows, list | tuple):
        return tuple(real_number(rows, what) for _ in range(size))
    if len(rows) != size:
        raise ShapeError(f"{what} has {len(rows)} entries; give {size}")
    return tuple(real_number(entry, f"{what}[{i}]") for i, entry in enumerate(rows))
