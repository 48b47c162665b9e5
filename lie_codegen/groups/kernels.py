"""The kernels of every group: exp and log, Jacobians, products, adjoints, and the Wei-Norman equations.

product_exp(g) -> X            X = exp(g_1 A_1) ... exp(g_n A_n)
wei_norman_matrix(g) -> M      g' = M(g) u  for  X' = X hat(u)
wei_norman_rate(g, u) -> g_dot
exp(x) -> X, log(X) -> x       X = exp(hat(x))
compose(X, Y) -> Z             Z = X Y
inverse(X) -> X_inverse
Ad(X) -> Ad_X                  hat(Ad_X y) = X hat(y) X^{-1}
ad(x) -> ad_x, bracket(x, y) -> z    z = ad_x y = [x, y]
defect(X) -> defect            0 on the group, the relative distance near it
renormalise(X) -> Y            one step back to the group
ljac, rjac, ljac_inv, rjac_inv (x) -> J    d/dt exp(x) = hat(ljac x') exp(x) = exp(x) hat(rjac x')
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import GroupDerivation, derivation_of
from lie_codegen.groups.maps.checked_log import log_coordinates
from lie_codegen.groups.maps.defect import defect
from lie_codegen.groups.maps.exponential import exp_matrix, jacobian
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port
from lie_codegen.groups.maps.renormalise import renormalised
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman import body as wei_norman_body
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.brackets import ad, bracket
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port, Sampler
from lie_codegen.kernel.linear import identity, matmul
from lie_codegen.kernel.renaming import in_namespace

_WEI_NORMAN = "Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)"
_JACOBIANS = (
    "ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x) hat(rjac x')"
)
_EXP = "the power series, summed in closed form on the spectrum of hat(x)"
_LOG = "checked: closed forms by membership, iterations by exp(-hat x) X; within 1e-5 of the group that of the nearest element"
_AD = "X' = X hat(u) = hat(Ad_X u) X"
_BRACKET = "the structure constants: [A_i, A_j] = sum_k c_ijk A_k"
_DEFECT = "the conditions that the basis implies, found exactly"
_NEWTON_SCHULZ = "Higham, Functions of Matrices (2008), (8.20); any form in place of 1"
_PRODUCT = "the group's own product"


def group_kernels(group: GroupLike, *, name: str | None = None) -> tuple[Kernel, ...]:
    """All kernels of a group, in the order of `KERNEL_NAMES`.

    Args:
        group: object, catalogue name or file.
        name: C identifier that begins every symbol; the group's name if None.

    Raises:
        IdentifierError: the name is no C identifier.
    """
    group = as_group(group, "group_kernels")
    return in_namespace([group_kernel(group, each) for each in KERNEL_NAMES], name)


@kernel_factory()
def group_kernel(group: MatrixGroup, name: str) -> Kernel:
    """One kernel of a group.

    Raises:
        InputError: there is no kernel of that name; lists those there are.
    """
    if name not in _MAKERS:
        raise InputError(f"no kernel {name!r} of a group; there are {', '.join(KERNEL_NAMES)}")
    return _MAKERS[name](derivation_of(group))


def _product_exp(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, g: Any) -> tuple[Any, ...]:
        return (wei_norman_body.product_exp(ops, data.wei_norman, g),)

    formula = "X = exp(g_1 A_1) ... exp(g_n A_n)"
    return _kernel(data, "product_exp", [_vector(data, "g")], [_matrix(data, "X")], body, formula, _WEI_NORMAN)


def _wei_norman_matrix(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, g: Any) -> tuple[Any, ...]:
        return (wei_norman_body.matrix(ops, data.wei_norman, g),)

    formula = "g' = M(g) u for X = exp(g_1 A_1) ... exp(g_n A_n) and X' = X hat(u)"
    return _kernel(data, "wei_norman_matrix", [_vector(data, "g")], [_square(data, "M")], body, formula, _WEI_NORMAN)


def _wei_norman_rate(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, g: Any, u: Any) -> tuple[Any, ...]:
        return (wei_norman_body.rate(ops, data.wei_norman, g, u),)

    inputs = [_vector(data, "g"), _vector(data, "u", per="/s")]
    outputs = [_vector(data, "g_dot", per="/s")]
    return _kernel(data, "wei_norman_rate", inputs, outputs, body, "g' = M(g) u", _WEI_NORMAN)


def _exp(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, x: Any) -> tuple[Any, ...]:
        return (exp_matrix(ops, data, x),)

    return _kernel(
        data, "exp", [_vector(data, "x")], [_matrix(data, "X")], body, "X = exp(x_1 A_1 + ... + x_n A_n)", _EXP
    )


def _log(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, X: Any) -> tuple[Any, ...]:
        return (log_coordinates(ops, data, X),)

    formula = (
        "exp(x_1 A_1 + ... + x_n A_n) = X with the least sum of squares of turning angles; NaN where there is none"
    )
    return _kernel(data, "log", [_matrix(data, "X")], [_vector(data, "x")], body, formula, _LOG)


def _defect(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, X: Any) -> tuple[Any, ...]:
        return (defect(ops, data, X),)

    formula = "the largest relative violation of what every element keeps: forms, determinant, fixed entries, signs"
    return _kernel(data, "defect", [_matrix(data, "X")], [Port("defect", ())], body, formula, _DEFECT)


def _renormalise(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, X: Any) -> tuple[Any, ...]:
        return (renormalised(ops, data, X),)

    formula = "one step towards the group: X (3 - X* X)/2 on blocks that keep a form, X det(X)^(-1/n)"
    return _kernel(data, "renormalise", [_matrix(data, "X")], [_matrix(data, "Y")], body, formula, _NEWTON_SCHULZ)


def _compose(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, X: Any, Y: Any) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, data.real)
        columns = data.group.degree
        right = [row[:columns] for row in matrices.read(Y)]
        return (matrices.write(matmul(matrices.read(X), right)),)

    inputs = [_matrix(data, "X"), _matrix(data, "Y")]
    return _kernel(data, "compose", inputs, [_matrix(data, "Z")], body, "Z = X Y", _PRODUCT)


def _inverse(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, X: Any) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, data.real)
        return (matrices.write(matrices.inverse(matrices.read(X))),)

    return _kernel(
        data, "inverse", [_matrix(data, "X")], [_matrix(data, "X_inverse")], body, "X X_inverse = I", _PRODUCT
    )


def _group_adjoint(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, X: Any) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, data.real)
        element = matrices.read(X)
        inverse = matrices.inverse(element)
        columns = [matrices.Ad(element, inverse, unit) for unit in identity(data.group.dim)]
        return ([list(row) for row in zip(*columns, strict=True)],)

    formula = "hat(Ad_X y) = X hat(y) X^{-1}"
    return _kernel(data, "Ad", [_matrix(data, "X")], [_square(data, "Ad_X")], body, formula, _AD)


def _algebra_adjoint(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, x: Any) -> tuple[Any, ...]:
        return (ad(ops, data.group.algebra, x),)

    return _kernel(data, "ad", [_vector(data, "x")], [_square(data, "ad_x")], body, "ad_x y = [x, y]", _BRACKET)


def _bracket(data: GroupDerivation) -> Kernel:
    def body(ops: Arithmetic, x: Any, y: Any) -> tuple[Any, ...]:
        return (bracket(ops, data.group.algebra, x, y),)

    inputs = [_vector(data, "x"), _vector(data, "y")]
    return _kernel(data, "bracket", inputs, [Port("z", (data.group.dim,))], body, "z = [x, y]", _BRACKET)


def _jacobian(side: str, inverse: bool) -> Callable[[GroupDerivation], Kernel]:
    name = ("ljac" if side == "left" else "rjac") + ("_inv" if inverse else "")
    formula = ("d/dt exp(x) = hat(J x') exp(x)" if side == "left" else "d/dt exp(x) = exp(x) hat(J x')") + (
        ", inverted: J_inv J = I" if inverse else ""
    )

    def make(data: GroupDerivation) -> Kernel:
        def body(ops: Arithmetic, x: Any) -> tuple[Any, ...]:
            return (jacobian(ops, data, x, side, inverse=inverse),)

        output = _square(data, "J_inv" if inverse else "J")
        return _kernel(data, name, [_vector(data, "x")], [output], body, formula, _JACOBIANS)

    return make


_MAKERS: dict[str, Callable[[GroupDerivation], Kernel]] = {
    "product_exp": _product_exp,
    "wei_norman_matrix": _wei_norman_matrix,
    "wei_norman_rate": _wei_norman_rate,
    "exp": _exp,
    "log": _log,
    "compose": _compose,
    "inverse": _inverse,
    "Ad": _group_adjoint,
    "ad": _algebra_adjoint,
    "bracket": _bracket,
    "ljac": _jacobian("left", False),
    "rjac": _jacobian("right", False),
    "ljac_inv": _jacobian("left", True),
    "rjac_inv": _jacobian("right", True),
    "defect": _defect,
    "renormalise": _renormalise,
}
#: The kernels every group has.
KERNEL_NAMES = tuple(_MAKERS)


def _kernel(
    data: GroupDerivation,
    name: str,
    inputs: Sequence[Port],
    outputs: Sequence[Port],
    body: Callable[..., tuple[Any, ...]],
    formula: str,
    source: str,
) -> Kernel:
    sampler = _sampler(data, inputs)
    return Kernel(name, data.group.name, tuple(inputs), tuple(outputs), body, formula, source, sampler)


def _sampler(data: GroupDerivation, inputs: Sequence[Port]) -> Sampler:
    def sample(rng: random.Random) -> tuple[Any, ...]:
        return tuple(_draw(data, port, rng) for port in inputs)

    return sample


def _draw(data: GroupDerivation, port: Port, rng: random.Random) -> Any:
    """A vector in [-1, 1]^n, shorter where basis matrices are larger than 1, or an element of the group inside the domain of the logarithm."""
    n = data.group.dim
    x: list[Scalar] = [rng.uniform(-1, 1) for _ in range(n)]
    path = sum(abs(c) * _norm(A) for c, A in zip(x, data.group.basis, strict=True))
    if len(port.shape) == 1:
        return [c / max(1.0, path / n) for c in x]
    # exp(x_1 A_1) ... exp(x_n A_n) has a real logarithm where the path is below pi: Magnus's series converges (Moan and Niesen 2008).
    size = max(1.0, sum(c * c for c in x) ** 0.5, path / 3.0)
    return wei_norman_body.product_exp(FloatArithmetic(), data.wei_norman, [c / size for c in x])


def _norm(A: NDArray[Any]) -> float:
    """A bound of the spectral norm, (|A|_1 |A|_inf)^(1/2)."""
    sizes = np.abs(A)
    return float(np.sqrt(sizes.sum(axis=0).max() * sizes.sum(axis=1).max()))


def _vector(data: GroupDerivation, name: str, per: str = "") -> Port:
    units = [unit + per if unit else ("1" + per if per else "") for unit in data.group.units]
    text = ", ".join(units) if any(units) else ""
    labels = ", ".join(data.group.labels)
    return Port(name, (data.group.dim,), text, description=f"components {labels}")


def _matrix(data: GroupDerivation, name: str) -> Port:
    return matrix_port(data.group, name, "element of the group")


def _square(data: GroupDerivation, name: str) -> Port:
    return Port(name, (data.group.dim, data.group.dim))
