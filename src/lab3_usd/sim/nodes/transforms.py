"""Publishers of transforms, and which frames they publish. CN is core nodes, RN ROS 2 nodes.

All lines are those of PoseTree.h in core.includes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from msgspec import Struct

from lab3_usd.model.dry_run import HERE, Affine, Quaternion, Scene, ScenePrim
from lab3_usd.model.physics import EXCLUDED
from lab3_usd.model.transforms import Vector
from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.recording import Message, Transform
from lab3_usd.sim.execution.world import RosEndpoint, World, opened_endpoint, send
from lab3_usd.sim.nodes.core import wxyz, xyzw
from lab3_usd.sim.robot.machine import Machine

ROOT, BODY, ROBOT = "PhysicsArticulationRootAPI", "PhysicsRigidBodyAPI", "IsaacRobotAPI"
LINK, JOINT = "IsaacLinkAPI", "IsaacJointAPI"
COMPONENTS = {LINK, "IsaacSiteAPI", "IsaacReferencePointAPI"}
OPTICAL = Affine(((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))  # 180 degrees about X


_WORLD = "world"


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
        """Expand the targets; of a prim that is found twice the last parent counts."""
        members: list[ScenePrim] = []
        parents: dict[str, str] = {}
        for target in targets:
            prim = scene.prims.get(target)
            for member, above in _expanded(scene, prim, parent) if prim is not None else ():
                members.append(member)
                parents[member.path] = above
        names = _names(members)
        by_path = {prim.path: name for prim, name in zip(members, names, strict=True)}
        # A parent that is not there still gives its frame a name (:339-350).
        top_prim = parent if parent in scene.prims else ""
        top = frame_name(scene.prims[top_prim]) if top_prim else parent.rpartition("/")[2] or _WORLD

        def pair(prim: ScenePrim, name: str) -> Pair:
            above = parents[prim.path]
            is_frame = above in by_path
            return Pair(
                by_path[above] if is_frame else top,
                name,
                above if is_frame else top_prim,
                prim.path,
                prim.type == "Camera",
            )

        return cls(tuple(map(pair, members, names)))


def _expanded(scene: Scene, prim: ScenePrim, parent: str) -> Iterator[tuple[ScenePrim, str]]:
    """Yield what a target stands for, each with the prim that its frame hangs below."""
    if ROOT in prim.apis:
        bodies = [part for part in scene.below(prim.path) if BODY in part.apis]
        paths = {body.path for body in bodies}
        if bodies:
            for body in bodies:
                above = [up.path for up in scene.above(body.path) if up.path in paths]
                yield body, above[1] if len(above) > 1 else ""
            return
    if ROBOT in prim.apis:
        parts = [part for part in scene.below(prim.path) if part.apis & COMPONENTS]
        parts = [part for part in parts if not part.apis & {JOINT, ROBOT}]
        if parts:
            parents = _joint_parents(scene, prim)
            for part in parts:
                if part.path == parent:
                    continue
                if LINK in part.apis:
                    yield part, parents.get(part.path, "")
                else:
                    links = (up.path for up in scene.above(part.path) if LINK in up.apis)
                    yield part, next(links, "")
            return
    yield prim, ""


def _joint_parents(scene: Scene, robot: ScenePrim) -> dict[str, str]:
    parents: dict[str, str] = {}
    for path in robot.targets.get("isaac:physics:robotJoints", ()):
        joint = scene.prims.get(path)
        if joint is not None and joint.values.get(EXCLUDED) is True:
            continue  # robot_schema.h:638
        ends = [joint.targets.get(f"physics:body{n}", ()) for n in (0, 1)] if joint else [(), ()]
        if ends[0] and ends[1]:
            parents[ends[1][0]] = ends[0][0]
    return parents


def frame_name(prim: ScenePrim) -> str:
    """Return the frame of a prim: its override, else the prim's own name."""
    return str(prim.values.get("isaac:nameOverride") or "") or prim.path.rpartition("/")[2]


def _names(prims: Sequence[ScenePrim]) -> list[str]:
    """Return the names of frames; of several that want one, the longest path has it (:889-945)."""
    deepest: dict[str, int] = {}
    for number, prim in enumerate(prims):
        rival = deepest.setdefault(frame_name(prim), number)
        if len(prim.path) > len(prims[rival].path):
            deepest[frame_name(prim)] = number
    names = [
        frame_name(prim) if deepest[frame_name(prim)] == number else ""
        for number, prim in enumerate(prims)
    ]
    for number, prim in enumerate(prims):
        if not names[number]:
            parts = prim.path.split("/")
            tries = [parts[-1], *(f"{part}_{parts[-1]}" for part in parts[2:-1])]
            free = [name for name in tries if name not in names]
            names[number] = free[0] if free else "_".join(parts[2:] or parts[1:])
    return names


