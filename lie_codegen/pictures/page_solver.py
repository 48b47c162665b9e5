"""The steering solver of a page: the generated C, compiled to WebAssembly, in the page as text."""

from __future__ import annotations

import base64
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.target_functions import compile_folder
from lie_codegen.codegen.wasm import wasm_binary
from lie_codegen.errors import InputError, MissingDependencyError
from lie_codegen.groups.build import library_of
from lie_codegen.groups.generate import generate
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.pictures.scene import motion_of
from lie_codegen.steering.plan import Plan

_POINTS = 201
_MOST_SIZE = 25

_EXPORTS = ("lie_target", "lie_weights", "lie_u", "lie_X", "lie_cost", "lie_solve")

_WRAPPER = """#include "{prefix}.h"
static double target[{size}], weights[{controls}], u[{points} * {controls}], X[{points} * {size}];
static {prefix}_result result;
double *lie_target(void) {{ return target; }}
double *lie_weights(void) {{ return weights; }}
double *lie_u(void) {{ return u; }}
double *lie_X(void) {{ return X; }}
double *lie_cost(void) {{ return &result.cost; }}
int lie_solve(void)
{{
    {prefix}_options options = {prefix}_defaults();
    {prefix}_solve(1, target, weights, &options, &result);
    {prefix}_sample(result.mu0, weights, {points}, u, X);
    return result.status;
}}
"""


def page_solver(plan: Any) -> dict[str, Any]:
    """What the page needs to solve again: the solver in WebAssembly (base64), the basis, the target's logarithm.

    Raises:
        InputError: what is shown is no plan of least energy, or of a group that the page cannot move.
        MissingDependencyError: no ziglang.
        CodegenError: as `lc.generate`. CompileError: the compiler's own words.
    """
    if not isinstance(plan, Plan) or plan.method != "optimal":
        raise InputError('view: solve=True takes a plan of method="optimal"')
    group, kind = plan.group, motion_of(plan.group, np.asarray(plan.target)[None]).kind
    if kind == "point" or group.degree**2 > _MOST_SIZE or (group.is_complex and not _is_su2(group)):
        raise InputError(f"view: the page moves rotations and poses; {group.name} has others")
    if importlib.util.find_spec("ziglang") is None:
        raise MissingDependencyError(
            "view: solve=True compiles with ziglang: install lie_codegen with its extra, lie_codegen[zig]"
        )
    with compile_folder() as folder:
        package = generate(group, folder / "package", steering=plan.controls) / "steering"
        tree = {
            path.relative_to(package).as_posix(): path.read_text(encoding="utf-8") for path in package.rglob("*.[ch]")
        }
    header = next(Path(path) for path in tree if path.startswith("include/"))
    basis = _real(group.basis)
    size = group.degree**2 * (2 if group.is_complex else 1)
    shape = {"prefix": header.stem, "size": size, "controls": len(plan.controls), "points": _POINTS}
    binary = wasm_binary(tree, _WRAPPER.format(**shape), _EXPORTS)
    x = library_of(group).log(np.asarray(plan.target))
    weights = plan.details.get("weights")
    return {
        "kind": "steer",
        "wasm": base64.b64encode(binary).decode(),
        "points": _POINTS,
        "controls": len(plan.controls),
        "duration": plan.duration,
        "weights": np.ones(len(plan.controls)).tolist()
        if weights is None
        else np.asarray(weights, dtype=float).tolist(),
        "complex": group.is_complex,
        "basis": basis.tolist(),
        "labels": list(group.labels),
        "units": list(group.units),
        # coordinates of a matrix of the algebra, by its entries in rows: a dragged target's logarithm
        "vee": np.linalg.pinv(basis.reshape(group.dim, -1).T).tolist(),
        "target": np.asarray(x).tolist(),
        "plane": kind == "plane",
    }


def _is_su2(group: MatrixGroup) -> bool:
    """All of su(2) in its least matrices, whatever the basis: three skew-Hermitian matrices of two rows without trace."""
    A = group.basis
    skew = np.allclose(A, -np.conj(np.swapaxes(A, 1, 2)))
    return group.dim == 3 and group.degree == 2 and skew and np.allclose(np.trace(A, axis1=1, axis2=2), 0)


def _real(A: Array) -> Array:
    """Complex matrices as real ones of twice the rows, an entry a + ib as [[a, -b], [b, a]]; real ones as they are."""
    if not np.iscomplexobj(A):
        return A
    return np.kron(A.real, np.eye(2)) + np.kron(A.imag, np.array([[0.0, -1.0], [1.0, 0.0]]))
