"""Distributions on a group: Gaussian in the tangent space, and the invariant one of a compact group."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.studies.distributions import Distribution, covariance_factor, finite_numbers, normal_quantile
from lie_codegen.values import settle


@dataclass(frozen=True, eq=False, repr=False)
class OnGroup(Distribution):
    """Elements of a group.

    Attributes:
        group: the group, its name or its file.
        spread: None for Haar's measure, of a compact group; otherwise X = mean exp(hat xi), xi ~ N(0, spread^2):
            a number, (n,) standard deviations, or an (n, n) covariance.
        mean: (d, d) element, the identity if not given.

    Raises:
        UnknownGroupError: no such group.
        InputError: no spread on a group that is not compact; a spread that is none.
        ShapeError, NotOnGroupError: a mean that is no element; a spread of another shape.
    """

    group: GroupLike
    spread: Any = None
    mean: Any = None

    def __post_init__(self) -> None:
        group = as_group(self.group, "OnGroup")
        mean = np.eye(group.degree) if self.mean is None else admitted(group, self.mean, "OnGroup: mean").X
        spread = None
        if self.spread is None:
            if not _is_compact(group):
                raise InputError(
                    f"OnGroup: {group.name} is not compact, so its Haar measure is no distribution; give spread=, the standard "
                    "deviation of xi in mean exp(hat xi)"
                )
        else:
            spread = _spread(group, self.spread)
        settle(self, group=group, mean=mean, spread=spread)

    @property
    def slots(self) -> int:
        """n for a spread; for Haar's measure as many as a Gaussian matrix has numbers, or n for each of the factors of `_walk`."""
        group = self._group
        if self.spread is not None:
            return group.dim
        kind = _compact_kind(group)
        if kind is None:
            return _FACTORS * group.dim
        return group.degree**2 * (2 if kind == "su" else 1)

    @property
    def _group(self) -> MatrixGroup:
        return as_group(self.group)

    def draw(self, uniform: Array) -> Array:
        """Elements (N, d, d) of `uniform` numbers (N, slots) in (0, 1)."""
        group = self._group
        z = normal_quantile(uniform)
        if self.spread is not None:
            return np.asarray(self.mean @ expm(group.hat(z @ covariance_factor("OnGroup: spread", self.spread).T)))
        d, kind = group.degree, _compact_kind(group)
        if kind is None:
            return _walk(group, z.reshape(len(z), _FACTORS, group.dim))
        matrix = z[:, : d * d] + 1j * z[:, d * d :] if kind == "su" else z
        return _haar(matrix.reshape(-1, d, d))


def _spread(group: MatrixGroup, spread: ArrayLike) -> Array:
    """(n, n) covariance."""
    given = finite_numbers("OnGroup: spread", spread)
    if given.shape not in ((), (group.dim,), (group.dim, group.dim)):
        raise ShapeError(
            f"OnGroup: spread has shape {given.shape}; {group.name} takes a number, (n,) or (n, n), n = {group.dim}"
        )
    if given.ndim < 2:
        if np.any(given < 0):
            raise InputError("OnGroup: spread must not be negative")
        given = np.diag(np.broadcast_to(given, (group.dim,)) ** 2)
    covariance_factor("OnGroup: spread", given)
    return given


def _compact_kind(group: MatrixGroup) -> str | None:
    """ "so" or "su": the skew matrices of a degree are as many as its rotations have dimensions, so a skew basis of so many spans all."""
    skew = np.allclose(group.basis, -np.conj(np.swapaxes(group.basis, 1, 2)), atol=1e-14)
    d = group.degree
    if not skew:
        return None
    if not np.iscomplexobj(group.basis) and group.dim == d * (d - 1) // 2:
        return "so"
    traceless = np.allclose(np.trace(group.basis, axis1=1, axis2=2), 0, atol=1e-14)
    return "su" if np.iscomplexobj(group.basis) and traceless and group.dim == d * d - 1 else None


#: Factors of `_walk`, and the standard deviation of each, in an orthonormal basis.
_FACTORS, _WIDTH = 24, 8.0


def _is_compact(group: MatrixGroup) -> bool:
    """Whether all one-parameter subgroups stay bounded: then -tr(A B) is an invariant inner product, and a generic element has
    eigenvalues on the imaginary axis. The form alone would take diag(2 i t, t) for one, the eigenvalues alone a shear."""
    form = _trace_form(group)
    if np.linalg.eigvalsh(form)[0] <= 1e-9 * np.max(np.abs(form)):
        return False
    generic = group.hat(np.sqrt(np.arange(2.0, 2.0 + group.dim)))
    values = np.linalg.eigvals(generic)
    return bool(np.max(np.abs(values.real)) <= 1e-9 * np.max(np.abs(values)))


def _trace_form(group: MatrixGroup) -> Array:
    """(n, n) matrix of -Re tr(A B) in the basis."""
    return np.asarray(-np.einsum("aij,bji->ab", group.basis, group.basis).real)


def _walk(group: MatrixGroup, z: Array) -> Array:
    """(N, factors, n) Gaussian numbers -> (N, d, d) elements, Haar's measure to rounding.

    xi = Ad_g H with g from Haar's measure, H in a Cartan subalgebra, for a Gaussian in an invariant inner product; so wide that exp H is
    uniform on the torus. Such a measure acts on an irreducible representation by one number, the part of its zero weights in its
    dimension (1/3 for the rotations of space, 1/4 for the adjoint of SU(3)), and the product of k elements by its k-th power: it tends
    to Haar's measure (Peter and Weyl).
    """
    axes = np.linalg.inv(np.linalg.cholesky(_trace_form(group)))
    X = np.broadcast_to(np.eye(group.degree), (len(z), group.degree, group.degree))
    for k in range(z.shape[1]):
        X = X @ expm(group.hat(_WIDTH * z[:, k] @ axes))
    return np.asarray(X)


def _haar(gaussian: Array) -> Array:
    """The orthogonal or unitary factor of Gaussian matrices with R's diagonal made positive is Haar on O(d) or U(d) (Mezzadri,
    Notices of the AMS 54 (2007) 592); one column times 1/det leaves Haar's measure of the subgroup det = 1, for Haar's measure of the
    whole group is unchanged by such a factor from the right.
    """
    q, r = np.linalg.qr(gaussian)
    diagonal = np.diagonal(r, axis1=1, axis2=2)
    q = q * (diagonal / np.abs(diagonal))[:, None, :]
    q[:, :, 0] *= np.conj(np.linalg.det(q))[:, None]
    return np.asarray(q)
