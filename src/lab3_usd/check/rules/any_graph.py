"""Rules about graphs and their nodes that hold with and without a lab."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lab3_usd.check.fold import absent_above, of_one_cause
from lab3_usd.check.match.rule_inputs import (
    GraphsSubject,
    GraphSubject,
    LintSubject,
    StageSubject,
)
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import VERSION, other_names
from lab3_usd.facts.execution_order import live_nodes, unevaluated_by
from lab3_usd.facts.stalled_nodes import has_side_effects, limits_without_step
from lab3_usd.facts.stuck_nodes import is_made_later, is_placeholder
from lab3_usd.isaac.releases import order
from lab3_usd.model.changes import RemovePrim, SetValue
from lab3_usd.model.finding import Problem, display, node_title, short_source
from lab3_usd.model.stage import (
    DEACTIVATED,
    OVER,
    GraphModel,
    Node,
    absence_reason,
    nodes_outside_graphs,
)


@rule("K07", "instanced-graph", severity="warning")
@rule("G06", "graph-in-instance", scope="graph", severity="warning")
def instanced_graph(subject: GraphsSubject) -> Iterator[Problem]:
    """A graph is part of an instance.

    Why: Isaac Sim does not load graphs of instances: all copies share the graph, and it belongs to
    none. Nothing in it runs. The nodes are judged as if it were loaded.

    Fix: select the instance named here and clear Instanceable in the Property panel.

    Example: {robot} is a reference to a robot with its graphs, and is instanceable.

    Basis: USD shares the prims of an instance, so a graph cannot write to one of them. Kit's code
    is not public, and its documentation does not mention the case: a warning.
    """
    for graph in subject.graphs():
        instance = subject.stage.instance_above(graph.path)
        if graph.active and instance is not None:
            yield Problem(
                graph.path,
                f"graph is part of the instance {instance}: Isaac Sim loads no graph of one",
                actual=instance,
                related=(instance,),
                hint=f"select {instance} and clear Instanceable in the Property panel",
            )


@rule("K03", "graph-not-evaluated")
@rule("G03", "graph-kind", scope="graph")
def graph_not_evaluated(subject: GraphsSubject) -> Iterator[Problem]:
    """A graph is never evaluated, or not in the required mode.

    Why: an on-demand graph waits for an event of its own kind, such as On Physics Step; the updates
    of the application skip it. An instanced graph is evaluated only where a prim refers to it.
    Isaac Sim may give no message. A lab asks for an Action Graph, evaluated in the simulation
    pipeline: there, other settings are a fault, too. A push graph may compute every node at each
    update, with or without a signal.

    Fix: set the property named here to that of a new Action Graph, or create one and move the nodes
    there.

    Example: On Playback Tick in a graph with `pipelineStage = "pipelineStageOnDemand"`.

    Basis: NVIDIA's documentation of the OmniGraph schema for evaluation modes, and
    `OgnOnPhysicsStep.cpp:139-149` for on-demand graphs. Kit's own code is not public.
    """
    is_of_lab = isinstance(subject, GraphSubject)
    for graph in subject.graphs():
        cause = unevaluated_by(graph, subject.stage)
        is_idle = not graph.active or not graph.nodes
        for attribute in subject.platform.graph.attributes:
            value = graph.attributes.get(attribute.name, attribute.unwritten)
            is_as_asked = not attribute.required or value in attribute.accepted
            if is_as_asked if is_of_lab else is_idle or attribute.name != cause:
                continue
            effect = ": the graph is never evaluated" if attribute.name == cause else ""
            right = SetValue(graph.path, attribute.name, attribute.usd_type, attribute.value)
            yield Problem(
                graph.path,
                f"{attribute.name} is {display(value)}, expected {display(attribute.value)}"
                f"{effect}",
                property=attribute.name,
                expected=display(attribute.value),
                actual=display(value),
                fix=(right,) if is_of_lab else (),
            )


@rule("K31", "deprecated-types", severity="warning", formerly="old-names")
@rule("N06", "old-type-names", scope="graph", severity="warning")
def deprecated_types(subject: GraphsSubject) -> Iterator[Problem]:
    """Nodes have type or port names of another release.

    Why: Isaac Sim 4.5 and later rename types from before when they open the stage, which an older
    release saved with other defaults. An earlier release does not know the names of a later one.
    A script that creates a node by an old name stops there: names are renamed only when a stage is
    opened. There is one finding for the graph and the release.

    Fix: let `lab3 fix` rename them in the file; or open the stage in the release that you use, look
    at the graph, and save it again.

    Example: a ROS2 Context whose type begins with `omni.isaac`.
    """
    platform = subject.platform
    # A script stops at old names that the release does not have any more.
    is_late = order(platform.release) > order(platform.building.old_names_until)
    known = platform.names.types if subject.stage.build is not None and is_late else None
    for graph in subject.graphs():
        stops = known is not None and any(
            node.written_type and node.written_type not in known for node in graph.nodes
        )
        for other in other_names(graph, platform):
            verb, such_as = ("has", ":") if len(other.nodes) == 1 else ("have", ", such as")
            yield Problem(
                graph.path,
                f"{other.count} {verb} {other.what}{such_as} {other.written}, "
                f"{'before' if other.is_unknown else 'now'} {other.known}",
                expected=other.known,
                actual=other.written,
                related=tuple(node.path for node in other.nodes),
                severity="error" if other.is_unknown or stops else None,
                hint=None if subject.stage.build is None else "write the names of this release",
                fix=other.edits,
            )
        if isinstance(subject, LintSubject):
            yield from _deactivated(graph, subject)


def _deactivated(graph: GraphModel, subject: LintSubject) -> Iterator[Problem]:
    """Yield deactivated nodes with old types, which are not renamed when the stage is opened.

    `isaacsim/core/deprecation_manager/extension.py:114` looks at what Stage.Traverse() has.
    """
    platform = subject.platform
    is_renamed = order(platform.release) >= order(platform.names.before)
    names = {
        node.path: name
        for node in graph.absent
        if is_renamed and node.reason == DEACTIVATED and platform.names.is_old(node.type_name)
        if (name := platform.type_name(node.type_name)) in platform.types
    }
    if names:
        has = "node has" if len(names) == 1 else "nodes have"
        yield Problem(
            graph.path,
            f"{len(names)} deactivated {has} an old type name, which Isaac Sim does not rename "
            "when it opens the stage",
            expected=next(iter(names.values())),
            related=tuple(names),
            severity="note",
            identity=DEACTIVATED,
            hint="write the new name into the file before you activate the node",
        )


@rule(
    "K33",
    "newer-version",
    severity="note",
    counted=("node of a newer version", "nodes of a newer version"),
)
@rule("N05", "new-node-version", scope="graph", severity="warning")
def newer_version(subject: GraphsSubject) -> Iterator[Problem]:
    """A node has a newer version than any known.

    Why: ports and defaults may have changed, so the other findings about this node may be wrong. A
    lab knows the version of the release that it is for.

    Fix: create the graph with the release that you use, or compare the node with the release that
    saved it.

    Example: ROS2 Context of version 9, while 6.2 has 2.
    """
    for node in subject.nodes():
        newest = _newest_version(node, subject)
        if node.version is not None and newest is not None and node.version > newest:
            yield Problem(
                node.path,
                f"{node_title(node)} has version {node.version}; the newest known is {newest}",
                property=VERSION,
                expected=str(newest),
                actual=str(node.version),
            )


def _newest_version(node: Node, subject: GraphsSubject) -> int | None:
    """Return the version in the lab's release, or in any; None where a type may have more."""
    if isinstance(subject, GraphSubject):
        return subject.spec_of(node).type.version
    if node.type is None or node.type.may_have_more:
        return None
    return subject.platform.newest_version(node.type)


