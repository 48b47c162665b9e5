"""The library of a group: each kernel is derived, compiled and cached by itself, when first asked for.

Most programs use two or three of the fourteen kernels, and those of a large group take seconds each. What is known
beforehand is which kernels there are: from the C sources that ship with the package, from the cache, or from the group.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lie_codegen.door import on_behalf
from lie_codegen.groups.prebuilt import Prebuilt, find_prebuilt
from lie_codegen.identifiers import check_identifier
from lie_codegen.runtime import cache
from lie_codegen.runtime.build import build_sources, interpreted
from lie_codegen.runtime.cache_folder import usable_folder
from lie_codegen.runtime.compiler import find_compilers, warn_no_compiler
from lie_codegen.runtime.digests import digest, package_digest, templates_digest, versions
from lie_codegen.runtime.extension import prepare_extension
from lie_codegen.runtime.library import Library, require_kernels

if TYPE_CHECKING:
    from lie_codegen.arrays import Array
    from lie_codegen.codegen.library_sources import LibrarySources
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.kernel.kernel import Kernel
    from lie_codegen.runtime.call import Compiled


class GroupSources:
    """Where the kernels of a group come from; safe across threads.

    Attributes:
        definition: text that, with the source of this package, determines the kernels.
    """

    def __init__(self, definition: str, load: Callable[[], MatrixGroup]) -> None:
        self.definition = definition
        self._load = load
        self._lock = threading.RLock()

    @cached_property
    def prebuilt(self) -> Prebuilt | None:
        """The C sources that ship with the package, if they are of this definition and current."""
        return find_prebuilt(self.definition)

    @cached_property
    def group(self) -> MatrixGroup:
        """The group itself: SymPy is imported."""
        return self._load()

    def names(self) -> tuple[str, tuple[str, ...]]:
        """The namespace, and the names of the kernels."""
        with self._lock:
            if self.prebuilt is not None:
                return self.prebuilt.namespace, self.prebuilt.kernels
            from lie_codegen.groups.kernels import KERNEL_NAMES

            return self.group.name, KERNEL_NAMES

    def sources(self, name: str) -> LibrarySources:
        """The C text of one kernel."""
        with self._lock:
            if self.prebuilt is not None:
                return self.prebuilt.sources(name)
            from lie_codegen.codegen.package import render_library

            return render_library(self.group.name, [self.kernel(name)])

    def kernel(self, name: str) -> Kernel:
        """One kernel."""
        with self._lock:
            from lie_codegen.groups.kernels import group_kernel

            return group_kernel(self.group, name)


class GroupLibrary(Library):
    """The kernels of a group, each made when it is first asked for; safe across threads and processes.

    Attributes:
        exp, log: x (n,) -> X (d, d), and back.
        product_exp, wei_norman_matrix, wei_norman_rate: coordinates of the second kind g (n,) -> X, M(g), and (g, u) -> g'.
        compose, inverse: X Y and X^-1. Ad, ad, bracket: (n, n), (n, n), (n,).
        ljac, rjac, ljac_inv, rjac_inv: the left and right Jacobians of exp and their inverses, (n, n).
        defect: how far X is from the group. renormalise: one step back to it.
    """

    exp: Compiled[Array]
    log: Compiled[Array]
    product_exp: Compiled[Array]
    wei_norman_matrix: Compiled[Array]
    wei_norman_rate: Compiled[Array]
    compose: Compiled[Array]
    inverse: Compiled[Array]
    Ad: Compiled[Array]
    ad: Compiled[Array]
    bracket: Compiled[Array]
    ljac: Compiled[Array]
    rjac: Compiled[Array]
    ljac_inv: Compiled[Array]
    rjac_inv: Compiled[Array]
    defect: Compiled[float]
    renormalise: Compiled[Array]

    def __init__(
        self, namespace: str, kernels: Sequence[str], make: Callable[[str], Library], path: Path | None
    ) -> None:
        super().__init__(namespace, (), path)
        self.kernels = tuple(kernels)
        self._make = make
        self._made: dict[str, Library] = {}
        self._locks = {name: threading.Lock() for name in self.kernels}

    @property
    def build_log(self) -> tuple[str, ...]:
        """That of every kernel asked for so far; asking compiles their lanes."""
        logs = [self._made[name].build_log for name in self.kernels if name in self._made]
        return tuple(dict.fromkeys(line for log in logs for line in log))

    def __getattr__(self, name: str) -> Compiled[Any]:
        if name not in self.__dict__.get("kernels", ()):
            return super().__getattr__(name)
        with self._locks[name]:
            if name not in self._made:
                library = self._make(name)
                self.__dict__[name] = library[name]
                self.__dict__[name].belongs_to(self)
                self._made[name] = library
        function: Compiled[Any] = self.__dict__[name]
        return function

    def compile(self, names: Iterable[str]) -> None:
        """Have these kernels now: one is derived while others are compiled.

        Raises:
            InputError: there is no kernel of a name.
            CompileError: with the command and the compiler's own words.
        """
        wanted = require_kernels(self, names)
        if not wanted:
            return
        import os
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(max_workers=1 + (os.cpu_count() or 1)) as pool:
            for made in [pool.submit(on_behalf(getattr), self, name) for name in wanted]:
                made.result()


def group_library(definition: str, load: Callable[[], MatrixGroup], name: str | None = None) -> GroupLibrary:
    """The library of the group that `load` makes; `definition` determines it. It is called `name`, or as the group.

    Raises:
        IdentifierError: the name is no C identifier.
        InputError: the definition is not one of a group.
        CacheError: there is no folder to build in.
    """
    origin = GroupSources(definition, load)
    if name is not None:
        check_identifier(name, "name")
    compilers = find_compilers()
    if not compilers:
        warn_no_compiler()
        namespace, kernels = origin.names()
        library = GroupLibrary(name or namespace, kernels, lambda each: interpreted([origin.kernel(each)]), None)
        library.compiled_from(origin.kernel)
        return library
    folder = usable_folder()
    prepare_extension()
    namespace, kernels = _known_names(folder, origin)

    def make(kernel: str) -> Library:
        return build_sources(
            lambda: origin.sources(kernel), compilers, definition=f"{definition}\nkernel {kernel}", namespace=namespace
        )

    library = GroupLibrary(name or namespace, kernels, make, folder / "entries")
    library.compiled_from(origin.kernel)
    return library


def _known_names(folder: Path, origin: GroupSources) -> tuple[str, tuple[str, ...]]:
    """Namespace and kernels, from the cache if this definition was built before."""
    key = digest(["names", origin.definition, package_digest(), templates_digest(), versions()])
    note = cache.find_note(folder, key)
    with contextlib.suppress(LookupError, TypeError):
        return str(note["namespace"]), tuple(str(name) for name in note["kernels"])
    namespace, kernels = origin.names()
    data: dict[str, Any] = {"namespace": namespace, "kernels": list(kernels)}
    with contextlib.suppress(OSError):
        cache.store_note(folder, key, data)
    return namespace, kernels
