"""A commutator-free fourth-order step of X' = X hat(u(t)): two exponentials, no bracket."""

from __future__ import annotations

from typing import Any

from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.rkmk import flow_step, times_taylor_exp
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.runge_kutta import COMMUTATOR_FREE, combined, vectors


@kernel_factory(group=as_group)
def commutator_free_step(group: GroupLike, name: str = "commutator_free_step") -> Kernel:
    """One step of X' = X hat(u): (X, u0, um, u1, h) -> X_next, for `scan` and `scan_batch`.

    X_next = X exp(h (u0/4 + um/3 - u1/12)) exp(h (-u0/12 + um/3 + u1/4)); u0, um, u1 are u at t, t + h/2, t + h.
    Exact on the group, global error O(h^4); |h u| <= 1/4 keeps the exponentials exact to rounding. It needs no
    brackets, so it pays where those of `rkmk4_step` are dense.

    Args:
        group: object, catalogue name or file.
        name: C identifier.

    Raises:
        UnknownGroupError: no such group.
        IdentifierError: name is no C identifier.
    """

    group = as_group(group, "commutator_free_step")

    def body(ops: Arithmetic, X: Any, u0: Any, um: Any, u1: Any, h: Any) -> tuple[Any, ...]:
        for weights in COMMUTATOR_FREE:
            X = times_taylor_exp(group, ops, X, combined(vectors(ops), weights, (u0, um, u1), h))
        return (X,)

    formula = "X_next = X exp(h (u0/4 + um/3 - u1/12)) exp(h (-u0/12 + um/3 + u1/4))"
    source = "Celledoni, Marthinsen and Owren, Future Gener. Comput. Syst. 19 (2003) 341, for u that depends on t alone"
    return flow_step(group, name, body, formula, source)
