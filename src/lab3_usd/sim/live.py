"""A dry run that other programs of ROS 2 hear and drive, over DDS.

Messages have the types that Cyclone DDS makes of those of ROS 2.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from msgspec import Struct
from rosbags.interfaces import Nodetype

from lab3_usd.errors import UsageError
from lab3_usd.sim.bag.writer import STORE, TWIST, serialized
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.recording import Message, Profile
from lab3_usd.sim.execution.world import Twist
from lab3_usd.sim.timeline import Player, unknown_in

_OF: Any = types  # the library types no subscripts of its own
_BASES: dict[str, Any] = {
    "bool": bool,
    "byte": types.byte,
    "char": types.uint8,
    "int8": types.int8,
    "uint8": types.uint8,
    "int16": types.int16,
    "uint16": types.uint16,
    "int32": types.int32,
    "uint32": types.uint32,
    "int64": types.int64,
    "uint64": types.uint64,
    "float32": types.float32,
    "float64": types.float64,
    "string": str,
}

DEPTH = 10
FASTEST = 1e6  # metres or radians a second: what is beyond it, or no number, is no command
_BLOCKED = duration(milliseconds=100)  # as in the profiles of ROS 2
# Peers are asked one by one, as a loopback interface need not have multicast; ROS 2 asks 32.
# They are asked all the time, as they may come later and need not ask us: five times a second, as
# many of the programs that ask for topics are gone after a second.
CONFIGURATION = """
<CycloneDDS><Domain id="any">
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers>
    <SPDPInterval>200ms</SPDPInterval>
    <InitialLocatorPruneDelay>inf</InitialLocatorPruneDelay>
  </Discovery>
</Domain></CycloneDDS>
"""


def _qos(profile: Profile) -> Qos:
    reliable = Policy.Reliability.Reliable(_BLOCKED)
    return Qos(
        reliable if profile.is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if profile.is_durable else Policy.Durability.Volatile,
        Policy.History.KeepLast(profile.depth) if profile.depth else Policy.History.KeepAll,
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


class DdsLink:
    """A DDS participant in one domain: sends messages, receives commands."""

    def __init__(self, domain: int, commands: str) -> None:
        """Join a domain; where there is a topic of commands, listen to it.

        Raises:
            UsageError: there is no loopback interface, or the domain has no ports left.
        """
        self.sent: dict[tuple[str, str], int] = {}  # how many messages by topic and type
        self.lost = 0  # as somebody who listens does not keep up
        self._writers: dict[tuple[str, str, str], DataWriter[Any]] = {}
        self._reader: DataReader[Any] | None = None
        try:
            self._domain = Domain(domain, CONFIGURATION)
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise UsageError(
                f"--live: DDS does not start in domain {domain} on 127.0.0.1: {error.msg}"
            ) from error
        if commands:
            topic = Topic(self._participant, _wire_topic(commands), wire_type(TWIST))
            self._reader = DataReader(self._participant, topic, qos=_qos(Profile(DEPTH)))

    def publish(self, message: Message) -> None:
        """Send a message, except pixels and points, which a dry run does not make."""
        data = serialized(message)
        if data is None:
            return
        try:
            self._writer(message).write(wire_type(message.type).deserialize(data))
        except DDSException:  # a reader that is stuck holds up what is reliable, for a while
            self.lost += 1
            return
        key = (message.topic, message.type)
        self.sent[key] = self.sent.get(key, 0) + 1

    def commands(self) -> Iterator[Twist]:
        """Yield the commands that came since the last call, without those that are no numbers."""
        for sample in self._reader.take(N=DEPTH) if self._reader is not None else ():
            if isinstance(sample, InvalidSample):
                continue  # a publisher left
            linear = (sample.linear.x, sample.linear.y, sample.linear.z)
            angular = (sample.angular.x, sample.angular.y, sample.angular.z)
            if all(abs(speed) <= FASTEST for speed in (*linear, *angular)):
                yield (linear, angular)

    def close(self) -> None:
        """Leave the domain."""
        self._writers.clear()
        self._reader = None
        del self._participant, self._domain

    def _writer(self, message: Message) -> DataWriter[Any]:
        """Return the publisher of a node: each has its own, as in Isaac Sim."""
        key = (message.node, message.topic, message.type)
        if key not in self._writers:
            kind = wire_type(message.type)
            topic = Topic(self._participant, _wire_topic(message.topic), kind)
            offered = _qos(message.profile)
            self._writers[key] = DataWriter(self._participant, topic, qos=offered)
        return self._writers[key]


def _wire_topic(topic: str) -> str:
    """Return the name of a topic of ROS 2 on the wire: `rt/odom` for `/odom`."""
    return f"rt{topic}"


@cache
def wire_type(kind: str) -> type[IdlStruct]:
    """Return the DDS type of a message type, such as `geometry_msgs::msg::dds_::Twist_`."""
    _, fields = STORE.fielddefs[kind]
    package, _, message = kind.split("/")
    name = f"{message}_"
    made = {field: _field(*described) for field, described in fields}
    return make_idl_struct(name, f"{package}.msg.dds_.{name}", made)


def _field(node: Nodetype, of: Any) -> Any:
    if node is Nodetype.BASE:
        return _BASES[of[0]]
    if node is Nodetype.NAME:
        return wire_type(of)
    inner, length = of
    if node is Nodetype.ARRAY:
        return _OF.array[_field(*inner), length]
    return _OF.sequence[_field(*inner)]


BEHIND = 0.25  # seconds that are caught up; what is behind by more goes on from there


class Lived(Struct, frozen=True):
    """The result: simulated seconds, seconds of the clock, messages by topic."""

    played: float
    took: float
    commands: int
    sent: dict[tuple[str, str], int]
    lost: int
    away: tuple[tuple[str, int], ...]  # topics of other domains, which were not sent
    not_simulated: dict[str, str]


def play_live(player: Player, link: DdsLink, done: Callable[[int], bool]) -> Lived:
    """Play frame by frame, until it is done after so many frames, or until Ctrl-C."""
    network = player.world.network
    away: dict[tuple[str, int], None] = {}
    begun = due = time.monotonic()
    frames = 0
    try:
        while not done(frames):
            for twist in link.commands():
                player.hear(twist)
            player.step()
            frames += 1
            for message in network.sent:
                if message.away is None:
                    link.publish(message)
                else:
                    away[message.topic, message.away] = None
            network.sent.clear()
            due = paced(due + 1.0 / RATE)
    except KeyboardInterrupt:
        pass
    took = time.monotonic() - begun
    return Lived(
        frames / RATE,
        took,
        player.commands,
        dict(sorted(link.sent.items())),
        link.lost,
        tuple(away),
        unknown_in(player.world),
    )


def paced(due: float) -> float:
    """Wait until a frame is due, and return when it was; late frames follow at once."""
    now = time.monotonic()
    if now < due:
        time.sleep(due - now)
        return due
    return max(due, now - BEHIND)
