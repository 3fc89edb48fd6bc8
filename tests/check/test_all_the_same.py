"""Which messages say that the robot may drive all the same, and which must not."""

from __future__ import annotations

import pytest
from breaking import STEPS, broken, judged
from pxr import Sdf, Usd, UsdGeom, Vt
from scene_stages import Change, put, remove, several

from lab3_usd.model.finding import Finding

DRIVE = "/turtlebot3_burger/ROS_Drive"
ARRAY, WHEELS = f"{DRIVE}/make_array", f"{DRIVE}/articulation_controller"
LEFT, RIGHT = "wheel_left_joint", "wheel_right_joint"
CONSTANTS = (f"{DRIVE}/constant_left_joint", f"{DRIVE}/constant_right_joint")
SCALE, BREAK = f"{DRIVE}/scale_linear_velocity", f"{DRIVE}/break_linear_velocity"
TWIST = f"{DRIVE}/ros2_subscribe_twist"
SAID = "the robot may still drive"


def unwire(prim: str, port: str) -> Change:
    return lambda stage: stage.GetPrimAtPath(prim).GetAttribute(port).ClearConnections() and None


def wire(prim: str, port: str, *sources: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(prim).GetAttribute(port).SetConnections(
            [Sdf.Path(source) for source in sources]
        )

    return change


def names(*joints: str) -> Change:
    """Type joint names into the Articulation Controller."""
    port = "inputs:jointNames"
    typed = put(WHEELS, port, Vt.TokenArray(joints))
    return several(unwire(WHEELS, port), typed)


def typed(index: int, joint: str) -> Change:
    """Type a joint name into the array, as the Property panel saves it."""

    def change(stage: Usd.Stage) -> None:
        port = stage.GetPrimAtPath(ARRAY).GetAttribute(f"inputs:input{index}")
        port.ClearConnections()
        port.SetCustomDataByKey("omni:graph:attrType", "token")
        port.SetCustomDataByKey("omni:graph:attrValue", joint)

    return change


def without(*prims: str) -> Change:
    return several(*map(remove, prims))


def around(stage: Usd.Stage) -> None:
    """Wire the velocity past the node that scales it."""
    wire(BREAK, "inputs:tuple", f"{TWIST}.outputs:linearVelocity")(stage)


def errors(change: Change) -> list[Finding]:
    stage = broken("02", [])
    change(stage)
    return [finding for finding in judged(stage, "02").findings if finding.severity == "error"]


DRIVES = {
    "no names": unwire(WHEELS, "inputs:jointNames"),
    "names in the controller": names(LEFT, RIGHT),
    "names in the controller alone": several(names(LEFT, RIGHT), without(ARRAY, *CONSTANTS)),
    "no names anywhere": several(unwire(WHEELS, "inputs:jointNames"), without(ARRAY, *CONSTANTS)),
    "names in the array": several(typed(0, LEFT), typed(1, RIGHT), without(*CONSTANTS)),
    "a name in the array": typed(1, RIGHT),
    "no scaling": several(without(SCALE), around),
    "around the scaling": around,
    "the other conversion": put(SCALE, "inputs:conversion", "Convert to meters"),
}
STANDS = {
    "names in the wrong order": several(names(RIGHT, LEFT), without(ARRAY, *CONSTANTS)),
    "one name": names(LEFT),
    "names that no joint has": names("left", "right"),
    "names in the array, exchanged": several(typed(0, RIGHT), typed(1, LEFT), without(*CONSTANTS)),
    "no names in the array": without(*CONSTANTS),
    "an empty array": several(unwire(ARRAY, "inputs:input0"), unwire(ARRAY, "inputs:input1")),
    "no scaling and no wire": without(SCALE),
    "the wrong velocity around the scaling": several(
        without(SCALE), wire(BREAK, "inputs:tuple", f"{TWIST}.outputs:angularVelocity")
    ),
    "no conversion": put(SCALE, "inputs:conversion", "nothing"),
    "in centimetres": several(
        lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0.01) and None, without(SCALE), around
    ),
    "no tick": unwire(WHEELS, "inputs:execIn"),
    "no command": unwire(WHEELS, "inputs:velocityCommand"),
}


@pytest.mark.parametrize("change", DRIVES.values(), ids=DRIVES)
def test_a_fault_that_does_not_stop_the_robot_says_so(change: Change) -> None:
    found = errors(change)
    assert found
    assert [each.message for each in found if SAID not in each.message] == []


@pytest.mark.parametrize("change", STANDS.values(), ids=STANDS)
def test_a_fault_that_stops_the_robot_promises_nothing(change: Change) -> None:
    found = errors(change)
    assert found
    assert [each.message for each in found if SAID in each.message] == []


def hint_of(rule: str, checkpoint: str, *places: str) -> str:
    stage = broken(checkpoint, [])
    STEPS["connect"](stage, *places)
    (found,) = [finding for finding in judged(stage, checkpoint).findings if finding.rule == rule]
    return found.hint or ""


PROFILE = "ROS_Lidar2D/ros2_rtx_lidar_helper.inputs:qosProfile"
TEXT = "ROS_Drive/constant_left_joint.inputs:value"


@pytest.mark.parametrize(("rule", "checkpoint"), [("P04", "05"), ("Q04", "06")])
def test_a_profile_that_comes_by_a_wire_goes_with_the_wire(rule: str, checkpoint: str) -> None:
    hint = hint_of(rule, checkpoint, PROFILE, TEXT)
    assert hint.startswith("in ROS_Lidar2D, delete the wire from constant_left_joint.inputs:value")


def test_a_value_that_comes_by_a_wire_goes_with_the_wire() -> None:
    topic = "ROS_Drive/ros2_subscribe_twist.inputs:topicName"
    hint = hint_of("P01", "05", topic, TEXT)
    assert hint.startswith(
        "in ROS_Drive, delete the wire from constant_left_joint.inputs:value, then select"
    )
