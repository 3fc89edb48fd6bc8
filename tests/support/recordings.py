"""Recordings for tests: a dry run as a bag, packed and changed in the ways of real ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from msgspec import Struct
from rosbags.interfaces import Connection, Qos, QosDurability
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)


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
    with writer:
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