@rule("K34", "value-type", formerly="value-of-another-type")
@rule("P03", "wrong-value-type", scope="graph")
def value_type(subject: GraphsSubject) -> Iterator[Problem]:
    """A value has another type than its port.

    Why: Isaac Sim creates the port with its own type and ignores the value: the default applies.

    Fix: delete the node, add it again from the node list, and set its fields.

    Example: `inputs:wheelRadius` written as a string by a script, although it is a double.

    Basis: ports have the types of Isaac Sim's source. Kit's handling of other types is not public;
    pairs of types that earlier releases saved are accepted.
    """
    for node in subject.nodes():
        # Without a lab each value is judged, else one that it asks for.
        asked: Iterable[str] = node.ports
        if isinstance(subject, GraphSubject):
            asked = {setting.port for setting in subject.spec_of(node).settings}
        for name in asked:
            declared = node.wrong_type(name)
            port = None if node.type is None or declared is None else node.type.port(name)
            if port is not None:
                title = node_title(node)
                yield Problem(
                    node.path,
                    f"{name} has type {declared}, expected {port.usd_type}",
                    property=name,
                    expected=port.usd_type,
                    actual=declared,
                    hint=f"delete {title}, add it again from the node list and set its fields",
                )


@rule("K05", "stray-node", severity="warning")
@rule("N09", "node-outside-graph", scope="stage", severity="warning")
def stray_node(subject: LintSubject | StageSubject) -> Iterator[Problem]:
    """A node is in no graph, or a graph's prim is not a node.

    Why: Isaac Sim evaluates only nodes that are children of a graph. A node elsewhere, or a prim of
    another type, never computes. Where a graph of a lab lacks the node, the finding of the graph
    names it.

    Fix: drag the node into its graph in the Stage panel, or delete it.

    Example: `/to_string`, left at the root when its graph was renamed.

    Basis: in all saved stages and in NVIDIA's scripts nodes are children of a graph. Kit's code is
    not public.
    """
    is_of_lab = isinstance(subject, StageSubject)  # which needs no more than it asks for
    for node in nodes_outside_graphs(subject.stage):
        if not subject.platform.graph.ignores(node.path):
            yield Problem(
                node.path,
                f"{node_title(node)} is outside every graph and never executes",
                actual=node.saved_type,
                severity="error" if has_side_effects(node) and not is_of_lab else None,
                fix=(RemovePrim(node.path),) if is_of_lab else (),
                assumes=((node.path, None),),
            )
    for graph in subject.graphs() if isinstance(subject, LintSubject) else ():
        for prim in graph.absent if graph.active else ():
            if prim.reason not in (DEACTIVATED, OVER) and prim.type_name:
                yield Problem(prim.path, f"is {prim.reason}: it never executes")


