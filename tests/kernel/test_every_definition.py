"""Every public factory of kernels, and every result that has kernels: they have a definition and are values; other numbers, other kernels."""

from __future__ import annotations

import inspect
import json
import pickle
import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.plain_data import made_from

SO3 = {"inertia": (1, 2, 2), "error": "so3_right"}


def circles(size: Any) -> Any:
    return lc.PeriodicInput([f"{size}*cos(t)", "sin(t)", "0"])


def pendulum(length: Any) -> Any:
    return lc.lagrangian_system(
        coordinates=["x"], lagrangian=f"x_dot^2/2 + {length}*cos(x)", forces={"x": "f"}, inputs=["f"]
    )


def two_links(length: Any) -> Any:
    """Two coordinates with a mass matrix that is not constant: formulas that their own text does not give back."""
    kinetic = f"(x_dot^2 + {length}*y_dot^2 + x_dot*y_dot*cos(x - y))/2"
    return lc.lagrangian_system(
        coordinates=["x", "y"], lagrangian=f"{kinetic} + cos(x) + cos(y)", forces={"x": "f"}, inputs=["f"]
    )


def vehicle(mass: Any) -> Any:
    return lc.underwater_vehicle("se3", inertia=[1, 2, 3, 4, 5, 6], weight=mass, current=[0.1, 0, 0])


def pulse(mean: Any) -> Any:
    """Amplitude feedback of a pendulum whose vibration is tilted, so that the amplitude has authority at the equilibrium."""
    system = lc.lagrangian_system(
        coordinates=["x"], lagrangian="x_dot^2/2 - cos(x)", forces={"x": "f*sin(x - 1)"}, inputs=["f"]
    )
    fields = lc.vibrational_fields(system, lc.PeriodicInput([f"({mean} + alpha)*cos(t)"], parameters=["alpha"]))
    return lc.design_feedback(fields, amplitudes=["alpha"], eps=0.01, guess=[1.0, 0.0], poles=[-2.0, -5.0])


def tracking(gain: Any) -> Any:
    return lc.tracking_law("so3", **SO3, gains={"K_p": gain, "K_d": 6})


def free(kind: Callable[..., Any]) -> Callable[[Any], Any]:
    return lambda moment: kind("so3", [1, 2, moment])


def walked(size: Any) -> Any:
    return lc.connection("se2", shape=("r1", "r2"), A=[[f"{size}", "r2"], ["r1", "0"], ["0", "1"]]).kernels()


def mechanical(moment: Any) -> Any:
    system = lc.mechanical_system("so3", inertia=(3, 2, moment), inputs=["w1"])
    return lc.vibrational_average(system, lc.PeriodicInput(["cos(t)"]))


def euler(*formulas: str) -> Any:
    return lc.euler_average(lc.free_rigid_body([1, 2, 3]), list(formulas))


