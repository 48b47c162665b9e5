"""MatrixGroup: a Lie algebra with a faithful matrix representation, and so a connected matrix group."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.algebra.constructions import permutation, reorder_algebra
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array
from lie_codegen.door import guard_methods
from lie_codegen.errors import InputError, NotFiniteError, NotInAlgebraError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.kernel.casadi_functions import CasadiFunctions
from lie_codegen.kernel.definition import definition_of
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.plain_data import Definition
from lie_codegen.on_demand import sympy as sp
from lie_codegen.values import brief

#: Where the kernels of a group are made, above this file: named here and loaded when `group.casadi` is asked.
KERNELS, STEP = "lie_codegen.groups.kernels", "lie_codegen.groups.maps.rkmk"


@guard_methods
@dataclass(frozen=True, eq=False)
class MatrixGroup:
    """Connected matrix Lie group whose algebra has basis A_1..A_n. Groups are equal whose definitions are.

    Attributes:
        algebra: exact structure constants.
        exact_basis: (n) exact d x d matrices A_i, complex entries allowed.
        units: (n) units of the components of an algebra vector, "" where there are none.
        description: one line.
    """

    algebra: LieAlgebra
    exact_basis: tuple[sp.ImmutableMatrix, ...]
    units: tuple[str, ...]
    description: str = field(default="", compare=False)

    def __repr__(self) -> str:
        """In one line; whole matrices and constants of 63 dimensions are 50 kB."""
        kind = "complex" if self.is_complex else "real"
        return f"<group {self.name}: {self.dim} dimensions, {self.degree} x {self.degree} {kind} matrices, basis {brief(self.labels)}>"

    @property
    def name(self) -> str:
        """C identifier."""
        return self.algebra.name

    @property
    def labels(self) -> tuple[str, ...]:
        """(n,) basis names."""
        return self.algebra.labels

    @property
    def dim(self) -> int:
        """n, the dimension of the group."""
        return self.algebra.dim

    @property
    def degree(self) -> int:
        """d, the size of the matrices."""
        return len(self.definition["parameters"]["matrices"][0])

    @cached_property
    def is_complex(self) -> bool:
        """Whether a basis matrix has a complex entry."""
        return any(entry.is_real is not True for matrix in self.exact_basis for entry in matrix.flat())

    @cached_property
    def basis(self) -> Array:
        """(n, d, d) the matrices A_i as doubles (complex doubles for a complex group), read-only."""
        kind = complex if self.is_complex else float
        array = np.array([[[kind(entry) for entry in row] for row in m.tolist()] for m in self.exact_basis], dtype=kind)
        array.setflags(write=False)
        return array

    @cached_property
    def _basis_rows(self) -> Array:
        """(n, d^2) the matrices A_i, row by row."""
        return self.basis.reshape(self.dim, -1)

    @cached_property
    def coordinate_rows(self) -> Array:
        """(n, 2 d^2) coordinates from the real parts of all entries, row by row, then the imaginary parts."""
        stacked = np.array([np.concatenate([m.real.ravel(), m.imag.ravel()]) for m in self.basis])
        return np.linalg.pinv(stacked.T)

    def hat(self, x: ArrayLike) -> Array:
        """x^ = sum_i x_i A_i: (..., n) -> (..., d, d).

        Raises:
            InputError: if x is not an array of real numbers.
            ShapeError: if the last axis is not n.
        """
        vector = _numbers(x, f"{self.name}.hat: x", float)
        if vector.ndim < 1 or vector.shape[-1] != self.dim:
            raise ShapeError(f"{self.name}.hat: x has shape {vector.shape}; its last axis must be {self.dim}")
        matrices: Array = (vector @ self._basis_rows).reshape(*vector.shape[:-1], self.degree, self.degree)
        return matrices

    def vee(self, A: ArrayLike) -> Array:
        """The x with hat(x) = A: (..., d, d) -> (..., n).

        Raises:
            InputError: if A is not an array of numbers.
            ShapeError: if the last two axes are not (d, d).
            NotFiniteError: for NaN or infinity.
            NotInAlgebraError: if A is not in the algebra to 1e-9 of its size.
        """
        matrix = _numbers(A, f"{self.name}.vee: A", complex)
        d = self.degree
        if matrix.shape[-2:] != (d, d):
            raise ShapeError(f"{self.name}.vee: A has shape {matrix.shape}; its last axes must be ({d}, {d})")
        size = float(np.abs(matrix).max(initial=0.0))  # not finite where an entry is not
        if not isfinite(size) and not np.all(np.isfinite(matrix)):
            raise NotFiniteError(f"{self.name}.vee: A holds NaN or infinity")
        x = self.project(matrix)
        off = float(np.abs(self.hat(x) - matrix).max(initial=0.0))
        if off > 1e-9 * max(1.0, size):
            raise NotInAlgebraError(
                f"{self.name}.vee: A is not in the algebra; the nearest element of the span of "
                f"{', '.join(self.labels)} differs by {off:.3g}"
            )
        return x

    def project(self, A: ArrayLike) -> Array:
        """Coordinates of the element of the algebra nearest to A (Frobenius).

        Args:
            A: (..., d, d), real or complex.

        Returns:
            (..., n).

        Raises:
            ArgumentError: the last axes are not (d, d).
        """
        matrix = np.asarray(A, dtype=complex)
        flat = matrix.reshape(*matrix.shape[:-2], -1)
        return np.concatenate([flat.real, flat.imag], axis=-1) @ self.coordinate_rows.T

    @cached_property
    def casadi(self) -> CasadiFunctions:
        """exp, log, Ad, ljac and the others as `casadi.Function`s for the user's own NLP, as `group.casadi.exp(x)`."""
        kernels = import_module(KERNELS)

        def make(name: str) -> Kernel:
            step = name == "rkmk4_step"
            made: Kernel = import_module(STEP).rkmk4_step(self) if step else kernels.group_kernel(self, name)
            return made

        return CasadiFunctions(self.name, (*kernels.KERNEL_NAMES, "rkmk4_step"), make)

    def reorder(self, labels: Sequence[str]) -> MatrixGroup:
        """The same group with its basis in another order.

        Raises:
            InputError: if `labels` is not a permutation of the group's labels.
        """
        order = permutation(self.algebra, labels)
        algebra = reorder_algebra(self.algebra, labels)
        basis = tuple(self.exact_basis[i] for i in order)
        return MatrixGroup(algebra, basis, tuple(self.units[i] for i in order), self.description)

    @cached_property
    def definition(self) -> Definition:
        """Plain data that determines the group: name, labels, exact matrices, units."""
        rows = {
            "labels": self.labels,
            "matrices": [matrix.tolist() for matrix in self.exact_basis],
            "units": self.units,
        }
        return definition_of("lie_codegen.groups.definition:defined_group", {"name": self.name, **rows})

    def __eq__(self, other: object) -> bool:
        return self.definition == other.definition if isinstance(other, MatrixGroup) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.definition)

    def __reduce__(self) -> tuple[Any, ...]:
        return MatrixGroup.recorded, (self.record,)

    def save(self, path: Any) -> Any:
        """Write its definition to a path as a file from which `lc.load` makes an equal group, proved anew; returns the path. The
        description, which is of no account in comparisons, is not in it.

        Raises:
            OutputFolderError, SystemRefusalError: the file cannot be written; what was there is untouched.
        """
        from lie_codegen.kernel.saved import save_definition

        return save_definition(self, path, f"the group {self.name}")

    @cached_property
    def record(self) -> dict[str, Any]:
        """Plain data from which `recorded` makes the group again, without deriving or proving anything."""
        numbers = self.basis
        parts = [numbers.real.tolist(), numbers.imag.tolist()] if self.is_complex else [numbers.tolist()]
        return {
            "definition": json.loads(self.definition.text),
            "text": self.definition_text,
            "description": self.description,
            "constants": self.algebra.record,
            "basis": parts,
        }

    @classmethod
    def recorded(cls, record: Mapping[str, Any]) -> MatrixGroup:
        """The group of which the record was taken; its exact basis is read when it is asked for.

        Args:
            record: what `MatrixGroup.record` holds: definition, floats of the basis and of the structure constants, units, description.

        Raises:
            ArgumentError: it is no such record.
        """
        definition = definition_of(record["definition"]["kind"], record["definition"]["parameters"])
        given = definition["parameters"]
        parts = [np.array(part) for part in record["basis"]]
        basis = parts[0] + 1j * parts[1] if len(parts) > 1 else parts[0]
        basis.setflags(write=False)
        group = cls.__new__(cls)
        group.__dict__.update(
            algebra=LieAlgebra.recorded(given["name"], given["labels"], record["constants"]),
            units=given["units"],
            description=record["description"],
            definition=definition,
            definition_text=record["text"],
            is_complex=len(parts) > 1,
            basis=basis,
            record=record,
        )
        return group

    if not TYPE_CHECKING:  # for a type checker no name is found that is not written above

        def __getattr__(self, name: str) -> Any:
            """The exact basis of a recorded group, the one thing that is not there from the start."""
            if name != "exact_basis" or "record" not in self.__dict__:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            rows = self.definition["parameters"]["matrices"]
            exact = tuple(sp.ImmutableMatrix([[exact_number(entry) for entry in row] for row in m]) for m in rows)
            self.__dict__["exact_basis"] = exact
            return exact

    @cached_property
    def definition_text(self) -> str:
        """Canonical text of everything the derived code depends on; equal groups have equal texts, and these give equal code."""
        rows = [f"{label} [{unit}] = {matrix.tolist()}" for label, unit, matrix in self._rows()]
        return "\n".join([self.name, *rows])

    def _rows(self) -> Any:
        return zip(self.labels, self.units, self.exact_basis, strict=True)


def require_group(value: object, where: str) -> MatrixGroup:
    """The value if it is a group.

    Raises:
        InputError: saying how to make one.
    """
    if isinstance(value, MatrixGroup):
        return value
    raise InputError(f"{where}: expected a group, got {value!r}; make one with lc.group(name) or lc.from_matrices(...)")


def _numbers(values: ArrayLike, what: str, kind: type) -> Array:
    try:
        return np.asarray(values, dtype=kind)
    except (TypeError, ValueError):
        real = "real numbers" if kind is float else "numbers"
        raise InputError(f"{what} must be an array of {real}, got {values!r:.60}") from None
