"""The content of layers: from text, to text, and whether two layers hold the same."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf

from lab3_usd.files import temporary_beside


def layer_from(text: str) -> Sdf.Layer | None:
    """Return the layer that a text holds, None where usd-core cannot read it."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    return layer if layer.ImportFromString(text) else None


def same_content(one: Sdf.Layer, other: Sdf.Layer) -> bool:
    """Whether two layers hold the same, in whatever order."""
    return _lines(one) == _lines(other)


def _lines(layer: Sdf.Layer) -> list[str]:
    return sorted(layer.ExportToString().split("\n"))


def is_text(layer: Sdf.Layer) -> bool:
    """Whether the file of a layer is text."""
    with Path(layer.realPath).open("rb") as file:
        return file.read(5) == b"#usda"


def crate_bytes(layer: Sdf.Layer) -> bytes:
    """Return a layer in the binary form."""
    path = temporary_beside(Path(layer.realPath), ".usdc")
    try:
        layer.Export(str(path), args={"format": "usdc"})
        return path.read_bytes()
    finally:
        path.unlink(missing_ok=True)
