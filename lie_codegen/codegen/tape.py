"""Kernel -> Tape: the straight-line, single-assignment program that templates print.

CasADi keeps a scalar function as a list of instructions over a work vector that is overwritten; here
every value has one name, so that the same program can be printed for scalars or for lanes.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

from lie_codegen.codegen.call_defaults import with_defaults, with_guards
from lie_codegen.codegen.statement import Statement as Statement
from lie_codegen.codegen.statement import Tape as Tape
from lie_codegen.errors import CodegenError
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.routine import Routine


def tape_of(kernel: Kernel, real: str = "double", *, routines: bool = True) -> Tape:
    """The tape of a kernel, for C in `real`; without `routines` NaN where these alone know the value.

    Raises:
        CodegenError: the kernel uses an operation that has no scalar meaning.
    """
    from lie_codegen.kernel.casadi_arithmetic import function_of

    return tape_of_function(function_of(kernel, real, routines=routines))


def tape_of_function(function: Any) -> Tape:
    """The tape of a CasADi SX Function with dense columns, without dead code.

    Raises:
        CodegenError: it is not an SX function, or has a symbol that is no input.
    """
    if not function.is_a("SXFunction"):
        raise CodegenError(f"{function.name()} is not a CasADi SX function: expand it first")
    if function.has_free():
        raise CodegenError(f"{function.name()} depends on symbols that are no inputs: {function.get_free()}")
    statements, outputs = _single_assignment(function)
    statements = _fuse_branches(statements)
    return _schedule(*with_guards(*with_defaults(statements, outputs)))


@cache
def _operation_names() -> dict[int, str]:
    import casadi as ca

    return {getattr(ca, name): name.removeprefix("OP_") for name in dir(ca) if name.startswith("OP_")}


def _single_assignment(function: Any) -> tuple[list[Statement], list[list[int]]]:
    names = _operation_names()
    statements: list[Statement] = []
    known: dict[tuple[Statement, str], int] = {}

    def add(statement: Statement) -> int:
        # repr in the key of a constant, because 0.0 == -0.0 and NaN differs from itself
        key = (statement, repr(statement.value) if statement.op == "CONST" else "")
        place = known.setdefault(key, len(statements))
        if place == len(statements):
            statements.append(statement)
        return place

    zero = Statement("CONST", value=0.0)
    outputs = [[-1] * function.numel_out(i) for i in range(function.n_out())]
    work: dict[int, int] = {}
    identity, inputs_of, outputs_of = function.instruction_id, function.instruction_input, function.instruction_output
    for k in range(function.n_instructions()):
        op, read, written = names[identity(k)], inputs_of(k), outputs_of(k)
        if op == "OUTPUT":
            outputs[written[0]][written[1]] = work[read[0]]
        elif op == "INPUT":
            work[written[0]] = add(Statement("INPUT", slot=(read[0], read[1])))
        elif op == "CONST":
            work[written[0]] = add(Statement("CONST", value=float(function.instruction_constant(k))))
        elif op == "CALL":
            routine = _routine_of(function, statements[work[read[0]]], len(read) - 2, len(written))
            called = add(Statement("CALL", tuple(work[i] for i in read[1:]), routine=routine))
            # All results, whether read or not, so that they follow the call at once: see `split`.
            results = [add(Statement("RESULT", (called,), (entry, 0))) for entry in range(routine.outputs)]
            for place, result in zip(written, results, strict=True):
                if place >= 0:
                    work[place] = result
        else:
            work[written[0]] = add(Statement(op, tuple(work[i] for i in read)))
    return statements, [[add(zero) if index < 0 else index for index in port] for port in outputs]


def _routine_of(function: Any, number: Statement, inputs: int, outputs: int) -> Routine:
    """The routine that a call names by its first argument.

    Raises:
        CodegenError: it is a derivative of one, which CasADi keeps as a function of its own.
    """
    from lie_codegen.kernel.casadi_arithmetic import routine_number

    routine = routine_number(number.value)
    if (inputs, outputs) != (routine.inputs, routine.outputs):
        raise CodegenError(
            f"{function.name()} differentiates {routine.name} by CasADi; differentiate the kernel's body with DualArithmetic instead"
        )
    return routine


def _fuse_branches(statements: list[Statement]) -> list[Statement]:
    """(c ? a : 0) + (!c ? b : 0) becomes c ? a : b; equal but for the sign of a zero."""
    fused = list(statements)
    for index, statement in enumerate(statements):
        if statement.op != "ADD":
            continue
        first, second = (statements[i] for i in statement.operands)
        if first.op != "IF_ELSE_ZERO" or second.op != "IF_ELSE_ZERO":
            continue
        (yes, a), (no, b) = first.operands, second.operands
        if statements[no] == Statement("NOT", (yes,)):
            fused[index] = Statement("SELECT", (yes, a, b))
        elif statements[yes] == Statement("NOT", (no,)):
            fused[index] = Statement("SELECT", (no, b, a))
    return fused


def _schedule(statements: list[Statement], outputs: Iterable[Iterable[int]]) -> Tape:
    """Drop what no output needs, load the inputs first, bring sin x and cos x together."""
    alive = {index for port in outputs for index in port}
    for index in range(len(statements) - 1, -1, -1):
        if index in alive:
            alive.update(statements[index].operands)
    live = [index for index in range(len(statements)) if index in alive]
    partner = {}
    for op, other in (("SIN", "COS"), ("COS", "SIN")):
        by_argument = {statements[i].operands: i for i in live if statements[i].op == other}
        partner.update({i: by_argument.get(statements[i].operands) for i in live if statements[i].op == op})
    loads = sorted((i for i in live if statements[i].op == "INPUT"), key=lambda i: statements[i].slot)
    place: dict[int, int] = {}
    ordered: list[Statement] = []
    for index in loads + live:
        for each in (index, partner.get(index)):
            if each is None or each in place:
                continue
            old = statements[each]
            place[each] = len(ordered)
            ordered.append(old._replace(operands=tuple(place[i] for i in old.operands)))
    return Tape(tuple(ordered), tuple(tuple(place[i] for i in port) for port in outputs))
