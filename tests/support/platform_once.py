"""Isaac Sim is assembled once for equal files: most copies of a lab change others."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from lab3_usd.isaac.load import platform
from lab3_usd.isaac.platform import Platform

ASSEMBLE = platform.assemble_platform
_KNOWN: dict[tuple[str, bytes], Platform] = {}


@contextmanager
def platform_assembled_once() -> Iterator[None]:
    """Let whoever reads files that were read before have the platform that they describe."""
    with patch.object(platform, "assemble_platform", _assembled):
        yield


def _assembled(folder: Path) -> Platform:
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        digest.update(path.name.encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    key = (folder.name, digest.digest())
    if key not in _KNOWN:
        _KNOWN[key] = ASSEMBLE(folder)
    return _KNOWN[key]
