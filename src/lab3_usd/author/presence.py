"""What of a planned graph a stage has already, and who does the same there."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from msgspec import Struct

from lab3_usd.facts.articulations import articulations, commands, named_joints
from lab3_usd.facts.domains import may_meet
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.execution_order import event_of, live_nodes, run_states
from lab3_usd.facts.frames import all_edges
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.graph import Graph
from lab3_usd.isaac.graph import Node as Planned
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.topics import TRANSFORMS, resolved_topic
from lab3_usd.isaac.values import Value
from lab3_usd.model.stage import GraphModel, Node, StageModel, same_value


class Likeness(Struct, frozen=True):
    """How far a graph of a stage is a planned one.

    `node_of` are its nodes by the roles that they play, `differences` the values that are others,
    in words, `wires_missing` counts wires. It is `whole` where each role is played, and `has_more`
    where there are nodes beside.
    """

    path: str
    node_of: Mapping[str, Node]
    differences: tuple[str, ...]
    wires_missing: int
    whole: bool
    has_more: bool

    @property
    def is_same(self) -> bool:
        """Whether the graph has all that is planned."""
        return self.whole and not (self.differences or self.wires_missing)

    @property
    def is_alike(self) -> bool:
        """Whether the graph is of the same kind, with other values."""
        return self.whole and not (self.wires_missing or self.has_more)


def likeness(planned: Graph, there: GraphModel, stage: StageModel) -> Likeness:
    """Return how far a graph of the stage is a planned one."""
    node_of: dict[str, Node] = {}
    differences: list[str] = []
    missing = 0
    for node in sorted(planned.nodes.values(), key=lambda node: node.place[0]):
        found = [
            (*_unlike(node, other, planned, node_of, stage), other)
            for other in there.nodes
            if _may_play(node, other, stage) and other not in node_of.values()
        ]
        if not found:
            continue
        wires, unlike, other = min(
            found, key=lambda entry: (entry[0], len(entry[1]), entry[2].path)
        )
        node_of[node.role] = other
        missing += wires
        differences += unlike
    is_whole = len(node_of) == len(planned.nodes)
    has_more = len(there.nodes) > len(node_of)
    return Likeness(there.path, node_of, tuple(differences), missing, is_whole, has_more)


def _may_play(planned: Planned, node: Node, stage: StageModel) -> bool:
    """Whether a node is of the type that is planned, or an event that fires as often."""
    if node.type_name == planned.type.type:
        return True
    usual = stage.platform.graph.value(stage.platform.graph.evaluation.stage)
    is_event = planned.type.type in stage.platform.events
    outputs = {port.name for port in planned.type.ports.values() if port.is_execution}
    return (
        is_event
        and node.type is not None
        and event_of(node, stage.platform) == usual
        and run_states(stage).get(node.path) == "runs"
        and outputs <= {*node.type.ports}
    )


def _unlike(
    planned: Planned,
    node: Node,
    graph: Graph,
    node_of: Mapping[str, Node],
    stage: StageModel,
) -> tuple[int, list[str]]:
    """Return how many wires a node lacks or has beside, and which of its values are others."""
    live = live_nodes(stage)
    missing = 0
    wired = {}
    for wire in graph.wires:
        if wire.target.role == planned.role:
            wired[wire.target.port] = wire
            source = node_of.get(wire.source.role)
            expected = f"{source.path}.{wire.source.port}" if source else ""
            missing += expected not in node.sources(wire.target.port)
    unlike: list[str] = []
    if node.type_name != planned.type.type:
        return missing, unlike
    for name, port in planned.type.ports.items():
        if port.is_target and name.startswith(INPUT):
            aims = planned.targets.get(name, ())
            if not _same_targets(planned, name, aims, node, stage):
                unlike.append(f"{node.path}.{name} is {', '.join(node.targets(name)) or 'nothing'}")
        elif name.startswith(INPUT) and not port.is_execution and name not in wired:
            value = planned.values.get(name, planned.type.default(name, None))
            actual = effective_value(node, name, live)
            if actual is None and node.sources(name):
                missing += 1  # what comes over a wire is not what is planned
            elif not _same(planned, name, value, actual):
                unlike.append(f"{node.path}.{name} is {_shown(actual)}, asked {_shown(value)}")
    return missing, unlike


def _same_targets(
    planned: Planned, name: str, aims: tuple[str, ...], node: Node, stage: StageModel
) -> bool:
    drives = planned.type.drives
    if drives is not None and name == drives.target:
        path = node.value(drives.path)
        found = (path,) if isinstance(path, str) and path else node.targets(name)
        return [*_roots(found, stage)] == [*_roots(aims, stage)]
    return set(node.targets(name)) == set(aims)


def _roots(paths: Collection[str], stage: StageModel) -> Iterator[str]:
    for path in paths:
        yield from articulations(path, stage)


def _same(planned: Planned, name: str, value: Value | None, actual: Value | None) -> bool:
    if name in planned.type.topics and isinstance(value, str) and isinstance(actual, str):
        return resolved_topic(value) == resolved_topic(actual)
    if value in (None, "", ()) and actual in (None, "", ()):
        return True
    return same_value(value, actual)


def _shown(value: Value | None) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:g}" if isinstance(value, float) else "unset" if value is None else str(value)


class Rival(Struct, frozen=True):
    """A node that does already what a new one would: what, in words, and its path."""

    what: str
    path: str
    new: str


def rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    """Yield who does already what the new nodes of a stage do, each by its path."""
    yield from _topic_rivals(new, stage)
    yield from _frame_rivals(new, stage)
    yield from _joint_rivals(new, stage)


def _topic_rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    sent = [end for end in endpoints(stage) if end.direction == "publishes" and end.topic]
    for own in sent:
        if own.node.path not in new or own.type == TRANSFORMS:
            continue
        for other in sent:
            is_other = other.node.path not in new and other.topic == own.topic and other.runs
            if is_other and may_meet(own.domain, other.domain):
                yield Rival(f"publishes {own.topic} already", other.node.path, own.node.path)


def _frame_rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    edges = all_edges(stage)
    for own in edges:
        if own.publisher not in new:
            continue
        for other in edges:
            is_other = other.publisher not in new and other.topic == own.topic
            if is_other and other.child == own.child and may_meet(own.domain, other.domain):
                yield Rival(
                    f"sends the frame {own.child} already, below {other.parent}",
                    other.publisher,
                    own.publisher,
                )


def _joint_rivals(new: Collection[str], stage: StageModel) -> Iterator[Rival]:
    found = [(command, named_joints(command, stage)) for command in commands(stage)]
    for own, names in found:
        if own.node.path not in new or not names:
            continue
        for other, others in found:
            if other.node.path in new or not others or not set(own.roots) & set(other.roots):
                continue
            shared = [name for name in names if name in others]
            if shared:
                yield Rival(f"commands {', '.join(shared)} already", other.node.path, own.node.path)
