"""Calls that hardly ever run: what their results are where they do not, so that a branch which is not taken costs a test and not a choice a number.

where(near, value, call(.., not near))    becomes a call whose result is `value` by default,
where(finite, that, NaN)                  becomes its default where(finite, value, NaN), and it runs where `finite` holds too.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass

from lie_codegen.codegen.statement import Statement, Tape


def with_defaults(statements: list[Statement], outputs: list[list[int]]) -> tuple[list[Statement], list[list[int]]]:
    """Where a call runs only unless a condition holds, the choices by that condition between values and its results become its defaults.

    Then a branch that is hardly ever taken costs a test, and not a choice a number.
    """
    same = list(range(len(statements)))
    for index, statement in enumerate(statements):
        if statement.op == "IF_ELSE_ZERO":
            condition, value = statement.operands[0], same[statement.operands[1]]
            if statements[value].op == "RESULT" and _condition(statements, value) == condition:
                same[index] = value  # zero already where the call is not run
    read = [[same[i] for i in each.operands] for each in statements]
    stored = {same[i] for port in outputs for i in port}
    users: dict[int, list[int]] = {index: [] for index in stored}
    for user in reversed(range(len(statements))):
        for i in dict.fromkeys(read[user]) if user in users else ():
            users.setdefault(i, []).append(user)
    choices: dict[int, dict[int, int]] = {}
    plain: set[int] = set()  # calls with a result that is read as it is
    for index, statement in enumerate(statements):
        if statement.op != "RESULT" or index not in users:
            continue
        call = statement.operands[0]
        user, *others = users[index] or [index]
        near, _, other = read[user] if statements[user].op == "SELECT" else (-1, -1, -1)
        if others or index in stored or other != index or _negated(statements, _condition(statements, index), near) < 0:
            plain.add(call)
        else:
            choices.setdefault(call, {})[statement.slot[0]] = user
    zero = len(statements)
    same.append(zero)
    changed = [*statements, Statement("CONST", value=0.0)]
    calls = {call: found for call, found in choices.items() if call not in plain}
    for call, found in calls.items():
        routine = statements[call].routine
        entries = range(routine.outputs if routine is not None else 0)
        near = read[next(iter(found.values()))][0]
        read[call][0] = _negated(statements, read[call][0], near)  # as a condition, not as a number
        read[call] += [read[found[entry]][1] if entry in found else zero for entry in entries]
    for index, statement in enumerate(statements):
        if statement.op == "RESULT" and statement.operands[0] in calls:
            same[calls[statement.operands[0]].get(statement.slot[0], index)] = index
    changed = [
        each._replace(operands=tuple(same[i] for i in now)) for each, now in zip(changed, [*read, []], strict=True)
    ]
    ordered = _reordered(changed, [[same[i] for i in port] for port in outputs], calls) if calls else None
    return ordered or (statements, outputs)


def with_guards(statements: list[Statement], outputs: list[list[int]]) -> tuple[list[Statement], list[list[int]]]:
    """Where all that is done with the results of a call with defaults is to replace them by a constant unless a condition holds, the defaults are
    replaced, and the call runs only where that condition holds too."""
    users: dict[int, list[int]] = {}
    for user, statement in enumerate(statements):
        for i in dict.fromkeys(statement.operands):
            users.setdefault(i, []).append(user)
    stored = {i for port in outputs for i in port}
    changed, same = list(statements), list(range(len(statements)))
    late = set()
    for call, statement in enumerate(statements):
        routine = statement.routine
        if routine is None or not has_defaults(statement):
            continue
        results = [i for i in users.get(call, ()) if i in stored or users.get(i)]
        choices = [users[i][0] for i in results if i not in stored and len(users[i]) == 1]
        conditions = {statements[user].operands[0] for user in choices if _guards(statements, user)}
        if len(choices) < len(results) or len(conditions) != 1 or not all(_guards(statements, i) for i in choices):
            continue
        guard = conditions.pop()
        operands = list(statement.operands)
        for result, user in zip(results, choices, strict=True):
            place = 1 + routine.inputs + statements[result].slot[0]
            changed.append(Statement("SELECT", (guard, operands[place], statements[user].operands[2])))
            operands[place] = len(changed) - 1
            same[user] = result
        changed.append(Statement("AND", (operands[0], guard)))
        operands[0] = len(changed) - 1
        changed[call] = statement._replace(operands=tuple(operands))
        late.add(call)
    same += range(len(same), len(changed))
    changed = [each._replace(operands=tuple(same[i] for i in each.operands)) for each in changed]
    return (_reordered(changed, [[same[i] for i in port] for port in outputs], late) if late else None) or (
        statements,
        outputs,
    )


def _guards(statements: Sequence[Statement], user: int) -> bool:
    """Whether a statement is a choice between a result and a constant."""
    statement = statements[user]
    return (
        statement.op == "SELECT"
        and statements[statement.operands[1]].op == "RESULT"
        and statements[statement.operands[2]].op == "CONST"
    )


def _condition(statements: Sequence[Statement], result: int) -> int:
    return statements[statements[result].operands[0]].operands[0]


def _negated(statements: Sequence[Statement], condition: int, near: int) -> int:
    """The statement that is not `near`, if the condition is it, or the number 1 where it holds; -1 if not."""
    if statements[condition].op == "IF_ELSE_ZERO":
        inner, value = statements[condition].operands
        condition = inner if statements[value] == Statement("CONST", value=1.0) else condition
    return condition if statements[condition] == Statement("NOT", (near,)) else -1


def _reordered(
    statements: list[Statement], outputs: list[list[int]], late: Container[int]
) -> tuple[list[Statement], list[list[int]]] | None:
    """The statements depth first from the outputs, as CasADi orders them, and the calls `late` after their defaults, as if these were the outputs;
    None where a default waits for its own call."""
    place: dict[int, int] = {}
    ordered: list[Statement] = []
    results: dict[int, list[int]] = {}
    for index, statement in enumerate(statements):
        if statement.op == "RESULT":
            results.setdefault(statement.operands[0], []).append(index)

    def needed(index: int) -> tuple[int, ...]:
        operands, routine = statements[index].operands, statements[index].routine
        if routine is None or index not in late:
            return operands
        return operands[1 + routine.inputs :] + operands[: 1 + routine.inputs]

    def shown(index: int) -> int:
        call = statements[index].operands[0] if statements[index].op == "RESULT" else -1
        if call not in late:
            return index
        return needed(call)[statements[index].slot[0]]

    begun: set[int] = set()
    stored = [index for port in outputs for index in port]
    for root in [*map(shown, stored), *stored]:
        waiting = [root]
        while waiting:
            index = waiting[-1]
            missing = [i for i in needed(index) if i not in place]
            if index in place or not missing:
                waiting.pop()
                # All results of a call follow it at once: see `split`.
                for each in (index, *results.get(index, ())) if index not in place else ():
                    place[each] = len(ordered)
                    operands = tuple(place[i] for i in statements[each].operands)
                    ordered.append(statements[each]._replace(operands=operands))
            elif index in begun:
                return None
            else:
                begun.add(index)
                waiting += reversed(missing)
    return ordered, [[place[index] for index in port] for port in outputs]


def has_defaults(call: Statement) -> bool:
    """Whether a CALL says what its results are where it is not run."""
    return call.routine is not None and len(call.operands) > 1 + call.routine.inputs


@dataclass(frozen=True)
class Chosen:
    """A result of a CALL with defaults.

    Attributes:
        statement: of the RESULT.
        entry: its place among the results.
        default: the statement of what it is where the call is not run.
        is_read: whether statements read it; else only outputs do, (port, entry) each.
        outputs: the outputs that are it.
    """

    statement: int
    entry: int
    default: int
    is_read: bool
    outputs: tuple[tuple[int, int], ...]


def chosen_results(tape: Tape) -> dict[int, list[Chosen]]:
    """The results that are read of every CALL with defaults."""
    read = {i for statement in tape.statements for i in statement.operands}
    stored: dict[int, list[tuple[int, int]]] = {}
    for port, entries in enumerate(tape.outputs):
        for entry, index in enumerate(entries):
            stored.setdefault(index, []).append((port, entry))
    found: dict[int, list[Chosen]] = {}
    for index, statement in enumerate(tape.statements):
        if statement.op != "RESULT" or not has_defaults(tape.statements[statement.operands[0]]):
            continue
        call, [entry, _] = tape.statements[statement.operands[0]], statement.slot
        default = call.operands[entry - (call.routine.outputs if call.routine is not None else 0)]
        chosen = Chosen(index, entry, default, index in read, tuple(stored.get(index, ())))
        found.setdefault(statement.operands[0], []).append(chosen)
    return found


def output_places(tape: Tape, call: int, chosen: Sequence[Chosen]) -> tuple[int, tuple[int, ...]] | None:
    """The one output that takes all results of a call that are read, and for each result its entry there or -1; None where they go elsewhere too."""
    ports = {port for each in chosen for port, _ in each.outputs}
    if len(ports) != 1 or any(each.is_read or len(each.outputs) != 1 for each in chosen):
        return None
    routine = tape.statements[call].routine
    places = dict.fromkeys(range(routine.outputs if routine is not None else 0), -1)
    places.update((each.entry, each.outputs[0][1]) for each in chosen)
    return ports.pop(), tuple(places.values())


def whole_output(tape: Tape, call: int, chosen: Sequence[Chosen]) -> int | None:
    """The output that holds the results of a call in their order, but for entries that are stored after it; None where there is none."""
    found = output_places(tape, call, chosen)
    if found is None or len(tape.outputs[found[0]]) != len(found[1]):
        return None
    if any(entry >= 0 and entry != place for place, entry in enumerate(found[1])):
        return None
    others = set(tape.outputs[found[0]]) - {each.statement for each in chosen}
    return None if any(tape.statements[index].op == "RESULT" for index in others) else found[0]
