"""The topics of a stage: what each node publishes and subscribes, as ROS 2 will see it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from lab3_usd.check.ros.qos import QUEUE, Qos, qos_of
from lab3_usd.check.ros.running import (
    Nodes,
    effective_value,
    is_switched_on,
    live_nodes,
    run_states,
    running_nodes,
)
from lab3_usd.check.ros.sensor_sources import fed_by_sensor, is_fed, rate_source, sensor_of
from lab3_usd.model.derived import once_per_stage
from lab3_usd.model.stage import Node, StageModel
from lab3_usd.spec.catalog import INPUT, NodeType
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.topic_names import frame_ports, product_input, resolved_topic, topic_switch

TRANSFORMS = "tf2_msgs/msg/TFMessage"
Direction = Literal["publishes", "subscribes"]
_DIRECTIONS: dict[str, Direction] = {
    "publisher": "publishes",
    "helper": "publishes",
    "subscriber": "subscribes",
}
_KIND = "inputs:type"
_MESSAGE = ("inputs:messagePackage", "inputs:messageSubfolder", "inputs:messageName")
_VALID = re.compile(r"^(/[A-Za-z_][A-Za-z0-9_]*)+$")


class Endpoint(Struct, frozen=True):
    """One topic of one node.

    `topic` is the resolved name, None where ROS 2 refuses it or a wire brings it; `written` is
    the setting. `type` is None where the stage does not say. `runs` tells whether anything is
    sent or received at all, `sure` whether that is certain, `rate` what sets the pace.
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


def resolve(namespace: str, written: str) -> str | None:
    """Return the full name of a topic as Isaac Sim's bridge asks ROS 2 for it.

    The bridge strips whatever is no letter or digit from both ends of the name and puts the
    namespace before it. None where nothing is left, or ROS 2 allows no such name.
    """
    name = resolved_topic(written, namespace)
    return name if _VALID.match(name) else None


@once_per_stage
def endpoints(stage: StageModel, lab: Lab) -> tuple[Endpoint, ...]:
    """Return every topic of every node in an active graph, in the order of topic and node."""
    live, running = live_nodes(stage, lab), running_nodes(stage, lab)
    nodes = (live, running, _sure(running, stage, lab))
    found = [
        _endpoint(node, port, stage, lab, nodes)
        for node in live.values()
        if node.type is not None and node.type.role in _DIRECTIONS
        for port in used_topics(node, node.type, live)
    ]
    return tuple(sorted(found, key=lambda each: (each.topic or "", each.direction, each.node.path)))


def used_topics(node: Node, kind: NodeType, live: Nodes) -> Iterator[str]:
    """Yield the topic inputs in use: a topic with a switch of its own counts when that is on.

    A topic that belongs to other kinds of messages than the node's is not in use.
    """
    asked = effective_value(node, _KIND, live)
    for port in kind.topics:
        if asked is not None and asked not in kind.only_of.get(port, (asked,)):
            continue
        switch = kind.ports.get(topic_switch(port))
        if switch is None or effective_value(node, switch.name, live) is True:
            product = kind.ports.get(product_input(port))
            if port == kind.topics[0] or product is None or is_fed(node, product.name, live):
                yield port


def _endpoint(
    node: Node, port: str, stage: StageModel, lab: Lab, nodes: tuple[Nodes, Nodes, Nodes]
) -> Endpoint:
    live, running, sure = nodes
    kind = node.type
    assert kind is not None  # noqa: S101 - endpoints() asks only nodes of a known type
    written = effective_value(node, port, live)
    queue = effective_value(node, QUEUE, live)
    switch = None if kind.tf is None else kind.tf.static
    static = switch is not None and effective_value(node, switch, live) is True
    runs = [_is_at_work(node, port, live, each) for each in (running, sure)]
    return Endpoint(
        topic=resolve(namespace_of(node, stage, lab, live), written)
        if isinstance(written, str)
        else None,
        written="" if written is None else str(written),
        type=message_type(node, kind, port, live),
        direction=_DIRECTIONS[kind.role],
        node=node,
        port=port,
        frames=tuple(_frames(node, port, live)),
        queue=queue if isinstance(queue, int) else None,
        qos=qos_of(node, live, static=static),
        rate=rate_source(node, stage, lab, running, static=static),
        runs=runs[0],
        sure=runs[1],
    )


