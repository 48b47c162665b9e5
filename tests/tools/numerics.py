"""Whether the numerics version has to rise: the arithmetic of the catalogue's kernels against that of the last release.

python -m tests.tools.numerics             says which groups compute otherwise
python -m tests.tools.numerics --release   at a release: writes what is now to tests/codegen/numerics.json
"""

from __future__ import annotations

import hashlib
import json
import lzma
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lie_codegen.codegen.numerics import NUMERICS_VERSION
from lie_codegen.groups.prebuilt import prebuilt_folder

RECORD = Path(__file__).resolve().parents[1] / "codegen" / "numerics.json"
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


def arithmetic(text: str) -> str:
    """C text without comments and with one space for any: what can change the bits of a result."""
    return " ".join(_COMMENT.sub(" ", text).split())


def digests() -> dict[str, str]:
    """Group -> digest of the sources of its kernels, scalar and in lanes, as they ship; "lanes" are the functions they share."""
    found = {}
    for path in sorted(prebuilt_folder().glob("*.json.xz")):
        store: Any = json.loads(lzma.decompress(path.read_bytes()))
        kernels = {name: kernel["files"] for name, kernel in store.get("kernels", {"lanes": {"files": store}}).items()}
        texts = {name: {file: arithmetic(text) for file, text in files.items()} for name, files in kernels.items()}
        found[path.name.removesuffix(".json.xz")] = hashlib.sha256(
            json.dumps(texts, sort_keys=True).encode()
        ).hexdigest()
    return found


def verdict(released: Mapping[str, Any], now: Mapping[str, str], version: int) -> str:
    """What is wrong with the version, or an empty text.

    A group that is new or gone asks for nothing: nobody's bits have changed.
    """
    changed = sorted(name for name, value in released["digests"].items() if now.get(name, value) != value)
    due = released["version"] + bool(changed)
    if changed and version < due:
        return (
            f"the generated arithmetic of {', '.join(changed)} is not that of the release with numerics version "
            f"{released['version']}: set NUMERICS_VERSION = {due} in lie_codegen/codegen/numerics.py, and say so in CHANGELOG.md"
        )
    if version > released["version"] + 1 or version < released["version"]:
        return f"NUMERICS_VERSION is {version}; after a release with {released['version']} it is that or one more"
    return ""


def main() -> None:
    """Says, or writes."""
    if "--release" in sys.argv[1:]:
        RECORD.write_text(
            json.dumps({"version": NUMERICS_VERSION, "digests": digests()}, indent=1) + "\n", encoding="utf-8"
        )
        return
    said = verdict(json.loads(RECORD.read_text(encoding="utf-8")), digests(), NUMERICS_VERSION)
    print(said or f"numerics version {NUMERICS_VERSION} is right")  # noqa: T201
    sys.exit(bool(said))


if __name__ == "__main__":
    main()
