"""The QoS profile that a publisher or subscriber ends up with, decoded from what the file says.

Facts: Isaac Sim's ROS 2 nodes read a profile as JSON with eight fields, all of them required; the
node that makes such profiles replaces them by those of its preset when the stage is loaded.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.ros.running import Nodes, effective_value, live_sources
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, Value

PROFILE = "inputs:qosProfile"
QUEUE = "inputs:queueSize"
PRESET = "inputs:createProfile"


class Qos(Struct, frozen=True):
    """A QoS profile in the words of ROS 2; times in seconds, 0 for no limit.

    `depth` is None where it comes by a wire that nobody can read.
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


# Each field of the JSON, and of the node that makes it, with ours.
FIELDS = {
    "history": "history",
    "depth": "depth",
    "reliability": "reliability",
    "durability": "durability",
    "deadline": "deadline",
    "lifespan": "lifespan",
    "liveliness": "liveliness",
    "leaseDuration": "lease_duration",
}
_NUMBERS = ("depth", "deadline", "lifespan", "leaseDuration")
_DEFAULT = Qos()
_SENSOR = Qos(depth=5, reliability="best_effort")
_SYSTEM = Qos("system_default", 0, "system_default", "system_default")
PRESETS = {
    "Default for publishers/subscribers": _DEFAULT,
    "Services": _DEFAULT,
    "Sensor Data": _SENSOR,
    "System Default": _SYSTEM,
}
WORDS = {
    "history": ("keepLast", "keepAll", "systemDefault", "unknown"),
    "reliability": ("reliable", "bestEffort", "systemDefault", "unknown"),
    "durability": ("volatile", "transientLocal", "systemDefault", "unknown"),
    "liveliness": ("automatic", "manualByTopic", "systemDefault", "unknown"),
}


def qos_of(node: Node, live: Nodes, *, static: bool) -> Qos | None:
    """Return the profile that the node uses; None where it refuses to work or it is unknown.

    Without a profile of its own a node keeps the last `queueSize` messages, reliable and volatile.
    A static TF publisher keeps one message for late subscribers, whatever its profile says.
    """
    if static:
        return Qos(depth=1, durability="transient_local")
    maker = next((source for source, _ in live_sources(node, PROFILE, live)), None)
    if maker is not None and is_maker(maker):
        return _made_by(maker, live)
    text = effective_value(node, PROFILE, live)
    if text is None and node.has_port(PROFILE):
        return None
    if isinstance(text, str) and text:
        return decode(text)
    return replace(_DEFAULT, depth=_whole(effective_value(node, QUEUE, live)))


def is_maker(node: Node) -> bool:
    """Whether the node's inputs are the fields of a profile."""
    return node.type is not None and all(INPUT + name in node.type.ports for name in FIELDS)


def _made_by(maker: Node, live: Nodes) -> Qos | None:
    preset = PRESETS.get(str(effective_value(maker, PRESET, live)))
    if preset is not None:
        return preset
    return _profile({name: effective_value(maker, INPUT + name, live) for name in FIELDS})


def decode(text: str) -> Qos | None:
    """Read a profile written as JSON; None where Isaac Sim would refuse it."""
    import json  # noqa: PLC0415 - few stages write profiles out

    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(data, dict):
        return None
    return _profile(data)


def _profile(data: Mapping[str, object]) -> Qos | None:
    values: dict[str, object] = {}
    for name, ours in FIELDS.items():
        value = data.get(name)
        if name in _NUMBERS:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or value < 0:
                return None
            values[ours] = int(value) if name == "depth" else float(value)
        elif value in WORDS[name]:
            values[ours] = re.sub(r"([A-Z])", r"_\1", str(value)).lower()
        else:
            return None
    return Qos(**values)  # type: ignore[arg-type]  # each was just checked


def _whole(value: Value | None) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) else None