@rule("K14", "unresolved-target", formerly="target-not-there")
@rule("R03", "unknown-target", scope="graph", severity="warning")
def unresolved_target(subject: GraphsSubject) -> Iterator[Problem]:
    """A target prim of a node does not exist.

    Why: the node logs an error or skips the target: a missing sensor gives no data, a missing link
    no frame. In a file with graphs but neither robot nor sensor, a stage that uses it as a sublayer
    may have the prim: a warning.

    Fix: select the node, and choose the prim again or remove it in the Property panel.

    Example: `inputs:targetPrims` still names the old path of a link.
    """
    problems = _unresolved_targets(subject, subject.nodes())
    if isinstance(subject, LintSubject):
        yield from of_one_cause(problems, "targets", subject.stage)
    else:
        yield from (problem for problem, _ in problems)


@rule("G09", "left-graph", scope="stage", severity="warning", needs="optional checkpoints")
def left_graph(subject: StageSubject) -> Iterator[Problem]:
    """A graph that this checkpoint does not ask for names a prim that does not exist.

    Why: the graph of an optional checkpoint stays, and its sensor is gone: the node logs an error
    at each start, and its topics are silent.

    Fix: delete the graph as well, or restore the prim.

    Example: the graph of an optional camera whose prim was deleted.
    """
    lab, checkpoint = subject.lab, subject.checkpoint
    done = lab.added_until(checkpoint.id).difference(checkpoint.graphs)
    paths = {spec.path for name, spec in lab.graphs.items() if name in done}
    for graph in subject.stage.graphs:
        if graph.active and graph.path in paths and not checkpoint.is_removed(graph.path):
            yield from (problem for problem, _ in _unresolved_targets(subject, graph.nodes))


