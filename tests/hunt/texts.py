"""Hostile texts by Hypothesis: group files that are valid TOML with hostile values, formulas, Lagrangians, command lines.

`corpus/` keeps what once did harm; tests read it first, and `python -m tests.hunt` goes on from there.
"""

from __future__ import annotations

import contextlib
import json
import resource
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st

import lie_codegen as lc
from lie_codegen.groups.group_file import parse_group_file
from tests.hunt.hostile import judged

CORPUS = Path(__file__).with_name("corpus")
SECONDS = 5.0
#: Bytes of address space beyond what is in use; SymPy, NumPy and CasADi alone map gigabytes.
MEMORY = 4 << 30

_label = st.sampled_from(
    ["a", "b", "c", "x1", "", "int", "1a", "a b", "\u00e9", "a'", "__class__", "x" * 300, "A,B", "\x00"]
)
_number = st.one_of(
    st.integers(-3, 3).map(str),
    st.sampled_from(
        ["1e1000000", "9" * 5000, "0x" + "F" * 3000, "1e-300", "1e300", "nan", "inf", "-inf", "true", "1.5", "0.1", "1979-05-27",
         '"sqrt(2)"', '"sqrt(2)+sqrt(3)+sqrt(5)+sqrt(7)+sqrt(11)+sqrt(13)"', '"((9^64)^64)^64"', '"(1+sqrt(2)+sqrt(3)+pi)^64"',
         '"pi"', '"I"', '"1/0"', '""', '"1/2"', '"' + "(" * 200 + '"', '"sqrt(-1)"', '"sqrt(sqrt(sqrt(2)))"', '"2^-64"', "[1]", "{}",
         '"sqrt(10000000000000000000000000000000000000000000000000000000061)"', '"__import__(\'os\')"', '"e"', '"1e400"', '"-"']
    ),
)  # fmt: skip
_text = st.text(max_size=8)


def _toml_text(value: str) -> str:
    return json.dumps(value, ensure_ascii=True)


@st.composite
def group_files(draw: st.DrawFn) -> str:
    """A table that is TOML nearly always, and a group now and then."""
    labels = draw(st.lists(_label, max_size=4))
    lines = [
        f"name = {_toml_text(draw(st.one_of(_label, _text)))}" if draw(st.booleans()) else f"name = {draw(_number)}"
    ]
    lines.append(f"labels = [{', '.join(map(_toml_text, labels))}]")
    if draw(st.integers(0, 4)) == 0:
        lines.append(f"units = [{', '.join(draw(st.lists(_number, max_size=3)))}]")
    if draw(st.integers(0, 9)) == 0:
        lines.append(".".join(["k"] * draw(st.sampled_from([2, 50, 3000]))) + " = 1")
    if draw(st.booleans()):
        lines.append("[brackets]")
        for _ in range(draw(st.integers(0, 4))):
            first, second, third = (draw(st.sampled_from(labels or ["a"])) for _ in range(3))
            lines.append(f"{_toml_text(f'{first},{second}')} = {{ {_toml_text(third)} = {draw(_number)} }}")
    else:
        lines.append("[matrices]")
        size = draw(st.integers(0, 3))
        for label in dict.fromkeys(labels):
            rows = [[draw(_number) for _ in range(size)] for _ in range(size)]
            lines.append(f"{_toml_text(label)} = [{', '.join('[' + ', '.join(row) + ']' for row in rows)}]")
    return "\n".join(lines) + "\n"


def formulas(names: list[str]) -> st.SearchStrategy[str]:
    """Texts near the grammar."""
    leaf = st.sampled_from(
        [
            *names,
            "1",
            "0",
            "2.5",
            "1e300",
            "11e400",
            "1/0",
            "pi",
            "I",
            "9" * 400,
            "t",
            "nan",
            "inf",
            "x.y",
            "a[0]",
            "0.1",
            "1e-300",
        ]
    )

    def more(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        functions = st.sampled_from(
            ["sin", "cos", "exp", "log", "sqrt", "tan", "atan2", "abs", "asin", "lambda", "eval"]
        )
        return st.one_of(
            st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "^", "**", "//", "%"]), inner).map("".join),
            st.tuples(functions, inner).map(lambda pair: f"{pair[0]}({pair[1]})"),
            inner.map(lambda text: f"({text})^{'64' if len(text) % 2 else '2'}"),
            inner.map(lambda text: f"-({text})"),
        )

    return st.one_of(st.recursive(leaf, more, max_leaves=12), st.text(max_size=12))


