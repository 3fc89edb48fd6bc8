"""What stays the same when a file is edited or moved: fingerprints and relative paths."""

from __future__ import annotations

import os
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

from lab3_usd.check.finding import Report
from lab3_usd.report.entries import Entry, entries


def fingerprinted(report: Report) -> Iterator[tuple[Entry, str]]:
    """Yield every finding with a fingerprint that survives edits elsewhere in the file.

    It names rule, prim and property, never the line; the number after the colon counts findings
    of one file that agree in all three.
    """
    seen: dict[tuple[str, str], int] = {}
    for entry in entries(report):
        finding = entry.finding
        digest = fingerprint(finding.rule, finding.prim, finding.property or "")
        key = (entry.path, digest)
        seen[key] = seen.get(key, 0) + 1
        yield entry, f"{digest}:{seen[key]}"


def fingerprint(*parts: str) -> str:
    """Return 32 hexadecimal digits that stand for `parts`."""
    return sha256("\0".join(parts).encode("utf-8", "backslashreplace")).hexdigest()[:32]


def relative_path(path: str, root: str | None) -> str:
    """Return `path` with forward slashes, relative to `root` (the current folder) if below it.

    Decided by the text alone: a link stays the file that was given.
    """
    base = os.path.normpath(Path.cwd() / (root or ""))
    whole = os.path.normpath(Path.cwd() / path)
    try:
        return Path(whole).relative_to(base).as_posix()
    except ValueError:
        return Path(whole).as_posix()
