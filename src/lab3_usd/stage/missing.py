"""Assets that a stage asks for and that cannot be found, and what would stand on them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from typing import Literal

from pxr import Sdf, Usd

from lab3_usd.check.model import Unresolved
from lab3_usd.stage.barred import asked_for

_ASSET = re.compile(r"@(.*?)@")
# A file that was found but lacks the prim asked for hides nothing: what it holds is judged.
_MISSING = ("ErrorInvalidAssetPath", "ErrorMutedAssetPath", "ErrorInvalidSublayerPath")


def find_unresolved(stage: Usd.Stage) -> list[Unresolved]:
    """Return what composition could not find, in the order of prim and asset."""
    found: set[tuple[str, str, Literal["reference", "payload", "sublayer"], str]] = set()
    for error in stage.GetCompositionErrors():
        text = str(error)
        assets = _ASSET.findall(text)
        if type(error).__name__ not in _MISSING or not assets:
            continue
        kind = _kind(type(error).__name__, text)
        prim = "/" if kind == "sublayer" else str(error.rootSite.path.GetPrimPath())
        layer = assets[1] if len(assets) > 1 else ""
        found.add((prim, asked_for(_as_written(assets[0], layer)), kind, layer))
    return [Unresolved(*each) for each in sorted(found)]


def _kind(error: str, text: str) -> Literal["reference", "payload", "sublayer"]:
    if error == "ErrorInvalidSublayerPath":
        return "sublayer"
    return "payload" if "@ for payload" in text else "reference"


def _as_written(asset: str, layer_path: str) -> str:
    """Return the asset as the layer names it; usd-core tells it as a path of this computer."""
    layer = Sdf.Layer.Find(layer_path)
    for written in layer.GetCompositionAssetDependencies() if layer else ():
        if asset in {written, os.path.normpath(written), layer.ComputeAbsolutePath(written)}:
            return str(written)
    return asset


def is_in_scene(prim: Usd.Prim, hidden: Iterable[str]) -> bool:
    """Whether the prim is defined, or would be if the assets missing at `hidden` were there.

    A student's prim below an `over` of a robot whose file did not come along is the student's
    own work all the same.
    """
    if prim.IsDefined():
        return not prim.IsAbstract()
    if not prim.HasDefiningSpecifier():
        return False
    above = prim.GetParent()
    while above and not above.IsDefined():
        path = f"{above.GetPath()}/"
        if not above.HasDefiningSpecifier() and not any(
            path.startswith(f"{place.rstrip('/')}/") for place in hidden
        ):
            return False
        above = above.GetParent()
    return True
