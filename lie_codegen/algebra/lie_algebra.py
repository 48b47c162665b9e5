"""LieAlgebra: exact structure constants, proved in the constructor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from lie_codegen.errors import AlgebraError, InputError, JacobiError
from lie_codegen.exact.numbers import Number, exact_number, field_elements
from lie_codegen.identifiers import check_identifier
from lie_codegen.on_demand import sympy as sp
from lie_codegen.values import brief

#: Sparse vector: basis index -> coefficient, no zeros.
Sparse = Mapping[int, Number]


@dataclass(frozen=True)
class LieAlgebra:
    """Real Lie algebra with basis A_1..A_n and [A_i, A_j] = sum_k c[i, j, k] A_k.

    Attributes:
        name: C identifier; it prefixes every generated symbol.
        labels: (n,) basis names, in the order used by every vector and matrix.
        table: for i < j, (i, j) -> {k: c[i, j, k]}, exact and without zeros; antisymmetry is built in.

    Raises:
        IdentifierError: if the name or a label cannot be a C identifier.
        AlgebraError: if a label is repeated or an index is out of range.
        JacobiError: if the Jacobi identity fails, naming the triple.
    """

    name: str
    labels: tuple[str, ...]
    table: Mapping[tuple[int, int], Sparse]

    def __repr__(self) -> str:
        """In one line."""
        return f"<algebra {self.name}: {self.dim} dimensions, basis {brief(self.labels)}>"

    def __post_init__(self) -> None:
        check_identifier(self.name, "name")
        if not self.labels:
            raise AlgebraError(f"{self.name}: a Lie algebra needs at least one basis element")
        for label in self.labels:
            check_identifier(label, f"{self.name}: label")
        repeated = sorted({label for label in self.labels if self.labels.count(label) > 1})
        if repeated:
            raise AlgebraError(f"{self.name}: labels repeated: {', '.join(repeated)}; give each a name of its own")
        for (i, j), row in self.table.items():
            if not (0 <= i < j < self.dim) or any(not 0 <= k < self.dim for k in row):
                raise AlgebraError(f"{self.name}: bracket ({i}, {j}) -> {dict(row)} is out of range")
        self._check_jacobi()

    @classmethod
    def recorded(cls, name: str, labels: tuple[str, ...], constants: Sequence[Sequence[Any]]) -> LieAlgebra:
        """The algebra of which `record` was taken: proved then, and not again; its exact table is read when it is asked for."""
        algebra = cls.__new__(cls)
        numbers = np.zeros((len(labels),) * 3)
        for i, j, k, _, value in constants:
            numbers[i, j, k], numbers[j, i, k] = value, -value
        numbers.setflags(write=False)
        algebra.__dict__.update(name=name, labels=labels, structure_constants=numbers, _recorded=constants)
        return algebra

    @property
    def record(self) -> list[list[Any]]:
        """[i, j, k, c[i, j, k] as a text, as a double] for i < j where it is not zero."""
        if "_recorded" in self.__dict__:
            return list(self.__dict__["_recorded"])
        return [[i, j, k, str(value), float(value)] for (i, j), row in self.table.items() for k, value in row.items()]

    if not TYPE_CHECKING:  # for a type checker no name is found that is not written above

        def __getattr__(self, name: str) -> Any:
            """The table of a recorded algebra, the one thing that is not there from the start."""
            if name != "table" or "_recorded" not in self.__dict__:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            table: dict[tuple[int, int], dict[int, Number]] = {}
            for i, j, k, text, _ in self.__dict__["_recorded"]:
                table.setdefault((i, j), {})[k] = exact_number(text)
            self.__dict__["table"] = table
            return table

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        # Groups are the keys of what is compiled, in every call. Equal tables have equal doubles.
        return hash((self.name, self.labels, self.structure_constants.tobytes()))

    def __reduce__(self) -> tuple[Any, ...]:
        # Without the hash: that of a text is another one in another process.
        return LieAlgebra.recorded, (self.name, self.labels, self.record)

    @property
    def dim(self) -> int:
        """n, the number of basis elements."""
        return len(self.labels)

    @cached_property
    def c(self) -> sp.ImmutableDenseNDimArray:
        """(n, n, n) exact structure constants."""
        n = self.dim
        flat = [sp.S.Zero] * n**3
        for i, j, k, value in self.constants():
            flat[(i * n + j) * n + k] = value
        return sp.ImmutableDenseNDimArray(flat, (n, n, n))

    @cached_property
    def structure_constants(self) -> np.ndarray:
        """(n, n, n) structure constants as doubles."""
        array = np.zeros((self.dim,) * 3)
        for i, j, k, value in self.constants():
            array[i, j, k] = float(value)
        array.setflags(write=False)
        return array

    @cached_property
    def ad_matrices(self) -> np.ndarray:
        """(n, n, n) the matrices of ad_{A_i} as doubles: column j of the i-th holds the coordinates of [A_i, A_j]."""
        array = np.ascontiguousarray(np.swapaxes(self.structure_constants, 1, 2))
        array.setflags(write=False)
        return array

    def constants(self) -> Iterator[tuple[int, int, int, Number]]:
        """All nonzero (i, j, k, c[i, j, k]), both orders of i and j."""
        for (i, j), row in self.table.items():
            for k, value in row.items():
                yield i, j, k, value
                yield j, i, k, -value

    def bracket(self, x: Sparse, y: Sparse) -> dict[int, Number]:
        """[x, y] of two sparse exact vectors."""
        result: dict[int, Number] = {}
        for i, xi in x.items():
            for j, yj in y.items():
                if i == j:
                    continue
                sign, key = (1, (i, j)) if i < j else (-1, (j, i))
                for k, value in self.table.get(key, {}).items():
                    result[k] = result.get(k, sp.S.Zero) + sign * xi * yj * value
        return {k: total for k, value in result.items() if (total := sp.expand(value)) != 0}

    def index(self, label: str | int) -> int:
        """The position of a basis element given by label or by position.

        Raises:
            InputError: if there is no such basis element.
        """
        if isinstance(label, str):
            if label in self.labels:
                return self.labels.index(label)
            raise InputError(f"{self.name} has no basis element {label!r}; its labels are {', '.join(self.labels)}")
        if isinstance(label, int | np.integer) and not isinstance(label, bool) and 0 <= label < self.dim:
            return int(label)
        raise InputError(f"{self.name}: {label!r} is neither a label nor an index from 0 to {self.dim - 1}")

    def _check_jacobi(self) -> None:
        # In the field of the constants a sum costs no expansion of radicals: an algebra in a basis at random is proved in a fraction of the time.
        domain, values = field_elements([value for row in self.table.values() for value in row.values()])
        elements = iter(values)
        inner = {key: {k: next(elements) for k in row} for key, row in self.table.items() if row}
        signed = {**inner, **{(j, i): {k: -value for k, value in row.items()} for (i, j), row in inner.items()}}
        for i, j, k in combinations(range(self.dim), 3):
            defect: dict[int, Any] = {}
            for a, b, third in ((i, j, k), (j, k, i), (k, i, j)):
                for m, outer in signed.get((a, b), {}).items():
                    for index, value in signed.get((m, third), {}).items():
                        defect[index] = defect.get(index, domain.zero) + outer * value
            left = {
                m: total
                for m, value in defect.items()
                if value != domain.zero and (total := _simplified(domain.to_sympy(value))) != 0
            }
            if left:
                names = self.labels
                value = " + ".join(f"({coefficient}) {names[m]}" for m, coefficient in left.items())
                raise JacobiError(
                    f"{self.name}: the Jacobi identity fails for ({names[i]}, {names[j]}, {names[k]}): "
                    f"[[{names[i]}, {names[j]}], {names[k]}] + cyclic = {value}, not 0; check these brackets"
                )


def _simplified(value: Number) -> Number:
    """Zero if the number is zero, whatever radicals it is written in."""
    return value if value.is_Rational else sp.radsimp(sp.expand(value)) if value.equals(0) is not True else sp.S.Zero
