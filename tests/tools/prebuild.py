"""Write lie_codegen/prebuilt: the C sources of the catalogue's kernels. From the root: python -m tests.tools.prebuild

Groups whose sources are current are left alone; `--all` derives every one.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import os
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import lie_codegen as lc
from lie_codegen.groups.buildable import object_definition, source_definition
from lie_codegen.groups.catalogue_names import definition_source
from lie_codegen.groups.prebuilt import SHARED_STORE, TEMPLATES, file_digest, made_from_digest, prebuilt_folder, sealed
from lie_codegen.runtime.digests import digest, versions


def derived(name: str) -> dict[str, Any]:
    """The store of a group and the shared file, by a process of its own."""
    command = [sys.executable, "-m", "tests.tools.derive_traced", name]
    root = Path(__file__).resolve().parent.parent.parent
    # Without a cache: what is found there is not derived, and so not observed.
    environment = {**os.environ, "PYTHONPATH": str(Path(lc.__file__).parent.parent), "LIE_CODEGEN_CACHE": os.devnull}
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root, env=environment)
    data: dict[str, Any] = json.loads(done.stdout)
    return data


def definitions_of(name: str) -> list[str]:
    """The definitions by which a group of the catalogue is asked for: by its name, and as an object."""
    return [source_definition(definition_source(name)), object_definition(lc.group(name))]


def stale(folder: Path) -> list[str]:
    """The groups without a store made from what the package is now."""
    try:
        index = json.loads((folder / "index.json").read_bytes())
        stores = {name: unpack(folder / f"{name}.json.xz") for name in lc.group_names()}
        return [name for name, store in stores.items() if index["made_from"][name] != _made(store)]
    except (OSError, ValueError, LookupError, TypeError):
        return list(lc.group_names())


def _made(store: Any) -> str | None:
    return None if store is None else made_from_digest(store["made_from"])


def main() -> None:
    """Write what is not current."""
    folder = prebuilt_folder()
    folder.mkdir(exist_ok=True)
    names = list(lc.group_names())
    waiting = names if "--all" in sys.argv[1:] else stale(folder)
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for name, data in zip(waiting, pool.map(derived, waiting), strict=True):
            _write(folder / f"{name}.json.xz", data["store"])
            _write(folder / f"{SHARED_STORE}.json.xz", data["shared"])
    for path in folder.glob("*.json.xz"):
        if path.name.removesuffix(".json.xz") not in {*names, SHARED_STORE}:
            path.unlink()
    stores = {name: unpack(folder / f"{name}.json.xz") for name in names}
    files = sorted({f for store in stores.values() for f in store["made_from"]} | {f"templates/{f}" for f in TEMPLATES})
    index = {
        "written_with": versions(),
        "files": files,
        "sha256": file_digest(files),
        "made_from": {name: made_from_digest(store["made_from"]) for name, store in stores.items()},
        "stores": {name: _sha256(folder / f"{name}.json.xz") for name in (*names, SHARED_STORE)},
        "definitions": {digest(definition): name for name in names for definition in definitions_of(name)},
    }
    (folder / "index.json").write_text(json.dumps(sealed(index), indent=1, sort_keys=True) + "\n", encoding="utf-8")
    size = sum(path.stat().st_size for path in folder.iterdir())
    sys.stdout.write(f"{folder}: {len(names)} groups, {size / 1e3:.0f} kB; derived: {', '.join(waiting) or 'none'}\n")


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _write(path: Path, data: Mapping[str, Any]) -> None:
    """Write unless it holds the same already: the compressed bytes may differ from one liblzma to the next."""
    if not path.is_file() or unpack(path) != data:
        text = json.dumps(data, separators=(",", ":"))
        path.write_bytes(lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))


def unpack(path: Path) -> Any:
    """The content of a store; None if it is damaged."""
    try:
        return json.loads(lzma.decompress(path.read_bytes()))
    except (lzma.LZMAError, ValueError):
        return None


if __name__ == "__main__":
    main()
