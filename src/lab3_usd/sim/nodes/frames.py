"""Which frames Isaac Compute Transform Tree publishes (OgnIsaacComputeTransformTree.cpp)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from msgspec import Struct

from lab3_usd.model.dry_run.affine import Affine, Quaternion
from lab3_usd.model.dry_run.scene import Prim, Scene
from lab3_usd.model.physics import EXCLUDED

if TYPE_CHECKING:
    from lab3_usd.sim.execution.world import World

ROOT, BODY, ROBOT = "PhysicsArticulationRootAPI", "PhysicsRigidBodyAPI", "IsaacRobotAPI"
LINK, JOINT = "IsaacLinkAPI", "IsaacJointAPI"
COMPONENTS = {LINK, "IsaacSiteAPI", "IsaacReferencePointAPI"}
OPTICAL = Affine(((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))  # 180 degrees about X


class Pair(Struct, frozen=True):
    """A transform: names, and the prims that stand for them ('' is the world)."""

    parent: str
    child: str
    parent_prim: str
    child_prim: str
    camera: bool

    def pose(self, world: World) -> Affine:
        """Return where the child stands in its parent's frame, in stage units."""
        child: Affine = world.machines.place(self.child_prim)
        child = child.then(OPTICAL) if self.camera else child
        back: Affine = world.machines.inverse(self.parent_prim)
        return back.then(child)

    def turn(self, world: World) -> Quaternion:
        """Return how the child is turned in its parent's frame."""
        return self.pose(world).quaternion()


class Tree(Struct, frozen=True):
    """The transforms of a node, in order."""

    pairs: tuple[Pair, ...]

    @classmethod
    def of(cls, scene: Scene, parent: str, targets: Sequence[str]) -> Tree:
        """Expand the targets; a prim that is found twice hangs below what was said last of it."""
        found: list[Prim] = []
        parents: dict[str, str] = {}
        for target in targets:
            prim = scene.prims.get(target)
            for each, above in _expanded(scene, prim, parent) if prim is not None else ():
                found.append(each)
                parents[each.path] = above
        names = _names(found)
        by_path = {prim.path: name for prim, name in zip(found, names, strict=True)}
        top = frame_name(scene.prims[parent]) if parent in scene.prims else "world"
        top_prim = parent if parent in scene.prims else ""

        def pair(prim: Prim, name: str) -> Pair:
            above = parents[prim.path]
            is_frame = above in by_path
            return Pair(
                by_path[above] if is_frame else top,
                name,
                above if is_frame else top_prim,
                prim.path,
                prim.type == "Camera",
            )

        return cls(tuple(map(pair, found, names)))


def _expanded(scene: Scene, prim: Prim, parent: str) -> Iterator[tuple[Prim, str]]:
    """Yield what a target stands for, each with the prim that its frame hangs below."""
    if ROOT in prim.apis:
        bodies = [each for each in scene.below(prim.path) if BODY in each.apis]
        paths = {each.path for each in bodies}
        if bodies:
            for each in bodies:
                above = [up.path for up in scene.above(each.path) if up.path in paths]
                yield each, above[1] if len(above) > 1 else ""
            return
    if ROBOT in prim.apis:
        found = [each for each in scene.below(prim.path) if each.apis & COMPONENTS]
        found = [each for each in found if not each.apis & {JOINT, ROBOT}]
        if found:
            parents = _joint_parents(scene, prim)
            for each in found:
                if each.path != parent:
                    yield (
                        each,
                        parents.get(each.path, "")
                        if LINK in each.apis
                        else _link_above(scene, each),
                    )
            return
    yield prim, ""


def _joint_parents(scene: Scene, robot: Prim) -> dict[str, str]:
    found: dict[str, str] = {}
    for path in robot.targets.get("isaac:physics:robotJoints", ()):
        joint = scene.prims.get(path)
        if joint is not None and joint.values.get(EXCLUDED) is True:
            continue  # robot_schema.h:638
        ends = [joint.targets.get(f"physics:body{n}", ()) for n in (0, 1)] if joint else [(), ()]
        if ends[0] and ends[1]:
            found[ends[1][0]] = ends[0][0]
    return found


def _link_above(scene: Scene, prim: Prim) -> str:
    above = (up.path for up in scene.above(prim.path) if up is not prim and LINK in up.apis)
    return next(above, "")


def frame_name(prim: Prim) -> str:
    """Return the frame of a prim: its override, else the prim's own name."""
    return str(prim.values.get("isaac:nameOverride") or "") or prim.path.rpartition("/")[2]


def _names(prims: Sequence[Prim]) -> list[str]:
    """Return the names of frames; of several that want one, the longest path has it (:889-945)."""
    deepest: dict[str, int] = {}
    for number, prim in enumerate(prims):
        other = deepest.setdefault(frame_name(prim), number)
        if len(prim.path) > len(prims[other].path):
            deepest[frame_name(prim)] = number
    names = [
        frame_name(prim) if deepest[frame_name(prim)] == number else ""
        for number, prim in enumerate(prims)
    ]
    for number, prim in enumerate(prims):
        if not names[number]:
            parts = prim.path.split("/")
            tries = [parts[-1], *(f"{each}_{parts[-1]}" for each in parts[2:-1])]
            free = [each for each in tries if each not in names]
            names[number] = free[0] if free else "_".join(parts[2:] or parts[1:])
    return names
