"""Rules about nodes that the handout does not ask for."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import strays
from lab3_usd.check.commanders import second_commanders
from lab3_usd.check.finding import Problem
from lab3_usd.check.model import Node
from lab3_usd.check.names import resolved_topic
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.nodes import absent_nodes
from lab3_usd.check.say import title_of
from lab3_usd.check.subject import GraphSubject, StageSubject
from lab3_usd.check.topics import Endpoint, endpoints
from lab3_usd.spec.spec import Lab

_PUBLISHES = ("publisher", "helper")


@rule("N02", "extra-node", scope="graph", severity="warning")
def extra_node(subject: GraphSubject) -> Iterator[Problem]:
    """The graph holds a node that the handout does not ask for.

    Why: it may do nothing, or do a second time what another node does. A second node with the
    same settings (two contexts, two ticks, two subscribers) works as the first does.

    Fix: select the node in the Action Graph editor and delete it.

    Example: a second ROS2 Context in ROS_Drive.
    """
    roles = {subject.spec.name: subject.roles}
    told = [node for node, _ in second_commanders(subject.stage, subject.lab, roles)]
    for node in subject.roles.extra:
        is_told = _is_script(subject, node) or node in told
        if not is_told and not _published_again(subject, node):
            message = f"{title_of(node)} is not asked for in {subject.spec.name}"
            yield Problem(node.path, message, actual=node.type_name, handout=subject.spec.handout)


def _is_script(subject: GraphSubject, node: Node) -> bool:
    return subject.lab.catalog.scripts.runs(node.type_name)


def _published_again(subject: GraphSubject, node: Node) -> tuple[Endpoint, Endpoint] | None:
    """Return where an extra node publishes a topic of the lab, and where another node does."""
    asked = _topics_asked(subject.lab)
    if subject.checkpoint.frames:
        asked -= set(subject.lab.policy.tree_topics)  # the rules of frames judge what it sends
    published = [
        each
        for each in endpoints(subject.stage, subject.lab)
        if each.runs and each.direction == "publishes" and each.topic in asked
    ]
    pairs = [
        (own, other)
        for own in published
        for other in published
        if own.node is node and other.node is not node and own.topic == other.topic
    ]
    return min(pairs, key=lambda pair: not _is_sure(pair), default=None)


def _is_sure(pair: tuple[Endpoint, Endpoint]) -> bool:
    return all(endpoint.sure for endpoint in pair)


def _topics_asked(lab: Lab) -> set[str]:
    return {
        resolved_topic(str(setting.value))
        for spec in lab.graphs.values()
        for node in spec.nodes.values()
        for setting in node.settings
        if setting.port in node.type.topics and node.type.role in _PUBLISHES
    }


@rule("N07", "repeated-publisher", scope="graph")
def repeated_publisher(subject: GraphSubject) -> Iterator[Problem]:
    """An extra node publishes a topic of the lab a second time.

    Why: two publishers of one topic send two streams that nobody can tell apart; two transform
    publishers give one frame two parents.

    Fix: delete the node that the handout does not ask for.

    Example: a second ROS2 Publish Clock in ROS_Clock.
    """
    for node in subject.roles.extra:
        pair = None if _is_script(subject, node) else _published_again(subject, node)
        if pair is not None:
            own, other = pair
            yield Problem(
                node.path,
                f"{title_of(node)} is not asked for and publishes {own.topic} again",
                property=own.port,
                actual=own.topic,
                handout=subject.spec.handout,
                related=(other.node.path,),
                severity=None if _is_sure(pair) else "warning",
            )


@rule("N08", "script-node", scope="stage")
def script_node(subject: StageSubject) -> Iterator[Problem]:
    """The stage holds a node, or a prim with Python scripting, that runs code out of the file.

    Why: whoever opens the stage and presses Play may run that code. The lab needs none.

    Fix: delete the node. On a prim that carries a script, remove Python Scripting in the Property
    panel.

    Example: a Script Node that publishes /odom from Python.
    """
    for script in subject.stage.scripts:
        is_node = subject.lab.catalog.scripts.runs(script.carrier)
        what = "node" if is_node else "prim"
        yield Problem(
            script.prim,
            f"{what} runs code out of the file, which the lab does not need",
            property="node:type" if is_node else None,
            actual=script.carrier,
        )


@rule("N09", "node-outside-graph", scope="stage", severity="warning")
def node_outside_graph(subject: StageSubject) -> Iterator[Problem]:
    """A node stands outside every graph.

    Why: nobody evaluates it. It is usually left over from dragging nodes in the Stage panel. A
    graph that lacks this node says so itself.

    Fix: drag it back below its graph in the Stage panel, or delete it.

    Example: `/to_string` at the root of the stage.
    """
    lab, stage = subject.lab, subject.stage
    missed = {
        each.path
        for name, roles in subject.roles.items()
        for each in absent_nodes(lab.graphs[name], roles, stage, lab.catalog).values()
    }
    for node in strays(stage):
        if node.path not in missed and not lab.catalog.scripts.runs(node.type_name):
            message = f"{title_of(node)} stands outside every graph, where it is never evaluated"
            yield Problem(node.path, message, None, None, node.type_name)
