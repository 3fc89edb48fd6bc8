"""The starter of a lab is made once for equal files: stages grow on copies of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from pxr import Sdf

from lab3_usd.spec.lab import SCENE, STARTER
from lab3_usd.stage.write import builder

MAKE = builder.starter_layer
_KNOWN: dict[tuple[bytes, ...], Sdf.Layer] = {}


@contextmanager
def starter_made_once() -> Iterator[None]:
    """Let whoever builds on one have the layer that was made before."""
    with patch.object(builder, "starter_layer", _layer):
        yield


def _layer(folder: Path) -> Sdf.Layer:
    files = [folder / STARTER, folder / SCENE]
    if not all(file.is_file() for file in files):
        return MAKE(folder)
    key = tuple(file.read_bytes() for file in files)
    if key not in _KNOWN:
        layer = MAKE(folder)
        layer.SetPermissionToEdit(False)  # noqa: FBT003 - pxr takes no keyword
        _KNOWN[key] = layer
    return _KNOWN[key]
