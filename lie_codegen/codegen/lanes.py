"""Tape -> straight-line C over lanes: one vector of samples a value, masks for conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from lie_codegen.codegen.lane_coefficients import HALF_PI, HALF_PI_PARTS, LOG2_PARTS, POLYNOMIALS
from lie_codegen.codegen.lane_networks import networks
from lie_codegen.codegen.opcodes import c_literal
from lie_codegen.codegen.reciprocals import with_shared_reciprocals
from lie_codegen.codegen.split import split
from lie_codegen.codegen.tape import Statement, Tape
from lie_codegen.codegen.templates import render
from lie_codegen.errors import CodegenError

#: Operation -> C expression over vectors {0}, {1}, {2}.
LANE_FORMS: Mapping[str, str] = {
    "ASSIGN": "{0}",
    "LIFT": "{0}",
    "ADD": "{0} + {1}",
    "SUB": "{0} - {1}",
    "MUL": "{0} * {1}",
    "DIV": "{0} / {1}",
    "NEG": "-{0}",
    "INV": "1.0 / {0}",
    "TWICE": "2.0 * {0}",
    "SQ": "{0} * {0}",
    "SQRT": "lcg_sqrt({0})",
    "EXP": "lcg_exp({0})",
    "EXPM1": "lcg_expm1({0})",
    "LOG": "lcg_log({0})",
    "SIN": "lcg_sin({0})",
    "COS": "lcg_cos({0})",
    "TAN": "lcg_tan({0})",
    "ASIN": "lcg_asin({0})",
    "ACOS": "lcg_acos({0})",
    "ATAN": "lcg_atan({0})",
    "ATAN2": "lcg_atan2({0}, {1})",
    "SINH": "lcg_sinh({0})",
    "COSH": "lcg_cosh({0})",
    "TANH": "lcg_tanh({0})",
    "FABS": "lcg_fabs({0})",
    "FLOOR": "lcg_floor({0})",
    "CEIL": "lcg_ceil({0})",
    "COPYSIGN": "lcg_copysign({0}, {1})",
    "FMIN": "lcg_fmin({0}, {1})",
    "FMAX": "lcg_fmax({0}, {1})",
    "SIGN": "lcg_sign({0})",
}
#: Of conditions: the operands of the first four are numbers, of the others conditions; the result is a mask.
MASK_FORMS: Mapping[str, str] = {
    "LT": "lcg_lt({0}, {1})",
    "LE": "lcg_le({0}, {1})",
    "EQ": "lcg_eq({0}, {1})",
    "NE": "lcg_ne({0}, {1})",
    "NOT": "lcg_not({0})",
    "AND": "(lcg_m)({0} & {1})",
    "OR": "(lcg_m)({0} | {1})",
}
#: Statements from which a body is a function of its own.
INLINE = 400
#: Statements from which a body is not interleaved with its twin: the processor then finds enough independent work in one
#: vector of samples, and two run out of registers (measured: 204 and 258 statements gain a sixth and a quarter, 289 lose a tenth).
TWIN = 260
_OF_MASKS = frozenset({"NOT", "AND", "OR"})
#: The first operand is a condition.
CHOICE_FORMS: Mapping[str, str] = {
    "IF_ELSE_ZERO": "lcg_select({0}, {1}, lcg_splat(0.0))",
    "SELECT": "lcg_select({0}, {1}, {2})",
}
#: Without a lane form: libm, one lane after another. The build log says so.
SLOW_FORMS: Mapping[str, str] = {
    "POW": "lcg_each2(pow, {0}, {1})",
    "CONSTPOW": "lcg_each2(pow, {0}, {1})",
    "LOG1P": "lcg_each(log1p, {0})",
    "ASINH": "lcg_each(asinh, {0})",
    "ACOSH": "lcg_each(acosh, {0})",
    "ATANH": "lcg_each(atanh, {0})",
    "ERF": "lcg_each(erf, {0})",
    "HYPOT": "lcg_each2(hypot, {0}, {1})",
    "FMOD": "lcg_each2(fmod, {0}, {1})",
    "REMAINDER": "lcg_each2(remainder, {0}, {1})",
}


@dataclass(frozen=True)
class LaneStatement:
    """const <type> <name> = <expression>; an array of `results` vectors, which a macro fills lane by lane, if there are any."""

    type: str
    name: str
    expression: str
    results: int = 0

    @property
    def text(self) -> str:
        """As C."""
        if not self.results:
            return f"const {self.type} {self.name} = {self.expression};"
        return f"{self.type} {self.name}[{self.results}]; {self.expression};"


@dataclass(frozen=True)
class LaneStore:
    """out<port>[entry] = <value>;"""

    port: int
    entry: int
    value: str


@dataclass(frozen=True)
class LaneBody:
    """One kernel over lanes.

    Attributes:
        slow: operations that run lane by lane, sorted.
        read: the input ports that are read.
        parts: functions before this one if the tape is long; they store in the array `work`, of `work_size` vectors.
        twin: the same for a second vector of samples, to be interleaved with the first; its entries follow those of the
            first in every port. Only for short bodies.
    """

    statements: tuple[LaneStatement, ...]
    stores: tuple[LaneStore, ...]
    slow: tuple[str, ...]
    read: frozenset[int]
    parts: tuple[LaneBody, ...] = ()
    work_size: int = 0
    twin: LaneBody | None = None

    @property
    def inline(self) -> bool:
        """Whether the loops hold it, instead of calling it."""
        return len(self.statements) < INLINE


@dataclass(frozen=True)
class _Polynomial:
    about: str
    coefficients: tuple[str, ...]
    error: str


def lane_body(tape: Tape, sizes: Sequence[int]) -> LaneBody:
    """The lane form of a tape with input ports of these sizes; a long one in parts, a short one with its twin.

    Raises:
        CodegenError: an operation has none, not even lane by lane.
    """
    ports = len(sizes)
    tape = with_shared_reciprocals(tape)
    pieces = split(tape, ports)
    if pieces is None:
        body = _body(tape)
        return replace(body, twin=_twin(tape, sizes)) if len(body.statements) < TWIN else body
    parts = []
    for part in pieces.parts:
        body = _body(part.tape, ports)
        moved = [replace(store, entry=place) for store, place in zip(body.stores, part.places, strict=True)]
        parts.append(replace(body, stores=tuple(moved)))
    return replace(
        _body(pieces.last, ports),
        slow=tuple(sorted({op for part in parts for op in part.slow})),
        read=frozenset().union(*(part.read for part in parts)) - {ports},
        parts=tuple(parts),
        work_size=pieces.size,
    )


def _twin(tape: Tape, sizes: Sequence[int]) -> LaneBody:
    emitter = _Emitter(tape, -1, _Names("s", "q", tuple(sizes)))
    body = _emitted(tape, emitter)
    return replace(
        body, stores=tuple(replace(store, entry=store.entry + len(tape.outputs[store.port])) for store in body.stores)
    )


def _body(tape: Tape, work: int = -1) -> LaneBody:
    return _emitted(tape, _Emitter(tape, work))


def _emitted(tape: Tape, emitter: _Emitter) -> LaneBody:
    for index, statement in enumerate(tape.statements):
        emitter.emit(index, statement)
    return LaneBody(
        statements=tuple(emitter.done),
        stores=tuple(
            LaneStore(port, entry, emitter.number(index))
            for port, entries in enumerate(tape.outputs)
            for entry, index in enumerate(entries)
        ),
        slow=tuple(sorted({s.op for s in tape.statements} & SLOW_FORMS.keys())),
        read=frozenset(s.slot[0] for s in tape.statements if s.op == "INPUT"),
    )


@dataclass(frozen=True)
class _Names:
    """First letters of values and of pairs; what is added to the entries of each input port."""

    value: str = "t"
    pair: str = "p"
    shifts: tuple[int, ...] = ()


class _Emitter:
    """Names of values, as numbers and as masks."""

    def __init__(self, tape: Tape, work: int, names: _Names = _Names()) -> None:
        self._work = work
        self._names = names
        self.done: list[LaneStatement] = []
        self._numbers: dict[int, str] = {}
        self._masks: dict[int, str] = {}
        operands = {op: {s.operands for s in tape.statements if s.op == op} for op in ("SIN", "COS")}
        self._paired = operands["SIN"] & operands["COS"]
        self._pairs: dict[tuple[int, ...], str] = {}

    def number(self, index: int) -> str:
        """The value as a vector of doubles."""
        return self._numbers.get(index) or f"lcg_number({self._masks[index]})"

    def _mask(self, index: int) -> str:
        return self._masks.get(index) or f"lcg_ne({self._numbers[index]}, lcg_splat(0.0))"

    def emit(self, index: int, statement: Statement) -> None:
        op, operands = statement.op, statement.operands
        if op == "CONST":
            self._numbers[index] = f"lcg_splat({c_literal(statement.value)})"
        elif op == "INPUT":
            port, entry = statement.slot
            shift = self._names.shifts[port] if self._names.shifts else 0
            self._add("lcg_v", index, f"work[{entry}]" if port == self._work else f"in{port}[{shift + entry}]")
        elif op in ("SIN", "COS") and operands in self._paired:
            if operands not in self._pairs:
                name = self._pairs[operands] = f"{self._names.pair}{index}"
                self.done.append(LaneStatement("lcg_pair", name, f"lcg_sincos({self.number(operands[0])})"))
            self._numbers[index] = f"{self._pairs[operands]}.{'s' if op == 'SIN' else 'c'}"
        elif op == "CALL":
            self._call(index, statement)
        elif op == "RESULT":
            self._numbers[index] = f"{self._numbers[operands[0]]}[{statement.slot[0]}]"
        elif op in MASK_FORMS:
            of = self._mask if op in _OF_MASKS else self.number
            self._add("lcg_m", index, MASK_FORMS[op].format(*[of(i) for i in operands]))
        elif op in CHOICE_FORMS:
            rest = [self.number(i) for i in operands[1:]]
            self._add("lcg_v", index, CHOICE_FORMS[op].format(self._mask(operands[0]), *rest))
        else:
            form = LANE_FORMS.get(op) or SLOW_FORMS.get(op)
            if form is None:
                raise CodegenError(f"operation {op} has no lane form: write the kernel without it")
            self._add("lcg_v", index, form.format(*[self.number(i) for i in operands]))

    def _call(self, index: int, statement: Statement) -> None:
        """One sample after another; a routine leaves its loops when its own numbers say so."""
        routine = statement.routine
        if routine is None:
            raise CodegenError("a call without a routine")
        name = f"{self._names.value}{index}"
        condition = self._mask(statement.operands[0])
        arguments = ", ".join(self.number(i) for i in statement.operands[1:])
        expression = f"LCG_CALL({routine.name}, {routine.inputs}, {routine.outputs}, {condition}, {name}, {arguments})"
        self.done.append(LaneStatement("lcg_v", name, expression, routine.outputs))
        self._numbers[index] = name

    def _add(self, kind: str, index: int, expression: str) -> None:
        name = f"{self._names.value}{index}"
        self.done.append(LaneStatement(kind, name, expression))
        (self._masks if kind == "lcg_m" else self._numbers)[index] = name


@cache
def lanes_header() -> str:
    """The C header that lane bodies need; the same for all kernels."""
    polynomials = [
        (name, _Polynomial(about, _literals(coefficients), repr(error)))
        for name, (about, coefficients, error) in POLYNOMIALS.items()
    ]
    constants = {
        "two_over_pi": c_literal(2 / np.pi),
        "one_over_log2": c_literal(1 / np.log(2)),
        "half_pi": _literals(HALF_PI),
        "pi": _literals([2 * part for part in HALF_PI]),
        "quarter_pi": _literals([part / 2 for part in HALF_PI]),
        "half_pi_parts": _literals(HALF_PI_PARTS),
        "log2_parts": _literals(LOG2_PARTS),
    }
    return render(
        "lanes.h.jinja", polynomials=polynomials, constants=constants, networks=[networks(n) for n in (8, 4, 2)]
    )


def _literals(values: Sequence[float]) -> tuple[str, ...]:
    return tuple(c_literal(float(value)) for value in values)
