"""Caches the loaded YAML beside its files, as Python caches compiled modules.

Reading and checking the YAML takes longer than judging a stage. A wheel carries the platform and
the lab compiled into one file; a checkout compiles them when they are first loaded. The platform
comes first and is read alone where no lab is needed, and its node types when they are asked for:
4 ms of a processor for the platform and 6 with the lab, where one pickle of everything takes 13.
Only bundled files are compiled, whose folder is trusted as much as the code.
"""

from __future__ import annotations

import io
import os
import pickle
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.data import PACKAGE
from lab3_usd.isaac.node_types import NodeType
from lab3_usd.isaac.platform import Platform

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Lab

_Entry = TypeVar("_Entry")

FILE = "compiled.pickle"
PLATFORM = "isaac"  # the folder of Isaac Sim's files beside those of the lab
RECIPES = "recipes"  # the folder of graphs to add beside those files
_NUMBER = 4  # bytes of the checksum, and of the length of the first part
_PLATFORM, _TYPE, _PATH = "platform", "type", "path"


class Compiled(Struct, frozen=True):
    """A platform, and the lab beside it as it is kept."""

    platform: Platform
    packed: bytes
    folder: Path

    def lab(self) -> Lab:
        """Return the lab."""
        lab: Lab = _LabReader(self.packed, self.platform).load()
        return replace(lab, folder=self.folder)


def compiled_or_loaded(folder: Path, load: Callable[[Path], Lab]) -> Compiled:
    """Return the compiled lab of `folder`; where there is none, what `load` makes of the files.

    What is compiled holds for the very bytes that it was made of, code included.
    """
    platform, packed = _kept(folder, load)
    return Compiled(pickle.loads(platform), packed, folder)  # noqa: S301 - as trusted as the code


class Packed(Mapping[str, _Entry], Generic[_Entry]):
    """A mapping whose entries are unpacked when first asked for: most stages need few types."""

    def __init__(self, packed: Mapping[str, bytes]) -> None:
        """Hold entries that `pack` made."""
        self._packed = packed
        self._entries: dict[str, _Entry] = {}

    def __getitem__(self, name: str) -> _Entry:
        """Return an entry, always the same object for a name.

        Raises:
            KeyError: there is none.
        """
        found = self._entries.get(name)
        if found is None:
            found = self._entries[name] = pickle.loads(self._packed[name])  # noqa: S301 - as trusted as its file
        return found

    def get(self, name: str, default: _Entry | None = None) -> _Entry | None:  # type: ignore[override]
        """Return an entry as above, else the default."""
        found = self._entries.get(name)
        return self[name] if found is None and name in self._packed else found or default

    def __contains__(self, name: object) -> bool:
        """Whether there is an entry, which stays packed."""
        return name in self._packed

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._packed)

    def __len__(self) -> int:
        """Count the entries."""
        return len(self._packed)

    def __reduce__(self) -> tuple[object, ...]:
        """Be pickled packed."""
        return Packed, (self._packed,)


def pack(entries: Mapping[str, _Entry]) -> Packed[_Entry]:
    """Return a mapping that keeps its entries packed."""
    return Packed({name: pickle.dumps(entry, protocol=5) for name, entry in entries.items()})


def compile_lab(folder: Path, lab: Lab) -> bytes:
    """Return a lab and its platform as they are kept."""
    return _joined(_checksum(folder), _parts(lab))


_Parts = tuple[bytes, bytes]


def _parts(lab: Lab) -> _Parts:
    types = pack(lab.platform.types)
    models = lab.platform.sensor_models
    platform = replace(
        lab.platform,
        types=types,
        base=types,
        releases=pack(lab.platform.releases),
        recipes=pack(lab.platform.recipes),
        sensor_models=replace(models, schemas=pack(models.schemas)),
    )
    written = io.BytesIO()
    _LabWriter(written, lab.platform).dump(replace(lab, folder=Path()))
    return pickle.dumps(platform, protocol=5), written.getvalue()


