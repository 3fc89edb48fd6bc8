"""Caches the loaded YAML beside its files, as Python caches compiled modules.

Reading and checking the YAML takes longer than judging a stage. A wheel carries the lab with its
platform compiled into one file; a checkout compiles them when they are first loaded. Node types are
decoded when they are asked for: 0.8 ms of a processor for the lab, where all of them take 4.9. The
platform alone took 0.4, which no command shows (41 pairs: lint 0.2 % more, check 1.0 %).
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
_NUMBER = 4  # bytes of a checksum


def compiled_or_loaded(folder: Path, load: Callable[[Path], Lab]) -> Lab:
    """Return the compiled lab of `folder`; where there is none, what `load` makes of the files.

    What is compiled holds for the very bytes that it was made of, code included.
    """
    from lab3_usd.spec.lab import Lab

    fields = pickle.loads(_kept(folder, load))  # noqa: S301 - as trusted as the code
    return Lab(folder=folder, **fields)


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
        entry = self._entries.get(name)
        if entry is None:
            entry = self._entries[name] = pickle.loads(self._packed[name])  # noqa: S301 - as trusted as its file
        return entry

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
    return _joined(_checksum(folder), _content(lab))


def _content(lab: Lab) -> bytes:
    """Return the fields of a lab without its folder, a class whose module Python renames."""
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
    fields = {name: getattr(lab, name) for name in lab.__struct_fields__ if name != "folder"}
    written = io.BytesIO()
    _Writer(written, lab.platform, types).dump(fields | {"platform": platform})
    return written.getvalue()


class _Writer(pickle.Pickler):
    """Writes a node type of the platform as the entry that it is there."""

    def __init__(self, file: io.BytesIO, platform: Platform, packed: Packed[NodeType]) -> None:
        super().__init__(file, protocol=5)
        self._types = platform.types
        self._packed = packed

    def reducer_override(self, obj: Any) -> Any:
        """Return how a node type is read."""
        if isinstance(obj, NodeType) and self._types.get(obj.type) is obj:
            return Packed.__getitem__, (self._packed, obj.type)
        return NotImplemented


def _kept(folder: Path, load: Callable[[Path], Lab]) -> bytes:
    checksum = _checksum(folder)
    ours = folder / "__pycache__" / FILE
    for path in (folder / FILE, ours):
        stored = _read(path, checksum)
        if stored is not None:
            return stored
    content = _content(load(folder))
    if not sys.dont_write_bytecode:
        try:
            ours.parent.mkdir(exist_ok=True)
            # Written whole, readable for whoever may read its folder.
            temporary = ours.with_name(f"{ours.name}.{os.getpid()}")
            temporary.write_bytes(_joined(checksum, content))
            temporary.replace(ours)
        except OSError:
            pass  # the next start is slower, no more
    return content


def _joined(checksum: int, content: bytes) -> bytes:
    """Return a content with a sum of it, and of what it was made of, before it."""
    return zlib.crc32(content, checksum).to_bytes(_NUMBER, "big") + content


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


def _read(path: Path, checksum: int) -> bytes | None:
    """Return the content of a file that is whole and up to date, None for another."""
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    content = stored[_NUMBER:]
    is_whole = zlib.crc32(content, checksum).to_bytes(_NUMBER, "big") == stored[:_NUMBER]
    return content if content and is_whole else None
