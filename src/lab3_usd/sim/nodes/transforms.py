"""Publishers of transforms, and which frames they publish. CN is core nodes, RN ROS 2 nodes.

All lines are those of PoseTree.h in core.includes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

from msgspec import Struct

from lab3_usd.isaac.topics import TRANSFORMS
from lab3_usd.model.dry_run import Affine, Scene, ScenePrim
from lab3_usd.model.physics import EXCLUDED
from lab3_usd.model.transforms import Vector
from lab3_usd.physics.machine import Machine, Posture, Spot
from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.recording import Later, Message, Transforms
from lab3_usd.sim.execution.world import RosEndpoint, World, opened_endpoint, send
from lab3_usd.sim.nodes.core import wxyz, xyzw

ROOT, BODY, ROBOT = "PhysicsArticulationRootAPI", "PhysicsRigidBodyAPI", "IsaacRobotAPI"
LINK, JOINT = "IsaacLinkAPI", "IsaacJointAPI"
COMPONENTS = {LINK, "IsaacSiteAPI", "IsaacReferencePointAPI"}
OPTICAL = Affine(((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))  # 180 degrees about X


_WORLD = "world"


class Pair(Struct, frozen=True):
    """A transform: names, and the prims that stand for them."""

    parent: str
    child: str
    above: Spot
    below: Spot
    camera: bool

    def pose(self, stood: Mapping[str, Posture]) -> Affine:
        """Return where the child stands in its parent's frame, in stage units."""
        child = self.below.place(stood.get(self.below.base))
        child = child.then(OPTICAL) if self.camera else child
        return self.above.back(stood.get(self.above.base)).then(child)


class NodeTransforms(Struct, frozen=True, dict=True):
    """The transforms of a node, in order."""

    pairs: tuple[Pair, ...]

    @cached_property
    def frames(self) -> tuple[tuple[str, str], ...]:
        """The names of parents and children."""
        return tuple((pair.parent, pair.child) for pair in self.pairs)

    @cached_property
    def _machines(self) -> tuple[Machine, ...]:
        spots = (spot for pair in self.pairs for spot in (pair.above, pair.below))
        return tuple({spot.base: spot.machine for spot in spots if spot.machine}.values())

    def now(self) -> Later[Affine]:
        """Return where the children stand now in the frames of their parents, in stage units."""
        stood = {machine.base: machine.posture() for machine in self._machines}
        return Later(len(self.pairs), lambda: tuple(pair.pose(stood) for pair in self.pairs))

    @classmethod
    def of(cls, world: World, parent: str, targets: Sequence[str]) -> NodeTransforms:
        """Expand the targets; of a prim that is found twice the last parent counts."""
        scene, spot = world.scene, world.machines.spot
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
                spot(above if is_frame else top_prim),
                spot(prim.path),
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
        above, below = joint.ends if joint is not None else ("", "")
        if above and below:
            parents[below] = above
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


def pose_tree(world: World, parent: str, targets: Sequence[str]) -> NodeTransforms:
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
                world.machines.spot(above or parent),
                world.machines.spot(path),
                prim.type == "Camera",
            )
            if above or pair.parent != pair.child or BODY not in prims[path].apis:  # :280, :324
                pairs.append(pair)
    return NodeTransforms(tuple(pairs))


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


@computes("ROS2PublishRawTransformTree")
def publish_raw_transform(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishRawTransformTree.cpp:60-140."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None:
        return False
    if not ready:
        names = (node.text(name, world) for name in ("parentFrameId", "childFrameId"))
        node.memory["frames"] = (tuple(names),)
        return True
    pose = node.vector("translation", world), wxyz(node, "rotation", world)
    return _send_tree(node, world, endpoint, Transforms(node.memory["frames"], (pose,)))


def _send_tree(node: NodeInstance, world: World, endpoint: RosEndpoint, tree: Transforms) -> bool:
    static = node.flag("staticPublisher", world)
    if static and node.memory.get("sent"):
        return False
    node.memory["sent"] = True
    stamp = node.number("timeStamp", world)
    send(node, world, endpoint, Message(TRANSFORMS, stamp, data=tree, static=static))
    return True


@computes("IsaacComputeTransformTree")
def compute_transform_tree(node: NodeInstance, world: World) -> bool:
    """CN/nodes/OgnIsaacComputeTransformTree.cpp."""
    tree: NodeTransforms | None = node.memory.get("tree")
    if tree is None:
        parent, targets = node.target("parentPrim"), node.targets("targetPrims")
        tree = node.memory["tree"] = NodeTransforms.of(world, parent, targets)
        node.memory["names"] = tuple(zip(*tree.frames, strict=True))
    if not tree.pairs:
        node.memory.clear()
        return node.fails("none of its target prims exists", "no-target-prim")
    poses, count = tree.now(), len(tree.pairs)
    parents, children = node.memory["names"]
    node.outputs.update(
        parentFrames=parents,
        childFrames=children,
        translations=Later(count, lambda: tuple(pose.origin for pose in poses)),
        orientations=Later(count, lambda: tuple(xyzw(pose) for pose in poses)),
    )
    return node.goes_on()


@computes("ROS2PublishTransformTree")
def publish_transform_tree(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishTransformTree.cpp:60-300: where from is decided once, at creation."""
    memory = node.memory
    if "endpoint" not in memory:
        if not node.items("parentFrames", world):
            targets = node.targets("targetPrims")
            if not targets or not set(targets) <= world.scene.prims.keys():
                # Tried again at the next tick: there is no publisher yet.
                return node.fails(
                    "no frames reach it, and it has no target prims", "no-frames-input"
                )
            memory["tree"] = pose_tree(world, node.target("parentPrim"), targets)
        return opened_endpoint(node, world)[0] is not None
    if memory["endpoint"] is None:
        memory.clear()
        return False
    unit = world.scene.meters_per_unit
    if "tree" in memory:
        tree: NodeTransforms = memory["tree"]
        placed = tree.now()
        poses = Later(
            len(placed), lambda: tuple((_metres(p.origin, unit), p.quaternion()) for p in placed)
        )
        return _send_tree(node, world, memory["endpoint"], Transforms(tree.frames, poses))
    parents, children = (node.items(name, world) for name in ("parentFrames", "childFrames"))
    places, turns = (
        node.vectors_later(name, world, size)
        for name, size in (("translations", 3), ("orientations", 4))
    )
    count = len(parents)
    if not count == len(children) == len(places) == len(turns) or not count:
        return node.fails("its four arrays have different lengths", "unequal-frame-arrays")
    frames = tuple(zip(map(str, parents), map(str, children), strict=True))
    poses = Later(
        count,
        lambda: tuple(
            (_metres(place, unit), (w, x, y, z))
            for place, (x, y, z, w) in zip(places, turns, strict=True)
        ),
    )
    return _send_tree(node, world, memory["endpoint"], Transforms(frames, poses))


def _metres(at: Sequence[float], unit: float) -> Vector:
    x, y, z = at
    return (x * unit, y * unit, z * unit)
