"""Rules about topics: one publisher each, the right message type, a QoS that subscribers match."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lab3_usd.check.lab_frames import repeated_publishers, repeating_graphs, role_specs
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import edits_in_stage, edits_of_harm
from lab3_usd.check.robot.sensors import second_lidars
from lab3_usd.check.robot.wheels import second_commanders
from lab3_usd.facts.endpoints import PROFILE, Endpoint, endpoints
from lab3_usd.facts.execution_order import live_nodes, live_sources
from lab3_usd.model.changes import Edit, RemovePrim
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.prims import is_at_or_below


@rule("Q01", "topic-published-twice", scope="stage")
def topic_published_twice(subject: StageSubject) -> Iterator[Problem]:
    """A topic has two publishers.

    Why: subscribers receive both streams mixed. Two clocks make time jump back{wheels?}, two
    odometries make the robot jump{/}. Only `/tf` and `/tf_static` may have several publishers. The
    graph of a second sensor is reported with that sensor.

    Fix: delete the second publisher. Most often it is a copy of the whole graph, or was created by
    an Isaac Sim menu under `/Graph`.

    Example: `/Graph/ROS_Clock` publishes `/clock` beside `{graph}`.
    """
    if not subject.checkpoint.graphs:
        return
    lidar_paths = tuple(prim.path for prim in second_lidars(subject))
    again: dict[str, list[tuple[Endpoint, tuple[Endpoint, ...]]]] = {}
    for endpoint, others in repeated_publishers(subject):
        if not any(is_at_or_below(endpoint.node.path, lidar) for lidar in lidar_paths):
            again.setdefault(endpoint.node.path.rpartition("/")[0], []).append((endpoint, others))
    for repeats in again.values():
        first = repeats[0][0]
        names = ", ".join(str(endpoint.topic) for endpoint, _ in repeats)
        paths = [other.node.path for _, others in repeats for other in others]
        wanted = subject.lab.topics.get(str(first.topic))
        severity: Severity | None = (
            None
            if any(
                endpoint.sure and any(other.sure for other in others)
                for endpoint, others in repeats
            )
            else "warning"
        )
        yield Problem(
            first.node.path,
            f"publishes {names}, which another node publishes as well",
            property=first.port,
            expected="one publisher",
            actual=names,
            handout=None if wanted is None else wanted.handout,
            related=tuple(dict.fromkeys([*(e.node.path for e, _ in repeats[1:]), *paths])),
            severity=severity,
            fix=tuple(_without(repeats, subject)) if severity is None else (),
        )


def _without(
    repeats: Sequence[tuple[Endpoint, tuple[Endpoint, ...]]], subject: StageSubject
) -> Iterator[Edit]:
    """Yield what removes the publishers of one graph that repeat those of the lab.

    A graph that sends and receives nothing else is a copy, and removed as a whole. Which of two
    publishers is too many where the lab has none, is unknown.
    """
    played, tree = role_specs(subject), subject.lab.platform.ros.tree_topics
    if not all(any(other.node.path in played for other in others) for _, others in repeats):
        return
    again = {endpoint.node.path for endpoint, _ in repeats}
    graph = repeats[0][0].node.path.rpartition("/")[0]
    is_copy = not any(is_at_or_below(path, graph) for path in played) and all(
        endpoint.node.path in again or endpoint.topic in tree
        for endpoint in endpoints(subject.stage, subject.lab.platform)
        if is_at_or_below(endpoint.node.path, graph)
    )
    yield from map(RemovePrim, [graph] if is_copy else sorted(again.difference(played)))


@rule("Q02", "wrong-topic-type", scope="stage", formerly="topic-of-another-type")
def wrong_topic_type(subject: StageSubject) -> Iterator[Problem]:
    """A topic has another message type.

    Why: ROS 2 connects only publishers and subscribers of the same type. With two types on one
    name, `ros2 topic echo` and recordings fail.

    Fix: use the message type of the lab, or another topic name.

    Example: a generic ROS2 Subscriber reads `{commands}` as `std_msgs/msg/String`.
    """
    played, copies = role_specs(subject), repeating_graphs(subject)
    expected = subject.lab.topics_until(subject.checkpoint.id)
    for endpoint in endpoints(subject.stage, subject.lab.platform):
        path, wanted = endpoint.node.path, expected.get(endpoint.topic or "")
        if wanted is None or endpoint.type in (None, wanted.type) or path in played:
            continue
        is_told = path in subject.faulty_prims or path.rpartition("/")[0] in copies
        if endpoint.runs and not is_told:
            severity: Severity | None = None if endpoint.sure else "warning"
            yield Problem(
                path,
                f"{endpoint.direction} {endpoint.topic} as {endpoint.type}",
                property=endpoint.port,
                expected=wanted.type,
                actual=endpoint.type,
                handout=wanted.handout,
                severity=severity,
                fix=edits_of_harm(subject, path, endpoint.port, severity),
            )


@rule("Q03", "wrong-durability", scope="stage", formerly="durability-of-a-topic")
def wrong_durability(subject: StageSubject) -> Iterator[Problem]:
    """A publisher has another durability.

    Why: a subscriber that requests stored messages gets none from a volatile publisher. Static
    transforms on `/tf_static` must be transient local, live data volatile.

    Fix: clear QoS Profile, and enable Static Publisher for `/tf_static` only.

    Example: a Publish Raw Transform Tree publishes on `/tf_static` with Static Publisher off.
    """
    if not subject.checkpoint.topics:
        return
    played, copies = role_specs(subject), repeating_graphs(subject)
    expected = subject.lab.topics
    for endpoint in endpoints(subject.stage, subject.lab.platform):
        path, wanted = endpoint.node.path, expected.get(endpoint.topic or "")
        judged = path in played or path in subject.faulty_prims or path.rpartition("/")[0] in copies
        if judged or wanted is None or endpoint.direction != "publishes" or not endpoint.runs:
            continue
        actual = None if endpoint.qos is None else endpoint.qos.durability
        if wanted.durability and actual not in (None, wanted.durability):
            severity: Severity | None = None if endpoint.sure else "warning"
            yield Problem(
                path,
                f"publishes {endpoint.topic} with durability {actual}",
                property=endpoint.port,
                expected=wanted.durability,
                actual=actual,
                handout=wanted.handout,
                severity=severity,
                fix=edits_of_harm(subject, path, endpoint.port, severity),
            )


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
    live, played = live_nodes(subject.stage, subject.lab.platform), role_specs(subject)
    for endpoint in endpoints(subject.stage, subject.lab.platform):
        path = endpoint.node.path
        sources = [
            f"{node.name}.{port}" for node, port in live_sources(endpoint.node, PROFILE, live)
        ]
        if sources and path in played:
            yield Problem(
                path,
                f"the QoS profile of {endpoint.topic} comes over a wire",
                property=PROFILE,
                expected="the default",
                actual="a profile Isaac Sim refuses" if endpoint.qos is None else str(endpoint.qos),
                hint=f"delete the wire from {', '.join(sources)} and leave the profile empty",
                fix=edits_in_stage(subject, path, PROFILE),
            )


@rule("Q05", "second-subscriber", scope="stage", severity="warning", formerly="topic-taken-twice")
def second_subscriber(subject: StageSubject) -> Iterator[Problem]:
    """A second graph subscribes to a topic.

    Why: both graphs act on every message. Two copies of a graph command the same joints, and a
    change in one has no effect while the other runs.

    Fix: delete the copy.

    Example: `/Graph/Copy` subscribes to `{commands}` beside the graph of the lab.
    """
    played = role_specs(subject)
    takers = [
        e for e in endpoints(subject.stage, subject.lab.platform) if e.direction == "subscribes"
    ]
    taken = {e.topic: e.node.path for e in takers if e.topic and e.node.path in played}
    lab_graphs = {roles.graph.path for roles in subject.roles.values() if roles.graph}
    commanders = second_commanders(subject.stage, subject.lab, subject.roles)
    lab_graphs |= {node.path.rpartition("/")[0] for node, _ in commanders}
    for endpoint in takers:
        path = endpoint.node.path
        if endpoint.runs and endpoint.topic in taken and path.rpartition("/")[0] not in lab_graphs:
            yield Problem(
                path,
                f"takes {endpoint.topic}, as a node of the lab does",
                property=endpoint.port,
                actual=endpoint.topic,
                related=(taken[endpoint.topic],),
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
    played = role_specs(subject)
    every_endpoint = endpoints(subject.stage, subject.lab.platform)
    taken = {
        endpoint.topic: endpoint.node.path
        for endpoint in every_endpoint
        if endpoint.topic and endpoint.direction == "subscribes" and endpoint.node.path in played
    }
    for endpoint in every_endpoint:
        if endpoint.runs and endpoint.direction == "publishes" and endpoint.topic in taken:
            yield Problem(
                endpoint.node.path,
                f"publishes {endpoint.topic}, which {taken[endpoint.topic]} takes "
                "from outside the stage",
                property=endpoint.port,
                actual=endpoint.topic,
                related=(taken[endpoint.topic],),
                fix=edits_in_stage(subject, endpoint.node.path, endpoint.port),
            )
