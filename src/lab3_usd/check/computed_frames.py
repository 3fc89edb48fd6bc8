"""The frames that a list of target prims gives, as Isaac Compute Transform Tree works them out."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.check.frame_names import frame_name, unique_names
from lab3_usd.check.link_tree import Links, expansion
from lab3_usd.check.model import Node, StageModel
from lab3_usd.spec.catalog import TfPorts
from lab3_usd.spec.spec import Lab


class Pair(Struct, frozen=True):
    """A parent and a child frame that a list of target prims gives."""

    parent: str
    child: str
    target: str
    prim: str
    expanded: bool


def tf_ports(node: Node) -> TfPorts:
    """Return the ports of a node that carry frames; none for a node of another kind."""
    found = None if node.type is None else node.type.tf
    return TfPorts() if found is None else found


def computed_pairs(node: Node, stage: StageModel, lab: Lab) -> list[Pair]:
    """Return the frames that a node's target prims give, in the order of the targets.

    A target with an articulation root or the robot API stands for its links, each below its own
    parent; every other target is one frame below the parent prim. Targets that do not exist are
    left out, unless a missing asset could hold them.
    """
    if not tf_ports(node).prims:
        return []
    parent_port, target_port = tf_ports(node).prims
    parent_prim = next(iter(node.targets(parent_port)), "")
    found: list[tuple[str, str]] = []  # target prim, prim of the frame
    links: Links = {}
    expanded: set[str] = set()
    for target in node.targets(target_port):
        made = _frames_of(target, parent_prim, stage)
        if made != {target: ""}:
            expanded.add(target)
        found.extend((target, path) for path in made)
        links.update(made)
    names = unique_names([path for _, path in found], stage)
    index = {path: name for (_, path), name in zip(found, names, strict=True)}
    # Without a parent prim Isaac Sim hangs the frames below the very one that the lab forbids.
    top = frame_name(parent_prim, stage) if parent_prim else lab.frames.forbidden_edge[0]
    return [
        Pair(index.get(links[path], top), name, target, path, target in expanded)
        for (target, path), name in zip(found, names, strict=True)
    ]


def _frames_of(target: str, parent_prim: str, stage: StageModel) -> Links:
    prim = stage.prim(target)
    if prim is None:
        return {target: ""} if stage.unresolved_above(target) else {}
    links = expansion(prim, stage)
    if not links:
        return {target: ""}
    return {path: parent for path, parent in links.items() if path != parent_prim}


def expands(target: str, stage: StageModel) -> bool:
    """Whether a target prim stands for the links of a robot instead of for itself."""
    prim = stage.prim(target)
    return prim is not None and bool(expansion(prim, stage))
