"""lc.wei_norman_order: a basis order, and where it helps a basis, in which the Wei-Norman chart is large."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import permutations

from lie_codegen.algebra.ideal_chain import adapted_basis, chain_order, is_ideal, is_subalgebra
from lie_codegen.algebra.structure import structure
from lie_codegen.algebra.subspace import Subspace, Vector
from lie_codegen.exact.numbers import Number
from lie_codegen.groups.cartan import restricted_to
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.change_of_basis import change_of_basis
from lie_codegen.groups.iwasawa import iwasawa
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.chart_domain import ChartDomain, chart_domain, is_generic
from lie_codegen.groups.wei_norman.chart_end import combination_text, is_compact
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp

_RANK = {"never": 0, "walls": 1, "either": 2, "escape": 3}
#: Up to this dimension every order is tried.
_ALL_ORDERS = 4
_LONGEST = 2000
#: dim so(3)
_ROTATIONS = 3


@dataclass(frozen=True, eq=False, repr=False)
class WeiNormanOrder(Saved):
    """A recommended basis order for product-of-exponentials coordinates.

    Attributes:
        labels: the best order found of the group's own basis.
        group: the group in that order.
        domain: its chart.
        change_of_basis: {new label: {label: coefficient}} of a basis with a better chart, None where none was found; give it
            to `lc.change_of_basis`.
        changed_group, changed_domain: the group in that basis and its chart, None without one.
        reason: why, in words, at most 2,000 characters.
        truncated: whether a determinant was not expanded, or the reason cut, because the basis is generic.
    """

    labels: tuple[str, ...]
    group: MatrixGroup
    domain: ChartDomain
    change_of_basis: Mapping[str, Mapping[str, Number]] | None
    changed_group: MatrixGroup | None
    changed_domain: ChartDomain | None
    reason: str
    truncated: bool = False

    @property
    def determinant(self) -> sp.Expr:
        """det M^{-1} in the recommended order, factored."""
        return self.domain.determinant

    @property
    def is_global(self) -> bool:
        """Whether the recommended order (without a change of basis) is global."""
        return self.domain.is_global


def wei_norman_order(group: GroupLike) -> WeiNormanOrder:
    """The basis order with the largest Wei-Norman chart, and why.

    A solvable algebra gets an order along a chain of ideals, which is global. Otherwise the semisimple part comes first and
    the radical after it, so that only the semisimple part limits the chart; up to four dimensions every order is tried.
    Where a change of basis does better (Iwasawa's K, A, N for a noncompact semisimple part, an adapted basis for a solvable
    algebra), it is offered beside. The present order wins ties.

    Args:
        group: object, catalogue name or file.

    Raises:
        UnknownGroupError: no such group.
    """
    group = as_group(group, "wei_norman_order")
    best, domain = group, chart_domain(group)
    for order in _candidates(group):
        if domain.is_global:
            break
        other = group.reorder(order)
        found = chart_domain(other)
        # A wall is a place where every solution that gets there ends; an escape may never happen: no walls for none.
        if _score(found) < _score(domain) and (domain.walls == found.walls == () or domain.walls):
            best, domain = other, found
    combinations = None if domain.is_global else _adapted_combinations(group)
    if combinations and domain.truncated and all(dict(row) == {label: 1} for label, row in combinations.items()):
        combinations = None  # the given basis again: to prove it an algebra once more takes longest of all
    changed = change_of_basis(group, combinations) if combinations else None
    changed_domain = chart_domain(changed) if changed and not is_generic(changed.algebra) else None
    truncated = domain.truncated
    if changed_domain is None or (not truncated and _RANK[changed_domain.end] >= _RANK[domain.end]):
        combinations = changed = changed_domain = None
    reason = _reason(group, best, domain, combinations, changed_domain)
    if len(reason) > _LONGEST:
        reason, truncated = reason[: _LONGEST - 4] + " ...", True
    return WeiNormanOrder(best.labels, best, domain, combinations, changed, changed_domain, reason, truncated)


def _score(domain: ChartDomain) -> tuple[int, int, int]:
    """Smaller is better: how the chart ends, walls that couple coordinates, number of walls."""
    coupled = sum(len(wall.free_symbols) > 1 for wall in domain.walls)
    return _RANK[domain.end], coupled, len(domain.walls)


def _candidates(group: MatrixGroup) -> Iterator[tuple[str, ...]]:
    algebra = group.algebra
    if is_generic(algebra):
        return
    everything = list(range(group.dim))
    whole = chain_order(algebra, everything)
    if whole is not None:
        yield tuple(group.labels[i] for i in whole)
        return
    split = _split_by_basis(group)
    if split is not None:
        yield tuple(group.labels[i] for i in (*split[0], *split[1]))
    if group.dim <= _ALL_ORDERS:
        yield from permutations(group.labels)


def _split_by_basis(group: MatrixGroup) -> tuple[list[int], list[int]] | None:
    """(Levi part, radical in chain order) if both are spanned by basis elements."""
    radical = [i for vector in structure(group.algebra).radical for i in _single(vector)]
    if len(radical) != len(structure(group.algebra).radical):
        return None
    levi = [i for i in range(group.dim) if i not in radical]
    order = chain_order(group.algebra, radical)
    everything = list(range(group.dim))
    if order is None or not is_subalgebra(group.algebra, levi) or not is_ideal(group.algebra, radical, everything):
        return None
    return levi, order


def _single(vector: Vector) -> list[int]:
    """[i] for a multiple of A_i, else []."""
    found = [i for i, value in enumerate(vector) if value != 0]
    return found if len(found) == 1 else []


def _adapted_combinations(group: MatrixGroup) -> dict[str, dict[str, Number]] | None:
    """Iwasawa's K, A, N of a Levi subalgebra, or that subalgebra as it is, then the radical in chain order."""
    parts = structure(group.algebra)
    blocks: list[tuple[str, tuple[Vector, ...]]] = []
    if parts.levi:
        decomposition = iwasawa(group, parts.levi)
        blocks += (
            [("s", _orthogonal(group, parts.levi))]
            if decomposition is None or not decomposition.n
            else [("k", decomposition.k), ("a", decomposition.a), ("n", decomposition.n)]
        )
    blocks.append(("r", adapted_basis(group.algebra, parts.radical)))
    taken = set(group.labels)
    combinations: dict[str, dict[str, Number]] = {}
    for letter, vectors in blocks:
        for number, vector in enumerate(vectors, start=1):
            single = _single(vector)
            label = group.labels[single[0]] if single else _free(letter, number, len(vectors), taken)
            combinations[label] = {group.labels[i]: value for i, value in enumerate(vector) if value != 0}
            taken.add(label)
    return combinations if len(combinations) == group.dim else None


