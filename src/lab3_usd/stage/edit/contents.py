"""The content of layers: from text, to text, and whether two layers hold the same.

Prims are rendered as usd-core writes them.
"""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf

from lab3_usd.files import temporary_beside

# The fields of a prim that edits change, beside its specifier and type.
_FIELDS = ("active", "apiSchemas")


def layer_from(text: str) -> Sdf.Layer | None:
    """Return the layer that a text holds, None where usd-core cannot read it."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    return layer if layer.ImportFromString(text) else None


def same_content(one: Sdf.Layer, other: Sdf.Layer) -> bool:
    """Whether two layers hold the same, in whatever order."""
    mine, theirs = (each.ExportToString() for each in (one, other))
    if mine == theirs:
        return True
    # Two prims that have exchanged a value have the same lines.
    is_alike = sorted(mine.split("\n")) == sorted(theirs.split("\n"))
    return is_alike and _fields(one) == _fields(other)


def _fields(layer: Sdf.Layer) -> dict[Sdf.Path, dict[str, str]]:
    """Return what a layer says of each prim and property, as text: no NaN equals another."""
    found: dict[Sdf.Path, dict[str, str]] = {}

    def keep(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)  # None for a target or a source
        names = spec.ListInfoKeys() if spec else ()
        found[path] = {each: str(spec.GetInfo(each)) for each in names}

    layer.Traverse(Sdf.Path.absoluteRootPath, keep)
    return found


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


def render_prim(layer: Sdf.Layer, path: str) -> str:
    """Return a layer that holds one prim with its properties and without its children.

    Of the layer itself, `/`, the metadata is rendered.
    """
    made = Sdf.Layer.CreateAnonymous(".usda")
    if path == "/":
        for name in layer.pseudoRoot.ListInfoKeys():
            made.pseudoRoot.SetInfo(name, layer.pseudoRoot.GetInfo(name))
        return str(made.ExportToString())
    source = layer.GetPrimAtPath(path)
    prim = Sdf.CreatePrimInLayer(made, path)
    prim.specifier = source.specifier
    if source.typeName:
        prim.typeName = source.typeName
    for name in _FIELDS:
        if source.HasInfo(name):
            prim.SetInfo(name, source.GetInfo(name))
    for each in source.properties:
        Sdf.CopySpec(layer, each.path, made, each.path)
    return str(made.ExportToString())


def render_tree(layer: Sdf.Layer, path: str) -> str:
    """Return a layer that holds one prim with everything below it."""
    made = Sdf.Layer.CreateAnonymous(".usda")
    parent = path.rpartition("/")[0]
    if parent:
        Sdf.CreatePrimInLayer(made, parent)
    Sdf.CopySpec(layer, path, made, path)
    return str(made.ExportToString())


def has_prim(layer: Sdf.Layer, path: str) -> bool:
    """Whether a layer says anything of a prim."""
    return path == "/" or layer.GetPrimAtPath(path) is not None


def child_names(layer: Sdf.Layer, path: str) -> list[str]:
    """Name the prims below a prim, or below the layer itself."""
    spec = layer.pseudoRoot if path == "/" else layer.GetPrimAtPath(path)
    return [each.name for each in spec.nameChildren]
