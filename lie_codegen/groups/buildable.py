"""What can be built: a group, its name or file, kernels, or several of these; their definitions, and the name of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lie_codegen.errors import InputError
from lie_codegen.identifiers import check_identifier

if TYPE_CHECKING:
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.kernel.kernel import Kernel

    Buildable = MatrixGroup | Kernel | str | Path | Sequence[MatrixGroup | Kernel | str | Path]


def source_definition(source: bytes) -> str:
    """What `build` knows a name or a group file by."""
    return f"file\n{source.decode('utf-8', errors='replace')}"


def object_definition(group: MatrixGroup) -> str:
    """What `build` knows a group by."""
    return f"group\n{group.definition_text}"


def _kernels_of(group: MatrixGroup) -> tuple[Kernel, ...]:
    from lie_codegen.groups.kernels import group_kernels

    return group_kernels(group)


def group_or_kernels(what: Any) -> tuple[MatrixGroup | None, tuple[Kernel, ...]]:
    """One group, or all kernels of what is given; a group in a list counts as its kernels.

    Raises:
        InputError: it is none of these.
    """
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.kernel.kernel import Kernel

    if isinstance(what, MatrixGroup):
        return what, ()
    kernels: list[Kernel] = []
    for each in (what,) if isinstance(what, Kernel) else what if isinstance(what, Sequence) else (None,):
        if isinstance(each, str | Path):
            from lie_codegen.groups.catalogue_load import group as load

            each = load(each)
        if isinstance(each, MatrixGroup):
            kernels += _kernels_of(each)
        elif isinstance(each, Kernel):
            kernels.append(each)
        else:
            raise InputError(f"expected a group, its name or file, a Kernel or several of these, got {what!r}")
    if not kernels:
        raise InputError(f"expected a group, its name or file, a Kernel or several of these, got {what!r}")
    return None, tuple(kernels)


def package_name(kernels: Sequence[Kernel], name: str | None) -> str:
    """The name given, or the namespaces of the kernels, of which no two have one symbol.

    Raises:
        InputError: two have one symbol. IdentifierError: the name is no C identifier.
    """
    symbols = [kernel.symbol for kernel in kernels]
    repeated = sorted({symbol for symbol in symbols if symbols.count(symbol) > 1})
    if repeated:
        raise InputError(f"kernel names repeated: {', '.join(repeated)}; give one of each another name=")
    return check_identifier(name, "name") if name is not None else "_".join(dict.fromkeys(k.namespace for k in kernels))
