"""The wires that were left out of a graph, where one alone can be meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.facts.clocks import CLOCK, Stamp
from lab3_usd.facts.execution_order import event_of, live_nodes, run_states
from lab3_usd.facts.planned_graphs import extension, likeness
from lab3_usd.facts.reaching_values import live_sources
from lab3_usd.isaac.filling import filled
from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.model.changes import AddGraph, Connect, Edit
from lab3_usd.model.finding import short_source
from lab3_usd.model.stage import Node, StageModel, once_per_stage

_CONTEXT, _CONTEXT_INPUT = f"{OUTPUT}context", f"{INPUT}context"
_TIME = "double"
_SUBSCRIBER = "subscriber"


def execution_wire(node: Node, port: str, subject: LintSubject) -> tuple[Edit, ...]:
    """Return the wire that triggers a node that nothing triggers.

    It comes from the only node that computes an input of this node and signals afterwards. Without
    one it comes from the only event of the graph that surely fires at every update.
    """
    inputs = () if node.type is None else node.type.execution_inputs
    makers = {maker.path: maker for maker in _makers(node, subject)}
    if len(inputs) != 1 or len(makers) > 1:
        return ()
    sources = [*makers.values()] or _events(node, subject.stage)
    outputs = [path for source in sources for path in _signals(source)]
    return _connect(node, port, outputs)


def _makers(node: Node, subject: LintSubject) -> Iterator[Node]:
    """Yield the running nodes that give data to a node and a signal when they have computed."""
    for port in node.ports:
        for source, _ in live_sources(node, port, subject.live):
            kind = source.type
            is_paced = kind is not None and kind.role != _SUBSCRIBER and kind.execution_inputs
            if is_paced and subject.runs(source.path) and _signals(source):
                yield source


def _events(node: Node, stage: StageModel) -> list[Node]:
    """Return the events of a node's graph that surely fire at every update."""
    return [other for other in _beside(node, stage) if fires_always(other, stage)]


def fires_always(node: Node, stage: StageModel) -> bool:
    """Whether a node is an event that surely fires at every update."""
    form = stage.platform.graph
    is_usual = event_of(node, stage.platform) == form.value(form.evaluation.stage)
    return is_usual and run_states(stage).get(node.path) == "runs"


def _beside(node: Node, stage: StageModel) -> Sequence[Node]:
    return _by_graph(stage).get(node.path.rpartition("/")[0], ())


@once_per_stage
def _by_graph(stage: StageModel) -> Mapping[str, Sequence[Node]]:
    """Map each graph to its live nodes."""
    graphs: dict[str, list[Node]] = {}
    for node in live_nodes(stage).values():
        graphs.setdefault(node.path.rpartition("/")[0], []).append(node)
    return graphs


@once_per_stage
def _read_outputs(stage: StageModel) -> frozenset[tuple[str, str]]:
    """Return the outputs that some node reads, each by its node and name."""
    live = live_nodes(stage)
    return frozenset(
        (source.path, output)
        for node in live.values()
        for name in node.ports
        for source, output in live_sources(node, name, live)
    )


def _signals(node: Node) -> list[str]:
    """Return the outputs that carry signals."""
    signals = () if node.type is None else node.type.signals
    return [f"{node.path}.{OUTPUT}{name}" for name in signals]


def step_wire(node: Node, port: str, stage: StageModel) -> tuple[Edit, ...]:
    """Return the wire that gives a node the length of a step, from the one event of its graph."""
    deltas = stage.platform.deltas
    outputs = [
        f"{event.path}.{OUTPUT}{deltas[event.type_name]}"
        for event in _events(node, stage)
        if event.type_name in deltas
    ]
    return _connect(node, port, outputs)


def context_wire(node: Node, port: str, subject: LintSubject) -> tuple[Edit, ...]:
    """Return the wire from the one context of a node's graph."""
    outputs = [
        f"{other.path}.{_CONTEXT}"
        for other in _beside(node, subject.stage)
        if other.type is not None and _CONTEXT in other.type.ports
    ]
    return _connect(node, port, outputs)


