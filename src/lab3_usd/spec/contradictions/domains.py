"""What the graphs of a lab do not share or have: domains, variables, a name for the team, trees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.isaac.node_types import INPUT
from lab3_usd.spec.contradictions.names import (
    LabFault,
    file_of,
    likely,
    spec_value,
    transform_topics,
)
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import CHECKPOINTS, ROS, Lab
from lab3_usd.spec.submission import TEAM, has_teams


def domain_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield domains of graphs that are not one, and a domain of the system that none of them is."""
    places: dict[object, str] = {}
    ros = lab.platform.ros
    port, switch = f"{INPUT}{ros.domain}", f"{INPUT}{ros.domain_by_environment}"
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            if port in node.type.ports and spec_value(node, switch) is False:
                domain = spec_value(node, port)
                places.setdefault(domain, f"{file_of(graph)}: {node.role}: {ros.domain}")
        yield from _without_context(graph, places)
    system = lab.ros.system.domain
    (first, place), *more = [*places.items()] or [(system, "")]
    for second, other in more:
        file, _, key = other.partition(": ")
        message = f"the domain is {second}, in another graph {first}: no listener receives both"
        yield LabFault(file, key, message, place, "warning")
    if places and system not in places:
        message = f"{system} is the domain of no graph, {first} is"
        yield LabFault(ROS, "system: domain", message, place)


_CONTEXT = "context"


def _without_context(graph: GraphSpec, places: Mapping[object, str]) -> Iterator[LabFault]:
    """Yield nodes without a context, whose domain is that of the environment, beside others."""
    port = f"{INPUT}{_CONTEXT}"
    for node in graph.nodes.values() if places else ():
        is_wired = (node.role, port) in graph.wired_inputs
        if node.type.role and port in node.type.ports and not is_wired:
            message = "it is not connected: the domain is that of ROS_DOMAIN_ID"
            place = next(iter(places.values()))
            yield LabFault(file_of(graph), f"{node.role}: {_CONTEXT}", message, place, "warning")


def team_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield values by team where no name of a file says which team it is."""
    if lab.by_team and not has_teams(lab.files):
        message = f"no {TEAM}, so that only --team and folders as team_7 say whose values count"
        yield LabFault(CHECKPOINTS, "files", message, lab.by_team[0], "warning")


def tree_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield trees on topics on which no graph sends transforms."""
    sent = sorted(transform_topics(lab))
    for tree in lab.frames.trees:
        if tree.topic not in sent:
            hint = likely(tree.topic, sent)
            message = f"'{tree.topic}' is not a topic of the graphs' transforms{hint}"
            yield LabFault(CHECKPOINTS, f"frames: trees: {tree.topic}", message)


def variable_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield the nodes that name a variable which their graph does not have."""
    for graph in lab.graphs.values():
        variables = [variable.name for variable in graph.variables]
        for node in graph.nodes.values():
            port = next(iter(node.type.variable), "")
            if not port or (node.role, port) in graph.wired_inputs:
                continue
            name = spec_value(node, port)
            if name not in variables:
                hint = likely(str(name), variables)
                message = f"'{name}' is not a variable of the graph{hint}"
                key = f"{node.role}: {port.partition(':')[2]}"
                yield LabFault(file_of(graph), key, message, "variables", "warning")
