"""lc.point_mass_connection: a rigid body in which point masses are moved, at zero momentum; section 6.2 of TR 93-59 for several masses.

With y_a the places of the masses from the body's own centre of mass, in body axes, s = sum m_a y_a and M the total mass, the kinetic energy
at zero linear momentum is the quadratic form of (w, y') with

    M_11 = I_0 + sum m_a (|y_a|^2 1 - y_a y_a^T) - (|s|^2 1 - s s^T)/M,    M_12 = m_a (hat(y_a) - hat(s)/M) for each a,    (71), (72)

which for one mass is I_0 + alpha_m (|y|^2 1 - y y^T) and alpha_m hat(y). On SE(3) and SE(2) the body's own place is kept too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.averaging.shape_connection import ShapeConnection, connection
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.actuators import positive_inertia
from lie_codegen.mechanics.body_frame import body_frame
from lie_codegen.on_demand import sympy as sp


def point_mass_connection(group: GroupLike, *, body_mass: Any, masses: Sequence[Any], inertia: Any) -> ShapeConnection:
    """The connection of a body with point masses that move inside it, at zero momentum: averages, displacement, curvature, C.

    Args:
        group: rotations of space in any basis, SU(2), se3 or se2 with the labels of the catalogue.
        body_mass: m_0. [kg]
        masses: (q,) the point masses. [kg]
        inertia: (3,) or (3, 3) of the body alone about its centre of mass; on se2 a number. [kg m^2]

    Returns:
        shapes y1_1, y1_2, y1_3, y2_1, ..: the places of the masses in body axes (two components each on se2).

    Raises:
        InputError: another group, a mass that is not positive, an inertia that is not positive definite.
        ShapeError: an inertia of another shape.
    """
    group = as_group(group, "point_mass_connection")
    if isinstance(masses, str) or not isinstance(masses, Sequence) or not masses:
        raise InputError("point_mass_connection: masses is a sequence of at least one mass")
    m0, *m = (_positive(value) for value in (body_mass, *masses))
    planar = group.labels == ("omega", "vx", "vy") and group.degree == 3
    rigid = group.labels == ("w1", "w2", "w3", "v1", "v2", "v3") and group.degree == 4
    axes = 2 if planar else 3
    names = [f"y{a + 1}_{i + 1}" for a in range(len(m)) for i in range(axes)]
    symbols = [sp.Symbol(name, real=True) for name in names]
    places = [sp.Matrix([*symbols[axes * a : axes * (a + 1)], *([0] * (3 - axes))]) for a in range(len(m))]
    if planar:
        if isinstance(inertia, list | tuple):
            raise ShapeError("point_mass_connection: on se2 the inertia is a number")
        full = _rigid_form(m0, m, places, sp.diag(1, 1, _positive(inertia)))
        kept = [2, 3, 4, *(6 + 3 * a + i for a in range(len(m)) for i in range(2))]
        form = full.extract(kept, kept)
    else:
        full = _rigid_form(m0, m, places, sp.Matrix(positive_inertia(inertia, "point_mass_connection: inertia")))
        form = full if rigid else _reduced(full, group)
    return connection(group, shape=names, metric=form.applyfunc(sp.expand).tolist())


def _positive(value: Any) -> sp.Expr:
    number = exact_number(repr(value) if isinstance(value, float) else value)
    if not number > 0:
        raise InputError(f"point_mass_connection: {number} must be positive")
    return number


def _hat(v: sp.Matrix) -> sp.Matrix:
    return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _rigid_form(m0: sp.Expr, m: Sequence[sp.Expr], places: Sequence[sp.Matrix], inertia: sp.Matrix) -> sp.Matrix:
    """The kinetic energy as a form of (w, v, y_1', .., y_q'): the sum of m |v + w x y + y'|^2 over body and masses."""
    size = 6 + 3 * len(m)
    form = sp.zeros(size, size)
    form[:3, :3] = inertia
    form[3:6, 3:6] = m0 * sp.eye(3)
    for a, (mass, y) in enumerate(zip(m, places, strict=True)):
        velocity = sp.zeros(3, size)
        velocity[:, :3], velocity[:, 3:6] = -_hat(y), sp.eye(3)
        velocity[:, 6 + 3 * a : 9 + 3 * a] = sp.eye(3)
        form += mass * velocity.T * velocity
    return form


def _reduced(form: sp.Matrix, group: MatrixGroup) -> sp.Matrix:
    """Of (w, y') alone in the group's basis: the velocity that makes the linear momentum zero is put in, a Schur complement."""
    kept = [0, 1, 2, *range(6, form.rows)]
    place = [3, 4, 5]
    total = form[3, 3]
    rest = form.extract(kept, kept) - form.extract(kept, place) * form.extract(place, kept) / total
    frame = sp.diag(sp.Matrix(body_frame(group, "point_mass_connection")), sp.eye(len(kept) - 3))
    reduced: sp.Matrix = frame.T * rest * frame
    return reduced
