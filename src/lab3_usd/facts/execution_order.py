"""Which nodes compute once the timeline plays, on what values, and at which pace.

Everything that asks whether something happens asks here: rules, topics, frames and drawings.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping
from functools import lru_cache
from typing import Literal, TypeVar

from lab3_usd.facts.reaching_values import (
    LiveNodes,
    Nodes,
    Sources,
    effective_value,
    live_sources,
)
from lab3_usd.isaac.node_types import INPUT, OUTPUT, NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import Severity
from lab3_usd.model.stage import GraphModel, Node, StageModel, once_per_stage

# A node that is not named among the states does not run.
State = Literal["runs", "may run"]
ENABLED = "inputs:enabled"
_Entry = TypeVar("_Entry")
_Followers = Mapping[str, list[str]]
_OPENED_FIRST = ("publisher", "subscriber")
_SUREST_FIRST: tuple[State, ...] = ("runs", "may run")


@once_per_stage
def live_nodes(stage: StageModel) -> LiveNodes:
    """Return the nodes of all active graphs by path, leaving out what the application made."""
    graphs = [g for g in stage.graphs if g.active and not stage.platform.graph.ignores(g.path)]
    nodes = [node for graph in graphs for node in graph.nodes]
    kinds = {node.type for node in nodes if node.type}
    # Where a node sets variables of graphs, what a graph holds of them is not what is read.
    is_set = any(kind.variable and kind.execution_inputs for kind in kinds)
    return LiveNodes(nodes, {} if is_set else {graph.path: graph.attributes for graph in graphs})


@once_per_stage
def _by_type(stage: StageModel) -> Mapping[NodeType, list[tuple[int, Node]]]:
    """Map each type to its live nodes, numbered as the stage has them."""
    by_type: dict[NodeType, list[tuple[int, Node]]] = {}
    for numbered in enumerate(live_nodes(stage).values()):
        if numbered[1].type is not None:
            by_type.setdefault(numbered[1].type, []).append(numbered)
    return by_type


def nodes_with(
    asked: Callable[[NodeType], _Entry | None], stage: StageModel
) -> list[tuple[Node, _Entry]]:
    """Return the live nodes whose types have something, with it, in the order of the stage."""
    numbered = [
        (number, node, given)
        for kind, nodes in _by_type(stage).items()
        if (given := asked(kind))
        for number, node in nodes
    ]
    return [(node, given) for _, node, given in sorted(numbered, key=lambda each: each[0])]


def nodes_of(asked: Callable[[NodeType], object], stage: StageModel) -> list[Node]:
    """Return the live nodes of the types asked for, in the order of the stage."""
    return [node for node, _ in nodes_with(asked, stage)]


def nodes_in(table: Mapping[str, _Entry], stage: StageModel) -> list[tuple[Node, _Entry]]:
    """Return the live nodes of the types in a table of the platform, with what it says of each."""
    return nodes_with(lambda kind: table.get(kind.type), stage)


@once_per_stage
def run_states(stage: StageModel) -> dict[str, State]:
    """Return how surely each node runs while the timeline plays, by path.

    A node runs when a signal of an event reaches it over execution wires in a graph that is
    evaluated, and it may run when it is unknown whether the event fires. In a graph whose evaluator
    takes no signals every node runs. A node that is switched off, or a gate that is shut, passes no
    signal on. A publisher or subscriber that is signalled a single time does not run: the first
    signal opens it, the second would have it work. Nodes that are not named do not run.
    """
    return states_without(stage)


@once_per_stage
def nodes_of_their_own(stage: StageModel) -> Nodes:
    """Return the nodes that run or may run without somebody at the screen, by path."""
    live = live_nodes(stage)
    if stage.platform.by_hand.isdisjoint(node.type_name for node in live.values()):
        return running_nodes(stage)
    return {path: live[path] for path in states_without(stage, stage.platform.by_hand)}


def states_without(
    stage: StageModel,
    quiet: Container[str] = (),
    stuck: Container[str] = (),
) -> dict[str, State]:
    """Return the states of the nodes where events of the types `quiet` do not fire.

    Nodes with the paths `stuck` run, and pass no signal on.
    """
    live = live_nodes(stage)
    computing: dict[str, Node] = {}
    states: dict[str, State] = {}
    for graph in stage.graphs:
        nodes = {node.path: node for node in graph.nodes if node.path in live}
        if not nodes or not is_graph_evaluated(graph, stage):
            continue
        computing.update(nodes)
        form = stage.platform.graph.evaluation
        evaluator = _attribute(graph, form.evaluator, stage.platform)
        if evaluator == stage.platform.graph.value(form.evaluator):
            starts = _starts(graph, nodes, live, stage.platform)
            states.update((path, s) for path, s in starts if nodes[path].type_name not in quiet)
            continue
        pace = _attribute(graph, form.stage, stage.platform)
        is_usual = pace in (stage.platform.graph.value(form.stage), *form.on_demand)
        # Isaac Sim should load no graph of an instance.
        is_certain = is_usual and not graph.instanced and evaluator in form.all_nodes
        states.update(dict.fromkeys(nodes, "runs" if is_certain else "may run"))
    lasting, once = _followers(computing, stage.platform)
    unsure = {path for path, node in computing.items() if _is_unsure(node, live, stage.platform)}
    shut = {
        path
        for path in {**lasting, **once}
        if not is_switched_on(live[path], live) or shut_gate(live[path], live, stage.platform)
    }
    # A single signal never opens a gate that counts to more.
    gates = [node for node in computing.values() if node.type_name in stage.platform.gates]
    counting = {node.path for node in gates if gate_step(node, live, stage.platform) > 1}
    once = {path: some for path, some in once.items() if path not in counting}
    for followers in (lasting, once):
        passing = {
            path: some for path, some in followers.items() if path not in stuck and path not in shut
        }
        for state in _SUREST_FIRST:
            _spread(state, states, passing, unsure)
    return {path: states[path] for path in computing if path in states}


@once_per_stage
def running_nodes(stage: StageModel) -> LiveNodes:
    """Return the nodes that run or may run, by path."""
    live = live_nodes(stage)
    return LiveNodes((live[path] for path in run_states(stage)), live.variables)


def severity_if_uncertain(stage: StageModel, *paths: str) -> Severity | None:
    """Return the severity of a fault that occurs only if all these nodes run, None for the rule's.

    Where one of them only may run, the fault may not show: a warning.
    """
    states = run_states(stage)
    return "warning" if any(states.get(path) == "may run" for path in paths) else None


def _attribute(graph: GraphModel, name: str, platform: Platform) -> Value | None:
    """Return an attribute of a graph; one that the file leaves out is as an Action Graph's."""
    return graph.attributes.get(name, platform.graph.value(name))


