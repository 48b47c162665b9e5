"""Random numbers by sample index, and what is made of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import lie_codegen as lc
from lie_codegen.studies.draws import uniforms
from lie_codegen.studies.space import Space


def test_numbers_do_not_depend_on_where_a_chunk_begins() -> None:
    whole = uniforms(7, "x", 0, 1000, 5)
    pieces = [uniforms(7, "x", first, count, 5) for first, count in ((0, 1), (1, 332), (333, 667))]
    assert np.array_equal(whole, np.concatenate(pieces))
    assert np.all((whole > 0) & (whole < 1))
    far = uniforms(7, "x", 10**12, 3, 16)
    assert far.shape == (3, 16)
    assert np.array_equal(far[1:], uniforms(7, "x", 10**12 + 1, 2, 16))


def test_seeds_names_and_slots_are_independent() -> None:
    x = uniforms(0, "x", 0, 20_000, 3)
    for other in (uniforms(1, "x", 0, 20_000, 3), uniforms(0, "y", 0, 20_000, 3)):
        assert not np.any(x == other)
        assert abs(np.corrcoef(x.ravel(), other.ravel())[0, 1]) < 0.02
    assert np.max(np.abs(np.corrcoef(x.T) - np.eye(3))) < 0.03
    assert abs(np.corrcoef(x[:-1, 0], x[1:, 0])[0, 1]) < 0.03
    assert stats.kstest(x.ravel(), "uniform").pvalue > 1e-3


@pytest.mark.parametrize(
    ("made", "law"),
    [
        (lc.Normal(1.0, 2.0), stats.norm(1, 2)),
        (lc.Uniform(-1, 4), stats.uniform(-1, 5)),
        (lc.LogUniform(1e-3, 10), stats.loguniform(1e-3, 10)),
        (lc.Sobol(lc.Normal(1.0, 2.0)), stats.norm(1, 2)),
        (lc.LatinHypercube(-1, 4), stats.uniform(-1, 5)),
    ],
)
def test_distributions_against_scipy(made: lc.Distribution, law: object) -> None:
    x = Space({"x": made}).columns(3, 0, 4096, 4096)["x"]
    assert stats.kstest(x, law.cdf).pvalue > 1e-3  # type: ignore[attr-defined]


def test_covariance_choice_and_joint() -> None:
    cov = np.array([[2.0, 0.5], [0.5, 1.0]])

    def pair(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return u[:, 0], u[:, 0] + u[:, 1]

    space = Space(
        {
            "z": lc.Normal([1, -1], cov=cov), "c": lc.Choice([10, 20, 30], p=[0.5, 0.3, 0.2]), ("p", "q"): lc.Joint(pair, 2),
            "twice": lambda c: 2 * c, "four": lambda twice: 2 * twice, "k": 3,
        }
    )  # fmt: skip
    found = space.columns(1, 0, 40_000, 40_000)
    assert np.allclose(np.cov(found["z"].T), cov, atol=0.05)
    assert np.allclose([np.mean(found["c"] == v) for v in (10, 20, 30)], [0.5, 0.3, 0.2], atol=0.02)
    assert np.all(found["q"] >= found["p"])
    assert np.array_equal(found["four"], 4 * found["c"])
    assert np.all(found["k"] == 3)
    later = space.columns(1, 12_345, 10, 40_000)
    assert all(np.array_equal(later[name], found[name][12_345:12_355]) for name in found)


def test_designs_are_the_same_in_pieces() -> None:
    for kind in (lc.Sobol, lc.LatinHypercube):
        space = Space({"x": kind(0, 1), "y": kind(lc.Normal([0, 0], 1))})
        whole = space.columns(4, 0, 256, 256)
        pieces = [space.columns(4, first, 64, 256) for first in range(0, 256, 64)]
        for name in ("x", "y"):
            assert np.array_equal(whole[name], np.concatenate([piece[name] for piece in pieces]))
    # one point in each of 256 equal cells of each coordinate: what both designs are for
    assert np.array_equal(np.sort(np.floor(256 * whole["x"])), np.arange(256))


def test_grids_make_their_product() -> None:
    space = Space({"a": [1, 2, 3], "b": lc.Grid(["so3", "se3"]), "c": lc.Uniform(0, 1)})
    assert space.whole == 6
    found = space.columns(0, 0, 6, 6)
    assert list(zip(found["a"].tolist(), found["b"].tolist(), strict=True)) == [
        (1, "so3"), (1, "se3"), (2, "so3"), (2, "se3"), (3, "so3"), (3, "se3"),
    ]  # fmt: skip


@pytest.mark.parametrize(("name", "degree"), [("so3", 3), ("so4", 4), ("su2", 2), ("su3", 3)])
def test_haar_by_the_moments_of_the_trace(name: str, degree: int) -> None:
    """E |tr X|^2 = 1 for the defining representation, irreducible; E X = 0; and the moments stay under a fixed rotation."""
    made = lc.OnGroup(name)
    X = made.draw(uniforms(2, "X", 0, 40_000, made.slots))
    assert np.max(np.abs(np.conj(np.swapaxes(X, 1, 2)) @ X - np.eye(degree))) < 1e-13
    assert np.max(np.abs(np.linalg.det(X) - 1)) < 1e-13
    fixed = X[0]
    for Y in (X, fixed @ X):
        trace = np.trace(Y, axis1=1, axis2=2)
        assert abs(np.mean(trace)) < 0.03
        assert abs(np.mean(np.abs(trace) ** 2) - 1) < 0.05
    if name == "so3":
        # the angle has density (1 - cos)/pi
        angle = 2 * np.arcsin(np.minimum(1, np.linalg.norm(X - np.eye(3), axis=(1, 2)) / np.sqrt(8)))
        assert stats.kstest(angle, lambda a: (a - np.sin(a)) / np.pi).pvalue > 1e-3


def test_haar_of_compact_groups_in_other_matrices() -> None:
    """SO(3) in its five-dimensional representation, and SU(2) x SO(3) in blocks: moments of characters count invariants."""
    five = lc.from_matrices("five", ("a", "b", "c"), _conjugations())
    made = lc.OnGroup(five)
    X = made.draw(uniforms(5, "X", 0, 4_000, made.slots))
    # chi_2 = 1 + 2 cos a + 2 cos 2 a, the angle with density (1 - cos)/pi
    trace = np.trace(X, axis1=1, axis2=2)
    a = np.linspace(0, np.pi, 20_001)
    moments = [
        _integral((1 + 2 * np.cos(a) + 2 * np.cos(2 * a)) ** k * (1 - np.cos(a)) / np.pi, a) for k in (1, 2, 3, 4)
    ]
    for k, moment in enumerate(moments, 1):
        assert abs(np.mean(trace**k) - moment) < 5 * np.std(trace**k) / np.sqrt(len(X))
    blocks = [np.zeros((5, 5), dtype=complex) for _ in range(6)]
    for i in range(3):
        blocks[i][:2, :2] = lc.group("su2").basis[i]
        blocks[3 + i][2:, 2:] = lc.group("so3").basis[i]
    made = lc.OnGroup(lc.from_matrices("blocks", tuple("abcdef"), blocks))
    X = made.draw(uniforms(6, "X", 0, 4_000, made.slots))
    spin, turn = np.trace(X[:, :2, :2], axis1=1, axis2=2).real, np.trace(X[:, 2:, 2:], axis1=1, axis2=2).real
    for value, moment in (
        (spin, 0),
        (spin**2, 1),
        (turn, 0),
        (turn**2, 1),
        (spin**2 * turn, 0),
        (spin**2 * turn**2, 1),
    ):
        assert abs(np.mean(value) - moment) < 5 * np.std(value) / np.sqrt(len(X))


def _integral(values: np.ndarray, at: np.ndarray) -> float:
    return float(np.sum((values[1:] + values[:-1]) / 2 * np.diff(at)))


def _conjugations() -> list[np.ndarray]:
    """S -> A S - S A on the symmetric matrices of trace zero, in an orthogonal basis that is not normed."""
    basis = [np.diag([1.0, -1, 0]), np.diag([1.0, 1, -2])]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        S = np.zeros((3, 3))
        S[i, j] = S[j, i] = 1
        basis.append(S)
    return [
        np.array([[np.sum(P * (A @ Q - Q @ A)) / np.sum(P * P) for Q in basis] for P in basis])
        for A in lc.group("so3").basis
    ]


def test_concentrated_elements_have_their_spread() -> None:
    mean = lc.build("se3").exp(np.array([0.3, -0.2, 0.1, 1, 2, 3]))
    made = lc.OnGroup("se3", spread=[0.01, 0.02, 0.03, 0.1, 0.2, 0.3], mean=mean)
    X = made.draw(uniforms(2, "X", 0, 20_000, made.slots))
    x = lc.build("se3").log.batch(np.ascontiguousarray(np.linalg.inv(mean) @ X))
    assert np.allclose(np.std(x, axis=0), [0.01, 0.02, 0.03, 0.1, 0.2, 0.3], rtol=0.03)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: lc.Normal(0, -1), "negative"),
        (lambda: lc.Normal([0, 0], cov=[[1, 2], [2, 1]]), "eigenvalues"),
        (lambda: lc.Uniform(2, 1), "above"),
        (lambda: lc.Choice([1, 2], p=[0.5, 0.6]), "one"),
        (lambda: lc.Grid([]), "list"),
        (lambda: lc.OnGroup("se3"), "Haar"),
        (lambda: lc.Quantile("x", 1.5, 0.1), "between"),
        (lambda: Space({"x": object()}), "distribution"),
        (lambda: Space({"x": lambda y: y}), "no such inputs"),
        (lambda: Space({"x y": 1}), "name"),
    ],
)
def test_what_is_refused(make: object, said: str) -> None:
    with pytest.raises(lc.errors.InputError, match=said):
        make()  # type: ignore[operator]
