"""Rules about nodes that the handout does not ask for."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.finding import Problem
from lab3_usd.check.model import Node
from lab3_usd.check.names import resolved_topic
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.nodes import absent_nodes
from lab3_usd.check.say import title_of
from lab3_usd.check.subject import GraphSubject, StageSubject
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
    for node in subject.roles.extra:
        if not (_is_script(subject, node) or _publishes_again(subject, node)):
            message = f"{title_of(node)} is not asked for in {subject.spec.name}"
            yield Problem(node.path, message, actual=node.type_name, handout=subject.spec.handout)


def _is_script(subject: GraphSubject, node: Node) -> bool:
    return node.type_name in subject.lab.catalog.scripts


def _publishes_again(subject: GraphSubject, node: Node) -> bool:
    """Whether an extra node publishes a topic of the lab that another node publishes as well."""
    own = _published(node)
    if own is None or own not in _topics_asked(subject.lab):
        return False
    if subject.checkpoint.frames and own in subject.lab.policy.tree_topics:
        return False  # the rules of frames judge what it sends
    return any(_published(each) == own for each in subject.live.values() if each is not node)


def _published(node: Node) -> str | None:
    """Return the topic that a node publishes first of all, None for one that publishes none."""
    if node.type is None or not node.type.topics or node.type.role not in _PUBLISHES:
        return None
    return resolved_topic(str(node.value(node.type.topics[0])))


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
        is_again = not _is_script(subject, node) and _publishes_again(subject, node)
        if is_again and node.type is not None:
            topic = _published(node)
            message = f"{title_of(node)} is not asked for and publishes {topic} again"
            yield Problem(
                node.path, message, node.type.topics[0], None, topic, subject.spec.handout
            )


@rule("N08", "script-node", scope="stage")
def script_node(subject: StageSubject) -> Iterator[Problem]:
    """The stage holds a node that runs code out of the file.

    Why: whoever opens the stage and presses Play runs that code. The lab needs none.

    Fix: delete the node.

    Example: a Script Node that publishes /odom from Python.
    """
    for node in subject.stage.nodes():
        if node.type_name in subject.lab.catalog.scripts:
            message = "node runs code out of the file, which the lab does not need"
            yield Problem(node.path, message, "node:type", None, node.type_name)


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
    for node in stage.orphans:
        if node.path not in missed and node.type_name not in lab.catalog.scripts:
            message = f"{title_of(node)} stands outside every graph, where it is never evaluated"
            yield Problem(node.path, message, None, None, node.type_name)