class _LabWriter(pickle.Pickler):
    """Writes a lab without its platform, the types of that, and paths, which it only names."""

    def __init__(self, file: io.BytesIO, platform: Platform) -> None:
        super().__init__(file, protocol=5)
        self._platform = platform

    def persistent_id(self, obj: Any) -> tuple[str, str] | None:
        """Name what the platform holds."""
        if obj is self._platform:
            return _PLATFORM, ""
        if isinstance(obj, NodeType) and self._platform.types.get(obj.type) is obj:
            return _TYPE, obj.type
        if isinstance(obj, Path):  # whose module has another name in each release of Python
            return _PATH, str(obj)
        return None


class _LabReader(pickle.Unpickler):
    """Reads a lab beside its platform."""

    def __init__(self, data: bytes, platform: Platform) -> None:
        super().__init__(io.BytesIO(data))
        self._platform = platform

    def persistent_load(self, pid: Any) -> Any:
        """Return what the platform holds under a name."""
        kind, name = pid
        if kind == _PATH:
            return Path(name)
        return self._platform if kind == _PLATFORM else self._platform.types[name]


def _kept(folder: Path, load: Callable[[Path], Lab]) -> _Parts:
    checksum = _checksum(folder)
    ours = folder / "__pycache__" / FILE
    for path in (folder / FILE, ours):
        found = _read(path, checksum)
        if found is not None:
            return found
    parts = _parts(load(folder))
    if not sys.dont_write_bytecode:
        try:
            ours.parent.mkdir(exist_ok=True)
            _write(ours, _joined(checksum, parts))
        except OSError:
            pass  # the next start is slower, no more
    return parts


def _joined(checksum: int, parts: _Parts) -> bytes:
    first, second = parts
    sums = (checksum, len(first), zlib.crc32(second, zlib.crc32(first)))
    return b"".join((*(each.to_bytes(_NUMBER, "big") for each in sums), first, second))


def _checksum(folder: Path) -> int:
    """Return what tells these files, and the code that reads them, from all others."""
    own, system = _files(folder, ".yaml"), _files(folder / PLATFORM, ".yaml", ".json")
    recipes = folder / PLATFORM / RECIPES
    recipe_files = _files(recipes, ".yaml") if recipes.is_dir() else []
    return _sum((*own, *system, *recipe_files), _code_checksum(PACKAGE))


@lru_cache(maxsize=1)
def _code_checksum(package: Path) -> int:
    readers = ("isaac", "isaac/load", "spec", "spec/load")
    files = (file for folder in readers for file in _files(package / folder, ".py"))
    return _sum((*files, package / "yaml_file.py"), 0)


def _files(folder: Path, *endings: str) -> list[Path]:
    """Return the files of a folder that end so."""
    return sorted(file for file in folder.iterdir() if file.name.endswith(endings))


def _sum(files: Iterable[Path], checksum: int) -> int:
    for file in files:
        checksum = zlib.crc32(file.read_bytes(), zlib.crc32(file.name.encode(), checksum))
    return checksum


def _read(path: Path, checksum: int) -> _Parts | None:
    """Return both parts of a file that is whole and up to date, None for another."""
    try:
        with path.open("rb") as file:
            # The checksum comes first, so that a stale file is never even read.
            if file.read(_NUMBER) != checksum.to_bytes(_NUMBER, "big"):
                return None
            length, content = (int.from_bytes(file.read(_NUMBER), "big") for _ in range(2))
            first, second = file.read(length), file.read()
    except OSError:
        return None
    is_whole = bool(first) and zlib.crc32(second, zlib.crc32(first)) == content
    return (first, second) if is_whole else None


def _write(path: Path, data: bytes) -> None:
    """Write a file whole, readable for whoever may read its folder."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}")
    temporary.write_bytes(data)
    temporary.replace(path)
