"""What the templates see: small frozen records of text and numbers, never live objects."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from lie_codegen.codegen.call_defaults import chosen_results, whole_output
from lie_codegen.codegen.opcodes import C99, RESERVED, Target, in_single
from lie_codegen.codegen.signature import is_step
from lie_codegen.codegen.split import split
from lie_codegen.codegen.tape import Statement, Tape, tape_of
from lie_codegen.codegen.templates import render
from lie_codegen.errors import CodegenError
from lie_codegen.kernel.definition import described
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine

_WIDTH = 108


@dataclass(frozen=True)
class PackageMetadata:
    """What the generated folder says about the group.

    Attributes:
        title: one line; the namespace when empty.
        description: a paragraph: matrices, brackets, what the coordinates mean.
        labels: names of the basis, in the order of every vector.
        units: one a label, or empty.
        conventions: lines of the conventions section.
        version: version of the CMake package.
    """

    title: str = ""
    description: str = ""
    labels: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    conventions: tuple[str, ...] = (
        "Left-invariant: X' = X hat(u), u in the body frame.",
        "Product of exponentials: X = exp(g1 A1) ... exp(gn An), in basis order.",
        "SI units and radians.",
    )
    version: str = "0.1.0"


@dataclass(frozen=True)
class PortView:
    """One argument of a C function."""

    name: str
    parameter: str
    by_value: bool
    is_complex: bool
    size: int
    shape: str
    summary: tuple[str, ...]


@dataclass(frozen=True)
class StatementView:
    """const <type> <name> = <expression>; without a type, which the template chooses: C of double or float, CUDA, OpenCL. A statement over lanes is
    another thing: it knows its type, a mask or numbers, may be skipped, and prints itself beside its twin: `lanes.LaneStatement`.

    A call of a routine leaves an array, of `results` numbers of `type_name`: <expression>(arguments, <name>), where `condition` holds if it
    has one, and where it does not the numbers are zeros. With `defaults` it leaves numbers of its own and entries of arrays: (what is declared or
    stored, whether it is declared, its place among the results, its value where the condition does not hold) each; with `place` these are entries of
    that array, in their order, but for others that are stored later.
    """

    name: str
    expression: str
    arguments: tuple[str, ...] = ()
    results: int = 0
    condition: str = ""
    type_name: str = ""
    defaults: tuple[tuple[str, bool, int, str], ...] = ()
    place: str = ""


@dataclass(frozen=True)
class StoreView:
    """<parameter>[entry] = <value>, by the name of a parameter or of the work; lanes store by the number of a port: `lanes.LaneStore`."""

    parameter: str
    entry: int
    value: str


@dataclass(frozen=True)
class PartView:
    """One of several C functions that share the work of a long kernel."""

    statements: tuple[StatementView, ...]
    stores: tuple[StoreView, ...]
    unused: tuple[str, ...]


@dataclass(frozen=True)
class KernelView:
    """One C function; with `parts` before it if it is long, which fill the array `work` of `work_size` entries."""

    name: str
    symbol: str
    formula: tuple[str, ...]
    source: tuple[str, ...]
    parameters: tuple[str, ...]
    inputs: tuple[PortView, ...]
    outputs: tuple[PortView, ...]
    unused: tuple[str, ...]
    statements: tuple[StatementView, ...]
    stores: tuple[StoreView, ...]
    is_step: bool
    parts: tuple[PartView, ...] = ()
    work: str = ""
    work_size: int = 0


@dataclass(frozen=True)
class RoutineView:
    """A static function with loops: its text, after the kernels that it calls."""

    helpers: tuple[KernelView, ...]
    text: str
    type_name: str
    name: str


@dataclass(frozen=True)
class PackageView:
    """The whole package."""

    namespace: str
    title: str
    description: tuple[str, ...]
    basis: tuple[str, ...]
    conventions: tuple[str, ...]
    version: str
    type_name: str
    kernels: tuple[KernelView, ...]
    routines: tuple[RoutineView, ...] = ()


def package_view(
    namespace: str,
    kernels: Sequence[Kernel],
    tapes: Sequence[Tape],
    metadata: PackageMetadata,
    target: Target = C99,
) -> PackageView:
    """The view of a package: texts made safe for a C comment, statements printed for the target."""
    names = [kernel.name for kernel in kernels]
    units = metadata.units or ("",) * len(metadata.labels)
    basis = tuple(
        _safe(f"{index}: {label}" + (f" [{unit}]" if unit else ""))
        for index, (label, unit) in enumerate(zip(metadata.labels, units, strict=True))
    )
    return PackageView(
        namespace=namespace,
        title=_safe(metadata.title or namespace),
        description=comment_lines(metadata.description),
        basis=basis,
        conventions=tuple(line for text in metadata.conventions for line in comment_lines(text)),
        version=metadata.version,
        type_name=target.type_name,
        kernels=tuple(
            _told_apart(kernel_view(kernel, tape, target, in_parts=True), names)
            for kernel, tape in zip(kernels, tapes, strict=True)
        ),
        routines=_routine_views(routines_of(tapes), target),
    )


def routines_of(tapes: Iterable[Tape]) -> tuple[Routine, ...]:
    """The routines that tapes call, each once."""
    found = (statement.routine for tape in tapes for statement in tape.statements)
    return tuple(dict.fromkeys(routine for routine in found if routine is not None))


def _routine_target(routine: Routine, target: Target) -> Target:
    """Double, whatever the package computes in, unless the routine knows its settings in single precision."""
    return C99 if routine.single is None else target


def _routine_views(routines: Iterable[Routine], target: Target) -> tuple[RoutineView, ...]:
    """The C text of routines and of the kernels they call, each of these once."""
    views: list[RoutineView] = []
    printed, begun = set[str](), set[str]()

    def add(routine: Routine) -> None:
        if routine.name in begun:
            return
        begun.add(routine.name)
        fresh = [kernel for kernel in routine.helpers if kernel.symbol not in printed]
        printed.update(kernel.symbol for kernel in fresh)
        own = _routine_target(routine, target)
        tapes = [tape_of(kernel, own.type_name) for kernel in fresh]
        for inner in routines_of(tapes):
            add(inner)
        helpers = tuple(
            kernel_view(kernel, tape, own, in_parts=True) for kernel, tape in zip(fresh, tapes, strict=True)
        )
        settings = dict(routine.settings)
        if own.type_name == "float":
            settings |= dict(routine.single or ())
        text = render(routine.template, name=routine.name, **settings)
        views.append(
            RoutineView(helpers, in_single(text) if own.type_name == "float" else text, own.type_name, routine.name)
        )

    for routine in routines:
        add(routine)
    return tuple(views)


def _told_apart(view: KernelView, names: Sequence[str]) -> KernelView:
    """A name that two namespaces share gives way to the symbol."""
    return replace(view, name=view.symbol) if names.count(view.name) > 1 else view


def kernel_view(kernel: Kernel, tape: Tape, target: Target = C99, *, in_parts: bool = False) -> KernelView:
    """The view of one kernel; with `in_parts` a long one is cut into functions."""
    parameters = _parameter_names(kernel)
    inputs = tuple(_port_view(port, parameters[port.name], is_input=True) for port in kernel.inputs)
    outputs = tuple(_port_view(port, parameters[port.name], is_input=False) for port in kernel.outputs)
    prefix = _temporary_prefix(parameters.values())
    work = next(name for name in ("w", "work", "w_", "work_", "w__") if name not in parameters.values())
    names = [None if port.by_value else port.parameter for port in inputs]
    scalars = [port.parameter for port in inputs]
    pieces = split(tape, len(inputs)) if in_parts else None
    last, size = (tape, 0) if pieces is None else (pieces.last, pieces.size)
    parts = []
    for part in pieces.parts if pieces is not None else ():
        stores = [[(work, place) for place in part.places]]
        statements, left = _printed(part.tape, [*names, work], [*scalars, work], stores, target, prefix, calls=True)
        parts.append(PartView(statements, left, _unread(inputs, part.tape)))
    stores = [[(port.parameter, entry) for entry in range(port.size)] for port in outputs]
    statements, left = _printed(last, [*names, work], [*scalars, work], stores, target, prefix, calls=in_parts)
    return KernelView(
        name=kernel.name,
        symbol=kernel.symbol,
        formula=comment_lines(kernel.formula),
        source=comment_lines(f"Source: {kernel.source}" if kernel.source else ""),
        parameters=tuple(line for text in described(kernel.definition) for line in comment_lines(text)),
        inputs=inputs,
        outputs=outputs,
        unused=_unread(inputs, tape) if pieces is None else (),
        statements=statements,
        stores=left,
        is_step=is_step(kernel.inputs, kernel.outputs),
        parts=tuple(parts),
        work=work,
        work_size=size,
    )


def _printed(
    tape: Tape,
    arrays: Sequence[str | None],
    scalars: Sequence[str],
    stores: Sequence[Sequence[tuple[str, int]]],
    target: Target,
    prefix: str,
    *,
    calls: bool,
) -> tuple[tuple[StatementView, ...], tuple[StoreView, ...]]:
    """The statements, and the stores after them, of each entry of each output; an input port without an array is a scalar.

    What a call with defaults leaves to outputs alone is stored with it: a value then waits for no branch.
    """
    values: list[str] = []
    statements: list[StatementView] = []
    chosen = chosen_results(tape)
    done: set[int] = set()
    for index, statement in enumerate(tape.statements):
        if statement.op == "CONST":
            values.append(target.literal(statement.value))
            continue
        if statement.op == "INPUT":
            port, entry = statement.slot
            array = arrays[port]
            text = scalars[port] if array is None else target.load.format(array, entry)
        elif statement.op == "CALL":
            if not calls:
                raise CodegenError(
                    "a kernel that calls a routine has no form in this package: it is printed in packages of kernels alone"
                )
            values.append(f"{prefix}{index}")
            defaults: list[tuple[str, bool, int, str]] = []
            for each in chosen.get(index, ()):
                default = values[each.default]
                if each.is_read:
                    defaults.append((f"{prefix}{each.statement}", True, each.entry, default))
                else:
                    done.add(each.statement)
                    places = ["{}[{}]".format(*stores[port][entry]) for port, entry in each.outputs]
                    defaults += [(place, False, each.entry, default) for place in places]
            call = replace(_call(statement, values, target), defaults=tuple(defaults))
            whole = whole_output(tape, index, chosen[index]) if index in chosen else None
            if whole is not None and call.type_name == target.type_name:
                call = replace(call, place=stores[whole][0][0])
            statements.append(call)
            continue
        elif statement.op == "RESULT" and statement.operands[0] in chosen:
            values.append(f"{prefix}{index}")
            continue
        elif statement.op == "RESULT":
            number = f"{values[statement.operands[0]]}[{statement.slot[0]}]"
            routine = tape.statements[statement.operands[0]].routine
            own = target if routine is None else _routine_target(routine, target)
            text = number if target.type_name == own.type_name else f"({target.type_name}){number}"
        else:
            text = target.expression(statement.op, tuple(values[i] for i in statement.operands))
        values.append(f"{prefix}{index}")
        statements.append(StatementView(values[-1], text))
    left = tuple(
        StoreView(*stores[port][entry], values[index])
        for port, entries in enumerate(tape.outputs)
        for entry, index in enumerate(entries)
        if index not in done
    )
    return tuple(statements), left


def _call(statement: Statement, values: Sequence[str], target: Target) -> StatementView:
    routine = statement.routine
    if routine is None:
        raise CodegenError("a call without a routine")
    condition, *arguments = (values[i] for i in statement.operands[: 1 + routine.inputs])
    always = condition.rstrip("f") == C99.literal(1.0)
    type_name = _routine_target(routine, target).type_name
    if type_name != target.type_name:
        arguments = [f"({type_name}){argument}" for argument in arguments]
    condition = "" if always else condition
    return StatementView(values[-1], routine.name, tuple(arguments), routine.outputs, condition, type_name)


def _unread(inputs: Sequence[PortView], tape: Tape) -> tuple[str, ...]:
    read = {statement.slot[0] for statement in tape.statements if statement.op == "INPUT"}
    return tuple(port.parameter for number, port in enumerate(inputs) if number not in read)


def comment_lines(text: str) -> tuple[str, ...]:
    """Text wrapped and made safe inside a C comment, whoever wrote it."""
    lines = [part for line in text.splitlines() for part in (textwrap.wrap(line, _WIDTH) or [""])]
    return tuple(_safe(line) for line in lines)


def _safe(text: str) -> str:
    """No end or start of a comment, no trigraph, no line splice, no control character."""
    text = re.sub(r"[\x00-\x1f\x7f\u0085\u2028\u2029\u202a-\u202e\u2066-\u2069]", " ", text)
    text = re.sub(r"(?<=[*/?])(?=[*/?])", " ", text)
    return text.replace("\\", "\\ ").rstrip()


def _parameter_names(kernel: Kernel) -> dict[str, str]:
    """Port name -> C parameter, renamed where it would hide a function the body may call."""
    names = {port.name for port in kernel.inputs + kernel.outputs}
    parameters = {}
    for port in kernel.inputs + kernel.outputs:
        parameter = port.name
        while parameter in RESERVED or parameter == kernel.symbol or (parameter != port.name and parameter in names):
            parameter = f"{parameter}_"
        parameters[port.name] = parameter
    return parameters


def _temporary_prefix(names: Iterable[str]) -> str:
    """The first of t, t_, t__ ... that no parameter could be mistaken for."""
    names = tuple(names)
    prefix = "t"
    while any(re.fullmatch(re.escape(prefix) + r"[0-9]+", name) for name in names):
        prefix += "_"
    return prefix


def _port_view(port: Port, parameter: str, *, is_input: bool) -> PortView:
    layout = {0: "scalar", 1: "vector", 2: "matrix, row-major"}[len(port.shape)]
    shape = "x".join(str(side) for side in port.shape) or "1"
    parts = [f"({', '.join(map(str, port.shape))}) {layout}" if port.shape else layout]
    if port.is_complex:
        parts.append("complex, each entry as (re, im)")
    if port.units:
        parts.append(f"[{port.units}]")
    text = f"{'in ' if is_input else 'out'} {parameter}: {', '.join(parts)}"
    if port.description:
        text += f"; {port.description}"
    return PortView(
        name=port.name,
        parameter=parameter,
        by_value=is_input and not port.shape and not port.is_complex,
        is_complex=port.is_complex,
        size=port.size,
        shape=shape,
        summary=comment_lines(text),
    )
