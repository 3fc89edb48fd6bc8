"""The topics, frames and rates that the lab asks for over ROS at a checkpoint."""

from __future__ import annotations

from typing import Any

from lab3_usd.sim.behaviour.evidence import Interface
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.ros import FROM_THE_FIRST, TopicSpec
from lab3_usd.spec.scene import SensorSpec

# The parts that topics play, by the type of their messages.
_PARTS = {
    "clock": "rosgraph_msgs/msg/Clock",
    "odometry": "nav_msgs/msg/Odometry",
    "transforms": "tf2_msgs/msg/TFMessage",
    "scan": "sensor_msgs/msg/LaserScan",
    "image": "sensor_msgs/msg/Image",
    "info": "sensor_msgs/msg/CameraInfo",
}
_COMMANDS = "geometry_msgs/msg/Twist"
_MAP = "nav_msgs/msg/OccupancyGrid"
_KEPT = "transient_local"
_RATE = "omni:sensor:tickRate"
_LIMITS = ("maxLinearSpeed", "maxAngularSpeed")
_PARENT, _CHILD = "header.frame_id", "child_frame_id"


def interface(lab: Lab, checkpoint: Checkpoint) -> Interface:
    """Return what somebody at the other end of ROS is to see of a stage of this checkpoint."""
    reached = (FROM_THE_FIRST, *lab.until(checkpoint.id))
    asked = [each for each in lab.topics.values() if _of_stage(each, reached)]
    names = {part: _named(asked, kind) for part, kind in _PARTS.items()}
    odometry = [each for each in lab.topics.values() if each.type == _PARTS["odometry"]]
    frames = odometry[0].fields or {} if odometry else {}
    lidar, camera = map(lab.first_sensor, ("lidar", "camera"))
    view = camera.looks if camera else None
    return Interface(
        types={each.name: each.type for each in asked if not each.subscribed},
        domain=lab.ros.system.domain,
        commands=_named(asked, _COMMANDS),
        **names,
        root=frames.get(_PARENT, ""),
        base=frames.get(_CHILD, ""),
        scan_rate=_rate(lidar),
        image_rate=_rate(camera),
        limits=_limits(lab),
        looks=view.along if view else (0.0, 0.0, 0.0),
        upward=view.up if view else (0.0, 0.0, 0.0),
        profile={name: said.value for name, said in lidar.attributes.items()} if lidar else {},
        static=static_topics(lab),
    )


def reached_topics(lab: Lab, checkpoint: str) -> tuple[TopicSpec, ...]:
    """Return all topics of the running system from the first checkpoint to one of them."""
    reached = (FROM_THE_FIRST, *lab.until(checkpoint))
    return tuple(each for each in lab.topics.values() if each.since in reached)


def static_topics(lab: Lab) -> frozenset[str]:
    """Return the topics of transforms that are kept for those who come late."""
    kept = (each for each in lab.topics.values() if each.durability == _KEPT)
    return frozenset(each.name for each in kept if each.type == _PARTS["transforms"])


def map_topic(lab: Lab, checkpoint: str) -> tuple[str, str]:
    """Return the topic of the map and its frame; empty where no map is asked for."""
    for each in reached_topics(lab, checkpoint):
        if each.type == _MAP:
            return each.name, (each.fields or {}).get(_PARENT, "")
    return "", ""


def _of_stage(topic: TopicSpec, reached: tuple[str, ...]) -> bool:
    return (
        topic.since in reached and (topic.subscribed or topic.source is None) and not topic.optional
    )


def _named(topics: list[TopicSpec], kind: str) -> str:
    return next((each.name for each in topics if each.type == kind), "")


def _rate(sensor: SensorSpec | None) -> float:
    """Return the rate that is asked of a sensor, 0 where none is."""
    asked = None if sensor is None else sensor.attributes.get(_RATE)
    return 0.0 if asked is None else float(asked.value)


def _limits(lab: Lab) -> tuple[float, float]:
    """Return the speeds to which commands are cut down."""
    settings: dict[str, Any] = {
        setting.port.rpartition(":")[2]: setting.value
        for graph in lab.graphs.values()
        for node in graph.nodes.values()
        for setting in node.settings
    }
    ahead, turning = (float(settings.get(each, 0.0)) for each in _LIMITS)
    return (ahead, turning)
