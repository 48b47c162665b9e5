"""Forces on a group from a potential and from damping, as bodies for `closed_loop` and the integrators.

    f = -d_1 V,  d_1 V_a = d/ds V(X exp(s A_a)) at s = 0;   f = -D xi

nabla_{q'} q' = M^{-1}(F - dV): (9) of Bullo and Murray, CIT-CDS 97-003, is printed with + dV, which feeds energy in.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lie_codegen.control.error_derivatives import ErrorDerivatives
from lie_codegen.control.error_function import ErrorSymbols, error_function
from lie_codegen.control.error_inputs import refuse_inputs
from lie_codegen.control.second_order_step import ForceBody
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import eigenvalues, symmetric_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import Vector, constant_matrix, identity, matvec, negative


class Potential:
    """V(X) with its force; (ops, X) -> (n,) force of position, as `variational_step` takes it.

    Args:
        group: a `MatrixGroup`.
        V: a text or SymPy expression of X, as phi in `error_function`. [J]
        parameters: name -> number.

    Raises:
        ExpressionError, InputError: outside the grammar; an entry of X_d, which a potential does not know.
    """

    def __init__(self, group: MatrixGroup, V: Any, parameters: Mapping[str, Any] | None = None) -> None:
        self.group = group
        self.real = derivation_of(group).real
        self.data = refuse_inputs(error_function(group, V, parameters=parameters, name="potential"))
        own = {s for prefix in ("X", "Xi") for s in ErrorSymbols(group).matrix(prefix).free_symbols}
        foreign = self.data.phi.free_symbols - own
        if foreign:
            raise InputError(f"a potential depends on X alone, not on {', '.join(sorted(map(str, foreign)))}")

    def __call__(self, ops: Arithmetic, X: Any) -> Vector:
        return negative(self._at(ops, X).differential(1)[1])

    def energy(self, ops: Arithmetic, X: Any) -> Scalar:
        """V(X). [J]

        Args:
            ops: an arithmetic.
            X: (d, d) element, rows of its numbers.
        """
        return self._at(ops, X).differential(1)[0]

    @property
    def force(self) -> ForceBody:
        """The same as (ops, t, X, xi) -> (n,), for `closed_loop(external=...)`."""
        return lambda ops, _t, X, _xi: self(ops, X)

    def _at(self, ops: Arithmetic, X: Any) -> ErrorDerivatives:
        element = GroupMatrices(ops, self.real).read(X)
        return ErrorDerivatives(ops, self.data, self.real, element, identity(self.real.size))


def damping_force(group: GroupLike, D: Any) -> ForceBody:
    """The body force -D xi, (n,), D symmetric and not negative, for `closed_loop(external=...)`.

    Args:
        group: the group, its name or its file.
        D: a number, (n,) for a diagonal, or (n, n), in units of force over velocity.

    Raises:
        InputError: D has a negative eigenvalue. ShapeError: it is none of these shapes.
    """
    group = as_group(group, "damping_force")
    matrix = symmetric_matrix(D, group.dim, "damping")
    if eigenvalues(matrix)[0] < -1e-12:
        raise InputError("damping has a negative eigenvalue: it would drive the system")
    return lambda ops, _t, _X, xi: negative(matvec(constant_matrix(ops, matrix), xi))
