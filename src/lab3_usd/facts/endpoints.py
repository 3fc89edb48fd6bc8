"""The topics of a stage as ROS 2 will see them: who publishes and subscribes, with which QoS.

Facts: Isaac Sim's ROS 2 nodes read a profile as JSON with eight fields, all of them required;
the node that makes such profiles replaces them by those of its preset when the stage is loaded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.facts.domains import Domain, domain_of
from lab3_usd.facts.execution_order import (
    event_of,
    is_switched_on,
    live_nodes,
    nodes_with,
    run_states,
    signals,
)
from lab3_usd.facts.reaching_values import LiveNodes, Nodes, effective_value, live_sources
from lab3_usd.facts.render_products import (
    has_two_sizes,
    sensor_of,
    sensor_shown,
    stereo_products,
)
from lab3_usd.facts.sensor_values import values_of
from lab3_usd.facts.stuck_nodes import obstacle, working_nodes, working_states
from lab3_usd.isaac.messages import NAMED
from lab3_usd.isaac.node_types import INPUT, KIND, NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import frame_ports, product_input, resolved_topic, topic_switch
from lab3_usd.model.qos import Direction, Qos
from lab3_usd.model.stage import Node, StageModel, Unknown, once_per_stage

PROFILE = "inputs:qosProfile"
QUEUE = "inputs:queueSize"
PRESET = "inputs:createProfile"


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
_DEPTH = "depth"
_NUMBERS = (_DEPTH, "deadline", "lifespan", "leaseDuration")
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
        preset = PRESETS.get(str(effective_value(maker, PRESET, live)))
        return preset or _profile(
            {name: effective_value(maker, INPUT + name, live) for name in FIELDS}
        )
    text = effective_value(node, PROFILE, live)
    if text is None and node.has_port(PROFILE):
        return None
    if isinstance(text, str) and text:
        return read_profile(text)
    depth = effective_value(node, QUEUE, live)
    is_whole = isinstance(depth, int) and not isinstance(depth, bool)
    return replace(_DEFAULT, depth=depth if is_whole else None)


def is_maker(node: Node) -> bool:
    """Whether the node's inputs are the fields of a profile."""
    return node.type is not None and all(INPUT + name in node.type.ports for name in FIELDS)


def read_profile(text: str) -> Qos | None:
    """Read a profile written as JSON; None where Isaac Sim would refuse it.

    It asks for times with a point and the depth without one. Source: `Ros2QoS.h:247-253` of 6.0.1,
    the same in 5.0 and 5.1.
    """
    import json

    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(data, dict) or not isinstance(data.get(_DEPTH), int):
        return None
    times = [data.get(name) for name in _NUMBERS if name != _DEPTH]
    if not all(isinstance(time, float) and math.isfinite(time) for time in times):
        return None
    return _profile(data)


def _profile(data: Mapping[str, object]) -> Qos | None:
    values: dict[str, object] = {}
    for name, field in FIELDS.items():
        value = data.get(name)
        if name in _NUMBERS:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or value < 0:
                return None
            values[field] = int(value) if name == _DEPTH else float(value)
        elif value in WORDS[name]:
            values[field] = re.sub(r"([A-Z])", r"_\1", str(value)).lower()
        else:
            return None
    return Qos(**values)  # type: ignore[arg-type]  # all were just checked


_DIRECTIONS: dict[str, Direction] = {
    "publisher": "publishes",
    "helper": "publishes",
    "subscriber": "subscribes",
}
_VIEWPORT = "inputs:viewport"  # before 6.0 a window could stand for the render product
_VALID = r"^(/[A-Za-z_][A-Za-z0-9_]*)+$"


class Endpoint(Struct, frozen=True):
    """One topic of one node.

    `topic` is the resolved name, None where ROS 2 refuses it or a wire brings it; `written` is
    the setting. `type` is None where the stage does not say. `runs` tells whether anything is
    sent or received at all, `sure` whether that is certain, `rate` what sets the pace. `silence`
    says why nothing is sent or received, '' where something is.
    """

    topic: str | None
    written: str
    type: str | None
    direction: Direction
    node: Node
    port: str
    frames: tuple[str, ...]
    queue: int | None
    qos: Qos | None
    rate: str
    runs: bool
    sure: bool
    domain: Domain = Domain()
    silence: str = ""


def ros_name(namespace: str, written: str) -> str | None:
    """Return the full name of a topic as Isaac Sim's bridge asks ROS 2 for it.

    The bridge strips whatever is no letter or digit from both ends of the name and puts the
    namespace before it. None where nothing is left, or ROS 2 allows no such name.
    """
    name = resolved_topic(written, namespace)
    return name if re.match(_VALID, name) else None


