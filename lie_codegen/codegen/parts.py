"""What a thing of a floor above (a plan, a closed loop) brings to a C package: kernels, and further files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from lie_codegen.kernel.kernel import Kernel


@dataclass(frozen=True)
class PackageParts:
    """Attributes:
    namespace: the name of a package of this alone.
    kernels: what is printed as functions.
    files: {path: text}; src/*.c and include/*.h join the library, *.c beside them are programs that test themselves.
    starts: {symbol: {port: numbers}}: where a function that steps begins, for units that other programs step.
    schedule: of a closed loop, in what order a unit calls its functions: symbols "step", "control" and "reference" ("" where there is
        none); "stages" of the reference a step; seconds "period" between steps at most, "sample" between calls of the law (0: at every
        stage); "delay" in samples, "command" its doubles; "input", the port that the simulator gives: the others are parameters.
    has_forms: whether there are several ways to store it, of which `form` is one.
    """

    namespace: str
    kernels: tuple[Kernel, ...]
    files: Mapping[str, str] = field(default_factory=dict)
    starts: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    schedule: Mapping[str, str | int | float] = field(default_factory=dict)
    has_forms: bool = False


@runtime_checkable
class HasParts(Protocol):
    """A value that can be written as C."""

    def package_parts(self, name: str | None = None, real: str = "double", form: str | None = None) -> PackageParts:
        """Its kernels and files.

        Args:
            name: C identifier of the package, for includes and symbols; its own if None.
            real: "double" or "float".
            form: one of several ways to store it, if it has them.
        """
