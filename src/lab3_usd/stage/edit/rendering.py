"""Renders prims of a layer as text, as usd-core writes them."""

from __future__ import annotations

from pxr import Sdf

# The fields of a prim that edits change, beside its specifier and type.
_FIELDS = ("active", "apiSchemas")


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
