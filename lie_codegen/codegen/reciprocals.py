"""Divisions that share their divisor, as products with its reciprocal: on lanes a division costs as much as ten products.

CasADi turns x * (1 / y) into x / y, so no kernel can say this itself. A result changes by a unit in the last place at most;
single calls, which are equal to the interpreter, do not use it.
"""

from __future__ import annotations

from collections import Counter

from lie_codegen.codegen.tape import Statement, Tape


def with_shared_reciprocals(tape: Tape) -> Tape:
    """a / d, b / d as a r, b r with r = 1 / d, and c / sqrt(d) as (c sqrt(d)) r, where that spares a division."""
    roots = {index: s.operands[0] for index, s in enumerate(tape.statements) if s.op == "SQRT"}
    uses = Counter(s.operands[1] for s in tape.statements if s.op == "DIV")
    for root, square in roots.items():
        if square in uses:
            uses[square] += uses[root]
    shared = {divisor for divisor, count in uses.items() if count > 1}
    done: list[Statement] = []
    moved: dict[int, int] = {}
    reciprocals: dict[int, int] = {}

    def add(op: str, *operands: int) -> int:
        done.append(Statement(op, operands))
        return len(done) - 1

    def reciprocal(divisor: int) -> int:
        if divisor not in reciprocals:
            reciprocals[divisor] = add("INV", moved[divisor])
        return reciprocals[divisor]

    for index, statement in enumerate(tape.statements):
        operands = tuple(moved[operand] for operand in statement.operands)
        if statement.op == "DIV" and roots.get(statement.operands[1]) in shared:
            product = add("MUL", *operands)
            moved[index] = add("MUL", product, reciprocal(roots[statement.operands[1]]))
        elif statement.op == "DIV" and statement.operands[1] in shared:
            moved[index] = add("MUL", operands[0], reciprocal(statement.operands[1]))
        else:
            done.append(statement._replace(operands=operands))
            moved[index] = len(done) - 1
    return Tape(tuple(done), tuple(tuple(moved[index] for index in port) for port in tape.outputs))
