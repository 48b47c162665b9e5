"""Relative errors of exp and log with their first two derivatives, of ours and of the neighbours, against 60 digits.

Compared are f, Df u and D^2 f (u, v) along random directions for
    exp of SE(3): x = (w, v) -> the entries of exp(hat(x)), |w| the angle, v of size 1
    exp of SO(3): w -> the entries of exp(hat(w))
    log of SO(3): y -> log(R(q (1, y/2) / |(1, y/2)|)) at y = 0, R the rotation of a unit quaternion q of that angle.
The last takes each library's log from the group itself: no exp of any library is in it, and what a library does off the
group plays no part. An error is the largest among the entries, over the largest entry of the exact answer (over 1 if that is 0; over
max |u_i| max |v_i| if a second derivative is smaller than that, as log's is near the identity, where it vanishes).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from types import MappingProxyType
from typing import Any

import casadi as ca
import mpmath
import numpy as np

from lie_codegen import __version__
from lie_codegen.arrays import Array
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.kernel.casadi_arithmetic import function_of

#: (x, u, v) -> f, Df u, D^2 f (u, v), flat.
Derivatives = Callable[[Array, Array, Array], Sequence[Any]]

FUNCTIONS = ("exp of SE(3)", "exp of SO(3)", "log of SO(3)")
ANGLES = (0.0, *(float(f"{digit}e{power}") for power in range(-8, 0) for digit in (1, 3)), 1.0, 2.0, 3.0)
_DIGITS = 60
_STEP = 15


@dataclass(frozen=True)
class Place:
    """Where a function is differentiated: exp at x; log at y = 0, x being the unit quaternion (w, x, y, z).

    Attributes:
        x: the point.
        directions: pairs (u, v).
        exact: f, Df u and D^2 f (u, v) for each pair.
    """

    x: Array
    directions: tuple[tuple[Array, Array], ...]
    exact: tuple[list[Array], ...]


def place(function: str, angle: float, seed: int = 3) -> Place:
    """A point of that angle, three pairs of directions, and what is exact there."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    dim = 6 if function == "exp of SE(3)" else 3
    rest = rng.normal(size=3)
    if function == "log of SO(3)":
        x = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    else:
        x = np.concatenate([angle * axis, rest])[:dim]
    pairs = rng.normal(size=(3, 2, dim))
    return Place(x, tuple((u, v) for u, v in pairs), tuple(exact_derivatives(function, x, u, v) for u, v in pairs))


def errors(derivatives: Derivatives, at: Place) -> list[float]:
    """Relative errors of f, Df u and D^2 f (u, v), the worst of the directions; NaN where the library gives none."""
    worst = [0.0, 0.0, 0.0]
    for (u, v), exact in zip(at.directions, at.exact, strict=True):
        for order, (a, b) in enumerate(zip(derivatives(at.x, u, v), exact, strict=True)):
            off = np.max(np.abs(np.asarray(a, dtype=float).ravel() - b))
            least = np.max(np.abs(u)) * np.max(np.abs(v)) if order == 2 else 0.0
            error = float(off / (max(np.max(np.abs(b)), least) or 1.0))
            worst[order] = float(np.maximum(worst[order], error))
    return worst


def exact_derivatives(function: str, x: Array, u: Array, v: Array) -> list[Array]:
    """f, Df u, D^2 f (u, v) to 25 digits, rounded: central differences over 60-digit arithmetic."""
    with mpmath.workdps(_DIGITS):
        h = mpmath.mpf(10) ** -_STEP

        def at(a: int, b: int) -> Any:
            step = [h * (a * mpmath.mpf(p) + b * mpmath.mpf(q)) for p, q in zip(u, v, strict=True)]
            return _EXACT[function](x, step)

        centre = at(0, 0)
        slope = [(p - q) / (2 * h) for p, q in zip(at(1, 0), at(-1, 0), strict=True)]
        corners = zip(at(1, 1), at(1, -1), at(-1, 1), at(-1, -1), strict=True)
        curvature = [(p - q - r + s) / (4 * h * h) for p, q, r, s in corners]
        return [np.array([float(entry) for entry in row]) for row in (centre, slope, curvature)]


def _exact_exp(x: Array, step: Sequence[Any]) -> list[Any]:
    w1, w2, w3, *v = [mpmath.mpf(float(a)) + b for a, b in zip(x, step, strict=True)]
    rows = [[0, -w3, w2], [w3, 0, -w1], [-w2, w1, 0]]
    if v:
        rows = [*([*row, entry] for row, entry in zip(rows, v, strict=True)), [0, 0, 0, 0]]
    return list(mpmath.expm(mpmath.matrix(rows), method="taylor"))


def _exact_log(q: Array, y: Sequence[Any]) -> list[Any]:
    a, b, c, d = _turned([mpmath.mpf(float(entry)) for entry in q], y)
    sine = mpmath.sqrt(b * b + c * c + d * d)
    if sine == 0:
        return [mpmath.mpf(0)] * 3
    factor = 2 * mpmath.atan2(sine, a) / sine
    return [factor * b, factor * c, factor * d]


