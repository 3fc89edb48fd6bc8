"""Rules about nodes that the handout does not ask for: extra, outside a graph, with code."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.absent_nodes import absent_nodes
from lab3_usd.check.match.subject import GraphSubject, StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import live_nodes, severity_if_uncertain
from lab3_usd.check.ros.topics import Endpoint, endpoints
from lab3_usd.check.scene.wheel_commands import is_doubtful, second_commanders
from lab3_usd.model.absent_prims import nodes_outside_graphs
from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import node_title
from lab3_usd.model.stage import Node
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.topic_names import resolved_topic

_PUBLISHES = ("publisher", "helper")


@rule("N02", "extra-node", scope="graph", severity="warning")
def extra_node(subject: GraphSubject) -> Iterator[Problem]:
    """The graph holds a node that the handout does not ask for.

    Why: the node may do nothing, or may repeat the work of another node. A second node with the
    same settings (context, tick, subscriber) works like the first.

    Fix: select the node in the Action Graph editor and delete it.

    Example: a second ROS2 Context in {next_graph_name}.
    """
    if not subject.roles.extra:
        return
    roles = {subject.spec.name: subject.roles}
    told = [node for node, _ in second_commanders(subject.stage, subject.lab, roles)]
    for node in subject.roles.extra:
        is_told = _is_script(subject, node) or node in told
        if not is_told and not _published_again(subject, node):
            message = f"{node_title(node)} is not asked for in {subject.spec.name}"
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

    Why: subscribers cannot tell the two streams apart. Two transform publishers give one frame two
    parents.

    Fix: delete the node that the handout does not ask for.

    Example: a second ROS2 Publish Clock in {graph_name}.
    """
    for node in subject.roles.extra:
        pair = None if _is_script(subject, node) else _published_again(subject, node)
        if pair is not None:
            own, other = pair
            yield Problem(
                node.path,
                f"{node_title(node)} is not asked for and publishes {own.topic} again",
                property=own.port,
                actual=own.topic,
                handout=subject.spec.handout,
                related=(other.node.path,),
                severity=None if _is_sure(pair) else "warning",
            )


@rule("N08", "script-node", scope="stage")
def script_node(subject: StageSubject) -> Iterator[Problem]:
    """A node, or a prim with Python scripting, runs code from the file.

    Why: the code may run when somebody opens the stage and presses Play. The lab needs no code.

    Fix: delete the node. If a prim carries the script, remove Python Scripting in the Property
    panel.

    Example: a Script Node that publishes odometry from Python.
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
    """A node is outside every graph.

    Why: such a node is never evaluated. It is usually left over after nodes were dragged in the
    Stage panel. If a graph lacks this node, N01 reports it instead.

    Fix: drag the node back below its graph in the Stage panel, or delete it.

    Example: `/to_string` at the root of the stage.
    """
    lab, stage = subject.lab, subject.stage
    missed = {
        each.path
        for name, roles in subject.roles.items()
        for each in absent_nodes(lab.graphs[name], roles, stage, lab.catalog).values()
    }
    for node in nodes_outside_graphs(stage):
        if node.path not in missed and not lab.catalog.scripts.runs(node.type_name):
            message = f"{node_title(node)} stands outside every graph, where it is never evaluated"
            yield Problem(node.path, message, None, None, node.type_name)


@rule("N12", "wheels-commanded-twice", scope="stage")
def wheels_commanded_twice(subject: StageSubject) -> Iterator[Problem]:
    """A second node commands the wheels of the robot.

    Why: both controllers write the wheel velocities in every frame, and the last one wins. The
    robot stands still or does not follow its commands.

    Fix: delete the graph of that node. Isaac Sim's menu for a differential controller creates one.

    Example: `/Graph/differential_controller/ArticulationController`, created by Tools > Robotics >
    OmniGraph Controllers > Differential Controller.
    """
    stage, lab, robot = subject.stage, subject.lab, subject.lab.scene.robot
    live = live_nodes(stage, lab)
    for node, own in second_commanders(stage, lab, subject.roles):
        doubtful = (
            "warning"
            if is_doubtful(node, live)
            else severity_if_uncertain(stage, lab, node.path, own)
        )
        yield Problem(
            node.path,
            f"{node_title(node)} commands the wheels as well, which only {own} may do",
            expected="one controller",
            actual=node.type_name,
            handout=robot.wheels.handout or robot.handout,
            related=(own,),
            severity=doubtful,
        )
