"""Which work on lanes is skipped: the order of evaluation that `with_skips` gives, for toys and for the kernels of groups."""

from __future__ import annotations

from typing import Any

import pytest
from operation_kernels import every_operation, mixed, sided, sizes

import lie_codegen as lc
from lie_codegen.codegen.reciprocals import with_shared_reciprocals
from lie_codegen.codegen.skips import Skip, with_skips
from lie_codegen.codegen.tape import Tape, tape_of
from lie_codegen.kernel.kernel import Kernel, Port


def check(tape: Tape) -> list[Skip]:
    """Every statement once, after its operands; what a block holds is read by choices of its own side alone."""
    order = with_skips(tape)
    skips = [each for each in order if isinstance(each, Skip)]
    home = {index: skip for skip in skips for index in skip.members}
    done: set[int] = set()
    for each in order:
        for index in each.members if isinstance(each, Skip) else (each,):
            assert index not in done
            assert done.issuperset(tape.statements[index].operands)
            done.add(index)
        if isinstance(each, Skip):
            assert each.condition in done - set(each.members)
    assert done == set(range(len(tape.statements)))
    for index, statement in enumerate(tape.statements):
        for place, operand in enumerate(statement.operands):
            skip = home.get(operand)
            if skip is None or home.get(index) is skip:
                continue
            assert operand in skip.results
            assert statement.operands[0] == skip.condition
            assert (statement.op, place) in ({("SELECT", 1), ("IF_ELSE_ZERO", 1)} if skip.holds else {("SELECT", 2)})
    assert not home.keys() & {index for port in tape.outputs for index in port}
    return skips


@pytest.mark.parametrize("group", ["so3", "se3", "su2", "sim3", "so4"])
def test_blocks_of_the_kernels_of_groups_can_be_left_out(group: str) -> None:
    skips = {k.name: check(with_shared_reciprocals(tape_of(k))) for k in lc.group_kernels(group)}
    if group not in ("so4", "sim3"):
        assert (
            len(skips["exp"]) == 1
        )  # root, sine, cosine and division of the closed form, needed away from the identity
        assert not skips["exp"][0].holds


def test_blocks_of_toys() -> None:
    for kernel in (every_operation(), mixed(), sizes()):
        check(tape_of(kernel))
    assert [skip.holds for skip in check(tape_of(sided()))] == [False, True]


def test_sides_that_need_each_other_are_computed() -> None:
    """The second use of one condition hangs on a choice that hangs on the first: the two cannot be skipped together."""

    def body(ops: Any, x: Any) -> tuple[Any, ...]:
        first, second = ops.less(x[0], 0), ops.less(x[1], 0)
        a = ops.sqrt(ops.sin(x[0]) + 2) / (3 + x[0])
        b = ops.sqrt(ops.cos(x[1]) + 2) / (3 + x[1])
        from_a = ops.where(first, a, 1)
        from_b = ops.where(second, b * from_a, 1)
        again = ops.where(first, ops.sqrt(2 + ops.sin(from_b)) / (2 + from_b), 2)
        return ([from_b, again],)

    assert not check(tape_of(Kernel("crossed", "toy", (Port("x", (2,)),), (Port("z", (2,)),), body)))
