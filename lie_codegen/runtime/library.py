"""Library: the kernels of one namespace, ready to be called."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

from lie_codegen.codegen.signature import Signature
from lie_codegen.door import guard_methods
from lie_codegen.errors import CodegenError, InputError
from lie_codegen.kernel.plain_data import Definition, NoDefinitionError

if TYPE_CHECKING:
    from lie_codegen.kernel.kernel import Kernel
    from lie_codegen.runtime.call import Compiled


@guard_methods
class Library:
    """Compiled kernels, each an attribute and an item.

    Attributes:
        namespace: prefix of the C symbols.
        kernels: names, in order.
        compiled: False where CasADi's interpreter stands in for C.
        path: the shared library, the folder of all of them for a group, or None.
        build_log: lanes of a batch, operations without a lane form, how calls go.
    """

    namespace: str
    kernels: tuple[str, ...]
    compiled: bool
    path: Path | None

    def __init__(
        self,
        namespace: str,
        functions: Sequence[Compiled[Any]],
        path: Path | None,
        build_log: Sequence[str] = (),
        lanes: Callable[[], int] | None = None,
    ) -> None:
        self.namespace = namespace
        self.kernels = tuple(function.name for function in functions)
        self.compiled = path is not None
        self.path = path
        self._notes = tuple(build_log)
        self._lanes = lanes
        self._recipe: tuple[Any, ...] = ()
        self._kernel: Callable[[str], Kernel] | None = None
        self.__dict__.update({function.name: function for function in functions})

    def made_by(self, make: Callable[..., Any], *arguments: Any) -> None:
        """What makes this library again: it pickles as that, never as a path, and equals what is made alike."""
        self._recipe = (make, *arguments)
        _LIVE[self._recipe] = self
        for function in self.__dict__.values():
            if hasattr(function, "belongs_to"):
                function.belongs_to(self)

    def compiled_from(self, kernel: Callable[[str], Kernel]) -> None:
        """Where the Kernel of a name is found, for what is derived from compiled functions."""
        self._kernel = kernel

    def kernel_of(self, name: str) -> Kernel:
        """The Kernel that a compiled function was made from.

        Raises:
            InputError: the library was not made by lc.build.
        """
        if self._kernel is None:
            raise InputError(
                f"the library {self.namespace} was not made by lc.build and knows no kernels; give the Kernel"
            )
        return self._kernel(name)

    @property
    def definition(self) -> Definition | None:
        """What makes it again, as plain data; None where it was not made by lc.build, or of kernels written by hand."""
        if not self._recipe:
            return None
        import inspect

        from lie_codegen.kernel.definition import definition_of

        make, *arguments = self._recipe
        try:
            named = dict(zip(inspect.signature(make).parameters, arguments, strict=True))
            return definition_of(f"{make.__module__}:{make.__qualname__}", named)
        except NoDefinitionError:
            return None

    def save(self, path: str | Path) -> Path:
        """Write what makes it again as an npz file: `lc.load` builds it, or finds it in the cache; returns the path.

        Raises:
            InputError: it has no definition.
            OutputFolderError, SystemRefusalError: the file cannot be written; what was there is untouched.
        """
        from lie_codegen.kernel.saved import save_definition

        return save_definition(self, path, f"the library {self.namespace}")

    def __reduce__(self) -> tuple[Any, ...]:
        if not self._recipe:
            raise TypeError(f"the library {self.namespace} was not made by lc.build and cannot be pickled")
        return _made_again, self._recipe

    def __copy__(self) -> Library:
        return self

    def __deepcopy__(self, _: Any) -> Library:
        return self

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, Library) and bool(self._recipe) and self._recipe == other._recipe)

    def __hash__(self) -> int:
        return hash((self.namespace, self.kernels))

    @property
    def build_log(self) -> tuple[str, ...]:
        """How it was built; asking compiles the lanes, if no batch has yet."""
        if self._lanes is None:
            return self._notes
        return (f"batches: {self._lanes()} samples at a time", *self._notes)

    def __getattr__(self, name: str) -> Compiled[Any]:
        kernels = self.__dict__.get("kernels", ())
        import difflib

        close = difflib.get_close_matches(name, kernels, n=3) if not name.startswith("_") else []
        hint = f"; near: {', '.join(close)}" if close else f"; it has {', '.join(kernels)}"
        raise AttributeError(f"the library {self.__dict__.get('namespace')} has no kernel {name!r}{hint}")

    def __getitem__(self, name: str) -> Compiled[Any]:
        if name not in self.kernels:
            raise KeyError(name)
        function: Compiled[Any] = getattr(self, name)
        return function

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.kernels})

    def __iter__(self) -> Iterator[str]:
        return iter(self.kernels)

    def __len__(self) -> int:
        return len(self.kernels)

    def __repr__(self) -> str:
        how = "compiled" if self.compiled else "interpreted"
        return f"<{how} library {self.namespace}: {', '.join(self.kernels)}>"


#: Libraries in use, by what makes them: one process builds and opens each once.
_LIVE: WeakValueDictionary[tuple[Any, ...], Library] = WeakValueDictionary()


def _made_again(*recipe: Any) -> Library:
    live = _LIVE.get(recipe)
    make, *arguments = recipe
    made: Library = live if live is not None else make(*arguments)
    return made


def require_kernels(library: Library, names: Iterable[str]) -> tuple[str, ...]:
    """The names, if the library has a kernel of each.

    Raises:
        InputError: naming those it has not, and those it has.
    """
    wanted = (names,) if isinstance(names, str) else tuple(names)
    unknown = [str(name) for name in wanted if name not in library.kernels]
    if unknown:
        has = ", ".join(library.kernels)
        raise InputError(f"no kernel {', '.join(unknown)} of {library.namespace}: it has {has}")
    return wanted


def check_names(signatures: Sequence[Signature]) -> None:
    """No kernel hides an attribute of the library.

    Raises:
        CodegenError: naming it.
    """
    for signature in signatures:
        if signature.name in Library.__annotations__ or hasattr(Library, signature.name):
            raise CodegenError(f"a kernel cannot be called {signature.name}: libraries have that attribute")