def _unresolved_targets(
    subject: GraphsSubject | StageSubject, nodes: Iterable[Node]
) -> Iterator[tuple[Problem, str]]:
    """Yield a problem for each target, and the prim whose absence is its cause."""
    is_module = isinstance(subject, LintSubject) and subject.is_module
    for node in nodes:
        for port, path in _judged_targets(node, subject):
            is_made = is_made_later(path, subject.stage)
            if is_made or subject.stage.prim(path) is not None:
                continue
            is_one_of_several = len(node.targets(port)) > 1
            reason = absence_reason(subject.stage, path)
            if is_placeholder(path, subject.stage):
                reason = "is the graph itself: no prim uses the graph"
            problem = Problem(
                node.path,
                f"{port} names {path}, which {reason}",
                property=port,
                actual=path,
                severity="warning" if is_one_of_several or is_module else None,
                assumes=((node.path, f"{port}[{path}]"),),
                rests_on=subject.stage.unknown(path),
            )
            yield problem, absent_above(path, subject.stage)


def _judged_targets(node: Node, subject: GraphsSubject | StageSubject) -> Iterator[tuple[str, str]]:
    """Yield targets by port: all, or those of a list that may have more than the lab asks for."""
    spec = subject.spec_of(node) if isinstance(subject, GraphSubject) else None
    asked = {path for target in spec.targets for path in target.prims} if spec else ()
    for port in node.ports if spec is None else spec.frames_from:
        yield from ((port, path) for path in node.targets(port) if path not in asked)


@rule("K63", "limit-needs-time-step")
@rule("P11", "limit-without-time-step", scope="graph")
def limit_needs_time_step(subject: GraphsSubject) -> Iterator[Problem]:
    """An acceleration needs a time step, which is 0.

    Why: a Differential Controller with an acceleration limit, and an Ackermann Controller with an
    acceleration or a steering speed, refuse to compute without a time step: the robot never moves.
    If the value comes over a wire, the robot stops when the value is not 0.

    Fix: set the limit back to 0, or connect Delta Seconds of On Playback Tick to Dt.

    Example: `inputs:maxAcceleration = 2` while `inputs:dt` is not connected.
    """
    live = live_nodes(subject.stage)
    limited = (node for node in subject.nodes() if node.type and node.type.step_limits)
    for node in limited:
        for port, value in limits_without_step(node, live).items():
            from lab3_usd.check.missing_wires import step_wire  # which few stages need

            steps = () if node.type is None else node.type.time_step
            at_steps = tuple((node.path, step) for step in steps)
            wires = ", ".join(map(short_source, node.sources(port)))
            first = f"delete the wire from {wires}, then " if wires else ""
            is_known = value is not None
            written = f"is {display(value)}" if is_known else "is connected"
            effect = "the robot never moves" if is_known else "where it is not 0, all stops"
            yield Problem(
                node.path,
                f"{port} {written} while {steps[0]} is 0: {effect}",
                property=port,
                expected="0",
                actual=display(value),
                severity=None if is_known else "warning",
                hint=f"{first}select {node_title(node)} and set {port.partition(':')[2]} to 0, or "
                f"connect the delta of the tick to {steps[0].partition(':')[2]}",
                fix=() if node.sources(steps[0]) else step_wire(node, steps[0], subject.stage),
                assumes=() if is_known else ((node.path, port), *at_steps),
                covers=at_steps if is_known else (),
            )
