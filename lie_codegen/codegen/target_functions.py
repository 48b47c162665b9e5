"""The functions of a package as the templates of another target see them: names free of its words, ports flat, its test vectors."""

from __future__ import annotations

import contextlib
import re
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lie_codegen.errors import CompileError, SystemRefusalError

_RUST_WORDS = frozenset(
    "as break const continue crate dyn else enum extern false fn for if impl in let loop match mod move mut pub ref return self "
    "static struct super trait true type unsafe use where while async await box final gen macro override priv try typeof "
    "unsized virtual yield".split()
)
_JS_WORDS = frozenset(
    [
        "in",
        "function",
        "var",
        "let",
        "const",
        "new",
        "delete",
        "class",
        "default",
        "export",
        "import",
        "this",
        "with",
        "void",
    ]
)
#: A machine under load needs minutes for the first compilation, in which zig makes its C library.
_SECONDS = 900


@dataclass(frozen=True)
class PortView:
    name: str
    size: int
    shape: tuple[int, ...]
    said: str

    @property
    def scalar(self) -> bool:
        """Whether it goes into the C function by value."""
        return self.shape == ()

    @property
    def rust(self) -> str:
        return f"{self.name}_" if self.name in _RUST_WORDS else self.name

    @property
    def js(self) -> str:
        return f"{self.name}_" if self.name in _JS_WORDS else self.name


@dataclass(frozen=True)
class VectorView:
    inputs: Sequence[tuple[PortView, list[str]]]
    outputs: Sequence[tuple[PortView, list[str]]]


@dataclass(frozen=True)
class FunctionView:
    name: str
    symbol: str
    formula: str
    inputs: Sequence[PortView]
    outputs: Sequence[PortView]
    vectors: Sequence[VectorView]
    tunable: frozenset[str]
    start: Mapping[str, list[str]]

    @property
    def rust(self) -> str:
        return f"{self.name}_" if self.name in _RUST_WORDS else self.name

    @property
    def is_step(self) -> bool:
        """Whether an output p_next goes on from an input p."""
        sizes = {port.name: port.size for port in self.inputs}
        return any(
            sizes.get(port.name.removesuffix("_next")) == port.size
            for port in self.outputs
            if port.name.endswith("_next")
        )


def functions_of(manifest: Mapping[str, Any], tree: Mapping[str, str]) -> list[FunctionView]:
    """The functions of a package with their test vectors; a name that two of them have gives way to the C symbol."""
    vectors = _vectors(tree["test_vectors.csv"])
    found = []
    for each in manifest["functions"]:
        inputs, outputs = (tuple(_port(port) for port in each[side]) for side in ("inputs", "outputs"))
        given = (each.get("definition") or {}).get("parameters", {})
        tunable = frozenset(
            p.name for p in inputs if (given.get("tunable") is True and p.name in given) or given.get(p.name) == "input"
        )
        cases = [
            VectorView([(p, case["in"][p.name]) for p in inputs], [(p, case["out"][p.name]) for p in outputs])
            for case in vectors.get(each["symbol"], [])
        ]
        formula = " ".join(str(each.get("formula") or each["name"]).split())
        start = {port.name: values for port, values in cases[0].inputs} if cases else {}
        start |= {port: [repr(float(number)) for number in numbers] for port, numbers in each.get("start", {}).items()}
        found.append(FunctionView(each["name"], each["symbol"], formula, inputs, outputs, cases, tunable, start))
    names = [each.name for each in found]
    return [each if names.count(each.name) == 1 else replace(each, name=each.symbol) for each in found]


def _port(record: Mapping[str, Any]) -> PortView:
    shape = tuple(int(size) for size in record["shape"])
    size = 2 if record.get("is_complex") else 1
    for each in shape:
        size *= each
    units = f" [{record['units']}]" if record.get("units") else ""
    kind = " x ".join(map(str, shape)) or "number"
    said = f"{kind}{', complex' if record.get('is_complex') else ''}{units} {record.get('description', '')}".strip()
    # a complex array has its parts as one more axis
    return PortView(record["name"], size, (*shape, 2) if record.get("is_complex") else shape, " ".join(said.split()))


def _vectors(csv: str) -> dict[str, list[dict[str, dict[str, list[str]]]]]:
    found: dict[str, dict[int, dict[str, dict[str, list[str]]]]] = {}
    for line in csv.strip().splitlines()[1:]:
        symbol, number, direction, port, values = line.split(",")
        case = found.setdefault(symbol, {}).setdefault(int(number), {"in": {}, "out": {}})
        case[direction][port] = values.split()
    return {symbol: [cases[k] for k in sorted(cases)] for symbol, cases in found.items()}


def c_sources(tree: Mapping[str, str]) -> list[str]:
    """The paths of the C files."""
    return sorted(path for path in tree if path.startswith("src/") and path.endswith(".c"))


def crate_name(namespace: str) -> str:
    """The namespace as the registries of other languages take it."""
    return re.sub(r"_+", "_", namespace.lower()).strip("_")


@contextlib.contextmanager
def compile_folder() -> Iterator[Path]:
    """A temporary folder to compile in, gone afterwards.

    Raises:
        SystemRefusalError: it, or a file in it, cannot be written.
    """
    try:
        with tempfile.TemporaryDirectory() as name:
            yield Path(name)
    except OSError as error:
        raise SystemRefusalError(
            f"the temporary folder to compile in cannot be written: {error.strerror or error}"
        ) from error


def run_compiler(command: Sequence[str]) -> None:
    """Run it.

    Raises:
        CompileError: the compiler's own words.
    """
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CompileError(f"{command[0]} does not compile the package: {error}") from None
    if done.returncode:
        raise CompileError(f"{' '.join(command[:4])} ... does not compile the package:\n{done.stderr.strip()[-2000:]}")


def put_files(folder: Path, files: Mapping[str, str]) -> None:
    """Write the files in the folder."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
