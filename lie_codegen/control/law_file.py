"""Laws in files: a TOML description of a law, read as data.

law = "tracking"                        # any `<law>_law` of lie_codegen.control: tracking, attitude, integral, pointing, ...
group = "so3"                           # of laws on any group; the one asked for if missing
inertia = [1, 2, 3]                     # numbers, exact texts ("1/3"), or "input"
error = "so3_right"
gains = { K_p = [4, 5, 6], K_d = 6 }
name = "detumble"                       # optional, as every other argument of the function of that law
"""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Mapping
from decimal import Decimal
from importlib import import_module
from pathlib import Path
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.kernel import Kernel

#: What a law's function is called, behind the law's own name.
_SUFFIX = "_law"


def law_kinds() -> Mapping[str, Callable[..., Any]]:
    """The public laws of this folder: what a file calls it -> its function. A new one joins by its line in `__init__.pyi`."""
    control = import_module("lie_codegen.control")
    names = [name for name in control.__all__ if name.endswith(_SUFFIX) and name != "read_law"]
    return {name.removesuffix(_SUFFIX): getattr(control, name) for name in names}


def read_law(path: str | Path, group: GroupLike | None = None) -> Kernel:
    """The law that a TOML file describes: `law` says which, its other keys are the arguments of `lc.<law>_law`, with every number
    exact.

    Args:
        path: the file.
        group: of the law, if the file names none.

    Raises:
        InputError: no such file, no TOML, an unknown law or argument, another group than the file's, or what the law itself
            refuses; names the file.
    """
    table = _table(path)
    kind, laws = table.pop("law", None), law_kinds()
    if not isinstance(kind, str) or kind not in laws:
        raise InputError(f'{path}: law = {kind!r} is not known; write law = one of "{", ".join(sorted(laws))}"')
    make = laws[kind]
    known = set(inspect.signature(make).parameters)
    unknown = sorted(set(table) - known - {"group"})
    if unknown:
        raise InputError(
            f"{path}: a law of kind {kind!r} takes no {', '.join(unknown)}; it takes {', '.join(sorted(known))}"
        )
    own = table.pop("group", None)
    if own is not None and group is not None and as_group(own, "read_law") != as_group(group, "read_law"):
        raise InputError(f"{path}: a law on {own}, not on {as_group(group, 'read_law').name}")
    asked = own if own is not None else group
    if "group" in known:
        if asked is None:
            raise InputError(f'{path}: add group = "..." (a catalogue name or a file)')
        table["group"] = asked
    law = _made(path, make, table)
    if asked is not None and as_group(asked, "read_law").name != law.namespace:
        raise InputError(f"{path}: {kind} laws are laws on {law.namespace}")
    return law


def _table(path: str | Path) -> dict[str, Any]:
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"), parse_float=Decimal)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except (ValueError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None


def _made(path: str | Path, make: Callable[..., Any], table: Mapping[str, Any]) -> Kernel:
    """The kernel of the law; refusals begin with the file."""
    try:
        made = make(**{key: _exact(value) for key, value in table.items()})
    except TypeError as error:
        raise InputError(f"{path}: {error}") from None
    except InputError as error:
        raise type(error)(f"{path}: {error}") from None
    law: Kernel = made if isinstance(made, Kernel) else made.kernel
    return law


def _exact(value: Any) -> Any:
    """Decimals as the texts of the file, which the laws read exactly."""
    if isinstance(value, Decimal):
        return str(value)
    if isinstance(value, list):
        return [_exact(each) for each in value]
    return {key: _exact(each) for key, each in value.items()} if isinstance(value, dict) else value
