"""Stages that show one kind of fault each, in one check of a dry run."""

from __future__ import annotations

from breaking import STEPS, Step
from pxr import Gf
from scene_stages import (
    CAMERA,
    JOINTS,
    LIDAR,
    MATERIALS,
    ROBOT,
    Change,
    put,
    several,
    slick,
    switch,
    weld,
)

from lab3_usd.model.fault import FaultKind


def steps(*changes: Step) -> Change:
    def change(stage: object) -> None:
        for step in changes:
            for name, arguments in step.items():
                STEPS[name](stage, *(arguments if isinstance(arguments, list) else [arguments]))

    return change


def value(place: str, setting: object) -> Change:
    return steps({"set": [place, setting]})


def cut(place: str) -> Change:
    return steps({"disconnect": place})


CLOCK, READ_TIME = "ROS_Clock/ros2_publish_clock", "ROS_Clock/isaac_read_simulation_time"
DIFFERENTIAL, CONTROLLER = "ROS_Drive/differential_controller", "ROS_Drive/articulation_controller"
NAMES, LEFT = "ROS_Drive/make_array", f"{JOINTS}/wheel_left_joint"
RIGHT = f"{JOINTS}/wheel_right_joint"
RAW, TREE = "ROS_OdomTF/ros2_publish_raw_transform_tree", "ROS_OdomTF/ros2_publish_transform_tree"
ODOMETRY, TREE_TARGETS = (
    "ROS_OdomTF/ros2_publish_odometry",
    "ROS_OdomTF/isaac_compute_transform_tree.inputs:targetPrims",
)
LIDAR_PRODUCT = "ROS_Lidar2D/isaac_create_render_product"
LIDAR_HELPER = "ROS_Lidar2D/ros2_rtx_lidar_helper"
IMAGE_PRODUCT = "ROS_Camera/isaac_create_render_product"
INFO = "ROS_Camera/ros2_camera_info_helper"

