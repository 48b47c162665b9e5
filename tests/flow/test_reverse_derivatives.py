"""Reverse derivatives of X(T): against the variational equation, finite differences of single runs, and the numpy form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, expm_frechet

import lie_codegen as lc
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.flow import input_slopes
from lie_codegen.flow.magnus import reverse, tangents


def cotangent(group: lc.MatrixGroup, seed: int = 3) -> np.ndarray:
    parts = np.random.default_rng(seed).normal(size=(2, group.degree, group.degree))
    return parts[0] + 1j * parts[1] if group.is_complex else parts[0]


@pytest.mark.parametrize("name", ["so3", "su2", "se3", "su3", "so7", "gl3", "sl2", "h3", "osc4", "r3", "se_2_3", "su4"])
def test_lanes_and_numpy_pull_the_same_covector_back(name: str) -> None:
    group, rng = lc.group(name), np.random.default_rng(0)
    values, lengths = rng.normal(size=(43, 6, group.dim)) / np.sqrt(group.dim), rng.uniform(0.05, 0.2, 43)
    C = cotangent(group)
    found = reverse.pullback(group, values, lengths, C)
    wanted, _ = reverse._by_numpy(group, values, lengths, reverse._skew_part(group, C))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13 * np.max(np.abs(wanted)))


@pytest.mark.parametrize("name", ["so3", "su2", "sl2", "se3", "su4"])
def test_samples_that_are_held_have_the_derivative_of_their_exponentials(name: str) -> None:
    """X = exp(h_1 v_1^) ... exp(h_m v_m^): scipy's Frechet derivative of each factor."""
    group, rng = lc.group(name), np.random.default_rng(1)
    m, n = 7, group.dim
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 0.5, m))])
    v = rng.normal(size=(m, n)) / np.sqrt(n)
    p = lc.propagator(group, lc.SampledInput(times, v), duration=float(times[-1]))()
    widths = np.diff(times)
    factors = [expm(h * group.hat(row)) for h, row in zip(widths, v, strict=True)]
    wanted = np.empty((m, n, group.degree, group.degree), p.X.dtype)
    for k in range(m):
        before = np.linalg.multi_dot([np.eye(group.degree), np.eye(group.degree), *factors[:k]])
        after = np.linalg.multi_dot([np.eye(group.degree), np.eye(group.degree), *factors[k + 1 :]])
        for i in range(n):
            slope = expm_frechet(widths[k] * group.hat(v[k]), widths[k] * group.basis[i], compute_expm=False)
            wanted[k, i] = before @ slope @ after
    scale = np.max(np.abs(wanted))
    np.testing.assert_allclose(p.dX, wanted, rtol=0, atol=2e-12 * scale)
    G = cotangent(group)
    np.testing.assert_allclose(
        p.gradient(G), np.einsum("ij,kpij->kp", G.conj(), wanted).real, rtol=0, atol=1e-11 * scale
    )
    assert p.eta.shape == (m, n, n)


def test_samples_joined_by_lines_and_held_beyond_their_times() -> None:
    so3, rng, h = lc.group("so3"), np.random.default_rng(2), 1e-4
    times, v = np.array([0.4, 1.0, 1.3, 2.2]), rng.normal(size=(4, 3))

    def X(values: np.ndarray) -> np.ndarray:
        return lc.propagator(so3, lc.SampledInput(times, values, "linear"), duration=3.0, rtol=1e-13)().X

    p = lc.propagator(so3, lc.SampledInput(times, v, "linear"), duration=3.0)()
    for place in np.ndindex(4, 3):
        moved = [X(v + k * h * (np.arange(12).reshape(4, 3) == 3 * place[0] + place[1])) for k in (-2, -1, 1, 2)]
        wanted = (moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / (12 * h)
        np.testing.assert_allclose(p.dX[place], wanted, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ["so3", "su2", "se2"])
def test_many_parameters_go_back_and_give_what_going_forward_gives(name: str) -> None:
    group, m = lc.group(name), 9
    names = [f"p{k}" for k in range(m)]
    texts = [" + ".join(f"p{k}*cos({k + i}*t/3)" for k in range(m)) for i in range(3)]
    u = lc.ParametricInput(texts, parameters=names, breakpoints=(0.7,))
    at = dict(zip(names, np.random.default_rng(4).normal(size=m) / 3, strict=True))
    p = lc.propagator(group, u, duration=2.0)(**at)
    wanted = tangents.tangents(group, u, at, 2.0, p.finest)
    np.testing.assert_allclose(p.dX, wanted, rtol=0, atol=1e-13 * max(1.0, np.max(np.abs(wanted))))
    G = cotangent(group)
    np.testing.assert_allclose(p.gradient(G), np.einsum("ij,pij->p", G.conj(), wanted).real, rtol=0, atol=1e-12)


def test_the_gradient_of_a_period_sees_that_the_period_moves() -> None:
    u = lc.ParametricInput(["a*cos(w*t)", "0", "1"], parameters=("a", "w"), period="2*pi/w")
    p = lc.propagator("so3", u, duration="period")(a=0.4, w=1.3)
    G = cotangent(lc.group("so3"))
    np.testing.assert_allclose(p.gradient(G), np.einsum("ij,pij->p", G, p.dX), rtol=0, atol=1e-12)


def test_blocks_of_steps_and_of_values_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    u = lc.SampledInput(np.linspace(0, 3, 31), np.random.default_rng(5).normal(size=(30, 3)))
    p = lc.propagator("su2", u, duration=3.0)()
    G = cotangent(lc.group("su2"))
    whole = p.gradient(G)
    monkeypatch.setattr(reverse, "_BLOCK", 17)
    monkeypatch.setattr(input_slopes, "_MOST_VALUES", 100)
    np.testing.assert_allclose(p.gradient(G), whole, rtol=0, atol=1e-13)


def test_what_cannot_be_a_cotangent_is_refused() -> None:
    p = lc.propagator("so3", lc.SampledInput([0, 1.0], [[1.0, 0, 0]]), duration=1.0)()
    with pytest.raises(ShapeError, match=r"give \(3, 3\)"):
        p.gradient(np.ones(3))
    with pytest.raises(NotFiniteError):
        p.gradient(np.full((3, 3), np.nan))
    with pytest.raises(InputError, match="no parameters"):
        lc.propagator("so3", [1.0, 0, 0], duration=1.0)().gradient(np.eye(3))