def _sure(running: Nodes, stage: StageModel, lab: Lab) -> Nodes:
    states = run_states(stage, lab)
    return {path: node for path, node in running.items() if states[path] == "runs"}


def _is_at_work(node: Node, port: str, live: Nodes, running: Nodes) -> bool:
    """Whether a node sends or receives a topic, when these nodes run."""
    product = product_input(port)
    needs = node.type is not None and product in node.type.ports
    is_on = is_switched_on(node, live) and not is_refused(node, live)
    return node.path in running and is_on and (not needs or fed_by_sensor(node, product, running))


def namespace_of(node: Node, stage: StageModel, lab: Lab, live: Nodes) -> str:
    """Return the namespace before the node's topics.

    The node's own setting wins; else the attributes on the prims above the node count, for
    a TF publisher the outermost one only, for a sensor helper those above its sensor.
    """
    own = effective_value(node, INPUT + lab.policy.namespace, live)
    if isinstance(own, str) and own:
        return own
    if node.type is not None and node.type.tf is not None:
        return node.namespace.partition("/")[0]
    sensor = sensor_of(node, live)
    if sensor is None:
        return node.namespace
    return "/".join(value for _, value in namespaces_above(sensor, stage, lab))


def namespaces_above(path: str, stage: StageModel, lab: Lab) -> list[tuple[str, str]]:
    """Return the prims at and above a path that carry a namespace, outermost first, with it."""
    found: list[tuple[str, str]] = []
    while path:
        prim = stage.prim(path)
        value = None if prim is None else prim.attributes.get(lab.policy.namespace_attribute)
        found.extend([(path, value)] if isinstance(value, str) and value else [])
        path = path.rpartition("/")[0]
    return found[::-1]


def moving_prims(node: Node, stage: StageModel, lab: Lab, live: Nodes) -> list[tuple[str, str]]:
    """Return the prims whose namespace attribute moves the node's topics, with the attribute."""
    if effective_value(node, INPUT + lab.policy.namespace, live):
        return []
    sensor = sensor_of(node, live)
    is_tf = node.type is not None and node.type.tf is not None
    graph = node.path.rpartition("/")[0]
    found = namespaces_above(graph if is_tf or sensor is None else sensor, stage, lab)
    if node.own_namespace and (is_tf or sensor is None):
        found.append((node.path, node.own_namespace))
    return found[:1] if is_tf else found


def message_type(node: Node, kind: NodeType, port: str, live: Nodes) -> str | None:
    """Return the message type of one topic of a node, None where the stage does not say."""
    if topic_switch(port) in kind.ports:
        return None
    if all(name in kind.ports for name in _MESSAGE):
        parts = [effective_value(node, name, live) for name in _MESSAGE]
        return "/".join(str(part) for part in parts) if all(parts) else None
    return kind.message.get("") or kind.message.get(str(effective_value(node, _KIND, live)))


def is_refused(node: Node, live: Nodes) -> bool:
    """Whether the node asks for a kind of message that its type does not have: it sends nothing."""
    kind = node.type
    if kind is None or _KIND not in kind.ports or "" in kind.message:
        return False
    asked = effective_value(node, _KIND, live)
    return isinstance(asked, str) and asked not in kind.message


def _frames(node: Node, port: str, live: Nodes) -> Iterator[str]:
    for name in () if node.type is None else frame_ports(node.type, port):
        value = effective_value(node, name, live)
        yield "?" if value is None else str(value)
