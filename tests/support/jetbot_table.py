"""The sheet of the second lab, typed by hand: its files, graphs, sensors and frames.

Nothing here is read from `docs/examples/labs/jetbot`. Each wire is written as
`node.port > node.port`, with the nodes' names as the sheet calls them.
"""

from __future__ import annotations

CHASSIS = "/World/Jetbot/chassis"
SCANNER = "/World/Jetbot/mast/Scanner"
IMU = "/World/Jetbot/chassis/Imu"

FILES = (
    "Week5_1_start",
    "Week5_2_clock",
    "Week5_3_drive",
    "Week5_4_lidar",
    "Week5_5_imu",
    "Week5_6_odometry",
    "Week5_7_topics",
)
# Path of each graph: the number of the file that holds it first.
GRAPHS = {
    "/World/Clock": 2,
    "/World/Jetbot/Drive": 3,
    "/World/Jetbot/mast/Scanner/Scan": 4,
    "/World/Jetbot/chassis/Imu/Measure": 5,
    "/World/Jetbot/Odometry": 6,
}
SENSORS = {SCANNER: ("OmniLidar", 4), IMU: ("IsaacImuSensor", 5)}
SENSOR_VALUES = {
    SCANNER: {"omni:sensor:tickRate": 20.0, "omni:sensor:Core:scanRateBaseHz": 20},
    IMU: {"sensorPeriod": 0.01, "linearAccelerationFilterWidth": 10},
}
SENSOR_PLACES = {SCANNER: (0.0, 0.0, 0.02), IMU: (0.0, 0.0, 0.05)}

