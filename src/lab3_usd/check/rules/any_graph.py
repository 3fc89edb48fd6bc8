"""Rules about graphs and their nodes that hold with and without a lab."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import GraphsSubject
from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem


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
