"""Keeps what was loaded from YAML beside its files, as Python keeps compiled modules.

Reading and checking the YAML takes longer than judging a stage. A wheel carries the lab and the
types of Isaac Sim compiled; a checkout compiles them when they are first loaded. Only bundled files
are compiled, whose folder is trusted as much as the code.
"""

from __future__ import annotations

import os
import pickle
import sys
import zlib
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from msgspec.structs import replace

from lab3_usd.data import PACKAGE, data_folder
from lab3_usd.spec.isaac import IsaacTypes
from lab3_usd.spec.lab import Lab

FILE = "lab.pickle"
TYPES_FILE = "isaac_types.pickle"
_Loaded = TypeVar("_Loaded", Lab, IsaacTypes)


def compiled_or_loaded(folder: Path, load: Callable[[Path], Lab]) -> Lab:
    """Return the compiled lab of `folder`; where there is none, what `load` makes of the files.

    A compiled lab holds for the very bytes that it was made of, code included.
    """

    def make() -> Lab:
        return replace(load(folder), folder=Path())

    lab = _kept(folder / FILE, folder.glob("*.yaml"), Lab, make)
    return replace(lab, folder=folder)


def compiled_or_loaded_types(folder: Path, load: Callable[[Path], IsaacTypes]) -> IsaacTypes:
    """Return the compiled node types of `folder`, or what `load` makes of the files."""
    return _kept(folder / TYPES_FILE, _type_files(folder), IsaacTypes, lambda: load(folder))


def compile_lab(folder: Path, lab: Lab) -> bytes:
    """Return the lab as it is kept."""
    return _packed(_checksum(folder.glob("*.yaml")), replace(lab, folder=Path()))


def compile_types(folder: Path, types: IsaacTypes) -> bytes:
    """Return the node types as they are kept."""
    return _packed(_checksum(_type_files(folder)), types)


def _type_files(folder: Path) -> Iterable[Path]:
    """Return the files of the node types: those of the lab win over the others."""
    return (*folder.parent.glob("node_types.yaml"), *folder.glob("*.yaml"))


def _kept(
    beside: Path, files: Iterable[Path], kind: type[_Loaded], make: Callable[[], _Loaded]
) -> _Loaded:
    checksum = _checksum(files)
    ours = beside.parent / "__pycache__" / beside.name
    for path in (beside, ours):
        found = _read(path, checksum, kind)
        if found is not None:
            return found
    made = make()
    if not sys.dont_write_bytecode:
        try:
            ours.parent.mkdir(exist_ok=True)
            _write(ours, _packed(checksum, made))
        except OSError:
            pass  # the next start is slower, no more
    return made


def _packed(checksum: int, loaded: Lab | IsaacTypes) -> bytes:
    return checksum.to_bytes(4, "big") + pickle.dumps(loaded, protocol=5)


def _checksum(files: Iterable[Path]) -> int:
    """Return what tells these files, and the code that reads them, from all others."""
    return _sum(files, _code_checksum(PACKAGE))


@lru_cache(maxsize=1)
def _code_checksum(package: Path) -> int:
    return _sum((*package.glob("spec/*.py"), *package.glob("spec/load/*.py")), 0)


def _sum(files: Iterable[Path], checksum: int) -> int:
    for file in sorted(files):
        checksum = zlib.crc32(file.read_bytes(), zlib.crc32(file.name.encode(), checksum))
    return checksum


def _read(path: Path, checksum: int, kind: type[_Loaded]) -> _Loaded | None:
    try:
        with path.open("rb") as file:
            # The checksum comes first, so that a stale file is never even read.
            if file.read(4) != checksum.to_bytes(4, "big"):
                return None
            found = pickle.load(file)  # noqa: S301 - it is trusted as the code is
    except Exception:  # noqa: BLE001 - whatever is wrong with it, the files are there
        return None
    return found if isinstance(found, kind) else None


def _write(path: Path, data: bytes) -> None:
    """Write a file whole, readable for whoever may read its folder."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}")
    temporary.write_bytes(data)
    temporary.replace(path)


@lru_cache(maxsize=1)
def load_isaac_types() -> IsaacTypes:
    """Load every public node type of Isaac Sim, which the lab's catalog is a part of.

    Raises:
        SpecError: a file is missing or wrong.
    """
    return compiled_or_loaded_types(data_folder("graphs") / "isaac", _assemble_types)


def _assemble_types(folder: Path) -> IsaacTypes:
    from lab3_usd.spec.load.catalog import assemble_types

    return assemble_types(folder)
