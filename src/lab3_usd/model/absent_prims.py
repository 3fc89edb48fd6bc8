"""Why a prim is not in the scene, and whether an asset that cannot be found could hold it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel


def absence_reason(stage: StageModel, path: str) -> str:
    """Say why there is no prim at `path`, as the end of a sentence about it."""
    found = stage.prims.get(path)
    if found is None:
        above = _nearest_prim(stage, path)
        if above and not stage.prims[above].present:
            return f"is missing: {above} {absence_reason(stage, above)}"
        return "is missing"
    if not found.active:
        return "is deactivated"
    return "is only an over without a def"


def _nearest_prim(stage: StageModel, path: str) -> str:
    """Return the path itself or the nearest one above it that holds a prim, '' for none."""
    while path and path not in stage.prims:
        path = path.rpartition("/")[0]
    return path


def missing_graphs_text(missing_graphs: Mapping[str, str], path: str) -> str:
    """Name the graphs that are missing together with the prim, as the end of a sentence."""
    names = [name for name, prim in missing_graphs.items() if prim == path]
    return f"; missing with it: {', '.join(names)}" if names else ""


def is_unresolved(stage: StageModel, path: str) -> bool:
    """Whether a missing asset could hold the prim at `path`, or what it lacks.

    A prim that was deactivated on purpose is absent whatever the asset holds.
    """
    above = _nearest_prim(stage, path)
    if above and not stage.prims[above].active:
        return False
    return stage.unresolved_above(path) is not None


def nodes_outside_graphs(stage: StageModel) -> Iterator[Node]:
    """Yield the nodes outside every graph.

    Left out are those below an over that may be a graph in an asset which cannot be found.
    """
    for node in stage.orphans:
        above = _nearest_prim(stage, node.path.rpartition("/")[0])
        over = stage.prims.get(above)
        if over is None or not over.active or over.defined or not is_unresolved(stage, above):
            yield node


def is_pose_unresolved(stage: StageModel, prim: Prim) -> bool:
    """Whether a missing asset could say where the prim stands, and nothing else does."""
    return prim.local is None and is_unresolved(stage, prim.path)


def is_subtree_unresolved(stage: StageModel, path: str) -> bool:
    """Whether a missing asset could hold something at or below `path`."""
    return is_unresolved(stage, path) or any(
        is_at_or_below(missing.prim, path) for missing in stage.unresolved
    )


def has_unresolved_outside(stage: StageModel, path: str) -> bool:
    """Whether an asset is missing elsewhere than at or below `path`."""
    return any(not is_at_or_below(missing.prim, path) for missing in stage.unresolved)