# Node types by graph, how often each.
TYPES = {
    "/World/Clock": {
        "omni.graph.action.OnPlaybackTick": 1,
        "isaacsim.ros2.bridge.ROS2Context": 1,
        "isaacsim.core.nodes.IsaacReadSimulationTime": 1,
        "isaacsim.ros2.bridge.ROS2PublishClock": 1,
    },
    "/World/Jetbot/Drive": {
        "omni.graph.action.OnPlaybackTick": 1,
        "isaacsim.ros2.bridge.ROS2Context": 1,
        "isaacsim.ros2.bridge.ROS2SubscribeTwist": 1,
        "omni.graph.nodes.BreakVector3": 2,
        "isaacsim.robot.wheeled_robots.DifferentialController": 1,
        "omni.graph.nodes.ConstantToken": 2,
        "omni.graph.nodes.ConstructArray": 1,
        "isaacsim.core.nodes.IsaacArticulationController": 1,
    },
    "/World/Jetbot/mast/Scanner/Scan": {
        "omni.graph.action.OnPlaybackTick": 1,
        "isaacsim.ros2.bridge.ROS2Context": 1,
        "isaacsim.core.nodes.OgnIsaacRunOneSimulationFrame": 1,
        "isaacsim.core.nodes.IsaacCreateRenderProduct": 1,
        "isaacsim.ros2.bridge.ROS2RtxLidarHelper": 1,
    },
    "/World/Jetbot/chassis/Imu/Measure": {
        "omni.graph.action.OnPlaybackTick": 1,
        "isaacsim.ros2.bridge.ROS2Context": 1,
        "isaacsim.core.nodes.IsaacReadSimulationTime": 1,
        "isaacsim.sensors.physics.IsaacReadIMU": 1,
        "isaacsim.ros2.bridge.ROS2PublishImu": 1,
    },
    "/World/Jetbot/Odometry": {
        "omni.graph.action.OnPlaybackTick": 1,
        "isaacsim.ros2.bridge.ROS2Context": 1,
        "isaacsim.core.nodes.IsaacReadSimulationTime": 1,
        "isaacsim.core.nodes.IsaacComputeOdometry": 1,
        "isaacsim.ros2.bridge.ROS2PublishOdometry": 1,
        "isaacsim.ros2.bridge.ROS2PublishRawTransformTree": 1,
        "isaacsim.core.nodes.IsaacComputeTransformTree": 1,
        "isaacsim.ros2.bridge.ROS2PublishTransformTree": 1,
    },
}
WIRES = {
    "/World/Clock": """
        tick.outputs:tick > clock.inputs:execIn
        context.outputs:context > clock.inputs:context
        time.outputs:simulationTime > clock.inputs:timeStamp
    """,
    "/World/Jetbot/Drive": """
        context.outputs:context > twist.inputs:context
        tick.outputs:tick > twist.inputs:execIn
        twist.outputs:linearVelocity > ahead.inputs:tuple
        twist.outputs:angularVelocity > turn.inputs:tuple
        ahead.outputs:x > controller.inputs:linearVelocity
        turn.outputs:z > controller.inputs:angularVelocity
        tick.outputs:tick > controller.inputs:execIn
        left.inputs:value > names.inputs:input0
        right.inputs:value > names.inputs:input1
        names.outputs:array > motors.inputs:jointNames
        tick.outputs:tick > motors.inputs:execIn
        controller.outputs:velocityCommand > motors.inputs:velocityCommand
    """,
    "/World/Jetbot/mast/Scanner/Scan": """
        tick.outputs:tick > once.inputs:execIn
        once.outputs:step > product.inputs:execIn
        product.outputs:execOut > helper.inputs:execIn
        product.outputs:renderProductPath > helper.inputs:renderProductPath
        context.outputs:context > helper.inputs:context
    """,
    "/World/Jetbot/chassis/Imu/Measure": """
        tick.outputs:tick > imu.inputs:execIn
        imu.outputs:execOut > publisher.inputs:execIn
        context.outputs:context > publisher.inputs:context
        time.outputs:simulationTime > publisher.inputs:timeStamp
        imu.outputs:linAcc > publisher.inputs:linearAcceleration
        imu.outputs:angVel > publisher.inputs:angularVelocity
        imu.outputs:orientation > publisher.inputs:orientation
    """,
    "/World/Jetbot/Odometry": """
        tick.outputs:tick > odometry.inputs:execIn
        odometry.outputs:execOut > publish_odometry.inputs:execIn
        context.outputs:context > publish_odometry.inputs:context
        time.outputs:simulationTime > publish_odometry.inputs:timeStamp
        odometry.outputs:position > publish_odometry.inputs:position
        odometry.outputs:orientation > publish_odometry.inputs:orientation
        odometry.outputs:linearVelocity > publish_odometry.inputs:linearVelocity
        odometry.outputs:angularVelocity > publish_odometry.inputs:angularVelocity
        odometry.outputs:execOut > publish_base.inputs:execIn
        context.outputs:context > publish_base.inputs:context
        time.outputs:simulationTime > publish_base.inputs:timeStamp
        odometry.outputs:position > publish_base.inputs:translation
        odometry.outputs:orientation > publish_base.inputs:rotation
        tick.outputs:tick > links.inputs:execIn
        links.outputs:execOut > publish_links.inputs:execIn
        context.outputs:context > publish_links.inputs:context
        time.outputs:simulationTime > publish_links.inputs:timeStamp
        links.outputs:parentFrames > publish_links.inputs:parentFrames
        links.outputs:childFrames > publish_links.inputs:childFrames
        links.outputs:translations > publish_links.inputs:translations
        links.outputs:orientations > publish_links.inputs:orientations
    """,
}
# What is typed into the nodes: `node.port`, by graph; every context has domain 5.
VALUES: dict[str, dict[str, object]] = {
    "/World/Clock": {"time.resetOnStop": False, "clock.topicName": "/clock", "clock.queueSize": 10},
    "/World/Jetbot/Drive": {
        "twist.topicName": "/jetbot/cmd_vel",
        "twist.queueSize": 1,
        "controller.maxLinearSpeed": 0.5,
        "controller.maxAngularSpeed": 2.0,
        "controller.wheelDistance": 0.1125,
        "controller.wheelRadius": 0.03,
        "left.value": "left_wheel_joint",
        "right.value": "right_wheel_joint",
        "names.arraySize": 2,
        "names.arrayType": "token[]",
    },
    "/World/Jetbot/mast/Scanner/Scan": {
        "helper.type": "laser_scan",
        "helper.topicName": "/jetbot/scan",
        "helper.frameId": "mast",
    },
    "/World/Jetbot/chassis/Imu/Measure": {
        "time.resetOnStop": False,
        "imu.readGravity": True,
        "publisher.topicName": "/jetbot/imu",
        "publisher.frameId": "Imu",
        "publisher.queueSize": 10,
    },
    "/World/Jetbot/Odometry": {
        "time.resetOnStop": False,
        "publish_odometry.chassisFrameId": "chassis",
        "publish_odometry.odomFrameId": "odom",
        "publish_odometry.topicName": "/jetbot/odom",
        "publish_odometry.queueSize": 10,
        "publish_base.parentFrameId": "odom",
        "publish_base.childFrameId": "chassis",
        "publish_base.topicName": "/tf",
        "publish_base.queueSize": 10,
        "publish_links.topicName": "/tf",
        "publish_links.queueSize": 10,
    },
}
CONTEXT = {"context.domain_id": 5, "context.useDomainIDEnvVar": False}
TARGETS = {
    "/World/Clock": {},
    "/World/Jetbot/Drive": {"motors.inputs:targetPrim": (CHASSIS,)},
    "/World/Jetbot/mast/Scanner/Scan": {"product.inputs:cameraPrim": (SCANNER,)},
    "/World/Jetbot/chassis/Imu/Measure": {"imu.inputs:imuPrim": (IMU,)},
    "/World/Jetbot/Odometry": {
        "odometry.inputs:chassisPrim": (CHASSIS,),
        "links.inputs:parentPrim": (CHASSIS,),
        "links.inputs:targetPrims": (
            "/World/Jetbot/left_wheel",
            "/World/Jetbot/right_wheel",
            "/World/Jetbot/mast",
            IMU,
        ),
    },
}
TREE = {
    ("odom", "chassis"),
    ("chassis", "left_wheel"),
    ("chassis", "right_wheel"),
    ("chassis", "mast"),
    ("chassis", "Imu"),
}
MASSES = {"chassis": 1.05, "mast": 0.1, "left_wheel": 0.05, "right_wheel": 0.05}