def pose_tree(world: World, parent: str, targets: Sequence[str]) -> Tree:
    """Expand the targets: an articulation stands for its links, all else for itself (:177-357)."""
    pairs: list[Pair] = []
    prims, names = world.scene.prims, dict[str, str]()
    parent = parent if parent in prims else ""

    def named(path: str) -> str:
        """Who comes first keeps a name, the next one goes by its path (:412-443)."""
        if path and path not in names:
            name = frame_name(prims[path])
            names[path] = path[1:].replace("/", "_") if name in names.values() else name
        return names[path] if path else _WORLD

    named(parent)
    for target in targets:
        prim = prims[target]
        machine = world.machines.articulation(target) if ROOT in prim.apis else None
        links = {target: ""} if machine is None else _links(machine)
        for path, above in links.items():
            pair = Pair(
                named(above or parent),
                named(path),
                above or parent,
                path,
                prim.type == "Camera",
            )
            if above or pair.parent != pair.child or BODY not in prims[path].apis:  # :280, :324
                pairs.append(pair)
    return Tree(tuple(pairs))


def _links(machine: Machine) -> dict[str, str]:
    """Return the links of an articulation, each with the one that its joint hangs it on."""
    links = {machine.base: ""}
    for path in machine.rest:
        joint = machine.parents.get(path)
        if joint is not None and not joint.excluded:
            above = joint.bodies[0] if joint.bodies[1] == path else joint.bodies[1]
            if above in links:
                links[path] = above
    return links


TF = "tf2_msgs/msg/TFMessage"


@computes("ROS2PublishRawTransformTree")
def publish_raw_transform(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishRawTransformTree.cpp:60-140."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None:
        return False
    if not ready:
        for name in ("parentFrameId", "childFrameId"):
            node.memory[name] = node.text(name, world)
        return True
    transform = Transform(
        node.memory["parentFrameId"],
        node.memory["childFrameId"],
        node.vector("translation", world),
        wxyz(node, "rotation", world),
    )
    return _send_tree(node, world, endpoint, (transform,))


def _send_tree(
    node: NodeInstance, world: World, endpoint: RosEndpoint, tree: tuple[Transform, ...]
) -> bool:
    static = node.flag("staticPublisher", world)
    if static and node.memory.get("sent"):
        return False
    node.memory["sent"] = True
    stamp = node.stamp(world)
    send(node, world, endpoint, Message(TF, stamp, data=tree, static=static))
    return True


@computes("IsaacComputeTransformTree")
def compute_transform_tree(node: NodeInstance, world: World) -> bool:
    """CN/nodes/OgnIsaacComputeTransformTree.cpp."""
    tree: Tree | None = node.memory.get("tree")
    if tree is None:
        parents, targets = node.targets("parentPrim"), node.targets("targetPrims")
        tree = node.memory["tree"] = Tree.of(world.scene, parents[0] if parents else "", targets)
        pairs = tree.pairs
        node.memory["names"] = tuple(p.parent for p in pairs), tuple(p.child for p in pairs)
    if not tree.pairs:
        node.memory.clear()
        return node.fails("none of its target prims exists", "no-target-prim")
    poses = [pair.pose(world) for pair in tree.pairs]
    parents, children = node.memory["names"]
    node.outputs.update(
        parentFrames=parents,
        childFrames=children,
        translations=tuple(pose.origin for pose in poses),
        orientations=tuple(xyzw(pose) for pose in poses),
    )
    return node.goes_on()


@computes("ROS2PublishTransformTree")
def publish_transform_tree(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishTransformTree.cpp:60-300: where from is decided once, at creation."""
    memory = node.memory
    if "endpoint" not in memory:
        if not node.items("parentFrames", world):
            parents, targets = node.targets("parentPrim"), node.targets("targetPrims")
            if not targets or not set(targets) <= world.scene.prims.keys():
                # Tried again at the next tick: there is no publisher yet.
                return node.fails(
                    "no frames reach it, and it has no target prims", "no-frames-input"
                )
            memory["tree"] = pose_tree(world, parents[0] if parents else "", targets)
        return opened_endpoint(node, world)[0] is not None
    if memory["endpoint"] is None:
        memory.clear()
        return False
    if "tree" in memory:
        transforms = tuple(
            Transform(pair.parent, pair.child, _metres(pair.pose(world), world), pair.turn(world))
            for pair in memory["tree"].pairs
        )
        return _send_tree(node, world, memory["endpoint"], transforms)
    arrays: list[tuple[Any, ...]] = [
        *(node.items(name, world) for name in ("parentFrames", "childFrames")),
        *(node.vectors(name, world, k) for name, k in (("translations", 3), ("orientations", 4))),
    ]
    if not arrays[0] or len({len(array) for array in arrays}) > 1:
        return node.fails("its four arrays have different lengths", "unequal-frame-arrays")
    transforms = tuple(
        Transform(str(parent), str(child), _metres(Affine(HERE.rows, at), world), (q[3], *q[:3]))
        for parent, child, at, q in zip(*arrays, strict=True)
    )
    return _send_tree(node, world, memory["endpoint"], transforms)


def _metres(place: Affine, world: World) -> Vector:
    unit = world.scene.meters_per_unit
    x, y, z = place.origin
    return (x * unit, y * unit, z * unit)
