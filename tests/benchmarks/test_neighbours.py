"""lie-codegen bench neighbours: the errors are those against an independent exponential, and what errs is found."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.benchmarks.neighbours import Neighbour, bench_neighbours, errors, exact_exp, ours, table


def test_the_exact_exponential_is_scipys() -> None:
    x = np.array([0.4, -1.1, 2.0, 0.3, 0.2, -0.7])
    np.testing.assert_allclose(exact_exp(x), expm(lc.group("se3").hat(x)), rtol=0, atol=3e-15)


def test_ours_is_right_to_rounding_near_the_identity_and_near_half_a_turn() -> None:
    assert max(errors(ours())) < 2e-15


def test_a_library_that_loses_digits_or_gives_no_number_is_seen() -> None:
    se3, log_of_ours = lc.group("se3"), lc.build("se3").log

    def careless(X: np.ndarray) -> np.ndarray:
        """The textbook: the angle by an arc cosine, NaN at the identity."""
        angle = np.arccos(np.clip((np.trace(X[:3, :3]) - 1) / 2, -1, 1))
        with np.errstate(invalid="ignore", divide="ignore"):
            w = angle / (2 * np.sin(angle)) * np.array([X[2, 1] - X[1, 2], X[0, 2] - X[2, 0], X[1, 0] - X[0, 1]])
        return np.append(w, log_of_ours(X)[3:])

    exp, log, cut = errors(Neighbour(lambda x: expm(se3.hat(x)), careless))
    assert exp < 1e-12
    assert log >= 1
    assert cut > 1e-9


def test_who_is_absent_is_named_and_who_is_there_is_timed() -> None:
    rows = bench_neighbours(3, libraries=("lie_codegen", "gtsam", "scipy RigidTransform"))
    assert rows[0].exp_ns > 0
    assert rows[0].batch_ns < rows[0].exp_ns
    assert all(row.note or row.exp_ns > 0 for row in rows)
    assert "lie_codegen" in table(rows)
