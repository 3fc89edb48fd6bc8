"""Publishers of transforms. RN is ROS 2 nodes, CN core nodes."""

from __future__ import annotations

from lab3_usd.model.dry_run.affine import HERE, Affine
from lab3_usd.model.transform_math import Vector
from lab3_usd.sim.execution.record import Message, Transform
from lab3_usd.sim.execution.registry import computes
from lab3_usd.sim.execution.ros import Endpoint, opened_endpoint, send
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.execution.world import World
from lab3_usd.sim.nodes.frames import Tree
from lab3_usd.sim.nodes.pose_tree import pose_tree
from lab3_usd.sim.nodes.quaternions import wxyz, xyzw

TF = "tf2_msgs/msg/TFMessage"


@computes("ROS2PublishRawTransformTree")
def publish_raw_transform(node: Running, world: World) -> bool:
    """RN/nodes/OgnROS2PublishRawTransformTree.cpp:60-140."""
    endpoint, ready = opened_endpoint(node, world)
    if endpoint is None:
        return False
    if not ready:
        for each in ("parentFrameId", "childFrameId"):
            node.memory[each] = node.text(each, world)
        return True
    transform = Transform(
        node.memory["parentFrameId"],
        node.memory["childFrameId"],
        node.vector("translation", world),
        wxyz(node, "rotation", world),
    )
    return _send_tree(node, world, endpoint, (transform,))


def _send_tree(
    node: Running, world: World, endpoint: Endpoint, tree: tuple[Transform, ...]
) -> bool:
    static = node.flag("staticPublisher", world)
    if static and node.memory.get("sent"):
        return False
    node.memory["sent"] = True
    stamp = node.number("timeStamp", world)
    send(node, world, endpoint, Message(TF, stamp, data=tree, static=static))
    return True


@computes("IsaacComputeTransformTree")
def compute_transform_tree(node: Running, world: World) -> bool:
    """CN/nodes/OgnIsaacComputeTransformTree.cpp."""
    tree: Tree | None = node.memory.get("tree")
    if tree is None:
        parents, targets = node.targets("parentPrim"), node.targets("targetPrims")
        tree = node.memory["tree"] = Tree.of(world.scene, parents[0] if parents else "", targets)
    if not tree.pairs:
        node.memory.clear()
        return node.fails("none of its target prims is there", "R01")
    poses = [pair.pose(world) for pair in tree.pairs]
    node.outputs.update(
        parentFrames=tuple(pair.parent for pair in tree.pairs),
        childFrames=tuple(pair.child for pair in tree.pairs),
        translations=tuple(each.origin for each in poses),
        orientations=tuple(xyzw(each) for each in poses),
    )
    node.enabled.append("execOut")
    return True


@computes("ROS2PublishTransformTree")
def publish_transform_tree(node: Running, world: World) -> bool:
    """RN/nodes/OgnROS2PublishTransformTree.cpp:60-300: where from is decided once, at creation."""
    known = node.memory
    if "endpoint" not in known:
        return _decide(node, world)
    if known["endpoint"] is None:
        known.clear()
        return False
    if "tree" in known:
        transforms = tuple(
            Transform(pair.parent, pair.child, _metres(pair.pose(world), world), pair.turn(world))
            for pair in known["tree"].pairs
        )
        return _send_tree(node, world, known["endpoint"], transforms)
    arrays = [
        node.items(name, world)
        for name in ("parentFrames", "childFrames", "translations", "orientations")
    ]
    if not arrays[0] or len({len(each) for each in arrays}) > 1:
        return node.fails("its four arrays are not equally long", "W01")
    transforms = tuple(
        Transform(str(parent), str(child), _metres(Affine(HERE.rows, at), world), (q[3], *q[:3]))
        for parent, child, at, q in zip(*arrays, strict=True)
    )
    return _send_tree(node, world, known["endpoint"], transforms)


def _decide(node: Running, world: World) -> bool:
    known = node.memory
    if not node.items("parentFrames", world):
        parents, targets = node.targets("parentPrim"), node.targets("targetPrims")
        if not targets or not set(targets) <= world.scene.prims.keys():
            # Tried again at the next tick: there is no publisher yet.
            return node.fails("no frames reach it, and it has no target prims", "W01")
        known["tree"] = pose_tree(world, parents[0] if parents else "", targets)
    endpoint, _ = opened_endpoint(node, world)
    return endpoint is not None


def _metres(place: Affine, world: World) -> Vector:
    unit = world.scene.meters_per_unit
    x, y, z = place.origin
    return (x * unit, y * unit, z * unit)
