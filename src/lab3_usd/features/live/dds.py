"""A dry run that other programs of ROS 2 hear and drive, over DDS.

Messages have the types that Cyclone DDS makes of those of ROS 2.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
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
from msgspec.structs import replace
from rosbags.interfaces import Nodetype

from lab3_usd.errors import UsageError
from lab3_usd.isaac.topics import JOINT_STATES, STEERING, TWIST
from lab3_usd.model.qos import Qos as Profile
from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.execution.recording import JointStates, Message, Steering
from lab3_usd.sim.execution.world import SUBSCRIBER, RosEndpoint, Twist
from lab3_usd.sim.ros_messages import STORE, nanoseconds, serialized
from lab3_usd.sim.timeline import Player

_OF: Any = types  # the library types no subscripts of its own
# Base types of ROS 2 that the library has by another name.
_BASES: dict[str, Any] = {"bool": bool, "char": types.uint8, "string": str}

Command = Twist | JointStates | Steering
DEPTH = 10
FASTEST = 1e6  # metres or radians a second: what is beyond it, or no number, is no command
USUAL = Profile()
_MANUAL = "manual_by_topic"
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
    is_reliable, is_manual = profile.reliability == "reliable", profile.liveliness == _MANUAL
    is_durable = profile.durability == "transient_local"
    policies: list[Any] = [
        Policy.Reliability.Reliable(_BLOCKED) if is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if is_durable else Policy.Durability.Volatile,
        Policy.History.KeepAll
        if profile.history == "keep_all"
        else Policy.History.KeepLast(profile.depth or 1),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    ]
    if profile.deadline:
        policies.append(Policy.Deadline(nanoseconds(profile.deadline)))
    lease = profile.lease_duration
    if lease or is_manual:
        kind = Policy.Liveliness.ManualByTopic if is_manual else Policy.Liveliness.Automatic
        policies.append(kind(nanoseconds(lease) if lease else duration(infinite=True)))
    return Qos(*policies)


class DdsLink:
    """DDS participants, one in each domain: they send messages, and receive commands."""

    def __init__(self, home: int) -> None:
        """Join the domain of the lab, or of the first robot.

        Raises:
            UsageError: there is no loopback interface, or the domain has no ports left.
        """
        self.home = home
        self.sent: dict[tuple[str, str, int], int] = {}  # messages by topic, type and domain
        self.unsent: set[tuple[str, str, int]] = set()  # topics whose content a run does not make
        self.lost = 0  # as somebody who listens does not keep up
        self.refused: dict[int, str] = {}  # domains that cannot be joined, with the reason
        self._joined: dict[int, tuple[Domain, DomainParticipant]] = {}
        self._writers: dict[tuple[str, str, str, int], DataWriter[Any]] = {}
        self._readers: dict[tuple[int, str, str], DataReader[Any]] = {}
        try:
            self._participant(home)
        except DDSException as error:
            raise UsageError(
                f"--live: DDS does not start in domain {home} on 127.0.0.1: {error.msg}"
            ) from error

    def listen(self, domain: int, topic: str, kind: str, profile: Profile = USUAL) -> bool:
        """Listen to commands as a subscriber of the stage does, and return whether that is new."""
        key = (domain, topic, kind)
        if key in self._readers or domain in self.refused:
            return False
        there = self._in(domain)
        if there is None:
            return False
        on_wire = Topic(there, _wire_topic(topic), wire_type(kind))
        kept = replace(profile, history="keep_last", depth=DEPTH)
        self._readers[key] = DataReader(there, on_wire, qos=_qos(kept))
        return True

    def publish(self, message: Message) -> None:
        """Send a message, except pixels and points, which a dry run does not make."""
        data = serialized(message)
        domain = self.home if message.away is None else message.away
        if data is None:
            self.unsent.add((message.topic, message.type, domain))
        there = None if data is None else self._in(domain)
        if data is None or there is None:
            return
        try:
            writer = self._writer(message, domain, there)
            writer.write(wire_type(message.type).deserialize(data))
        except DDSException:  # a reader that is stuck holds up what is reliable, for a while
            self.lost += 1
            return
        key = (message.topic, message.type, domain)
        self.sent[key] = self.sent.get(key, 0) + 1

    def commands(self) -> Iterator[tuple[int, str, Command]]:
        """Yield domain, topic and content of the commands that came since the last call.

        Those that are no numbers are left out.
        """
        for (domain, topic, kind), reader in self._readers.items():
            for sample in reader.take(N=DEPTH):
                command = None if isinstance(sample, InvalidSample) else _COMMANDS[kind](sample)
                if command is not None:  # else a publisher left
                    yield domain, topic, command

    def close(self) -> None:
        """Leave the domains."""
        self._writers.clear()
        self._readers.clear()
        self._joined.clear()

    def _in(self, domain: int) -> DomainParticipant | None:
        """Return the participant in a domain, None where it cannot be joined."""
        if domain in self.refused:
            return None
        try:
            return self._participant(domain)
        except DDSException as error:
            self.refused[domain] = str(error.msg)
            return None

    def _participant(self, domain: int) -> DomainParticipant:
        if domain not in self._joined:
            self._joined[domain] = (Domain(domain, CONFIGURATION), DomainParticipant(domain))
        return self._joined[domain][1]

    def _writer(self, message: Message, domain: int, there: DomainParticipant) -> DataWriter[Any]:
        """Return the publisher of a node: each has its own, as in Isaac Sim."""
        key = (message.node, message.topic, message.type, domain)
        if key not in self._writers:
            topic = Topic(there, _wire_topic(message.topic), wire_type(message.type))
            self._writers[key] = DataWriter(there, topic, qos=_qos(message.profile))
        return self._writers[key]


def _twist_of(sample: Any) -> Twist | None:
    linear = (sample.linear.x, sample.linear.y, sample.linear.z)
    angular = (sample.angular.x, sample.angular.y, sample.angular.z)
    return (linear, angular) if _are_speeds(*linear, *angular) else None


def _joints_of(sample: Any) -> JointStates | None:
    arrays = [tuple(array) for array in (sample.position, sample.velocity, sample.effort)]
    # What is no number leaves a joint as it is.
    numbers = [number for array in arrays for number in array if not math.isnan(number)]
    return JointStates(tuple(sample.name), *arrays) if _are_speeds(*numbers) else None


def _steering_of(sample: Any) -> Steering | None:
    speed, angle = sample.drive.speed, sample.drive.steering_angle
    return Steering(speed, angle) if _are_speeds(speed, angle) else None


def _are_speeds(*numbers: float) -> bool:
    return all(abs(number) <= FASTEST for number in numbers)


_COMMANDS: Mapping[str, Callable[[Any], Command | None]] = {
    TWIST: _twist_of,
    JOINT_STATES: _joints_of,
    STEERING: _steering_of,
}


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
        return _BASES.get(of[0]) or getattr(types, of[0])
    if node is Nodetype.NAME:
        return wire_type(of)
    inner, length = of
    if node is Nodetype.ARRAY:
        return _OF.array[_field(*inner), length]
    return _OF.sequence[_field(*inner)]


BEHIND = 0.25  # seconds that are caught up; what is behind by more goes on from there


def play_live(
    player: Player,
    link: DdsLink,
    done: Callable[[int], bool],
    opened: Callable[[str, str, int], object] = lambda *_: None,
    only: str = "",
) -> tuple[float, float]:
    """Play frame by frame, until it is done after so many frames, or until Ctrl-C.

    Return the simulated seconds, and those of the clock. Each subscriber of commands is heard, or
    those of `only` one topic; `opened` is told the topic, the type and the domain of each when it
    opens.
    """
    network = player.world.network
    network.is_open = True
    home = network.commands.domain
    subscribers = [
        (node, kind)
        for node in player.program.nodes.values()
        if SUBSCRIBER in node.type.role and (kind := node.type.message.get("", "")) in _COMMANDS
    ]
    begun = due = time.monotonic()
    frames = 0
    try:
        while not done(frames):
            for domain, topic, command in link.commands():
                network.tell(command, (home if domain == link.home else domain, topic))
            player.step()
            frames += 1
            for message in network.sent:
                link.publish(message)
            network.sent.clear()
            for node, kind in subscribers:
                endpoint: RosEndpoint | None = node.memory.get("endpoint")
                if endpoint is None or only not in {"", endpoint.topic}:
                    continue
                there = link.home if endpoint.domain == home else endpoint.domain
                if link.listen(there, endpoint.topic, kind, endpoint.profile):
                    opened(endpoint.topic, kind, there)
            due = paced(due + 1.0 / RATE)
    except KeyboardInterrupt:
        pass
    return frames / RATE, time.monotonic() - begun


def paced(due: float) -> float:
    """Wait until a frame is due, and return when it was; late frames follow at once."""
    now = time.monotonic()
    if now < due:
        time.sleep(due - now)
        return due
    return max(due, now - BEHIND)
