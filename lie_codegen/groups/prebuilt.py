"""C sources of the catalogue's kernels that ship with the package: neither SymPy nor CasADi is needed to build them.

    prebuilt/index.json        digest of a definition -> name; name -> digest of what its sources are made from
    prebuilt/<name>.json.xz    the sources of each kernel of the group; the functions of the package that ran to make them
    prebuilt/lanes.json.xz     the file they all include

What was made by other code than this package's, or of another definition, is not used; what is damaged is not either, after a warning. Written by tests/tools/prebuild.py.
Each group is judged by itself, by the functions that ran (codegen/made_from.py). That takes a fifth of a second, and is
not done where all files are, to the byte, those at the time of writing, as in an installed package.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lie_codegen.runtime.degraded import warn_degraded
from lie_codegen.runtime.digests import digest

if TYPE_CHECKING:
    from lie_codegen.codegen.library_sources import LibrarySources

#: The file that every kernel includes, and the name it is stored by.
SHARED, SHARED_STORE = "lie_codegen_lanes.h", "lanes"
#: What becomes C text beside the functions.
TEMPLATES = (
    "binding.c.jinja",
    "far_routine.c.jinja",
    "header.h.jinja",
    "lanes.h.jinja",
    "lanes_records.h.jinja",
    "log_routine.c.jinja",
    "macros.jinja",
    "source.c.jinja",
)
_NOT_USED = "the C that ships with the package is damaged and not used: groups are derived again (the same results, seconds later; install it anew)"
_PACKAGE = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Prebuilt:
    """The kernels of one group.

    Attributes:
        namespace: prefix of the C symbols.
        kernels: names, in order.
    """

    namespace: str
    kernels: tuple[str, ...]
    _data: Mapping[str, Any]
    _shared: Mapping[str, str]

    def sources(self, name: str) -> LibrarySources:
        """The C text of one kernel."""
        from lie_codegen.codegen.library_sources import LibrarySources

        own = LibrarySources.from_json(self._data[name])
        return replace(own, files={**own.files, **self._shared})


def find_prebuilt(definition: str, folder: Path | None = None) -> Prebuilt | None:
    """The sources of that definition; None where there are none, or none that are current and whole."""
    home = prebuilt_folder() if folder is None else folder
    if not (home / "index.json").is_file():
        return None
    try:
        index = _read_index(home)
        name = index["definitions"].get(digest(definition))
        if name is None:
            return None
        data, shared = (_unpacked(home, each, index["stores"][each]) for each in (name, SHARED_STORE))
        found = Prebuilt(str(data["namespace"]), tuple(data["kernels"]), data["kernels"], shared)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ImportError) as error:
        warn_degraded(_NOT_USED, str(error))
        return None
    try:
        if file_digest(index["files"]) == index["sha256"]:
            return found
        return found if made_from_digest(data["made_from"]) == index["made_from"][name] else None
    except (OSError, LookupError, TypeError, AttributeError, ImportError, SyntaxError):
        return None


def sealed(index: Mapping[str, Any]) -> dict[str, Any]:
    """The index with a digest of itself: one changed character, and another group's C might be taken for that of a definition."""
    plain = {name: value for name, value in index.items() if name != "seal"}
    return {**plain, "seal": digest(plain)}


def _read_index(home: Path) -> Any:
    index = json.loads((home / "index.json").read_bytes())
    if not isinstance(index, dict) or sealed(index) != index:
        raise ValueError("prebuilt/index.json is not as it was written")
    return index


def prebuilt_folder() -> Path:
    """Where they are in the installed package."""
    return _PACKAGE / "prebuilt"


def file_digest(files: Iterable[str]) -> str:
    """Digest of the bytes of files of the package, given by their paths in it; templates by theirs after "templates/".

    Raises:
        OSError: one is not there.
    """
    from lie_codegen.codegen.templates import template_folder

    summary = hashlib.sha256()
    for name in files:
        path = template_folder() / name.removeprefix("templates/") if name.startswith("templates/") else _PACKAGE / name
        content = path.read_bytes()
        summary.update(f"{name}\0{len(content)}\0".encode())
        summary.update(content)
    return summary.hexdigest()


def made_from_digest(ran: Mapping[str, Sequence[str]]) -> str:
    """Digest of the functions {module file: [those that ran]} and of the templates.

    Raises:
        OSError: a file is not there.
        SyntaxError: a file is not Python.
    """
    from lie_codegen.codegen.made_from import source_digest

    return digest([source_digest(_PACKAGE, ran), file_digest(f"templates/{name}" for name in TEMPLATES)])


def _unpacked(home: Path, name: str, expected: str) -> Any:
    import lzma

    packed = (home / f"{name}.json.xz").read_bytes()
    if hashlib.sha256(packed).hexdigest() != expected:
        raise ValueError(f"prebuilt/{name}.json.xz is not what the index says")
    try:
        return json.loads(lzma.decompress(packed))
    except lzma.LZMAError as error:
        raise ValueError(str(error)) from error
