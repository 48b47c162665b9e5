"""Laws tell the truth: NaN off the group, error energies without cancellation near the reference."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
import scipy.linalg
from generators import haar_rotation, off_the_group

import lie_codegen as lc
from lie_codegen.control.error_catalogue import error_names
from lie_codegen.groups.matrix_group import MatrixGroup

ROWS = [(name, error) for name in ("so3", "se3", "se2") for error in error_names(lc.group(name))]


def gains(group: MatrixGroup, error: str) -> dict[str, object]:
    """Gains of full matrices where they may be."""
    e = group.degree - (group.name != "so3")
    K1 = np.diag([1.0, 2.0, 4.0][:e])
    K2 = np.array([[2.0, 0.5, 0], [0.5, 3.0, 0.25], [0, 0.25, 5.0]])[:e, :e]
    if error == "frobenius":
        return {"k_p": 2, "K_d": 3}
    return {"K_p": K1, "K_d": 3} if group.name == "so3" else {"K_1": K1, "K_2": K2, "K_d": 3}


def law_of(name: str, error: str):
    group = lc.group(name)
    law = lc.tracking_law(group, inertia=np.eye(group.dim), error=error, gains=gains(group, error))
    return group, lc.build([law])[law.name]


@pytest.mark.parametrize(("name", "error"), ROWS)
def test_error_energies_near_the_reference_are_positive_and_right_to_the_last_digits(name: str, error: str) -> None:
    """At X_d = 1 the entries of X hold the error to the last bit; sixty digits evaluate the published formulas there."""
    group, law = law_of(name, error)
    rng, zero = np.random.default_rng(3), np.zeros(group.dim)
    eye = np.eye(group.degree)
    for size in (1e-8, 1e-5, 1e-2):
        x = size * rng.normal(size=group.dim)
        X = exact_exp(group, x)
        # The diagonal of a double holds 1 - x^2/2 to 1e-16 only, which the squares of X - 1 do not feel.
        found = law(X=np.array(X.tolist(), dtype=float), xi=zero, X_d=eye, xi_d=zero, xi_d_dot=zero)
        expected = published(group, error, X)
        assert found.phi == pytest.approx(expected, rel=1e-12 if size == 1e-8 else 1e-13 + 1e-16 / size**2)
        assert found.phi == found.W
    for _ in range(200):
        X = scipy.linalg.expm(group.hat(rng.normal(size=group.dim)))
        Y = X @ scipy.linalg.expm(10.0 ** rng.uniform(-17, -7) * group.hat(rng.normal(size=group.dim)))
        assert law(X=Y, xi=zero, X_d=X, xi_d=zero, xi_d_dot=zero).W >= 0
        assert law(X=X, xi=zero, X_d=X, xi_d=zero, xi_d_dot=zero).W == 0


def exact_exp(group: MatrixGroup, x: np.ndarray) -> mp.matrix:
    with mp.workdps(60):
        return mp.expm(mp.matrix(group.hat(x).tolist()))


def published(group: MatrixGroup, error: str, X: mp.matrix) -> float:
    """tr(K (1 - R))/2 and the offsets of Table 1, as printed (row 5 corrected), at X_d = 1."""
    with mp.workdps(60):
        given = gains(group, error)
        if error == "frobenius":
            difference = X - mp.eye(group.degree)
            return float(sum(entry**2 for entry in difference))
        e = group.degree - (group.name != "so3")
        R = X[:e, :e]
        K = mp.matrix(np.asarray(given["K_p" if group.name == "so3" else "K_1"]).tolist())
        phi = sum((K * (mp.eye(e) - R))[i, i] for i in range(e)) / 2
        if group.name == "so3":
            return float(phi)
        p = X[:e, e]
        row = error[-1]
        offset = {
            "1": p,
            "2": p,
            "3": R.T * p,
            "4": (R.T + mp.eye(e)) * p,
            "5": (R + mp.eye(e)) * R.T * p,
            "6": R.T * p,
        }[row]
        K2 = mp.matrix(np.asarray(given["K_2"]).tolist())
        return float(phi + (offset.T * K2 * offset)[0] / 2)


def test_laws_off_the_group_give_nan() -> None:
    rng = np.random.default_rng(5)
    pd = lc.build([lc.attitude_law("pd", inertia=np.diag([1, 2, 3]), k_p=4, k_d=6)]).attitude_pd
    p = lc.build([lc.attitude_law("p", k_p=2)]).attitude_p
    R, omega = haar_rotation(3, rng), rng.normal(size=3)
    for wrong in (
        np.diag([1.0, 1, -1]),
        -R,
        1.2 * R,
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        off_the_group(lc.group("so3"), R, 1e-3, rng),
    ):
        for output in (*pd(wrong, omega), *p(wrong)):
            assert np.all(np.isnan(output))
    single = R.astype(np.float32).astype(float)
    np.testing.assert_allclose(pd(single, omega).torque, pd(R, omega).torque, atol=1e-5)
    reduced = lc.build([lc.attitude_law("reduced", k_p=1)]).attitude_reduced
    assert np.all(np.isnan(reduced(np.array([0.0, 0.0, 2.0])).omega))
    assert np.all(np.isfinite(reduced(R[2]).omega))


@pytest.mark.parametrize("name", ["so3", "se3", "su2"])
def test_tracking_laws_off_the_group_give_nan_in_calls_and_batches(name: str) -> None:
    group, rng = lc.group(name), np.random.default_rng(6)
    law = lc.tracking_law(group, inertia=np.eye(group.dim), error="frobenius", gains={"k_p": 2, "K_d": 3})
    call = lc.build([law])[law.name]
    zero = np.zeros(group.dim)
    X = scipy.linalg.expm(group.hat(rng.normal(size=group.dim)))
    wrong = off_the_group(group, X, 1e-2, rng)
    assert np.isfinite(call(X=X, xi=zero, X_d=X, xi_d=zero, xi_d_dot=zero).W)
    for a, b in ((X, wrong), (wrong, X)):
        assert np.all(np.isnan(call(X=a, xi=zero, X_d=b, xi_d=zero, xi_d_dot=zero).force))
    many = call.batch(X=np.array([X, wrong] * 9), xi=zero, X_d=X, xi_d=zero, xi_d_dot=zero)
    assert np.all(np.isnan(many.W[1::2]))
    assert np.all(np.isfinite(many.W[::2]))
