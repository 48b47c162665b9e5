"""A commutator-free fourth-order step of X' = X hat(u(t)): two exponentials, no bracket."""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernels.arithmetic import Arithmetic, FloatArithmetic
from lie_codegen.kernels.kernel import Kernel, Port
from lie_codegen.kernels.rkmk import times_taylor_exp
from lie_codegen.kernels.wei_norman_body import WeiNormanData, product_exp


def commutator_free_step(group: MatrixGroup) -> Kernel:
    """One step of X' = X hat(u): (X, u0, um, u1, h) -> X_next, for `scan` and `scan_batch`.

    X_next = X exp(h (u0/4 + um/3 - u1/12)) exp(h (-u0/12 + um/3 + u1/4)); u0, um, u1 are u at t, t + h/2, t + h.
    Exact on the group, global error O(h^4); |h u| <= 1/4 keeps the exponentials exact to rounding. It needs no
    brackets, so it pays where those of `rkmk4_step` are dense.
    """
    n, d = group.dim, group.degree

    def body(ops: Arithmetic, X: Any, u0: Any, um: Any, u1: Any, h: Any) -> tuple[Any, ...]:
        three = list(zip(u0, um, u1, strict=True))
        first = [h / 12 * (3 * a + 4 * m - b) for a, m, b in three]
        second = [h / 12 * (3 * b + 4 * m - a) for a, m, b in three]
        return (times_taylor_exp(group, ops, times_taylor_exp(group, ops, X, first), second),)

    data = WeiNormanData(group)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        X = product_exp(FloatArithmetic(), data, [rng.uniform(-1, 1) for _ in range(n)])
        return (X, *([rng.uniform(-1, 1) for _ in range(n)] for _ in range(3)), rng.uniform(0, 0.1))

    return Kernel(
        name="commutator_free_step",
        namespace=group.name,
        inputs=(
            Port("X", (d, d), is_complex=group.is_complex),
            *(Port(name, (n,)) for name in ("u0", "um", "u1")),
            Port("h", (), "s"),
        ),
        outputs=(Port("X_next", (d, d), is_complex=group.is_complex),),
        body=body,
        formula="X_next = X exp(h (u0/4 + um/3 - u1/12)) exp(h (-u0/12 + um/3 + u1/4))",
        source="Celledoni, Marthinsen and Owren, Future Gener. Comput. Syst. 19 (2003) 341, for u that depends on t alone",
        sampler=sampler,
    )
