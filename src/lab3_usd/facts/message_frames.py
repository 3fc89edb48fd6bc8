"""The frames that messages name: of sensors, and those between which odometry lies."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.facts.endpoints import Endpoint, endpoints
from lab3_usd.facts.execution_order import live_nodes, nodes_of, run_states
from lab3_usd.facts.frame_targets import tf_ports
from lab3_usd.facts.frames import tf2_name
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.isaac.topics import frame_ports
from lab3_usd.model.stage import Node, StageModel, once_per_stage

_POSE = ("inputs:position", "inputs:translation")


class MessageFrame(Struct, frozen=True, eq=False):
    """A frame that a message names, in its setting `port`."""

    endpoint: Endpoint
    port: str
    name: str


@once_per_stage
def message_frames(stage: StageModel) -> tuple[MessageFrame, ...]:
    """Return the frames that messages name which are sent, but those of transforms themselves."""
    live, named = live_nodes(stage), dict[tuple[str, str], MessageFrame]()
    for endpoint in endpoints(stage):
        node, kind = endpoint.node, endpoint.node.type
        is_sent = endpoint.runs and endpoint.direction == "publishes"
        if kind is None or kind.tf is not None or not is_sent:
            continue
        for port in frame_ports(kind, endpoint.port):
            name = effective_value(node, port, live)
            if isinstance(name, str):
                named.setdefault((node.path, port), MessageFrame(endpoint, port, name))
    return tuple(named.values())


class NamedPose(Struct, frozen=True, eq=False):
    """A pose with named frames: both frames, the inputs that name them, and who computes it.

    It is of a transform or of a message, which is not `sent` where its publisher does not run.
    """

    node: Node
    ports: tuple[str, ...]
    frames: tuple[str, str]
    maker: str
    is_transform: bool
    sent: bool

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """The node with each of the ports that name the frames."""
        return tuple((self.node.path, port) for port in self.ports)


def odometry_pairs(stage: StageModel) -> Iterator[tuple[NamedPose, NamedPose]]:
    """Yield messages and transforms whose pose comes from one node."""
    poses = [
        pose
        for node in nodes_of(lambda kind: any(map(kind.port, _POSE)), stage)
        if (pose := _named_pose(node, stage))
    ]
    transforms: dict[str, list[NamedPose]] = {}
    for pose in poses:
        if pose.is_transform and pose.sent:
            transforms.setdefault(pose.maker, []).append(pose)
    for message in poses:
        if not message.is_transform:
            yield from ((message, transform) for transform in transforms.get(message.maker, ()))


def _named_pose(node: Node, stage: StageModel) -> NamedPose | None:
    sources = (
        source for port in _POSE for source, _ in live_sources(node, port, live_nodes(stage))
    )
    maker = next(sources, None)
    if node.type is None or maker is None:
        return None
    names = tf_ports(node).names
    ports = names or node.type.frames
    values = [effective_value(node, port, live_nodes(stage)) for port in ports]
    texts = [value for value in values if isinstance(value, str)]
    if len(texts) != len(_POSE) or len(ports) != len(_POSE):
        return None
    frames = (tf2_name(texts[0]), tf2_name(texts[1])) if names else (texts[0], texts[1])
    is_sent = node.path in run_states(stage)
    return NamedPose(node, ports, frames, maker.path, bool(names), is_sent)
