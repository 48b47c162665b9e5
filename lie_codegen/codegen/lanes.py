"""Tape -> straight-line C over lanes: one vector of samples a value, masks for conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from lie_codegen.codegen.call_defaults import chosen_results, output_places
from lie_codegen.codegen.lane_forms import CHOICE_FORMS, LANE_FORMS, MASK_FORMS, OF_MASKS, SLOW_FORMS
from lie_codegen.codegen.opcodes import C99, Target
from lie_codegen.codegen.reciprocals import with_shared_reciprocals
from lie_codegen.codegen.skips import Skip, with_skips
from lie_codegen.codegen.split import split
from lie_codegen.codegen.tape import Statement, Tape
from lie_codegen.errors import CodegenError

#: Statements from which a body is a function of its own.
INLINE = 400
#: Statements from which a body is interleaved with its twin only where a vector has fewer than eight lanes. With eight the processor
#: finds enough independent work in one vector of samples, and two run out of registers (measured: 204 and 258 statements gain a sixth
#: and a quarter, 289 lose a tenth). With four the half of the work takes as long: 318 statements gain two fifths.
TWIN = 260
#: Statements a number that is read or written, up to which a loop of its own stores large results past the caches as they are made: beyond,
#: computing takes longer than moving, and the compiler's time for a third copy of the body buys nothing.
MOVING = 10
#: Statements a number that is read or written, between which each sample is a call where results stay in the caches, and the operations in them:
#: with fewer, records are only copied, and with more it is lanes that pay. In between it takes longer to gather and to spread long records, beyond
#: `SHORT` numbers, than to compute (measured, with four and with eight lanes: compose, inverse and Ad of SE_2(3) in .72 to .82 of the time).
LIGHT, SHORT = (0.5, 2.0), 8
_OF_LIGHT = {"INPUT", "CONST", "ADD", "SUB", "MUL", "NEG", "SQ", "TWICE"}


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
class LaneRoutine:
    """A routine that is called on lanes: the type it computes in, its name, its numbers of inputs and outputs."""

    type: str
    name: str
    inputs: int
    outputs: int


@dataclass(frozen=True)
class LanePatch(LaneStatement):
    """Numbers and entries of outputs, then what a routine leaves of them in the lanes where a condition holds.

    Attributes:
        routine: what is called.
        condition: a mask.
        arguments: values.
        chosen: (what is declared or stored, whether it is declared, place among the results, value where nothing is called) each.
        array: the output that all of these are entries of; empty where they are not.
        places: for each result its entry of that output, or -1; empty if they are all of its first, in order.
    """

    routine: LaneRoutine = LaneRoutine("", "", 0, 0)
    condition: str = ""
    arguments: tuple[str, ...] = ()
    chosen: tuple[tuple[str, bool, int, str], ...] = ()
    array: str = ""
    places: tuple[int, ...] = ()

    @property
    def text(self) -> str:
        """As C."""
        given = [f"{f'{self.type} ' * declared}{name} = {value};" for name, declared, _, value in self.chosen]
        inside = [
            f"const lcg_m on = {self.condition};",
            f"const lcg_v from[{self.routine.inputs}] = {{{', '.join(self.arguments)}}};",
        ]
        if not self.array:
            inside += [f"lcg_v to[{self.routine.outputs}];", f"{self.routine.name}_on_lanes(from, &on, to, 0);"]
            inside += [f"{name} = lcg_select(on, to[{entry}], {name});" for name, _, entry, _ in self.chosen]
        elif self.places:
            inside.append(f"static const short at[{len(self.places)}] = {{{', '.join(map(str, self.places))}}};")
            inside.append(f"{self.routine.name}_on_lanes(from, &on, {self.array}, at);")
        else:
            inside.append(f"{self.routine.name}_on_lanes(from, &on, {self.array}, 0);")
        some = f"if (__builtin_expect(lcg_some({self.condition}), 0)) {{"
        return "\n    ".join([*given, some, *(f"    {line}" for line in inside), "}"])


@dataclass(frozen=True)
class LaneBlock:
    """Statements that are skipped where no lane needs them; the choices after them read `results`, zeros then.

    Attributes:
        condition: a mask of the lanes that need them.
        results: names.
        statements: inside.
    """

    condition: str
    results: tuple[str, ...]
    statements: tuple[LaneStatement, ...]

    @property
    def text(self) -> str:
        """As C."""
        return self.beside(self.statements, self.results, f"lcg_some({self.condition})")

    def with_twin(self, twin: LaneBlock) -> str:
        """As C, with the same for other samples."""
        # the processor works on one while the other waits; a block is skipped where neither of the two vectors needs it
        both = [each for pair in zip(self.statements, twin.statements, strict=True) for each in pair]
        some = f"lcg_some((lcg_m)({self.condition} | {twin.condition}))"
        return self.beside(both, (*self.results, *twin.results), some)

    @staticmethod
    def beside(statements: Sequence[LaneStatement], results: Sequence[str], some: str) -> str:
        """Zeros, then the statements where `some`."""
        zeros = ", ".join(f"{name} = lcg_splat(0.0)" for name in results)
        inside = [f"{s.name} = {s.expression};" if s.name in results else s.text for s in statements]
        return "\n    ".join([f"lcg_v {zeros};", f"if ({some}) {{", *(f"    {line}" for line in inside), "}"])


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
        past: whether the twins have a second loop, for results that go past the caches.
        light: whether each sample is a call instead where results stay in the caches; to the last bit the same.
        patches: the routines of its patches.
    """

    statements: tuple[LaneStatement | LaneBlock, ...]
    stores: tuple[LaneStore, ...]
    slow: tuple[str, ...]
    read: frozenset[int]
    parts: tuple[LaneBody, ...] = ()
    work_size: int = 0
    twin: LaneBody | None = None
    past: bool = False
    light: bool = False
    patches: tuple[LaneRoutine, ...] = ()

    @property
    def inline(self) -> bool:
        """Whether the loops hold it, instead of calling it."""
        return self.size < INLINE

    @property
    def crowded(self) -> bool:
        """Whether vectors of eight lanes are better taken one by one."""
        return self.size >= TWIN

    @property
    def size(self) -> int:
        """Number of statements, those in blocks too."""
        return sum(len(s.statements) if isinstance(s, LaneBlock) else 1 for s in self.statements)

    @property
    def together(self) -> list[str]:
        """The statements as C, each followed by its twin; blocks are skipped together."""
        lines: list[str] = []
        if self.twin is None:
            return [each.text for each in self.statements]
        for one, other in zip(self.statements, self.twin.statements, strict=True):
            if isinstance(one, LaneBlock) and isinstance(other, LaneBlock):
                lines.append(one.with_twin(other))
            else:
                lines += [one.text, other.text]
        return lines


