"""What a target prim stands for: itself, the bodies of an articulation, or the links of a robot.

Isaac Compute Transform Tree goes by schemas and by the namespace. The joints say only below which
link another one hangs; what a robot lists as its links plays no part.
"""

from __future__ import annotations

from collections.abc import Iterable

from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import (
    ARTICULATION_API,
    BODIES,
    bodies_below,
    is_excluded,
    is_joint,
    is_joint_type,
)
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import StageModel

ROBOT_API = "IsaacRobotAPI"
LINK_API = "IsaacLinkAPI"
FRAME_APIS = frozenset({LINK_API, "IsaacSiteAPI", "IsaacReferencePointAPI"})
_NO_FRAMES = frozenset({"IsaacJointAPI", ROBOT_API})
_ROBOT_JOINTS = "isaac:physics:robotJoints"

Links = dict[str, str]  # the path of each link with that of its parent link, '' for none


def expansion(target: Prim, stage: StageModel, parent: str) -> Links | None:
    """Return the prims that become frames in the place of a target, None where it stays one.

    An articulation root stands for the bodies at and below it, a robot for everything in its
    subtree that a schema of Isaac Sim calls a link, a site or a reference point. Of a robot, not
    of an articulation, the prim `parent` is left out, below which the others hang.
    """
    if ARTICULATION_API in target.apis:
        bodies = bodies_below(stage, target.path)
        if bodies:
            return {path: above(path, bodies) for path in bodies}
    links = _robot(target, stage) if ROBOT_API in target.apis else {}
    return {path: links[path] for path in links if path != parent} if links else None


def _robot(robot: Prim, stage: StageModel) -> Links:
    parents = joint_parents(robot, stage)
    links = {prim.path for prim in stage.with_api(LINK_API) if prim.present}
    return {
        prim.path: parents.get(prim.path, "") if prim.path in links else above(prim.path, links)
        for prim in stage.with_api(FRAME_APIS.__contains__)
        if prim.present and is_at_or_below(prim.path, robot.path)
        if not _NO_FRAMES & set(prim.apis)
    }


def joint_parents(robot: Prim, stage: StageModel) -> Links:
    """Map each link to the one on which the robot's joints hang it; the last joint counts."""
    found: Links = {}
    for path in robot.relationships.get(_ROBOT_JOINTS, ()):
        joint = stage.prims.get(path)  # a joint that is deactivated is still read
        if joint is None or not is_joint(joint) or is_excluded(joint):
            continue
        parent, child = (joint.relationships.get(name, ()) for name in BODIES)
        if parent and child:
            found[child[0]] = parent[0]
    return found


def above(path: str, paths: Iterable[str]) -> str:
    """Return the nearest prim above `path` that is one of `paths`, '' for none."""
    found = (each for each in paths if path.startswith(f"{each}/"))
    return max(found, key=len, default="")


def articulation_links(root: Prim, stage: StageModel) -> Links | None:
    """Return the links that joints tie to an articulation root, parents first; None for no root."""
    if ARTICULATION_API not in root.apis:
        return None
    parents = _parents_by_joints(stage)
    children: dict[str, list[str]] = {}
    for child, parent in parents.items():
        children.setdefault(parent, []).append(child)
    ahead = [_topmost(path, parents) for path in bodies_below(stage, root.path)]
    links: Links = {}
    while ahead:
        path = ahead.pop(0)
        if path not in links:
            links[path] = parents.get(path, "")
            ahead.extend(children.get(path, ()))
    return links or None


def _topmost(path: str, parents: Links) -> str:
    """Climb to the link that no joint hangs below another."""
    seen = {path}
    while parents.get(path) and parents[path] not in seen:
        path = parents[path]
        seen.add(path)
    return path


def _parents_by_joints(stage: StageModel) -> Links:
    """Map each body to the one its joint hangs it on."""
    found: Links = {}
    for joint in stage.of_type(is_joint_type):
        if joint.present:
            parent, child = (joint.relationships.get(name, ()) for name in BODIES)
            if parent and child and stage.prim(parent[0]) and stage.prim(child[0]):
                found.setdefault(child[0], parent[0])
    return found
