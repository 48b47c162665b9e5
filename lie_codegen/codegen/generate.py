"""Kernels -> a C package on disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lie_codegen.codegen.package import render_package
from lie_codegen.codegen.targets import with_target
from lie_codegen.codegen.views import PackageMetadata
from lie_codegen.codegen.write import write_package
from lie_codegen.kernel.kernel import Kernel


def generate(
    kernels: Sequence[Kernel],
    folder: str | Path,
    *,
    namespace: str,
    metadata: PackageMetadata | Mapping[str, Any] | None = None,
    extra: Mapping[str, str] | None = None,
    real: str = "double",
    target: str = "c",
    starts: Mapping[str, Mapping[str, tuple[float, ...]]] | None = None,
    schedule: Mapping[str, str | int | float] | None = None,
    compilers: Sequence[Sequence[str]] = (),
) -> Path:
    """Write the C package of `kernels` as a folder, in place of an earlier one; return its path.

    Args:
        kernels: of one namespace or of several.
        folder: created if need be; an existing one must be empty or hold an unedited package of ours.
        namespace: the name of the header, the source and the CMake target.
        metadata: what the documentation says about the group: `PackageMetadata` or a mapping of its fields.
        extra: further files of the package, {path: text}.
        real: "double", or "float" for processors that have no double; the formulas are the same.
        target: what surrounds the C, see `lie_codegen.codegen.targets`.
        starts: {symbol: {port: numbers}} at which a unit of such a function starts; its first test vector where none is given.
        schedule: in what order a unit calls the functions of a closed loop, as in `PackageParts`.
        compilers: commands, best first, for targets that hold a library.

    Raises:
        CodegenError: a kernel cannot become C, two symbols collide, or a constant is beyond the range of float.
        IdentifierError: the namespace is no C identifier.
        OutputFolderError: the folder cannot be written, or holds files that are not ours.
    """
    tree = render_package(namespace, kernels, _metadata(metadata), extra, real, starts, schedule)
    return write_package(with_target(tree, target, real, compilers), folder)


def _metadata(given: PackageMetadata | Mapping[str, Any] | None) -> PackageMetadata:
    if given is None or isinstance(given, PackageMetadata):
        return given or PackageMetadata()
    fields: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in given.items()}
    return PackageMetadata(**fields)
