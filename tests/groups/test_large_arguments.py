"""exp and its Jacobians far beyond the depth of their polynomials: values and derivatives against integers of hundreds of bits."""

from __future__ import annotations

from functools import cache

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
import sympy as sp

import lie_codegen as lc
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.numpy_arithmetic import evaluate

EPS = 2.0**-53
SIZES = (1, 5, 10, 14, 20, 30, 50, 100, 300, 1000)
COMPACT = ("su3", "so4", "so5", "su4", "so4 x so3", "su3 in another basis")
GROUPS = ("su3", "so4", "so5", "sl3", "gl3", "sp4", "so31", "sim3", "su4", "so4 x so3", "su3 in another basis")
MAPS = ("exp", "rjac", "ljac_inv")


@cache
def group(name: str) -> MatrixGroup:
    if name == "so4 x so3":
        return lc.product("so4", "so3", name="so4_so3")
    if name == "su3 in another basis":
        su3 = lc.group("su3")
        rows = {
            f"b{i}": {su3.labels[j]: sp.Rational(1 + (i * j) % 3, 2 + (i + j) % 3) for j in {i, (i + 1) % 8}}
            for i in range(8)
        }
        return lc.change_of_basis(su3, rows, name="su3_mixed")
    return lc.group(name)


def basis(name: str, *, adjoint: bool) -> tuple[sp.Matrix, ...]:
    """Of the real form of the matrices, or of ad."""
    G = group(name)
    if adjoint:
        table = [sp.zeros(G.dim, G.dim) for _ in range(G.dim)]
        for i, j, k, c in G.algebra.constants():
            table[i][k, j] += c
        return tuple(table)
    if not G.is_complex:
        return tuple(sp.Matrix(m) for m in G.exact_basis)
    parts = [(m.applyfunc(sp.re), m.applyfunc(sp.im)) for m in G.exact_basis]
    return tuple(sp.Matrix(sp.BlockMatrix([[a, -b], [b, a]])) for a, b in parts)


@cache
def digits(name: str, adjoint: bool, bits: int) -> np.ndarray:
    """(n, m, m) integers, the basis times 2^bits."""
    with mp.workprec(bits + 40):
        scale = mp.mpf(2) ** bits

        def number(entry: sp.Expr) -> int:
            return int(mp.nint(mp.mpf(sp.N(entry, int(bits / 3.3) + 20)) * scale))

        return np.array(
            [[[number(e) for e in row] for row in m.tolist()] for m in basis(name, adjoint=adjoint)], object
        )


