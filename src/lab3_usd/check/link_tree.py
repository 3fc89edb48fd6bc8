"""The links of a robot and the parent of each, as its joints tie them together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lab3_usd.check.model import Prim, StageModel

ARTICULATION_API = "PhysicsArticulationRootAPI"
ROBOT_API = "IsaacRobotAPI"
BODY_API = "PhysicsRigidBodyAPI"
ROBOT_LINKS = "isaac:physics:robotLinks"
ROBOT_JOINTS = "isaac:physics:robotJoints"
_PARENT_BODY = "physics:body0"
_CHILD_BODY = "physics:body1"

Links = dict[str, str]  # the path of each link with that of its parent link, '' for none


def expansion(prim: Prim, stage: StageModel) -> Links:
    """Return the links that Isaac Sim puts in the place of this prim; empty where it stays one.

    A prim that is the articulation root stands for the links of the articulation, one with the
    robot API for the links it lists.
    """
    if ARTICULATION_API in prim.apis:
        found = _articulation(prim, stage)
        if found:
            return found
    return _listed(prim, stage) if ROBOT_API in prim.apis else {}


def _articulation(root: Prim, stage: StageModel) -> Links:
    """Follow the joints from the links at and below the root prim; parents come first."""
    parents = _parents(stage.prims.values(), stage)
    children: dict[str, list[str]] = {}
    for child, parent in parents.items():
        children.setdefault(parent, []).append(child)
    inside = [path for path in _below(root.path, stage) if BODY_API in stage.prims[path].apis]
    links: Links = {}
    ahead = [_top(path, parents) for path in inside]
    while ahead:
        path = ahead.pop(0)
        if path not in links:
            links[path] = parents.get(path, "")
            ahead.extend(children.get(path, ()))
    return links


def _top(path: str, parents: Links) -> str:
    """Climb to the link that no joint hangs below another."""
    seen = {path}
    while parents.get(path) and parents[path] not in seen:
        path = parents[path]
        seen.add(path)
    return path


def _listed(robot: Prim, stage: StageModel) -> Links:
    joints = (stage.prim(path) for path in robot.relationships.get(ROBOT_JOINTS, ()))
    parents = _parents((joint for joint in joints if joint is not None), stage)
    return {
        path: parents.get(path, "")
        for path in robot.relationships.get(ROBOT_LINKS, ())
        if stage.prim(path) is not None
    }


def _parents(joints: Iterable[Prim], stage: StageModel) -> Links:
    """Map each body to the one its joint hangs it on."""
    found: Links = {}
    for joint in joints:
        parent = joint.relationships.get(_PARENT_BODY, ())
        child = joint.relationships.get(_CHILD_BODY, ())
        if joint.present and parent and child and stage.prim(parent[0]) and stage.prim(child[0]):
            found.setdefault(child[0], parent[0])
    return found


def _below(path: str, stage: StageModel) -> Iterator[str]:
    """Yield the prim and those below it."""
    yield path
    for other, prim in stage.prims.items():
        if other.startswith(f"{path}/") and prim.present:
            yield other
