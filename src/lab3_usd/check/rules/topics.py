"""Rules about the topics of a lab: a QoS that subscribers match, and who takes commands."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.lab_topics import domain_name, role_specs
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import edits_in_stage
from lab3_usd.check.robot.wheels import second_commanders
from lab3_usd.facts.endpoints import PROFILE, Endpoint, endpoints
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.reaching_values import live_sources
from lab3_usd.model.finding import Problem


@rule("Q04", "wired-qos", scope="stage", formerly="profile-by-wire")
def wired_qos(subject: StageSubject) -> Iterator[Problem]:
    """A QoS profile comes over a connection.

    Why: a profile with best effort or a short queue loses messages. A profile that Isaac Sim cannot
    read stops the node.

    Fix: disconnect QoS Profile and leave it empty. The default is reliable and volatile and keeps
    as many messages as Queue Size says.

    Example: a ROS2 QoS Profile node set to Sensor Data is connected to the helper of a sensor.
    """
    if not subject.checkpoint.topics:
        return
    live, played = live_nodes(subject.stage), role_specs(subject)
    asked = {
        node.path
        for graph in subject.graphs
        for wire in graph.spec.wires
        if wire.target.port == PROFILE
        and (node := graph.roles.node_of[wire.target.role]) is not None
    }
    for endpoint in endpoints(subject.stage):
        path = endpoint.node.path
        sources = [
            f"{node.name}.{port}" for node, port in live_sources(endpoint.node, PROFILE, live)
        ]
        if sources and path in played and path not in asked:
            yield Problem(
                path,
                f"the QoS profile of {endpoint.topic} comes over a wire",
                property=PROFILE,
                expected="the default",
                actual="a profile Isaac Sim refuses" if endpoint.qos is None else str(endpoint.qos),
                hint=f"delete the wire from {', '.join(sources)} and leave the profile empty",
                fix=edits_in_stage(subject, path, PROFILE),
            )


def _heard(endpoint: Endpoint, subject: StageSubject) -> tuple[str | None, str]:
    """Return who hears of an endpoint: a topic and a domain."""
    return endpoint.topic, domain_name(endpoint.domain, subject)


def _taken(subject: StageSubject) -> dict[tuple[str | None, str], str]:
    """Map what the nodes of the lab subscribe to, to the node."""
    played = role_specs(subject)
    return {
        _heard(endpoint, subject): endpoint.node.path
        for endpoint in endpoints(subject.stage)
        if endpoint.topic and endpoint.direction == "subscribes" and endpoint.node.path in played
    }


@rule("Q05", "second-subscriber", scope="stage", severity="warning", formerly="topic-taken-twice")
def second_subscriber(subject: StageSubject) -> Iterator[Problem]:
    """A second graph subscribes to a topic.

    Why: both graphs act on every message. Two copies of a graph command the same joints, and a
    change in one has no effect while the other runs.

    Fix: delete the copy.

    Example: `/Graph/Copy` subscribes to `{commands}` beside the graph of the lab.
    """
    taken = _taken(subject)
    lab_graphs = {roles.graph.path for roles in subject.roles.values() if roles.graph}
    commanders = (node for robot in subject.robots for node, _ in second_commanders(robot))
    lab_graphs |= {node.path.rpartition("/")[0] for node in commanders}
    for endpoint in endpoints(subject.stage):
        path, heard = endpoint.node.path, _heard(endpoint, subject)
        is_taker = endpoint.runs and endpoint.direction == "subscribes"
        if is_taker and heard in taken and path.rpartition("/")[0] not in lab_graphs:
            yield Problem(
                path,
                f"also subscribes to {endpoint.topic}, which a node of the lab does",
                property=endpoint.port,
                actual=endpoint.topic,
                related=(taken[heard],),
                fix=edits_in_stage(subject, path, endpoint.port),
            )


@rule(
    "Q06",
    "command-topic-published",
    scope="stage",
    severity="warning",
    formerly="topic-of-commands-published",
)
def command_topic_published(subject: StageSubject) -> Iterator[Problem]:
    """The stage publishes a topic that it should receive.

    Why: what commands the robot publishes {commands}. A publisher in the stage adds its own
    commands, and the robot follows both in turn.

    Fix: delete the publisher, or give it another topic.

    Example: a ROS2 Publisher publishes on `{commands}`.
    """
    taken = _taken(subject)
    for endpoint in endpoints(subject.stage):
        taker = taken.get(_heard(endpoint, subject))
        if endpoint.runs and endpoint.direction == "publishes" and taker is not None:
            yield Problem(
                endpoint.node.path,
                f"publishes {endpoint.topic}, which {taker} takes from outside the stage",
                property=endpoint.port,
                actual=endpoint.topic,
                related=(taker,),
                fix=edits_in_stage(subject, endpoint.node.path, endpoint.port),
            )