class Exact:
    """A map of a group in integers of `bits` bits after the point."""

    def __init__(self, name: str, map_name: str, size: float) -> None:
        self.name, self.map = name, map_name
        growth = 1.5 if name in COMPACT else 4.5 * (2 if "inv" in map_name else 1)
        self.bits = 320 + int(growth * size)

    def product(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a @ b) >> self.bits

    def exponential(self, A: np.ndarray) -> np.ndarray:
        """Taylor's series of A / 2^s, squared s times."""
        norm = max(sum(abs(e) for e in row) for row in A)
        halvings = max(0, (norm >> self.bits).bit_length()) + 8
        A = A >> halvings
        one = np.array([[(i == j) << self.bits for j in range(len(A))] for i in range(len(A))], object)
        value, term, k = one, one, 0
        while any(e not in (0, -1) for e in term.flat):
            k += 1
            term = self.product(term, A) // k
            value = value + term
        for _ in range(halvings):
            value = self.product(value, value)
        return value

    def inverse(self, A: np.ndarray) -> np.ndarray:
        n = len(A)
        rows = [[*row, *((i == j) << self.bits for j in range(n))] for i, row in enumerate(A.tolist())]
        for k in range(n):
            p = max(range(k, n), key=lambda i: abs(rows[i][k]))
            rows[k], rows[p] = rows[p], rows[k]
            rows[k] = [(e << self.bits) // rows[k][k] for e in rows[k]]
            for i in range(n):
                if i != k:
                    factor = rows[i][k]
                    rows[i] = [e - ((factor * f) >> self.bits) for e, f in zip(rows[i], rows[k], strict=True)]
        return np.array([row[n:] for row in rows], object)

    def matrix(self, x: np.ndarray) -> np.ndarray:
        """hat(x) or +-ad(x), x in integers."""
        A = np.tensordot(x, digits(self.name, self.map != "exp", self.bits), 1) >> self.bits
        return -A if self.map.startswith("r") else A

    def function(self, A: np.ndarray) -> np.ndarray:
        """Of a matrix; exp of a complex group as its real and imaginary parts, one above the other."""
        if self.map == "exp":
            return self.exponential(A)[:, : group(self.name).degree]
        n = len(A)
        # exp of [[a, 1], [0, 0]] has (e^a - 1)/a in its corner.
        block = np.zeros((2 * n, 2 * n), object)
        block[:n, :n] = A
        block[:n, n:] = np.array([[(i == j) << self.bits for j in range(n)] for i in range(n)], object)
        J = self.exponential(block)[:n, n:]
        return self.inverse(J) if self.map.endswith("inv") else J

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Of x in integers."""
        return self.function(self.matrix(x))

    def integers(self, x: np.ndarray) -> np.ndarray:
        return np.array([int(mp.mpf(float(c)) * mp.mpf(2) ** self.bits) for c in x], object)

    def floats(self, value: np.ndarray, shift: int = 0) -> np.ndarray:
        """value 2^(shift - bits)."""
        with mp.workprec(80):
            return np.array([float(mp.ldexp(mp.mpf(int(e)), shift - self.bits)) for e in value.flat]).reshape(
                value.shape
            )


def point(name: str, map_name: str, size: float, rng: np.random.Generator) -> np.ndarray:
    """x whose matrix (or ad) has eigenvalues up to the size."""
    x = rng.normal(size=group(name).dim)
    rows = [np.array(m.evalf(), dtype=float) for m in basis(name, adjoint=map_name != "exp")]
    return np.asarray(x * size / np.abs(np.linalg.eigvals(np.tensordot(x, rows, 1))).max())


def as_real(name: str, map_name: str, value: np.ndarray) -> np.ndarray:
    return np.concatenate([value.real, value.imag]) if group(name).is_complex and map_name == "exp" else value


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


def sensitivity(exact: Exact, x: np.ndarray, expected: np.ndarray, rng: np.random.Generator) -> float:
    """How many relative errors of the result a relative error of the matrix makes, in directions of its size, in the algebra and across."""
    A = exact.matrix(exact.integers(x))
    base, size = exact.function(A), float(np.max(np.abs(exact.floats(A))))
    most = 1.0
    for _ in range(3):
        E = exact.integers(rng.uniform(-size, size, A.size)).reshape(A.shape) >> 100
        moved = exact.floats(exact.function(A + E) - base, 100)
        most = max(most, float(np.max(np.abs(moved))) / float(np.max(np.abs(expected))))
    return most


def sizes(name: str, map_name: str) -> tuple[int, ...]:
    """Inverses where e^size is in the matrix take integers of thousands of bits, and the larger groups their time: some sizes of each."""
    if name in ("so5", "sp4") and map_name != "exp":
        return (10, 50)
    return (5, 14, 30, 100) if name not in COMPACT and "inv" in map_name else SIZES


#: Of these one Jacobian, the inverse, is in the default run.
_SLOW = ("su3 in another basis", "so4 x so3", "so31", "sl3")
#: The Jacobians of gl3 are those of sl3, and those of su4 have 225 entries.
CASES = [
    pytest.param(name, m, marks=[pytest.mark.slow] if m == "rjac" and name in _SLOW else [])
    for name in GROUPS
    for m in MAPS
    if m == "exp" or name not in ("gl3", "su4")
]


@pytest.mark.parametrize(("name", "map_name"), CASES)
def test_every_size_is_as_good_as_doubles_allow(name: str, map_name: str) -> None:
    rng = np.random.default_rng(5)
    compiled = getattr(lc.build(group(name)), map_name)
    points, values = [], []
    for size in sizes(name, map_name):
        x, exact = point(name, map_name, size, rng), Exact(name, map_name, size)
        found = np.asarray(compiled(x))
        points.append(x)
        values.append(found)
        expected = exact.floats(exact(exact.integers(x)))
        found = as_real(name, map_name, found)
        if not np.all(np.isfinite(expected)):
            assert not np.all(np.isfinite(found))  # beyond the largest double
            continue
        allowed = 20 * EPS * max(10.0, sensitivity(exact, x, expected, rng))
        assert relative(found, expected) <= allowed, size
    for single, batched in zip(values, compiled.batch(np.array(points)), strict=True):
        finite = np.isfinite(single)
        np.testing.assert_array_equal(finite, np.isfinite(batched))
        np.testing.assert_allclose(
            batched[finite], single[finite], rtol=0, atol=4 * EPS * np.max(np.abs(single[finite]), initial=0.0)
        )


@pytest.mark.parametrize("turns", [2, 10])
@pytest.mark.parametrize("name", ["so4", "su3"])
def test_near_their_poles_inverses_are_as_good_as_their_condition(name: str, turns: int) -> None:
    """ad x has an eigenvalue close to 2 pi i turns."""
    rng = np.random.default_rng(6)
    for distance in (1e-2, 1e-5, 1e-9):
        size = 2 * np.pi * turns * (1 + distance)
        x, exact = point(name, "ljac_inv", size, rng), Exact(name, "ljac_inv", size)
        expected = exact.floats(exact(exact.integers(x)))
        assert np.max(np.abs(expected)) > 0.1 / distance
        found = np.asarray(lc.build(group(name)).ljac_inv(x))
        assert relative(found, expected) <= 20 * EPS * sensitivity(exact, x, expected, rng)


def directional(exact: Exact, x: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first and second derivative along v, by differences of 2^-100."""
    at, step = exact.integers(x), exact.integers(v) >> 100
    ahead, here, behind = exact(at + step), exact(at), exact(at - step)
    return exact.floats(ahead - behind, 99), exact.floats(ahead - 2 * here + behind, 200)


#: Those that compile and evaluate longest are slow: maps of the other side and groups of the other kind are in the default run.
_LONG = {("so4", "exp"), ("so4", "rjac"), ("so4", "ljac_inv"), ("su3", "rjac"), ("sim3", "rjac")}


@pytest.mark.parametrize(
    ("name", "map_name"),
    [
        pytest.param(name, each, marks=[pytest.mark.slow] if (name, each) in _LONG else [])
        for name in ("su3", "so4", "sim3")
        for each in MAPS
    ],
)
def test_derivatives_are_as_good(name: str, map_name: str) -> None:
    """Of CasADi's Function forward, in reverse and twice, and of compiled C, once and twice."""
    rng = np.random.default_rng(9)
    G, kernel = group(name), group_kernel(group(name), map_name)
    x = ca.MX.sym("x", G.dim)
    value = getattr(G.casadi, map_name)(x)
    v, w = rng.normal(size=G.dim), rng.normal(size=value.numel())
    # CasADi's matrices hold complex entries as neighbours, (re, im); row by row as NumPy sees them.
    flat = ca.vec(value.T)
    first = ca.jtimes(flat, x, ca.DM(v))
    weighted = ca.dot(w, flat)
    casadi = ca.Function("derivatives", [x], [first, ca.gradient(weighted, x), ca.hessian(weighted, x)[0]])
    slope = lc.jacobian(kernel, "x")
    compiled = lc.build([slope, lc.jacobian(slope, "x", name="twice")] if name == "so4" else [slope])
    for size in (5, 40, 200):
        at, exact = point(name, map_name, size, rng), Exact(name, map_name, size)
        once, twice = directional(exact, at, v)
        if G.is_complex and map_name == "exp":
            once, twice = (np.stack(np.split(each, 2), axis=-1) for each in (once, twice))
        once, twice = once.ravel(), twice.ravel()
        allowed = 20 * EPS * max(10.0, sensitivity(exact, at, exact.floats(exact(exact.integers(at))), rng))
        forward, gradient, hessian = (np.array(each) for each in casadi(at))
        assert relative(forward.ravel(), once) <= allowed
        assert abs(gradient.ravel() @ v - w @ once) <= allowed * np.abs(w) @ np.abs(once)
        assert abs(v @ hessian @ v - w @ twice) <= allowed * np.abs(w) @ np.abs(twice)
        moved = np.asarray(getattr(compiled, slope.name)(at)).reshape(-1, G.dim) @ v
        assert relative(moved.view(float) if np.iscomplexobj(moved) else moved, once) <= allowed
        if name == "so4":
            second = np.asarray(compiled.twice(at)).reshape(-1, G.dim, G.dim) @ v @ v
            assert relative(second, twice) <= allowed


@pytest.mark.parametrize("map_name", MAPS)
def test_numpy_casadi_and_single_precision_agree_with_compiled_c(map_name: str) -> None:
    rng = np.random.default_rng(2)
    points = np.array([point("so4", map_name, size, rng) for size in (1, 9, 15, 40, 200)])
    compiled = getattr(lc.build("so4"), map_name).batch(points)
    (found,) = evaluate(group_kernel(group("so4"), map_name), points)
    single = getattr(lc.build("so4"), map_name).batch(points.astype(np.float32), real="float")
    for k, x in enumerate(points):
        casadi = np.array(getattr(group("so4").casadi, map_name)(x))
        assert relative(found[k], compiled[k]) <= 1e-13
        assert relative(casadi, compiled[k]) <= 1e-13
        rounded = x.astype(np.float32).astype(float)
        exact = Exact("so4", map_name, 200)
        expected = exact.floats(exact(exact.integers(rounded)))
        allowed = 20 * 2.0**-24 * max(10.0, sensitivity(exact, rounded, expected, rng))
        assert relative(np.asarray(single[k], dtype=float), expected) <= allowed


def test_what_no_double_holds_is_no_number() -> None:
    sl3, so4 = lc.build("sl3"), lc.build("so4")
    diagonal = np.linalg.lstsq(
        np.array([np.array(m, dtype=float).ravel() for m in group("sl3").exact_basis]).T,
        np.diag([900.0, -300.0, -600.0]).ravel(),
        rcond=None,
    )[0]
    assert not np.all(np.isfinite(sl3.exp(diagonal)))
    for size in (1e17, 1e60, 1e160, np.inf, np.nan):
        x = np.full(6, 1.0) * size
        for name in MAPS:
            assert not np.any(np.isfinite(getattr(so4, name)(x))), (size, name)
            assert not np.any(np.isfinite(getattr(so4, name).batch(x[None]))), (size, name)


def test_packages_without_routines_say_nan() -> None:
    """CUDA and OpenCL have no loops: the straight line there knows how far it reaches."""
    text = lc.device_source("so4", kernels=["exp", "ljac_inv"], target="cuda")
    assert "_far" not in text
    assert "NAN" in text.upper()
