"""Laws in files: a TOML description of a law, read as data.

law = "tracking"                        # tracking, attitude or integral
group = "so3"                           # of tracking and integral laws; the one asked for if missing
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
from pathlib import Path
from typing import Any

from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.integral_law import integral_law
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.kernel import Kernel

_LAWS: Mapping[str, Callable[..., Kernel]] = {
    "tracking": tracking_law,
    "attitude": attitude_law,
    "integral": integral_law,
}


def read_law(path: str | Path, group: GroupLike | None = None) -> Kernel:
    """The law that a TOML file describes: `law` says which, its other keys are the arguments of `tracking_law`, `attitude_law` or
    `integral_law`, with every number exact.

    Args:
        path: the file.
        group: of the law, if the file names none.

    Raises:
        InputError: no such file, no TOML, an unknown law or argument, another group than the file's, or what the law itself
            refuses; names the file.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"), parse_float=Decimal)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except (ValueError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    kind = table.pop("law", None)
    if kind not in _LAWS:
        raise InputError(f'{path}: law = {kind!r} is not known; write law = one of "{", ".join(_LAWS)}"')
    make = _LAWS[kind]
    known = set(inspect.signature(make).parameters)
    unknown = sorted(set(table) - known - {"group"})
    if unknown:
        raise InputError(
            f"{path}: a law of kind {kind!r} takes no {', '.join(unknown)}; it takes {', '.join(sorted(known))}"
        )
    own = table.pop("group", None)
    if own is not None and group is not None and as_group(own, "read_law") != as_group(group, "read_law"):
        raise InputError(f"{path}: a law on {own}, not on {as_group(group, 'read_law').name}")
    if kind == "attitude":
        if group is not None and as_group(group, "read_law").name != "so3":
            raise InputError(f"{path}: attitude laws are laws on so3")
    elif own is None and group is None:
        raise InputError(f'{path}: add group = "..." (a catalogue name or a file)')
    else:
        table["group"] = own if own is not None else group
    try:
        return make(**{key: _exact(value) for key, value in table.items()})
    except TypeError as error:
        raise InputError(f"{path}: {error}") from None
    except InputError as error:
        raise type(error)(f"{path}: {error}") from None


def _exact(value: Any) -> Any:
    """Decimals as the texts of the file, which the laws read exactly."""
    if isinstance(value, Decimal):
        return str(value)
    if isinstance(value, list):
        return [_exact(each) for each in value]
    return {key: _exact(each) for key, each in value.items()} if isinstance(value, dict) else value
