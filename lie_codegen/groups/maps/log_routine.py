"""log(X): the candidate, and what makes it a number that was checked.

    log X = the x in the algebra with exp(hat x) = X that minimises sum_j (Im mu_j)^2 over the eigenvalues mu_j of hat x.

Where the principal logarithm lies in the algebra it is this one. Where every block of X has a closed form and they do not depend on each other, the
closed form is exact on all of the group, and membership (`defect`) is its certificate (`checked_log`); off the group by rounding of single precision or
so, and for all other groups, the routine of this file is called:

    1. a candidate from the blocks: Jacobi rotations of unitary matrices, the real split of orthogonal ones, Schur form and square roots,
    2. E = exp(-hat x) X - 1, u = vee E: Newton's steps x <- x + rjac_inv(x) u as long as u falls,
    3. x where |hat u| <= 1e-12 W and the distance from the group |E - hat u| <= 1e-5 W entry by entry, W = max(1, |exp(-hat x)| |X|) being what
       rounding of each entry of E is measured by: a rotation is looked at as closely far from the origin as near it,
    4. else every logarithm of X is looked through (`log_lattice`), and NaN where there is none.

The derivative is D log(X)[X hat v] = rjac_inv(x) v on every branch: not that of sweeps, selections and roots.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.exponential import exp_matrix, jacobian
from lie_codegen.groups.maps.log_in_numpy import RESIDUAL, SETTLED, NumpyLog
from lie_codegen.groups.maps.logarithm import candidate
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port, real_rows
from lie_codegen.groups.maps.moduli import largest, moduli, parts_of
from lie_codegen.groups.maps.rkmk import hat_body
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, identity, matmul, matvec, total
from lie_codegen.kernel.plain_data import Definition
from lie_codegen.kernel.routine import Routine, call_routine
from lie_codegen.kernel.structural_zeros import add, is_zero, product

_DISTANCE = 1e-5
#: Far from the group Newton's steps shrink u by the distance each: three of them leave the cube of a tenth, and any x will do whose exp is near X.
_FAR, _FAR_RESIDUAL = 0.1, 1e-3


class _Rounding(NamedTuple):
    """What counts as zero on the way, as C constants: `off`, `pivot`, `symmetric`, `kernel`, `least` and `most` bound squares, these two where they
    are normal numbers; below `nothing` there is no reciprocal."""

    off: str
    pivot: str
    symmetric: str
    nudge: str
    polar: str
    deflation: str
    singular: str
    settled: str
    residual: str
    kernel: str
    cluster: str
    tie: str
    short: str
    independent: str
    turn: str
    cost: str
    least: str
    most: str
    nothing: str


_DOUBLE = _Rounding(
    off="1e-30",
    pivot="1e-36",
    symmetric="1e-32",
    nudge="1e-16",
    polar="1e-15",
    deflation="1.1e-16",
    singular="1e-13",
    settled=repr(SETTLED),
    residual=repr(RESIDUAL),
    kernel="1e-14",
    cluster="1e-6",
    tie="1e-9",
    short="1e-7",
    independent="1e-6",
    turn="1e-5",
    cost="1e-6",
    least="1e-280",
    most="1e300",
    nothing="1e-305",
)
_SINGLE = _Rounding(
    off="1e-13",
    pivot="1e-18",
    symmetric="1e-14",
    nudge="1e-7",
    polar="5e-7",
    deflation="6e-8",
    singular="1e-5",
    settled="1e-6",
    residual="2e-5",
    kernel="1e-5",
    cluster="3e-4",
    tie="1e-4",
    short="1e-3",
    independent="3e-4",
    turn="1e-3",
    cost="1e-4",
    least="1e-31",
    most="1e36",
    nothing="1e-37",
)


def closed_log(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> Vector | None:
    """The closed form alone, for an X that is known to be on the group; None where there is none."""
    if not data.log_structure.is_closed:
        return None
    return whole(ops, data, candidate(ops, data, [list(row) for row in X]))


def whole(ops: Arithmetic, data: GroupDerivation, x: Vector) -> Vector:
    """x, NaN in all of its components where one block has no logarithm."""
    partial = {"scale", "real2", "complex2"} | {block.kind for block in data.log_structure.blocks if block.scaled}
    if not any(block.kind in partial for block in data.log_structure.blocks):
        return x
    size = total(ops.fabs(c) for c in x if not is_zero(c))
    finite = ops.less(size, ops.constant(math.inf))
    return [ops.where(finite, c, ops.constant(math.nan)) for c in x]


def far_log(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> Vector:
    """The logarithm of the element near X, X up to a tenth of its size from the group."""
    entries = [list(row) for row in X]
    if data.log_structure.is_closed:
        return candidate(ops, data, entries)
    flat = [part for row in entries for entry in row for part in parts_of(entry, data.group.is_complex)]
    return call_routine(ops, log_routine(data, _FAR), flat)


@lru_cache(maxsize=64)
def log_routine(data: GroupDerivation, distance: float = _DISTANCE) -> Routine:
    """The checked logarithm of a group as a routine: X flat (complex entries as pairs) to x; NaN beyond `distance` from the group."""
    group, structure = data.group, data.log_structure
    d, n = group.degree, group.dim
    far = distance == _FAR
    X, x, u = matrix_port(group, "X"), Port("x", (n,)), Port("u", (n,))
    size = sum(len(block.rows) for block in structure.iterated)
    logs = (Port("logs", (size,)),) if size else ()

    def from_blocks(ops: Arithmetic, X: Any, *logs: Any) -> tuple[Any, ...]:
        return (candidate(ops, data, X, *logs),)

    def error(ops: Arithmetic, x: Any, X: Any) -> tuple[Any, ...]:
        return off_exponential(ops, data, x, X)

    first = Kernel("log_candidate", group.name, (X, *logs), (x,), from_blocks)
    second = Kernel("log_error", group.name, (x, X), (u, Port("error", (2,))), error)
    helpers = [first, second]
    if not structure.is_onto:
        helpers += _lattice_helpers(data, X, x)
    blocks, start = [], 0
    for block in structure.iterated:
        blocks.append(Definition(kind=block.kind, indices=block.indices, special=block.special, start=start))
        start += len(block.rows)
    settings = (
        ("definition", group.definition),
        ("degree", d),
        ("dim", n),
        ("is_complex", group.is_complex),
        ("kinds", tuple(sorted({block.kind for block in structure.iterated}))),
        ("blocks", tuple(blocks)),
        ("logs_size", size),
        ("distance", distance),
        ("rounding", _DOUBLE._replace(residual=repr(_FAR_RESIDUAL)) if far else _DOUBLE),
        ("constants", tuple((i, j, k, float(c)) for i, j, k, c in group.algebra.constants())),
        ("candidate_symbol", first.symbol),
        ("error_symbol", second.symbol),
        ("lattice", not structure.is_onto),
        *((f"{each.name.removeprefix('log_')}_symbol", each.symbol) for each in helpers[2:]),
    )
    twin = NumpyLog(data, first, second, distance, _FAR_RESIDUAL if far else RESIDUAL)
    return Routine(
        f"{group.name}_log_far" if far else f"{group.name}_log_checked",
        d * d * (2 if group.is_complex else 1),
        n,
        "log_routine.c.jinja",
        settings,
        tuple(helpers),
        twin,
        _tangent(data),
        # Rounding X to floats moves it off the group by a few 1e-7.
        (
            ("rounding", _SINGLE._replace(residual=repr(_FAR_RESIDUAL)) if far else _SINGLE),
            ("distance", max(distance, 2e-5)),
        ),
    )


def _lattice_helpers(data: GroupDerivation, X: Port, x: Port) -> list[Kernel]:
    """hat, vee, Ad and X exp(-hat y), as the lattice's C calls them."""
    group, n = data.group, data.group.dim

    def hat(ops: Arithmetic, x: Any) -> tuple[Any, ...]:
        return (hat_body(group, ops, x),)

    def coordinates(ops: Arithmetic, A: Any) -> tuple[Any, ...]:
        return (vee(ops, data, A),)

    def adjoint(ops: Arithmetic, X: Any) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, data.real)
        element = matrices.read(X)
        inverse = matrices.inverse(element)
        columns = [matrices.Ad(element, inverse, unit) for unit in identity(n)]
        return ([list(row) for row in zip(*columns, strict=True)],)

    def turned(ops: Arithmetic, y: Any, X: Any) -> tuple[Any, ...]:
        return (matmul(X, exp_matrix(ops, data, [product(-1, c) for c in y])),)

    A, Y = matrix_port(group, "A"), matrix_port(group, "Y")
    return [
        Kernel("log_hat", group.name, (x,), (A,), hat),
        Kernel("log_vee", group.name, (A,), (x,), coordinates),
        Kernel("log_adjoint", group.name, (X,), (Port("Ad_X", (n, n)),), adjoint),
        Kernel("log_turned", group.name, (Port("y", (n,)), X), (Y,), turned),
    ]


