"""Writes a run as a bag: MCAP, with the metadata of Humble."""

from __future__ import annotations

from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any, Literal, NamedTuple

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from ruamel.yaml import YAML

from lab3_usd.sim.bag.messages import STORE, TWIST, command, nanoseconds, serialized
from lab3_usd.sim.behaviour.evidence import Evidence
from lab3_usd.sim.execution.drive import RATE, command_frames
from lab3_usd.sim.execution.record import Profile

HUMBLE = 5  # the version of its metadata
_LATER = ("custom_data", "ros_distro")  # keys that came after it
_HASH = "type_description_hash"
_WRITTEN: Literal[8] = (
    8  # the oldest version that the library writes; its QoS profiles are Humble's
)
_FOREVER = QosTime(2147483647, 4294967295)


class Record(NamedTuple):
    """A message of a bag: when it came, on which topic, and the message itself."""

    nanoseconds: int
    topic: str
    type: str
    data: bytes
    profile: Profile = Profile()


def write_bag(folder: Path, evidence: Evidence) -> int:
    """Write a bag into a new folder, and return how many messages it holds.

    It has what came in the lab's domain, and the commands. Pictures are not in it.
    """
    records = sorted((*_commands(evidence), *_messages(evidence)), key=lambda each: each[:2])
    with Writer(folder, version=_WRITTEN, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[tuple[str, str], Any] = {}
        for each in records:
            key = (each.topic, each.type)
            if key not in connections:
                connections[key] = writer.add_connection(
                    *key, typestore=STORE, offered_qos_profiles=[_offered(each.profile)]
                )
            writer.write(connections[key], each.nanoseconds, each.data)
    _as_humble(folder / "metadata.yaml")
    return len(records)


def _starts(evidence: Evidence) -> list[float]:
    """Return when each session begins, in seconds since the first Play."""
    starts = [0.0]
    for session in evidence.drive:
        frames = sum(round(leg.seconds * RATE) for leg in session.legs)
        starts.append(starts[-1] + frames / RATE)
    return starts


def _messages(evidence: Evidence) -> Iterator[Record]:
    starts = _starts(evidence)
    for each in evidence.recording.messages:
        data = None if each.away is not None else serialized(each)
        if data is not None:
            time = nanoseconds(starts[each.session] + each.at)
            yield Record(time, each.topic, each.type, data, each.profile)


def _commands(evidence: Evidence) -> Iterator[Record]:
    for start, session in zip(_starts(evidence), evidence.drive, strict=False):
        for frame, leg in command_frames(session):
            time = nanoseconds(start + (frame + 1) / RATE)
            yield Record(time, evidence.wanted.commands, TWIST, command(leg))


def _offered(profile: Profile) -> Qos:
    return Qos(
        QosHistory.KEEP_LAST if profile.depth else QosHistory.KEEP_ALL,
        profile.depth,
        QosReliability.RELIABLE if profile.is_reliable else QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL if profile.is_durable else QosDurability.VOLATILE,
        _FOREVER,
        _FOREVER,
        QosLiveliness.AUTOMATIC,
        _FOREVER,
        avoid_ros_namespace_conventions=False,
    )


def _as_humble(path: Path) -> None:
    """Rewrite the metadata as Humble writes them."""
    reader = YAML(typ="safe")
    reader.default_flow_style = False
    document = reader.load(path.read_text(encoding="utf-8"))
    said = document["rosbag2_bagfile_information"]
    said["version"] = HUMBLE
    for name in _LATER:
        said.pop(name, None)
    for topic in said["topics_with_message_count"]:
        topic["topic_metadata"].pop(_HASH, None)
    text = StringIO()
    reader.dump(document, text)
    path.write_text(text.getvalue(), encoding="utf-8")
