"""Checks a file of a recording before the library opens it, and refuses what would exhaust it."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from lab3_usd.errors import RecordingError
from lab3_usd.sim.bag import limits

MOST_RECORDS = 100_000  # in the index of an MCAP file: chunks, topics, statistics
_ODD = set("%?#")
# A view, virtual table or generated column may take for ever to be read.
_COMPUTED = """SELECT 1 FROM sqlite_master AS each WHERE type NOT IN ('table', 'index')
OR sql LIKE 'create virtual%' OR sql LIKE '%generated%' OR sql LIKE '% as (%' LIMIT 1"""
_FOOTER = 37  # bytes: a record of 29 bytes, and what the file ends in
_SUMMARY = slice(9, 17)  # in it, where the index begins
_HEAD = 9  # bytes of a record: what it is, and its length


def screen(path: Path) -> None:
    """Refuse a file that the library should not be given.

    Raises:
        RecordingError: it is damaged, or holds too much.
        OSError: it cannot be read.
    """
    if path.suffix == ".mcap":
        _check_index(path)
        return
    if _ODD & set(str(path)):  # which the library hands to SQLite as part of an address
        message = f"{path.name} has %, ? or # in its name or folder; rename it"
        raise RecordingError(message)
    _check_database(path)


def _check_index(path: Path) -> None:
    """Count the records of the index, each of which the library keeps."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - _FOOTER))
        at = int.from_bytes(file.read(_FOOTER)[_SUMMARY], "little")
        for _ in range(MOST_RECORDS):
            if not 0 < at <= size - _FOOTER - _HEAD:
                return
            file.seek(at)
            at += _HEAD + int.from_bytes(file.read(_HEAD)[1:], "little")
    message = f"{path.name} has an index of more than {MOST_RECORDS} records"
    raise RecordingError(message)


def _check_database(path: Path) -> None:
    """Refuse a database that is cut off, or has too many topics, before each is read.

    Raises:
        RecordingError: it has too many, or is no database.
    """
    with path.open("rb") as file:
        start = file.read(32)
    size, pages = int.from_bytes(start[16:18], "big"), int.from_bytes(start[28:32], "big")
    if path.stat().st_size < pages * (65536 if size == 1 else size):
        message = f"{path.name} is cut off"
        raise RecordingError(message)
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as base:
            if base.execute(_COMPUTED).fetchone() is not None:
                message = f"{path.name} holds what SQLite would have to compute; not opened"
                raise RecordingError(message)
            (count,) = base.execute("SELECT count(*) FROM topics").fetchone()
    except sqlite3.Error as error:
        message = f"{path.name} is damaged or no recording: {error}"
        raise RecordingError(message) from error
    if count > limits.MOST_TOPICS:
        raise RecordingError(limits.too_many())
