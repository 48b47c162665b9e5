"""The Wei-Norman determinant and the margin of the chart as kernels: by them a simulation knows when to restart.

By left invariance X = X_k Phi(g) with g = 0 at t_k is the same solution in a new chart, whatever the time t_k. On a chart that
ends at walls alone the margin is 0 there; where escape is possible it also falls as |M| grows. The edge met is a singular
chart if the determinant falls to 0, and a finite escape if the coordinates grow without bound while it does not.
"""

from __future__ import annotations

from typing import Any

from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.wei_norman import body as wei_norman_body
from lie_codegen.groups.wei_norman.chart_domain import chart_domain
from lie_codegen.groups.wei_norman.matrix import wei_norman
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import expression_body
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.on_demand import sympy as sp


@kernel_factory(group=as_group)
def wei_norman_determinant(group: GroupLike, name: str = "wei_norman_determinant") -> Kernel:
    """g -> det M(g)^{-1}, from its factored form; 1 at g = 0, and the chart ends where it vanishes.

    Args:
        group: object, catalogue name or file.
        name: C identifier.

    Raises:
        UnknownGroupError: no such group.
        IdentifierError: name is no C identifier.
        InputError: the exact determinant is beyond the limit of exact work.
    """
    group = as_group(group)
    wn = wei_norman(group)
    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(Port("g", (group.dim,), description="Wei-Norman coordinates"),),
        outputs=(Port("det", (), description="det M(g)^-1"),),
        body=expression_body([wn.g], [wn.determinant]),
        formula=f"det M(g)^-1 = {wn.determinant}",
        source="Wei and Norman, Proc. AMS 15 (1964) 327",
    )


@kernel_factory(group=as_group)
def chart_margin(group: GroupLike, name: str = "chart_margin") -> Kernel:
    """g -> margin, 1 at g = 0 and 0 at the edge of the chart, by which a simulation decides to restart it.

    Product of the walls, each 1 at g = 0; times sqrt(n) / |M(g)| (Frobenius) where an escape is possible. Constant 1 on a
    global chart. By left invariance a restart is X = X_k Phi(g) with g = 0 at t_k.

    Args:
        group: object, catalogue name or file.
        name: C identifier.

    Raises:
        UnknownGroupError: no such group.
        IdentifierError: name is no C identifier.
        InputError: the exact determinant is beyond the limit of exact work.
    """
    group = as_group(group)
    domain = chart_domain(group)
    wn = wei_norman(group)
    origin = dict.fromkeys(wn.g, 0)
    scaled = sp.Mul(*(wall / wall.subs(origin) for wall in domain.walls))
    walls = expression_body([wn.g], [scaled])

    def body(ops: Arithmetic, g: Any) -> tuple[Any, ...]:
        [margin] = walls(ops, g)
        if domain.end in ("never", "walls"):
            return (ops.constant(1) if domain.end == "never" else margin,)
        entries = [entry for row in wei_norman_body.matrix(ops, wn.data, g) for entry in row]
        total = ops.constant(0)
        for entry in entries:
            total = total + entry * entry
        return (margin * ops.sqrt(ops.constant(group.dim) / total),)

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(Port("g", (group.dim,), description="Wei-Norman coordinates"),),
        outputs=(Port("margin", (), description="1 at g = 0, 0 at the edge of the chart"),),
        body=body,
        formula=f"{scaled}" + ("" if domain.end in ("never", "walls") else " * sqrt(n) / |M(g)|"),
    )
