"""Publishers of time, odometry and transforms.

RN is isaacsim.ros2.nodes, CN isaacsim.core.nodes.
"""

from __future__ import annotations

from typing import Any

from executor.affine import HERE, Affine, Vector, cross, dot, length
from executor.execution import Running, computes
from executor.frames import Tree
from executor.record import Message, Odometry, Transform
from executor.ros import opened, send

TF = "tf2_msgs/msg/TFMessage"
NO_TURN = (0.0, 0.0, 0.0, 1.0)


@computes("isaacsim.ros2.bridge.ROS2PublishClock")
def publish_clock(node: Running, world: Any) -> bool:
    """RN/nodes/OgnROS2PublishClock.cpp:40-110."""
    endpoint, ready = opened(node, world)
    if endpoint is None or not ready:
        return endpoint is not None
    stamp = float(node.get("timeStamp", world) or 0.0)
    send(node, world, endpoint, Message("rosgraph_msgs/msg/Clock", stamp, data=stamp))
    return True


@computes("isaacsim.core.nodes.IsaacComputeOdometry")
def compute_odometry(node: Running, world: Any) -> bool:
    """CN/nodes/OgnIsaacComputeOdometry.cpp:77-360: the way since Play, seen from its start."""
    path = node.memory.get("path") or _chassis(node, world)
    if path is None:
        return False
    now = world.machines.place(path)
    if "path" not in node.memory:
        node.memory.update(path=path, start=now.inverse())
    start: Affine = node.memory["start"]
    velocity, turning = world.machines.velocity(path)
    there = start.then(now)
    unit = world.scene.meters_per_unit
    back = now.inverse()
    node.outputs.update(
        position=tuple(x * unit for x in there.origin),
        orientation=_xyzw(there),
        linearVelocity=back.turn(velocity),
        globalLinearVelocity=velocity,
        angularVelocity=turning,
    )
    node.enabled.append("execOut")
    return True


def _chassis(node: Running, world: Any) -> str | None:
    """Return the body that is watched, or None where there is none."""
    targets = node.targets("chassisPrim")
    prim = world.scene.prims.get(targets[0]) if targets else None
    body, root = "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI"
    if prim is not None and not prim.apis & {body, root} and "IsaacRobotAPI" in prim.apis:
        links = prim.targets.get("isaac:physics:robotLinks", ())
        prim = world.scene.prims.get(links[0]) if links else None
    if prim is None or not prim.apis & {body, root}:
        return None
    if body in prim.apis:
        return str(prim.path)
    machine = world.machines.articulation(prim.path)
    return machine.base if machine is not None else None


def _xyzw(place: Affine) -> tuple[float, float, float, float]:
    w, x, y, z = place.quaternion()
    return (x, y, z, w)


def _wxyz(node: Running, name: str, world: Any) -> tuple[float, float, float, float]:
    """Return a quaternion input: OGN's order is x, y, z, w; a file's literal has w first."""
    value = node.get(name, world)
    if not isinstance(value, tuple) or len(value) != 4:
        value = NO_TURN
    elif name not in node.wires and f"inputs:{name}" in node.node.inputs:
        saved = node.node.inputs[f"inputs:{name}"].value
        if saved == value:
            return value
    x, y, z, w = value
    return (w, x, y, z)


def _vector(node: Running, name: str, world: Any) -> Vector:
    value = node.get(name, world)
    usable = isinstance(value, tuple) and len(value) == 3
    return value if usable else (0.0, 0.0, 0.0)


@computes("isaacsim.ros2.bridge.ROS2PublishOdometry")
def publish_odometry(node: Running, world: Any) -> bool:
    """RN/nodes/OgnROS2PublishOdometry.cpp:69-145."""
    endpoint, ready = opened(node, world)
    if endpoint is None:
        return False
    if not ready:
        for each in ("odomFrameId", "chassisFrameId"):
            node.memory[each] = str(node.get(each, world) or "")
        x, y, _ = _vector(node, "robotFront", world)
        size = length((x, y, 0.0)) or 1.0
        node.memory["front"] = (x / size, y / size, 0.0)
        return True
    linear, angular = _velocities(node, world)
    data = Odometry(
        node.memory["chassisFrameId"],
        _vector(node, "position", world),
        _wxyz(node, "orientation", world),
        linear,
        angular,
    )
    stamp = float(node.get("timeStamp", world) or 0.0)
    frame = node.memory["odomFrameId"]
    send(node, world, endpoint, Message("nav_msgs/msg/Odometry", stamp, frame, data))
    return True


