"""Tracking of manipulators on R^n: augmented PD (19) and computed torque (20), from the inertia matrix as formulas.

    augmented_pd      F = M r'' + C(q, q') r' - K_p (q - r) - K_d (q' - r') + dV
    computed_torque   F = M (r'' - K_p (q - r) - K_d (q' - r')) + C(q, q') q' + dV

(20) prints F = M^{-1}(U - C) q'; it is F = M U + C q'. Bullo and Murray, CIT-CDS 97-003, section 5.2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
from lie_codegen.exact.positive_matrix import positive_matrix, real_number
from lie_codegen.identifiers import check_identifier, shown
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import expression_body
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.parameter import Parameter, input_ports, input_symbols, parameter, sample_inputs
from lie_codegen.on_demand import sympy as sp
from lie_codegen.vehicles.riemannian import coriolis

_KINDS = ("augmented_pd", "computed_torque")


@kernel_factory()
def manipulator_law(
    inertia: Sequence[Sequence[Any]],
    *,
    K_p: Any,
    K_d: Any,
    kind: str = "augmented_pd",
    potential: Any = 0,
    parameters: Mapping[str, Any] | None = None,
    name: str = "manipulator",
) -> Kernel:
    """A tracking law in coordinates: (q, q_dot, r, r_dot, r_ddot) -> (force, W, W_dot).

    W = (q-r)' K_p (q-r)/2 + (q'-r')' M (q'-r')/2 and dW/dt = -(q'-r')' K_d (q'-r') for augmented_pd; for computed
    torque the same with 1 in place of M.

    Args:
        inertia: (n, n) rows of M(q): texts or SymPy in q1 .. qn and the parameters.
        K_p: stiffness; a number, a diagonal or an (n, n) matrix.
        K_d: damping, likewise.
        kind: "augmented_pd" or "computed_torque".
        potential: V(q), whose force is cancelled.
        parameters: numbers by name. They, K_p and K_d may be "input": an input of that name, behind the others.
        name: C identifier, the namespace too.

    Raises:
        InputError: an unknown kind, an indefinite gain, an inertia that is not symmetric.
        ExpressionError: a text outside the grammar.
    """
    if kind not in _KINDS:
        raise InputError(f"kind {kind!r} is not known; choose one of {', '.join(_KINDS)}")
    if isinstance(inertia, str) or not isinstance(inertia, Sequence | sp.MatrixBase) or not len(inertia):
        raise InputError(f"manipulator_law: inertia must be a list of rows of formulas, got {shown(inertia)}")
    n = len(inertia)
    q, v, r, w, a = (sp.symbols(f"{letter}1:{n + 1}", real=True) for letter in ("q", "v", "r", "w", "a"))
    named = {
        check_identifier(key, "parameter"): parameter(Port(key, (), any_sign=True), value, real_number)
        for key, value in (parameters or {}).items()
    }
    gains = [
        parameter(
            Port(key, (n, n), description=f"{what}, symmetric"),
            value,
            lambda given, name: positive_matrix(given, n, name),
        )
        for key, what, value in (("K_p", "stiffness", K_p), ("K_d", "damping", K_d))
    ]
    M, V = _read(inertia, potential, q, {key: _symbolic(each) for key, each in named.items()})
    P, D = (_symbolic(each) for each in gains)
    inputs = input_ports([*gains, *named.values()])
    error, velocity = sp.Matrix(q) - sp.Matrix(r), sp.Matrix(v) - sp.Matrix(w)
    C = coriolis(M, q, v)
    gradient = sp.Matrix([sp.diff(V, x) for x in q])
    if kind == "augmented_pd":
        force = M * sp.Matrix(a) + C * sp.Matrix(w) - P * error - D * velocity + gradient
        kinetic = velocity.dot(M * velocity) / 2
    else:
        force = M * (sp.Matrix(a) - P * error - D * velocity) + C * sp.Matrix(v) + gradient
        kinetic = velocity.dot(velocity) / 2
    outputs = [list(force), error.dot(P * error) / 2 + kinetic, -velocity.dot(D * velocity)]
    return Kernel(
        name=kind,
        namespace=name,
        inputs=(*(Port(port, (n,)) for port in ("q", "q_dot", "r", "r_dot", "r_ddot")), *inputs),
        outputs=(Port("force", (n,)), Port("W", ()), Port("W_dot", ())),
        body=expression_body([q, v, r, w, a, *map(input_symbols, inputs)], outputs),
        formula={
            "augmented_pd": "F = M r'' + C r' - K_p (q - r) - K_d (q' - r') + dV",
            "computed_torque": "F = M (r'' - K_p (q - r) - K_d (q' - r')) + C q' + dV",
        }[kind],
        source="Bullo and Murray, CIT-CDS 97-003, (19), (20)",
        sampler=lambda rng: (
            *([rng.uniform(-1, 1) for _ in range(n)] for _ in range(5)),
            *sample_inputs([*gains, *named.values()], rng),
        ),
    )


def _symbolic(each: Parameter) -> Any:
    """The number, or the symbols that stand for the input."""
    return input_symbols(each.port) if each.value is None else each.value


def _read(
    inertia: Sequence[Sequence[Any]], potential: Any, q: Sequence[sp.Symbol], parameters: Mapping[str, Any]
) -> tuple[sp.Matrix, sp.Expr]:
    n = len(q)
    if any(len(row) != n for row in inertia):
        raise ShapeError(f"the inertia must have {n} rows of {n} entries")
    names = {**{symbol.name: symbol for symbol in q}, "pi": sp.pi}
    names |= parameters

    def read(entry: Any) -> sp.Expr:
        if isinstance(entry, str):
            return parse_expression(entry, names, FORMULA_FUNCTIONS)
        value = entry if isinstance(entry, sp.Expr) else real_number(entry, "inertia")
        return value.subs({sp.Symbol(key): value for key, value in names.items()})

    M = sp.Matrix([[read(entry) for entry in row] for row in inertia])
    if any(sp.simplify(M[i, j] - M[j, i]) != 0 for i in range(n) for j in range(i)):
        raise InputError("the inertia matrix is not symmetric")
    return M, read(potential)