def lane_body(tape: Tape, sizes: Sequence[int], target: Target = C99) -> LaneBody:
    """The lane form of a tape with input ports of these sizes; a long one in parts, a short one with its twin.

    The names are those of lanes of doubles, the constants those of the target; `in_floats` rewrites the names.

    Raises:
        CodegenError: an operation has none, not even lane by lane.
    """
    ports = len(sizes)
    tape = with_shared_reciprocals(tape)
    pieces = split(tape, ports)
    if pieces is None:
        body = _body(tape, target)
        if not body.inline:
            return body
        numbers = sum(sizes) + sum(map(len, tape.outputs))
        light = (
            LIGHT[0] < body.size / max(numbers, 1) <= LIGHT[1]
            and max((*sizes, *map(len, tape.outputs)), default=0) > SHORT
            and {s.op for s in tape.statements} <= _OF_LIGHT
        )
        return replace(body, twin=_twin(tape, sizes, target), past=body.size <= MOVING * numbers, light=light)
    parts = []
    for part in pieces.parts:
        body = _body(part.tape, target, ports, [[f"work[{place}]" for place in part.places]])
        moved = [replace(store, entry=part.places[store.entry]) for store in body.stores]
        parts.append(replace(body, stores=tuple(moved)))
    return replace(
        _body(pieces.last, target, ports),
        slow=tuple(sorted({op for part in parts for op in part.slow})),
        read=frozenset().union(*(part.read for part in parts)) - {ports},
        parts=tuple(parts),
        work_size=pieces.size,
    )


def _twin(tape: Tape, sizes: Sequence[int], target: Target) -> LaneBody:
    places = [
        [f"out{port}[{len(each) + entry}]" for entry in range(len(each))] for port, each in enumerate(tape.outputs)
    ]
    emitter = _Emitter(tape, target, -1, places, _Names("s", "q", tuple(sizes)))
    body = _emitted(tape, emitter)
    return replace(
        body, stores=tuple(replace(store, entry=store.entry + len(tape.outputs[store.port])) for store in body.stores)
    )


def _body(tape: Tape, target: Target, work: int = -1, places: Sequence[Sequence[str]] = ()) -> LaneBody:
    """`places`: where each entry of each output is stored, if not in the output."""
    own = [[f"out{port}[{entry}]" for entry in range(len(each))] for port, each in enumerate(tape.outputs)]
    return _emitted(tape, _Emitter(tape, target, work, places or own))


def _emitted(tape: Tape, emitter: _Emitter) -> LaneBody:
    for each in with_skips(tape):
        if isinstance(each, int):
            emitter.emit(each, tape.statements[each])
        else:
            emitter.emit_skip(each, tape)
    return LaneBody(
        statements=tuple(emitter.done),
        stores=tuple(
            LaneStore(port, entry, emitter.number(index))
            for port, entries in enumerate(tape.outputs)
            for entry, index in enumerate(entries)
            if index not in emitter.stored
        ),
        slow=tuple(sorted({s.op for s in tape.statements} & SLOW_FORMS.keys())),
        read=frozenset(s.slot[0] for s in tape.statements if s.op == "INPUT"),
        patches=tuple(each.routine for each in emitter.done if isinstance(each, LanePatch)),
    )


@dataclass(frozen=True)
class _Names:
    """First letters of values and of pairs; what is added to the entries of each input port."""

    value: str = "t"
    pair: str = "p"
    shifts: tuple[int, ...] = ()


