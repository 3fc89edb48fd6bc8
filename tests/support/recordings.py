"""Recordings for tests: a dry run as a bag, packed and changed in the ways of real ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TextIO
from unittest.mock import patch

import quick_yaml
from breaking import correct_stage
from click.testing import CliRunner
from msgspec import Struct
from rosbags.interfaces import Connection, Qos, QosDurability
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.rosbag2 import metadata as qos_metadata
from rosbags.rosbag2 import writer as bag_writer

from lab3_usd.features.sim.sim import command as sim_command
from lab3_usd.sim.ros_messages import STORE

DRIVE = "0.2,0,1.26 0,0,0.2 -0.2,0,1.26 0,0.8,0.5 0,0,0.2"


def recorded(folder: Path, name: str = "run") -> Path:
    """Record the correct stage of the last checkpoint that has one, with images; no fault."""
    stage = folder / "Lab3_05.usda"
    correct_stage("05").GetRootLayer().Export(str(stage))
    arguments = [str(stage), "--drive", DRIVE, "--bag", str(folder / "dry")]
    assert CliRunner().invoke(sim_command, arguments, catch_exceptions=False).exit_code == 0
    return rewritten(folder / "dry", folder / name, pictures)


class Sent(Struct):
    """A message on its way into a recording, which is decoded where somebody looks into it."""

    time: int
    topic: str
    type: str
    held: Any  # a message, or its bytes
    qos: tuple[Qos, ...] = ()

    @property
    def said(self) -> Any:
        if isinstance(self.held, bytes):
            self.held = STORE.deserialize_cdr(self.held, self.type)
        return self.held


class QuickYaml:
    """What stands for the YAML of ruamel where rosbags writes metadata."""

    def __init__(self, **_: str) -> None:
        """Take the type of loader that rosbags names."""

    def dump(self, document: object, stream: TextIO) -> None:
        stream.write(quick_yaml.dump(document))


Change = Callable[[Sent], Iterator[Sent]]


def keep(sent: Sent) -> Iterator[Sent]:
    yield sent


def messages(bag: Path) -> Iterator[Sent]:
    for connection, time, data in stored(bag):
        qos = tuple(connection.ext.offered_qos_profiles)
        yield Sent(time, connection.topic, connection.msgtype, data, qos)


@cache
def stored(bag: Path) -> list[tuple[Connection, int, bytes]]:
    """Return what a recording, which nobody changes, holds."""
    with Reader(bag) as reader:
        return list(reader.messages())


def rewritten(
    bag: Path,
    folder: Path,
    change: Change = keep,
    *,
    storage: StoragePlugin = StoragePlugin.MCAP,
    packing: CompressionMode = CompressionMode.NONE,
) -> Path:
    """Write a recording anew, with every message changed."""
    writer = Writer(folder, version=8, storage_plugin=storage)
    writer.set_compression(packing, CompressionFormat.ZSTD)
    sent = sorted((each for one in messages(bag) for each in change(one)), key=lambda e: e.time)
    quickly = (patch.object(module, "YAML", QuickYaml) for module in (qos_metadata, bag_writer))
    with next(quickly), next(quickly), writer:
        connections: dict[tuple[str, str], Any] = {}
        for each in sent:
            key = (each.topic, each.type)
            if key not in connections:
                connections[key] = writer.add_connection(
                    *key, typestore=STORE, offered_qos_profiles=each.qos
                )
            data = each.held
            if not isinstance(data, bytes):
                data = bytes(STORE.serialize_cdr(data, each.type))
            writer.write(connections[key], each.time, data)
    return folder


def pictures(sent: Sent) -> Iterator[Sent]:
    """Add an image to each camera info."""
    yield sent
    if sent.topic == "/camera/camera_info":
        kind = "sensor_msgs/msg/Image"
        numpy = __import__("numpy")
        said = STORE.types[kind](
            sent.said.header, sent.said.height, sent.said.width, "rgb8", 0,
            3 * sent.said.width, numpy.zeros(3 * 640, dtype=numpy.uint8),
        )  # fmt: skip
        yield Sent(sent.time, "/camera/image_raw", kind, said, sent.qos)


def durable(qos: tuple[Qos, ...]) -> tuple[Qos, ...]:
    return tuple(each._replace(durability=QosDurability.TRANSIENT_LOCAL) for each in qos)


def on(topic: str, edit: Callable[[Any], object]) -> Callable[[Sent], Iterator[Sent]]:
    """Edit the messages of one topic; `None` of an edit leaves the message out."""

    def change(sent: Sent) -> Iterator[Sent]:
        if sent.topic != topic or edit(sent.said) != "drop":
            yield sent

    return change


def in_laser(said: Any) -> None:
    said.header.frame_id = "laser"


def faster(said: Any) -> None:
    said.twist.twist.linear.x *= 2


def tied(sent: Sent, parent: str, end: float = 100.0) -> Iterator[Sent]:
    """Add what AMCL sends: the place of odometry in the map."""
    yield sent
    if sent.topic == "/scan" and sent.time < end * 1_000_000_000:
        kind = "tf2_msgs/msg/TFMessage"
        types = STORE.types
        still = types["geometry_msgs/msg/Transform"](
            types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0),
            types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        )
        head = types["std_msgs/msg/Header"](sent.said.header.stamp, parent)
        said = types[kind]([types["geometry_msgs/msg/TransformStamped"](head, "odom", still)])
        yield Sent(sent.time, "/tf", kind, said, sent.qos)


def aimed(sent: Sent, status: int) -> Iterator[Sent]:
    """Add a goal, which is under way for two seconds and then has this status."""
    yield sent
    if sent.topic == "/camera/camera_info":
        kind, types = "action_msgs/msg/GoalStatusArray", STORE.types
        number = types["unique_identifier_msgs/msg/UUID"](__import__("numpy").ones(16, "u1"))
        goal = types["action_msgs/msg/GoalInfo"](number, sent.said.header.stamp)
        state = types["action_msgs/msg/GoalStatus"](goal, status if sent.time > 2e9 else 2)
        topic = "/navigate_to_pose/_action/status"
        yield Sent(sent.time, topic, kind, types[kind]([state]), sent.qos)
