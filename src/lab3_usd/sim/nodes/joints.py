"""Joint states: read, published and heard.

RN is ROS 2 nodes, SN the nodes of physics sensors, RM Ros2Message.cpp of ROS 2 core.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from lab3_usd.isaac.pure_nodes import are_numbers
from lab3_usd.isaac.topics import JOINT_STATES
from lab3_usd.physics.machine import SLIDER, Joint
from lab3_usd.sim.execution.node_instance import NodeInstance, computes
from lab3_usd.sim.execution.recording import JointStates, Message
from lab3_usd.sim.execution.world import World, open_endpoint, send
from lab3_usd.sim.nodes.robot import joints_at, received, robot_path

_ROTATION, _TRANSLATION = 0, 1  # of a degree of freedom
_DIGITS = 4  # to which states are rounded (RM:1190, 1250)
_STATES = ("jointNames", "jointPositions", "jointVelocities", "jointEfforts", "jointDofTypes")


@computes("IsaacReadJointState")
def read_joint_state(node: NodeInstance, world: World) -> bool:
    """SN/nodes/OgnIsaacReadJointState.cpp:44-160; efforts are not known and are 0."""
    target = node.target("prim")
    machine = world.machines.viewed(target) if target else None
    joints = [] if machine is None else [*machine.articulated.values()]
    node.outputs.update(
        _states_of(joints),
        jointEfforts=(0.0,) * len(joints),
        jointDofTypes=tuple(map(_degree, joints)),
        stageMetersPerUnit=world.scene.meters_per_unit if joints else 0.0,
        sensorTime=world.since_play if joints else 0.0,
    )
    if not target:
        return node.fails("it has no prim", "no-articulation")
    if not joints:
        text = f"{target} is not an articulation, nor a link or joint of one"
        return node.fails(text, "no-articulation")
    return node.goes_on()


def _states_of(joints: Sequence[Joint]) -> dict[str, tuple[str | float, ...]]:
    """Return the names, positions and velocities of joints, by the names of outputs."""
    return {
        "jointNames": tuple(joint.name for joint in joints),
        "jointPositions": tuple(joint.position for joint in joints),
        "jointVelocities": tuple(joint.velocity for joint in joints),
    }


def _degree(joint: Joint) -> int:
    return _TRANSLATION if joint.kind == SLIDER else _ROTATION


@computes("ROS2PublishJointState")
def publish_joint_state(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2PublishJointState.cpp:58-290: what reaches it, else what its target does."""
    names, *arrays = (node.items(name, world) for name in _STATES)
    positions, velocities, efforts, degrees = arrays
    unit = node.number("stageMetersPerUnit", world)
    stamp = node.number("sensorTime", world) or node.number("timeStamp", world)
    if names or positions or velocities or efforts or degrees:
        sizes = {len(array) for array in (names, positions, velocities, efforts, degrees)}
        if not names or len(sizes) > 1:
            return node.fails("its arrays have different lengths", "unequal-joint-arrays")
        if not all(map(are_numbers, arrays)):
            return node.fails("its arrays do not hold numbers", "unequal-joint-arrays")
        if not 0 < unit < math.inf:
            return node.fails("no unit of the stage reaches it", "unequal-joint-arrays")
    else:
        target = node.target("targetPrim")
        machine = world.machines.viewed(target) if target else None
        if machine is None:
            is_part = "is not an articulation, nor a link or joint of one"
            text = f"{target} {is_part}" if target else "it has no target"
            return node.fails(text, "no-articulation")
        joints = [*machine.articulated.values()]
        names, positions, velocities = _states_of(joints).values()
        efforts, degrees = (0.0,) * len(joints), tuple(map(_degree, joints))
        unit, stamp = world.scene.meters_per_unit, node.number("timeStamp", world)
    endpoint = node.memory.get("endpoint") or open_endpoint(node, world)
    if endpoint is None:
        return False
    node.memory["endpoint"] = endpoint
    # Isaac Sim divides lengths by the unit of the stage (RM:1156, 1233).
    scales = [1.0 / unit if degree == _TRANSLATION else 1.0 for degree in degrees]
    data = JointStates(
        tuple(map(str, names)),
        tuple([round(x * k, _DIGITS) for x, k in zip(positions, scales, strict=True)]),
        tuple([round(x * k, _DIGITS) for x, k in zip(velocities, scales, strict=True)]),
        tuple(map(float, efforts)),
    )
    send(node, world, endpoint, Message(JOINT_STATES, stamp, data=data))
    return True


@computes("ROS2SubscribeJointState")
def subscribe_joint_state(node: NodeInstance, world: World) -> bool:
    """RN/nodes/OgnROS2SubscribeJointState.cpp:40-150: what a message leaves out is no number."""
    states = received(node, world, JointStates)
    if not isinstance(states, JointStates):
        return node.failure is None and "endpoint" in node.memory
    count = len(states.names)
    arrays = (states.positions, states.velocities, states.efforts)
    if not count or all(len(array) != count for array in arrays):  # RM:1287-1302
        return False
    names = ("positionCommand", "velocityCommand", "effortCommand")
    node.outputs["jointNames"] = states.names
    for name, array in zip(names, arrays, strict=True):
        node.outputs[name] = array if len(array) == count else (math.nan,) * count
    return node.goes_on()


@computes("IsaacArticulationState")
def articulation_state(node: NodeInstance, world: World) -> bool:
    """CN/python/nodes/OgnIsaacArticulationState.py:117-165; forces are not known and are 0."""
    path = robot_path(node, world)
    machine = world.machines.articulation(path)
    if machine is None:
        return node.fails(f"there is no articulation at or below {path}", "no-articulation")
    joints = [*machine.articulated.values()]
    names, indices = node.items("jointNames", world), node.numbers("jointIndices", world)
    if names:
        if not {*names} <= machine.articulated.keys():
            return node.fails("the robot lacks one of its joints", "unknown-joint")
        joints = [machine.articulated[str(name)] for name in names]
    elif any(indices):
        chosen = joints_at(node, joints, indices)
        if chosen is None:
            return False
        joints = chosen
    zeros = ((0.0, 0.0, 0.0),) * len(joints)
    node.outputs.update(
        _states_of(joints),
        measuredJointEfforts=(0.0,) * len(joints),
        measuredJointForces=zeros,
        measuredJointTorques=zeros,
    )
    return True
