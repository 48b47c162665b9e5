"""The C of a transcription says what CasADi says of the same program written out as one expression: f, g, and both derivatives.

Second derivatives of intervals keep leading terms alone, those of conditions are exact. The last stage counts: it has no interval,
and conditions with second derivatives of their own where the goal is a set (they were written behind the end of the array).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.steering.transcription.problem import _symbolic
from lie_codegen.steering.transcription.source import compiled
from lie_codegen.steering.transcription.structure import Structure

pytestmark = pytest.mark.skipif(not find_compilers(), reason="no C compiler")

SHAPES: dict[str, dict[str, Any]] = {
    "an element": {},
    "an element in least time": {"free_time": True},
    "a coset": {"free": 1},
    "a coset among balls": {"free": 1, "balls": 2},
    "a coset in least time among balls": {"free": 1, "balls": 1, "free_time": True},
    "a coset on the way of torques": {"free": 1, "second_order": True},
    "a guarded element by way of another": {"guarded": True, "via": (2,)},
}


def of_library(structure: Structure, solver: str) -> dict[str, Any]:
    library = str(compiled(structure, solver))
    return {name: ca.external(name, library) for name in ("nlp_f", "nlp_g", "nlp_jac_g", "nlp_hess_l")}


def point(structure: Structure, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Variables and parameters whose elements lie on the group: the derivatives are along it."""
    x = rng.uniform(0.2, 0.6, structure.variables)
    p = rng.uniform(0.2, 0.6, structure.parameters)
    element = structure.size
    for k in range(structure.intervals + 1):
        x[k * structure.width :][:element] = packed(structure, rng)
    p[:element] = packed(structure, rng)
    first, last = structure.parameter_ranges["via"]
    for start in range(first, last, element):
        p[start : start + element] = packed(structure, rng)
    return x, p


def packed(structure: Structure, rng: np.random.Generator) -> np.ndarray:
    group = structure.group
    return expm(group.hat(rng.uniform(-0.8, 0.8, group.dim))).ravel()[list(structure.positions)]


@pytest.mark.parametrize("solver", ["ipopt", "fatrop"])
@pytest.mark.parametrize(("group", "controls"), [("se2", (0, 1)), ("so3", (0, 1, 2))])
@pytest.mark.parametrize("shape", SHAPES)
def test_values_and_derivatives_are_those_of_the_whole_expression(
    shape: str, group: str, controls: tuple[int, ...], solver: str
) -> None:
    if group == "so3" and "balls" in shape:
        pytest.skip("no positions to keep clear")
    structure = Structure(lc.group(group), controls, intervals=4, **SHAPES[shape])
    library, whole = of_library(structure, solver), _symbolic(structure)
    multipliers, factor = ca.MX.sym("l", whole["g"].numel()), ca.MX.sym("s")
    lagrangian = factor * whole["f"] + ca.dot(multipliers, whole["g"])
    curvature = ca.hessian(lagrangian, whole["x"])[0]
    truth = ca.Function(
        "truth",
        [whole["x"], whole["p"], factor, multipliers],
        [whole["f"], whole["g"], ca.jacobian(whole["g"], whole["x"]), curvature],
    )
    rng = np.random.default_rng(7)
    for _ in range(3):
        x, p = point(structure, rng)
        weights = rng.normal(size=whole["g"].numel())
        f, g, slopes, curve = (each.full() for each in truth(x, p, 0.7, weights))
        assert np.allclose(library["nlp_f"](x, p).full(), f, rtol=1e-12, atol=1e-12)
        assert np.allclose(library["nlp_g"](x, p).full(), g, rtol=1e-11, atol=1e-11)
        assert np.allclose(library["nlp_jac_g"](x, p)[1].full(), slopes, rtol=1e-6, atol=1e-6)
        found = library["nlp_hess_l"](x, p, 0.7, weights)
        found = (found[1] if solver == "fatrop" else ca.triu2symm(found)).full()
        last = slice(structure.intervals * structure.width, None)
        assert np.allclose(found[last, last], curve[last, last], rtol=1e-9, atol=1e-9)
        if not structure.second_order:  # torques: the midpoint rule's, which is not near at four intervals
            assert np.allclose(found, curve, atol=1e-2 * np.abs(curve).max())
