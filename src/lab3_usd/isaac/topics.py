"""The names of topics, and the inputs that belong to each, by the way Isaac Sim names them."""

from __future__ import annotations

import re
from functools import lru_cache

from lab3_usd.isaac.node_types import INPUT, NodeType

# Types of messages.
CLOCK, TRANSFORMS = "rosgraph_msgs/msg/Clock", "tf2_msgs/msg/TFMessage"
TWIST, STEERING = "geometry_msgs/msg/Twist", "ackermann_msgs/msg/AckermannDriveStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
SCAN, POINTS = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"
IMAGE, CAMERA_INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
JOINT_STATES = "sensor_msgs/msg/JointState"
STATIC = "_static"  # what the topic of transforms that never change has more
PRODUCT = f"{INPUT}renderProductPath"
_ENDS = r"^[^A-Za-z0-9]+|[^A-Za-z0-9]+$"


@lru_cache(maxsize=64)  # the lab has a dozen topics, and every rule about them asks
def resolved_topic(name: str, namespace: str = "") -> str:
    """Return the topic that Isaac Sim publishes for a topic name and namespace.

    Everything that is no letter or digit is trimmed off both ends, then namespace and a slash are
    put before (`Ros2Node.h:139, 209, 304`). An empty name stays empty.
    """
    trimmed = re.sub(_ENDS, "", name)
    inside = re.sub(_ENDS, "", namespace)
    if not trimmed:
        return ""
    return f"/{inside}/{trimmed}" if inside else f"/{trimmed}"


def topic_switch(port: str) -> str:
    """Return the input that switches this topic on, by the way Isaac Sim names the two."""
    stem = port.removeprefix(INPUT).removesuffix("TopicName")
    return f"{INPUT}enable{stem[:1].upper()}{stem[1:]}"


def product_input(port: str) -> str:
    """Return the input that takes the render product of this topic."""
    return f"{PRODUCT}{_suffix(port)}"


def frame_ports(kind: NodeType, port: str) -> tuple[str, ...]:
    """Return the inputs that name the frames of one topic: its own of a pair, else all."""
    paired = f"{INPUT}frameId{_suffix(port)}"
    return (paired,) if paired in kind.frames else kind.frames


def _suffix(port: str) -> str:
    """Return what tells the second topic of a pair from the first (`Right`)."""
    return port.partition("opicName")[2]
