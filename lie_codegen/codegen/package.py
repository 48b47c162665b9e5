"""Kernels -> the generated package as text: pure, the same bytes for the same kernels."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from lie_codegen.codegen.lane_headers import in_floats, lanes_float_header, lanes_header
from lie_codegen.codegen.lanes import lane_body
from lie_codegen.codegen.library_sources import LibrarySources
from lie_codegen.codegen.numerics import NUMERICS_VERSION
from lie_codegen.codegen.opcodes import REALS, Target
from lie_codegen.codegen.signature import Signature, is_step
from lie_codegen.codegen.stack import package_stack
from lie_codegen.codegen.tape import tape_of
from lie_codegen.codegen.templates import render
from lie_codegen.codegen.vectors import TestVector, make_vectors
from lie_codegen.codegen.views import PackageMetadata, PackageView, package_view
from lie_codegen.codegen.write import GENERATOR
from lie_codegen.errors import CodegenError
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.definition import described
from lie_codegen.kernel.kernel import Kernel

#: What example.c allows between its results and the vectors, relative to max(1, |expected|).
TOLERANCES = {"double": 1e-11, "float": 1e-5}


@dataclass(frozen=True)
class _Rows:
    """The vectors of one kernel as C literals: [port][vector][entry]."""

    count: int
    inputs: tuple[tuple[tuple[str, ...], ...], ...]
    outputs: tuple[tuple[tuple[str, ...], ...], ...]


@dataclass(frozen=True)
class _CsvRow:
    symbol: str
    number: int
    direction: str
    port: str
    numbers: tuple[str, ...]


def render_package(
    namespace: str,
    kernels: Sequence[Kernel],
    metadata: PackageMetadata | None = None,
    extra: Mapping[str, str] | None = None,
    real: str = "double",
    starts: Mapping[str, Mapping[str, tuple[float, ...]]] | None = None,
    schedule: Mapping[str, str | int | float] | None = None,
) -> dict[str, str]:
    """The package as {path: text}, in double or float, with `extra` files of the same form; writes nothing.

    `starts`: {symbol: {port: numbers}}, and `schedule`, as in `PackageParts`, told in the manifest.

    Raises:
        CodegenError, IdentifierError: as in `lie_codegen.codegen.generate`.
    """
    if real not in REALS:
        raise CodegenError(f"real is one of {', '.join(REALS)}, given {real!r}")
    target = REALS[real]
    view = _view(namespace, kernels, metadata or PackageMetadata(), target)
    vectors = [make_vectors(kernel, real=real) for kernel in kernels]
    checks = [
        (shown, _rows(kernel, each, target)) for shown, kernel, each in zip(view.kernels, kernels, vectors, strict=True)
    ]
    more = sorted(extra or {})
    stack = package_stack(view)
    files = {
        "sources": [f"src/{namespace}.c", *(path for path in more if path.startswith("src/") and path.endswith(".c"))],
        "headers": [f"include/{namespace}.h", *(path for path in more if path.startswith("include/"))],
        "programs": [
            (path, stem if (stem := path.removesuffix(".c")).startswith(f"{namespace}_") else f"{namespace}_{stem}")
            for path in more
            if "/" not in path and path.endswith(".c")
        ],
        "declared": [row for path in more if path.startswith("include/") for row in _declared((extra or {})[path])],
    }
    tree = {
        f"include/{namespace}.h": render("header.h.jinja", package=view),
        f"src/{namespace}.c": render("source.c.jinja", package=view),
        "CMakeLists.txt": render("CMakeLists.txt.jinja", package=view, **files),
        f"{namespace}Config.cmake.in": render("Config.cmake.in.jinja", package=view),
        "example.c": render("example.c.jinja", package=view, checks=checks, tolerance=repr(TOLERANCES[real])),
        "test_vectors.csv": render("test_vectors.csv.jinja", rows=_csv_rows(kernels, vectors)),
        "README.md": render("README.md.jinja", package=view, stack=stack, **files),
        **(extra or {}),
    }
    return {**tree, "manifest.json": _manifest(view, kernels, tree, stack, starts or {}, schedule or {})}


def _declared(header: str) -> list[tuple[str, str, str]]:
    """(name, declaration, comment) of the functions of a header, each declared behind its comment."""
    found = re.findall(r"/\*((?:(?!\*/).)*)\*/\n((?:\w+ )+\**(\w+)\([^;{}]*\));", header, re.DOTALL)
    return [(name, " ".join(declaration.split()), " ".join(comment.split())) for comment, declaration, name in found]


def render_library(namespace: str, kernels: Sequence[Kernel], real: str = "double") -> LibrarySources:
    """The sources of the shared library that Python loads: the package's own, and the entry points; over doubles or floats.

    Raises:
        CodegenError, IdentifierError: as in `lie_codegen.codegen.generate`.
    """
    _check(namespace, kernels)
    target = REALS[real]
    tapes = [tape_of(kernel, real) for kernel in kernels]
    view = package_view(namespace, kernels, tapes, PackageMetadata(), target)
    bodies = [
        lane_body(tape, [port.size for port in kernel.inputs], target)
        for kernel, tape in zip(kernels, tapes, strict=True)
    ]
    header = "lie_codegen_lanes.h" if real == "double" else "lie_codegen_lanes_float.h"
    reduces = any(kernel.is_step and len(kernel.outputs) > 1 for kernel in view.kernels)
    both = list(zip(view.kernels, bodies, strict=True))
    patches = tuple(dict.fromkeys(each for body in bodies for part in (*body.parts, body) for each in part.patches))
    binding = render("binding.c.jinja", package=view, kernels=both, header=header, reduces=reduces, patches=patches)
    files = {
        f"{namespace}.h": render("header.h.jinja", package=view),
        f"{namespace}.c": render("source.c.jinja", package=view),
        "lie_codegen_lanes.h": lanes_header(),
        **({} if real == "double" else {header: lanes_float_header()}),
        f"{namespace}_binding.c": binding if real == "double" else in_floats(binding),
    }
    return LibrarySources(
        namespace=namespace,
        files=files,
        main=f"{namespace}_binding.c",
        statements=max(len(tape.statements) for tape in tapes),
        signatures=library_signatures(kernels, real),
        notes=tuple(
            f"{kernel.name}: batches call libm lane by lane for {', '.join(body.slow)}"
            for kernel, body in zip(kernels, bodies, strict=True)
            if body.slow
        ),
    )


def library_signatures(kernels: Sequence[Kernel], real: str = "double") -> tuple[Signature, ...]:
    """The signatures; a name that two namespaces share gives way to the symbol."""
    names = [kernel.name for kernel in kernels]
    return tuple(
        replace(Signature.of(kernel, real), name=kernel.symbol)
        if names.count(kernel.name) > 1
        else Signature.of(kernel, real)
        for kernel in kernels
    )


def _check(namespace: str, kernels: Sequence[Kernel]) -> None:
    check_identifier(namespace, "namespace")
    _check_symbols(namespace, kernels)


def _view(namespace: str, kernels: Sequence[Kernel], metadata: PackageMetadata, target: Target) -> PackageView:
    _check(namespace, kernels)
    tapes = [tape_of(kernel, target.type_name) for kernel in kernels]
    said = f"Numerics version {NUMERICS_VERSION} of lie_codegen: the same number and definition, the same arithmetic."
    told = replace(metadata, conventions=(*metadata.conventions, said))
    return package_view(namespace, kernels, tapes, told, target)


def _check_symbols(namespace: str, kernels: Sequence[Kernel]) -> None:
    """No two exported symbols are equal."""
    if not kernels:
        raise CodegenError(f"{namespace}: no kernel given")
    owner: dict[str, str] = {}
    for kernel in kernels:
        suffixes = ("", "_call", "_batch", "_lanes") + (
            ("_scan", "_scan_batch", "_reduce") if is_step(kernel.inputs, kernel.outputs) else ()
        )
        for suffix in suffixes:
            symbol = kernel.symbol + suffix
            if symbol in owner:
                raise CodegenError(f"kernels {owner[symbol]} and {kernel.symbol} both need the symbol {symbol}")
            owner[symbol] = kernel.symbol


def _rows(kernel: Kernel, vectors: Sequence[TestVector], target: Target) -> _Rows:
    def literals(part: str, number: int) -> tuple[tuple[str, ...], ...]:
        return tuple(tuple(target.literal(entry) for entry in getattr(vector, part)[number]) for vector in vectors)

    return _Rows(
        count=len(vectors),
        inputs=tuple(literals("inputs", number) for number in range(len(kernel.inputs))),
        outputs=tuple(literals("outputs", number) for number in range(len(kernel.outputs))),
    )


def _csv_rows(kernels: Sequence[Kernel], vectors: Sequence[Sequence[TestVector]]) -> list[_CsvRow]:
    return [
        _CsvRow(kernel.symbol, number, direction, port.name, tuple(repr(entry) for entry in values))
        for kernel, each in zip(kernels, vectors, strict=True)
        for number, vector in enumerate(each)
        for direction, ports, parts in (("in", kernel.inputs, vector.inputs), ("out", kernel.outputs, vector.outputs))
        for port, values in zip(ports, parts, strict=True)
    ]


def _function(kernel: Kernel, start: Mapping[str, tuple[float, ...]] | None) -> dict[str, Any]:
    """The signature, and the definition where a number is compiled in, and where a unit of it starts."""
    own = {"definition": kernel.definition} if described(kernel.definition) else {}
    begin = {"start": {port: list(numbers) for port, numbers in start.items()}} if start else {}
    return {**Signature.of(kernel).to_json(), **own, **begin}


def _manifest(
    view: PackageView,
    kernels: Sequence[Kernel],
    tree: Mapping[str, str],
    stack: Mapping[str, int],
    starts: Mapping[str, Mapping[str, tuple[float, ...]]],
    schedule: Mapping[str, str | int | float],
) -> str:
    data: dict[str, Any] = {
        "generator": GENERATOR,
        "format": 1,
        "namespace": view.namespace,
        "version": view.version,
        "numerics": NUMERICS_VERSION,
        **({"real": view.type_name} if view.type_name != "double" else {}),
        "functions": [_function(kernel, starts.get(kernel.symbol)) for kernel in kernels],
        **({"stack_bytes": dict(stack)} if stack else {}),
        **({"schedule": dict(schedule)} if schedule else {}),
        "files": {path: hashlib.sha256(text.encode()).hexdigest() for path, text in sorted(tree.items())},
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