def command_lines() -> st.SearchStrategy[list[str]]:
    """Words for the command line; nothing that writes or computes for long."""
    word = st.sampled_from(
        ["so3", "no_such", "-", "--", "--json", "--u", "cos(t)", "sin(11e400*t)", "0", "--order", "-1", "99999999999999999999", "1e400", "nan",
         "--eps", "--end", "--samples", "--target", "0.1,0.2,0.3", "nan,inf,0", "", "x" * 3000, "--help", "/", "\u202e", "--controls", "w1,w2",
         "--duration", "1e-300", "0x10", "--clear=maybe"]
    )  # fmt: skip
    command = st.sampled_from(
        ["list", "show", "check", "average", "steer", "simulate", "nonsense", "cache", "--version"]
    )
    return st.tuples(command, st.lists(word, max_size=6)).map(lambda pair: [pair[0], *pair[1]])


def _read_group(text: str) -> None:
    parse_group_file(text.encode("utf-8", "surrogatepass"), "fuzzed.toml")


def _read_input(text: str) -> None:
    lc.PeriodicInput([text, "cos(t)"])


def _read_lagrangian(text: str) -> None:
    lc.lagrangian_system(coordinates=["x"], lagrangian=f"dx^2/2 - ({text})", forces={"x": "u"})


def run_command(words: list[str]) -> str | None:
    """What is wrong with how `lie-codegen WORDS` ended, in this process: a traceback, more than a line of error, another status."""
    import io
    import sys
    from unittest import mock

    from lie_codegen.cli import app

    out, err = io.StringIO(), io.StringIO()
    status: Any = None

    def call() -> None:
        nonlocal status
        try:
            app.main()
        except SystemExit as stopped:
            status = stopped.code or 0

    with (
        mock.patch.object(sys, "argv", ["lie-codegen", *words]),
        mock.patch.object(sys, "stdin", io.StringIO("")),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        verdict = judged(20.0, call)
    if verdict is None and status not in (0, 1, 2):
        verdict = f"status {status}"
    lines = [line for line in err.getvalue().strip().splitlines() if "warning" not in line]
    if verdict is None and status and len(lines) > 1:
        verdict = f"{len(lines)} lines of error: {lines[:2]}"
    return verdict


#: kind -> (inputs, what is wrong with how one is read)
KINDS: dict[str, tuple[st.SearchStrategy[Any], Callable[[Any], str | None]]] = {
    "group files": (group_files(), lambda text: judged(SECONDS, lambda: _read_group(text))),
    "formulas": (formulas(["t", "sin(t)", "cos(2*t)"]), lambda text: judged(SECONDS, lambda: _read_input(text))),
    "Lagrangians": (formulas(["x", "dx", "x^2"]), lambda text: judged(SECONDS, lambda: _read_lagrangian(text))),
    "command lines": (command_lines(), run_command),
}


def corpus(kind: str) -> list[Any]:
    """The inputs kept of a kind."""
    return list(json.loads((CORPUS / f"{kind.replace(' ', '_').lower()}.json").read_text(encoding="utf-8")))


@contextlib.contextmanager
def limited_memory() -> Iterator[None]:
    """Little more memory than is in use: what asks for gigabytes fails at once. Not around sanitizers, which map terabytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    if pages:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def hunt(kind: str, examples: int, seed: int = 0) -> tuple[int, list[str]]:
    """(inputs tried, finds): the corpus, then new ones."""
    inputs, judge = KINDS[kind]
    tried, found = 0, []

    def look(value: Any) -> None:
        nonlocal tried
        tried += 1
        verdict = judge(value)
        if verdict is not None:
            found.append(f"{kind}: {value!r:.300}: {verdict}")

    with limited_memory():
        for value in corpus(kind):
            look(value)
        _explore(inputs, look, examples, seed)
    return tried, found


def _explore(inputs: st.SearchStrategy[Any], look: Callable[[Any], None], examples: int, seed: int) -> None:
    # No shrinking and no stop at the first: finds are listed, and go to the corpus by hand when they are mended.
    run = given(inputs)(look)
    run = settings(max_examples=examples, deadline=None, database=None, suppress_health_check=list(HealthCheck))(run)
    seeded(seed)(run)()