@once_per_stage
def endpoints(stage: StageModel) -> tuple[Endpoint, ...]:
    """Return every topic of every node in an active graph, in the order of topic and node."""
    live, running = live_nodes(stage), working_nodes(stage)
    states = working_states(stage)
    is_certain = all(state == "runs" for state in states.values())
    surely = (node for path, node in running.items() if states[path] == "runs")
    certain = running if is_certain else LiveNodes(surely, live.variables)
    nodes = (live, running, certain)
    unordered = [
        _endpoint(node, port, stage, nodes)
        for node, kind in nodes_with(lambda kind: kind if kind.role in _DIRECTIONS else None, stage)
        for port in used_topics(node, kind, live)
    ]
    return tuple(sorted(unordered, key=lambda end: (end.topic or "", end.direction, end.node.path)))


@once_per_stage
def names_by_node(stage: StageModel) -> Mapping[str, frozenset[tuple[str, str | None, str]]]:
    """Map each node to its topics: direction, resolved name and domain."""
    by_node: dict[str, set[tuple[str, str | None, str]]] = {}
    for end in endpoints(stage):
        by_node.setdefault(end.node.path, set()).add((end.direction, end.topic, end.domain.name))
    return {path: frozenset(names) for path, names in by_node.items()}


@once_per_stage
def running_endpoints(stage: StageModel, direction: Direction) -> tuple[Endpoint, ...]:
    """Return the topics that something is sent to, or received from, and whose name is known."""
    return tuple(
        endpoint
        for endpoint in endpoints(stage)
        if endpoint.runs and endpoint.topic and endpoint.direction == direction
    )


def used_topics(node: Node, kind: NodeType, live: Nodes) -> Iterator[str]:
    """Yield the topic inputs in use: a topic with a switch of its own counts when that is on.

    A topic that belongs to other kinds of messages than the node's is not in use.
    """
    message_kind = effective_value(node, KIND, live)
    for port in kind.topics:
        if message_kind is not None and message_kind not in kind.only_of.get(port, (message_kind,)):
            continue
        switch = kind.ports.get(topic_switch(port))
        if switch is None or effective_value(node, switch.name, live) is True:
            product = kind.ports.get(product_input(port))
            if port == kind.topics[0] or product is None or _is_fed(node, product.name, live):
                yield port


def _endpoint(
    node: Node, port: str, stage: StageModel, nodes: tuple[Nodes, Nodes, Nodes]
) -> Endpoint:
    live, running, certain = nodes
    kind = node.type
    assert kind is not None  # noqa: S101 - endpoints() asks only nodes of a known type
    written = effective_value(node, port, live)
    queue = effective_value(node, QUEUE, live)
    switch = None if kind.tf is None else kind.tf.static
    static = switch is not None and effective_value(node, switch, live) is True
    is_refused_pair = has_two_sizes(stereo_products(node, stage, live))
    runs = _is_at_work(node, port, live, running) and not is_refused_pair
    is_sure = certain is running or _is_at_work(node, port, live, certain)
    frames = (effective_value(node, name, live) for name in frame_ports(kind, port))
    direction, qos = _DIRECTIONS[kind.role], qos_of(node, live, static=static)
    return Endpoint(
        topic=full_topic(node, port, stage, live),
        written=display_unknown(node, port) if written is None else str(written),
        type=message_type(node, kind, port, live),
        direction=direction,
        node=node,
        port=port,
        frames=tuple("?" if frame is None else str(frame) for frame in frames),
        queue=queue if isinstance(queue, int) else None,
        qos=None if qos is None or not qos.is_known else qos.opened(direction),
        rate=_rate_source(node, stage, running, static=static),
        runs=runs,
        sure=runs and is_sure,
        domain=domain_of(node, live, stage.platform),
        silence="" if runs else _silence(node, port, stage),
    )


def _silence(node: Node, port: str, stage: StageModel) -> str:
    """Say why a node neither sends nor receives a topic."""
    live, states = live_nodes(stage), run_states(stage)
    stuck = obstacle(node, stage)
    if not is_switched_on(node, live):
        return "it is disabled"
    if is_refused(node, live):
        return f"it has no {KIND.removeprefix(INPUT)} {effective_value(node, KIND, live)}"
    if stuck is not None and stuck.sure:
        return stuck.why if stuck.node is node else f"{stuck.node.path}: {stuck.why}"
    if node.path in states:
        return f"nothing reaches {product_input(port)}"
    return "nothing triggers it"


def _is_at_work(node: Node, port: str, live: Nodes, running: Nodes) -> bool:
    """Whether a node sends or receives a topic, when these nodes run."""
    product = product_input(port)
    needs = node.type is not None and product in node.type.ports
    is_on = is_switched_on(node, live) and not is_refused(node, live)
    is_fed_otherwise = node.has_port(_VIEWPORT) and _is_fed(node, _VIEWPORT, live)
    # A render product reaches a node from one that runs, or by name.
    is_fed = (
        any(is_switched_on(source, running) for source, _ in live_sources(node, product, running))
        if node.sources(product)
        else bool(node.value(product)) or node.is_unknown(product)
    )
    has_sensor = not needs or is_fed_otherwise or is_fed
    return node.path in running and is_on and has_sensor


def full_topic(node: Node, port: str, stage: StageModel, live: Nodes) -> str | None:
    """Return the topic of a node with its namespace, None where it is not valid or not known."""
    written = effective_value(node, port, live)
    is_known = not node.is_unknown(INPUT + stage.platform.ros.namespace)
    if not isinstance(written, str) or not is_known:
        return None
    return ros_name(namespace_of(node, stage, live), written)