def is_graph_evaluated(graph: GraphModel, stage: StageModel) -> bool:
    """Whether anything at all is computed in the graph while the timeline plays."""
    return not unevaluated_by(graph, stage)


@once_per_stage
def referenced_graphs(stage: StageModel) -> frozenset[str]:
    """Return the graphs that prims of the scene use."""
    name = stage.platform.graph.evaluation.reference
    prims = (prim for prim in stage.prims.values() if prim.present)
    return frozenset(path for prim in prims for path in prim.relationships.get(name, ()))


@once_per_stage
def unevaluated_by(graph: GraphModel, stage: StageModel) -> str:
    """Return the attribute that keeps a graph from being evaluated, '' for none."""
    form = stage.platform.graph.evaluation
    is_by_reference = _attribute(graph, form.mode, stage.platform) in form.by_reference
    if is_by_reference and graph.path not in referenced_graphs(stage):
        return form.mode
    pace = _attribute(graph, form.stage, stage.platform)
    is_on_demand = pace in form.on_demand
    is_asked = is_on_demand and any(event_of(node, stage.platform) == pace for node in graph.nodes)
    return form.stage if is_on_demand and not is_asked else ""


def event_of(node: Node, platform: Platform) -> str | None:
    """Return the pipeline stage in which an event fires, '' for an unknown one, None for none."""
    return platform.events.get(node.type_name)


def _starts(
    graph: GraphModel, nodes: Nodes, live: Nodes, platform: Platform
) -> Iterator[tuple[str, State]]:
    """Yield the nodes of an evaluated graph that start an execution by themselves."""
    form = platform.graph.evaluation
    pace = _attribute(graph, form.stage, platform)
    for path, node in nodes.items():
        needed = event_of(node, platform)
        is_sure = needed is not None and (needed == pace or _fires_at_play(node, live, platform))
        if is_sure:
            yield path, "may run" if graph.instanced else "runs"
        elif needed not in form.on_demand and (
            needed is not None or _may_start(node, nodes, platform)
        ):
            yield path, "may run"


def _may_start(node: Node, nodes: Nodes, platform: Platform) -> bool:
    """Whether a node that is no known event may be one: it sends signals and waits for none.

    What changes the scene waits for a signal.
    """
    if node.type_name in platform.writers:
        return False
    if node.type is None:
        return not any(True for _ in signal_sources(node, nodes))
    if node.type.execution_inputs:
        return False
    return any(port.is_execution for port in node.type.ports.values())


def _spread(
    state: State, states: dict[str, State], followers: _Followers, unsure: Container[str]
) -> None:
    """Carry a state on to all that the nodes in it trigger, unless those are surer already.

    Nodes behind one that is `unsure`, as it may or may not pass a signal on, may run.
    """
    ahead = [
        path
        for path, path_state in states.items()
        if path_state == state or (state == "may run" and path in unsure)
    ]
    while ahead:
        path = ahead.pop()
        is_passing = state == "may run" or path not in unsure
        for follower in followers.get(path, ()) if is_passing else ():
            if states.get(follower) not in ("runs", state):
                states[follower] = state
                ahead.append(follower)


