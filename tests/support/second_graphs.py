"""The five graphs of sections B to F of the handout, typed a second time.

Nodes are called as they come to mind; a wire reads `source.port > node.port`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

ROBOT = "/turtlebot3_burger"
FOOTPRINT = "/turtlebot3_burger/base_footprint"
LIDAR = "/turtlebot3_burger/base_scan/Lidar2D"
CAMERA = "/turtlebot3_burger/base_footprint/Camera_1"
LINKS = ("base_link", "base_scan", "caster_back_link", "wheel_left_link", "wheel_right_link")
FRAMES = (*(f"{ROBOT}/{link}" for link in LINKS), CAMERA)


@dataclass(frozen=True)
class Graph:
    """One graph: its nodes by kind, `source.port > node.port` wires, values and targets."""

    path: str
    since: int
    nodes: Mapping[str, str]
    wires: str
    values: Mapping[str, Mapping[str, Any]]
    targets: Mapping[str, Mapping[str, Sequence[str]]] = field(default_factory=dict)


DOMAIN = {"domain_id": 0, "useDomainIDEnvVar": False}

GRAPHS = (
    Graph(
        "/World/ROS_Clock",
        1,
        {"tick": "tick", "context": "context", "time": "time", "clock": "clock"},
        "tick.tick > clock.execIn, context.context > clock.context,"
        "time.simulationTime > clock.timeStamp",
        {
            "context": DOMAIN,
            "time": {"resetOnStop": False},
            "clock": {"topicName": "/clock", "queueSize": 10},
        },
    ),
    Graph(
        f"{ROBOT}/ROS_Drive",
        2,
        {
            "tick": "tick",
            "context": "context",
            "twist": "twist",
            "scale": "scale",
            "linear": "break",
            "angular": "break",
            "differential": "differential",
            "left": "constant",
            "right": "constant",
            "array": "array",
            "articulation": "articulation",
        },
        "tick.tick > twist.execIn, tick.tick > differential.execIn,"
        "tick.tick > articulation.execIn, context.context > twist.context,"
        "twist.linearVelocity > scale.value, scale.result > linear.tuple,"
        "linear.x > differential.linearVelocity, twist.angularVelocity > angular.tuple,"
        "angular.z > differential.angularVelocity,"
        "differential.velocityCommand > articulation.velocityCommand,"
        "left.value > array.input0, right.value > array.input1,"
        "array.array > articulation.jointNames",
        {
            "context": DOMAIN,
            "twist": {"topicName": "/cmd_vel", "queueSize": 10},
            "scale": {"conversion": "Convert to stage units"},
            "differential": {
                "maxLinearSpeed": 0.22,
                "maxAngularSpeed": 1.0,
                "wheelDistance": 0.16,
                "wheelRadius": 0.025,
            },
            "left": {"value": "wheel_left_joint"},
            "right": {"value": "wheel_right_joint"},
            "array": {"arraySize": 2, "arrayType": "token[]"},
        },
        {"articulation": {"targetPrim": [FOOTPRINT]}},
    ),
    Graph(
        f"{LIDAR}/ROS_Lidar2D",
        3,
        {kind: kind for kind in ("tick", "context", "frame", "render", "lidar")},
        "tick.tick > frame.execIn, frame.step > render.execIn, render.execOut > lidar.execIn,"
        "render.renderProductPath > lidar.renderProductPath, context.context > lidar.context",
        {
            "context": DOMAIN,
            "render": {"enabled": True, "width": 640, "height": 480},
            "lidar": {
                "type": "laser_scan",
                "topicName": "/scan",
                "frameId": "base_scan",
                "enabled": True,
                "queueSize": 10,
            },
        },
        {"render": {"cameraPrim": [LIDAR]}},
    ),
    Graph(
        f"{CAMERA}/ROS_Camera",
        4,
        {kind: kind for kind in ("tick", "context", "frame", "render", "camera", "info")},
        "tick.tick > frame.execIn, frame.step > render.execIn, render.execOut > camera.execIn,"
        "render.execOut > info.execIn, render.renderProductPath > camera.renderProductPath,"
        "render.renderProductPath > info.renderProductPath, context.context > camera.context,"
        "context.context > info.context",
        {
            "context": DOMAIN,
            "render": {"enabled": True, "width": 640, "height": 480},
            "camera": {
                "type": "rgb",
                "topicName": "/camera/image_raw",
                "frameId": "Camera_1",
                "enabled": True,
                "queueSize": 10,
            },
            "info": {
                "topicName": "/camera/camera_info",
                "frameId": "Camera_1",
                "enabled": True,
                "queueSize": 10,
            },
        },
        {"render": {"cameraPrim": [CAMERA]}},
    ),
    Graph(
        f"{ROBOT}/ROS_OdomTF",
        5,
        {
            kind: kind
            for kind in ("tick", "context", "time", "odometry", "odom", "raw", "links", "tree")
        },
        "tick.tick > odometry.execIn, context.context > odom.context,"
        "odometry.execOut > odom.execIn, odometry.position > odom.position,"
        "odometry.orientation > odom.orientation,"
        "odometry.linearVelocity > odom.linearVelocity,"
        "odometry.angularVelocity > odom.angularVelocity,"
        "time.simulationTime > odom.timeStamp, context.context > raw.context,"
        "odometry.execOut > raw.execIn, odometry.position > raw.translation,"
        "odometry.orientation > raw.rotation, time.simulationTime > raw.timeStamp,"
        "context.context > tree.context, tick.tick > links.execIn, links.execOut > tree.execIn,"
        "links.parentFrames > tree.parentFrames, links.childFrames > tree.childFrames,"
        "links.translations > tree.translations, links.orientations > tree.orientations,"
        "time.simulationTime > tree.timeStamp",
        {
            "context": DOMAIN,
            "time": {"resetOnStop": False},
            "odom": {
                "chassisFrameId": "base_footprint",
                "odomFrameId": "odom",
                "topicName": "/odom",
                "queueSize": 10,
            },
            "raw": {
                "parentFrameId": "odom",
                "childFrameId": "base_footprint",
                "topicName": "/tf",
                "queueSize": 10,
                "staticPublisher": False,
            },
            "tree": {"topicName": "/tf", "queueSize": 10, "staticPublisher": False},
        },
        {
            "odometry": {"chassisPrim": [FOOTPRINT]},
            "links": {"parentPrim": [FOOTPRINT], "targetPrims": FRAMES},
        },
    ),
)


def graphs_until(checkpoint: str) -> list[Graph]:
    return [graph for graph in GRAPHS if graph.since <= int(checkpoint)]
