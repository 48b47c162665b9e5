"""Gallery targets of the rigid body and of vibrational control: pictures made, numbers as published."""

from __future__ import annotations

import json

import pytest

from lie_codegen.gallery.registry import reproduce


def run(name, folder):
    result = reproduce(name, folder, lambda line: None)
    assert result.picture.read_bytes().startswith(b"\x89PNG")
    return json.loads((folder / f"{name}.json").read_text())


def test_thruster(tmp_path):
    numbers = run("rigid_body_thruster", tmp_path)
    assert numbers["Omega"]["actual"] == pytest.approx(1.7567495548, abs=2e-9)
    assert numbers["k"]["averaged"] == pytest.approx(0.3418341913, abs=2e-9)


@pytest.mark.slow
def test_boom_and_limit_cycle(tmp_path):
    numbers = run("rigid_body_boom", tmp_path)
    assert numbers["k_squared"]["algebraic"] == pytest.approx(0.3048172434, abs=1e-9)
    assert numbers["largest_error_k_squared_percent"] < 2
    numbers = run("rigid_body_limit_cycle", tmp_path)
    assert numbers["Omega"]["actual"] == pytest.approx(1.3781238629, abs=2e-9)
    assert numbers["khat_squared"] == pytest.approx(0.25, abs=1e-6)
    assert numbers["Omega"]["third_order"]["mean"] == pytest.approx(1.3352, abs=5e-5)
    assert numbers["c3"] == pytest.approx(0.738374562, abs=2e-8)


@pytest.mark.slow
def test_tumbling_bodies(tmp_path):
    numbers = run("tumbling_debris", tmp_path)
    assert numbers["status"] == "ok"
    assert numbers["largest_error"]["osculating_from_mean"] < numbers["largest_error"]["osculating_start"]
    assert numbers["evaluations"]["direct"] > 10_000 * numbers["evaluations"]["averaged"]
    numbers = run("tumbling_separatrix", tmp_path)
    assert numbers["event"]["t"] == pytest.approx(5412, abs=2)
    assert (numbers["event"]["left"], numbers["event"]["entered"]) == ("LAM", "SAM")


@pytest.mark.slow
def test_cost_over_one_over_eps(tmp_path):
    numbers = run("rigid_body_cost", tmp_path)
    assert all(0.9 < slope < 1.2 for slope in numbers["slopes"][1:])
    assert numbers["seconds_averaged"][-1] < numbers["seconds_direct"][-1]
    assert numbers["elliptic_ns"]["kernel, lanes"] < numbers["elliptic_ns"]["scipy, vectorised"]


@pytest.mark.slow
def test_kapitza(tmp_path):
    numbers = run("vibrational_kapitza", tmp_path)
    assert numbers["threshold_relative_error"] < 1e-3
    assert max(numbers["open_loop"]) > 0 > max(numbers["closed_loop"])
    assert "src/tilt.c" in numbers["c_package"]


@pytest.mark.slow
def test_examples_have_their_orders(tmp_path):
    numbers = run("vibrational_examples", tmp_path)
    for name in ("cart with pendulum, cart cyclic", "two-link arm, free second joint"):
        first, second = numbers[name]["slopes"]
        assert first == pytest.approx(1, abs=0.15)
        assert second == pytest.approx(2, abs=0.15)


@pytest.mark.slow
def test_dumbbell_tells_what_reproduces(tmp_path):
    numbers = run("vibrational_dumbbell", tmp_path)
    assert max(real for real, _ in numbers["pd_alone_eigenvalues"]) == pytest.approx(-3.64e-4, rel=2e-3)
    averaged = numbers["averaged_as_printed"]
    assert averaged["rho_amplitude_last_tenth"] < averaged["rho_amplitude_first_tenth"]
    assert numbers["actual_as_printed_escapes_at"] < 0.8
    calm = numbers["pd_and_sin_alone"]
    assert 0.75 < calm["rho_amplitude_last_tenth"] / calm["rho_amplitude_first_tenth"] < 0.9
    assert calm["theta_amplitude_last_tenth"] == pytest.approx(0.395, abs=0.02)
    for when in ("first", "last"):
        name = f"rho_amplitude_{when}_tenth"
        assert numbers["pd_and_sin_alone_variational"][name] == pytest.approx(calm[name], rel=0.05)
    corrected = numbers["corrected_design"]
    assert corrected["orbit_damping_with"] > 50 * corrected["orbit_damping_without"]
    assert corrected["rho_amplitude_last_orbit_with"] < 1e-6 < corrected["rho_amplitude_last_orbit_without"]
