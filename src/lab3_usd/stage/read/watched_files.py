"""The files behind a stage that is judged again and again, and reading them anew."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

from pxr import Sdf

from lab3_usd.errors import StageError
from lab3_usd.stage.read.opening import open_stage

# A binary layer begins with a name, a version and where its table of sections begins. Each
# section has a name, a beginning and a size.
_CRATE = b"PXR-USDC"
_BEGIN, _COUNT, _SECTION = struct.Struct("<8s8sq"), struct.Struct("<Q"), struct.Struct("<16sqq")
_MOST_SECTIONS = 64


def may_be_whole(path: Path) -> bool:
    """Whether a file may be read: of a binary layer, every section must have been written.

    usd-core does not survive every binary layer that is cut short.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(_BEGIN.size)
            if not begin.startswith(_CRATE):
                return bool(begin)
            size, table = path.stat().st_size, _BEGIN.unpack(begin)[2]
            file.seek(table)
            count = min(_COUNT.unpack(file.read(_COUNT.size))[0], _MOST_SECTIONS)
            sections = _SECTION.iter_unpack(file.read(_SECTION.size * count))
            return table > 0 and all(start + length <= size for _, start, length in sections)
    except (OSError, ValueError, struct.error):
        return False


def used_files(path: Path) -> frozenset[str]:
    """Return the stage file and the files of all layers that it uses, links followed."""
    found = {str(path.resolve())}
    try:
        stage = open_stage(path)
    except StageError:
        return frozenset(found)
    return frozenset(found | {layer.realPath for layer in stage.GetUsedLayers() if layer.realPath})


def forget_files(paths: Iterable[str]) -> None:
    """Read layers of these files anew where something still holds them."""
    for path in paths:
        layer = Sdf.Layer.Find(path)
        if layer is not None:
            layer.Reload(force=True)
