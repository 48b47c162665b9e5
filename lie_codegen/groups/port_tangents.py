"""Tangents of the ports of kernels, for derivatives by dual numbers: along a group, or entry by entry."""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.catalogue_load import group as named_group
from lie_codegen.groups.catalogue_names import group_names
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.admission import NEAR_GROUP
from lie_codegen.groups.maps.defect import defect
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import number, total
from lie_codegen.kernel.plain_data import made_from
from lie_codegen.kernel.structural_zeros import is_zero, product

#: A tangent of a port: for each of its entries, in C order, direction -> rate.
Rates = list[dict[int, Scalar]]


def acting_group(kernel: Kernel, place: int, given: Any, tangent: str) -> MatrixGroup:
    """The group that moves an input: the one given, or that of the kernel's definition or namespace.

    Raises:
        InputError: there is none, or what the kernel admits at that port is no element of it.
        ShapeError: its matrices have another size.
    """
    port = kernel.inputs[place]
    group = given if given is not None else _made_for(kernel.definition)
    if group is None and kernel.namespace in group_names():
        group = named_group(kernel.namespace)
    if group is None:
        raise InputError(
            f'the group of {port.name} in kernel {kernel.symbol} is not known; give group=, or tangent="entries"'
        )
    if port.shape != (group.degree, group.degree) or port.is_complex != group.is_complex:
        kind = "complex" if group.is_complex else "real"
        raise ShapeError(
            f"{port.name} of {kernel.symbol} is no element of {group.name}: its shape is {port.shape}, "
            f'{group.name} has {kind} ({group.degree}, {group.degree}); give group=, or tangent="entries"'
        )
    # Only a kernel that says what it admits can tell an element from another matrix, as an inertia, of the same shape.
    if kernel.sampler is not None:
        sample = kernel.sample(random.Random(0))[place]
        if not defect(FloatArithmetic(), derivation_of(group), sample) < NEAR_GROUP:
            raise InputError(
                f"{port.name} of {kernel.symbol} is no element of {group.name}, so that tangent={tangent!r} has no "
                'meaning; give group=, or tangent="entries"'
            )
    return group


def _made_for(definition: Any) -> MatrixGroup | None:
    """The group among the arguments of the factory, or of the kernel that it changed."""
    if not isinstance(definition, Mapping) or "parameters" not in definition:
        return None
    parameters = definition["parameters"]
    own = parameters.get("group")
    if own is not None:
        made = made_from(own)
        return made if isinstance(made, MatrixGroup) else as_group(made, "jacobian")
    inner = [_made_for(parameters.get(key)) for key in ("kernel", "law", "step")]
    return next((group for group in inner if group is not None), None)


def group_rates(ops: Arithmetic, group: MatrixGroup, X: Any, tangent: str) -> Rates:
    """X A_j or A_j X for every j."""
    d = group.degree
    rates: Rates = [{} for _ in range(d * d)]
    for j, exact in enumerate(group.exact_basis):
        A = [[_exact(ops, exact[i, k], group.is_complex) for k in range(d)] for i in range(d)]
        for i in range(d):
            for k in range(d):
                pairs = [(A[m][k], X[i][m]) if tangent == "right" else (A[i][m], X[m][k]) for m in range(d)]
                rates[d * i + k][j] = _sum_of_products(pairs, group.is_complex)
    return rates


def _exact(ops: Arithmetic, value: Any, is_complex: bool) -> Any:
    def part(each: Any) -> Any:
        return 0 if each == 0 else number(ops, each)

    if not is_complex:
        return part(value)
    re, im = value.as_real_imag()
    return Complex(part(re), part(im))


def _sum_of_products(pairs: Sequence[tuple[Any, Any]], is_complex: bool) -> Any:
    if not is_complex:
        return total(product(a, x) for a, x in pairs)
    values = [(a, Complex.of(x)) for a, x in pairs]
    re = total(term for a, x in values for term in (product(a.re, x.re), product(_minus(a.im), x.im)))
    im = total(term for a, x in values for term in (product(a.re, x.im), product(a.im, x.re)))
    return Complex(re, im)


def _minus(value: Any) -> Any:
    return 0 if is_zero(value) else -value


def entry_rates(port: Port, value: Any) -> Rates:
    """Each entry along itself; a complex one along 1, then along i."""
    count = math.prod(port.shape)
    if not port.is_complex:
        return [{i: 1} for i in range(count)]
    return [{2 * i: Complex(1, 0), 2 * i + 1: Complex(0, 1)} for i in range(count)]


def moving(dual: DualArithmetic, port: Port, value: Any, rates: Rates) -> Any:
    """The value of a port with its tangents, nested as a body takes it."""

    def entry(x: Any, rate: dict[int, Any]) -> Any:
        if not port.is_complex:
            return dual.variable(x, rate)
        z = Complex.of(x)
        return Complex(
            dual.variable(z.re, {j: Complex.of(r).re for j, r in rate.items()}),
            dual.variable(z.im, {j: Complex.of(r).im for j, r in rate.items()}),
        )

    if not port.shape:
        return entry(value, rates[0])
    if len(port.shape) == 1:
        return [entry(x, rate) for x, rate in zip(value, rates, strict=True)]
    columns = port.shape[1]
    return [[entry(x, rates[columns * i + k]) for k, x in enumerate(row)] for i, row in enumerate(value)]


def derivative_rows(ops: Arithmetic, dual: DualArithmetic, port: Port, found: Any, columns: int) -> list[list[Any]]:
    """A row for each entry of the output, NaN all over where one of the entries is no finite number.

    A law that refuses a matrix off the group returns the constant NaN, whose derivative would be a plausible zero.
    """
    entries = [found] if not port.shape else list(found) if len(port.shape) == 1 else [x for row in found for x in row]
    parts = [[x.re, x.im] if isinstance(x, Complex) else [x] for x in entries]
    size = total(value_of(part, dual.level) for pair in parts for part in pair)
    is_number = ops.less(ops.fabs(size), ops.constant(sys.float_info.max))

    def slope(part: Any, j: int) -> Any:
        return ops.where(is_number, tangent_of(part, j, dual.level), ops.constant(math.nan))

    if not port.is_complex:
        return [[slope(pair[0], j) for j in range(columns)] for pair in parts]
    full = [[*pair, 0][:2] for pair in parts]
    return [[Complex(slope(re, j), slope(im, j)) for j in range(columns)] for re, im in full]
