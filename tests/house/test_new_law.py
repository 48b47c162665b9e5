"""A new law is one file in lie_codegen/control: everything else finds it by what it says of itself."""

from __future__ import annotations

import pickle
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen import control

#: The whole of it, as somebody would add it: a proportional-derivative torque whose pull never exceeds the gain.
LAW = '''
"""A PD law on SO(3) whose stiffness saturates."""

from lie_codegen.control.attitude_ports import ATTITUDE, RATE, attitude_gain, random_rotation
from lie_codegen.groups.maps.rotation_log import rotation_log
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import dot, minus, scaled
from lie_codegen.kernel.parameter import input_ports, sample_inputs, values_of


@kernel_factory(units={"k_p": "N m", "k_d": "N m s/rad"})
def bounded_law(*, k_p=1, k_d=1, name="bounded_law"):
    """torque = -k_p theta / sqrt(1 + |theta|^2) - k_d omega."""
    numbers = (
        attitude_gain(Port("k_p", (), "N m", description="largest pull"), k_p, False),
        attitude_gain(Port("k_d", (), "N m s/rad", description="damping"), k_d, False),
    )

    def body(ops, X, omega, *given):
        p, d = values_of(ops, numbers, given)
        theta = rotation_log(ops, X)
        pull = scaled(-p / ops.sqrt(1 + dot(theta, theta)), theta)
        return (minus(pull, scaled(d, omega)),)

    ports = (ATTITUDE, RATE, *input_ports(numbers))
    sampler = lambda rng: (random_rotation(rng), [rng.uniform(-1, 1) for _ in range(3)], *sample_inputs(numbers, rng))
    formula = "torque = -k_p theta/sqrt(1 + |theta|^2) - k_d omega"
    return Kernel(name, "so3", ports, (Port("torque", (3,), "N m"),), body, formula, sampler=sampler)
'''


@pytest.fixture
def bounded_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The law's function, its file lying in the folder of laws."""
    home = tmp_path / "laws"
    home.mkdir()
    (home / "bounded_law.py").write_text(LAW)
    monkeypatch.setattr(control, "__path__", [*control.__path__, str(home)])
    yield import_module("lie_codegen.control.bounded_law").bounded_law
    sys.modules.pop("lie_codegen.control.bounded_law")


def pulled(X: np.ndarray, omega: np.ndarray, k_p: float, k_d: float) -> np.ndarray:
    """The law by hand, for rotations of less than half a turn."""
    angle = np.arccos((np.trace(X) - 1) / 2)
    theta = angle / (2 * np.sin(angle)) * np.array([X[2, 1] - X[1, 2], X[0, 2] - X[2, 0], X[1, 0] - X[0, 1]])
    return -k_p * theta / np.sqrt(1 + theta @ theta) - k_d * omega


def test_it_compiles_and_is_a_value(bounded_law: Any, tmp_path: Path) -> None:
    law = bounded_law(k_p=3, k_d="1/2")
    assert law == bounded_law(k_p=3, k_d=0.5)
    assert law != bounded_law(k_p=4, k_d=0.5)
    assert hash(law) == hash(bounded_law(k_p=3, k_d="1/2"))
    library = lc.build(law)
    rng = np.random.default_rng(0)
    X = np.asarray(lc.build("so3").exp.batch(rng.uniform(-1, 1, size=(8, 3))))
    omega = rng.normal(size=(8, 3))
    found = library.bounded_law.batch(X, omega)
    expected = [pulled(x, w, 3, 0.5) for x, w in zip(X, omega, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    for value in (law, library, library.bounded_law):
        assert pickle.loads(pickle.dumps(value)) == value
        assert lc.load(value.save(tmp_path / "value.npz")) == value


def test_it_is_generated_with_its_gains_named(bounded_law: Any, tmp_path: Path) -> None:
    package = lc.generate([bounded_law(k_p=7, k_d="input")], tmp_path / "package", name="flight")
    header = "".join(path.read_text() for path in package.rglob("*.h"))
    assert "k_p = 7 [N m]" in header
    assert "k_p = 7 [N m]" in (package / "README.md").read_text()
    assert "torque = -k_p theta/sqrt(1 + |theta|^2) - k_d omega" in header


def test_it_closes_loops_one_and_many(bounded_law: Any, tmp_path: Path) -> None:
    start, t = lc.build("so3").exp([0.9, -0.4, 0.3]), np.linspace(0, 30, 4)
    alone = lc.closed_loop("so3", law=bounded_law(k_p=3, k_d=2), inertia=[1, 2, 3], X0=start, t=t)
    np.testing.assert_allclose(alone.X[-1], np.eye(3), atol=1e-3)
    bodies = np.stack([np.diag([1.0, 2.0, 3.0]), np.diag([2.0, 2.0, 3.0])])
    law = bounded_law(k_p=3, k_d="input")
    many = lc.closed_loop("so3", law=law, inertia=bodies, gains={"k_d": [2.0, 3.0]}, X0=start, t=t)
    np.testing.assert_allclose(many.X[:, 0], alone.X, rtol=0, atol=1e-8)
    assert lc.load(alone.save(tmp_path / "run.npz")) == alone
