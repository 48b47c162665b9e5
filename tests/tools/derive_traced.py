"""Derive a group's kernels as C and see which functions of the package ran: python -m tests.tools.derive_traced so3

Prints JSON: the group's store with "made_from" = {module file: [functions that ran]}, and the file that all kernels include.
A process of its own, so that no earlier group's memo hides a function; nothing of the package is imported before the
observer is on, for functions that imports run count too.
"""

from __future__ import annotations

import inspect
import json
import os
import sys
import threading
from types import CodeType, FrameType
from typing import Any


def store_of(name: str) -> tuple[dict[str, Any], dict[str, str]]:
    """What is kept of a group of the catalogue but for "made_from", and the file that all kernels include."""
    from lie_codegen.codegen.package import render_library
    from lie_codegen.groups.catalogue_load import group
    from lie_codegen.groups.kernels import group_kernels
    from lie_codegen.groups.prebuilt import SHARED

    kernels: dict[str, Any] = {}
    shared: dict[str, str] = {}
    for kernel in group_kernels(group(name)):
        data = json.loads(json.dumps(render_library(name, [kernel]).to_json()))
        shared = {SHARED: data["files"].pop(SHARED)}
        kernels[kernel.name] = data
    return {"namespace": name, "kernels": kernels}, shared


def functions_by_file(codes: set[CodeType], home: str) -> dict[str, list[str]]:
    """The functions among them, by file below `home`; a module that ran none has an empty list."""
    found: dict[str, set[str]] = {}
    for code in codes:
        if code.co_filename.startswith(home):
            names = found.setdefault(code.co_filename.removeprefix(home).replace(os.sep, "/"), set())
            function = code.co_qualname.split(".<locals>")[0]
            # A class's body is no function, nor is a lambda or comprehension of a module: statements, which count anyway.
            if code.co_flags & inspect.CO_OPTIMIZED and "<" not in function:
                names.add(function)
    return {file: sorted(names) for file, names in sorted(found.items())}


def main(name: str) -> None:
    """Write the JSON to standard output."""
    seen: set[CodeType] = set()

    def observe(frame: FrameType, _event: str, _argument: Any) -> None:
        seen.add(frame.f_code)

    threading.settrace(observe)
    sys.settrace(observe)
    store, shared = store_of(name)
    sys.settrace(None)
    import lie_codegen

    home = os.path.dirname(os.path.abspath(lie_codegen.__file__)) + os.sep
    json.dump({"store": {**store, "made_from": functions_by_file(seen, home)}, "shared": shared}, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
