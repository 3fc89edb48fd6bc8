"""Keeps the loaded lab beside its files, as Python keeps compiled modules.

Reading and checking the YAML takes longer than judging a stage. A wheel carries the compiled lab; a
checkout compiles it when it is first loaded. Only bundled files are compiled, whose folder is
trusted as much as the code.
"""

from __future__ import annotations

import os
import pickle
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.data import PACKAGE
from lab3_usd.spec.spec import Lab

FILE = "lab.pickle"


def compiled_or_loaded(folder: Path, load: Callable[[Path], Lab]) -> Lab:
    """Return the compiled lab of `folder`; where there is none, what `load` makes of the files.

    A compiled lab holds for the very bytes that it was made of, code included.
    """
    checksum = _checksum(folder)
    ours = folder / "__pycache__" / FILE
    for path in (folder / FILE, ours):
        lab = _read(path, checksum)
        if lab is not None:
            return replace(lab, folder=folder)
    lab = load(folder)
    if not sys.dont_write_bytecode:
        try:
            ours.parent.mkdir(exist_ok=True)
            _write(ours, compile_lab(folder, lab))
        except OSError:
            pass  # the next start is slower, no more
    return lab


def compile_lab(folder: Path, lab: Lab) -> bytes:
    """Return the lab as it is kept."""
    checksum = _checksum(folder).to_bytes(4, "big")
    return checksum + pickle.dumps(replace(lab, folder=Path()), protocol=5)


def _checksum(folder: Path) -> int:
    """Return what tells the files of a lab, and the code that reads them, from all others."""
    checksum = 0
    for file in (*sorted(folder.glob("*.yaml")), *sorted((PACKAGE / "spec").glob("*.py"))):
        checksum = zlib.crc32(file.read_bytes(), zlib.crc32(file.name.encode(), checksum))
    return checksum


def _read(path: Path, checksum: int) -> Lab | None:
    try:
        with path.open("rb") as file:
            # The checksum comes first, so that a stale lab is never even read.
            if file.read(4) != checksum.to_bytes(4, "big"):
                return None
            found = pickle.load(file)  # noqa: S301 - it is trusted as the code is
    except Exception:  # noqa: BLE001 - whatever is wrong with it, the files are there
        return None
    return found if isinstance(found, Lab) else None


def _write(path: Path, data: bytes) -> None:
    """Write a file whole, readable for whoever may read its folder."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}")
    temporary.write_bytes(data)
    temporary.replace(path)
