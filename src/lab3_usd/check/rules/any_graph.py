"""Rules about graphs and their nodes that hold with and without a lab."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import GraphsSubject, LintSubject, StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import other_names
from lab3_usd.facts.stalled_nodes import has_side_effects
from lab3_usd.model.changes import RemovePrim
from lab3_usd.model.finding import Problem, node_title
from lab3_usd.model.stage import DEACTIVATED, OVER, nodes_outside_graphs


@rule("K07", "instanced-graph", scope="lint", severity="warning")
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


@rule("K31", "deprecated-types", scope="lint", severity="warning", formerly="old-names")
@rule("N06", "old-type-names", scope="graph", severity="warning")
def deprecated_types(subject: GraphsSubject) -> Iterator[Problem]:
    """Nodes have names of another release, for their types or their ports.

    Why: Isaac Sim 4.5 and later rename types from before when they open the stage, which an older
    release saved with other defaults. An earlier release does not know the names of a later one.
    There is one finding for the graph and the release.

    Fix: open the stage in the release that you use, look at the graph, and save it again.

    Example: a ROS2 Context whose type begins with `omni.isaac`.
    """
    for graph in subject.graphs():
        for other in other_names(graph, subject.platform):
            verb = "has" if len(other.nodes) == 1 else "have"
            yield Problem(
                graph.path,
                f"{other.count} {verb} {other.what}: {other.written}, now {other.known}",
                expected=other.known,
                actual=other.written,
                related=tuple(node.path for node in other.nodes),
                fix=other.edits,
            )


@rule("K34", "value-type", scope="lint", formerly="value-of-another-type")
@rule("P03", "wrong-value-type", scope="graph")
def value_type(subject: GraphsSubject) -> Iterator[Problem]:
    """A value has a type that its port does not have.

    Why: Isaac Sim creates the port with its own type and ignores the value: the default applies.

    Fix: delete the node, add it again from the node list, and set its fields.

    Example: `inputs:wheelRadius` written as a string by a script, although it is a double.

    Basis: ports have the types of Isaac Sim's source. Kit's handling of other types is not public;
    pairs of types that earlier releases saved are accepted.
    """
    for node in subject.nodes():
        for name in node.ports:
            declared = node.wrong_type(name) if subject.judges_value(node, name) else None
            port = None if node.type is None else node.type.port(name)
            if declared is None or port is None:
                continue
            title = node_title(node)
            yield Problem(
                node.path,
                f"{name} has type {declared}, expected {port.usd_type}",
                property=name,
                expected=port.usd_type,
                actual=declared,
                hint=f"delete {title}, add it again from the node list and set its fields",
            )


@rule("K05", "stray-node", scope="lint", severity="warning")
@rule("N09", "node-outside-graph", scope="stage", severity="warning")
def stray_node(subject: LintSubject | StageSubject) -> Iterator[Problem]:
    """A node is in no graph, or a prim in a graph is no node.

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
                yield Problem(prim.path, f"is not a node but {prim.reason}, and never executes")
