"""Where compiled libraries are kept: a folder that only its user can write, else none."""

from __future__ import annotations

import atexit
import os
import shutil
import stat
from functools import cache
from pathlib import Path

from lie_codegen.door import warn_caller
from lie_codegen.errors import CacheError, CacheWarning


def cache_folder() -> Path:
    """$LIE_CODEGEN_CACHE, or the user's cache folder of the platform; it may not exist yet."""
    override = os.environ.get("LIE_CODEGEN_CACHE", "").strip()
    if override:
        return Path(override).expanduser().absolute()
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("lie_codegen"))


def why_unusable(folder: Path) -> str | None:
    """Create the folder if need be; the reason it cannot be trusted, or None.

    Code is loaded from it, so nobody else may be able to write there.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except OSError as error:
        return error.strerror or str(error)
    if not stat.S_ISDIR(status.st_mode):
        return "it is not a folder"
    if hasattr(os, "getuid"):
        if status.st_uid != os.getuid():
            return f"it belongs to user {status.st_uid}, not to you ({os.getuid()})"
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return f"others may write to it (mode {stat.S_IMODE(status.st_mode):o}); chmod 700 it"
    return None


#: {folder: why} whose libraries the system did not load in this process, as on a disk mounted noexec.
_not_loaded: dict[Path, str] = {}


def usable_folder() -> Path:
    """The cache folder, or after one warning a private temporary folder that goes with the process.

    Raises:
        CacheError: there is neither.
    """
    folder = cache_folder()
    reason = _not_loaded.get(folder) or why_unusable(folder)
    return folder if reason is None else temporary_folder(f"the cache folder {folder} cannot be used: {reason}")


def note_not_loaded(library: Path, why: str) -> bool:
    """Take a temporary folder from now on, where it was a library of the cache folder that could not be loaded; whether it was."""
    folder = cache_folder()
    if folder not in library.parents or folder in _not_loaded:
        return False
    _not_loaded[folder] = f"the system loads no library from it ({why}); is it mounted noexec?"
    return True


def temporary_folder(reason: str) -> Path:
    """The private temporary folder of this process, after a warning that says why it is needed.

    Raises:
        CacheError: none can be made.
    """
    _warn_once(reason)
    folder = _temporary()
    if not folder.is_dir():  # someone cleaned up
        _temporary.cache_clear()
        folder = _temporary()
    return folder


@cache
def _warn_once(reason: str) -> None:
    warn_caller(
        f"{reason}. What is compiled now is lost with this process; set LIE_CODEGEN_CACHE to a folder of your own.",
        CacheWarning,
    )


@cache
def _temporary() -> Path:
    import tempfile

    try:
        folder = Path(tempfile.mkdtemp(prefix="lie_codegen-"))
    except OSError as error:
        raise CacheError(f"no folder to compile in: the temporary folder {tempfile.gettempdir()}: {error}") from error
    atexit.register(_remove, folder, os.getpid())
    return folder


def _remove(folder: Path, owner: int) -> None:
    """A child of `os.fork` leaves it to its parent, which made it and may go on using it."""
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
