"""The node types of the lab as Isaac Sim 6.0.1 has them, typed without a look at `graphs/`.

Each port stands as `usd_type name = default`, the default as JSON. `rel` is a relationship.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

SIGNALS = {"execIn", "execOut", "tick", "step"}


@dataclass(frozen=True)
class Port:
    name: str
    type: str
    default: Any = None


@dataclass(frozen=True)
class Kind:
    """A node type: its version now and in 4.5, and how the editor and the menus name a prim."""

    type: str
    version: int
    old_version: int
    names: tuple[str, str]
    inputs: str
    outputs: str

    def ports(self) -> Iterator[Port]:
        yield from _ports("inputs:", self.inputs)
        yield from _ports("outputs:", self.outputs)


def _ports(prefix: str, text: str) -> Iterator[Port]:
    for each in filter(None, text.split("; ")):
        declared, _, default = each.partition(" = ")
        usd_type, name = declared.split()
        yield Port(prefix + name, usd_type, json.loads(default) if default else None)


KINDS = {
    "tick": Kind(
        "omni.graph.action.OnPlaybackTick",
        2,
        1,
        ("on_playback_tick", "OnPlaybackTick"),
        (""),
        ("uint tick; double deltaSeconds; double time; double frame"),
    ),
    "context": Kind(
        "isaacsim.ros2.bridge.ROS2Context",
        2,
        2,
        ("ros2_context", "Context"),
        ("uchar domain_id = 0; bool useDomainIDEnvVar = true"),
        ("uint64 context = 0"),
    ),
    "time": Kind(
        "isaacsim.core.nodes.IsaacReadSimulationTime",
        1,
        1,
        ("isaac_read_simulation_time", "ReadSimTime"),
        (
            "bool resetOnStop = true; int64 referenceTimeNumerator = 0; uint64 "
            "referenceTimeDenominator = 0"
        ),
        ("double simulationTime"),
    ),
    "clock": Kind(
        "isaacsim.ros2.bridge.ROS2PublishClock",
        1,
        1,
        ("ros2_publish_clock", "PublishClock"),
        (
            'uint execIn; uint64 context = 0; string nodeNamespace = ""; string topicName = '
            '"clock"; string qosProfile = ""; uint64 queueSize = 10; double timeStamp = 0'
        ),
        (""),
    ),
    "twist": Kind(
        "isaacsim.ros2.bridge.ROS2SubscribeTwist",
        1,
        1,
        ("ros2_subscribe_twist", "SubscribeTwist"),
        (
            'uint execIn; uint64 context = 0; string nodeNamespace = ""; string topicName = '
            '"cmd_vel"; string qosProfile = ""; uint64 queueSize = 10'
        ),
        (
            "uint execOut; vector3d linearVelocity = [0.0, 0.0, 0.0]; vector3d angularVelocity = "
            "[0.0, 0.0, 0.0]"
        ),
    ),
    "scale": Kind(
        "isaacsim.core.nodes.OgnIsaacScaleToFromStageUnit",
        1,
        1,
        ("scale_to_from_stage_units", "ScaleToFromStageUnits"),
        ('token conversion = "Convert to stage units"; token value'),
        ("token result"),
    ),
    "break": Kind(
        "omni.graph.nodes.BreakVector3",
        1,
        1,
        ("break_3_vector", "BreakVel"),
        ("token tuple"),
        ("token x; token y; token z"),
    ),
    "differential": Kind(
        "isaacsim.robot.wheeled_robots.DifferentialController",
        1,
        1,
        ("differential_controller", "DifferentialController"),
        (
            "uint execIn; double wheelRadius = 0.0; double wheelDistance = 0.0; double dt = 0.0; "
            "double maxAcceleration = 0.0; double maxDeceleration = 0.0; double "
            "maxAngularAcceleration = 0.0; double maxLinearSpeed = 0.0; double maxAngularSpeed = "
            "0.0; double maxWheelSpeed = 0.0; double linearVelocity = 0.0; double angularVelocity "
            "= 0.0"
        ),
        ("double[] velocityCommand = [0.0, 0.0]"),
    ),
    "constant": Kind(
        "omni.graph.nodes.ConstantToken",
        1,
        1,
        ("constant_token", "JointName"),
        ('token value = ""'),
        (""),
    ),
    "array": Kind(
        "omni.graph.nodes.ConstructArray",
        1,
        1,
        ("make_array", "ArrayNames"),
        ('int arraySize = 1; token arrayType = "auto"; token input0'),
        ("token array"),
    ),
    "articulation": Kind(
        "isaacsim.core.nodes.IsaacArticulationController",
        1,
        1,
        ("articulation_controller", "ArticulationController"),
        (
            'uint execIn; rel targetPrim; string robotPath = ""; token[] jointNames = []; int[] '
            "jointIndices = []; double[] positionCommand = []; double[] velocityCommand = []; "
            "double[] effortCommand = []"
        ),
        (""),
    ),
    "frame": Kind(
        "isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame",
        1,
        1,
        ("isaac_run_one_simulation_frame", "RunOnce"),
        ("uint execIn"),
        ("uint step"),
    ),
    "render": Kind(
        "isaacsim.core.nodes.IsaacCreateRenderProduct",
        3,
        2,
        ("isaac_create_render_product", "RenderProduct"),
        (
            "uint execIn; uint width = 1280; uint height = 720; rel cameraPrim; bool enabled = "
            "true; rel renderProductPrim"
        ),
        ("token renderProductPath; uint execOut"),
    ),
    "lidar": Kind(
        "isaacsim.ros2.bridge.ROS2RtxLidarHelper",
        3,
        1,
        ("ros2_rtx_lidar_helper", "LaserScanPublish"),
        (
            'uint execIn; bool enabled = true; uint64 context = 0; string nodeNamespace = ""; '
            'string frameId = "sim_lidar"; string topicName = "scan"; string qosProfile = ""; '
            'uint64 queueSize = 10; token renderProductPath = ""; token type = "laser_scan"; bool '
            "resetSimulationTimeOnStop = true; bool fullScan = true; bool showDebugView = false; "
            "bool useSystemTime = false; uint frameSkipCount = 0; token[] selectedMetadata = []; "
            'bool enableObjectIdMap = false; string objectIdMapTopicName = "object_id_map"'
        ),
        (""),
    ),
    "camera": Kind(
        "isaacsim.ros2.bridge.ROS2CameraHelper",
        3,
        2,
        ("ros2_camera_helper", "RGBPublish"),
        (
            'uint execIn; bool enabled = true; uint64 context = 0; string nodeNamespace = ""; '
            'string frameId = "sim_camera"; string topicName = "rgb"; string qosProfile = ""; '
            'uint64 queueSize = 10; token renderProductPath = ""; token type = "rgb"; bool '
            'enableSemanticLabels = false; string semanticLabelsTopicName = "semantic_labels"; '
            "float2 stereoOffset = [0, 0]; bool resetSimulationTimeOnStop = true; bool "
            'useSystemTime = false; uint frameSkipCount = 0; string srtxCompressionType = "hevc"'
        ),
        (""),
    ),
    "info": Kind(
        "isaacsim.ros2.bridge.ROS2CameraInfoHelper",
        1,
        1,
        ("ros2_camera_info_helper", "CameraInfoPublish"),
        (
            'uint execIn; bool enabled = true; uint64 context = 0; string nodeNamespace = ""; '
            'string qosProfile = ""; uint64 queueSize = 10; string frameId = "sim_camera"; string '
            'topicName = "camera_info"; token renderProductPath = ""; string frameIdRight = '
            '"sim_camera_right"; string topicNameRight = "camera_info_right"; token '
            'renderProductPathRight = ""; bool resetSimulationTimeOnStop = true; bool '
            "useSystemTime = false; uint frameSkipCount = 0"
        ),
        (""),
    ),
    "odometry": Kind(
        "isaacsim.core.nodes.IsaacComputeOdometry",
        1,
        1,
        ("isaac_compute_odometry_node", "ComputeOdometry"),
        ("uint execIn; rel chassisPrim"),
        (
            "uint execOut; vector3d position = [0.0, 0.0, 0.0]; quatd orientation = [0.0, 0.0, "
            "0.0, 1.0]; vector3d linearVelocity = [0.0, 0.0, 0.0]; vector3d angularVelocity = "
            "[0.0, 0.0, 0.0]; vector3d linearAcceleration = [0.0, 0.0, 0.0]; vector3d "
            "angularAcceleration = [0.0, 0.0, 0.0]; vector3d globalLinearVelocity = [0.0, 0.0, "
            "0.0]; vector3d globalLinearAcceleration = [0.0, 0.0, 0.0]"
        ),
    ),
    "odom": Kind(
        "isaacsim.ros2.bridge.ROS2PublishOdometry",
        1,
        1,
        ("ros2_publish_odometry", "PublisherOdometry"),
        (
            'uint execIn; uint64 context = 0; string nodeNamespace = ""; string odomFrameId = '
            '"odom"; string chassisFrameId = "base_link"; string topicName = "odom"; string '
            'qosProfile = ""; bool publishRawVelocities = false; uint64 queueSize = 10; double '
            "timeStamp = 0.0; vector3d position = [0.0, 0.0, 0.0]; quatd orientation = [0.0, 0.0, "
            "0.0, 1.0]; vector3d linearVelocity = [0.0, 0.0, 0.0]; vector3d angularVelocity = "
            "[0.0, 0.0, 0.0]; vector3d robotFront = [1.0, 0.0, 0.0]"
        ),
        (""),
    ),
    "raw": Kind(
        "isaacsim.ros2.bridge.ROS2PublishRawTransformTree",
        1,
        1,
        ("ros2_publish_raw_transform_tree", "TFOdom2Base"),
        (
            'uint execIn; uint64 context = 0; string nodeNamespace = ""; string parentFrameId = '
            '"odom"; string childFrameId = "base_link"; string topicName = "tf"; string '
            'qosProfile = ""; uint64 queueSize = 10; double timeStamp = 0.0; vector3d translation '
            "= [0.0, 0.0, 0.0]; quatd rotation = [0.0, 0.0, 0.0, 1.0]; bool staticPublisher = "
            "false"
        ),
        (""),
    ),
    "links": Kind(
        "isaacsim.core.nodes.IsaacComputeTransformTree",
        1,
        1,
        ("isaac_compute_transform_tree", "ComputeTF"),
        ("uint execIn; rel parentPrim; rel targetPrims"),
        (
            "uint execOut; token[] parentFrames; token[] childFrames; double3[] translations; "
            "double4[] orientations"
        ),
    ),
    "tree": Kind(
        "isaacsim.ros2.bridge.ROS2PublishTransformTree",
        1,
        1,
        ("ros2_publish_transform_tree", "TFRobot"),
        (
            "uint execIn; uint64 context = 0; rel parentPrim; rel targetPrims; string "
            'nodeNamespace = ""; string topicName = "tf"; string qosProfile = ""; uint64 '
            "queueSize = 10; double timeStamp = 0.0; bool staticPublisher = false; token[] "
            "parentFrames = []; token[] childFrames = []; double3[] translations = []; double4[] "
            "orientations = []"
        ),
        (""),
    ),
}
