"""The layers of a stage: the files that it could read, and the sublayers that are muted."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from msgspec import Struct
from pxr import Ar, Sdf, Tf, Usd

from lab3_usd.model.stage import MutedSublayer
from lab3_usd.stage.read.opening import quiet

_MUTED = "omni_layer:muteness"  # of the root layer's custom data
# usd-core takes an address for a path and drops one of its slashes.
_ONE_SLASH = r"^(\w{2,}):/(?=[^/])"


class LayerFiles(Struct, frozen=True):
    """The files of a stage, links followed, and what could not be found or read, in order."""

    files: frozenset[Path]
    missing: tuple[str, ...]


def layer_files(stage: Usd.Stage) -> LayerFiles:
    """Follow every sublayer, reference and payload, whatever is selected, active or loaded."""
    files: set[Path] = set()
    missing: set[str] = set()
    seen: set[str] = set()
    waiting = [stage.GetRootLayer()]
    with quiet(), Ar.ResolverContextBinder(stage.GetPathResolverContext()):
        while waiting:
            layer = waiting.pop()
            if layer.realPath:
                files.add(_file(layer.realPath))
            for identifier in _leads_to(layer) - seen:
                seen.add(identifier)
                found = _open(identifier)
                if found is None:
                    missing.add(re.sub(_ONE_SLASH, r"\1://", identifier))
                    files.add(_file(identifier))
                else:
                    waiting.append(found)
    return LayerFiles(frozenset(files), tuple(sorted(missing)))


def _leads_to(layer: Sdf.Layer) -> set[str]:
    paths = (path for path in layer.GetCompositionAssetDependencies() if path)
    return {Sdf.ComputeAssetPathRelativeToLayer(layer, path) for path in paths}


def _open(identifier: str) -> Sdf.Layer | None:
    try:
        return Sdf.Layer.FindOrOpen(identifier)
    except Tf.ErrorException:  # it is damaged
        return None


def _file(path: str) -> Path:
    """Return the file itself: a layer in a package is the package."""
    return Path(path.partition("[")[0]).resolve()


def find_muted(stage: Usd.Stage) -> Iterator[MutedSublayer]:
    """Yield each sublayer that Isaac Sim opens muted, with the prims that it has opinions about.

    The root layer lists them; usd-core composes them all the same.
    """
    root = stage.GetRootLayer()
    listed = root.customLayerData
    for key in _MUTED.split(":"):
        listed = listed.get(key, {}) if isinstance(listed, Mapping) else {}
    told: list[Sdf.Layer] = []
    for written, is_muted in sorted(listed.items() if isinstance(listed, Mapping) else ()):
        layer = _muted_layer(stage, root, written) if is_muted else None
        if layer is not None and layer not in told:  # one layer may be listed in two spellings
            told.append(layer)
            yield MutedSublayer(written, tuple(_prims_in(layer)))


def _muted_layer(stage: Usd.Stage, root: Sdf.Layer, written: str) -> Sdf.Layer | None:
    names = {written, root.ComputeAbsolutePath(written)}
    for layer in stage.GetLayerStack(includeSessionLayers=False):
        if layer != root and not names.isdisjoint({layer.identifier, layer.realPath}):
            return layer
    return None


def _prims_in(layer: Sdf.Layer) -> Iterator[str]:
    ahead = list(layer.rootPrims)
    while ahead:
        spec = ahead.pop()
        ahead.extend(spec.nameChildren)
        if spec.specifier == Sdf.SpecifierDef or spec.properties or spec.HasInfo("active"):
            yield str(spec.path)
