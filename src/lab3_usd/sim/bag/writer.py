"""Writes a run, in which every robot is driven, as a bag: messages of ROS 2 Humble in MCAP."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, NamedTuple

from msgspec import Struct
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

from lab3_usd.errors import unwritten
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import Scene
from lab3_usd.model.qos import Qos as Profile
from lab3_usd.sim.bag.recording_files import NOT_SENT
from lab3_usd.sim.execution.drive import RATE, Leg, Session, command_frames
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.judge.expectations import Trial
from lab3_usd.sim.ros_messages import STORE, command_message, nanoseconds, serialized
from lab3_usd.sim.timeline import content_of, player_of

HUMBLE = 5  # the version of its metadata
_LATER = ("ros_distro",)  # a key that came after it; that of data of one's own it passes over
_HASH = "type_description_hash"
# The oldest version that the library writes; its QoS profiles are Humble's.
_WRITTEN: Literal[8] = 8
_FOREVER = QosTime(2147483647, 4294967295)


class SentCommand(NamedTuple):
    """A command: seconds after Play, where it comes, and the leg that says what it is."""

    at: float
    domain: int
    topic: str
    leg: Leg


class Tape(Struct, frozen=True):
    """What a bag is to hold, from Play to Stop; `home` is the domain of messages that name none."""

    messages: tuple[Message, ...]
    commands: tuple[SentCommand, ...]
    home: int

    def domain(self, message: Message) -> int:
        """Return the domain in which a message came."""
        return self.home if message.away is None else message.away


def tape_of(trial: Trial) -> Tape:
    """Return the first session of a run: after another Play the robot is back where it began."""
    wanted = trial.wanted
    commands = (
        SentCommand((frame + 1) / RATE, wanted.domain, wanted.commands, leg)
        for frame, leg in command_frames(trial.drive[0])
    )
    messages = (message for message in trial.recording.messages if not message.session)
    return Tape(tuple(messages), tuple(commands), wanted.domain)


def tape_of_plays(scene: Scene, platform: Platform, plays: Sequence[Trial]) -> Tape:
    """Play a stage with the commands of several plays at once, those of each of its robots.

    What one robot hears on a topic, another does as well.
    """
    sessions: dict[tuple[int, str], Session] = {}
    for wanted, session in ((play.wanted, play.drive[0]) for play in plays):
        if wanted.commands:
            sessions.setdefault((wanted.domain, wanted.commands), session)
    player = player_of(scene, platform, plays[0].wanted)
    network = player.world.network
    network.is_open = True
    told: dict[int, list[tuple[tuple[int, str], Leg]]] = {}
    frames = 0
    for place, session in sessions.items():
        for frame, leg in command_frames(session):
            told.setdefault(frame, []).append((place, leg))
        frames = max(frames, sum(round(leg.seconds * RATE) for leg in session.legs))
    commands = []
    for frame in range(frames):
        for place, leg in told.get(frame, ()):
            network.tell(content_of(leg), place)
            commands.append(SentCommand((frame + 1) / RATE, *place, leg))
        player.step()
    return Tape(tuple(network.sent), tuple(commands), network.commands.domain)


class Record(NamedTuple):
    """A message of a bag: when it came, on which topic, and the message itself."""

    nanoseconds: int
    topic: str
    type: str
    data: bytes
    profile: Profile = Profile()


class Written(NamedTuple):
    """A bag that was written: its folder, what it holds, and the topics that it cannot hold."""

    folder: Path
    messages: int
    topics: int
    left_out: tuple[str, ...]


def write_bags(folder: Path, tape: Tape) -> list[Written]:
    """Write a bag into a new folder; one for each domain into folders there, if there are several.

    As `ros2 bag record`, a bag has what came in one domain. What has no content in a dry run,
    pictures for one, is not in it: its metadata name the topics, so that they do not look silent.

    Raises:
        UsageError: the folder cannot be written.
        NoRoomError: the disk is full.
    """
    domains = {tape.domain(message) for message in tape.messages}
    domains |= {command.domain for command in tape.commands}
    several = len(domains) > 1
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary:
            whole = Path(temporary) / folder.name
            written = [
                _write_bag(whole / f"domain_{domain}" if several else whole, tape, domain)
                for domain in sorted(domains or {tape.home})
            ]
            whole.rename(folder)  # which replaces nothing, or an empty folder
    except OSError as error:
        raise unwritten(folder, error) from error
    return [bag._replace(folder=folder / bag.folder.relative_to(whole)) for bag in written]


def _write_bag(folder: Path, tape: Tape, domain: int) -> Written:
    records = sorted(_records(tape, domain), key=lambda record: record[:2])
    last = {each.topic: each for each in tape.messages if tape.domain(each) == domain}
    # Of these topics a dry run does not make the messages.
    left_out = tuple(sorted(topic for topic, sent in last.items() if serialized(sent) is None))
    folder.parent.mkdir(exist_ok=True)
    with Writer(folder, version=_WRITTEN, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.set_custom_data(NOT_SENT, " ".join(left_out))
        connections: dict[tuple[str, str], Any] = {}
        for record in records:
            key = (record.topic, record.type)
            if key not in connections:
                connections[key] = writer.add_connection(
                    *key, typestore=STORE, offered_qos_profiles=[_offered(record.profile)]
                )
            writer.write(connections[key], record.nanoseconds, record.data)
    _as_humble(folder / "metadata.yaml")
    return Written(folder, len(records), len(connections), left_out)


def _records(tape: Tape, domain: int) -> Iterator[Record]:
    """Yield the commands, then the messages, in seconds since Play."""
    for sent in tape.commands:
        if sent.domain == domain:
            yield Record(nanoseconds(sent.at), sent.topic, *command_message(sent.leg))
    for message in tape.messages:
        data = serialized(message) if tape.domain(message) == domain else None
        if data is not None:
            yield Record(
                nanoseconds(message.at), message.topic, message.type, data, message.profile
            )


def _offered(profile: Profile) -> Qos:
    return Qos(
        QosHistory[profile.history.upper()],
        0 if profile.history == "keep_all" else profile.depth or 0,
        QosReliability[profile.reliability.upper()],
        QosDurability[profile.durability.upper()],
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
    metadata = document["rosbag2_bagfile_information"]
    metadata["version"] = HUMBLE
    for name in _LATER:
        metadata.pop(name, None)
    for topic in metadata["topics_with_message_count"]:
        topic["topic_metadata"].pop(_HASH, None)
    text = StringIO()
    reader.dump(document, text)
    path.write_text(text.getvalue(), encoding="utf-8")
