"""Kernels of vibrationally averaged systems: averaged rate, actual rate, estimator and reconstruction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.mechanics.vibrational_fields import VibrationalFields, fast_time
from lie_codegen.on_demand import sympy as sp

SOURCE = "Sanyal, Bloch and McClamroch, Control of mechanical systems with cyclic coordinates"
_EPS = Port("eps", (), "1", description="ratio of the fast to the slow time scale")
_TAU = Port("tau", (), "1", description="fast time t / eps")


@kernel_factory()
def vibrational_kernels(fields: VibrationalFields, namespace: str) -> tuple[Kernel, ...]:
    """rate (averaged), actual, estimate, estimate_first and reconstruct of an averaged system.

    rate(z, eps) = Z_1 + eps Z_2; actual(y, tau, eps) = X + (1/eps) Y_a u^a(tau);
    estimate(y, tau, eps) = P^{-1}(Phi^{-1}(y)), (24), `estimate_first` without P;
    reconstruct(z, tau, eps) = Phi(P(z)). Parameters that stayed symbols are further scalar inputs, in order.

    Args:
        fields: of `vibrational_fields`.
        namespace: C identifier that begins the symbols.

    Raises:
        IdentifierError: namespace is no C identifier.
        ArgumentError: fields are no such fields.
    """
    n = len(fields.state)
    z, y = Port("z", (n,), description="averaged state (q, v)"), Port("y", (n,), description="actual state (q, v)")
    parameters = tuple(Port(str(p), ()) for p in fields.parameters)

    def kernel(
        name: str, inputs: tuple[Port, ...], output: str, make: Callable[..., list[Scalar]], text: str
    ) -> Kernel:
        def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
            own, given = arguments[: len(inputs)], arguments[len(inputs) :]
            values = dict(zip(fields.parameters, given, strict=True))
            return (make(ops, values, *own),)

        return Kernel(name, namespace, (*inputs, *parameters), (Port(output, (n,)),), body, text, SOURCE)

    def at(ops: Arithmetic, values: dict[sp.Symbol, Scalar], state: Any, tau: Scalar = 0) -> ExpressionEvaluator:
        return ExpressionEvaluator(ops, {**values, **dict(zip(fields.state, state, strict=True)), fast_time(): tau})

    def moved(evaluate: ExpressionEvaluator, state: Any, field: Any, factor: Scalar) -> list[Scalar]:
        return [x + factor * evaluate(f) if f != 0 else x for x, f in zip(state, field, strict=True)]

    def rate(ops: Arithmetic, values: Any, state: Any, eps: Scalar) -> list[Scalar]:
        evaluate = at(ops, values, state)
        first = [evaluate(entry) for entry in fields.Z[0]]
        if fields.order == 1:
            return first
        return [a + eps * evaluate(b) if b != 0 else a for a, b in zip(first, fields.Z[1], strict=True)]

    def actual(ops: Arithmetic, values: Any, state: Any, tau: Scalar, eps: Scalar) -> list[Scalar]:
        drift, forced = fields.actual
        evaluate = at(ops, values, state, tau)
        return moved(evaluate, [evaluate(x) for x in drift], forced, 1 / eps)

    def estimate_first(ops: Arithmetic, values: Any, state: Any, tau: Scalar, eps: Scalar) -> list[Scalar]:
        return moved(at(ops, values, state, tau), state, fields.shift, -1)

    def estimate(ops: Arithmetic, values: Any, state: Any, tau: Scalar, eps: Scalar) -> list[Scalar]:
        w = estimate_first(ops, values, state, tau, eps)
        return moved(at(ops, values, w, tau), w, fields.displacement, -eps)

    def reconstruct(ops: Arithmetic, values: Any, state: Any, tau: Scalar, eps: Scalar) -> list[Scalar]:
        w = moved(at(ops, values, state, tau), state, fields.displacement, eps)
        return moved(at(ops, values, w, tau), w, fields.shift, 1)

    return (
        kernel("rate", (z, _EPS), "z_dot", rate, "z' = Z1(z) + eps Z2(z)"),
        kernel("actual", (y, _TAU, _EPS), "y_dot", actual, "y' = X(y) + (1/eps) Y_a u^a(tau)"),
        kernel("estimate", (y, _TAU, _EPS), "z", estimate, "z = P^-1(Phi^-1(y))"),
        kernel("estimate_first", (y, _TAU, _EPS), "z", estimate_first, "z = Phi^-1(y), to first order"),
        kernel("reconstruct", (z, _TAU, _EPS), "y", reconstruct, "y = Phi(P(z))"),
    )


@kernel_factory()
def term_kernels(fields: VibrationalFields, namespace: str) -> tuple[Kernel, ...]:
    """term_q(z) = Z_q(z), one kernel an order; parameters that stayed symbols are further inputs."""
    n = len(fields.state)
    parameters = tuple(Port(str(p), ()) for p in fields.parameters)

    def kernel(q: int) -> Kernel:
        def body(ops: Arithmetic, z: Any, *given: Any) -> tuple[Any, ...]:
            values = dict(zip((*fields.parameters, *fields.state), (*given, *z), strict=True))
            evaluate = ExpressionEvaluator(ops, values)
            return ([evaluate(entry) for entry in fields.Z[q - 1]],)

        z = Port("z", (n,), description="averaged state (q, v)")
        return Kernel(f"term_{q}", namespace, (z, *parameters), (Port("Z", (n,)),), body, f"Z_{q}(z)", SOURCE)

    return tuple(kernel(q) for q in range(1, fields.order + 1))


@kernel_factory()
def lagrangian_kernels(system: LagrangianSystem, namespace: str = "lagrangian") -> tuple[Kernel, ...]:
    """rate(y, u, parameters...) -> y' = X(y) + Y_a(q) u^a, and energy(y, parameters...) -> kinetic plus potential.

    Args:
        system: n coordinates and m inputs: y is (2 n,), the coordinates before their rates; u is (m,) and left out where m = 0.
            The parameters are scalar inputs in the system's order.
        namespace: C identifier that begins the symbols.

    Raises:
        IdentifierError: namespace is no C identifier.
        ArgumentError: system is no `LagrangianSystem`.
    """
    n, m = len(system.state), len(system.inputs)
    ports = [Port("y", (n,), description=", ".join(map(str, system.state)))]
    if m:
        ports.append(Port("u", (m,), description=", ".join(system.inputs)))
    parameters = tuple(Port(name, ()) for name in system.parameters)
    controls = sp.symbols(f"lie_u0:{m}", real=True) if m else ()
    field = system.drift + sum((u * f for u, f in zip(controls, system.input_fields, strict=True)), system.drift * 0)
    kinetic = (sp.Matrix(system.v).T * system.mass * sp.Matrix(system.v))[0] / 2

    def body(outputs: Any, with_inputs: bool) -> Callable[..., tuple[Any, ...]]:
        def evaluate(ops: Arithmetic, y: Any, *rest: Any) -> tuple[Any, ...]:
            values = dict(zip(system.state, y, strict=True))
            if with_inputs and m:
                values |= dict(zip(controls, rest[0], strict=True))
                rest = rest[1:]
            at = ExpressionEvaluator(ops, {**values, **dict(zip(system.parameter_symbols, rest, strict=True))})
            return ([at(entry) for entry in outputs],) if isinstance(outputs, list) else (at(outputs),)

        return evaluate

    return (
        Kernel("rate", namespace, (*ports, *parameters), (Port("y_dot", (n,)),), body(list(field), True),
               "y' = X(y) + Y_a(q) u^a", "Euler-Lagrange equations"),
        Kernel("energy", namespace, (ports[0], *parameters), (Port("energy", ()),),
               body(kinetic + system.potential, False), "v' M v / 2 + V", "Lagrangian mechanics"),
    )  # fmt: skip