def _velocities(node: Running, world: Any) -> tuple[Vector, Vector]:
    linear = _vector(node, "linearVelocity", world)
    angular = _vector(node, "angularVelocity", world)
    if node.get("publishRawVelocities", world):
        return linear, angular
    front: Vector = node.memory["front"]
    up = (0.0, 0.0, 1.0) if world.scene.up == "Z" else (0.0, 1.0, 0.0)
    unit = world.scene.meters_per_unit
    along = (
        dot(front, linear) * unit,
        dot(cross(up, front), linear) * unit,
        dot(up, linear) * unit,
    )
    return along, (0.0, 0.0, dot(up, angular))


@computes("isaacsim.ros2.bridge.ROS2PublishRawTransformTree")
def publish_raw_transform(node: Running, world: Any) -> bool:
    """RN/nodes/OgnROS2PublishRawTransformTree.cpp:60-140."""
    endpoint, ready = opened(node, world)
    if endpoint is None:
        return False
    if not ready:
        for each in ("parentFrameId", "childFrameId"):
            node.memory[each] = str(node.get(each, world) or "")
        return True
    transform = Transform(
        node.memory["parentFrameId"],
        node.memory["childFrameId"],
        _vector(node, "translation", world),
        _wxyz(node, "rotation", world),
    )
    return _send_tree(node, world, endpoint, (transform,))


def _send_tree(node: Running, world: Any, endpoint: Any, tree: tuple[Transform, ...]) -> bool:
    static = bool(node.get("staticPublisher", world))
    if static and node.memory.get("sent"):
        return False
    node.memory["sent"] = True
    stamp = float(node.get("timeStamp", world) or 0.0)
    send(node, world, endpoint, Message(TF, stamp, data=tree, static=static))
    return True


@computes("isaacsim.core.nodes.IsaacComputeTransformTree")
def compute_transform_tree(node: Running, world: Any) -> bool:
    """CN/nodes/OgnIsaacComputeTransformTree.cpp."""
    tree = node.memory.get("tree")
    if tree is None:
        parents, targets = node.targets("parentPrim"), node.targets("targetPrims")
        tree = node.memory["tree"] = Tree.of(world.scene, parents[0] if parents else "", targets)
    if not tree.pairs:
        node.memory.clear()
        return False
    poses = [pair.pose(world) for pair in tree.pairs]
    node.outputs.update(
        parentFrames=tuple(pair.parent for pair in tree.pairs),
        childFrames=tuple(pair.child for pair in tree.pairs),
        translations=tuple(each.origin for each in poses),
        orientations=tuple(_xyzw(each) for each in poses),
    )
    node.enabled.append("execOut")
    return True


@computes("isaacsim.ros2.bridge.ROS2PublishTransformTree")
def publish_transform_tree(node: Running, world: Any) -> bool:
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
        node.get(name, world) or ()
        for name in ("parentFrames", "childFrames", "translations", "orientations")
    ]
    if not arrays[0] or len({len(each) for each in arrays}) > 1:
        return False
    transforms = tuple(
        Transform(str(parent), str(child), _metres(Affine(HERE.rows, at), world), (q[3], *q[:3]))
        for parent, child, at, q in zip(*arrays, strict=True)
    )
    return _send_tree(node, world, known["endpoint"], transforms)


def _decide(node: Running, world: Any) -> bool:
    known = node.memory
    if not node.get("parentFrames", world):
        parents, targets = node.targets("parentPrim"), node.targets("targetPrims")
        if not targets or not set(targets) <= world.scene.prims.keys():
            return False  # tried again: no publisher yet
        known["tree"] = Tree.of(
            world.scene, parents[0] if parents else "", targets, deprecated=True
        )
    endpoint, _ = opened(node, world)
    return endpoint is not None


def _metres(place: Affine, world: Any) -> Vector:
    unit = world.scene.meters_per_unit
    x, y, z = place.origin
    return (x * unit, y * unit, z * unit)
