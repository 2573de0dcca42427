"""Finished blocks of a sweep, kept beside its target until the file is complete.

A SQLite database of one meta row, which says what sweep the blocks are of, and a row a block with the
hash of its bytes. Every block is on the disk before the next is counted as done, so that a run that is killed, or
that fills the disk, loses the block at work and nothing else.
"""

from __future__ import annotations

import contextlib
import hashlib
import sqlite3
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from freqrail.errors import FileError, FreqrailWarning, InputError
from freqrail.files import check_beside

_TABLES = """
create table meta (identity text not null);
create table block (key text primary key, digest text not null, data blob not null);
"""


def journal_path(target: Path) -> Path:
    """Where the journal of a target lies."""
    return target.with_name(f".{target.name}.journal")


@dataclass(frozen=True)
class Journal:
    """An open journal. keys: the blocks that were found whole when it was opened."""

    path: Path
    keys: frozenset[str]
    _database: sqlite3.Connection

    @classmethod
    @contextlib.contextmanager
    def open(cls, target: Path, identity: str, resume: bool) -> Iterator[Journal]:
        """The journal of `target`, for the sweep with this identity; a context that closes it.

        resume: take over the blocks that an earlier run of the same sweep left; else any journal is begun afresh.
        Raises InputError if a journal to resume is of another sweep or damaged, FileError if it cannot be written, or
        if a file that is no journal stands in its place.
        """
        path = journal_path(target)
        check_beside(path, "the journal")
        check_beside(_sqlite_own(path), "the journal")
        if not resume and path.exists():
            if not _is_journal(path):
                raise FileError(f"{path}: is in the way of the journal, and none of freqrail's; remove it")
            remove(path)
            warnings.warn(
                f"{path}: an interrupted run left this journal; started afresh, --resume would have gone on",
                FreqrailWarning,
                stacklevel=2,
            )
        there = path.exists()
        try:
            database = sqlite3.connect(path, isolation_level=None)
        except sqlite3.Error as fault:
            raise FileError(f"{path}: the journal cannot be opened: {fault}") from None
        with contextlib.closing(database):
            try:
                database.execute("pragma journal_mode = delete")
                database.execute("pragma synchronous = full")
                keys = _whole_blocks(database, path, identity) if there else _begin(database, identity)
            except sqlite3.DatabaseError as fault:
                if there and not isinstance(fault, sqlite3.OperationalError):
                    raise InputError(
                        f"--resume: {path}: damaged ({fault}); remove it and leave out --resume to start afresh"
                    ) from None
                raise FileError(f"{path}: the journal cannot be written: {fault}") from None
            try:
                yield cls(path, keys, database)
            except BaseException:
                with contextlib.suppress(sqlite3.Error):
                    if not database.execute("select count(*) from block").fetchone()[0]:
                        remove(path)  # nothing to resume
                raise

    def keep(self, key: str, data: bytes) -> None:
        """Add a finished block. Raises FileError if the disk does not take it."""
        try:
            self._database.execute("insert or replace into block values (?, ?, ?)", (key, _hash(data), data))
        except sqlite3.Error as fault:
            raise FileError(
                f"{self.path}: a finished block cannot be kept: {fault}; the journal holds those before it: "
                "make room and go on with --resume"
            ) from None

    def read(self, key: str) -> bytes:
        """The bytes of a block that was kept. Raises FileError if they are not those that were written."""
        try:
            row = self._database.execute("select digest, data from block where key = ?", (key,)).fetchone()
        except sqlite3.Error as fault:
            raise FileError(f"{self.path}: a finished block cannot be read back: {fault}") from None
        if row is None or _hash(row[1]) != row[0]:
            raise FileError(f"{self.path}: a finished block is damaged: go on with --resume, which computes it anew")
        return bytes(row[1])

    def discard(self) -> None:
        """Remove the journal: its target is complete."""
        self._database.close()
        remove(self.path)


def remove(path: Path) -> None:
    """Delete a journal and what SQLite left beside it, if they are there."""
    for each in (path, _sqlite_own(path)):
        each.unlink(missing_ok=True)


def _sqlite_own(path: Path) -> Path:
    """Where SQLite keeps what it needs to undo a change of a journal that was cut short."""
    return path.with_name(path.name + "-journal")


def _is_journal(path: Path) -> bool:
    """Whether a file is a journal that a run left, and not somebody's file of that name; empty if killed at once."""
    try:
        with contextlib.closing(sqlite3.connect(path)) as database:
            tables = {row[0] for row in database.execute("select name from sqlite_master where type = 'table'")}
    except sqlite3.Error:
        return False
    return tables in (set(), {"meta", "block"})


def _begin(database: sqlite3.Connection, identity: str) -> frozenset[str]:
    database.executescript(f"begin; {_TABLES}")
    database.execute("insert into meta values (?)", (identity,))
    database.execute("commit")
    return frozenset()


def _whole_blocks(database: sqlite3.Connection, path: Path, identity: str) -> frozenset[str]:
    """Keys of the blocks whose hash holds. A run killed before its first commit left an empty database."""
    if not database.execute("select count(*) from sqlite_master").fetchone()[0]:
        return _begin(database, identity)
    found = [row[0] for row in database.execute("select identity from meta")]
    if found != [identity]:
        raise InputError(
            f"--resume: {path}: it is of another case, grid, responses or version of freqrail or numpy; "
            "leave out --resume to start afresh"
        )
    return frozenset(
        key for key, digest, data in database.execute("select key, digest, data from block") if _hash(data) == digest
    )


def _hash(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=32).hexdigest()