def _orthogonal(group: MatrixGroup, levi: Subspace) -> tuple[Vector, ...]:
    """An so(3) in a basis orthogonal for the Killing form, not normalised, so that it stays rational: two of its elements
    then have their bracket along the third, and the chart has one wall. Others as they are."""
    if len(levi) != _ROTATIONS:
        return levi
    own = restricted_to(group.algebra, levi)
    if not is_compact(own):
        return levi
    form = -sp.Matrix(structure(own).killing)
    chosen: list[sp.Matrix] = []
    for i in range(own.dim):
        row = sp.Matrix([[int(i == k) for k in range(own.dim)]])
        for other in chosen:
            row = row - other * ((row * form * other.T)[0] / (other * form * other.T)[0])
        chosen.append(row)
    basis = sp.Matrix([list(vector) for vector in levi])
    return tuple(tuple(row * basis) for row in chosen)


def _free(letter: str, number: int, count: int, taken: set[str]) -> str:
    label = letter if count == 1 else f"{letter}{number}"
    while label in taken:
        label += "_"
    return label


def _reason(
    group: MatrixGroup,
    best: MatrixGroup,
    domain: ChartDomain,
    combinations: Mapping[str, Mapping[str, Number]] | None,
    changed: ChartDomain | None,
) -> str:
    order = ", ".join(best.labels)
    kept = "the present order" if best.labels == group.labels else "the order"
    text = f"{group.name}: {kept} {order}: {domain.text}; {domain.reason}"
    if combinations is None or changed is None:
        return text
    basis = ", ".join(
        label if dict(row) == {label: 1} else f"{label} = {combination_text(row)}"
        for label, row in combinations.items()
    )
    return f"{text}. With the basis {basis}: {changed.text}; {changed.reason}"
