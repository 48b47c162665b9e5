"""Writing a generated tree: all of it or nothing, and never over a file that is not ours."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from lie_codegen.errors import OutputFolderError, write_refusal

#: The value of "generator" in manifest.json by which a folder is known as ours.
GENERATOR = "lie_codegen"
_MANIFEST = "manifest.json"


def write_package(tree: Mapping[str, str | bytes], folder: str | Path) -> Path:
    """Write {path: content} as `folder`, replacing an earlier generated package there; return its path.

    The tree is written to a temporary folder beside it, then renamed.

    Raises:
        OutputFolderError: the folder cannot be written, or holds a file that this package did not write
            or that was edited since; nothing is touched then.
        SystemRefusalError: the disk is full; nothing is touched.
    """
    if not isinstance(folder, str | os.PathLike):
        raise OutputFolderError(f"the folder to write must be a path, got {folder!r}")
    target = Path(folder).expanduser().absolute()
    target = target.resolve() if target.is_symlink() else target
    try:
        replaced = _owned_files(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise write_refusal(f"cannot write {folder}", error) from error
    try:
        _write_tree(tree, fresh)
        _swap(fresh, target, replaced)
    except OSError as error:
        raise write_refusal(f"cannot write {folder}", error) from error
    finally:
        _remove(fresh, tuple(tree))  # where it was not moved to its place
    return target


def _owned_files(target: Path) -> tuple[str, ...]:
    """The files of an existing folder, all proved ours."""
    if not target.exists():
        return ()
    if not target.is_dir():
        raise OutputFolderError(f"{target} is a file: choose a folder")
    present = sorted(
        Path(parent, name).relative_to(target).as_posix()
        for parent, folders, files in os.walk(target)
        for name in (*files, *(each for each in folders if Path(parent, each).is_symlink()))
    )
    if not present:
        return ()
    digests = _manifest_digests(target)
    if digests is None:
        raise OutputFolderError(
            f"{target} is not empty and is no package of ours (no {_MANIFEST} of {GENERATOR}): choose an empty folder"
        )
    foreign = [path for path in present if path not in digests and path != _MANIFEST]
    if foreign:
        raise OutputFolderError(f"{target} holds files that are not ours: {_some(foreign)}; move them away")
    edited = [path for path in present if path != _MANIFEST and _digest(target / path) != digests[path]]
    if edited:
        raise OutputFolderError(f"{target}: edited since they were generated: {_some(edited)}; move them away")
    return tuple(present)


def _manifest_digests(target: Path) -> dict[str, str] | None:
    try:
        data = json.loads((target / _MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(data, dict) or data.get("generator") != GENERATOR or not isinstance(data.get("files"), dict):
        return None
    return {str(path): str(digest) for path, digest in data["files"].items()}


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _some(paths: list[str]) -> str:
    return ", ".join(paths[:5]) + (f" and {len(paths) - 5} more" if len(paths) > 5 else "")


def _write_tree(tree: Mapping[str, str | bytes], folder: Path) -> None:
    mask = os.umask(0)  # the only way to read it
    os.umask(mask)
    folder.chmod(0o777 & ~mask)  # mkdtemp made it private
    for path, content in tree.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.encode() if isinstance(content, str) else content)


def _swap(fresh: Path, target: Path, replaced: tuple[str, ...]) -> None:
    """Put `fresh` where `target` is; what was there is removed file by file, so nothing else can go."""
    if not target.exists():
        fresh.rename(target)
        return
    shelter = Path(tempfile.mkdtemp(prefix=f".{target.name}.old.", dir=target.parent))
    old = shelter / target.name
    try:
        target.rename(old)
        try:
            fresh.rename(target)
        except BaseException:
            old.rename(target)
            raise
        _remove(old, replaced)
    finally:
        with contextlib.suppress(OSError):
            shelter.rmdir()


def _remove(folder: Path, files: tuple[str, ...]) -> None:
    """Remove these files and the folders they leave empty; whatever else is there stays."""
    with contextlib.suppress(OSError):
        for path in files:
            (folder / path).unlink(missing_ok=True)
        for parent, _, _ in os.walk(folder, topdown=False):
            os.rmdir(parent)
