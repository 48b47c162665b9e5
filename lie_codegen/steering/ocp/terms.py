"""What a user writes, a text or a Kernel, as scalars of an arithmetic at one point of a problem."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import prod
from typing import Any

import numpy as np

from lie_codegen.errors import ExpressionError, InputError, ShapeError
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import product_exp
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.matrix_formula import formula, scalar_formula
from lie_codegen.on_demand import sympy as sp
from lie_codegen.steering.ocp.layout import Layout, Shape, entry_names

#: A text in the matrix grammar, or a Kernel whose ports are matched by name.
Term = str | Kernel


@dataclass(frozen=True)
class Point:
    """Values at one instant in one arithmetic.

    Attributes:
        ops: the arithmetic.
        X: d x d matrix of the group, rows of scalars (Complex for a complex group).
        values: the vector of each layout: inputs, states, parameters; None where there is none (controls at the end).
        t: the time.
    """

    ops: Arithmetic
    X: Any
    values: Mapping[str, Sequence[Scalar]]
    t: Scalar


@dataclass(frozen=True)
class Scope:
    """The names that formulas and ports may use.

    Attributes:
        group: the group of X.
        layouts: inputs, states and parameters.
    """

    group: MatrixGroup
    layouts: tuple[Layout, ...]

    def without_inputs(self) -> Scope:
        """The scope at the end, where no control acts."""
        return Scope(self.group, tuple(each for each in self.layouts if each.what != "input"))

    def shapes(self) -> dict[str, Shape]:
        """Every name but X and t."""
        return {name: shape for each in self.layouts for name, shape in each.shapes}

    def uses(self, term: Term) -> frozenset[str]:
        """The names that a term reads: of layouts, X, t."""
        if isinstance(term, Kernel):
            return frozenset(port.name for port in term.inputs)
        owners = _owners(self)
        return frozenset(owners[str(symbol)] for entry in _parsed(self, term, "any") for symbol in entry.free_symbols)

    def evaluate(self, term: Term, at: Point, kind: str, where: str) -> list[Scalar]:
        """The entries of a term, real; a complex entry gives its real and its imaginary part.

        Args:
            term: text or Kernel (of one output).
            at: the point.
            kind: "scalar" refuses a matrix; "any" takes both; "parts" takes complex entries too, as real and imaginary.
            where: for messages.

        Raises:
            ExpressionError: a text outside the grammar, with an unknown name, or of another kind.
            InputError, ShapeError: a Kernel whose ports do not fit.
        """
        entries = self._kernel(term, at, where) if isinstance(term, Kernel) else self._text(term, at, kind, where)
        if not any(isinstance(entry, Complex) for entry in entries):
            return entries
        if kind == "parts":
            return [part for entry in entries for part in (Complex.of(entry).re, Complex.of(entry).im)]
        if not is_real(self, term):
            raise InputError(f"{where}: the value of {name_of(term)} is complex; take a norm2, or a part of it")
        return [Complex.of(entry).re for entry in entries]

    def _text(self, text: str, at: Point, kind: str, where: str) -> list[Any]:
        try:
            expressions = _parsed(self, text, kind)
            return _evaluated(self, expressions, at)
        except ExpressionError as error:
            raise ExpressionError(f"{where}: {error}") from None

    def _kernel(self, kernel: Kernel, at: Point, where: str) -> list[Any]:
        check_ports(self, kernel, where)
        places = {name: (each.what, place) for each in self.layouts for name, (place, _) in each.slices().items()}
        arguments = []
        for port in kernel.inputs:
            if port.name == "X":
                arguments.append(at.X)
            elif port.name == "t":
                arguments.append(at.t)
            else:
                what, place = places[port.name]
                entries = list(at.values[what][place])
                if port.is_complex:
                    entries = [Complex(re, im) for re, im in zip(entries[::2], entries[1::2], strict=True)]
                arguments.append(_nested(entries, port.shape))
        results = kernel.evaluate(at.ops, *arguments)
        return _flat(results[0], kernel.outputs[0].shape)


def name_of(term: Term) -> str:
    """What a term is called in messages."""
    return term.name if isinstance(term, Kernel) else term


def is_real(scope: Scope, term: Term) -> bool:
    """Whether a term is real on the group, though its entries are complex: tr(X) on SU(2); at three random points."""
    rng = random.Random(0)
    group = scope.group
    for _ in range(3):
        values = {each.what: _random_values(group, each, rng) for each in scope.layouts}
        at = Point(FloatArithmetic(), _random_element(group, rng), values, rng.uniform(0, 1))
        entries = scope._kernel(term, at, "") if isinstance(term, Kernel) else scope._text(term, at, "any", "")
        if any(abs(Complex.of(entry).im) > 1e-12 * (1 + abs(Complex.of(entry).re)) for entry in entries):
            return False
    return True


def _random_values(group: MatrixGroup, each: Layout, rng: random.Random) -> list[float]:
    """Numbers for every name; elements of the group for what is one."""
    values: list[float] = []
    for _, shape in each.shapes:
        if len(shape) == 3:
            element = [Complex.of(entry) for row in _random_element(group, rng) for entry in row]
            values += [part for entry in element for part in (entry.re, entry.im)]
        else:
            values += [rng.uniform(0.1, 1) for _ in range(prod(shape))]
    return values


def _random_element(group: MatrixGroup, rng: random.Random) -> Any:
    g = [rng.uniform(-1, 1) for _ in group.labels]
    return product_exp(FloatArithmetic(), derivation_of(group).wei_norman, g)


def check_ports(scope: Scope, kernel: Kernel, where: str) -> None:
    """Every input is a name of the scope, of its shape.

    Raises:
        InputError, ShapeError: naming the port.
    """
    if len(kernel.outputs) != 1:
        raise InputError(f"{where}: the kernel {kernel.name} has {len(kernel.outputs)} outputs; give one that has one")
    d = scope.group.degree
    shapes = {"X": (d, d), "t": (), **scope.shapes()}
    for port in kernel.inputs:
        if port.name not in shapes:
            raise InputError(
                f"{where}: the kernel {kernel.name} has an input {port.name!r}; known names are {', '.join(shapes)}"
            )
        wanted = shapes[port.name]
        is_complex = len(wanted) == 3 or (port.name == "X" and scope.group.is_complex)
        if port.shape != wanted[:2] and {port.shape, wanted} != {(), (1,)}:
            raise ShapeError(
                f"{where}: the input {port.name} of {kernel.name} has shape {port.shape}, not {wanted[:2]}"
            )
        if port.is_complex != is_complex:
            which = "complex" if is_complex else "real"
            raise ShapeError(f"{where}: the input {port.name} of {kernel.name} must be {which}")


def _nested(entries: list[Any], shape: Shape) -> Any:
    if not shape:
        return entries[0]
    if len(shape) == 1:
        return entries
    return [entries[i * shape[1] : (i + 1) * shape[1]] for i in range(shape[0])]


def _flat(value: Any, shape: Shape) -> list[Any]:
    if not shape:
        return [value]
    return list(value) if len(shape) == 1 else [entry for row in value for entry in row]


@lru_cache(maxsize=512)
def _parsed(scope: Scope, text: str, kind: str) -> tuple[sp.Expr, ...]:
    """The entries of a text, in the symbols of `_symbols`."""
    matrices, names, values = _symbols(scope)
    if kind == "scalar":
        return (scalar_formula(text, matrices, names, values, hermitian=scope.group.is_complex),)
    value = formula(text, matrices, names, values, hermitian=scope.group.is_complex)
    return tuple(value.flat()) if isinstance(value, sp.MatrixBase) else (value,)


@lru_cache(maxsize=64)
def _symbols(scope: Scope) -> tuple[dict[str, sp.ImmutableMatrix], dict[str, sp.Expr], dict[str, Any]]:
    """What the parser of matrix formulas takes: X and X^-1, names of entries, and named vectors and matrices."""
    matrices = {"X": _element(scope.group, "X"), "Xi": _element(scope.group, "Xi")}
    names: dict[str, sp.Expr] = {"t": sp.Symbol("t", real=True)}
    values: dict[str, Any] = {}
    for each in scope.layouts:
        for name, shape in each.shapes:
            symbols = [sp.Symbol(entry, real=True) for entry in entry_names(name, shape)]
            if len(symbols) == 1 and len(shape) < 2:
                values[name] = symbols[0]
                continue
            names.update({str(symbol): symbol for symbol in symbols})
            if len(shape) == 3:
                symbols = [re + sp.I * im for re, im in zip(symbols[::2], symbols[1::2], strict=True)]
                places = entry_names(name, shape[:2])
                names.update(dict(zip(places, symbols, strict=True)))
            rows, columns = (shape[0], 1) if len(shape) == 1 else shape[:2]
            values[name] = sp.ImmutableMatrix(rows, columns, symbols)
            if name == "Xd" and rows == columns == scope.group.degree:
                matrices |= {"Xd": values[name], "Xdi": _element(scope.group, "Xdi")}
    for (i, j), entry in zip(np.ndindex(scope.group.degree, scope.group.degree), matrices["X"].flat(), strict=True):
        names.setdefault(f"X{i + 1}{j + 1}", entry)
        names.update({str(symbol): symbol for symbol in entry.free_symbols})
    return matrices, names, values


@lru_cache(maxsize=64)
def _owners(scope: Scope) -> dict[str, str]:
    """The name behind each symbol."""
    owners = {"t": "t"}
    for each in scope.layouts:
        for name, shape in each.shapes:
            owners.update(dict.fromkeys(entry_names(name, shape), name))
    for name, owner in (("X", "X"), ("Xi", "X"), ("Xdi", "Xd")):
        owners.update({str(s): owner for entry in _element(scope.group, name).flat() for s in entry.free_symbols})
    return owners


def _element(group: MatrixGroup, name: str) -> sp.ImmutableMatrix:
    """A matrix of symbols, with numbers where every element of the group has the identity's entry."""
    d = group.degree
    matrix = sp.eye(d).as_mutable()
    for i, j in varying_entries(group):
        entry = f"{name}{i + 1}{j + 1}"
        re, im = (sp.Symbol(f"{entry}_{part}", real=True) for part in ("re", "im"))
        matrix[i, j] = re + sp.I * im if group.is_complex else sp.Symbol(entry, real=True)
    return sp.ImmutableMatrix(matrix)


