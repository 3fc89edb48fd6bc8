"""The graphs that Isaac Sim's menus and NVIDIA's own tests build, written again from their wiring.

Facts of `isaacsim.ros2.ui`, `isaacsim.robot.wheeled_robots.ui` and `isaacsim.ros2.nodes` of
isaac-sim/IsaacSim v6.0.1 (Apache-2.0): which nodes, values and wires.
"""

from __future__ import annotations

from collections.abc import Callable

from foreign_robots import CONTEXT, TICK, TIME, rover_scene, write_graph
from pxr import Sdf, Usd

ROBOT = "/World/Rover"
BASE = f"{ROBOT}/chassis"
_START = {"OnPlaybackTick": TICK, "Context": CONTEXT, "ReadSimTime": TIME}
_ARRAYS = ("parentFrames", "childFrames", "translations", "orientations")


def clock(stage: Usd.Stage) -> None:
    write_graph(
        stage,
        "/Graph/ROS_Clock",
        {**_START, "PublishClock": ("ros.ROS2PublishClock", {"topicName": "/clock"})},
        [
            "OnPlaybackTick.tick -> PublishClock.execIn",
            "Context.context -> PublishClock.context",
            "ReadSimTime.simulationTime -> PublishClock.timeStamp",
        ],
    )


def _generic(stage: Usd.Stage, name: str, kind: str, node: str, port: str) -> None:
    message = {"messageName": name, "messagePackage": "std_msgs", "messageSubfolder": "msg"}
    values = {} if port == "rtf" else {"value": "Hello" if name == "String" else 42}
    write_graph(
        stage,
        f"/Graph/ROS_{name}",
        {
            "OnPlaybackTick": TICK,
            "Context": CONTEXT,
            "GenericPublisher": ("ros.ROS2Publisher", {**message, "topicName": name.lower()}),
            node: (kind, values if name == "String" else {}),
        },
        [
            "OnPlaybackTick.tick -> GenericPublisher.execIn",
            "Context.context -> GenericPublisher.context",
            f"{node}.{port} -> GenericPublisher.data",
        ],
    )


def generic_publishers(stage: Usd.Stage) -> None:
    _generic(stage, "Float32", "core.IsaacRealTimeFactor", "RTF", "rtf")
    _generic(stage, "Bool", "nodes.ConstantBool", "ConstBool", "value")
    _generic(stage, "Int64", "nodes.ConstantInt64", "ConstInt", "value")
    _generic(stage, "String", "nodes.ConstantToken", "ConstToken", "value")


def joint_states(stage: Usd.Stage) -> None:
    write_graph(
        stage,
        "/Graph/ROS_JointStates",
        {
            **_START,
            "PublisherJointState": (
                "ros.ROS2PublishJointState",
                {"targetPrim": BASE, "topicName": "/joint_states"},
            ),
            "SubscriberJointState": (
                "ros.ROS2SubscribeJointState",
                {"topicName": "/joint_command"},
            ),
            "ArticulationController": ("core.IsaacArticulationController", {"targetPrim": ROBOT}),
        },
        [
            "OnPlaybackTick.tick -> PublisherJointState.execIn",
            "Context.context -> PublisherJointState.context",
            "ReadSimTime.simulationTime -> PublisherJointState.timeStamp",
            "OnPlaybackTick.tick -> SubscriberJointState.execIn",
            "Context.context -> SubscriberJointState.context",
            "OnPlaybackTick.tick -> ArticulationController.execIn",
            *(
                f"SubscriberJointState.{each} -> ArticulationController.{each}"
                for each in ("positionCommand", "velocityCommand", "effortCommand", "jointNames")
            ),
        ],
    )


def tf(stage: Usd.Stage) -> None:
    write_graph(
        stage,
        "/Graph/ROS_TF",
        {
            **_START,
            "ComputePublisherTF": ("core.IsaacComputeTransformTree", {"targetPrims": ROBOT}),
            "PublisherTF": ("ros.ROS2PublishTransformTree", {"topicName": "/tf"}),
        },
        _tree("ComputePublisherTF", "PublisherTF"),
    )


def _tree(compute: str, publisher: str) -> list[str]:
    return [
        f"OnPlaybackTick.tick -> {compute}.execIn",
        f"{compute}.execOut -> {publisher}.execIn",
        *(f"{compute}.{array} -> {publisher}.{array}" for array in _ARRAYS),
        f"ReadSimTime.simulationTime -> {publisher}.timeStamp",
        f"Context.context -> {publisher}.context",
    ]