def vee(ops: Arithmetic, data: GroupDerivation, A: Sequence[Sequence[Any]]) -> Vector:
    """The x with hat x nearest to A (least squares over all entries)."""
    group = data.group
    flat = [Complex.of(entry) if group.is_complex else entry for row in A for entry in row]
    entries = [z.re for z in flat] + [z.im for z in flat] if group.is_complex else flat
    rows = np.where(np.abs(group.coordinate_rows) < 1e-15, 0.0, group.coordinate_rows)
    return [
        total(product(_weight(ops, float(w)), entry) for w, entry in zip(row, entries, strict=False) if w)
        for row in rows
    ]


def _weight(ops: Arithmetic, value: float) -> Scalar:
    """Coordinates of a plain basis are simple fractions."""
    nearest = round(value * 24) / 24
    value = nearest if abs(value - nearest) < 1e-14 else value
    return int(value) if value == int(value) else ops.constant(value)


def off_exponential(ops: Arithmetic, data: GroupDerivation, x: Vector, X: Any) -> tuple[Any, ...]:
    """u = vee E for E = exp(-hat x) X - 1, and the largest entries of E - hat u and of hat u relative to W; NaN where E is not finite."""
    group = data.group
    d = range(group.degree)
    backward = exp_matrix(ops, data, [product(-1, c) for c in x])
    E = [[_minus(entry, int(i == j)) for j, entry in enumerate(row)] for i, row in enumerate(matmul(backward, X))]
    u = vee(ops, data, E)
    hat: Matrix = [[0 for _ in d] for _ in d]
    for c, matrix in zip(u, group.exact_basis, strict=True):
        for i in d:
            for j in d:
                if matrix[i, j] != 0:
                    re, im = matrix[i, j].as_real_imag()
                    weight: Any = ops.constant(re) if im == 0 else Complex(ops.constant(re), ops.constant(im))
                    hat[i][j] = add(hat[i][j], c * weight if im == 0 else Complex(c * weight.re, c * weight.im))
    rest = [[_minus(a, b) for a, b in zip(p, q, strict=True)] for p, q in zip(E, hat, strict=True)]
    limits = None if _bounded(data) else matmul(moduli(ops, backward), moduli(ops, X))
    found = []
    for each in (rest, hat):
        sizes = moduli(ops, each)
        if limits is not None:
            sizes = [
                [size if is_zero(size) else size / largest(ops, [1, limit]) for size, limit in zip(a, b, strict=True)]
                for a, b in zip(sizes, limits, strict=True)
            ]
        found.append(largest(ops, [size for row in sizes for size in row]))
    # Comparisons with NaN are false, and a maximum would lose it.
    finite = ops.less(total(size for row in moduli(ops, E) for size in row), ops.constant(math.inf))
    return u, [ops.where(finite, size, ops.constant(math.nan)) for size in found]


