"""Remembers the loaded lab beside its files, as Python remembers compiled modules.

Reading and checking the YAML takes longer than judging a stage. Only the bundled files are
remembered, whose folder is trusted as much as the code.
"""

from __future__ import annotations

import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from lab3_usd.data import PACKAGE
from lab3_usd.spec.spec import Lab

_Key = tuple[tuple[str, int, int], ...]


def remembered(folder: Path, load: Callable[[Path], Lab]) -> Lab:
    """Return what `load` makes of `folder`, from last time where no file has changed since."""
    memory = folder / "__pycache__" / f"lab.{sys.implementation.cache_tag}.pickle"
    key = _key(folder)
    known = _recall(memory, key)
    if known is not None:
        return known
    lab = load(folder)
    if not sys.dont_write_bytecode:
        _keep(memory, key, lab)
    return lab


def _key(folder: Path) -> _Key:
    """Return name, size and time of every file that the lab is made of, code included."""
    files = [*folder.glob("*.yaml"), *(PACKAGE / "spec").glob("*.py")]
    stats = ((str(file), file.stat()) for file in sorted(files))
    return tuple((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats)


def _recall(memory: Path, key: _Key) -> Lab | None:
    try:
        with memory.open("rb") as file:
            # The key comes first, so that a stale lab is never even read.
            if pickle.load(file) != key:  # noqa: S301 - see above
                return None
            found = pickle.load(file)  # noqa: S301
    except Exception:  # noqa: BLE001 - whatever is wrong with the memory, the files are there
        return None
    return found if isinstance(found, Lab) else None


def _keep(memory: Path, key: _Key, lab: Lab) -> None:
    """Write the memory whole; where that is not allowed, the next start is slower, no more."""
    try:
        memory.parent.mkdir(exist_ok=True)
        handle, name = tempfile.mkstemp(dir=memory.parent)
    except OSError:
        return
    try:
        with open(handle, "wb") as file:  # noqa: PTH123 - a handle, not a path
            pickle.dump(key, file)
            pickle.dump(lab, file, protocol=pickle.HIGHEST_PROTOCOL)
        os.replace(name, memory)  # noqa: PTH105 - both are text here
    except OSError:
        Path(name).unlink(missing_ok=True)
