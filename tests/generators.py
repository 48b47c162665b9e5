"""Elements and groups that stress what is rare: section by section what a sampler "well inside the domain" never meets.

Everything is seeded by the generator that is given. Matrices near the cut are built from (-cos delta, sin delta), not from cos(pi - delta),
which loses every delta below 1e-8. Independent of the package's kernels: NumPy and SciPy alone, groups by the front door.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import scipy.linalg
import sympy as sp
from numpy.typing import NDArray

import lie_codegen as lc
from lie_codegen.groups.matrix_group import MatrixGroup

Array = NDArray[Any]

#: Distances from the cut.
NEAR = (0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3)
#: Sizes of the noise that carries an element off its group.
OFF = (1e-13, 1e-9, 1e-7, 1e-5, 1e-4, 1e-2)


def haar_unitary(n: int, rng: np.random.Generator) -> Array:
    """U(n): QR of a complex Gaussian matrix; without the phases of diag R it would not be Haar."""
    Q, R = np.linalg.qr(rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n)))
    phases = np.diag(R) / np.abs(np.diag(R))
    return np.asarray(Q * phases)


def haar_special_unitary(n: int, rng: np.random.Generator) -> Array:
    """SU(n): the first column over the determinant."""
    U = haar_unitary(n, rng)
    U[:, 0] /= np.linalg.det(U)
    return U


def haar_rotation(n: int, rng: np.random.Generator) -> Array:
    """SO(n): signs of diag R, then the determinant."""
    Q, R = np.linalg.qr(rng.normal(size=(n, n)))
    Q = Q * np.sign(np.diag(R))
    Q[:, 0] *= np.sign(np.linalg.det(Q))
    return np.asarray(Q)


def plane_rotation(angle: float) -> Array:
    """[[c, -s], [s, c]]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def half_turn_less(delta: float) -> Array:
    """The rotation of the plane by pi - delta, with all digits of delta."""
    c, s = np.cos(delta), np.sin(delta)
    return np.array([[-c, -s], [s, -c]])


