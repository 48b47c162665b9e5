"""A law that refuses matrices off the group, and its formula alone for where elements are such by construction."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from lie_codegen.groups.maps.guard import nan_off_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.kernel import Body, Kernel


@dataclass(frozen=True, eq=False)
class GuardedBody:
    """The body of a law that is NaN off the group.

    Attributes:
        checked: what the law computes, for anybody who calls it.
        within: the same without the look at the group, a third of a short law's work.
    """

    checked: Body
    within: Body

    def __call__(self, ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        return self.checked(ops, *arguments)


def on_group_alone(law: Kernel, group: MatrixGroup, ports: Iterable[str]) -> Kernel:
    """The law with NaN for all outputs where the matrix of one of the ports is not of the group; see `nan_off_group`."""
    return replace(law, body=GuardedBody(nan_off_group(law, group, ports).body, law.body))


def own_body(law: Kernel) -> Body:
    """The body that its factory gave a law. One from a record of the cache has a method of what makes the law when it is called."""
    made = getattr(getattr(law.body, "__self__", None), "kernel", None)
    return own_body(made) if isinstance(made, Kernel) else law.body


def evaluated_within(law: Kernel, ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
    """What the law gives at elements of the group."""
    body = own_body(law)
    return (body.within if isinstance(body, GuardedBody) else body)(ops, *arguments)