#: public name -> (kernels of a number, two numbers of it)
MADE: dict[str, tuple[Callable[[Any], Any], Sequence[Any]]] = {
    "allocation_kernel": (lambda k: lc.allocation_kernel(lc.allocate(np.eye(3, 4) + k)), (0.1, 0.2)),
    "attitude_law": (lambda k: lc.attitude_law(k_p=k), (1, 2)),
    "averaged_kernels": (lambda k: lc.averaged_kernels(lc.average("so3", circles(k), 2)), ("2", "1/3")),
    "chart_margin": (lc.chart_margin, ("so3", "se2")),
    "commutator_free_step": (lc.commutator_free_step, ("so3", "se2")),
    "compensated": (lambda m: lc.compensated(lc.tracking_law("se3", inertia=1, error="se3_4", gains={"K_1": 1, "K_2": 1, "K_d": 1}), vehicle(m)), (1, 2)),
    "covariance_kernels": (lc.covariance_kernels, ("so3", "se2")),
    "driven_step": (lambda degree: lc.driven_step("so3", degree), (4, 5)),
    "elliptic_kernels": (lc.elliptic_kernels, ("elliptic", "other")),
    "euler_poincare_kernel": (free(lc.euler_poincare_kernel), (2, 3)),
    "feedback_kernels": (lambda mean: lc.feedback_kernels(pulse(mean), "law"), ("3", "4")),
    "flat_reference": (lambda rate: lc.flat_reference([f"{rate}*t", "t", "0"]), (1, 2)),
    "gradient": (lambda k: lc.gradient(tracking(k), "X", output="phi"), (1, 2)),
    "group_kernels": (lc.group_kernels, ("so2", "h3")),
    "hessian": (lambda k: lc.hessian(tracking(k), "xi", output="W"), (1, 2)),
    "integral_law": (lambda k: lc.integral_law("so3", **SO3, gains={"K_p": 4, "K_d": 6, "K_i": k}), (1, 2)),
    "jacobian": (lambda k: lc.jacobian(lc.attitude_law(k_p=k), "X", output="omega"), (1, 2)),
    "lagrangian_kernels": (lambda g: lc.lagrangian_kernels(pendulum(g)), ("1/3", "2")),
    "lagrangian_variational_step": (lambda g: lc.lagrangian_variational_step(pendulum(g)), ("1/3", "2")),
    "manifold_law": (lambda k: lc.manifold_law(lc.manifold(1), phi=f"{k}*(q1 - r1)^2", transport=[["1"]]), (1, 2)),
    "manipulator_law": (lambda k: lc.manipulator_law([["2"]], K_p=k, K_d=1), (1, 2)),
    "pointing_law": (lambda k: lc.pointing_law(k_p=k), (1, 2)),
    "quadrotor_law": (lambda m: lc.quadrotor_law(mass=m, inertia=(1, 2, 2), gains=dict.fromkeys(("k_x", "k_v", "k_R", "k_W"), 3)), (1, 2)),
    "quaternion_law": (lambda k: lc.quaternion_law(inertia=(1, 2, 2), k_p=k, K_d=3), (1, 2)),
    "rkmk4_step": (lc.rkmk4_step, ("so3", "se2")),
    "spatial_momentum_kernel": (free(lc.spatial_momentum_kernel), (2, 3)),
    "sphere_law": (lambda k: lc.sphere_law(k_p=k, k_d=1), (1, 2)),
    "tracking_law": (tracking, (1, 2)),
    "transition_step": (lambda m: lc.transition_step(lc.rkmk4_step("so3", f"step_{m}")), (1, 2)),
    "underwater_kernel": (lambda m: lc.underwater_kernel(vehicle(m)), (1, 2)),
    "variational_step": (free(lc.variational_step), (2, 3)),
    "vibration_feedback": (lambda k: lc.vibration_feedback("so3", (1, 2, 3), ("w1", "w2"), k_p=k), (1, "1/2")),
    "vibrational_kernels": (lambda g: lc.vibrational_kernels(lc.vibrational_fields(pendulum(g), lc.PeriodicInput(["cos(t)"])), "vib"), ("1/3", "2")),
    "vibrational kernels of two links": (lambda m: lc.vibrational_kernels(lc.vibrational_fields(two_links(m), lc.PeriodicInput(["cos(t)"])), "vib"), ("2", "3")),
    "wei_norman_step": (lc.wei_norman_step, ("so3", "se2")),
    "wei_norman_determinant": (lc.wei_norman_determinant, ("so3", "se2")),
    "with_quaternion": (lambda k: lc.with_quaternion(lc.attitude_law(k_p=k), order="scalar_first"), (1, 2)),
    # kernels of results
    "adaptive_law": (lambda k: lc.adaptive_law("so3", error="so3_right", gains={"K_p": k, "K_d": 5}), (1, 2)),
    "hybrid_law": (lambda k: lc.hybrid_law("so3", inertia=[1, 2, 3], K_p=[4, 5, 6], K_d=k), (1, 2)),
    "observer": (lambda k: lc.observer("so3", directions=np.eye(3)[:2], k_p=k), (1, 2)),
    "output_feedback_law": (lambda k: lc.output_feedback_law(directions=[[0, 0, 1]], target_directions=[[0, 0.6, 0.8]], G=k), (1, 2)),
    "connection": (walked, ("2", "1/3")),
    "feedback_average": (lambda k: lc.feedback_average("so3", [f"-{k}*g1", "cos(t)*g2", "0"]).kernel, (1, 2)),
    "free_rigid_body": (lambda m: lc.free_rigid_body([1, 2, m]).kernels(), (3, "5/2")),
    "euler_average": (lambda k: euler(f"-{k}*w1", "-w2", "-w3").kernels(), (1, 2)),
    "euler_average of squares": (lambda k: euler(f"-{k}*w1^3", "-w2", "-w3").kernels(), (1, 2)),
    "tumbling_average": (lambda k: lc.tumbling_average([1, 2, 3], lc.torque.formula([f"-{k}*w1", "0", "0"])).kernels(), (1, 2)),
    "vibrational_average": (lambda g: lc.vibrational_average(pendulum(g), lc.PeriodicInput(["cos(t)"])).kernels(), ("1/3", "2")),
    "mechanical average": (lambda m: mechanical(m).kernels(), (1, "3/2")),
    "loop of a mechanical average": (lambda m: mechanical(m).loop(0.1), (1, "3/2")),
    "phase_average": (lambda k: lc.phase_average([f"-{k}*x1*cos(p)^2"], rate="1", variables=["x1"], phase="p", period="2*pi").kernels(), (1, 2)),
    "time_average": (lambda k: lc.time_average([f"-{k}*x1*cos(t)^2"], variables=["x1"], period="2*pi").kernels(), (1, 2)),
}  # fmt: skip


def several(made: Any) -> tuple[lc.Kernel, ...]:
    return tuple(made) if isinstance(made, list | tuple) else (made,)


@pytest.mark.filterwarnings("ignore::lie_codegen.errors.InertiaWarning", "ignore::lie_codegen.errors.AssumptionWarning")
@pytest.mark.parametrize("name", MADE)
def test_a_kernel_is_what_its_definition_says(name: str, tmp_path: Path) -> None:
    make, (one, other) = MADE[name]
    kernels = several(make(one))
    for kernel, twin, changed in zip(kernels, several(make(one)), several(make(other)), strict=True):
        assert kernel.definition is not None, kernel.name
        assert kernel == twin
        assert hash(kernel) == hash(twin)
        assert kernel != changed
        again = made_from(json.loads(kernel.definition.text))
        assert again == pickle.loads(pickle.dumps(kernel)) == kernel
        assert lc.load(kernel.save(tmp_path / "kernel.npz")) == kernel
    # ... and it computes the same: the first of them that can be evaluated by itself
    first, again = kernels[0], several(made_from(json.loads(kernels[0].definition.text)))[0]  # type: ignore[union-attr]
    point = first.sample(random.Random(1))
    for a, b in zip(first.evaluate(FloatArithmetic(), *point), again.evaluate(FloatArithmetic(), *point), strict=True):
        assert str(a) == str(b)


def test_every_public_factory_of_kernels_is_here() -> None:
    found = []
    for name in dir(lc):
        thing = getattr(lc, name)
        if inspect.isfunction(thing) and "Kernel" in str(inspect.signature(thing).return_annotation):
            found.append(name)
    assert len(found) >= 30
    assert sorted(set(found) - set(MADE)) == ["read_law"]  # reads what the others make
