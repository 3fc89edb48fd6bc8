"""The starters of the bundled and the small lab are made once: stages grow on copies of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from unittest.mock import patch

from places import TESTS
from pxr import Sdf

from lab3_usd.data import data_folder
from lab3_usd.stage.write import builder

MAKE = builder.starter_layer
KEPT = {data_folder("graphs"), TESTS / "labs" / "mini"}


@contextmanager
def starter_made_once() -> Iterator[None]:
    """Let whoever builds on one of them have the layer that was made before."""
    with patch.object(builder, "starter_layer", _layer):
        yield


def _layer(folder: Path) -> Sdf.Layer:
    return _kept(folder) if folder in KEPT else MAKE(folder)


@cache
def _kept(folder: Path) -> Sdf.Layer:
    layer = MAKE(folder)
    layer.SetPermissionToEdit(False)  # noqa: FBT003 - pxr takes no keyword
    return layer
