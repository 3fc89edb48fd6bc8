"""The topics and frames that the graphs of a lab name, as a running stage would have them."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.spec.catalog import INPUT, Value
from lab3_usd.spec.graph import GraphSpec, NodeSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.topic_names import frame_ports, product_input, resolved_topic, topic_switch

_KIND = f"{INPUT}type"


class GraphTopic(Struct, frozen=True):
    """A topic of one node; `type` is its message type, None where the spec does not say."""

    name: str
    type: str | None
    is_subscribed: bool
    graph: str
    place: str


class GraphFrame(Struct, frozen=True):
    """A transform that one node gives, or a frame that it only names (`parent` is None then)."""

    parent: str | None
    child: str
    file: str
    key: str

    @property
    def place(self) -> str:
        """File and key."""
        return f"{self.file}: {self.key}"


def file_of(graph: GraphSpec) -> str:
    """Name the file of a graph."""
    return f"{graph.name}.yaml"


def value_of(node: NodeSpec, port: str) -> Value | None:
    """Return what an input has by the spec: the value set there, else the default."""
    said = next((each.value for each in node.settings if each.port == port), None)
    if said is not None:
        return said
    found = node.type.port(port)
    return None if found is None else found.default


def graph_topics(lab: Lab) -> Iterator[GraphTopic]:
    """Yield the topics that the graphs publish and subscribe."""
    for graph, node, port in _topic_ports(lab):
        topic = _topic(lab, node, port)
        if topic:
            message = node.type.message
            yield GraphTopic(
                name=topic,
                type=message.get("") or message.get(str(value_of(node, _KIND))),
                is_subscribed=node.type.role == "subscriber",
                graph=graph.name,
                place=f"{file_of(graph)}: {node.role}: {_short(port)}",
            )


def _topic_ports(lab: Lab) -> Iterator[tuple[GraphSpec, NodeSpec, str]]:
    """Yield the inputs that name topics in use: the second of a pair is where it gets an image."""
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            wired = {wire.target.port for wire in graph.wires_into(node.role)}
            for port in node.type.topics if node.type.role else ():
                product = product_input(port)
                is_first = port == node.type.topics[0]
                if is_first or product not in node.type.ports or product in wired:
                    yield graph, node, port


def _topic(lab: Lab, node: NodeSpec, port: str) -> str:
    """Return the name of a topic, '' where it is switched off or has none."""
    switch = topic_switch(port)
    if switch in node.type.ports and value_of(node, switch) is not True:
        return ""
    namespace = value_of(node, f"{INPUT}{lab.policy.namespace}") or ""
    return resolved_topic(str(value_of(node, port) or ""), str(namespace))


def _short(port: str) -> str:
    return port.partition(":")[2]


def graph_frames(lab: Lab) -> Iterator[GraphFrame]:
    """Yield the transforms that the graphs publish."""
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            tf = node.type.tf
            if tf is None:
                continue
            if tf.names:
                parent, child = (str(value_of(node, port) or "") for port in tf.names)
                key = f"{node.role}: {_short(tf.names[1])}"
                yield GraphFrame(parent, child, file_of(graph), key)
            if tf.prims:
                yield from _frames_of_prims(lab, graph, node, tf.prims)


def _frames_of_prims(
    lab: Lab, graph: GraphSpec, node: NodeSpec, ports: tuple[str, ...]
) -> Iterator[GraphFrame]:
    targets = {each.port: each.prims for each in node.targets}
    above = next((_name(path) for path in targets.get(ports[0], ())), lab.catalog.world_frame)
    robot = lab.scene.robot
    for path in targets.get(ports[1], ()):
        # The root of an articulation stands for its links.
        names = tuple(robot.links) if path == robot.path else (_name(path),)
        for name in names:
            if name != above:
                key = f"{node.role}: {_short(ports[1])}"
                yield GraphFrame(above, name, file_of(graph), key)


def _name(path: str) -> str:
    return path.rpartition("/")[2]


def named_frames(lab: Lab) -> Iterator[GraphFrame]:
    """Yield the frames that messages of the graphs name."""
    for graph, node, topic in _topic_ports(lab):
        for port in frame_ports(node.type, topic):
            frame = str(value_of(node, port) or "")
            if frame:
                yield GraphFrame(None, frame, file_of(graph), f"{node.role}: {_short(port)}")
