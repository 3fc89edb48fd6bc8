"""What the topic rules ask of a stage: which topics the lab wants, and who publishes them again."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.ros.topics import Endpoint, endpoints, resolve
from lab3_usd.model.derived import once_per_stage
from lab3_usd.spec.graph import NodeSpec


@once_per_stage
def role_specs(subject: StageSubject) -> dict[str, NodeSpec]:
    """Map the path of each node that plays a role to the spec of the role."""
    return {
        path: subject.lab.graphs[name].nodes[role]
        for name, roles in subject.roles.items()
        for path, role in roles.role_of.items()
        if role in subject.lab.graphs[name].nodes
    }


def required_topic(spec: NodeSpec | None, port: str) -> str | None:
    """Return the topic that the lab wants at one input of a role, None where it wants none."""
    if spec is None:
        return None
    return next((resolve("", str(s.value)) for s in spec.settings if s.port == port), None)


def required_topics(subject: StageSubject) -> set[str]:
    """Return the topics that the graphs of this checkpoint must publish or subscribe."""
    specs = (
        (node, port)
        for name in subject.checkpoint.graphs
        for node in subject.lab.graphs[name].nodes.values()
        for port in node.type.topics
    )
    return {topic for node, port in specs for topic in [required_topic(node, port)] if topic}


def repeated_publishers(subject: StageSubject) -> Iterator[tuple[Endpoint, tuple[Endpoint, ...]]]:
    """Yield each publisher of a topic that has one already, with those others.

    Left out are the topics of the TF tree, a node whose setting differs from its role's (the rule
    of settings says so) and an extra node in a graph of the lab (the rule of extra nodes does).
    """
    played = role_specs(subject)
    asked = required_topics(subject)
    lab_graphs = {roles.graph.path for roles in subject.roles.values() if roles.graph}
    together: dict[str, list[Endpoint]] = {}
    for each in endpoints(subject.stage, subject.lab):
        if each.topic and each.runs and each.direction == "publishes":
            required = required_topic(played.get(each.node.path), each.port)
            if each.node.path not in played or required == each.topic:
                together.setdefault(each.topic, []).append(each)
    for topic, group in together.items():
        if topic in subject.lab.policy.tree_topics:
            continue
        owner = next((each for each in group if each.node.path in played), group[0])
        for each in group:
            is_lab_graph = _graph_of(each) in lab_graphs and topic in asked
            if (
                each is not owner
                and not is_lab_graph
                and each.node.path not in subject.faulty_prims
            ):
                yield each, tuple(other for other in group if other is not each)


def _graph_of(endpoint: Endpoint) -> str:
    return endpoint.node.path.rpartition("/")[0]


@once_per_stage
def repeating_graphs(subject: StageSubject) -> set[str]:
    """Return the paths of the graphs that publish a topic again."""
    return {_graph_of(again) for again, _ in repeated_publishers(subject)}