def _turned(q: Sequence[Any], y: Sequence[Any]) -> list[Any]:
    """q (1, y/2), Hamilton's product; w, x, y, z. Not normalised."""
    w, (a, b, c), (p, r, s) = q[0], q[1:], [entry / 2 for entry in y]
    return [w - a * p - b * r - c * s, a + w * p + b * s - c * r, b + w * r + c * p - a * s, c + w * s + a * r - b * p]


_EXACT: Mapping[str, Callable[[Array, Sequence[Any]], list[Any]]] = MappingProxyType(
    {"exp of SE(3)": _exact_exp, "exp of SO(3)": _exact_exp, "log of SO(3)": _exact_log}
)


def ours(function: str) -> Derivatives:
    """Our kernels in the CasADi interpreter, differentiated by CasADi."""
    if function == "log of SO(3)":
        log = function_of(group_kernel(group("so3"), "log"))
        return _by_casadi(lambda q: log(ca.vertcat(*_rotation_entries(ca.vertsplit(q)))), function)
    exp = function_of(group_kernel(group("se3" if "SE" in function else "so3"), "exp"))
    return _by_casadi(exp, function)


def liecasadi(function: str) -> Derivatives:
    """liecasadi's own expressions, differentiated by CasADi.

    Raises:
        ImportError: it is not installed.
    """
    library: Any = import_module("liecasadi")

    def exp_se3(x: Any) -> Any:
        return ca.vec(library.SE3Tangent(ca.vertcat(x[3:], x[:3])).exp().as_matrix().T)

    def exp_so3(w: Any) -> Any:
        return ca.vec(library.SO3Tangent(w).exp().as_matrix().T)

    def log_so3(q: Any) -> Any:
        return library.SO3(xyzw=ca.vertcat(q[1:], q[0])).log().vec

    table = dict(zip(FUNCTIONS, (exp_se3, exp_so3, log_so3), strict=True))
    return _by_casadi(table[function], function)


def jaxlie(function: str) -> Derivatives:
    """jaxlie in double precision, differentiated forward twice by JAX.

    Raises:
        ImportError: it is not installed.
    """
    library: Any = import_module("jaxlie")
    jax: Any = import_module("jax")
    jnp: Any = import_module("jax.numpy")

    def exp_se3(x: Any) -> Any:
        return library.SE3.exp(jnp.concatenate([x[3:], x[:3]])).as_matrix().ravel()

    def exp_so3(w: Any) -> Any:
        return library.SO3.exp(w).as_matrix().ravel()

    def log_so3(q: Any, y: Any) -> Any:
        turned = jnp.stack(_turned(list(q), list(y)))
        return library.SO3(wxyz=turned / jnp.sqrt(jnp.dot(turned, turned))).log()

    table: Mapping[str, Callable[..., Any]] = {FUNCTIONS[0]: exp_se3, FUNCTIONS[1]: exp_so3}

    def all_three(x: Any, u: Any, v: Any) -> Any:
        if function == "log of SO(3)":
            f, place = (lambda y: log_so3(x, y)), jnp.zeros(3)
        else:
            f, place = table[function], x
        value, slope = jax.jvp(f, (place,), (u,))
        return value, slope, jax.jvp(lambda p: jax.jvp(f, (p,), (u,))[1], (place,), (v,))[1]

    compiled = jax.jit(all_three)

    def derivatives(x: Array, u: Array, v: Array) -> Sequence[Any]:
        with jax.enable_x64(True):
            return tuple(np.asarray(part) for part in compiled(x, u, v))

    return derivatives


def installed_version(library: str) -> str:
    """The version of an installed package; our own where it is only a folder."""
    return __version__ if library == "lie_codegen" else version(library)


def _by_casadi(f: Callable[[Any], Any], function: str) -> Derivatives:
    of_quaternion = function == "log of SO(3)"
    dim = 6 if function == "exp of SE(3)" else 3
    u, v = ca.SX.sym("u", dim), ca.SX.sym("v", dim)
    x = ca.SX.sym("x", 4 if of_quaternion else dim)
    place = ca.SX.sym("y", 3) if of_quaternion else x
    if of_quaternion:
        turned = ca.vertcat(*_turned(ca.vertsplit(x), ca.vertsplit(place)))
        value = f(turned / ca.sqrt(ca.dot(turned, turned)))
    else:
        value = f(x)
    slope = ca.jtimes(value, place, u)
    parts = [value, slope, ca.jtimes(slope, place, v)]
    if of_quaternion:
        parts = [ca.substitute(part, place, ca.DM.zeros(3)) for part in parts]
    compiled = ca.Function("derivatives", [x, u, v], [ca.densify(part) for part in parts])
    return lambda x, u, v: [np.array(part).ravel() for part in compiled(x, u, v)]


def _rotation_entries(q: Sequence[Any]) -> list[Any]:
    """R(q) of a unit quaternion, row by row."""
    w, x, y, z = q
    return [
        w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z,
    ]  # fmt: skip
