"""Holds the lines that the package finds in a text layer against the text and OpenUSD."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from pxr import Sdf, Usd, UsdUtils

from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage import statements as usda_scan
from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files

Spot = tuple[int, int]
INDENT = 4


@dataclass(frozen=True, slots=True)
class Measure:
    """One layer: how many paths OpenUSD finds in it, and those found at another place."""

    file: Path
    paths: int
    wrong: tuple[str, ...]


def measure(file: Path) -> Measure:
    text = file.read_bytes().decode("utf-8")
    paths = spec_paths(Sdf.Layer.FindOrOpen(str(file)))
    return Measure(file, len(paths), tuple(misplaced(text, paths)))


def misplaced(text: str, paths: Collection[str]) -> Iterator[str]:
    """Yield the paths that are not found where a text that OpenUSD wrote declares them.

    It indents each statement by its depth, and names what it declares; what a prim or variant
    holds stands between it and the next statement that is no deeper.
    """
    spots, lines = spots_of(text), text.split("\n")
    in_order = sorted((spots[path], path) for path in paths if path in spots)
    above: list[str] = []
    for (line, column), path in in_order:
        held_by, name = _parts(path)
        del above[(column - 1) // INDENT :]
        is_below = held_by == "".join(above[-1:]) and len(above) == (column - 1) // INDENT
        declared = re.search(
            rf"(?<![\w:]){re.escape(name)}(?![\w:])", lines[line - 1][column - 1 :]
        )
        if not (is_below and declared):
            yield path
        above.append(path)
    yield from (path for path in paths if path not in spots)


def _parts(path: str) -> tuple[str, str]:
    """Return what holds a spec, and its own name."""
    if path.endswith("}"):
        held_by, _, choice = path[:-1].rpartition("{")
        name, _, variant = choice.partition("=")
        return (f"{held_by}{{{name}=}}", variant) if variant else (held_by, name)
    cut = max(path.rfind("/"), path.rfind("."), path.rfind("}"))
    return path[: cut + (path[cut] == "}")], path[cut + 1 :]


def spots_of(text: str) -> dict[str, Spot]:
    """Return line and column of what the package's scanner finds, counted the plain way."""
    return {
        path: (text.count("\n", 0, offset) + 1, offset - (text.rfind("\n", 0, offset) + 1) + 1)
        for path, offset in usda_scan.scan_text(text).items()
    }


def spec_paths(layer: Sdf.Layer) -> list[str]:
    """Return the paths of all prims, variants and properties of a layer."""
    found: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, found.append)
    return sorted(
        str(path)
        for path in found
        if path.IsPrimPath() or path.IsPrimVariantSelectionPath() or path.IsPrimPropertyPath()
    )


def text_files(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*.usd*")):
        with path.open("rb") as file:
            if file.read(5) == b"#usda":
                yield path


def build_text_stages(folder: Path) -> list[Path]:
    """Build every checkpoint as text, and the last one in layers as students' files have them."""
    lab = load_lab()
    plan = plan_files(lab, folder, list(lab.checkpoints), "usda")
    built = build_files(lab, None, plan, BuildOptions())
    layered = folder / "layered"
    layered.mkdir()
    return [*built, *_layer(built[-1], layered)]


def _layer(built: Path, folder: Path) -> Iterator[Path]:
    """Write a stage that stands on `built` as a sublayer, and one flattened by OpenUSD."""
    above = folder / "above.usda"
    stage = Usd.Stage.CreateNew(str(above))
    stage.GetRootLayer().subLayerPaths.append(f"../{built.name}")
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            if attribute.HasAuthoredConnections():
                attribute.AddConnection(f"{prim.GetPath()}.inputs:other")
            elif attribute.HasAuthoredValue():
                attribute.Set(attribute.Get())
    stage.Save()
    yield above
    flat = folder / "flat.usda"
    UsdUtils.FlattenLayerStack(stage).Export(str(flat))
    yield flat
