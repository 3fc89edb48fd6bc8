"""Which clock stamps each message that a stage publishes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from lab3_usd.facts.domains import Domain
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.stage import Node, StageModel, listed_once

CLOCK = "rosgraph_msgs/msg/Clock"


_Clock = Literal["simulation", "system", "unknown"]
_Chosen = tuple[str, _Clock, bool | None]  # the input that chooses, the clock, whether it restarts


class Stamp(Struct, frozen=True, eq=False):
    """The clock of one topic; `port` is the input that chooses it.

    `restarts` is None where it is not known.
    """

    node: Node
    topic: str
    port: str
    clock: _Clock
    restarts: bool | None
    is_clock: bool
    domain: Domain


@listed_once
def topic_clocks(stage: StageModel) -> Iterator[Stamp]:
    """Yield the clock of each topic that is published."""
    for endpoint in endpoints(stage):
        if endpoint.runs and endpoint.direction == "publishes" and endpoint.topic:
            chosen = _own_clock(endpoint.node, stage) or _wired_clock(endpoint.node, stage)
            if chosen is not None:
                is_clock, domain = endpoint.type == CLOCK, endpoint.domain
                yield Stamp(endpoint.node, endpoint.topic, *chosen, is_clock, domain)


def _own_clock(node: Node, stage: StageModel) -> _Chosen | None:
    """Return the clock of a node that reads the time by itself."""
    live, ros = live_nodes(stage), stage.platform.ros
    system, restart = INPUT + ros.system_time, INPUT + ros.restart
    if node.type is None or system not in node.type.ports:
        return None
    if effective_value(node, system, live) is True:
        return system, "system", None
    restarts = effective_value(node, restart, live)
    return restart, "simulation", restarts if isinstance(restarts, bool) else None


def _wired_clock(node: Node, stage: StageModel) -> _Chosen | None:
    """Return the clock of a node whose time comes over a wire."""
    live, stamp = live_nodes(stage), INPUT + stage.platform.ros.stamp
    source, _ = next(iter(live_sources(node, stamp, live)), (None, ""))
    if source is None:
        return None
    if source.type is not None and any("systemTime" in port for port in source.type.ports):
        return stamp, "system", None
    restarts = effective_value(source, INPUT + stage.platform.ros.reader_restart, live)
    if source.type is None or not isinstance(restarts, bool):
        return stamp, "unknown", None
    return stamp, "simulation", restarts
