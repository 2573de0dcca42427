"""The list of its files, with their digests, that a command keeps in a folder of its own.

Only what the list of the same command names, unchanged since, may be replaced: a folder that holds anything else is
refused before anything is computed.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path

from freqrail import files
from freqrail.errors import FileError, InputError

NAME = "freqrail-manifest.json"
LARGEST = 10_000_000  # bytes: a manifest has a hundred a file
_SHOWN = 5  # names in a message


def owned(folder: Path, command: str) -> dict[str, str]:
    """{name: SHA-256} of the files that `command` may replace in a folder; none if it is missing or empty.

    Raises InputError if it holds anything that an earlier run of the same command did not write, or that was changed
    since; FileError if it cannot be read.
    """
    try:
        if not folder.is_dir():
            return {}
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
        listed = _listed(folder, command) if any(entry.name == NAME for entry in entries) else {}
        strange, changed = [], []
        for entry in entries:
            if entry.name == NAME or files.is_leftover(Path(entry.path)):
                continue
            if entry.name not in listed or not entry.is_file(follow_symlinks=False):
                strange.append(entry.name)
            elif digest(Path(entry.path)) != listed[entry.name]:
                changed.append(entry.name)
    except OSError as fault:
        raise FileError(f"{folder}: this folder cannot be read: {fault.strerror or fault}") from None
    problems = []
    if strange:
        problems.append(
            f"{folder}: holds what this command did not write ({_names(strange)}); move it elsewhere, or name another "
            "folder with -o"
        )
    if changed:
        problems.append(
            f"{folder}: holds files that were changed since this command wrote them ({_names(changed)}); move them "
            "elsewhere, or name another folder with -o"
        )
    if problems:
        raise InputError(*problems)
    return listed


def record(folder: Path, command: str, listed: Mapping[str, str]) -> None:
    """Write the list of a folder's files. Raises OSError or FileError if it cannot be written."""
    text = json.dumps({"command": command, "files": dict(sorted(listed.items()))}, indent=2) + "\n"
    with files.replacing(folder / NAME) as path:
        path.write_text(text, encoding="utf-8")


def digest(path: Path) -> str:
    """SHA-256 of a file, as hex text."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _listed(folder: Path, command: str) -> dict[str, str]:
    path = folder / NAME
    if path.is_symlink():
        raise InputError(f"{path}: is a link, no list of freqrail's; name another folder with -o")
    try:
        found = json.loads(files.read(path, LARGEST))
        by, listed = found["command"], found["files"]
        if not all(isinstance(text, str) for text in (by, *listed, *listed.values())):
            raise TypeError
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise InputError(f"{path}: is damaged: no list of what freqrail wrote; name another folder with -o") from None
    if by != command:
        raise InputError(f"{folder}: is a folder of another command (freqrail {by}); name another with -o")
    return dict(listed)


def _names(found: list[str]) -> str:
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return ", ".join(found[:_SHOWN]) + more