def rotations_near_the_cut(n: int, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """(description, X in SO(n)): one angle at pi - delta alone, equal pairs, unequal pairs, with 0 and with 2.3."""
    for delta in NEAR:
        cases: dict[str, list[Array]] = {"alone": [half_turn_less(delta)]}
        if n >= 4:
            cases["equal pair"] = [half_turn_less(delta)] * 2
            cases["unequal pair"] = [half_turn_less(delta), half_turn_less(3 * delta + 1e-7)]
            cases["opposite pair"] = [half_turn_less(delta), half_turn_less(delta).T]
            cases["with 2.3"] = [half_turn_less(delta), plane_rotation(2.3)]
            cases["with 1e-8"] = [half_turn_less(delta), plane_rotation(1e-8)]
        if n >= 6:
            cases["triple"] = [half_turn_less(delta)] * 3
        for text, blocks in cases.items():
            size = 2 * len(blocks)
            core = scipy.linalg.block_diag(*blocks, np.eye(n - size))
            Q = haar_rotation(n, rng)
            yield f"SO({n}), pi - {delta:g}, {text}", Q @ core @ Q.T


def special_unitaries_that_are_rare(n: int, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """(description, X in SU(n)): angle sums 2 pi k, ties, the centre, equal and nearly equal eigenvalues, near the cut."""

    def turned(angles: Any) -> Array:
        Q = haar_unitary(n, rng)
        return np.asarray((Q * np.exp(1j * np.asarray(angles, dtype=float))) @ Q.conj().T)

    for m in range(n):
        yield f"centre {m}", np.exp(2j * np.pi * m / n) * np.eye(n)
    for gap in (0.0, 1e-8, 1e-13):
        angles = np.full(n, 0.7)
        angles[0] += gap
        angles[-1] = -np.sum(angles[:-1])
        yield f"nearly equal, gap {gap:g}", turned(angles)
    tie = np.full(n, 2 * np.pi / n)
    tie[-1] = -np.sum(tie[:-1])
    yield "tie", turned(tie)
    for delta in NEAR:
        angles = rng.uniform(-1, 1, size=n)
        angles[0] = np.pi - delta
        angles[-1] = -np.sum(angles[:-1])
        yield f"pi - {delta:g}", turned(angles)
        if n >= 3:
            angles[1] = np.pi - 2 * delta
            angles[-1] = -np.sum(angles[:-1])
            yield f"pi - {delta:g} twice", turned(angles)
    for _ in range(4):
        angles = rng.uniform(2.2, 3.1, size=n)
        angles[-1] = -np.sum(angles[:-1])
        yield "k of 1 and more", turned(angles)
        yield "k of -1 and less", turned(-angles)


def noncompact_elements(group: MatrixGroup, rng: np.random.Generator) -> Iterator[tuple[str, Array, Array]]:
    """(description, x, exp(hat x)): Gaussian x scaled so that max |Im mu| takes each value, with max |Re mu| <= 4."""
    for angle in (0.3, 2.0, 3.1, 3.1415, 4.0, 6.0):
        x = rng.normal(size=group.dim)
        for _ in range(60):
            mu = np.linalg.eigvals(group.hat(x))
            turn, stretch = np.max(np.abs(mu.imag)), np.max(np.abs(mu.real))
            if turn > 1e-3 and stretch / turn * angle <= 4:
                x = x * (angle / turn)
                break
            x = rng.normal(size=group.dim)
        else:
            continue
        yield f"{group.name}, max |Im mu| = {angle}", x, scipy.linalg.expm(group.hat(x))


def without_logarithm(name: str, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """(description, X): matrices that are no exponential of the group, on the group's closed conditions or off them."""
    if name == "sl2":
        yield "trace below -2", np.diag([-2.0, -0.5])
        yield "minus a Jordan block", -np.array([[1.0, 1.0], [0.0, 1.0]])
    elif name == "gl2":
        yield "two different negative eigenvalues", np.diag([-2.0, -3.0])
        yield "minus a Jordan block", -np.array([[1.0, 0.5], [0.0, 1.0]])
        yield "negative determinant", np.diag([2.0, -3.0])
    elif name in ("gl3", "sl3"):
        yield "two different negative eigenvalues", np.diag([-2.0, -3.0, 1.0 / (6.0 if name == "sl3" else 1.0)])
        yield "an odd number of a negative eigenvalue", np.diag([-1.0, 2.0, 3.0 if name == "gl3" else -0.5])
    elif name in ("so3", "so4", "so5"):
        n = int(name[2])
        R = haar_rotation(n, rng)
        R[0] = -R[0]
        yield "reflection", R
        yield "1.2 times a rotation", 1.2 * haar_rotation(n, rng)
    elif name == "so31":
        yield "time and space reversed", -np.eye(4)
        yield "time reversed", np.diag([1.0, 1.0, 1.0, -1.0])
    elif name == "se3":
        X = np.eye(4)
        X[3, 0] = 0.01
        yield "a broken last row", X
    elif name == "h3":
        yield "a diagonal that is not 1", np.diag([1.0, 1.1, 1.0])


def off_the_group(group: MatrixGroup, X: Array, size: float, rng: np.random.Generator, *, across: bool = True) -> Array:
    """X plus noise of Frobenius norm `size`: across the tangent space at X (off the group), or along it (another element)."""
    noise = rng.normal(size=X.shape) + (1j * rng.normal(size=X.shape) if group.is_complex else 0)
    # The tangent space is X times the algebra; its orthonormal basis in real coordinates:
    tangents = np.array([_real(X @ matrix) for matrix in group.basis]).T
    Q, _ = np.linalg.qr(tangents)
    flat = _real(noise)
    along = Q @ (Q.T @ flat)
    part = flat - along if across else along
    length = float(np.linalg.norm(part))
    if length < 1e-12:
        return X
    half = part.size // 2
    step = (part[:half] + 1j * part[half:]).reshape(X.shape) * (size / length)
    return np.asarray(X + (step if group.is_complex else step.real))


def _real(A: Array) -> Array:
    flat = np.asarray(A, dtype=complex).ravel()
    return np.concatenate([flat.real, flat.imag])


def generic_basis(group: MatrixGroup, rng: np.random.Generator, *, scale: int = 1, largest: int = 3) -> MatrixGroup:
    """The group in a random rational basis; with `scale` > 1 its elements differ in size by that factor."""
    n = group.dim
    while True:
        change = rng.integers(-largest, largest + 1, size=(n, n))
        if abs(np.linalg.det(change)) > 0.5:
            break
    sizes = [Fraction(1), Fraction(1, scale), Fraction(scale)]
    combinations = {
        f"b{i + 1}": {
            label: sp.Rational(int(change[i, k])) * sp.Rational(sizes[i % 3].numerator, sizes[i % 3].denominator)
            for k, label in enumerate(group.labels)
            if change[i, k]
        }
        for i in range(n)
    }
    return lc.change_of_basis(group, combinations, name=f"{group.name}_generic")


def spin_group(twice_spin: int, name: str | None = None) -> MatrixGroup:
    """SU(2) (SO(3) for whole spins) by its antihermitian matrices of dimension twice_spin + 1."""
    j = sp.Rational(twice_spin, 2)
    d = twice_spin + 1
    m = [j - k for k in range(d)]
    plus = sp.zeros(d, d)
    for k in range(1, d):
        plus[k - 1, k] = sp.sqrt(j * (j + 1) - m[k] * (m[k] + 1))
    Jx, Jy, Jz = (plus + plus.T) / 2, (plus - plus.T) / (2 * sp.I), sp.diag(*m)
    matrices = [(-sp.I * J).applyfunc(sp.expand) for J in (Jx, Jy, Jz)]
    return lc.from_matrices(name or f"spin_{twice_spin}", ("jx", "jy", "jz"), matrices)


def real_double(group: MatrixGroup, name: str | None = None) -> MatrixGroup:
    """A complex group as real matrices [[Re, -Im], [Im, Re]]."""

    def doubled(matrix: Any) -> sp.Matrix:
        re, im = matrix.applyfunc(sp.re), matrix.applyfunc(sp.im)
        return sp.Matrix.vstack(sp.Matrix.hstack(re, -im), sp.Matrix.hstack(im, re))

    return lc.from_matrices(name or f"{group.name}_real", group.labels, [doubled(m) for m in group.exact_basis])


def adjoint_group(group: MatrixGroup, name: str | None = None) -> MatrixGroup:
    """The group by its adjoint matrices; of a group without centre of positive dimension."""
    n = group.dim
    matrices = [sp.zeros(n, n) for _ in range(n)]
    for i, j, k, value in group.algebra.constants():
        matrices[i][k, j] += value
    return lc.from_matrices(name or f"{group.name}_adjoint", group.labels, matrices)


def special_linear_complex(name: str = "sl2c") -> MatrixGroup:
    """SL(2, C): rotations -i sigma/2 and boosts sigma/2."""
    half, i = sp.Rational(1, 2), sp.I
    sigma = (sp.Matrix([[0, 1], [1, 0]]), sp.Matrix([[0, -i], [i, 0]]), sp.Matrix([[1, 0], [0, -1]]))
    matrices = [-i * half * s for s in sigma] + [half * s for s in sigma]
    return lc.from_matrices(name, ("j1", "j2", "j3", "k1", "k2", "k3"), [m.applyfunc(sp.expand) for m in matrices])


def unitary_group(n: int, name: str | None = None) -> MatrixGroup:
    """U(n): i times the identity, then SU(n)."""
    special = lc.group(f"su{n}")
    matrices = [sp.I * sp.eye(n), *special.exact_basis]
    return lc.from_matrices(name or f"u{n}", ("phase", *special.labels), matrices)


def residual(group: MatrixGroup, x: Array, X: Array) -> float:
    """max |exp(hat x) - X| over max(1, max |X|), by SciPy."""
    if not np.all(np.isfinite(x)):
        return float("nan")
    difference = scipy.linalg.expm(group.hat(x)) - X
    return float(np.max(np.abs(difference)) / max(1.0, float(np.max(np.abs(X)))))
