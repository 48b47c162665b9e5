"""lc.generate: the C package of groups, kernels, plans, closed loops and controllers, written as a folder."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from lie_codegen.errors import InputError
from lie_codegen.groups.buildable import group_or_kernels, object_definition, package_name, source_definition
from lie_codegen.runtime.build import defined_together
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.current_package import current_package, package_key, remember_package

if TYPE_CHECKING:
    from lie_codegen.codegen.parts import HasParts, PackageParts
    from lie_codegen.codegen.views import PackageMetadata
    from lie_codegen.groups.buildable import Buildable
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.kernel.kernel import Kernel


#: What `generate(steering=)` adds is written by a floor above this one, named here and loaded when asked for.
STEERING_PACKAGE = ("lie_codegen.steering.shooting.package", "render_steering_package")


def generate(
    what: Buildable | HasParts | Sequence[MatrixGroup | Kernel | str | Path | HasParts],
    folder: str | Path,
    *,
    steering: Sequence[str | int] | Literal[True] | None = None,
    real: str = "double",
    name: str | None = None,
    form: str | None = None,
    target: str = "c",
) -> Path:
    """The C package of a group, of kernels, of a plan, of a closed loop or of a controller of `lc.mpc`, or of several of these;
    written as a folder; returns its path.

    A plan becomes <name>_plan.h and .c, its controls as a function of t, and <name>_plan_replay.c, which runs them and compares with
    test vectors. A closed loop becomes its law with closed_loop.c, which runs it from the same start.

    Args:
        what: as `build`; or a plan; a closed loop; or a list of groups, kernels, plans and loops for one package. A controller is a
            package by itself, the bounded solver with its model.
        folder: created if need be.
        steering: controls of a group, for a minimum-energy steering solver in the subfolder "steering", a C package by
            itself with its own example and test vectors; True for all components. The solver is in double.
        real: "double", or "float" for processors without double: arguments, constants and libm in single precision.
        name: C identifier of the header, the source and the CMake target; the namespaces if None. So two laws of one group,
            with names of their own, and the group's own package go into one program.
        target: "c"; or what surrounds the same C: "fmu" (a unit of FMI 3.0 for co-simulation, <name>.fmu in the folder; steps keep their
            state, inputs that are gains or inertias are tunable parameters), "rust" (a no_std crate; `cargo test` runs the vectors), "wasm" (an
            ES module with types; needs ziglang), "ros2" (a package.xml for a workspace).
        form: of a plan's controls: "table" (polynomials, piece by piece), "fourier", or the shorter of the two if None.

    What the folder holds is compared with what was last written there from the same definition: if it is current, nothing
    is derived or written.

    Raises:
        InputError: as `build`; steering without a group; a form that the plan has not; a target that there is not.
        MissingDependencyError: wasm without ziglang. CompileError: of fmu and wasm, with the compiler's own words.
        UncontrollableError: the controls of `steering` do not reach everything; says what is missing.
        OutputFolderError: the folder cannot be written, or holds files that are not ours.
    """
    from lie_codegen.codegen.generate import generate as generate_package
    from lie_codegen.codegen.targets import check_target
    from lie_codegen.codegen.write import write_package

    check_target(target, real)
    render = getattr(what, "render_package", None)
    if callable(render):
        # a controller of a floor above this one says itself what it is as C
        if steering is not None:
            raise InputError("generate: steering needs a group, not a controller")
        if form is not None:
            raise InputError("generate: form says how the controls of a plan are stored, and a controller has none")
        if name is not None:
            raise InputError("generate: a controller bears the name of its problem; give name= to lc.ocp")
        if target != "c":
            raise InputError(f"generate: a controller is written as C, not for {target}")
        return write_package(render(real=real), folder)
    parted, plain = _split(what)
    if form is not None and not parted:
        raise InputError("generate: form says how the controls of a plan are stored, and no plan is given")
    source = None if parted else _known_by(plain)
    controls = list(steering) if isinstance(steering, Sequence) and not isinstance(steering, str) else steering
    key = None if source is None else package_key([source, controls, real, name, target])
    if (current := current_package(key, folder)) is not None:
        return current
    groups, kernels, parts = _gathered(plain, parted, name, real, form)
    if form is not None and not any(each.has_forms for each in parts):
        raise InputError(
            "generate: form says how the controls of a plan are stored; a closed loop and wheels have none"
        )
    if steering is not None and len(groups) != 1:
        raise InputError(f"generate: steering needs one group, and {len(groups)} are given")
    files = {path: text for each in parts for path, text in each.files.items()}
    extra = {**files, **(_steering(groups[0], steering) if steering is not None else {})}
    alone = groups[0] if len(groups) == 1 and all(kernel.namespace == groups[0].name for kernel in kernels) else None
    namespace = parts[0].namespace if parts and name is None else package_name(kernels, name)
    metadata = None if alone is None else _metadata(alone)
    starts = {symbol: ports for each in parts for symbol, ports in each.starts.items()}
    schedules = [each.schedule for each in parts if each.schedule]
    written = generate_package(
        kernels,
        folder,
        namespace=namespace,
        metadata=metadata,
        extra=extra,
        real=real,
        target=target,
        starts=starts,
        schedule=schedules[0] if len(schedules) == 1 else None,
        compilers=[each.command for each in find_compilers()] if target == "fmu" else (),
    )
    remember_package(key, written)
    return written


def _split(what: Any) -> tuple[list[HasParts], Any]:
    """What brings parts of its own, and the rest as it was given."""
    from lie_codegen.codegen.parts import HasParts

    if isinstance(what, HasParts):
        return [what], []
    if not isinstance(what, list | tuple):
        return [], what
    parted = [each for each in what if isinstance(each, HasParts)]
    return parted, [each for each in what if not isinstance(each, HasParts)] if parted else what


def _gathered(
    plain: Any, parted: Sequence[HasParts], name: str | None, real: str, form: str | None
) -> tuple[list[MatrixGroup], list[Kernel], list[PackageParts]]:
    """The groups themselves, all kernels once, and the parts; files of two plans or loops bear numbers."""
    from lie_codegen.groups.catalogue_load import group as load
    from lie_codegen.groups.matrix_group import MatrixGroup

    items = list(plain) if isinstance(plain, list | tuple) else [plain]
    named = [load(each) if isinstance(each, str | Path) else each for each in items]
    groups = [each for each in named if isinstance(each, MatrixGroup)]
    kernels = list(group_or_kernels(named)[1]) if named else []
    own = [each.package_parts(name, real, form) for each in parted]
    if own and name is None:
        # one name for the whole: the includes of all programs are of one package
        common = own[0].namespace
        own = [each.package_parts(common, real, form) for each in parted] if len(own) > 1 else own
    repeated = [
        path for index, each in enumerate(own) for path in each.files if any(path in o.files for o in own[:index])
    ]
    if repeated:
        raise InputError(
            f"generate: several things bring {', '.join(sorted(set(repeated)))}; write them to folders of their own"
        )
    for each in own:
        kernels += [kernel for kernel in each.kernels if kernel not in kernels]
    return groups, kernels, own


def _metadata(group: MatrixGroup) -> PackageMetadata:
    from lie_codegen.codegen.views import PackageMetadata

    return PackageMetadata(title=group.name, description=_about(group), labels=group.labels, units=group.units)


def _known_by(what: Buildable) -> str | None:
    """Text that, with the source of this package, determines what is made from it; None where there is none."""
    if isinstance(what, str | Path):
        from lie_codegen.groups.catalogue_names import definition_source

        return source_definition(definition_source(what))
    group, kernels = group_or_kernels(what)
    if group is not None:
        return f"{group.description}\n{object_definition(group)}"  # the header shows the description
    return defined_together(kernels)


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
