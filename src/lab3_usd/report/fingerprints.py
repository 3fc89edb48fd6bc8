"""Fingerprints of findings, which stay the same when a file is edited or moved."""

from __future__ import annotations

from collections.abc import Iterator
from zlib import crc32

from lab3_usd.model.finding import Finding, Report
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
    from hashlib import sha256  # noqa: PLC0415 - slow to load, and most formats do without

    return sha256("\0".join(parts).encode("utf-8", "backslashreplace")).hexdigest()[:32]


def fault_id(finding: Finding) -> str:
    """Return 8 hexadecimal digits that findings share which say the same of the same place.

    A fault that is carried along from stage to stage has one; the line does not matter.
    """
    parts = (finding.rule, finding.severity, finding.prim, finding.property, finding.message)
    text = "\0".join(part or "" for part in parts)
    return format(crc32(text.encode("utf-8", "backslashreplace")), "08x")
