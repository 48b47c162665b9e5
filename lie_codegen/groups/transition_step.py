"""lc.transition_step: a discrete step with its state transition matrix, for filters and for least squares over time.

    X_next(X exp(d), ...) = X_next exp(Phi d + Gamma w + ...)    right: the error in the body
    X_next(exp(d) X, ...) = exp(Phi d + Gamma w + ...) X_next    left: the error in space

The step runs once in dual numbers, a tangent for each component of the state and of the inputs named; what it moves the next
element by is read off in the algebra. Sola, Deray, Atchuthan, arXiv:1812.01537, section II.D, for the conventions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices, real_rows
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.port_tangents import acting_group, derivative_rows, entry_rates, group_rates, moving
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.dual import DualArithmetic, value_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, matmul


@dataclass(frozen=True)
class _Moved:
    """An input that moves: where it stands, from which column on, and along which group."""

    place: int
    port: Port
    first: int
    columns: int
    group: MatrixGroup | None


def _read_group(value: GroupLike | None) -> MatrixGroup | None:
    return None if value is None else as_group(value, "transition_step")


def _names(value: str | Sequence[str] | None) -> tuple[str, ...] | None:
    return None if value is None else (value,) if isinstance(value, str) else tuple(value)


@kernel_factory(group=_read_group, state=_names, by=_names)
def transition_step(
    step: Kernel,
    *,
    state: str | Sequence[str] | None = None,
    by: str | Sequence[str] | None = None,
    tangent: str = "right",
    group: GroupLike | None = None,
    name: str | None = None,
) -> Kernel:
    """The step with its transition matrix Phi (N, N), and Gamma_<input> (N, m) for each input named in `by`.

        right    X_next(X exp(d), u + w) = X_next exp(Phi d + Gamma_u w) to first order,     left with the exponentials before

    What an extended Kalman filter on the group takes: P_next = Phi P Phi^T + Gamma_u Q Gamma_u^T, with the covariances of errors in
    the body (right) or in space (left). Exact (dual numbers), a Kernel like any other: `scan` still runs it, and C for flight
    comes from `generate`.

    Args:
        step: inputs (state, ...) -> outputs (next state, ...); any Kernel, such as `rkmk4_step` or your own of several parts.
        state: the inputs that are the state, each with an output <input>_next; None for all of these, or for the first input
            if the first output has its shape. Matrices are elements of the group, vectors count as they are; N is the sum.
        by: further inputs, such as rates or noise.
        tangent: "right" or "left"; "entries" takes matrices entry by entry.
        group: of the matrices; None for the one that the step was made for.
        name: C identifier; <step>_transition if None.

    Raises:
        InputError: no such input, no pair of state and next state, no group known; a tangent that is not known.
        ShapeError: the matrices of the group have another size.
    """
    if not isinstance(step, Kernel):
        raise InputError(f"transition_step takes a Kernel, got {type(step).__name__}; for one: lc.rkmk4_step(group)")
    if tangent not in ("right", "left", "entries"):
        raise InputError(f"tangent {tangent!r} is not known; choose one of right, left, entries")
    pairs = _pairs(step, _names(state))
    moved, size = _moved(step, [place for place, _ in pairs], 0, group, tangent)
    driven, columns = _moved(step, [_input(step, each) for each in _names(by) or ()], size, group, tangent)
    repeated = {each.port.name for each in moved} & {each.port.name for each in driven}
    if repeated:
        raise InputError(f"transition_step: {', '.join(sorted(repeated))} is a state and stands in by= too")

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        dual = DualArithmetic(ops)
        given = list(arguments)
        for each in (*moved, *driven):
            value = arguments[each.place]
            rates = group_rates(ops, each.group, value, tangent) if each.group else entry_rates(each.port, value)
            shifted = [{each.first + j: rate for j, rate in entry.items()} for entry in rates]
            given[each.place] = moving(dual, each.port, value, shifted)
        found = step.evaluate(dual, *given)
        rows: Matrix = []
        for each, (_, output) in zip(moved, pairs, strict=True):
            slopes = derivative_rows(ops, dual, step.outputs[output], found[output], columns)
            plain = _values(dual, step.outputs[output], found[output])
            rows += _in_algebra(ops, each.group, plain, slopes, tangent) if each.group else _real(slopes)
        values = [_values(dual, port, value) for port, value in zip(step.outputs, found, strict=True)]
        blocks = [[row[each.first : each.first + each.columns] for row in rows] for each in driven]
        return (*values, [row[:size] for row in rows], *blocks)

    return Kernel(
        name=name or f"{step.name}_transition",
        namespace=step.namespace,
        inputs=step.inputs,
        outputs=(
            *step.outputs,
            Port("Phi", (size, size), description="state transition matrix"),
            *(
                Port(f"Gamma_{each.port.name}", (size, each.columns), description=f"of {each.port.name}")
                for each in driven
            ),
        ),
        body=body,
        formula=f"{step.formula}; Phi and Gamma: its derivative, errors {tangent}",
        source=step.source,
        sampler=step.sample,
    )


def _input(step: Kernel, name: str) -> int:
    names = [port.name for port in step.inputs]
    if name not in names:
        raise InputError(f"kernel {step.symbol} has no input {name!r}; there are {', '.join(names)}")
    return names.index(name)


def _pairs(step: Kernel, state: tuple[str, ...] | None) -> list[tuple[int, int]]:
    """(input, output) of each part of the state."""
    outputs = {port.name: place for place, port in enumerate(step.outputs)}
    if state is None:
        state = tuple(port.name for port in step.inputs if f"{port.name}_next" in outputs)
    if not state and step.inputs:
        state = (step.inputs[0].name,)
    pairs = []
    for each in state:
        place = _input(step, each)
        # a step of one state may call its result as it likes
        after = outputs.get(f"{each}_next", 0 if len(state) == 1 and place == 0 else None)
        alike = after is not None and _type(step.inputs[place]) == _type(step.outputs[after])
        if after is None or not alike:
            raise InputError(
                f"kernel {step.symbol} has no output {each}_next of the shape of {each}: it is no step of that state"
            )
        pairs.append((place, after))
    if not pairs:
        raise InputError(f"kernel {step.symbol} has no input: it is no step")
    return pairs


def _type(port: Port) -> tuple[tuple[int, ...], bool]:
    return port.shape, port.is_complex


def _moved(step: Kernel, places: Sequence[int], first: int, group: Any, tangent: str) -> tuple[tuple[_Moved, ...], int]:
    found = []
    for place in places:
        port = step.inputs[place]
        is_element = len(port.shape) == 2 and tangent != "entries"
        acting = acting_group(step, place, group, tangent) if is_element else None
        columns = acting.dim if acting else port.size
        found.append(_Moved(place, port, first, columns, acting))
        first += columns
    return tuple(found), first


def _values(dual: DualArithmetic, port: Port, value: Any) -> Any:
    def entry(x: Any) -> Any:
        if isinstance(x, Complex):
            return Complex(value_of(x.re, dual.level), value_of(x.im, dual.level))
        return value_of(x, dual.level)

    if not port.shape:
        return entry(value)
    if len(port.shape) == 1:
        return [entry(x) for x in value]
    return [[entry(x) for x in row] for row in value]


def _in_algebra(ops: Arithmetic, group: MatrixGroup, X: Any, slopes: Matrix, tangent: str) -> Matrix:
    """(n, columns): the v_j with T_j = X hat(v_j) or hat(v_j) X, T_j the derivative of X along the j-th tangent."""
    algebra = GroupMatrices(ops, derivation_of(group).real)
    element = algebra.read(X)
    inverse = algebra.inverse(element)
    d = group.degree
    columns = []
    for j in range(len(slopes[0])):
        tangent_matrix = [[slopes[d * i + k][j] for k in range(d)] for i in range(d)]
        moved = real_rows(tangent_matrix) if group.is_complex else tangent_matrix
        columns.append(algebra.vee(matmul(inverse, moved) if tangent == "right" else matmul(moved, inverse)))
    return [list(row) for row in zip(*columns, strict=True)]


def _real(slopes: Matrix) -> Matrix:
    """A complex entry is two numbers of the state: its real and its imaginary part."""
    rows: Matrix = []
    for row in slopes:
        if any(isinstance(x, Complex) for x in row):
            rows += [[Complex.of(x).re for x in row], [Complex.of(x).im for x in row]]
        else:
            rows.append(row)
    return rows
