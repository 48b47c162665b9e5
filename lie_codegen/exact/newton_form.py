"""exp(x A) by Newton's divided differences, for eigenvalues so close that Lagrange's denominators would cost all digits.

    exp(x A) = sum_k f[l_0, ..., l_k] (A - l_0) ... (A - l_{k-1}),   f(l) = e^{x l}.

A divided difference over nodes of spread s is x^k e^{x m} sum_j h_j(l - m) x^j/(k + j)! where |x| s < 1 (h_j the complete symmetric polynomials, m the
mean), and (f[l_1..l_k] - f[l_0..l_{k-1}])/(l_k - l_0) elsewhere: neither cancels. (Opitz 1964; McCurdy, Ng and Parlett 1984.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lie_codegen.exact.numbers import Number
from lie_codegen.on_demand import sympy as sp

#: Gaps below this share of the largest eigenvalue or gap are close: Lagrange's form loses their ratio, once a factor.
_CLOSE = 0.2
#: Terms of the series of a divided difference at |x| s = 1.
TERMS = 20


@dataclass(frozen=True)
class NewtonForm:
    """Nodes in order, and the entries of the products (A - l_0) ... (A - l_{k-1}).

    Attributes:
        nodes: the roots of the minimal polynomial, as often as they occur in it.
        entries: (i, j) -> one number for each k.
    """

    nodes: tuple[Number, ...]
    entries: dict[tuple[int, int], tuple[Number, ...]]

    @property
    def reflected(self) -> NewtonForm:
        """That of -A."""
        return NewtonForm(
            tuple(-node for node in self.nodes),
            {place: tuple((-1) ** k * v for k, v in enumerate(row)) for place, row in self.entries.items()},
        )


def newton_form(matrix: sp.MatrixBase, roots: Sequence[Number]) -> NewtonForm | None:
    """The form of a matrix with these roots; None where no two of them are close, or where the order of complex ones gives none."""
    values = [complex(sp.N(root, 30)) for root in roots]
    differences = [sp.expand(a - b) for k, a in enumerate(roots) for b in roots[:k]]
    gaps = [float(abs(sp.N(gap, 30))) for gap in differences if gap != 0]
    # Lagrange's form divides by the gaps what is of the size of the spread, or of x e^{x l} at x = 1/|l|.
    scale = max([*gaps, *map(abs, values)], default=0.0)
    if not gaps or min(gaps) >= _CLOSE * scale:
        return None
    order = sorted(range(len(roots)), key=lambda k: (round(values[k].imag / scale, 3), values[k].real, values[k].imag))
    nodes = tuple(roots[k] for k in order)
    if not _ordered([values[k] for k in order]):
        return None
    size = matrix.rows
    product = sp.eye(size)
    rows: dict[tuple[int, int], list[Number]] = {(i, j): [] for i in range(size) for j in range(size)}
    for node in nodes:
        for (i, j), row in rows.items():
            row.append(product[i, j])
        product = (product * (matrix - node * sp.eye(size))).applyfunc(sp.expand)
    return NewtonForm(nodes, {place: tuple(row) for place, row in rows.items() if any(row)})


def _ordered(values: Sequence[complex]) -> bool:
    """Whether the ends of every run of nodes are about as far apart as any two of it."""
    for i in range(len(values)):
        for j in range(i + 1, len(values)):
            run = values[i : j + 1]
            spread = max(abs(a - b) for a in run for b in run)
            if abs(values[j] - values[i]) < 0.3 * spread:
                return False
    return True


def symmetric_sums(nodes: Sequence[Number], mean: Number) -> list[complex]:
    """h_0, h_1, ... of nodes - mean: the coefficients of prod 1/(1 - (l - mean) t)."""
    # Real and imaginary parts apart: SymPy leaves a product of complex numbers as it is written.
    real, imaginary = [sp.S.One] + [sp.S.Zero] * TERMS, [sp.S.Zero] * (TERMS + 1)
    for node in nodes:
        re, im = sp.N(sp.expand(node - mean), 40).as_real_imag()
        for k in range(1, TERMS + 1):
            a, b = real[k - 1], imaginary[k - 1]
            real[k], imaginary[k] = real[k] + re * a - im * b, imaginary[k] + re * b + im * a
    return [complex(re, im) for re, im in zip(real, imaginary, strict=True)]
