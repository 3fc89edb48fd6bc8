"""Why a prim is not in the scene, and whether an asset that cannot be found could hold it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.model import Node, Prim, StageModel
from lab3_usd.check.paths import is_at_or_below

__all__ = [
    "hides_below",
    "hides_outside",
    "hides_place",
    "is_at_or_below",
    "is_hidden",
    "strays",
    "why_absent",
    "with_it",
]


def why_absent(stage: StageModel, path: str) -> str:
    """Say why there is no prim at `path`, as the end of a sentence about it."""
    found = stage.prims.get(path)
    if found is None:
        above = path.rpartition("/")[0]
        while above and above not in stage.prims:
            above = above.rpartition("/")[0]
        if above and not stage.prims[above].present:
            return f"is missing: {above} {why_absent(stage, above)}"
        return "is missing"
    if not found.active:
        return "is deactivated"
    return "is only an over without a def"


def with_it(lost: Mapping[str, str], path: str) -> str:
    """Name the graphs that are missing together with the prim, as the end of a sentence."""
    names = [name for name, prim in lost.items() if prim == path]
    return f"; missing with it: {', '.join(names)}" if names else ""


def is_hidden(stage: StageModel, path: str) -> bool:
    """Whether a missing asset could hold the prim at `path`, or what it lacks.

    A prim that was deactivated on purpose is absent whatever the asset holds.
    """
    above = path
    while above and above not in stage.prims:
        above = above.rpartition("/")[0]
    if above and not stage.prims[above].active:
        return False
    return stage.unresolved_above(path) is not None


def strays(stage: StageModel) -> Iterator[Node]:
    """Yield the nodes outside every graph.

    Left out are those below an over that may be a graph in an asset which cannot be found.
    """
    for node in stage.orphans:
        above = node.path.rpartition("/")[0]
        while above and above not in stage.prims:
            above = above.rpartition("/")[0]
        over = stage.prims.get(above)
        if over is None or not over.active or over.defined or not is_hidden(stage, above):
            yield node


def hides_place(stage: StageModel, prim: Prim) -> bool:
    """Whether a missing asset could say where the prim stands, and nothing else does."""
    return prim.local is None and is_hidden(stage, prim.path)


def hides_below(stage: StageModel, path: str) -> bool:
    """Whether a missing asset could hold something at or below `path`."""
    return is_hidden(stage, path) or any(
        is_at_or_below(missing.prim, path) for missing in stage.unresolved
    )


def hides_outside(stage: StageModel, path: str) -> bool:
    """Whether an asset is missing elsewhere than at or below `path`."""
    return any(not is_at_or_below(missing.prim, path) for missing in stage.unresolved)
