"""The files behind a stage: its layers, and assets that cannot be found."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct
from pxr import Ar, Sdf, Tf, Usd

from lab3_usd.model.stage import MutedSublayer, UnresolvedAsset
from lab3_usd.stage.read.opening import quiet

_MUTED = "omni_layer:muteness"  # of the root layer's custom data
# usd-core takes an address for a path and drops one of its slashes.
_ONE_SLASH = r"^(\w{2,}):/(?=[^/])"
_ASSET = r"@(.*?)@"
_SUBLAYER = "ErrorInvalidSublayerPath"
# A file that was found but lacks the prim asked for hides nothing: what it holds is judged.
_MISSING = ("ErrorInvalidAssetPath", "ErrorMutedAssetPath", _SUBLAYER)
_LACKS_PRIM = "ErrorUnresolvedPrimPath"
# A device has no children, so that nothing below it can be looked up, let alone opened. The asset
# is one name below it, whatever slashes and dots are in it.
_BLOCKED = "/dev/null/blocked/"
# Active, defined and not abstract: most prims are, and one question tells.
IS_PRESENT = Usd.PrimIsActive & Usd.PrimIsDefined & ~Usd.PrimIsAbstract
EVERYTHING = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)


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
                files.add(Path(real_path(layer.realPath)))
            paths = filter(None, layer.GetCompositionAssetDependencies())
            assets = {Sdf.ComputeAssetPathRelativeToLayer(layer, path) for path in paths}
            for identifier in assets - seen:
                seen.add(identifier)
                try:
                    opened = Sdf.Layer.FindOrOpen(identifier)
                except Tf.ErrorException:  # it is damaged
                    opened = None
                if opened is None:
                    missing.add(re.sub(_ONE_SLASH, r"\1://", identifier))
                    files.add(Path(real_path(identifier)))
                else:
                    waiting.append(opened)
    return LayerFiles(frozenset(files), tuple(sorted(missing)))


def real_path(identifier: str) -> str:
    """Return the file of a layer, links followed as far as is permitted; in a package, the package.

    Whoever wrote the layer may have named what nobody but root can follow, as /proc/1/root.
    """
    path = identifier.partition("[")[0]
    try:
        return os.path.realpath(path)
    except OSError:
        return os.path.abspath(path)  # noqa: PTH100 - it follows no link


def find_muted(stage: Usd.Stage) -> Iterator[MutedSublayer]:
    """Yield each sublayer that Isaac Sim opens muted, with the prims that it has opinions about.

    The root layer lists them; usd-core composes them all the same.
    """
    root = stage.GetRootLayer()
    listed = root.customLayerData
    for key in _MUTED.split(":"):
        listed = listed.get(key, {}) if isinstance(listed, Mapping) else {}
    muted: list[Sdf.Layer] = []
    for written, is_muted in sorted(listed.items() if isinstance(listed, Mapping) else ()):
        names = {written, root.ComputeAbsolutePath(written)} if is_muted else set()
        for layer in stage.GetLayerStack(includeSessionLayers=False):
            if layer != root and not names.isdisjoint({layer.identifier, layer.realPath}):
                if layer not in muted:  # one layer may be listed in two spellings
                    muted.append(layer)
                    yield MutedSublayer(written, tuple(_prims_in(layer)))
                break


def _prims_in(layer: Sdf.Layer) -> Iterator[str]:
    ahead = list(layer.rootPrims)
    while ahead:
        spec = ahead.pop()
        ahead.extend(spec.nameChildren)
        if spec.specifier == Sdf.SpecifierDef or spec.properties or spec.HasInfo("active"):
            yield str(spec.path)


def find_unresolved(stage: Usd.Stage) -> list[UnresolvedAsset]:
    """Return what composition could not find, in the order of prim and asset.

    A missing sublayer of the stage itself could hold anything. A missing sublayer of an asset
    concerns the prims that refer to the asset; what a prim lacks, those that refer to the prim.
    """
    errors = stage.GetCompositionErrors()
    if not errors:
        return []
    unresolved: set[tuple[str, str, Any, str]] = set()
    lacking: dict[str, set[str]] = {}
    for prim, error in (*((each.rootSite.path, each) for each in errors), *_again(stage, errors)):
        text, name = str(error), type(error).__name__
        assets = re.findall(_ASSET, text)
        if name not in _MISSING or not assets:
            continue
        layer = assets[1] if len(assets) > 1 else ""
        asset = original_asset(_as_written(assets[0], layer))
        if name != _SUBLAYER:
            kind = "payload" if "@ for payload" in text else "reference"
            unresolved.add((str(prim.GetPrimPath()), asset, kind, layer))
        elif error.rootSite.layerStack.rootLayer == stage.GetRootLayer():
            unresolved.add(("/", asset, "sublayer", layer))
        else:
            lacking.setdefault(layer, set()).add(asset)
    for layer, prim in _users(stage, set(lacking)) if lacking else ():
        unresolved |= {(prim, asset, "sublayer of an asset", layer) for asset in lacking[layer]}
    return [UnresolvedAsset(*asset) for asset in sorted(unresolved)]


def _again(stage: Usd.Stage, errors: Iterable[Any]) -> Iterator[tuple[Sdf.Path, Any]]:
    """Yield errors with the prims that have them, where several prims have the same one.

    Composition names the prim in which an asset is missing, also to those that refer to that prim.
    """
    counts = Counter(error.rootSite.path for error in errors)
    if any(count > 1 for count in counts.values()):
        for prim in stage.Traverse(EVERYTHING):
            for error in Usd.Prim.GetPrimIndex(prim).localErrors:
                yield Usd.Prim.GetPath(prim), error


def _users(stage: Usd.Stage, layers: set[str]) -> Iterator[tuple[str, str]]:
    """Yield each of these layers with the topmost prims that its asset is brought to.

    A prim may also want from the asset what only the missing sublayer would define.
    """
    above: dict[str, str] = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), EVERYTHING):
        path = str(prim.GetPath())
        for layer in _brought(prim) & layers:
            if not path.startswith(f"{above.get(layer, path)}/"):
                above[layer] = path
                yield layer, path
    for error in stage.GetCompositionErrors():
        if type(error).__name__ == _LACKS_PRIM:
            root = Sdf.Layer.Find(re.findall(_ASSET, str(error))[0])
            for layer in _with_sublayers(root) & layers:
                yield layer, str(error.rootSite.path.GetPrimPath())


def _brought(prim: Usd.Prim) -> set[str]:
    """Return the layers that references and payloads of the prim, or above it, bring to it."""
    source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
    ahead = list(source.GetPrimIndex().rootNode.children) if source else []
    layers: set[str] = set()
    while ahead:
        node = ahead.pop()
        layers.update(layer.identifier for layer in node.layerStack.layers)
        ahead.extend(node.children)
    return layers


def _with_sublayers(root: Sdf.Layer | None) -> set[str]:
    layers: set[str] = set()
    ahead = [] if root is None else [root]
    while ahead:
        layer = ahead.pop()
        if layer.identifier not in layers:
            layers.add(layer.identifier)
            opened = (Sdf.Layer.FindRelativeToLayer(layer, path) for path in layer.subLayerPaths)
            ahead.extend(sublayer for sublayer in opened if sublayer is not None)
    return layers


def _as_written(asset: str, layer_path: str) -> str:
    """Return the asset as the layer names it; usd-core tells it as a path of this computer."""
    layer = Sdf.Layer.Find(layer_path)
    for written in layer.GetCompositionAssetDependencies() if layer else ():
        if asset in {written, os.path.normpath(written), layer.ComputeAbsolutePath(written)}:
            return str(written)
    return asset


def is_defined_in(prim: Usd.Prim, layers: Iterable[Sdf.Layer]) -> bool:
    """Whether one of these layers defines the prim, rather than overrides it."""
    return any(
        spec.specifier == Sdf.SpecifierDef and spec.layer in layers for spec in prim.GetPrimStack()
    )


def is_in_scene(prim: Usd.Prim, hidden: Iterable[str]) -> bool:
    """Whether the prim is defined, or would be if the assets missing at `hidden` were there.

    A student's prim below an `over` of a robot whose file did not come along is the student's
    own work all the same.
    """
    if Usd.Prim.IsDefined(prim):
        return not Usd.Prim.IsAbstract(prim)
    if not Usd.Prim.HasDefiningSpecifier(prim):
        return False
    above = Usd.Prim.GetParent(prim)
    while above and not Usd.Prim.IsDefined(above):
        path = f"{above.GetPath()}/"
        if not Usd.Prim.HasDefiningSpecifier(above) and not any(
            path.startswith(f"{place.rstrip('/')}/") for place in hidden
        ):
            return False
        above = Usd.Prim.GetParent(above)
    return True


def blocked_path(asset: str) -> str:
    """Return a path that no computer can open and that still tells which asset was asked for."""
    from urllib.parse import quote

    return _BLOCKED + quote(asset, safe="")


def original_asset(path: str) -> str:
    """Return the asset that a blocked path stands for, any other path as it is."""
    if not path.startswith(_BLOCKED):
        return path
    from urllib.parse import unquote

    return unquote(path[len(_BLOCKED) :])


def is_in_asset(prim: Usd.Prim) -> bool:
    """Whether a prim above this one refers to an asset."""
    while prim := prim.GetParent():
        if prim.HasAuthoredReferences() or prim.HasAuthoredPayloads():
            return True
    return False
