"""Controllability at second order, observability, and the regions of attraction."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.control.tracking_region import attitude_constants, tracking_region
from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.mechanics.accessibility import (
    accessibility_rank,
    direction_observability,
    second_order_controllability,
)


def test_two_torques_need_distinct_moments_for_the_full_state() -> None:
    """Proposition 13 with its true condition: rank 6 for I_1 != I_2, 5 for I_1 = I_2, attitude accessible in both."""
    so3 = load("so3").algebra
    distinct, equal = sp.diag(6, 3, 1), sp.diag(3, 3, 1)
    torques = ["w1", "w2"]
    assert accessibility_rank(so3, distinct, torques) == 6
    assert accessibility_rank(so3, equal, torques) == 5
    a, b = (second_order_controllability(so3, inertia, torques) for inertia in (distinct, equal))
    assert (a.state_accessible, a.configuration_accessible, a.configuration_controllable) == (True, True, True)
    assert (b.state_accessible, b.configuration_accessible, b.configuration_controllable) == (False, True, True)
    assert a.symmetric_growth[:2] == (2, 3)
    assert b.symmetric_growth[-1] == 2


def test_one_torque_reaches_little_and_a_full_set_everything() -> None:
    so3 = load("so3").algebra
    one = second_order_controllability(so3, sp.diag(6, 3, 1), ["w1"])
    assert not one.configuration_accessible
    assert accessibility_rank(so3, sp.diag(6, 3, 1), ["w1"]) == 2
    se3 = load("se3").algebra
    full = second_order_controllability(se3, sp.diag(2, 3, 4, 5, 6, 8), list(se3.labels), degree=2)
    assert full.configuration_controllable


def test_planar_body_with_an_off_axis_thruster_is_accessible_and_has_a_bad_product() -> None:
    """A hovercraft: force along x and along y at distance h: accessible and controllable (Lewis and Murray's planar body)."""
    se2 = load("se2").algebra
    found = second_order_controllability(se2, sp.diag(1, 2, 2), [[0, 1, 0], [-1, 0, 1]])
    assert found.configuration_accessible
    assert found.configuration_controllable
    lone = second_order_controllability(se2, sp.diag(1, 2, 2), [[-1, 0, 1]])
    assert not lone.configuration_controllable


def test_a_direction_sensor_sees_omega_unless_it_stays_along_the_direction() -> None:
    inertia, z = sp.diag(6, 3, 1), [0, 0, 1]
    assert direction_observability(inertia, z, [1, 2, 3]).rank == 5
    along = direction_observability(inertia, z, [0, 0, 3])  # principal and along y: a standing y
    assert not along.omega_observable
    symmetric = direction_observability(sp.diag(2, 2, 2), z, [0, 0, 3])
    assert symmetric.rank < 5
    tilted = direction_observability(inertia, [sp.Rational(3, 5), 0, sp.Rational(4, 5)], [3, 0, 4])
    assert tilted.omega_observable  # along y, but not principal: it does not stay
    assert not tilted.heading_observable


def test_region_of_attraction_is_that_of_lemma_5_2() -> None:
    so3 = load("so3")
    gains = {"K_p": [1, 2, 3], "K_d": 1}
    eye, zero = np.eye(3), np.zeros(3)
    still = {"inertia": [3, 2, 2], "error": "so3_right", "gains": gains, "X_d": eye, "xi_d": zero}
    turned = tracking_region(so3, X=expm(so3.hat([0, 0, np.pi])), xi=zero, **still)
    assert pytest.approx(3) == turned.W  # k_1 + k_2, the least of the pairs: the saddle itself
    assert tracking_region(so3, X=expm(so3.hat([0, 0, 3.0])), xi=zero, **still).inside
    moving = tracking_region(so3, X=eye, xi=[2, 0, 0], **still)
    assert (moving.W, moving.inside) == (pytest.approx(6), False)
    unknown = tracking_region(
        so3, inertia=1, error="frobenius", gains={"k_p": 1, "K_d": 1}, X=eye, xi=zero, X_d=eye, xi_d=zero
    )
    assert unknown.inside is None


def test_quadratic_constants_hold_on_samples() -> None:
    K, J, epsilon = [1, 2, 4], [3, 2, 2], 0.5
    constants = attitude_constants(K, J, epsilon)
    law = function_of(tracking_law(load("so3"), inertia=J, error="so3_right", gains={"K_p": K, "K_d": 1}))
    rng = np.random.default_rng(0)
    ratios = []
    for x in rng.normal(size=(300, 3)):
        R = expm(load("so3").hat(x))
        force, phi = (
            np.array(v).ravel() for v in law(R.ravel(), *np.zeros((1, 3)), np.eye(3).ravel(), *np.zeros((2, 3)))[:2]
        )
        if phi[0] < constants.L - epsilon:
            ratios.append(phi[0] / (force @ (force / J)))
    assert len(ratios) > 50
    assert constants.b_2 <= min(ratios) <= max(ratios) <= constants.b_1
    with pytest.raises(InputError, match="epsilon"):
        attitude_constants(K, J, 9)
