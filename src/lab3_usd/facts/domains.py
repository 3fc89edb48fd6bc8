"""ROS contexts: which nodes use each, and in which domain a node talks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msgspec import Struct

from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.likely_names import is_unregistered
from lab3_usd.facts.reaching_values import Nodes, effective_value, live_sources
from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value
from lab3_usd.model.stage import Node, StageModel, listed_once, once_per_stage

_CONTEXT = "context"
LAST_DOMAIN = 232  # its ports begin at 7400 + 250 * domain (DDS-RTPS), and end at 65535


class Domain(Struct, frozen=True):
    """The ROS domain of a node: `name` is its number where the environment names none.

    Two nodes see each other where the names are alike; with `from_environment` the environment's
    ROS_DOMAIN_ID wins. `name` is a path where nothing tells the number.
    """

    name: str = "0"
    from_environment: bool = True

    @property
    def number(self) -> int | None:
        """The number of the domain where the environment names none, None where it is unknown."""
        return int(self.name) if self.name.isdecimal() else None

    def __str__(self) -> str:
        """Write the domain in words."""
        domain = f"domain {self.name}"
        return f"the environment's domain, else {domain}" if self.from_environment else domain


def may_meet(one: Domain, other: Domain) -> bool:
    """Whether nodes of two domains may hear each other: the environment may name any."""
    return one.name == other.name or one.from_environment or other.from_environment


def are_surely_one(domains: Iterable[Domain]) -> bool:
    """Whether domains of one name are one in every environment."""
    return len({domain.from_environment for domain in domains}) < 2  # noqa: PLR2004 - both kinds


class ContextInput(Struct, frozen=True, eq=False):
    """The context of a node: what makes it, and whether anything is wired or set at all."""

    node: Node
    port: str
    contexts: tuple[Node, ...]
    is_set: bool


@listed_once
def context_inputs(stage: StageModel) -> Iterator[ContextInput]:
    """Yield the context of every live node that takes one."""
    live, port = live_nodes(stage), INPUT + _CONTEXT
    for node in live.values():
        if node.type is not None and port in node.type.ports:
            contexts = tuple(source for source, _ in live_sources(node, port, live))
            is_set = bool(node.sources(port) or node.value(port)) or node.is_unknown(port)
            yield ContextInput(node, port, contexts, is_set)


def invalid_contexts(stage: StageModel) -> Iterator[tuple[Node, str, Value]]:
    """Yield the nodes whose context is a number that they hold or a constant gives.

    With each come its input and the number, of which nothing made a context (Ros2Node.h:152-161).
    """
    live = live_nodes(stage)
    for entry in context_inputs(stage):
        handle = effective_value(entry.node, entry.port, live)
        if handle:
            yield entry.node, entry.port, handle


def domain_of(node: Node, live: Nodes, platform: Platform) -> Domain:
    """Return the domain in which a node talks: that of its context, else the environment's.

    Isaac Sim opens a stage without a context of a type that it surely does not have.

    Source: `Ros2Node.h:152-161`, `OgnROS2Context.cpp:41-120`.
    """
    for source, _ in live_sources(node, INPUT + _CONTEXT, live):
        if source.type is None and is_unregistered(source.type_name, platform):
            continue
        if source.type is None or OUTPUT + _CONTEXT not in source.type.ports:
            return Domain(source.path, from_environment=False)
        return _domain_of_context(source, live, platform)
    return Domain()


def _domain_of_context(context: Node, live: Nodes, platform: Platform) -> Domain:
    ros = platform.ros
    number = effective_value(context, INPUT + ros.domain, live)
    is_open = effective_value(context, INPUT + ros.domain_by_environment, live) is True
    return Domain(str(number) if isinstance(number, int) else context.path, is_open)


@once_per_stage
def domains(stage: StageModel) -> Mapping[Domain, list[Node]]:
    """Return the contexts that a node uses by the domain that they name."""
    live, by_domain = live_nodes(stage), dict[Domain, list[Node]]()
    used = {
        node.path: node
        for context_input in context_inputs(stage)
        for node in context_input.contexts
    }
    for node in used.values():
        if node.type is not None and OUTPUT + _CONTEXT in node.type.ports:
            by_domain.setdefault(_domain_of_context(node, live, stage.platform), []).append(node)
    return by_domain
