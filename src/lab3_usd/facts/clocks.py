"""Which clock stamps each message that a stage publishes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from lab3_usd.facts.domains import Domain
from lab3_usd.facts.endpoints import Endpoint, endpoints
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.stage import Node, StageModel, listed_once

CLOCK = "rosgraph_msgs/msg/Clock"


class Stamp(Struct, frozen=True, eq=False):
    """The clock of one topic; `port` is the input that chooses it.

    `restarts` is None where it is not known.
    """

    node: Node
    topic: str
    port: str
    clock: Literal["simulation", "system", "unknown"]
    restarts: bool | None
    is_clock: bool
    domain: Domain


@listed_once
def topic_clocks(stage: StageModel) -> Iterator[Stamp]:
    """Yield the clock of each topic that is published."""
    for endpoint in endpoints(stage):
        if endpoint.runs and endpoint.direction == "publishes" and endpoint.topic:
            stamp = _stamp_of_helper(endpoint, stage) or _stamp_by_wire(endpoint, stage)
            if stamp is not None:
                yield stamp


def _stamp_of_helper(endpoint: Endpoint, stage: StageModel) -> Stamp | None:
    """Return the clock of a node that reads the time by itself."""
    node, live, ros = endpoint.node, live_nodes(stage), stage.platform.ros
    system, restart = INPUT + ros.system_time, INPUT + ros.restart
    if node.type is None or system not in node.type.ports:
        return None
    topic = str(endpoint.topic)
    if effective_value(node, system, live) is True:
        return Stamp(node, topic, system, "system", None, is_clock=False, domain=endpoint.domain)
    restarts = effective_value(node, restart, live)
    restarting = restarts if isinstance(restarts, bool) else None
    return Stamp(
        node, topic, restart, "simulation", restarting, is_clock=False, domain=endpoint.domain
    )


def _stamp_by_wire(endpoint: Endpoint, stage: StageModel) -> Stamp | None:
    """Return the clock of a node whose time comes over a wire."""
    node, stamp = endpoint.node, INPUT + stage.platform.ros.stamp
    sources = live_sources(node, stamp, live_nodes(stage))
    if not sources:
        return None
    source, _ = sources[0]
    is_clock, topic = endpoint.type == CLOCK, str(endpoint.topic)
    restart = INPUT + stage.platform.ros.reader_restart
    restarts = effective_value(source, restart, live_nodes(stage))
    if source.type is None:
        return Stamp(node, topic, stamp, "unknown", None, is_clock, endpoint.domain)
    if any("systemTime" in port for port in source.type.ports):
        return Stamp(node, topic, stamp, "system", None, is_clock, endpoint.domain)
    if isinstance(restarts, bool):
        return Stamp(node, topic, stamp, "simulation", restarts, is_clock, endpoint.domain)
    return Stamp(node, topic, stamp, "unknown", None, is_clock, endpoint.domain)