def odometry(stage: Usd.Stage) -> None:
    told = ("TFWorld2Odom", "TFOdom2Robot", "PublisherOdometry")
    write_graph(
        stage,
        "/Graph/ROS_Odometry",
        {
            **_START,
            "TFWorld2Odom": (
                "ros.ROS2PublishRawTransformTree",
                {"childFrameId": "odom", "parentFrameId": "world"},
            ),
            "TFOdom2Robot": ("ros.ROS2PublishRawTransformTree", {"childFrameId": "chassis"}),
            "ComputeOdometry": ("core.IsaacComputeOdometry", {"chassisPrim": BASE}),
            "PublisherOdometry": (
                "ros.ROS2PublishOdometry",
                {"topicName": "/odom", "chassisFrameId": "chassis"},
            ),
            "ComputeTFRobot": (
                "core.IsaacComputeTransformTree",
                {"parentPrim": BASE, "targetPrims": ROBOT},
            ),
            "TFRobot": ("ros.ROS2PublishTransformTree", {"topicName": "/tf"}),
        },
        [
            "OnPlaybackTick.tick -> TFWorld2Odom.execIn",
            "OnPlaybackTick.tick -> TFOdom2Robot.execIn",
            "OnPlaybackTick.tick -> ComputeOdometry.execIn",
            "ComputeOdometry.execOut -> PublisherOdometry.execIn",
            *(
                f"ComputeOdometry.{each} -> PublisherOdometry.{each}"
                for each in ("position", "orientation", "linearVelocity", "angularVelocity")
            ),
            "ComputeOdometry.orientation -> TFOdom2Robot.rotation",
            "ComputeOdometry.position -> TFOdom2Robot.translation",
            *(f"Context.context -> {each}.context" for each in told),
            *(f"ReadSimTime.simulationTime -> {each}.timeStamp" for each in told),
            *_tree("ComputeTFRobot", "TFRobot"),
        ],
    )


def camera(stage: Usd.Stage) -> None:
    kinds = {
        "rgb": "/rgb",
        "depth": "/depth",
        "depth_pcl": "/depth_pcl",
        "instance_segmentation": "/instance_segmentation",
        "semantic_segmentation": "/semantic_segmentation",
        "bbox_2d_tight": "/bbox2d_tight",
        "bbox_3d": "/bbox3d",
    }
    helpers = {
        f"{kind}_publish": (
            "ros.ROS2CameraHelper",
            {
                "topicName": topic,
                "type": kind,
                "frameId": "eye",
                "resetSimulationTimeOnStop": True,
                **_labels(kind, topic),
            },
        )
        for kind, topic in kinds.items()
    }
    write_graph(
        stage,
        "/Graph/ROS_Camera",
        {
            "OnPlaybackTick": TICK,
            "Context": CONTEXT,
            "RunOnce": ("core.OgnIsaacRunOneSimulationFrame", {}),
            "RenderProduct": ("core.IsaacCreateRenderProduct", {"cameraPrim": f"{BASE}/eye"}),
            "CameraInfoPublish": (
                "ros.ROS2CameraInfoHelper",
                {"topicName": "/camera_info", "frameId": "eye"},
            ),
            **helpers,
        },
        [
            "OnPlaybackTick.tick -> RunOnce.execIn",
            "RunOnce.step -> RenderProduct.execIn",
            *_helped(["CameraInfoPublish", *helpers]),
        ],
    )


def _labels(kind: str, topic: str) -> dict[str, object]:
    if "segmentation" not in kind and "bbox" not in kind:
        return {}
    return {"enableSemanticLabels": True, "semanticLabelsTopicName": f"{topic}_labels"}


def _helped(helpers: list[str]) -> list[str]:
    return [
        wire
        for helper in helpers
        for wire in (
            f"RenderProduct.execOut -> {helper}.execIn",
            f"RenderProduct.renderProductPath -> {helper}.renderProductPath",
            f"Context.context -> {helper}.context",
        )
    ]


def lidar(stage: Usd.Stage) -> None:
    helpers = ["LaserScanPublish", "PointCloudPublish"]
    write_graph(
        stage,
        "/Graph/ROS_LidarRTX",
        {
            "OnPlaybackTick": TICK,
            "Context": CONTEXT,
            "RunOnce": ("core.OgnIsaacRunOneSimulationFrame", {}),
            "RenderProduct": ("core.IsaacCreateRenderProduct", {"cameraPrim": f"{BASE}/laser"}),
            "LaserScanPublish": (
                "ros.ROS2RtxLidarHelper",
                {"topicName": "/laser_scan", "type": "laser_scan", "frameId": "laser"},
            ),
            "PointCloudPublish": (
                "ros.ROS2RtxLidarHelper",
                {"topicName": "/point_cloud", "type": "point_cloud", "frameId": "laser"},
            ),
            "PCLConfig": ("ros.ROS2RtxLidarPointCloudConfig", {"outputIntensity": True}),
        },
        [
            "OnPlaybackTick.tick -> RunOnce.execIn",
            "RunOnce.step -> RenderProduct.execIn",
            *_helped(helpers),
            "PCLConfig.selectedMetadata -> PointCloudPublish.selectedMetadata",
        ],
    )


