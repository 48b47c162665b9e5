"""Writing files whole: whatever fails or is killed in between, a reader finds the old file or the new one, never a part of one.

What is written goes to a temporary file beside its place, to the disk, and takes the place in one step (rename).
"""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from lie_codegen.errors import write_refusal

#: How names of temporary files begin; a killed process may leave one.
BEGUN = ".new-"
#: Characters of a name that are kept in that of the temporary file, which must not be longer than a folder takes (255 bytes, 4 a character).
_KEPT = 40


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """Put the content in the file, UTF-8 if it is a text; returns the path.

    Raises:
        OutputFolderError: the place cannot be written; what was there is untouched.
        SystemRefusalError: the disk is full; what was there is untouched.
    """
    target = Path(path)
    try:
        with whole_file(target) as fresh:
            fresh.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise write_refusal(f"{target} cannot be written", error) from error
    return target


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A file of the same ending to write to: it takes the path's place if the block ends well, and goes if not.

    It is on the disk before it takes the place, so that a power failure leaves no empty file. A symbolic link stays, and the file that it leads
    to is replaced; a device or a pipe is written as it is, for nothing can take its place.

    Raises:
        OSError: it cannot be written; what was there is untouched.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        yield target
        return
    if target.exists() and not os.access(target, os.W_OK):  # a rename would not ask
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))
    mode = target.stat().st_mode & 0o7777 if target.exists() else 0o666 & ~_mask()
    with private_file(target) as fresh:
        yield fresh
        _settle(fresh)
        fresh.chmod(mode)


@contextlib.contextmanager
def private_file(target: Path) -> Iterator[Path]:
    """As `whole_file`, for what can be made again and is its user's alone, as the files of a cache: no wait for the disk, no rights for others,
    and a link in its place is replaced, not followed.

    Raises:
        OSError: it cannot be written; what was there is untouched.
    """
    import tempfile

    descriptor, name = tempfile.mkstemp(
        prefix=f"{BEGUN}{target.stem[:_KEPT]}.", suffix=target.suffix[:_KEPT], dir=target.parent
    )
    os.close(descriptor)
    try:
        yield Path(name)
        os.replace(name, target)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise


def _settle(file: Path) -> None:
    """Wait until what was written lies on the disk; a full disk may say so only here."""
    descriptor = os.open(file, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _mask() -> int:
    mask = os.umask(0)  # the only way to read it
    os.umask(mask)
    return mask
