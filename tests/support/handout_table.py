"""The handout's graphs and sensors, typed from its sections B to F, without a look at `graphs/`.

Node names are the handout's (section C3 names the drive graph's; elsewhere a node is called as its
type). Ports are named as they are in a saved file. Two rulings of the lab are in here: the wires of
Constant Token leave from its input, and the last graph has the context and timestamp wires of
F7, F8 and F10 besides those of the connection table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

ROBOT = "/turtlebot3_burger"
FOOTPRINT = "/turtlebot3_burger/base_footprint"
LIDAR = "/turtlebot3_burger/base_scan/Lidar2D"
CAMERA = "/turtlebot3_burger/base_footprint/Camera_1"

TYPES = {
    "On Playback Tick": "omni.graph.action.OnPlaybackTick",
    "ROS2 Context": "isaacsim.ros2.bridge.ROS2Context",
    "Isaac Read Simulation Time": "isaacsim.core.nodes.IsaacReadSimulationTime",
    "ROS2 Publish Clock": "isaacsim.ros2.bridge.ROS2PublishClock",
    "ROS2 Subscribe Twist": "isaacsim.ros2.bridge.ROS2SubscribeTwist",
    "Scale To/From Stage Units": "isaacsim.core.nodes.OgnIsaacScaleToFromStageUnit",
    "Break 3 Vector": "omni.graph.nodes.BreakVector3",
    "Differential Controller": "isaacsim.robot.wheeled_robots.DifferentialController",
    "Constant Token": "omni.graph.nodes.ConstantToken",
    "Make Array": "omni.graph.nodes.ConstructArray",
    "Articulation Controller": "isaacsim.core.nodes.IsaacArticulationController",
    "Isaac Run One Simulation Frame": "isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame",
    "Isaac Create Render Product": "isaacsim.core.nodes.IsaacCreateRenderProduct",
    "ROS2 RTX Lidar Helper": "isaacsim.ros2.bridge.ROS2RtxLidarHelper",
    "ROS2 Camera Helper": "isaacsim.ros2.bridge.ROS2CameraHelper",
    "ROS2 Camera Info Helper": "isaacsim.ros2.bridge.ROS2CameraInfoHelper",
    "Isaac Compute Odometry": "isaacsim.core.nodes.IsaacComputeOdometry",
    "ROS2 Publish Odometry": "isaacsim.ros2.bridge.ROS2PublishOdometry",
    "ROS2 Publish Raw Transform Tree": "isaacsim.ros2.bridge.ROS2PublishRawTransformTree",
    "Isaac Compute Transform Tree": "isaacsim.core.nodes.IsaacComputeTransformTree",
    "ROS2 Publish Transform Tree": "isaacsim.ros2.bridge.ROS2PublishTransformTree",
}

# File names of 6.1, without the ending.
FILES = (
    "Lab3_00_student_start",
    "Lab3_01_ros_clock",
    "Lab3_02_ros_drive",
    "Lab3_03_lidar",
    "Lab3_04_camera",
    "Lab3_05_odometry_tf",
    "Lab3_06_qos_verified",
    "Lab3_07_localization",
    "Lab3_08_nav2_complete",
)

Value = bool | int | float | str
Wire = tuple[str, str, str, str]  # source node, source port, destination node, destination port


@dataclass(frozen=True)
class Graph:
    """One graph of the handout; `since` is the first checkpoint that holds it."""

    path: str
    since: int
    nodes: Mapping[str, str]
    wires: tuple[Wire, ...]
    values: Mapping[str, Mapping[str, Value]]
    targets: Mapping[str, Mapping[str, tuple[str, ...]]] = field(default_factory=dict)


@dataclass(frozen=True)
class Sensor:
    """One sensor prim: position in metres, rotation as a quaternion w, x, y, z."""

    path: str
    since: int
    type: str
    translate: tuple[float, float, float]
    orient: tuple[float, float, float, float]
    values: Mapping[str, float | tuple[float, float]]


def named(*types: str) -> dict[str, str]:
    """Nodes that are called as their type."""
    return {name: TYPES[name] for name in types}


CONTEXT = {"inputs:domain_id": 0, "inputs:useDomainIDEnvVar": False}  # B4, C4, D8, E8, F4
TIME = {"inputs:resetOnStop": False}  # B5, F5

TICK = "On Playback Tick"
ROS = "ROS2 Context"
CLOCK_TIME = "Isaac Read Simulation Time"
FRAME = "Isaac Run One Simulation Frame"
RENDER = "Isaac Create Render Product"

ROS_CLOCK = Graph(
    path="/World/ROS_Clock",
    since=1,
    nodes=named(TICK, ROS, CLOCK_TIME, "ROS2 Publish Clock"),
    wires=(
        (TICK, "outputs:tick", "ROS2 Publish Clock", "inputs:execIn"),
        (ROS, "outputs:context", "ROS2 Publish Clock", "inputs:context"),
        (CLOCK_TIME, "outputs:simulationTime", "ROS2 Publish Clock", "inputs:timeStamp"),
    ),
    values={
        ROS: CONTEXT,
        CLOCK_TIME: TIME,
        "ROS2 Publish Clock": {"inputs:topicName": "/clock", "inputs:queueSize": 10},
    },
)

ROS_DRIVE = Graph(
    path="/turtlebot3_burger/ROS_Drive",
    since=2,
    nodes={
        "on_playback_tick": TYPES["On Playback Tick"],
        "ros2_context": TYPES["ROS2 Context"],
        "ros2_subscribe_twist": TYPES["ROS2 Subscribe Twist"],
        "scale_linear_velocity": TYPES["Scale To/From Stage Units"],
        "break_linear_velocity": TYPES["Break 3 Vector"],
        "break_angular_velocity": TYPES["Break 3 Vector"],
        "differential_controller": TYPES["Differential Controller"],
        "constant_left_joint": TYPES["Constant Token"],
        "constant_right_joint": TYPES["Constant Token"],
        "make_array": TYPES["Make Array"],
        "articulation_controller": TYPES["Articulation Controller"],
    },
    wires=(
        ("on_playback_tick", "outputs:tick", "ros2_subscribe_twist", "inputs:execIn"),
        ("on_playback_tick", "outputs:tick", "differential_controller", "inputs:execIn"),
        ("on_playback_tick", "outputs:tick", "articulation_controller", "inputs:execIn"),
        ("ros2_context", "outputs:context", "ros2_subscribe_twist", "inputs:context"),
        (
            "ros2_subscribe_twist",
            "outputs:linearVelocity",
            "scale_linear_velocity",
            "inputs:value",
        ),
        ("scale_linear_velocity", "outputs:result", "break_linear_velocity", "inputs:tuple"),
        (
            "break_linear_velocity",
            "outputs:x",
            "differential_controller",
            "inputs:linearVelocity",
        ),
        (
            "ros2_subscribe_twist",
            "outputs:angularVelocity",
            "break_angular_velocity",
            "inputs:tuple",
        ),
        (
            "break_angular_velocity",
            "outputs:z",
            "differential_controller",
            "inputs:angularVelocity",
        ),
        (
            "differential_controller",
            "outputs:velocityCommand",
            "articulation_controller",
            "inputs:velocityCommand",
        ),
        ("constant_left_joint", "inputs:value", "make_array", "inputs:input0"),
        ("constant_right_joint", "inputs:value", "make_array", "inputs:input1"),
        ("make_array", "outputs:array", "articulation_controller", "inputs:jointNames"),
    ),
    values={
        "ros2_context": CONTEXT,
        "ros2_subscribe_twist": {"inputs:topicName": "/cmd_vel", "inputs:queueSize": 10},
        "scale_linear_velocity": {"inputs:conversion": "Convert to stage units"},
        "differential_controller": {
            "inputs:maxLinearSpeed": 0.22,
            "inputs:maxAngularSpeed": 1.0,
            "inputs:wheelDistance": 0.16,
            "inputs:wheelRadius": 0.025,
        },
        "constant_left_joint": {"inputs:value": "wheel_left_joint"},
        "constant_right_joint": {"inputs:value": "wheel_right_joint"},
        "make_array": {"inputs:arraySize": 2, "inputs:arrayType": "token[]"},
    },
    targets={"articulation_controller": {"inputs:targetPrim": (FOOTPRINT,)}},
)

ROS_LIDAR = Graph(
    path="/turtlebot3_burger/base_scan/Lidar2D/ROS_Lidar2D",
    since=3,
    nodes=named(TICK, ROS, FRAME, RENDER, "ROS2 RTX Lidar Helper"),
    wires=(
        (TICK, "outputs:tick", FRAME, "inputs:execIn"),
        (FRAME, "outputs:step", RENDER, "inputs:execIn"),
        (RENDER, "outputs:execOut", "ROS2 RTX Lidar Helper", "inputs:execIn"),
        (RENDER, "outputs:renderProductPath", "ROS2 RTX Lidar Helper", "inputs:renderProductPath"),
        (ROS, "outputs:context", "ROS2 RTX Lidar Helper", "inputs:context"),
    ),
    values={
        ROS: CONTEXT,
        RENDER: {"inputs:enabled": True, "inputs:width": 640, "inputs:height": 480},
        "ROS2 RTX Lidar Helper": {
            "inputs:type": "laser_scan",
            "inputs:topicName": "/scan",
            "inputs:frameId": "base_scan",
            "inputs:enabled": True,
            "inputs:queueSize": 10,
        },
    },
    targets={RENDER: {"inputs:cameraPrim": (LIDAR,)}},
)

RGB, INFO = "ROS2 Camera Helper", "ROS2 Camera Info Helper"
ROS_CAMERA = Graph(
    path="/turtlebot3_burger/base_footprint/Camera_1/ROS_Camera",
    since=4,
    nodes=named(TICK, ROS, FRAME, RENDER, RGB, INFO),
    wires=(
        (TICK, "outputs:tick", FRAME, "inputs:execIn"),
        (FRAME, "outputs:step", RENDER, "inputs:execIn"),
        (RENDER, "outputs:execOut", RGB, "inputs:execIn"),
        (RENDER, "outputs:execOut", INFO, "inputs:execIn"),
        (RENDER, "outputs:renderProductPath", RGB, "inputs:renderProductPath"),
        (RENDER, "outputs:renderProductPath", INFO, "inputs:renderProductPath"),
        (ROS, "outputs:context", RGB, "inputs:context"),
        (ROS, "outputs:context", INFO, "inputs:context"),
    ),
    values={
        ROS: CONTEXT,
        RENDER: {"inputs:enabled": True, "inputs:width": 640, "inputs:height": 480},
        RGB: {
            "inputs:type": "rgb",
            "inputs:topicName": "/camera/image_raw",
            "inputs:frameId": "Camera_1",
            "inputs:enabled": True,
            "inputs:queueSize": 10,
        },
        INFO: {
            "inputs:topicName": "/camera/camera_info",
            "inputs:frameId": "Camera_1",
            "inputs:enabled": True,
            "inputs:queueSize": 10,
        },
    },
    targets={RENDER: {"inputs:cameraPrim": (CAMERA,)}},
)

ODOMETRY, ODOM_OUT = "Isaac Compute Odometry", "ROS2 Publish Odometry"
RAW, TREE, TREE_OUT = (
    "ROS2 Publish Raw Transform Tree",
    "Isaac Compute Transform Tree",
    "ROS2 Publish Transform Tree",
)
ROS_ODOM_TF = Graph(
    path="/turtlebot3_burger/ROS_OdomTF",
    since=5,
    nodes=named(TICK, ROS, CLOCK_TIME, ODOMETRY, ODOM_OUT, RAW, TREE, TREE_OUT),
    wires=(
        (TICK, "outputs:tick", ODOMETRY, "inputs:execIn"),
        (TICK, "outputs:tick", TREE, "inputs:execIn"),
        (ROS, "outputs:context", ODOM_OUT, "inputs:context"),
        (ODOMETRY, "outputs:execOut", ODOM_OUT, "inputs:execIn"),
        (ODOMETRY, "outputs:position", ODOM_OUT, "inputs:position"),
        (ODOMETRY, "outputs:orientation", ODOM_OUT, "inputs:orientation"),
        (ODOMETRY, "outputs:linearVelocity", ODOM_OUT, "inputs:linearVelocity"),
        (ODOMETRY, "outputs:angularVelocity", ODOM_OUT, "inputs:angularVelocity"),
        (CLOCK_TIME, "outputs:simulationTime", ODOM_OUT, "inputs:timeStamp"),
        (ROS, "outputs:context", RAW, "inputs:context"),
        (ODOMETRY, "outputs:execOut", RAW, "inputs:execIn"),
        (ODOMETRY, "outputs:position", RAW, "inputs:translation"),
        (ODOMETRY, "outputs:orientation", RAW, "inputs:rotation"),
        (CLOCK_TIME, "outputs:simulationTime", RAW, "inputs:timeStamp"),
        (ROS, "outputs:context", TREE_OUT, "inputs:context"),
        (TREE, "outputs:execOut", TREE_OUT, "inputs:execIn"),
        (TREE, "outputs:parentFrames", TREE_OUT, "inputs:parentFrames"),
        (TREE, "outputs:childFrames", TREE_OUT, "inputs:childFrames"),
        (TREE, "outputs:translations", TREE_OUT, "inputs:translations"),
        (TREE, "outputs:orientations", TREE_OUT, "inputs:orientations"),
        (CLOCK_TIME, "outputs:simulationTime", TREE_OUT, "inputs:timeStamp"),
    ),
    values={
        ROS: CONTEXT,
        CLOCK_TIME: TIME,
        ODOM_OUT: {
            "inputs:chassisFrameId": "base_footprint",
            "inputs:odomFrameId": "odom",
            "inputs:topicName": "/odom",
            "inputs:queueSize": 10,
        },
        RAW: {
            "inputs:parentFrameId": "odom",
            "inputs:childFrameId": "base_footprint",
            "inputs:topicName": "/tf",
            "inputs:queueSize": 10,
            "inputs:staticPublisher": False,
        },
        TREE_OUT: {
            "inputs:topicName": "/tf",
            "inputs:queueSize": 10,
            "inputs:staticPublisher": False,
        },
    },
    targets={
        ODOMETRY: {"inputs:chassisPrim": (FOOTPRINT,)},
        TREE: {
            "inputs:parentPrim": (FOOTPRINT,),
            "inputs:targetPrims": (
                "/turtlebot3_burger/base_link",
                "/turtlebot3_burger/base_scan",
                "/turtlebot3_burger/caster_back_link",
                "/turtlebot3_burger/wheel_left_link",
                "/turtlebot3_burger/wheel_right_link",
                "/turtlebot3_burger/base_footprint/Camera_1",
            ),
        },
    },
)

GRAPHS = (ROS_CLOCK, ROS_DRIVE, ROS_LIDAR, ROS_CAMERA, ROS_ODOM_TF)


def graphs_until(checkpoint: str) -> list[Graph]:
    return [graph for graph in GRAPHS if graph.since <= int(checkpoint)]


# Nodes and wires of each graph, counted in the handout once more.
COUNTS = ((4, 3), (11, 13), (5, 5), (6, 8), (8, 21))

# B3, the recommended layout of the clock graph.
CLOCK_LAYOUT = {
    TICK: (50, 100),
    ROS: (50, 250),
    CLOCK_TIME: (300, 400),
    "ROS2 Publish Clock": (650, 200),
}

SENSORS = (
    Sensor(
        path=LIDAR,
        since=3,
        type="OmniLidar",
        translate=(0.0, 0.0, 0.0),
        orient=(1.0, 0.0, 0.0, 0.0),
        values={"omni:sensor:tickRate": 10.0, "omni:sensor:Core:scanRateBaseHz": 10},
    ),
    Sensor(
        path=CAMERA,
        since=4,
        type="Camera",
        translate=(0.1, 0.0, 0.2),
        orient=(0.5, 0.5, -0.5, -0.5),
        values={
            "focalLength": 18.0,
            "clippingRange": (0.01, 100.0),
            "omni:sensor:tickRate": 10.0,
        },
    ),
)