def _is_unsure(node: Node, live: Nodes, platform: Platform) -> bool:
    """Whether it is unknown if the node passes a signal on that reaches it."""
    if (node.type and not node.type.may_have_more) or unchosen_output(node, live):
        return False
    name = node.type_name
    return not (name in platform.once or name in platform.passing or name in platform.events)


def _followers(nodes: Nodes, platform: Platform) -> tuple[_Followers, _Followers]:
    """Map each node to those that it triggers time and again, and to those that it may run once."""
    lasting: dict[str, list[str]] = {}
    once: dict[str, list[str]] = {}
    for node in nodes.values():
        for source, port in signals(node, nodes):
            if port == unchosen_output(source, nodes):
                continue
            if not signals_once(source, port, nodes, platform):
                lasting.setdefault(source.path, []).append(node.path)
            if not is_opened_first(node):
                once.setdefault(source.path, []).append(node.path)
    return lasting, once


def signals_once(node: Node, port: str, nodes: Nodes, platform: Platform) -> bool:
    """Whether an output of a node signals a single time after Play."""
    once = platform.once.get(node.type_name)
    if once is None or port.removeprefix(OUTPUT) not in once.outputs:
        return False
    if once.when and not _fires_at_play(node, nodes, platform):
        return False
    return not once.again or not any(live_sources(node, INPUT + once.again, nodes))


def _fires_at_play(node: Node, nodes: Nodes, platform: Platform) -> bool:
    """Whether an event is one that comes with Play."""
    once = platform.once.get(node.type_name)
    if once is None or not once.when:
        return False
    return effective_value(node, INPUT + once.when, nodes) in once.values


def is_opened_first(node: Node) -> bool:
    """Whether the first signal only opens the node's topic, and it works from the second on."""
    return node.type is not None and node.type.role in _OPENED_FIRST


def signal_inputs(node: Node) -> tuple[str, ...]:
    """Return the execution inputs, and the unknown ones."""
    kind = node.type
    if kind is not None and not kind.may_have_more:
        return kind.execution_inputs
    unknown = (
        name
        for name in node.ports
        if name.startswith(INPUT) and (kind is None or not kind.is_known_port(name))
    )
    return (*(() if kind is None else kind.execution_inputs), *unknown)


def signal_sources(node: Node, nodes: Nodes) -> Iterator[Node]:
    """Yield the nodes that trigger this one, or may where a type is unknown."""
    return (source for source, _ in signals(node, nodes))


def signals(node: Node, nodes: Nodes) -> Sources:
    """Return the outputs that trigger this node, or may where a type is unknown."""
    kept = nodes.triggers if type(nodes) is LiveNodes else {}
    if node not in kept:
        fed = (live_sources(node, port, nodes) for port in signal_inputs(node))
        sent = (each for sources in fed for each in sources)
        kept[node] = tuple(s for s in sent if _may_signal(s[0].type, s[1]))
    return kept[node]


@lru_cache(maxsize=1024)
def _may_signal(kind: NodeType | None, output: str) -> bool:
    """Whether an output gives signals, or it is unknown what it gives."""
    declared = kind.port(output) if kind is not None and kind.is_known_port(output) else None
    return output.startswith(OUTPUT) and (declared is None or declared.is_execution)


def unchosen_output(node: Node, live: Nodes) -> str | None:
    """Return the output at which a node never signals, as what chooses is fixed; None for none."""
    choice = None if node.type is None else node.type.choice
    if choice is None or (node.sources(choice.by) and not live_sources(node, choice.by, live)):
        return None
    chosen = effective_value(node, choice.by, live)
    return None if chosen is None else choice.outputs[not chosen]


def is_switched_on(node: Node, live: Nodes) -> bool:
    """Whether the node's own switch is on, or it has none."""
    return effective_value(node, ENABLED, live) is not False


def shut_gate(node: Node, live: Nodes, platform: Platform) -> str | None:
    """Return the input that lets no signal through; None for another node.

    It is 0, or of a door, to which no signal comes or which nothing opens.
    """
    door = platform.doors.get(node.type_name)
    if door is not None and not live_sources(node, INPUT + door.enter, live):
        return INPUT + door.enter
    if door is not None and not live_sources(node, INPUT + door.toggle, live):
        is_closed = effective_value(node, INPUT + door.closed, live) is True
        return INPUT + door.closed if is_closed else None
    gate = platform.gates.get(node.type_name)
    is_shut = gate is not None and effective_value(node, INPUT + gate, live) == 0
    return f"{INPUT}{gate}" if is_shut else None


def gate_step(node: Node, live: Nodes, platform: Platform) -> int:
    """Return how many signals a gate takes for each that it passes on; 1 for another node."""
    gate = platform.gates.get(node.type_name)
    step = None if gate is None else effective_value(node, INPUT + gate, live)
    return step if isinstance(step, int) and not isinstance(step, bool) else 1