def _evaluated(scope: Scope, expressions: Sequence[sp.Expr], at: Point) -> list[Any]:
    group = scope.group
    table: dict[sp.Symbol, Scalar] = {sp.Symbol("t", real=True): at.t}
    for each in scope.layouts:
        for name, symbol in zip(each.entry_names(), at.values[each.what], strict=True):
            table[sp.Symbol(name, real=True)] = symbol
    used = {str(symbol) for expression in expressions for symbol in expression.free_symbols}
    elements = {"X": at.X}
    for name, owner in (("Xi", "X"), ("Xdi", "Xd")):
        if any(str(symbol) in used for entry in _element(group, name).flat() for symbol in entry.free_symbols):
            matrices = GroupMatrices(at.ops, derivation_of(group).real)
            element = at.X if owner == "X" else _named_element(scope, owner, at)
            elements[name] = matrices.write(matrices.inverse(matrices.read(element)))
    for name, element in elements.items():
        for i, j in varying_entries(group):
            symbol = f"{name}{i + 1}{j + 1}"
            if group.is_complex:
                entry = Complex.of(element[i][j])
                table[sp.Symbol(f"{symbol}_re", real=True)] = entry.re
                table[sp.Symbol(f"{symbol}_im", real=True)] = entry.im
            else:
                table[sp.Symbol(symbol, real=True)] = element[i][j]
    evaluate = ExpressionEvaluator(at.ops, table)
    if not group.is_complex:
        return [evaluate(expression) for expression in expressions]
    results: list[Any] = []
    for expression in expressions:
        re, im = expression.as_real_imag()
        results.append(evaluate(re) if im == 0 else Complex(evaluate(re), evaluate(im)))
    return results


def _named_element(scope: Scope, name: str, at: Point) -> Any:
    """The matrix of a parameter, as rows."""
    for each in scope.layouts:
        if name in each.names:
            entries = list(at.values[each.what][each.slices()[name][0]])
            if scope.group.is_complex:
                entries = [Complex(re, im) for re, im in zip(entries[::2], entries[1::2], strict=True)]
            return _nested(entries, (scope.group.degree, scope.group.degree))
    raise InputError(f"ocp: no parameter {name}")