def _bounded(data: GroupDerivation) -> bool:
    """Whether all entries of all elements are of modulus 1 at most."""
    place = {i: number for number, (block, _) in enumerate(data.real.blocks) for i in block}
    compact = all(place[i] == place[j] for i, j in data.real.varying)
    return data.is_unitary or (compact and all(orthogonal for _, orthogonal in data.real.blocks))


def _minus(a: Any, b: Any) -> Any:
    return add(a, product(-1, b))


def _tangent(data: GroupDerivation) -> Any:
    group = data.group
    d = group.degree

    def matrix(values: Sequence[Scalar]) -> Matrix:
        if group.is_complex:
            values = [Complex(re, im) for re, im in zip(values[::2], values[1::2], strict=True)]
        return [list(values[i * d : (i + 1) * d]) for i in range(d)]

    def tangent(
        ops: Arithmetic, inputs: Sequence[Scalar], outputs: Sequence[Scalar], rates: Sequence[Scalar]
    ) -> list[Scalar]:
        # vee(X^{-1} dX): least squares, so that noise across the group does not move the logarithm.
        matrices = GroupMatrices(ops, data.real)
        inverse = matrices.inverse(matrices.read(matrix(inputs)))
        rate = real_rows(matrix(rates)) if group.is_complex else matrix(rates)
        velocity = vee(ops, data, matrices.write(matmul(inverse, rate)))
        return matvec(jacobian(ops, data, outputs, "right", inverse=True), velocity)

    return tangent