def display_unknown(node: Node, port: str) -> str:
    """Return what a script calls a value that is not known before it runs, '' for none."""
    state = node.state(port)
    value = None if state is None else state.value
    return f"{{{value.why}}}" if isinstance(value, Unknown) else ""


def namespace_of(node: Node, stage: StageModel, live: Nodes) -> str:
    """Return the namespace before the node's topics.

    The node's own setting wins; else the attributes on the prims above the node count, for
    a TF publisher the outermost one only, for a sensor helper those above its sensor.
    """
    own = effective_value(node, INPUT + stage.platform.ros.namespace, live)
    if isinstance(own, str) and own:
        return own
    if node.type is not None and node.type.tf is not None:
        return next(iter(node.namespaces), "")  # whole, with its slashes
    sensor = sensor_of(node, live)
    if sensor is None:
        return "/".join(node.namespaces)
    return "/".join(value for _, value in namespaces_above(sensor, stage))


def namespaces_above(path: str, stage: StageModel) -> list[tuple[str, str]]:
    """Return the prims at and above a path that carry a namespace, outermost first, with it."""
    namespaces: list[tuple[str, str]] = []
    while path:
        prim = stage.prim(path)
        value = (
            None if prim is None else prim.attributes.get(stage.platform.ros.namespace_attribute)
        )
        if isinstance(value, str) and value:
            namespaces.append((path, value))
        path = path.rpartition("/")[0]
    return namespaces[::-1]


def moving_prims(node: Node, stage: StageModel, live: Nodes) -> list[tuple[str, str]]:
    """Return the prims whose namespace attribute moves the node's topics, with the attribute."""
    if effective_value(node, INPUT + stage.platform.ros.namespace, live):
        return []
    sensor = sensor_of(node, live)
    is_tf = node.type is not None and node.type.tf is not None
    is_on_graph = is_tf or sensor is None
    if is_on_graph and not node.namespaces:
        return []
    graph = node.path.rpartition("/")[0]
    prims = namespaces_above(graph if sensor is None or is_tf else sensor, stage)
    if node.own_namespace and is_on_graph:
        prims.append((node.path, node.own_namespace))
    return prims[:1] if is_tf else prims


def message_type(node: Node, kind: NodeType, port: str, live: Nodes) -> str | None:
    """Return the message type of one topic of a node, None where the stage does not say."""
    if port in kind.other_messages:
        return kind.other_messages[port]
    if topic_switch(port) in kind.ports:
        return None
    if all(name in kind.ports for name in NAMED):
        parts = [effective_value(node, name, live) for name in NAMED]
        return "/".join(str(part) for part in parts) if all(parts) else None
    return kind.message.get("") or kind.message.get(str(effective_value(node, KIND, live)))


def is_refused(node: Node, live: Nodes) -> bool:
    """Whether the node asks for a kind of message that its type does not have: it sends nothing."""
    kind = node.type
    if kind is None or KIND not in kind.ports or "" in kind.message:
        return False
    message_kind = effective_value(node, KIND, live)
    return isinstance(message_kind, str) and message_kind not in kind.message


def _is_fed(node: Node, port: str, live: Nodes) -> bool:
    """Whether an input that is empty by default gets anything, by wire or as a value."""
    value = effective_value(node, port, live)
    return value is None or value not in ("", ())


_SKIPPED = "inputs:frameSkipCount"  # frames of the sensor that a helper leaves out after each


def _rate_source(node: Node, stage: StageModel, running: Nodes, *, static: bool) -> str:
    """Say what sets the pace: the sensor's own rate, the event that starts the node, or nothing."""
    state = run_states(stage).get(node.path)
    if state is None:
        return "never"
    event = ", ".join(dict.fromkeys(_events(node, stage.platform, running))) or "every update"
    event = event if state == "runs" else f"perhaps {event}"
    if static:
        return f"once after {event}"
    sensor = sensor_shown(node, stage, running)
    prim = None if sensor is None else stage.prim(sensor)
    rate = 0.0  # for every frame
    if prim is not None:
        rate = values_of(prim, stage).number(stage.platform.sensor_models.lidar.rate) or 0.0
    skipped = effective_value(node, _SKIPPED, running)
    rate /= skipped + 1 if isinstance(skipped, int) and skipped > 0 else 1
    return f"sensor at {rate:g} Hz" if rate > 0 else event


def _events(node: Node, platform: Platform, running: Nodes) -> Iterator[str]:
    """Yield the names of the events that the node's execution comes from, each once."""
    seen = {node.path}
    for current in (ahead := [node]):
        senders = signals(current, running)
        if event_of(current, platform) is not None or (current is not node and not senders):
            kind = current.type
            yield (current.type_name.rpartition(".")[2] if kind is None else kind.handout_name)
        for source, _ in senders:
            if source.path not in seen:
                seen.add(source.path)
                ahead.append(source)
