"""One step of a mechanical system on a group: X' = X hat(xi), I xi' = ad*_xi I xi + f(t, X, xi), to fourth order.

The state is the varying entries of X followed by xi, and by controller states if there are any, as one vector, so that
`scan` and `batch` take it. The group part is Runge-Kutta-Munthe-Kaas: four stages in the algebra, X exp(Theta) at
the end, on the group to rounding for |h xi| <= 1/4. Munthe-Kaas, BIT 38 (1998) 92.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from lie_codegen.control.reference_motion import Reference
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.maps.matrices import random_element
from lie_codegen.groups.maps.rkmk import times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.units import force_units
from lie_codegen.groups.wei_norman.body import WeiNormanData
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, bracket, constant_matrix, matmul, plus, scaled
from lie_codegen.kernel.parameter import Parameter, parameter
from lie_codegen.mechanics.kernels import acceleration

#: (ops, t, X, xi) -> (n,) body force.
ForceBody = Callable[[Arithmetic, Scalar, Any, Vector], Vector]
#: (ops, stage, t, X, xi, z) -> (n,) body force and the rate of the law's own state z; stage 0, 1, 2 at t, t + h/2, t + h.
StageForce = Callable[[Arithmetic, int, Scalar, Any, Vector, Vector], tuple[Vector, Vector]]

_ATTITUDE = ("X", "omega")
_TRACKING = ("X", "xi", "X_d", "xi_d", "xi_d_dot")


def check_loop(law: Kernel | None, reference: Reference | None) -> None:
    """A law that can be simulated, with the reference it needs.

    Raises:
        InputError: the law has other inputs than (X, omega) or (X, xi, X_d, xi_d, xi_d_dot), each perhaps with states of
            its own behind (an input `integral` beside an output `integral_dot`), or lacks its reference.
    """
    if law is not None and _tracks(law) and reference is None:
        raise InputError(f"the law {law.name} tracks: give it a reference")


@kernel_factory()
def second_order_step(
    group: MatrixGroup,
    inertia: Any,
    force: ForceBody | None = None,
    *,
    law: Kernel | None = None,
    name: str = "second_order_step",
) -> Kernel:
    """The step (state, t, h) -> (state_next,).

    Under a tracking law the step takes the reference as inputs too: (X_d, xi_d, xi_d_dot) at t, t + h/2 and t + h, in
    arrays of three rows, X_d flat; so it is evaluated once for any number of runs.

    Args:
        group: any matrix group.
        inertia: symmetric positive definite; or "input": then `inertia` and `inertia_inverse`, (n, n), are inputs, so that
            one library serves every body.
        force: body force beside the law; None for none.
        law: an attitude or tracking law; None for none. Parameters of the law that are inputs become inputs of the step;
            its `inertia` is that of the body if that is an input too.
        name: C identifier.

    Raises:
        InputError: the inertia is not symmetric positive definite, or the law has other inputs than those.
    """
    n = group.dim
    metric = parameter(Port("inertia", (n, n), description="of the body, symmetric"), inertia, read_inertia(n))
    size, move = packed_size(group), Move(group)
    tracks = law is not None and _tracks(law)
    own = () if law is None else law_states(law)
    tuned = step_parameters(metric, law)
    extent = size + n + sum(port.size for port in own)

    def body(ops: Arithmetic, state: Vector, t: Scalar, h: Scalar, *rest: Any) -> tuple[Any, ...]:
        X, xi, z = unpack(group, state[:size]), list(state[size : size + n]), list(state[size + n :])
        reference, given = (rest[:3], rest[3:]) if tracks else ((), rest)
        stages = [(_square(group, X_d), xi_d, rate) for X_d, xi_d, rate in zip(*reference, strict=True)]
        numbers = dict(zip((port.name for port in tuned), given, strict=True))
        if metric.value is None:
            body_inertia = numbers["inertia"], numbers["inertia_inverse"]
        else:
            body_inertia = constant_matrix(ops, metric.value), constant_matrix(ops, metric.value.inv())

        def applied(
            ops: Arithmetic, stage: int, time: Scalar, Y: Any, eta: Vector, zeta: Vector
        ) -> tuple[Vector, Vector]:
            total: Vector = [0] * group.dim if force is None else force(ops, time, Y, eta)
            if law is None:
                return total, []
            parts = dict(zip((port.name for port in own), _parts(own, zeta), strict=True))
            behind = [parts[p.name] if p.name in parts else numbers[p.name] for p in _behind(law)]
            given = law.evaluate(ops, Y, eta, *(stages[stage] if tracks else ()), *behind)
            by_name = dict(zip((port.name for port in law.outputs), given, strict=True))
            return plus(total, given[0]), [x for port in own for x in by_name[f"{port.name}_dot"]]

        Theta, change, drift = increments(ops, move, body_inertia, applied, X, xi, t, h, z)
        return ([*pack(group, move(ops, X, Theta)), *plus(xi, change), *(plus(z, drift) if z else ())],)

    data = WeiNormanData(group)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        def vector() -> list[float]:
            return [rng.uniform(-1, 1) for _ in range(group.dim)]

        rest = [rng.uniform(-1, 1) for _ in range(extent - size - group.dim)]
        state = [*pack(group, random_element(group, data, rng)), *vector(), *rest]
        flat = [[z for row in random_element(group, data, rng) for z in row] for _ in range(3)]
        reference = (flat, [vector() for _ in range(3)], [vector() for _ in range(3)]) if tracks else ()
        return state, rng.uniform(0, 1), rng.uniform(0, 0.05), *reference, *(_sample(port, rng) for port in tuned)

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            Port(
                "state", (extent,), description="varying entries of X, row by row, then xi, then the law's own states"
            ),
            Port("t", (), "s"),
            Port("h", (), "s"),
            *(_reference_ports(group) if tracks else ()),
            *tuned,
        ),
        outputs=(Port("state_next", (extent,)),),
        body=body,
        formula="X' = X hat(xi), I xi' = ad*_xi I xi + f: one RKMK4 step",
        source="Munthe-Kaas, BIT 38 (1998) 92; Bullo and Murray, CIT-CDS 97-003, (10)",
        sampler=sampler,
    )


def _tracks(law: Kernel) -> bool:
    """Whether the law takes a reference.

    Raises:
        InputError: its inputs are neither (X, omega) nor (X, xi, X_d, xi_d, xi_d_dot), with states and parameters of its own
            behind.
    """
    names = tuple(port.name for port in law.inputs)
    for known in (_TRACKING, _ATTITUDE):
        behind = law.inputs[len(known) :]
        if names[: len(known)] == known and all(_is_state(law, p) or _is_parameter(law, p) for p in behind):
            return known is _TRACKING
    raise InputError(
        f"the law {law.name} has the inputs {', '.join(names)}; a closed loop needs {', '.join(_ATTITUDE)} or "
        f"{', '.join(_TRACKING)}, and behind them only states of the law (vectors z with an output z_dot of their size) and "
        'parameters that are inputs ("input")'
    )


def _is_state(law: Kernel, port: Port) -> bool:
    results = {each.name: each.shape for each in law.outputs}
    return len(port.shape) == 1 and results.get(f"{port.name}_dot") == port.shape


def _is_parameter(law: Kernel, port: Port) -> bool:
    """By what the law is defined by: a number of that name, there or among its gains."""
    given = {} if law.definition is None else law.definition["parameters"]
    nested = [value for value in given.values() if isinstance(value, Mapping)]
    names = {_letters(key) for each in (given, *nested, *(n.get("parameters", {}) for n in nested)) for key in each}
    return _letters(port.name) in names


def _letters(name: str) -> str:
    """K_d, Kd and k_d are one gain."""
    return name.replace("_", "").lower()


def _behind(law: Kernel) -> tuple[Port, ...]:
    """The inputs behind the usual ones."""
    return law.inputs[len(_TRACKING if _tracks(law) else _ATTITUDE) :]


def law_states(law: Kernel) -> tuple[Port, ...]:
    """The states of the law itself, as the integral of `integral_law`; all zero at the start."""
    return tuple(port for port in _behind(law) if _is_state(law, port))


def law_parameters(law: Kernel) -> tuple[Port, ...]:
    """The numbers of the law that are inputs."""
    return tuple(port for port in _behind(law) if not _is_state(law, port))


def step_parameters(metric: Parameter, law: Kernel | None) -> tuple[Port, ...]:
    """The numbers that are inputs of the step: the inertia with its inverse, and those of the law."""
    inertia = (metric.port, replace(metric.port, name="inertia_inverse")) if metric.value is None else ()
    known = {port.name for port in inertia}
    return (*inertia, *(port for port in (law_parameters(law) if law is not None else ()) if port.name not in known))


def read_inertia(size: int) -> Callable[[Any, str], sp.ImmutableMatrix]:
    """(value, name) -> an exact symmetric positive definite matrix."""
    return lambda value, name: positive_matrix(value, size, name)


def _sample(port: Port, rng: random.Random) -> Any:
    if not port.shape:
        return rng.uniform(0.5, 2)
    return [[float(i == j) for j in range(port.shape[1])] for i in range(port.shape[0])]


def _parts(ports: Sequence[Port], flat: Vector) -> list[Vector]:
    parts, start = [], 0
    for port in ports:
        parts.append(list(flat[start : start + port.size]))
        start += port.size
    return parts


def _reference_ports(group: MatrixGroup) -> tuple[Port, ...]:
    when = "at t, t + h/2, t + h"
    return (
        Port("X_d", (3, group.degree**2), is_complex=group.is_complex, description=f"reference {when}, row by row"),
        Port("xi_d", (3, group.dim), description=f"its velocity {when}"),
        Port("xi_d_dot", (3, group.dim), description=f"the rate of that {when}"),
    )


def _square(group: MatrixGroup, flat: Sequence[Any]) -> list[list[Any]]:
    d = group.degree
    return [list(flat[d * i : d * (i + 1)]) for i in range(d)]


@kernel_factory()
def held_force_step(group: MatrixGroup, inertia: Any, name: str = "held_force_step") -> Kernel:
    """The step (state, force, h) -> (state_next,) under a constant body force, as a sampled controller gives it.

    Raises:
        InputError: the inertia is not symmetric positive definite.
    """
    metric = positive_matrix(inertia, group.dim, "inertia")
    size, move = packed_size(group), Move(group)

    def body(ops: Arithmetic, state: Vector, force: Vector, h: Scalar) -> tuple[Any, ...]:
        X, xi = unpack(group, state[:size]), list(state[size:])
        inertia = constant_matrix(ops, metric), constant_matrix(ops, metric.inv())
        Theta, change, _ = increments(ops, move, inertia, lambda *_: (list(force), []), X, xi, 0, h)
        return ([*pack(group, move(ops, X, Theta)), *plus(xi, change)],)

    data = WeiNormanData(group)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        xi, force = ([rng.uniform(-1, 1) for _ in range(group.dim)] for _ in range(2))
        return [*pack(group, random_element(group, data, rng)), *xi], force, rng.uniform(0, 0.05)

    port = (size + group.dim,)
    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            Port("state", port, description="varying entries of X, row by row, then xi"),
            Port("force", (group.dim,), force_units(group), description="body force, constant over the step"),
            Port("h", (), "s"),
        ),
        outputs=(Port("state_next", port),),
        body=body,
        formula="X' = X hat(xi), I xi' = ad*_xi I xi + f with constant f: one RKMK4 step",
        source="Munthe-Kaas, BIT 38 (1998) 92; Bullo and Murray, CIT-CDS 97-003, (10)",
        sampler=sampler,
    )


class Move:
    """(ops, X, theta) -> X exp(hat(theta)): in closed form where the group has one, else by the Taylor polynomial."""

    def __init__(self, group: MatrixGroup) -> None:
        self.group = group
        self.derivation = GroupDerivation(group)

    def __call__(self, ops: Arithmetic, X: Any, theta: Vector) -> Any:
        if self.derivation.matrix_pattern is None:
            return times_taylor_exp(self.group, ops, X, theta)
        return matmul(X, exp_matrix(ops, self.derivation, theta))


def increments(
    ops: Arithmetic,
    move: Move,
    inertia: tuple[Matrix, Matrix],
    force: StageForce,
    X: Any,
    xi: Vector,
    t: Scalar,
    h: Scalar,
    z: Vector | None = None,
) -> tuple[Vector, Vector, Vector]:
    """Theta and the changes of xi and z over a step; the force is told which of t, t + h/2, t + h it is asked for."""
    group, own = move.group, [] if z is None else z

    def rates(stage: int, Y: Any, eta: Vector, zeta: Vector) -> tuple[Vector, Vector]:
        time = (t, t + h / 2, t + h)[stage]
        applied, drift = force(ops, stage, time, Y, eta, zeta)
        return acceleration(ops, group, *inertia, eta, applied), drift

    def pulled(theta: Vector, eta: Vector) -> Vector:
        """Theta' = eta + [Theta, eta]/2 + [Theta, [Theta, eta]]/12, signs for X' = X hat(xi)."""
        once = bracket(ops, group.algebra, theta, eta)
        twice = bracket(ops, group.algebra, theta, once)
        return [e + a / 2 + b / 12 for e, a, b in zip(eta, once, twice, strict=True)]

    k, (a, c) = xi, rates(0, X, xi, own)
    stages = [(k, a, c, 1)]
    for stage, part, weight in ((1, h / 2, 2), (1, h / 2, 2), (2, h, 1)):
        theta, eta = scaled(part, k), plus(xi, scaled(part, a))
        zeta = plus(own, scaled(part, c)) if own else []
        a, c = rates(stage, move(ops, X, theta), eta, zeta)
        k = pulled(theta, eta)
        stages.append((k, a, c, weight))
    Theta = plus(*[scaled(h * w / 6, k) for k, _, _, w in stages])
    change = plus(*[scaled(h * w / 6, a) for _, a, _, w in stages])
    return Theta, change, plus(*[scaled(h * w / 6, c) for _, _, c, w in stages]) if own else []
