"""A branch that is hardly ever taken costs a test: choices between values and the results of a call become its defaults."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.codegen.call_defaults import chosen_results, output_places, whole_output
from lie_codegen.codegen.tape import tape_of
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, call_routine


def test_the_exponential_stores_its_values_and_then_looks_whether_they_are_near() -> None:
    tape = tape_of(group_kernel(lc.group("so4"), "exp"))
    assert not [s for s in tape.statements if s.op in ("SELECT", "IF_ELSE_ZERO")]
    [(call, chosen)] = chosen_results(tape).items()
    assert whole_output(tape, call, chosen) == 0
    assert output_places(tape, call, chosen) == (0, tuple(range(16)))
    # Sim(3): the last row is constant, and stored after the call.
    tape = tape_of(group_kernel(lc.group("sim3"), "exp"))
    [(call, chosen)] = chosen_results(tape).items()
    assert whole_output(tape, call, chosen) == 0
    places = output_places(tape, call, chosen)
    assert places is not None
    assert sorted(set(range(16)) - set(places[1])) == [12, 13, 14]


def test_derivatives_have_their_guard_among_the_defaults() -> None:
    tape = tape_of(lc.jacobian(group_kernel(lc.group("so4"), "exp"), "x"))
    calls = [(index, s) for index, s in enumerate(tape.statements) if s.op == "CALL"]
    outputs = {index for port in tape.outputs for index in port}
    rates = [index for index, s in calls if s.routine is not None and s.routine.name.endswith("_rate")]
    assert len(rates) == 6
    for index in rates:
        assert tape.statements[tape.statements[index].operands[0]].op == "AND"
        results = [k for k, s in enumerate(tape.statements) if s.op == "RESULT" and s.operands == (index,)]
        assert set(results) <= outputs


def doubled(read: str) -> Kernel:
    """y = x, or 2 x where x > 1 by a routine, and what is read of it."""

    def tangent(ops: Arithmetic, inputs: Any, outputs: Any, rates: Any) -> list[Scalar]:
        return [2 * rate for rate in rates]

    routine = Routine("twice", 1, 1, "far_routine.c.jinja", (("settings", read),), (), lambda x: [2 * x[0]], tangent)

    def body(ops: Arithmetic, x: Any) -> tuple[Any, ...]:
        near = ops.less(x[0], 1)
        [far] = call_routine(ops, routine, x, ops.where(near, 0, 1))
        y = ops.where(near, x[0], far)
        if read == "both":
            return ([y, far],)
        if read == "guarded by itself":
            return ([ops.where(ops.less(y, 3), y, ops.constant(math.nan)), x[0]],)
        return ([y, 3 * y],)

    return Kernel("doubled", "test", (Port("x", (1,)),), (Port("y", (2,)),), body)


@pytest.mark.parametrize(("read", "fused"), [("both", False), ("guarded by itself", True), ("again", True)])
def test_what_is_read_otherwise_stays_as_it_is(read: str, fused: bool) -> None:
    kernel = doubled(read)
    tape = tape_of(kernel)
    assert bool(chosen_results(tape)) == fused
    # Every statement after its operands, and the numbers of the plain meaning.
    assert all(i < index for index, s in enumerate(tape.statements) for i in s.operands)
    for x in (0.5, 1.25, 2.0):
        values: list[float] = []
        for s in tape.statements:
            a = [values[i] for i in s.operands]
            values.append(
                {
                    "INPUT": lambda x=x: x,
                    "CONST": lambda s=s: s.value,
                    "LT": lambda a=a: float(a[0] < a[1]),
                    "NOT": lambda a=a: float(not a[0]),
                    "SELECT": lambda a=a: a[1] if a[0] else a[2],
                    "IF_ELSE_ZERO": lambda a=a: a[1] if a[0] else 0.0,
                    "CALL": lambda a=a: 2 * a[1] if a[0] else (a[2] if len(a) > 2 else 0.0),
                    "RESULT": lambda a=a: a[0],
                    "MUL": lambda a=a: a[0] * a[1],
                    "ADD": lambda a=a: a[0] + a[1],
                }[s.op]()
            )
        expected = [x, 0.0] if x < 1 else [2 * x, 2 * x]
        if read == "guarded by itself":
            expected = [expected[0] if expected[0] < 3 else math.nan, x]
        elif read == "again":
            expected = [expected[0], 3 * expected[0]]
        np.testing.assert_array_equal([values[i] for i in tape.outputs[0]], expected)
