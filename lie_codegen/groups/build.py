"""lc.build: the compiled kernels of a group, of a law or of several things, found in the cache by their definitions."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from lie_codegen.groups.buildable import group_or_kernels, object_definition, package_name, source_definition
from lie_codegen.groups.group_library import GroupLibrary, group_library
from lie_codegen.kernel.plain_data import makes_records
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.library import Library, require_kernels

if TYPE_CHECKING:
    from lie_codegen.groups.buildable import Buildable
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.kernel.kernel import Kernel


#: Bytes as a text and back, whatever they are: a definition holds texts.
_BYTES = {"encoding": "utf-8", "errors": "surrogateescape"}


@overload
def build(
    what: MatrixGroup | str | Path, *, kernels: Sequence[str] | Literal["all"] = (), name: str | None = None
) -> GroupLibrary: ...


@overload
def build(
    what: Kernel | Sequence[MatrixGroup | Kernel | str | Path],
    *,
    kernels: Sequence[str] | Literal["all"] = (),
    name: str | None = None,
) -> Library: ...


def build(what: Buildable, *, kernels: Sequence[str] | Literal["all"] = (), name: str | None = None) -> Library:
    """Compiled kernels, from the cache where they are there.

    The kernels of a group are derived and compiled one by one, each when it is first asked for; a list of Kernels is
    compiled at once. What a kernel's definition determines is found in the cache by it, without SymPy or CasADi.

    Args:
        what: a group (all its kernels), a catalogue name or the path of a group file (the same, without importing SymPy
            when the cache has it, or the package brings the C sources), a Kernel, or several of all these. Kernels of two
            namespaces with one name go by their symbols (lib.so3_exp, lib.se3_exp).
        kernels: names to have compiled before this returns, side by side on the processor's cores; "all" for every one.
        name: C identifier by which the library is called; the namespaces of its kernels if None. As with `generate`, the
            symbols of the kernels stay theirs.

    Raises:
        InputError: if it is none of these, two kernels have one symbol, or `kernels` names one that there is not.
        CompileError: with the command and the compiler's own words; for a group when the kernel is asked for.
    """
    if isinstance(what, str | Path):
        library = _build_named(what, name)
    else:
        group, given = group_or_kernels(what)
        if group is None:
            whole = build_kernels(
                lambda: given, namespace=package_name(given, name), definition=defined_together(given)
            )
            require_kernels(whole, () if kernels == "all" else kernels)
            whole.made_by(built_kernels, given, name)
            whole.compiled_from(lambda asked: next(each for each in given if asked in (each.name, each.symbol)))
            return whole
        library = built_group(group, name)
    library.compile(library.kernels if kernels == "all" else kernels)
    return library


@makes_records
def built_group(group: MatrixGroup, name: str | None) -> GroupLibrary:
    """The library of a group, as pickles and files name it."""
    library = group_library(object_definition(group), lambda: group, name)
    library.made_by(built_group, group, name)
    return library


@lru_cache(maxsize=64)
def library_of(group: MatrixGroup) -> GroupLibrary:
    """`build(group)` once a process, for what asks for a map of a group in every call: a library of its own looks for compilers again."""
    return build(group)


def _build_named(what: str | Path, name: str | None) -> GroupLibrary:
    from lie_codegen.groups.catalogue_names import definition_source

    return built_source(str(what), definition_source(what).decode(**_BYTES), name)


@makes_records
def built_source(what: str, source: str, name: str | None) -> GroupLibrary:
    """The group of the text of a catalogue entry or a file: a file itself need not be where the library is made again."""
    data = source.encode(**_BYTES)

    def load() -> MatrixGroup:
        from lie_codegen.groups.catalogue_load import group_of_source

        return group_of_source(what, data)

    library = group_library(source_definition(data), load, name)
    library.made_by(built_source, what, source, name)
    return library


@makes_records
def built_kernels(kernels: tuple[Kernel, ...], name: str | None) -> Library:
    """The library of kernels, as pickles and files name it."""
    return build(kernels, name=name)
