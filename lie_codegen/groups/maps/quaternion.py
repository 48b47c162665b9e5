"""Laws that take a unit quaternion in place of a rotation matrix; the order of its entries is always named.

R(q) with q = q_0 + q_v Hamilton's: R = 1 + 2 q_0 q_v^ + 2 (q_v^)^2, so that R(q r) = R(q) R(r); q and -q are the
same attitude and give the same command: there is no unwinding. Geyer prints the transpose of this matrix, for which
R(q r) = R(r) R(q).
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix

#: Orders of the entries by name.
ORDERS = {"scalar_first": (0, 1, 2, 3), "scalar_last": (3, 0, 1, 2)}


def quaternion_order(order: str | None) -> tuple[int, ...]:
    """Positions of (q_0, q_1, q_2, q_3).

    Raises:
        InputError: the order is not given or not known.
    """
    order = {"wxyz": "scalar_first", "xyzw": "scalar_last"}.get(order, order) if order is not None else None
    if order is None or order not in ORDERS:
        given = "not given" if order is None else f"{order!r}"
        raise InputError(
            f"the quaternion order is {given}; name it: order='scalar_first' (w, x, y, z) or 'scalar_last' (x, y, z, w)"
        )
    return ORDERS[order]


def rotation_entries(q: Sequence[Scalar], places: Sequence[int]) -> Matrix:
    """R(q), divided by |q|^2 so that a slightly unnormalised quaternion gives a rotation all the same."""
    a, b, c, d = (q[k] for k in places)
    scale = 2 / (a * a + b * b + c * c + d * d)
    return [
        [1 - scale * (c * c + d * d), scale * (b * c - a * d), scale * (b * d + a * c)],
        [scale * (b * c + a * d), 1 - scale * (b * b + d * d), scale * (c * d - a * b)],
        [scale * (b * d - a * c), scale * (c * d + a * b), 1 - scale * (b * b + c * c)],
    ]


@kernel_factory()
def with_quaternion(law: Kernel, *, order: str | None = None, name: str | None = None) -> Kernel:
    """The same law with its (3, 3) inputs X and X_d as unit quaternions q and q_d.

    Args:
        law: an attitude law or a tracking law on SO(3).
        order: "scalar_first" ("wxyz") or "scalar_last" ("xyzw").
        name: C identifier; the law's own if None.

    Raises:
        InputError: the order is not given.
        ShapeError: the law has no (3, 3) input X.
    """
    places = quaternion_order(order)
    rotations = [number for number, port in enumerate(law.inputs) if port.shape == (3, 3) and port.name in ("X", "X_d")]
    if not rotations:
        raise ShapeError(
            f"{law.name} has no rotation among its inputs: it takes {', '.join(p.name for p in law.inputs)}"
        )

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        turned = [rotation_entries(a, places) if k in rotations else a for k, a in enumerate(arguments)]
        return law.evaluate(ops, *turned)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        values = list(law.sample(rng))
        for k in rotations:
            values[k] = _unit(rng)
        return tuple(values)

    words = "(w, x, y, z)" if places == ORDERS["scalar_first"] else "(x, y, z, w)"
    ports = tuple(
        Port({"X": "q", "X_d": "q_d"}[port.name], (4,), "", description=f"{port.description}; unit quaternion {words}")
        if k in rotations
        else port
        for k, port in enumerate(law.inputs)
    )
    return replace(
        law,
        name=name or law.name,
        inputs=ports,
        body=body,
        sampler=sampler,
        formula=f"{law.formula}; attitude as a quaternion {words}",
    )


def _unit(rng: random.Random) -> list[float]:
    q = np.array([rng.gauss(0, 1) for _ in range(4)])
    return [float(x) for x in q / np.linalg.norm(q)]
