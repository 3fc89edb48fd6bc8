"""Why a node never computes: no execution reaches it, or an input that it needs has no value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct

from lab3_usd.facts.arrays import array_items
from lab3_usd.facts.execution_order import (
    event_of,
    gate_step,
    is_opened_first,
    is_switched_on,
    live_nodes,
    run_states,
    shut_gate,
    signal_inputs,
    signal_sources,
    signals_once,
    unchosen_output,
)
from lab3_usd.facts.reaching_values import Nodes, effective_value, live_sources
from lab3_usd.isaac.behaviour import Need
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.isaac.values import Value
from lab3_usd.model.physics import number
from lab3_usd.model.stage import GraphModel, Node, StageModel, Unknown, once_per_stage

_USUAL = "inputs:execIn"  # the input for the signal that has a node compute


def needs_of(node: Node, platform: Platform, live: Nodes) -> Iterator[Need]:
    """Yield what a node needs by the platform, as it is set and wired."""
    kind = node.type
    for need in platform.needs.get(kind.type, ()) if kind is not None else ():
        if not is_release_within(platform.release, "", need.until):
            continue
        if need.when and not (is_given(node, need.when, live) or _is_on(node, need.when)):
            continue
        if need.when_wired and not node.sources(INPUT + need.when_wired):
            continue
        if need.unless and _is_on(node, need.unless):
            continue
        if any(node.is_unknown(INPUT + name) for name in (need.when, need.unless) if name):
            continue
        yield need


def unmet_needs(node: Node, platform: Platform, live: Nodes) -> Iterator[Need]:
    """Yield what a node needs by the platform and does not get."""
    for need in needs_of(node, platform, live):
        names = [name for name in need.inputs if node.type and INPUT + name in node.type.ports]
        if names and not any(_is_met(node, name, need, live) for name in names):
            yield need


def is_needed(node: Node, port: str, stage: StageModel) -> bool:
    """Whether a node lacks something while an input is not connected.

    Nothing else feeds it, no value is authored, and its default is not as good. A signal is needed
    by a node that does not run without it. A default is harmless where the platform knows what the
    node needs, and that is not among it.
    """
    live, kind = live_nodes(stage), node.type
    if kind is None or any(live_sources(node, port, live)):
        return False
    if port in signal_inputs(node):
        return node.path not in run_states(stage)
    items, state = array_items(node), node.state(port)
    value = None if state is None else state.value
    if items is not None and port in (*items.filled, *items.empty):
        return value in (None, "")
    for need in needs_of(node, stage.platform, live):
        if port.removeprefix(INPUT) in need.inputs:
            is_written = value is not None and (need.zero_counts or not is_nothing(value))
            inputs = (INPUT + name for name in need.inputs if INPUT + name != port)
            if not is_written and not any(_brings_data(node, other, live) for other in inputs):
                return True
    if kind.type in stage.platform.needs or has_side_effects(node):
        return False
    return value is None and kind.default(port, node.version) is None


def _brings_data(node: Node, port: str, live: Nodes) -> bool:
    """Whether a live wire feeds an input, or it names a prim or holds more than nothing."""
    state = node.state(port)
    if state is None or any(live_sources(node, port, live)):
        return state is not None
    return bool(state.targets) or not (state.value is None or is_nothing(state.value))


def _is_met(node: Node, name: str, need: Need, live: Nodes) -> bool:
    """Whether an input is given, and changes where it has to, or is a written zero that counts."""
    if is_given(node, name, live):
        fixed = _fixed(node, INPUT + name, live) if need.changing or need.positive else None
        is_low = isinstance(fixed, (int, float)) and fixed <= 0
        return not (is_low if need.positive else need.changing and fixed is not None)
    state = node.state(INPUT + name)
    if state is None or not need.zero_counts:
        return False
    return bool(state.sources) or state.value not in (None, ())


def _is_on(node: Node, name: str) -> bool:
    """Whether a switch is on, by its default if unset."""
    return node.value(INPUT + name) is True


def is_given(node: Node, name: str, live: Nodes) -> bool:
    """Whether an input is wired, names a prim, or holds more than nothing.

    A wire counts, also one that leads to no node, but not one from a constant that is nothing
    itself.
    """
    port = INPUT + name
    state = node.state(port)
    if state is not None and (state.sources or state.targets):
        fixed = _fixed(node, port, live)
        return fixed is None or not is_nothing(fixed)
    value = None if state is None else state.value
    if isinstance(value, Unknown):
        return True
    if value is None or is_nothing(value):
        return False
    declared = None if node.type is None else node.type.port(port)
    # The default of a quaternion, written down, says nothing.
    return declared is None or not isinstance(value, tuple) or value != declared.default


def _fixed(node: Node, port: str, live: Nodes) -> Value | None:
    """Return the value of an input that never changes, None where a wire brings another one."""
    is_dead = bool(node.sources(port)) and not any(live_sources(node, port, live))
    return None if is_dead else effective_value(node, port, live)


def is_nothing(value: Value | Unknown) -> bool:
    """Whether a value is known to be 0, false, an empty text or array, or made of zeros."""
    if isinstance(value, tuple):
        return all(is_nothing(item) for item in value)
    return not value


class Stop(Struct, frozen=True, eq=False):
    """A node at which signals end: why it gets none, and the nodes that wait for it.

    `reason` is one of unwired (`port` is not connected), broken (its sources do not exist), once
    (its only signal comes a single time), off (the node before it is disabled), shut (it is behind
    a closed gate), counts (it is behind a gate that needs more signals than the one it gets).
    """

    node: Node
    port: str
    reason: str
    cause: str
    waiting: tuple[Node, ...]


def stops(graph: GraphModel, stage: StageModel) -> Iterator[Stop]:
    """Yield the nodes of an evaluated graph that no signal reaches, each with those behind it.

    A node that waits for one of those is not listed again.
    """
    live, states = live_nodes(stage), run_states(stage)
    idle = [
        node
        for node in graph.nodes
        if node.path not in states
        and node.path in live
        and node.type is not None
        and node.type.execution_inputs
        and event_of(node, stage.platform) is None
    ]
    for node in idle:
        ahead = [source for source in signal_sources(node, live) if source.path != node.path]
        if any(source.path not in states for source in ahead):
            continue
        waiting = tuple(_behind(node, idle, stage))
        # Others break a loop off, or set a node back.
        port = _USUAL if _USUAL in signal_inputs(node) else signal_inputs(node)[0]
        written = any(node.sources(signal_input) for signal_input in signal_inputs(node))
        if not ahead:
            reason = "broken" if written else "unwired"
            yield Stop(node, port, reason, "", waiting)
        else:
            reason, cause = _obstacle(node, stage)
            yield Stop(node, port, reason, cause, waiting)


def _obstacle(node: Node, stage: StageModel) -> tuple[str, str]:
    """Return why signals of running nodes do not reach this one, and the node that holds them."""
    live = live_nodes(stage)
    for port in signal_inputs(node):
        for source, out in live_sources(node, port, live):
            if not is_switched_on(source, live):
                return "off", source.path
            if shut_gate(source, live, stage.platform) or out == unchosen_output(source, live):
                return "shut", source.path
            if gate_step(source, live, stage.platform) > 1:
                return "counts", source.path
            if is_opened_first(node) and signals_once(source, out, live, stage.platform):
                return "once", source.path
    if is_opened_first(node):  # what runs and signals it, runs once itself
        return "once", next(signal_sources(node, live)).path
    return "broken", ""


def _behind(first: Node, idle: list[Node], stage: StageModel) -> Iterator[Node]:
    """Yield the idle nodes that would run if this one did, in the order of the graph."""
    triggered: dict[str, list[str]] = {}
    for node in idle:
        for source in signal_sources(node, live_nodes(stage)):
            triggered.setdefault(source.path, []).append(node.path)
    reached, ahead = {first.path}, [first.path]
    while ahead:
        new = {path for path in triggered.get(ahead.pop(), ()) if path not in reached}
        reached |= new
        ahead += new
    return (node for node in idle if node.path in reached and node is not first)


def has_side_effects(node: Node) -> bool:
    """Whether a node talks to ROS or moves joints: it is there for a purpose of its own."""
    return node.type is not None and (bool(node.type.role) or node.type.drives is not None)


def feeds(node: Node, stage: StageModel) -> list[Node]:
    """Return the nodes into which something is connected to this one."""
    fed = _fed(stage).get(node.path, ())
    return [target for target in fed if target.path != node.path]


@once_per_stage
def _fed(stage: StageModel) -> dict[str, list[Node]]:
    """Return the live nodes that each prim is wired into, by its path."""
    fed: dict[str, list[Node]] = {}
    for target in live_nodes(stage).values():
        sources = (path for state in target.ports.values() for path in state.sources)
        for source in dict.fromkeys(path.partition(".")[0] for path in sources):
            fed.setdefault(source, []).append(target)
    return fed


def is_wired(node: Node, stage: StageModel) -> bool:
    """Whether anything is wired into a node or out of it."""
    return any(node.sources(port) for port in node.ports) or bool(feeds(node, stage))


def short(port: str) -> str:
    """Return the name of a port as people write it."""
    return port.removeprefix(INPUT)


def nodes_of_unknown_type(stage: StageModel) -> Iterator[Node]:
    """Yield the nodes of a type that nothing is known of, not even that it is an event."""
    types = {*stage.platform.events, *stage.platform.once}
    for node in live_nodes(stage).values():
        name = node.type_name
        if node.type is None and name not in types and not stage.platform.scripts.runs(name):
            yield node


def limits_without_step(node: Node, live: Mapping[str, Node]) -> dict[str, Value | None]:
    """Return the limits, with their values, that keep a node without a time step from computing.

    Without any they are those whose values, here None, come over wires.
    """
    if node.type is None or not _lacks_time_step(node, live):
        return {}
    values = {port: effective_value(node, port, live) for port in node.type.step_limits}
    known = {port: value for port, value in values.items() if value is not None}
    unknown = dict.fromkeys(port for port in values if port not in known and node.sources(port))
    return {port: value for port, value in known.items() if number(value) != 0} or unknown


def _lacks_time_step(node: Node, live: Mapping[str, Node]) -> bool:
    """Whether the time step of a node that takes one is 0 or less."""
    for step in node.type.time_step if node.type is not None else ():
        seconds = effective_value(node, step, live)
        length = 0.0 if seconds is None else number(seconds)
        is_open = bool(node.sources(step)) or node.is_unknown(step)
        if (seconds is None and is_open) or (length is not None and length > 0):
            return False
    return node.type is not None and bool(node.type.time_step)
