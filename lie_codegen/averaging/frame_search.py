"""The search for the frame of least motion: Gauss-Newton on a polynomial beta, with exact derivatives by complex steps."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.averaging.shape_form import ShapeForm
from lie_codegen.averaging.shape_frame import ShapeFrame, moved_by, polynomial_with_slopes
from lie_codegen.errors import InputError

_NODES, _STEPS, _SETTLED = 7, 12, 1e-10
_COMPLEX_STEP = 1e-30
Form = TypeVar("Form", bound=ShapeForm)


def best_frame(connection: Form, half_width: float, degree: int, length: float, centre: ArrayLike | None) -> Form:
    """See `ShapeConnection.best_frame`: Gauss-Newton on the coefficients of beta, from zero.

    Raises:
        InputError: sizes that are not positive, a connection that already has a frame.
    """
    if not (half_width > 0 and length > 0) or isinstance(degree, bool) or not isinstance(degree, int) or degree < 0:
        raise InputError("best_frame: half_width and length must be positive, degree a non-negative integer")
    if connection.frame is not None:
        raise InputError("best_frame: this connection has a frame already; start from the one that was given")
    group, k = connection.group, connection.size
    middle = np.zeros(k) if centre is None else np.asarray(centre, dtype=float)
    exponents = np.array([e for e in product(range(degree + 1), repeat=k) if sum(e) <= degree])
    x, w = np.polynomial.legendre.leggauss(_NODES)
    r = middle + half_width * np.array(list(product(x, repeat=k)))
    weights = np.sqrt(np.prod(np.array(list(product(w, repeat=k))), axis=1)) * half_width ** (k / 2)
    # an angle of one radian counts as a motion of `length`; components in metres are divided by it
    scales = np.array([1 / length if unit.split("/")[0] == "m" else 1.0 for unit in group.units])
    A = connection.A(r)

    def residual(coefficients: Array) -> Array:
        beta, slopes = polynomial_with_slopes(exponents, coefficients, (r - middle) / half_width, half_width)
        return np.asarray((weights[:, None, None] * scales[:, None] * moved_by(group, beta, slopes, A)).ravel())

    coefficients = np.zeros((len(exponents), group.dim))
    value = residual(coefficients)
    before = cost = float(value @ value)
    for _ in range(_STEPS):
        jacobian = np.empty((len(value), coefficients.size))
        for j in range(coefficients.size):
            bumped = coefficients.astype(complex)
            bumped.ravel()[j] += 1j * _COMPLEX_STEP
            jacobian[:, j] = residual(bumped).imag / _COMPLEX_STEP
        # abelian directions of beta that change nothing make the Jacobian singular: the shortest step leaves them alone
        step = np.linalg.lstsq(jacobian, -value, rcond=1e-12)[0].reshape(coefficients.shape)
        part = 1.0
        while part > 1e-4:
            trial = residual(coefficients + part * step)
            if float(trial @ trial) < cost:
                break
            part /= 2
        else:
            break
        gain = cost - float(trial @ trial)
        coefficients, value, cost = coefficients + part * step, trial, float(trial @ trial)
        if gain <= _SETTLED * before:
            break
    frame = ShapeFrame(group, middle, float(half_width), exponents, coefficients, before, cost)
    return replace(connection, frame=frame)
