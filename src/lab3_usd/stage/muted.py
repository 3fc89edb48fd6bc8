"""Sublayers that the application opens muted: it keeps their list in the root layer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pxr import Sdf, Usd

from lab3_usd.check.model import Muted

_LIST = "omni_layer:muteness"  # of the root layer's custom data


def find_muted(stage: Usd.Stage) -> Iterator[Muted]:
    """Yield each muted sublayer of the stage with the prims that it defines or says something of.

    usd-core composes it all the same.
    """
    root = stage.GetRootLayer()
    listed = root.customLayerData
    for key in _LIST.split(":"):
        listed = listed.get(key, {}) if isinstance(listed, Mapping) else {}
    for written, is_muted in sorted(listed.items() if isinstance(listed, Mapping) else ()):
        layer = _loaded(stage, root, written) if is_muted else None
        if layer is not None:
            yield Muted(written, tuple(_prims(layer)))


def _loaded(stage: Usd.Stage, root: Sdf.Layer, written: str) -> Sdf.Layer | None:
    names = {written, root.ComputeAbsolutePath(written)}
    for layer in stage.GetLayerStack(includeSessionLayers=False):
        if layer != root and not names.isdisjoint({layer.identifier, layer.realPath}):
            return layer
    return None


def _prims(layer: Sdf.Layer) -> Iterator[str]:
    ahead = list(layer.rootPrims)
    while ahead:
        spec = ahead.pop()
        ahead.extend(spec.nameChildren)
        if spec.specifier == Sdf.SpecifierDef or spec.properties or spec.HasInfo("active"):
            yield str(spec.path)
