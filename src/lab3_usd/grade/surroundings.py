"""What a worker process knows of its surroundings: where modules lie, and next to nothing else."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from lab3_usd.data import PACKAGE

_KEPT = ("PATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "SYSTEMROOT", "TZ")


def module_path() -> list[str]:
    """Return where a worker finds this package, and what this process finds beside it."""
    ours = str(PACKAGE.parent)
    return [ours, *(path for path in sys.path if path and path != ours and Path(path).is_dir())]


def environment(scratch: Path) -> dict[str, str]:
    """Return next to nothing: no plugin path, no search path, no proxy, no secret."""
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    return kept | {"HOME": str(scratch), "TMPDIR": str(scratch), "PXR_WORK_THREAD_LIMIT": "1"}