def likely_wire(node: Node, port: str, subject: LintSubject) -> tuple[Edit, ...]:
    """Return the wire that an input of a node most likely had.

    If the same input of all other nodes of the graph has the same source, it is that one. A time
    input gets the only node of the graph that reads simulation time.
    """
    beside = [other for other in _beside(node, subject.stage) if other.path != node.path]
    outputs = {
        f"{source.path}.{output}"
        for other in beside
        for source, output in live_sources(other, port, subject.live)
    }
    ros = subject.platform.ros
    if not outputs and port == INPUT + ros.stamp:
        reader = INPUT + ros.reader_restart
        outputs = {path for other in beside for path in _times(other, reader)}
    return _connect(node, port, sorted(outputs))


def _times(node: Node, reader: str) -> Iterator[str]:
    """Yield the outputs with the simulation time of a node with the input `reader`."""
    if node.type is not None and reader in node.type.ports:
        for name, port in node.type.ports.items():
            if name.startswith(OUTPUT) and port.usd_type == _TIME:
                yield f"{node.path}.{name}"


def lost_constant(node: Node, port: str, subject: LintSubject) -> tuple[Edit, ...]:
    """Return the wire from the one constant of a node's graph that nobody reads.

    Its type is that of the constants that are wired into the inputs beside.
    """
    live = subject.live
    stem = port.rstrip("0123456789")
    makers = {
        source.type_name
        for name in node.ports
        if name.startswith(stem)
        for source, output in live_sources(node, name, live)
        if output.startswith(INPUT)
    }
    read = _read_outputs(subject.stage)
    outputs = [
        f"{other.path}.{name}"
        for other in _beside(node, subject.stage)
        if other.type is not None and other.type_name in makers
        for name, other_port in other.type.ports.items()
        if other_port.is_source and name.startswith(INPUT) and (other.path, name) not in read
    ]
    return _connect(node, port, outputs)


def wire_hint(wire: tuple[Edit, ...]) -> str | None:
    """Name what a likely wire comes from."""
    sources = [source for edit in wire if isinstance(edit, Connect) for source in edit.sources]
    if not sources:
        return None
    return f"drag a wire from {short_source(sources[0])}, which alone fits, to this input"


def clock_publisher(stamp: Stamp, subject: LintSubject) -> tuple[Edit, ...]:
    """Return what adds the recipe of a clock to the graph of a node that stamps messages.

    It takes event, time and context from where the graph has them.
    """
    path, domain, recipe = stamp.node.path.rpartition("/")[0], stamp.domain, _clock_recipe(subject)
    own = next((graph for graph in subject.graphs() if graph.path == path), None)
    is_driven = bool(_events(stamp.node, subject.stage))
    if recipe is None or own is None or not is_driven or domain.number is None:
        return ()
    values = {
        **recipe.usual,
        "domain": domain.number or None,
        "domain_by_environment": None if domain.from_environment else False,
        "restart": stamp.restarts is not False,
    }
    planned, shared = filled(recipe, _ANYWHERE, values, subject.platform)
    best = likeness(planned, own, subject.stage)
    return AddGraph.of(extension(planned, shared, best, subject.stage)).contents


_ANYWHERE = "/Clock"  # the graph that is extended has a path of its own


def _clock_recipe(subject: LintSubject) -> Recipe | None:
    """Return the recipe that sends nothing but the clock, where the release has its types."""
    types = subject.platform.types
    for recipe in subject.platform.recipes.values():
        kinds = [types.get(node.type) for node in recipe.nodes.values()]
        messages = [name for kind in kinds if kind is not None for name in kind.message.values()]
        if None not in kinds and messages == [CLOCK]:
            return recipe
    return None


def _connect(node: Node, port: str, outputs: list[str]) -> tuple[Edit, ...]:
    declared = None if node.type is None else node.type.port(port)
    if declared is None or len(outputs) != 1:
        return ()
    return (Connect(node.path, port, declared.usd_type, tuple(outputs)),)
