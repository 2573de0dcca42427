"""Files as this program reads and replaces them: regular ones only, and whole or not at all.

A file is written in a folder of its own beside its target, made exclusively, so that nobody's file or link in the way
is written to, and put in the target's place only when it is whole.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

from freqrail.errors import FileError

_UNFINISHED = "unfinished"  # stem of the file in the folder beside a target
_LONGEST_SUFFIX = len(b"..journal-journal")  # what the names of the files beside a target add to its own
_IN_THE_WAY = "is in the way of a temporary file, and none of freqrail's; remove it"
_OPEN_FILES = Path("/proc/self/fd")


def read(path: str | os.PathLike[str], most: int = -1) -> bytes:
    """The first `most` bytes of a regular file, or all of them.

    Raises OSError for one that cannot be read or is not regular: a pipe or device might keep its reader waiting for
    ever. So do some files of /proc, whose size is 0; they count as empty.
    """
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "is not a regular file")
        if not status.st_size:
            return b""
        with os.fdopen(handle, "rb", closefd=False) as stream:
            return stream.read(most)
    finally:
        os.close(handle)


# --- names that the NetCDF library does not take ---------------------------------------------------


def _is_plain(path: Path) -> bool:
    """Whether the NetCDF library finds a file of this name: UTF-8, and no backslash, which it takes for Windows'."""
    text = os.path.abspath(path)
    try:
        os.fsdecode(text.encode("utf-8"))
    except UnicodeError:
        return False
    return os.name == "nt" or "\\" not in text


@contextlib.contextmanager
def spelled(path: Path) -> Iterator[Path]:
    """The path of a file or folder that is there, spelled so that the NetCDF library finds it."""
    if _is_plain(path):
        yield Path(os.path.abspath(path))
        return
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    try:
        yield _OPEN_FILES / str(handle)
    finally:
        os.close(handle)


def check_name(target: Path) -> None:
    """Raise FileError for an output that cannot be written under this name, before anything is computed."""
    if len(os.fsencode(target.name)) + _LONGEST_SUFFIX > _longest_name(target.parent):
        raise FileError(f"{target}: this name is too long with those of the files beside it; name a shorter one")
    folder = _folder_beside(target)
    if os.path.lexists(folder) and not is_leftover(folder):
        raise FileError(f"{folder}: {_IN_THE_WAY}")
    if not _is_plain(target) and not _OPEN_FILES.is_dir():
        raise FileError(f"{target}: a backslash, or bytes that are not UTF-8, in the path; name another with -o")


def _longest_name(folder: Path) -> int:
    try:
        return os.pathconf(folder, "PC_NAME_MAX")
    except (AttributeError, OSError, ValueError):  # where there is no such thing
        return 255


# --- files beside a target ---------------------------------------------------------------------------


def check_beside(path: Path, what: str, empty: bool = False) -> None:
    """Raise FileError if something else stands where a regular (and empty) file beside a target belongs: a link."""
    try:
        status = path.lstat()
    except OSError:  # not there, or told of when it is opened
        return
    if not stat.S_ISREG(status.st_mode) or (empty and status.st_size):
        raise FileError(f"{path}: is in the way of {what}, and none of freqrail's; remove it")


@contextlib.contextmanager
def replacing(target: Path, ready: Callable[[Path], object] = lambda whole: None) -> Iterator[Path]:
    """Where to write a file that takes the target's place when the block ends without an exception.

    ready: called with it when it is whole, just before. Raises FileError if something that no run of this program left
    stands in the way, OSError for what the disk does not take; the target is then what it was before.
    """
    folder = _folder_beside(target)
    unfinished = folder / f"{_UNFINISHED}{target.suffix}"
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        if not is_leftover(folder):
            raise FileError(f"{folder}: {_IN_THE_WAY}") from None
        shutil.rmtree(folder)
        folder.mkdir(mode=0o700)
    try:
        with spelled(folder) as place:
            yield place / unfinished.name
        _flush(unfinished)
        ready(unfinished)
        os.replace(unfinished, target)
        flush_folder(target.parent)
    finally:
        unfinished.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            folder.rmdir()


def _folder_beside(target: Path) -> Path:
    return target.with_name(f".{target.name}.partial")


def is_leftover(folder: Path) -> bool:
    """Whether a path is the folder of an unfinished file that a killed run left, and holds nothing else: no link."""
    if not (folder.name.startswith(".") and folder.name.endswith(".partial")):
        return False
    status = folder.lstat()
    own = not hasattr(os, "geteuid") or status.st_uid == os.geteuid()
    return stat.S_ISDIR(status.st_mode) and own and all(map(_is_unfinished, folder.iterdir()))


def _is_unfinished(path: Path) -> bool:
    return path.stem == _UNFINISHED and stat.S_ISREG(path.lstat().st_mode)


def _flush(path: Path) -> None:
    """Have the system write a file, or the entries of a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)  # Windows flushes what may be written only
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def flush_folder(folder: Path) -> None:
    """Have the disk know the names in a folder, where the system can: Windows opens no folder."""
    with contextlib.suppress(PermissionError):
        _flush(folder)
