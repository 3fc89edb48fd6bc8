"""The bundled starter is made once: stages grow on a copy of it, hundreds of times."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from unittest.mock import patch

from pxr import Sdf

from lab3_usd.data import data_folder
from lab3_usd.stage.write import builder

MAKE = builder.starter_layer
BUNDLED = data_folder("graphs")


@contextmanager
def starter_made_once() -> Iterator[None]:
    """Let whoever builds on the bundled starter have the layer that was made before."""
    with patch.object(builder, "starter_layer", _layer):
        yield


def _layer(folder: Path) -> Sdf.Layer:
    return _bundled() if folder == BUNDLED else MAKE(folder)


@cache
def _bundled() -> Sdf.Layer:
    layer = MAKE(BUNDLED)
    layer.SetPermissionToEdit(False)  # noqa: FBT003 - pxr takes no keyword
    return layer