STAGES: dict[FaultKind, tuple[Change, str]] = {
    "graph-not-evaluated": (value("ROS_Clock.pipelineStage", "pipelineStageOnDemand"), "topics"),
    "simulation-stopped": (
        steps(
            {"node": ["ROS_Clock/stop", "omni.graph.nodes.StopTimeline"]},
            {"declare": ["ROS_Clock/stop.inputs:execIn", "uint"]},
            {
                "connect": [
                    "ROS_Clock/stop.inputs:execIn",
                    "ROS_Clock/on_playback_tick.outputs:tick",
                ]
            },
        ),
        "graphs",
    ),
    "unknown-type": (
        value("ROS_Clock/ros2_context.node:type", "isaacsim.ros2.nodes.ROS2Context"),
        "graphs",
    ),
    "refused-wire": (
        steps({"connect": [f"{CLOCK}.inputs:topicName", f"{READ_TIME}.outputs:simulationTime"]}),
        "graphs",
    ),
    "unknown-port": (
        steps({"connect": [f"{CLOCK}.inputs:timeStamp", f"{READ_TIME}.outputs:time"]}),
        "graphs",
    ),
    "not-executed": (cut(f"{CLOCK}.inputs:execIn"), "topics"),
    "switched-off": (value(f"{LIDAR_PRODUCT}.inputs:enabled", False), "topics"),  # noqa: FBT003
    "zero-gate-step": (
        steps(
            {"node": ["ROS_Clock/gate", "isaacsim.core.nodes.IsaacSimulationGate"]},
            {"declare": ["ROS_Clock/gate.inputs:step", "uint", 0]},
            {"declare": ["ROS_Clock/gate.inputs:execIn", "uint"]},
            {
                "connect": [
                    "ROS_Clock/gate.inputs:execIn",
                    "ROS_Clock/on_playback_tick.outputs:tick",
                ]
            },
            {"connect": [f"{CLOCK}.inputs:execIn", "ROS_Clock/gate.outputs:execOut"]},
        ),
        "topics",
    ),
    "invalid-conversion": (
        value("ROS_Drive/scale_linear_velocity.inputs:conversion", "to feet"),
        "follows",
    ),
    "no-number-input": (cut("ROS_Drive/scale_linear_velocity.inputs:value"), "follows"),
    "no-vector-input": (cut("ROS_Drive/break_linear_velocity.inputs:tuple"), "follows"),
    "wrong-array-type": (
        steps(
            {"set": [f"{NAMES}.inputs:arrayType", "double[]"]},
            {"connect": [f"{CONTROLLER}.inputs:velocityCommand", f"{NAMES}.outputs:array"]},
        ),
        "follows",
    ),
    "invalid-context": (
        steps({"disconnect": f"{CLOCK}.inputs:context"}, {"set": [f"{CLOCK}.inputs:context", 99]}),
        "topics",
    ),
    "unmatched-peer": (
        value(
            "ROS_Drive/ros2_subscribe_twist.inputs:qosProfile",
            '{"history": "keepLast", "depth": 5, "reliability": "reliable", '
            '"durability": "transientLocal", "deadline": 0.0, "lifespan": 0.0, '
            '"liveliness": "systemDefault", "leaseDuration": 0.0}',
        ),
        "follows",
    ),
    "invalid-qos-profile": (value(f"{CLOCK}.inputs:qosProfile", "reliable"), "topics"),
    "invalid-topic-name": (value(f"{CLOCK}.inputs:topicName", "1 2"), "topics"),
    "ramp-without-time-step": (value(f"{DIFFERENTIAL}.inputs:maxAcceleration", 1.0), "follows"),
    "invalid-wheel-size": (value(f"{DIFFERENTIAL}.inputs:wheelRadius", 0.0), "follows"),
    "no-joint-controller": (steps({"remove": CONTROLLER}), "follows"),
    "no-articulation": (
        steps({"targets": [f"{CONTROLLER}.inputs:targetPrim", "/World"]}),
        "follows",
    ),
    "excluded-joint": (switch(LEFT, "physics:excludeFromArticulation", on=True), "follows"),
    "empty-joint-name": (cut(f"{NAMES}.inputs:input0"), "follows"),
    "unknown-joint": (value("ROS_Drive/constant_left_joint.inputs:value", "wheel"), "follows"),
    "wrong-command-count": (value(f"{NAMES}.inputs:arraySize", 1), "follows"),
    "non-numeric-command": (
        steps({"connect": [f"{CONTROLLER}.inputs:velocityCommand", f"{NAMES}.outputs:array"]}),
        "follows",
    ),
    "no-chassis-body": (
        steps({"targets": ["ROS_OdomTF/isaac_compute_odometry.inputs:chassisPrim", "/World"]}),
        "topics",
    ),
    "no-driven-robot": (
        steps({"deactivate": LEFT}, {"deactivate": RIGHT}),
        "follows",
    ),
    "kinematic-link": (
        switch(f"{ROBOT}/wheel_left_link", "physics:kinematicEnabled", on=True),
        "follows",
    ),
    "base-fixed-to-world": (weld(f"{JOINTS}/hold", body1=f"{ROBOT}/base_footprint"), "follows"),
    "no-gravity": (put("/physicsScene", "physics:gravityMagnitude", 0.0), "follows"),
    "no-ground": (steps({"deactivate": "/Environment/GroundPlane/CollisionPlane"}), "follows"),
    "no-wheel-contact": (
        steps(
            {"deactivate": f"{ROBOT}/wheel_left_link/collisions"},
            {"deactivate": f"{ROBOT}/wheel_right_link/collisions"},
        ),
        "follows",
    ),
    "tips-over": (
        put(f"{ROBOT}/base_link", "physics:centerOfMass", Gf.Vec3f(0.5, 0, 0)),
        "follows",
    ),
    "locked-joint": (
        weld(f"{JOINTS}/lock", body0=f"{ROBOT}/base_link", body1=f"{ROBOT}/wheel_left_link"),
        "follows",
    ),
    "no-velocity-drive": (put(LEFT, "drive:angular:physics:damping", 0.0), "follows"),
    "weak-drive": (
        several(*(put(each, "drive:angular:physics:maxForce", 1e-4) for each in (LEFT, RIGHT))),
        "follows",
    ),
    "no-grip": (
        slick(*MATERIALS),
        "follows",
    ),
    "limited-joint": (put(LEFT, "physics:upperLimit", 90.0), "follows"),
    "moves-uncommanded": (
        steps(
            {"disconnect": f"{DIFFERENTIAL}.inputs:linearVelocity"},
            {"set": [f"{DIFFERENTIAL}.inputs:linearVelocity", 0.1]},
        ),
        "rest",
    ),
    "moves-sideways": (
        steps(
            {
                "connect": [
                    f"{DIFFERENTIAL}.inputs:linearVelocity",
                    "ROS_Drive/break_linear_velocity.outputs:y",
                ]
            }
        ),
        "rest",
    ),
    "does-not-stop": (
        steps(
            {
                "connect": [
                    f"{DIFFERENTIAL}.inputs:dt",
                    "ROS_Drive/on_playback_tick.outputs:deltaSeconds",
                ]
            },
            {"set": [f"{DIFFERENTIAL}.inputs:maxAcceleration", 1.0]},
            {"set": [f"{DIFFERENTIAL}.inputs:maxDeceleration", 0.01]},
        ),
        "rest",
    ),
    "does-not-move": (
        steps(
            {"disconnect": f"{DIFFERENTIAL}.inputs:linearVelocity"},
            {"disconnect": f"{DIFFERENTIAL}.inputs:angularVelocity"},
        ),
        "follows",
    ),
    "wall-ahead": (put(ROBOT, "xformOp:translate", (2.1, 0.0, 0.0)), "follows"),
    "wrong-distance": (value(f"{DIFFERENTIAL}.inputs:wheelRadius", 0.1), "follows"),
    "wrong-turn": (value(f"{DIFFERENTIAL}.inputs:wheelDistance", 0.5), "follows"),
    "sideways-drift": (put(f"{ROBOT}/wheel_left_link/collisions/tyre", "radius", 0.03), "follows"),
    "turn-off-centre": (
        several(
            put(LEFT, "physics:localPos0", Gf.Vec3f(0.0, 0.13, 0.023)),
            put(RIGHT, "physics:localPos0", Gf.Vec3f(0.0, -0.03, 0.023)),
        ),
        "follows",
    ),
    "wrong-speed-limit": (value(f"{DIFFERENTIAL}.inputs:maxLinearSpeed", 2.0), "limits"),
    "wrong-odometry-frame": (value(f"{ODOMETRY}.inputs:chassisFrameId", "base_link"), "odometry"),
    "wrong-odometry-pose": (cut(f"{ODOMETRY}.inputs:position"), "odometry"),
    "wrong-odometry-velocity": (cut(f"{ODOMETRY}.inputs:linearVelocity"), "odometry"),
    "clock-jumps-back": (value(f"{READ_TIME}.inputs:resetOnStop", True), "clock"),  # noqa: FBT003
    "wrong-clock-rate": (cut(f"{CLOCK}.inputs:timeStamp"), "clock"),
    "wrong-stamp": (cut(f"{ODOMETRY}.inputs:timeStamp"), "stamps"),
    "silent-topic": (steps({"remove": CLOCK}), "topics"),
    "wrong-topic": (value(f"{CLOCK}.inputs:topicName", "/time"), "topics"),
    "namespaced-topic": (value(f"{CLOCK}.inputs:nodeNamespace", "tb3"), "topics"),
    "wrong-domain": (value("ROS_Clock/ros2_context.inputs:domain_id", 5), "topics"),
    "wrong-message-type": (
        steps(
            {"set": [f"{CLOCK}.inputs:topicName", "odom"]},
            {"set": [f"{ODOMETRY}.inputs:topicName", "clock"]},
        ),
        "topics",
    ),
    "duplicate-publisher": (steps({"copy": [CLOCK, "ROS_Clock/again"]}), "topics"),
    "no-target-prim": (steps({"remove": RAW}, {"targets": [TREE_TARGETS]}), "topics"),
    "no-frames-input": (
        steps({"remove": RAW}, {"disconnect": f"{TREE}.inputs:parentFrames"}),
        "topics",
    ),
    "unequal-frame-arrays": (
        steps({"remove": RAW}, {"disconnect": f"{TREE}.inputs:orientations"}),
        "topics",
    ),
    "missing-frame": (
        steps({"targets": [TREE_TARGETS, f"{ROBOT}/base_scan", CAMERA]}),
        "tree",
    ),
    "self-parent": (value(f"{RAW}.inputs:childFrameId", "odom"), "tree"),
    "several-parents": (
        steps(
            {"copy": [RAW, "ROS_OdomTF/again"]},
            {"set": ["ROS_OdomTF/again.inputs:parentFrameId", "start"]},
        ),
        "tree",
    ),
    "frame-cycle": (
        steps(
            {"copy": [RAW, "ROS_OdomTF/again"]},
            {"set": ["ROS_OdomTF/again.inputs:parentFrameId", "base_link"]},
        ),
        "tree",
    ),
    "several-publishers": (steps({"copy": [RAW, "ROS_OdomTF/again"]}), "tree"),
    "disconnected-frame": (steps({"remove": RAW}), "tree"),
    "unknown-frame": (value(f"{LIDAR_HELPER}.inputs:frameId", "lidar"), "tree"),
    "transform-ends": (value(f"{TREE}.inputs:staticPublisher", True), "tree"),  # noqa: FBT003
    "transform-unlike-odometry": (cut(f"{RAW}.inputs:translation"), "moving frames"),
    "no-camera-target": (steps({"targets": [f"{LIDAR_PRODUCT}.inputs:cameraPrim"]}), "topics"),
    "missing-camera-prim": (
        steps({"targets": [f"{LIDAR_PRODUCT}.inputs:cameraPrim", "/nowhere"]}),
        "topics",
    ),
    "empty-image": (value(f"{LIDAR_PRODUCT}.inputs:width", 0), "topics"),
    "no-render-product": (cut(f"{LIDAR_HELPER}.inputs:renderProductPath"), "topics"),
    "wrong-render-product": (
        steps({"targets": [f"{IMAGE_PRODUCT}.inputs:renderProductPrim", f"{ROBOT}/base_link"]}),
        "topics",
    ),
    "not-a-camera": (
        steps({"targets": [f"{IMAGE_PRODUCT}.inputs:cameraPrim", f"{ROBOT}/base_link"]}),
        "topics",
    ),
    "not-a-lidar": (steps({"targets": [f"{LIDAR_PRODUCT}.inputs:cameraPrim", CAMERA]}), "topics"),
    "no-lidar-schema": (
        steps({"schema off": [LIDAR, "OmniSensorGenericLidarCoreAPI"]}),
        "topics",
    ),
    "invalid-scan-profile": (value(f"{LIDAR}.omni:sensor:Core:scanRateBaseHz", 0), "topics"),
    "loose-sensor": (steps({"deactivate": f"{JOINTS}/scan_joint"}), "mounted"),
    "wrong-scan-rate": (value(f"{LIDAR}.omni:sensor:tickRate", 30.0), "scan"),
    "wrong-turn-rate": (value(f"{LIDAR}.omni:sensor:Core:scanRateBaseHz", 20), "scan"),
    "no-ray-returns": (value(f"{LIDAR}.omni:sensor:Core:farRangeM", 0.2), "scan"),
    "scan-off-walls": (put(LIDAR, "xformOp:translate", (0.3, 0.0, 0.0)), "scan"),
    "image-info-frames-differ": (value(f"{INFO}.inputs:frameId", "base_link"), "camera"),
    "image-info-sizes-differ": (
        steps(
            {"copy": [IMAGE_PRODUCT, "ROS_Camera/small"]},
            {"set": ["ROS_Camera/small.inputs:width", 320]},
            {"connect": [f"{INFO}.inputs:execIn", "ROS_Camera/small.outputs:execOut"]},
            {
                "connect": [
                    f"{INFO}.inputs:renderProductPath",
                    "ROS_Camera/small.outputs:renderProductPath",
                ]
            },
        ),
        "camera",
    ),
    "image-info-rates-differ": (value(f"{INFO}.inputs:frameSkipCount", 2), "camera"),
    "low-image-rate": (value(f"{CAMERA}.omni:sensor:tickRate", 2.0), "camera"),
    "misplaced-camera-frame": (cut(f"{RAW}.inputs:translation"), "camera"),
    "camera-not-ahead": (value(f"{CAMERA}.xformOp:orient", Gf.Quatd(1)), "camera"),
    "camera-not-upright": (
        value(f"{CAMERA}.xformOp:orient", Gf.Quatd(0.5, -0.5, -0.5, 0.5)),
        "camera",
    ),
}
# Shown by a drive with an arc, a node alone, maps, and an arm: test_faults.py, test_sim_nodes.py,
# test_scan_meets_map.py, test_joint_nodes.py.
BY_HAND: frozenset[FaultKind] = frozenset(
    {
        "wrong-arc",
        "unknown-output",
        "map-shifted",
        "map-inverted",
        "scan-off-map",
        "unequal-joint-arrays",
        "joint-off-target",
        "link-off-frame",
        "wrong-joint-state",
        "no-inertial-sensor",
        "several-commands",
        "no-position-drive",
    }
)
MOTION = ("rest", "follows", "limits", "again")  # shown by a stage that only drives, too
