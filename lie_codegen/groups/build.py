"""lc.build and lc.generate."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from lie_codegen.errors import InputError
from lie_codegen.groups.group_library import GroupLibrary, group_library
from lie_codegen.identifiers import check_identifier
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.current_package import current_package, package_key, remember_package
from lie_codegen.runtime.library import Library, require_kernels

if TYPE_CHECKING:
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.kernel.kernel import Kernel

    Buildable = MatrixGroup | Kernel | str | Path | Sequence[MatrixGroup | Kernel | str | Path]


#: What `generate(steering=)` adds is written by a floor above this one, named here and loaded when asked for.
STEERING_PACKAGE = ("lie_codegen.steering.shooting.package", "render_steering_package")


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
        name: C identifier of a library of kernels; their namespaces if None.

    Raises:
        InputError: if it is none of these, two kernels have one symbol, or `kernels` names one that there is not.
        CompileError: with the command and the compiler's own words; for a group when the kernel is asked for.
    """
    if isinstance(what, str | Path):
        library = _build_named(what)
    else:
        group, given = _group_or_kernels(what)
        if group is None:
            whole = build_kernels(
                lambda: given, namespace=_package_name(given, name), definition=defined_together(given)
            )
            require_kernels(whole, () if kernels == "all" else kernels)
            whole.made_by(_build_kernels, given, name)
            whole.compiled_from(lambda asked: next(each for each in given if asked in (each.name, each.symbol)))
            return whole
        library = group_library(object_definition(group), lambda: group)
        library.made_by(build, group)
    library.compile(library.kernels if kernels == "all" else kernels)
    return library


def generate(
    what: Buildable,
    folder: str | Path,
    *,
    steering: Sequence[str | int] | Literal[True] | None = None,
    real: str = "double",
    name: str | None = None,
) -> Path:
    """The C package of a group, of kernels or of a controller of `lc.mpc`, written as a folder; returns its path.

    Args:
        what: as `build`; or a controller, whose package is the bounded solver with its model.
        folder: created if need be.
        steering: controls of a group, for a minimum-energy steering solver in the subfolder "steering", a C package by
            itself with its own example and test vectors; True for all components. The solver is in double.
        real: "double", or "float" for processors without double: arguments, constants and libm in single precision.
        name: C identifier of the header, the source and the CMake target; the namespaces if None. So two laws of one group,
            with names of their own, and the group's own package go into one program.

    What the folder holds is compared with what was last written there from the same definition: if it is current, nothing
    is derived or written.

    Raises:
        InputError: as `build`; steering of kernels.
        UncontrollableError: the controls of `steering` do not reach everything; says what is missing.
        OutputFolderError: the folder cannot be written, or holds files that are not ours.
    """
    from lie_codegen.codegen.generate import generate as generate_package
    from lie_codegen.codegen.views import PackageMetadata
    from lie_codegen.codegen.write import write_package

    render = getattr(what, "render_package", None)
    if callable(render):
        # a controller of a floor above this one says itself what it is as C
        if steering is not None:
            raise InputError("generate: steering needs a group, not a controller")
        return write_package(render(real=real), folder)
    source = _known_by(what)
    controls = list(steering) if isinstance(steering, Sequence) and not isinstance(steering, str) else steering
    key = None if source is None else package_key([source, controls, real, name])
    if (current := current_package(key, folder)) is not None:
        return current
    if isinstance(what, str | Path):
        from lie_codegen.groups.catalogue_load import group as load

        what = load(what)
    group, kernels = _group_or_kernels(what)
    if group is None:
        if steering is not None:
            raise InputError("generate: steering needs a group, not kernels")
        written = generate_package(kernels, folder, namespace=_package_name(kernels, name), real=real)
    else:
        extra = _steering(group, steering) if steering is not None else {}
        metadata = PackageMetadata(title=group.name, description=_about(group), labels=group.labels, units=group.units)
        written = generate_package(
            _kernels_of(group), folder, namespace=name or group.name, metadata=metadata, extra=extra, real=real
        )
    remember_package(key, written)
    return written


def _known_by(what: Buildable) -> str | None:
    """Text that, with the source of this package, determines what is made from it; None where there is none."""
    if isinstance(what, str | Path):
        from lie_codegen.groups.catalogue_names import definition_source

        return source_definition(definition_source(what))
    group, kernels = _group_or_kernels(what)
    return object_definition(group) if group is not None else defined_together(kernels)


def _steering(group: MatrixGroup, controls: Sequence[str | int] | Literal[True]) -> dict[str, str]:
    module, function = STEERING_PACKAGE
    render = getattr(import_module(module), function)
    files: dict[str, str] = render(group, group.labels if controls is True else controls, folder="steering")
    return files


def _about(group: MatrixGroup) -> str:
    """The description and the matrices: a representation found from brackets is nowhere else to be read."""
    basis = zip(group.labels, group.exact_basis, strict=True)
    rows = [f"{label} = [{'; '.join(' '.join(map(str, row)) for row in matrix.tolist())}]" for label, matrix in basis]
    return "\n".join([line for line in (group.description,) if line] + ["Basis, row by row:", *rows])


def source_definition(source: bytes) -> str:
    """What `build` knows a name or a group file by."""
    return f"file\n{source.decode('utf-8', errors='replace')}"


def object_definition(group: MatrixGroup) -> str:
    """What `build` knows a group by."""
    return f"group\n{group.definition_text}"


def _build_named(what: str | Path) -> GroupLibrary:
    from lie_codegen.groups.catalogue_names import definition_source

    return _build_source(str(what), definition_source(what))


def _build_source(what: str, source: bytes) -> GroupLibrary:
    """The group of the text of a catalogue entry or a file: a file itself need not be where the library is made again."""

    def load() -> MatrixGroup:
        from lie_codegen.groups.catalogue_load import group_of_source

        return group_of_source(what, source)

    library = group_library(source_definition(source), load)
    library.made_by(_build_source, str(what), source)
    return library


def _build_kernels(kernels: tuple[Kernel, ...], name: str | None) -> Library:
    return build(kernels, name=name)


def _kernels_of(group: MatrixGroup) -> tuple[Kernel, ...]:
    from lie_codegen.groups.kernels import group_kernels

    return group_kernels(group)


def _group_or_kernels(what: Any) -> tuple[MatrixGroup | None, tuple[Kernel, ...]]:
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


def _package_name(kernels: Sequence[Kernel], name: str | None) -> str:
    """The name given, or the namespaces of the kernels, of which no two have one symbol."""
    symbols = [kernel.symbol for kernel in kernels]
    repeated = sorted({symbol for symbol in symbols if symbols.count(symbol) > 1})
    if repeated:
        raise InputError(f"kernel names repeated: {', '.join(repeated)}; give one of each another name=")
    return check_identifier(name, "name") if name is not None else "_".join(dict.fromkeys(k.namespace for k in kernels))
