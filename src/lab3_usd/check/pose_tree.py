"""The frames that a publisher of transforms finds at target prims of its own.

This is the way of Isaac Sim 5, which 6.0.1 keeps and calls deprecated. It goes by what the physics
engine makes of a prim: joints tie an articulation together, and robot schemas play no part.
"""

from __future__ import annotations

from collections.abc import Sequence

from lab3_usd.check.frame_names import frame_name
from lab3_usd.check.link_tree import Links
from lab3_usd.check.model import Prim, StageModel
from lab3_usd.check.physics import ARTICULATION_API, BODIES, bodies_below, is_joint_type


def articulation(root: Prim, stage: StageModel) -> Links | None:
    """Return the links that joints tie to an articulation root, parents first; None for no root."""
    if ARTICULATION_API not in root.apis:
        return None
    parents = _parents(stage)
    children: dict[str, list[str]] = {}
    for child, parent in parents.items():
        children.setdefault(parent, []).append(child)
    ahead = [_top(path, parents) for path in bodies_below(stage, root.path)]
    links: Links = {}
    while ahead:
        path = ahead.pop(0)
        if path not in links:
            links[path] = parents.get(path, "")
            ahead.extend(children.get(path, ()))
    return links or None


def _top(path: str, parents: Links) -> str:
    """Climb to the link that no joint hangs below another."""
    seen = {path}
    while parents.get(path) and parents[path] not in seen:
        path = parents[path]
        seen.add(path)
    return path


def _parents(stage: StageModel) -> Links:
    """Map each body to the one its joint hangs it on."""
    found: Links = {}
    for joint in stage.of_type(is_joint_type):
        if joint.present:
            parent, child = (joint.relationships.get(name, ()) for name in BODIES)
            if parent and child and stage.prim(parent[0]) and stage.prim(child[0]):
                found.setdefault(child[0], parent[0])
    return found


def names_in_turn(paths: Sequence[str], stage: StageModel) -> list[str]:
    """Return a frame name for each prim: who comes first keeps it, the next goes by its path."""
    names: dict[str, str] = {}
    for path in paths:
        if path not in names:
            name = frame_name(path, stage)
            taken = name in names.values()
            names[path] = path.strip("/").replace("/", "_") if taken else name
    return [names[path] for path in paths]
