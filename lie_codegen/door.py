"""The door of a subject: its public names, imported when first used, and nothing but errors of ours passes out through them; warnings point
at the line of the user's that called.

What a function was not written for (a text in place of an array, a number of 5,000 digits) fails somewhere inside, in NumPy or SymPy, with
a TypeError, a ValueError, an OverflowError ... At the door such an error becomes an `ArgumentError` that names the function and
what it was given, with the first error as its cause. What a function of the user raises passes as it is.
"""

from __future__ import annotations

import contextlib
import enum
import functools
import importlib
import sys
import threading
import types
import warnings
from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar

import lazy_loader

from lie_codegen.errors import ArgumentError, LieCodegenError, SubinterpreterError, SystemRefusalError
from lie_codegen.lost_parts import loses_parts, would_lose_parts
from lie_codegen.unbound import unbound

#: Packages whose frames belong to the work of a call: whatever else raises is the user's own.
_INSIDE = {
    "lie_codegen",
    "numpy",
    "scipy",
    "sympy",
    "mpmath",
    "casadi",
    "jinja2",
    "filelock",
    "platformdirs",
    "dask",
    "distributed",
    "zarr",
    "pyarrow",
    "xarray",
    "matplotlib",
    "PIL",
}
_LONGEST = 300

Result = TypeVar("Result")
Class = TypeVar("Class", bound=type)


def attach(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """(__getattr__, __dir__, __all__) of a subject with a stub beside it."""
    find, listed, names = lazy_loader.attach_stub(package, file)

    def found(name: str) -> Any:
        if is_subinterpreter():
            raise SubinterpreterError(
                f"{package}.{name}: NumPy and the compiled code serve the main interpreter of a process alone; "
                "use processes (lc.studies has a pool of them), or threads: compiled calls release the lock"
            )
        value = _guarded(find(name), name)
        sys.modules[package].__dict__[name] = value
        return value

    return found, listed, names


@functools.cache
def is_subinterpreter() -> bool:
    """Whether this is another interpreter than the first of its process."""
    for name in ("_interpreters", "_xxsubinterpreters"):  # of Python 3.13 and newer, and before
        with contextlib.suppress(ImportError):
            module = importlib.import_module(name)
            return bool(module.get_current() != module.get_main())
    return False


def _guarded(value: Any, name: str) -> Any:
    """The same value; a function is put behind the guard where it is defined too, of a class the constructor is."""
    if isinstance(value, types.FunctionType) and not hasattr(value, "__guarded__"):
        guarded = _guard(value, name)
        home = sys.modules[value.__module__].__dict__
        if home.get(name) is value:
            home[name] = guarded
        return guarded
    if isinstance(value, type) and not issubclass(value, enum.Enum):
        constructor = getattr(value, "__init__")  # noqa: B009  its own or one that it inherits, which then becomes its own
        if isinstance(constructor, types.FunctionType) and not hasattr(constructor, "__guarded__"):
            type.__setattr__(value, "__init__", _guard(constructor, name, bound=True))
    return value


def guard_methods(kind: Class) -> Class:
    """The same class, its public methods behind the guard for whoever calls them from outside: results are asked after the door, too.

    Between our own functions errors pass as they are, for these catch what they expect.
    """
    for name, value in list(vars(kind).items()):
        if name.startswith("_") and name != "__call__":
            continue
        wrapped = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if isinstance(wrapped, types.FunctionType) and not hasattr(wrapped, "__guarded__"):
            shown = kind.__name__ if name == "__call__" else f"{kind.__name__}.{name}"
            guarded = _guard(wrapped, shown, from_outside=True, bound=not isinstance(value, staticmethod))
            type.__setattr__(kind, name, guarded if wrapped is value else type(value)(guarded))
    return kind


def _guard(
    function: Callable[..., Any], name: str, *, from_outside: bool = False, bound: bool = False
) -> Callable[..., Any]:
    @functools.wraps(function)
    def guarded(*args: Any, **named: Any) -> Any:
        try:
            if would_lose_parts(args[1:] if bound else args, named):
                raise ArgumentError(
                    f"{name}: an array has masked entries, which are no numbers; fill them (.filled(...))"
                )
            return function(*args, **named)
        except LieCodegenError:
            raise
        except Exception as error:
            if (from_outside and _root(sys._getframe(1)) == "lie_codegen") or not _is_inside(error):
                raise
            if isinstance(error, TypeError) and (refusal := unbound(function, name, args, named)) is not None:
                raise ArgumentError(refusal) from None
            if loses_parts(error):
                raise ArgumentError(
                    f"{name}: complex numbers where real ones are asked for; give their real part (.real) if that is meant"
                ) from error
            kind = SystemRefusalError if isinstance(error, OSError | MemoryError) else ArgumentError
            shown = args[1:] if bound else args
            raise kind(f"{name}: {_given(shown, named)}: {type(error).__name__}: {_text(error)}") from error

    guarded.__guarded__ = True  # type: ignore[attr-defined]
    return guarded


_given_warnings = [0]


def warnings_given() -> int:
    """How many times this process has warned, heard or not: what was warned of is made again every time, and warned of again."""
    return _given_warnings[0]


#: A line of code: its file, its number, the globals of its module.
_Place: TypeAlias = tuple[str, int, dict[str, Any]]
_behalf = threading.local()


def warn_caller(message: str, category: type[Warning]) -> None:
    """Warn at the line of the user's code that led here, however many functions of ours lie between (a stacklevel would have to count them)."""
    _given_warnings[0] += 1
    file, line, there = _place_of_caller()
    registry = there.setdefault("__warningregistry__", {})
    warnings.warn_explicit(message, category, file, line, str(there.get("__name__", "<string>")), registry)


def on_behalf(function: Callable[..., Result]) -> Callable[..., Result]:
    """The function for a thread of ours, which holds no frame of the user's: it warns at the line that led to this call."""
    place = _place_of_caller()

    @functools.wraps(function)
    def run(*args: Any, **named: Any) -> Result:
        _behalf.place = place
        try:
            return function(*args, **named)
        finally:  # the thread of a pool serves others after this
            del _behalf.place

    return run


def _place_of_caller() -> _Place:
    """The nearest line that is not ours, of Python's own library or of what we compute with; that which started a thread of ours.

    The outermost if there is none.
    """
    frame = sys._getframe(1)
    while _belongs_inside(frame) and frame.f_back is not None:
        frame = frame.f_back
    if _belongs_inside(frame) and hasattr(_behalf, "place"):
        place: _Place = _behalf.place
        return place
    return frame.f_code.co_filename, frame.f_lineno, frame.f_globals


def _is_inside(error: Exception) -> bool:
    """Whether every frame the error came through is inside."""
    trace = error.__traceback__
    while trace is not None:
        if not _belongs_inside(trace.tb_frame):
            return False
        trace = trace.tb_next
    return True


def _belongs_inside(frame: types.FrameType) -> bool:
    """Whether a frame is ours, of Python's own library or of what we compute with; code made by lambdify has no module."""
    root = _root(frame)
    return not root or root in _INSIDE or root in sys.stdlib_module_names


def _root(frame: types.FrameType) -> str:
    """The package of a frame's module."""
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


def _given(args: tuple[Any, ...], named: dict[str, Any]) -> str:
    kinds = [type(value).__name__ for value in args] + [f"{key}={type(value).__name__}" for key, value in named.items()]
    return f"cannot work with what was given ({', '.join(kinds)})"


def _text(error: Exception) -> str:
    text = str(error)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
