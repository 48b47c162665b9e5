"""What water adds to a rigid body on SE(3): added mass, damping, weight and buoyancy, and a current.

With body velocity xi = (Omega, V), world axes with e_3 down, xi_r = xi - (0, R' c) the velocity through a steady
uniform current c, r_G and r_B from the body origin to the centres of gravity and buoyancy:

    I = I_body + I_added,   f = -D xi_r - D_q |xi_r| xi_r + (r_G x W R' e_3 - r_B x B R' e_3, (W - B) R' e_3)

    f_current = ad*_{xi_r} I_a xi_r - ad*_xi I_a xi + I_a c_b',  c_b' = (0, (R' c) x Omega)

where f_current turns the added mass of Kirchhoff's equations for xi into that for xi_r. Leonard's and Fossen's terms
in the convention of Bullo and Murray, CIT-CDS 97-003, (27).
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from lie_codegen.control.second_order_step import ForceBody
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import eigenvalues, positive_matrix, real_number, symmetric_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import random_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import ad_star
from lie_codegen.kernel.definition import kernel_factory, record_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, cross, dot, matvec, minus, number, plus, scaled
from lie_codegen.kernel.parameter import INPUT, Parameter, input_ports, is_input, sample_inputs, values_of
from lie_codegen.kernel.saved import Saved
from lie_codegen.kernel.structural_zeros import is_zero
from lie_codegen.on_demand import sympy as sp

_RIGID = ("w1", "w2", "w3", "v1", "v2", "v3")


@dataclass(frozen=True, eq=False, repr=False)
class UnderwaterVehicle(Saved):
    """A vehicle; made by `underwater_vehicle`.

    Attributes:
        group: SE(3) with labels w1 w2 w3 v1 v2 v3.
        inertia: (6, 6) body and added inertia.
        added: (6, 6) added inertia.
        linear, quadratic: (6, 6) symmetric and (6,) damping.
        weight, buoyancy: [N].
        r_G, r_B: (3) centres of gravity and of buoyancy [m].
        current: (3) velocity of the water in the world [m/s].

    Each is exact, or "input" where it is an input of the kernels.
    """

    group: MatrixGroup
    inertia: sp.ImmutableMatrix | str
    added: sp.ImmutableMatrix | str
    linear: sp.ImmutableMatrix | str
    quadratic: tuple[sp.Expr, ...] | str
    weight: sp.Expr | str
    buoyancy: sp.Expr | str
    r_G: tuple[sp.Expr, ...] | str
    r_B: tuple[sp.Expr, ...] | str
    current: tuple[sp.Expr, ...] | str

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The numbers of the forces, in the order in which those that are inputs stand in a kernel."""

        def of(
            name: str, value: Any, shape: tuple[int, ...], units: str, description: str, any_sign: bool = False
        ) -> Parameter:
            return Parameter(Port(name, shape, units, False, description, any_sign), None if is_input(value) else value)

        return (
            of("added", self.added, (6, 6), "", "added inertia, symmetric", True),
            of("linear_damping", self.linear, (6, 6), "", "symmetric", True),
            of("quadratic_damping", self.quadratic, (6,), "", "of each component of the velocity", True),
            of("weight", self.weight, (), "N", "", True),
            of("buoyancy", self.buoyancy, (), "N", "", True),
            of("r_G", self.r_G, (3,), "m", "centre of gravity", True),
            of("r_B", self.r_B, (3,), "m", "centre of buoyancy", True),
            of("current", self.current, (3,), "m/s", "velocity of the water in the world", True),
        )


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

    Args:
        group: SE(3) in the order w, v.
        inertia, added: (6, 6), a diagonal or a number, of the body and of the water that moves with it [kg m^2, kg].
        linear_damping: likewise, D of the force -D v, v the velocity through the water.
        quadratic_damping: (6,), D_i of the force -D_i |v_i| v_i.
        weight, buoyancy: [N], down and up.
        r_G, r_B: (3,) centres of gravity and buoyancy in the body [m].
        current: (3,) velocity of the water in the world [m/s].

    Each number may be "input": then it is an input of `underwater_kernel` and of a `compensated` law, of that name and behind the others,
    and its signs are not checked. The inertia is one of the law's: `vehicle.inertia` is "input" then, as the sum with "added" cannot be made.

    Raises:
        InputError: the group is not SE(3) in the order w, v; the total inertia is indefinite; a damping is negative; added or weight is an
            input and the inertia or the buoyancy, which follow from it, are not.
    """
    group = as_group(group, "underwater_vehicle")
    if group.labels != _RIGID or group.degree != 4:
        raise InputError(f"an underwater vehicle moves on se3 with labels {', '.join(_RIGID)}; reorder {group.name}")
    if is_input(added) and not is_input(inertia):
        raise InputError(
            'underwater_vehicle: added is an input, so that the total inertia is none of its numbers: give inertia="input" too'
        )
    if is_input(weight) and buoyancy is None:
        raise InputError(
            'underwater_vehicle: weight is an input, and no buoyancy is given: give a number or buoyancy="input"'
        )
    extra = _read(added, lambda value: symmetric_matrix(value, 6, "added"))
    total = _read(
        inertia,
        lambda value: positive_matrix((symmetric_matrix(value, 6, "inertia") + extra).tolist(), 6, "inertia + added"),
    )
    quadratic = _read(quadratic_damping, lambda value: _vector(value, 6, "quadratic_damping"))
    linear = _read(linear_damping, lambda value: symmetric_matrix(value, 6, "linear_damping"))
    drives = not is_input(quadratic) and any(value < 0 for value in quadratic)
    if drives or (not is_input(linear) and eigenvalues(linear)[0] < -1e-12):
        raise InputError("damping must not be negative: it would drive the vehicle")
    W = _read(weight, lambda value: real_number(value, "weight"))
    B = W if buoyancy is None else _read(buoyancy, lambda value: real_number(value, "buoyancy"))
    centres: list[Any] = [
        value if is_input(value) else _vector(value, 3, name)
        for name, value in (("r_G", r_G), ("r_B", r_B), ("current", current))
    ]
    return UnderwaterVehicle(group, total, extra, linear, quadratic, W, B, *centres)


def _read(value: Any, read: Callable[[Any], Any]) -> Any:
    """What it reads, or the word "input"."""
    return INPUT if is_input(value) else read(value)


def underwater_forces(vehicle: UnderwaterVehicle) -> ForceBody:
    """The body force (ops, t, X, xi) -> (6,), for `closed_loop(external=...)`; I is `vehicle.inertia`.

    Raises:
        InputError: a number of it is an input.
    """
    names = [port.name for port in input_ports(vehicle.parameters)]
    if names:
        raise InputError(
            f'underwater_forces: {", ".join(names)} of the vehicle cannot be "input" here: a function of (t, X, xi) has no other inputs; '
            "underwater_kernel and compensated have them"
        )

    def force(ops: Arithmetic, _t: Scalar, X: Any, xi: Vector) -> Vector:
        return _forces(ops, vehicle, X, xi)

    return force


@kernel_factory()
def underwater_kernel(vehicle: UnderwaterVehicle, name: str = "underwater_forces") -> Kernel:
    """(X (4, 4), xi (6,) [rad/s, m/s]) -> force (6,) [N m, N]: damping, weight and buoyancy, added mass in a current.

    To be cancelled by a law or added to a simulation. Numbers of the vehicle that are "input" are further inputs, in its order.

    Raises:
        IdentifierError: a name that is no C identifier.
    """
    return Kernel(
        name=name,
        namespace=vehicle.group.name,
        inputs=(
            Port("X", (4, 4), description="body to world, e_3 down"),
            Port("xi", (6,), "rad/s, rad/s, rad/s, m/s, m/s, m/s", description="body velocity (Omega, V)"),
            *input_ports(vehicle.parameters),
        ),
        outputs=(Port("force", (6,), "N m, N m, N m, N, N, N"),),
        body=lambda ops, X, xi, *given: (_forces(ops, vehicle, X, xi, given),),
        sampler=lambda rng: (*_sample(vehicle.group, rng), *sample_inputs(vehicle.parameters, rng)),
        formula="damping of the velocity through the water, weight and buoyancy, added mass in a current",
        source="Bullo and Murray, CIT-CDS 97-003, section 5.4; terms after Fossen and Leonard",
    )


@kernel_factory()
def compensated(law: Kernel, vehicle: UnderwaterVehicle, name: str | None = None) -> Kernel:
    """A tracking law on SE(3) with the vehicle's forces taken off: force - f(X, xi), (6,) [N m, N], so that the loop sees none of them.

    Args:
        law: (X, xi, ...) -> (force, ...), as `tracking_law` makes it.
        vehicle: whose forces f are; its numbers that are "input" are inputs of the new law, behind those of the old one.
        name: C identifier, the law's own if None.

    Raises:
        IdentifierError: name is no C identifier.
        ArgumentError: law is no kernel, or vehicle is none.
    """
    count, sampler = len(law.inputs), law.sampler

    def body(ops: Arithmetic, X: Any, xi: Vector, *rest: Any) -> tuple[Any, ...]:
        force, *others = law.evaluate(ops, X, xi, *rest[: count - 2])
        return minus(force, _forces(ops, vehicle, X, xi, rest[count - 2 :])), *others

    return replace(
        law,
        name=name or law.name,
        inputs=(*law.inputs, *input_ports(vehicle.parameters)),
        body=body,
        formula=f"{law.formula}; less the forces of the water",
        sampler=None if sampler is None else lambda rng: (*sampler(rng), *sample_inputs(vehicle.parameters, rng)),
    )


def _sample(group: MatrixGroup, rng: random.Random) -> tuple[Any, ...]:
    return random_element(group, derivation_of(group).wei_norman, rng), [rng.uniform(-1, 1) for _ in range(6)]


def _forces(
    ops: Arithmetic, vehicle: UnderwaterVehicle, X: Any, xi: Sequence[Scalar], given: Sequence[Any] = ()
) -> Vector:
    added, linear, quadratic, W, B, r_G, r_B, flow_world = values_of(ops, vehicle.parameters, given)
    down = [X[2][j] for j in range(3)]  # R' e_3
    flow = [dot([X[i][j] for i in range(3)], flow_world) for j in range(3)]
    relative = minus(xi, [0, 0, 0, *flow])
    drag = matvec(linear, relative)
    drag = plus(drag, [0 if is_zero(q) else q * ops.fabs(v) * v for q, v in zip(quadratic, relative, strict=True)])
    arm = minus(scaled(W, r_G), scaled(B, r_B))
    # Exact where both are known: a neutral vehicle has no net force, and not a rounding error of it.
    weight, buoyancy = vehicle.weight, vehicle.buoyancy
    exact = None if isinstance(weight, str) or isinstance(buoyancy, str) else weight - buoyancy
    net = W - B if exact is None else number(ops, exact)
    restoring = [*cross(arm, down), *scaled(net, down)]
    total = minus(restoring, drag)
    if any(vehicle.current) and not all(is_zero(entry) for row in added for entry in row):
        algebra = vehicle.group.algebra
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
