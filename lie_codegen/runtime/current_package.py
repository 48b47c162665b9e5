"""Is a generated folder what would be generated now? Known by its definition, without deriving anything.

When a package is written, the digest of its definition (with that of this package's own source) is noted in the cache beside the
digests of the files. A folder that holds just those files, byte for byte, is current.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path
from typing import Any

from lie_codegen.errors import CacheError
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import usable_folder
from lie_codegen.runtime.digests import digest, package_digest, templates_digest, versions


def package_key(request: Any) -> str:
    """The digest of a request (plain data), of this package's source and templates, and of what it computes with."""
    return digest(["package", request, package_digest(), templates_digest(), versions()])


def current_package(key: str | None, folder: str | Path) -> Path | None:
    """The folder, if what it holds was written for that key; None if it was not or nobody knows."""
    if key is None or not isinstance(folder, str | os.PathLike):
        return None
    target = Path(folder).expanduser().absolute()
    target = target.resolve() if target.is_symlink() else target
    with contextlib.suppress(OSError, CacheError):
        if cache.find_note(usable_folder(), key) == _digests(target):
            return target
    return None


def remember_package(key: str | None, folder: Path) -> None:
    """Note that the folder holds what belongs to the key."""
    if key is not None:
        with contextlib.suppress(OSError, CacheError):
            cache.store_note(usable_folder(), key, _digests(folder))


def _digests(folder: Path) -> dict[str, str]:
    """{path in the folder: SHA-256} of every file."""
    files = (Path(parent, name) for parent, _, names in os.walk(folder) for name in names)
    return {file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}