class _Emitter:
    """Names of values, as numbers and as masks."""

    def __init__(
        self, tape: Tape, target: Target, work: int, places: Sequence[Sequence[str]], names: _Names = _Names()
    ) -> None:
        self._tape = tape
        self._chosen = chosen_results(tape)
        self.stored: set[int] = set()
        self._target = target
        self._work = work
        self._places = places
        self._names = names
        self.done: list[LaneStatement | LaneBlock] = []
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
            self._numbers[index] = f"lcg_splat({self._target.literal(statement.value)})"
        elif op == "INPUT":
            port, entry = statement.slot
            shift = self._names.shifts[port] if self._names.shifts else 0
            self._add("lcg_v", index, f"work[{entry}]" if port == self._work else f"in{port}[{shift + entry}]")
        elif op in ("SIN", "COS") and operands in self._paired:
            # both of one argument share its reduction: one call gives the pair, whichever is asked for first
            if operands not in self._pairs:
                name = self._pairs[operands] = f"{self._names.pair}{index}"
                self.done.append(LaneStatement("lcg_pair", name, f"lcg_sincos({self.number(operands[0])})"))
            self._numbers[index] = f"{self._pairs[operands]}.{'s' if op == 'SIN' else 'c'}"
        elif op == "CALL":
            self._call(index, statement)
        elif op == "RESULT" and index in self._numbers:
            pass  # named by its call
        elif op == "RESULT":
            self._numbers[index] = f"{self._numbers[operands[0]]}[{statement.slot[0]}]"
        elif op in MASK_FORMS:
            of = self._mask if op in OF_MASKS else self.number
            self._add("lcg_m", index, MASK_FORMS[op].format(*[of(i) for i in operands]))
        elif op in CHOICE_FORMS:
            rest = [self.number(i) for i in operands[1:]]
            self._add("lcg_v", index, CHOICE_FORMS[op].format(self._mask(operands[0]), *rest))
        else:
            form = LANE_FORMS.get(op) or SLOW_FORMS.get(op)
            if form is None:
                raise CodegenError(f"operation {op} has no lane form: write the kernel without it")
            self._add("lcg_v", index, form.format(*[self.number(i) for i in operands]))

    def emit_skip(self, skip: Skip, tape: Tape) -> None:
        """A block; sines and cosines inside are declared inside."""
        before, self.done = self.done, []
        for index in skip.members:
            self.emit(index, tape.statements[index])
        for index in skip.results:
            if "." in self._numbers[index]:  # one of a pair: a name of its own is seen outside
                self._add("lcg_v", index, self._numbers[index])
        inside = tuple(each for each in self.done if isinstance(each, LaneStatement))
        mask = self._mask(skip.condition)
        names = tuple(self._numbers[index] for index in skip.results)
        self.done = [*before, LaneBlock(mask if skip.holds else f"lcg_not({mask})", names, inside)]

    def _call(self, index: int, statement: Statement) -> None:
        """One sample after another; a routine leaves its loops when its own numbers say so."""
        routine = statement.routine
        if routine is None:
            raise CodegenError("a call without a routine")
        name = self._numbers[index] = f"{self._names.value}{index}"
        condition = self._mask(statement.operands[0])
        arguments = tuple(self.number(i) for i in statement.operands[1 : 1 + routine.inputs])
        # A routine without settings for single precision computes in double whatever calls it.
        real = "LCG_ALWAYS_DOUBLE" if routine.single is None else "double"
        if index in self._chosen:
            of = LaneRoutine(real, routine.name, routine.inputs, routine.outputs)
            found = output_places(self._tape, index, self._chosen[index])
            array, places = "", tuple[int, ...]()
            if found is not None:
                name_of, _, first = self._places[found[0]][0].rstrip("]").partition("[")
                array = f"{name_of} + {first}"
                places = () if found[1] == tuple(range(routine.outputs)) else found[1]
            patch = LanePatch("lcg_v", name, "", 0, of, condition, arguments, self._choices(index), array, places)
            self.done.append(patch)
            return
        sizes = f"{routine.inputs}, {routine.outputs}"
        expression = f"LCG_CALL({real}, {routine.name}, {sizes}, {condition}, {name}, {', '.join(arguments)})"
        self.done.append(LaneStatement("lcg_v", name, expression, routine.outputs))

    def _choices(self, call: int) -> tuple[tuple[str, bool, int, str], ...]:
        chosen: list[tuple[str, bool, int, str]] = []
        for each in self._chosen[call]:
            name = self._numbers[each.statement] = f"{self._names.value}{each.statement}"
            default = self.number(each.default)
            if each.is_read:
                chosen.append((name, True, each.entry, default))
            else:
                self.stored.add(each.statement)
                chosen += [(self._places[port][entry], False, each.entry, default) for port, entry in each.outputs]
        return tuple(chosen)

    def _add(self, kind: str, index: int, expression: str) -> None:
        name = f"{self._names.value}{index}"
        self.done.append(LaneStatement(kind, name, expression))
        (self._masks if kind == "lcg_m" else self._numbers)[index] = name
