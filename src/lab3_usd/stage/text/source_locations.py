"""Says at which line of which layer a prim or property of a composed stage is written."""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.model.changes import Site
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.read.properties import AuthoredProperties
from lab3_usd.stage.text.usda_scan import scan_text

# The fields in which a property's opinion stands; a spec without them only declares it.
_OPINIONS = ("default", "timeSamples", "spline", "connectionPaths", "targetPaths")


class SourceLocation(Struct, frozen=True):
    """Where something is written; line and column count from 1, in characters.

    `layer` is the root layer's path as it was given, or the path of another layer from the same
    folder, and empty for a layer in memory. Line and column are None where no text says it.
    """

    layer: str
    line: int | None
    column: int | None


@quiet()
def locate(stage: Usd.Stage, given: str, sites: Iterable[Site]) -> dict[Site, SourceLocation]:
    """Return the place of each site: a prim path, and the name of a property or None.

    It is where the strongest opinion begins. A property that no layer holds is at its prim, a
    prim that no layer holds at the nearest prim above it; what has nothing above it is in the
    root layer, which `given` names, at no line. Every layer is read once at most.
    """
    root = stage.GetRootLayer()
    specs = {site: _spec(stage, *site) for site in sites}
    asked: dict[str, list[str]] = {}
    for layer, path in specs.values():
        asked.setdefault(layer.realPath, []).append(path)
    texts = {file: _read(file, paths) for file, paths in asked.items()}
    locations: dict[Site, SourceLocation] = {}
    for site, (layer, path) in specs.items():
        name = given if layer == root else layer_name(layer, root, given)
        locations[site] = _location(name, texts[layer.realPath], path)
    return locations


def _spec(stage: Usd.Stage, prim_path: str, name: str | None) -> tuple[Sdf.Layer, str]:
    """Return the layer that holds a site, and the path of the spec in it."""
    if prim_path == "/" and name:  # the metadata of the stage
        return stage.GetRootLayer(), f"/.{name}"
    prim = _prim(stage, prim_path)
    specs: Sequence[Any] = ()  # from the strongest to the weakest
    if name and prim and str(prim.GetPath()) == prim_path:
        specs = AuthoredProperties(prim)[name].specs
    if specs:
        specs = _saved(specs, stage)
        spec = next((each for each in specs if _has_opinion(each)), specs[0])
        return spec.layer, str(spec.path)
    stack: Sequence[Any] = prim.GetPrimStack() if prim else ()
    if stack:
        spec = _saved(stack, stage)[0]
        return spec.layer, str(spec.path)
    return stage.GetRootLayer(), ""


def _saved(specs: Sequence[Any], stage: Usd.Stage) -> Sequence[Any]:
    """Leave out what the session layer says, unless nobody else says anything."""
    return [each for each in specs if each.layer != stage.GetSessionLayer()] or specs


def _prim(stage: Usd.Stage, path: str) -> Usd.Prim | None:
    """Return the prim at `path` or the nearest above it; None where that is the root."""
    while path.startswith("/") and path != "/":
        if Sdf.Path.IsValidPathString(path) and (prim := stage.GetPrimAtPath(path)):
            return prim
        path = path.rpartition("/")[0]
    return None


def _has_opinion(spec: Sdf.PropertySpec) -> bool:
    return any(spec.HasInfo(field) for field in _OPINIONS)


def layer_name(layer: Sdf.Layer, root: Sdf.Layer, given: str) -> str:
    """Return the path of a layer as somebody would write it who wrote `given` for the root."""
    if not layer.realPath or not root.realPath:
        return str(layer.realPath)
    try:
        relative = os.path.relpath(layer.realPath, Path(root.realPath).parent)
    except ValueError:  # another drive
        return str(layer.realPath)
    return os.path.normpath(Path(given).parent / relative)


class _Text(Struct, frozen=True):
    """Where lines begin in a text layer, and the specs that are asked for, as offsets."""

    specs: Mapping[str, int]
    lines: Sequence[int]


def _read(path: str, asked: Iterable[str]) -> _Text | None:
    """Find specs in a text layer; None for a binary one, one in a package and one in memory."""
    try:
        data = Path(path).read_bytes() if path else b""
    except (OSError, ValueError):
        return None
    if not data.startswith(b"#"):
        return None
    text = data.decode("utf-8", errors="replace")
    lines = [0]
    while end := text.find("\n", lines[-1]) + 1:
        lines.append(end)
    return _Text(scan_text(text, asked), lines)


def _location(name: str, text: _Text | None, path: str) -> SourceLocation:
    offset = text.specs.get(path) if text else None
    if text is None or offset is None:
        return SourceLocation(name, None, None)
    line = bisect_right(text.lines, offset)
    return SourceLocation(name, line, offset - text.lines[line - 1] + 1)