def _differential(stage: Usd.Stage, array: dict[str, object], port: str) -> None:
    keys = ("W", "A", "S", "D")
    write_graph(
        stage,
        "/Graph/differential_controller",
        {
            "OnPlaybackTick": TICK,
            "DifferentialController": (
                "wheeled.DifferentialController",
                {"wheelRadius": 10.0, "wheelDistance": 40.0},
            ),
            "ArticulationController": ("core.IsaacArticulationController", {"targetPrim": ROBOT}),
            "ArrayNames": ("nodes.ConstructArray", {"arraySize": 2, **array}),
            **{key: ("nodes.ReadKeyboardState", {}) for key in keys},
            **{f"ToDouble{key}": ("nodes.ToDouble", {}) for key in keys},
            "AddLinear": ("nodes.Add", {}),
            "AddAngular": ("nodes.Add", {}),
        },
        [
            "OnPlaybackTick.tick -> DifferentialController.execIn",
            "OnPlaybackTick.tick -> ArticulationController.execIn",
            "DifferentialController.velocityCommand -> ArticulationController.velocityCommand",
            f"ArrayNames.array -> ArticulationController.{port}",
            *(f"{key}.isPressed -> ToDouble{key}.value" for key in keys),
            "ToDoubleW.converted -> AddLinear.a",
            "ToDoubleS.converted -> AddLinear.b",
            "ToDoubleA.converted -> AddAngular.a",
            "ToDoubleD.converted -> AddAngular.b",
            "AddLinear.sum -> DifferentialController.linearVelocity",
            "AddAngular.sum -> DifferentialController.angularVelocity",
        ],
    )


def differential(stage: Usd.Stage) -> None:
    names = {"input0": "left_wheel_joint", "input1": "right_wheel_joint"}
    _differential(stage, {"arrayType": "token[]", **names}, "jointNames")


def differential_by_number(stage: Usd.Stage) -> None:
    _differential(stage, {"arrayType": "int[]"}, "jointIndices")
    array = stage.GetPrimAtPath("/Graph/differential_controller/ArrayNames")
    for number in (0, 1):
        port = array.CreateAttribute(f"inputs:input{number}", Sdf.ValueTypeNames.Token, custom=True)
        port.SetCustomDataByKey("omni:graph:attrValue", number)


def nvidia_differential_test(stage: Usd.Stage) -> None:
    told = ("publishOdom", "publishRawTF")
    write_graph(
        stage,
        "/ActionGraph",
        {
            "OnPlaybackTick": TICK,
            "ReadSimTime": ("core.IsaacReadSimulationTime", {}),
            "computeOdom": ("core.IsaacComputeOdometry", {"chassisPrim": BASE}),
            "publishOdom": ("ros.ROS2PublishOdometry", {}),
            "publishRawTF": ("ros.ROS2PublishRawTransformTree", {}),
            "subscribeTwist": ("ros.ROS2SubscribeTwist", {}),
            "breakLinVel": ("nodes.BreakVector3", {}),
            "breakAngVel": ("nodes.BreakVector3", {}),
            "diffController": (
                "wheeled.DifferentialController",
                {"wheelRadius": 0.1, "wheelDistance": 0.4},
            ),
            "artController": (
                "core.IsaacArticulationController",
                {"jointNames": ["left_wheel_joint", "right_wheel_joint"], "targetPrim": ROBOT},
            ),
        },
        [
            *(f"OnPlaybackTick.tick -> {each}.execIn" for each in ("computeOdom", *told)),
            *(f"ReadSimTime.simulationTime -> {each}.timeStamp" for each in told),
            *(
                f"computeOdom.{each} -> publishOdom.{each}"
                for each in ("position", "orientation", "linearVelocity", "angularVelocity")
            ),
            "computeOdom.orientation -> publishRawTF.rotation",
            "computeOdom.position -> publishRawTF.translation",
            "OnPlaybackTick.tick -> subscribeTwist.execIn",
            "OnPlaybackTick.tick -> artController.execIn",
            "subscribeTwist.execOut -> diffController.execIn",
            "subscribeTwist.linearVelocity -> breakLinVel.tuple",
            "breakLinVel.x -> diffController.linearVelocity",
            "subscribeTwist.angularVelocity -> breakAngVel.tuple",
            "breakAngVel.z -> diffController.angularVelocity",
            "diffController.velocityCommand -> artController.velocityCommand",
        ],
    )


MENUS: dict[str, Callable[[Usd.Stage], None]] = {
    "clock": clock,
    "generic publishers": generic_publishers,
    "joint states": joint_states,
    "tf": tf,
    "odometry": odometry,
    "camera": camera,
    "lidar": lidar,
    "differential": differential,
    "differential by number": differential_by_number,
    "NVIDIA's differential test": nvidia_differential_test,
}


def with_menus(*names: str) -> Usd.Stage:
    """Return the robot with the graphs of these menus."""
    stage = rover_scene()
    for name in names:
        MENUS[name](stage)
    return stage
