"""The connection to other programs of ROS 2 on this computer: Cyclone DDS, loopback only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from lab3_usd.errors import UsageError
from lab3_usd.sim.bag.messages import TWIST, serialized
from lab3_usd.sim.live.wire_types import wire_topic, wire_type
from lab3_usd.sim.record import Message, Profile
from lab3_usd.sim.ros import Twist

DEPTH = 10
FASTEST = 1e6  # metres or radians a second: what is beyond it, or no number, is no command
_BLOCKED = duration(milliseconds=100)  # as in the profiles of ROS 2
# Peers are asked one by one, as a loopback interface need not have multicast; ROS 2 asks 32.
# They are asked all the time, as they may come later and need not ask us.
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
    <SPDPInterval>1s</SPDPInterval>
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


class Link:
    """What is sent over DDS in one domain, and the commands that come."""

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
            message = f"--live: DDS does not start in domain {domain} on 127.0.0.1: {error.msg}"
            raise UsageError(message) from error
        if commands:
            topic = Topic(self._participant, wire_topic(commands), wire_type(TWIST))
            self._reader = DataReader(self._participant, topic, qos=_qos(Profile(DEPTH)))

    def publish(self, message: Message) -> None:
        """Send a message, but for pixels and points, which a dry run does not make."""
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
        for said in self._reader.take(N=DEPTH) if self._reader is not None else ():
            if isinstance(said, InvalidSample):
                continue  # a publisher left
            linear = (said.linear.x, said.linear.y, said.linear.z)
            angular = (said.angular.x, said.angular.y, said.angular.z)
            if all(abs(each) <= FASTEST for each in (*linear, *angular)):
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
            topic = Topic(self._participant, wire_topic(message.topic), kind)
            offered = _qos(message.profile)
            self._writers[key] = DataWriter(self._participant, topic, qos=offered)
        return self._writers[key]
