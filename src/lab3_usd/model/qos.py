"""What of a QoS profile keeps an endpoint from its usual peer, and what Fast DDS makes of defaults.

The usual peers have the defaults of ROS 2 Humble: a publisher (teleop, `ros2 topic pub`, Nav2)
offers reliable, volatile, no deadline and automatic liveliness without a lease; `tf2_ros` listens
to transforms as reliable. Whoever asks for more than is offered hears nothing (DDS).
"""

from __future__ import annotations

from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.topics import TRANSFORMS

Direction = Literal["publishes", "subscribes"]
UNKNOWN, SYSTEM_DEFAULT = "unknown", "system_default"
TELEOP, LISTENER = "a default publisher (teleop, Nav2)", "tf2_ros.TransformListener"


class Qos(Struct, frozen=True):
    """A QoS profile in the words of ROS 2; times in seconds, 0 for no limit.

    `depth` is None where it comes over a wire with an unknown value.
    """

    history: str = "keep_last"
    depth: int | None = 10
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline: float = 0.0
    lifespan: float = 0.0
    liveliness: str = "system_default"
    lease_duration: float = 0.0

    def __str__(self) -> str:
        """Write what matters for meeting a subscriber."""
        depth = "?" if self.depth is None else str(self.depth)
        history = f"{self.history} {depth}" if self.history == "keep_last" else self.history
        return f"{history}, {self.reliability}, {self.durability}"

    @property
    def is_known(self) -> bool:
        """Whether an endpoint can have it: ROS 2 refuses a policy `unknown`."""
        words = (self.history, self.reliability, self.durability, self.liveliness)
        return UNKNOWN not in words

    def opened(self, direction: Direction) -> Qos:
        """Return it as Fast DDS opens it, which has defaults of its own."""
        publishes = direction == "publishes"
        reliability = "reliable" if publishes else "best_effort"
        durability = "transient_local" if publishes else "volatile"
        return replace(
            self,
            history="keep_last" if self.history == SYSTEM_DEFAULT else self.history,
            depth=1 if self.history == SYSTEM_DEFAULT and not self.depth else self.depth,
            reliability=reliability if self.reliability == SYSTEM_DEFAULT else self.reliability,
            durability=durability if self.durability == SYSTEM_DEFAULT else self.durability,
        )


def refusal(asked: Qos, offered: Qos) -> str:
    """Say what a subscriber with one profile asks for and a publisher does not offer, '' for none.

    Such two are not matched (DDS).
    """
    if asked.reliability == "reliable" and offered.reliability == "best_effort":
        return "reliable, and best effort is offered"
    if asked.durability == "transient_local" and offered.durability == "volatile":
        return "transient local, and volatile is offered"
    for limit, least, name in (
        (asked.deadline, offered.deadline, "deadline"),
        (asked.lease_duration, offered.lease_duration, "lease"),
    ):
        if limit and (not least or least > limit):
            given = f"one of {least:g} s" if least else "none"
            return f"a {name} of {limit:g} s, and {given} is offered"
    if asked.liveliness == "manual_by_topic" != offered.liveliness:
        return "manual liveliness, and automatic is offered"
    return ""


def unmatched(direction: Direction, kind: str, qos: Qos) -> str:
    """Say which usual peer an endpoint cannot be matched with, and why; '' where it can.

    `kind` is the type of its messages.
    """
    own, peer = qos.opened(direction), Qos()
    if direction == "subscribes":
        asked = refusal(own, peer)
        return f"it receives nothing from {TELEOP}: it asks for {asked}" if asked else ""
    asked = refusal(peer, own) if kind == TRANSFORMS else ""
    return f"{LISTENER} asks for {asked}" if asked else ""
