"""Rules about topics with and without a lab: one publisher, one type, static transforms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.check.lab_topics import (
    Publishers,
    assumed,
    domain_name,
    graph_of,
    once_there,
    plays_role,
    publishers_by_topic,
    role_specs,
    wanted_topic,
)
from lab3_usd.check.match.rule_inputs import ModelSubject, StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import removal_or_repair
from lab3_usd.facts.domains import are_surely_one
from lab3_usd.facts.endpoints import Endpoint, endpoints, running_endpoints
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.followed_bodies import moving_source
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.model.changes import Edit, RemovePrim
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.qos import Qos


def severity_of(*ends: Endpoint, subject: ModelSubject) -> Severity | None:
    """Return the severity of a fault between these, milder where it is not sure that they meet.

    The environment of a lab names no domain but the lab's.
    """
    is_sure = all(end.sure for end in ends)
    are_one = isinstance(subject, StageSubject) or are_surely_one(end.domain for end in ends)
    return None if is_sure and are_one else "warning"


@rule("K40", "two-publishers")
@rule("Q01", "topic-published-twice", scope="stage")
def two_publishers(subject: ModelSubject) -> Iterator[Problem]:
    """A topic has two publishers.

    Why: subscribers receive both streams mixed. Two clocks make time jump back{wheels?}, two
    odometries make the robot jump{/}. Only topics of transforms, such as `/tf`, may have several
    publishers. Publishers in different ROS domains never meet. The graph of a second sensor is
    reported with that sensor.

    Fix: delete the second publisher. Most often it is a copy of the whole graph, or was created by
    an Isaac Sim menu under `/Graph`. Of two robots, give each a namespace or topics of its own. A
    node that publishes two topics needs two topic names.

    Example: `/Graph/ROS_Clock` publishes `/clock` beside `{graph}`.
    """
    again: dict[str, list[tuple[Endpoint, Publishers]]] = {}
    if isinstance(subject, StageSubject) and not subject.checkpoint.graphs:
        return  # before the first graph of a lab nothing is judged
    for topic in publishers_by_topic(subject):
        for endpoint in topic.blamed:
            right = topic.right
            types = {right.type, endpoint.type}
            if endpoint.node.path == right.node.path:
                yield Problem(
                    endpoint.node.path,
                    f"{endpoint.port} and {right.port} are both {endpoint.topic}",
                    property=endpoint.port,
                    expected="a topic of its own",
                    actual=endpoint.topic,
                    severity=severity_of(right, endpoint, subject=subject),
                )
            elif None in types or len(types) == 1:  # else two kinds of messages, each sent once
                again.setdefault(graph_of(endpoint), []).append((endpoint, topic))
    for repeats in again.values():
        first = repeats[0][0]
        names = ", ".join(dict.fromkeys(str(endpoint.topic) for endpoint, _ in repeats))
        pairs = [(end, other) for end, topic in repeats for other in topic.rivals(end)]
        ends = (*(end for end, _ in repeats[1:]), *(other for _, other in pairs))
        paths = dict.fromkeys(end.node.path for end in ends if end.node.path != first.node.path)
        is_sure = any(severity_of(*pair, subject=subject) is None for pair in pairs)
        wanted = wanted_topic(first, subject)
        yield Problem(
            first.node.path,
            f"publishes {names}, which another node publishes as well",
            property=first.port,
            expected="one publisher",
            actual=names,
            handout=None if wanted is None else wanted.handout,
            related=tuple(paths),
            severity=None if is_sure else "warning",
            fix=tuple(_without(repeats, subject)) if is_sure else (),
            assumes=assumed(first, subject),
            covers=(once_there(first.node.path),),
        )


def _without(
    repeats: Sequence[tuple[Endpoint, Publishers]], subject: ModelSubject
) -> Iterator[Edit]:
    """Yield what removes the publishers of one graph that repeat those of the lab.

    A graph that sends and receives nothing else is a copy, and removed as a whole. Which of two
    publishers is too many where the lab has none, is unknown.
    """
    if not isinstance(subject, StageSubject):
        return
    played, tree = role_specs(subject), subject.platform.ros.tree_topics
    if not all(topic.right.node.path in played for _, topic in repeats):
        return
    again = {endpoint.node.path for endpoint, _ in repeats}
    graph = graph_of(repeats[0][0])
    is_copy = not any(is_at_or_below(path, graph) for path in played) and all(
        endpoint.node.path in again or endpoint.topic in tree
        for endpoint in endpoints(subject.stage)
        if is_at_or_below(endpoint.node.path, graph)
    )
    yield from map(RemovePrim, [graph] if is_copy else sorted(again.difference(played)))


@rule("K41", "two-types")
@rule("Q02", "wrong-topic-type", scope="stage", formerly="topic-of-another-type")
def two_types(subject: ModelSubject) -> Iterator[Problem]:
    """One topic has two message types.

    Why: ROS 2 connects only publishers and subscribers of the same type. With two types on one
    name, `ros2 topic echo`, RViz and recordings fail. It is a warning where a lab asks nothing of
    the topic.

    Fix: use the message type of the other nodes, or another topic name.

    Example: a generic ROS2 Subscriber reads `{commands}` as `std_msgs/msg/String`.
    """
    first: dict[tuple[str, str], Endpoint] = {}
    for endpoint in (
        *running_endpoints(subject.stage, "publishes"),
        *running_endpoints(subject.stage, "subscribes"),
    ):
        if endpoint.type is None:
            continue
        key = (str(endpoint.topic), domain_name(endpoint.domain, subject))
        other = first.setdefault(key, endpoint)
        is_twice = other.node is endpoint.node and other is not endpoint
        if is_twice or plays_role(endpoint, subject):
            continue
        wanted = wanted_topic(endpoint, subject)
        expected, rivals = (other.type, [other]) if wanted is None else (wanted.type, [])
        if endpoint.type != expected:
            problem = Problem(
                endpoint.node.path,
                f"{endpoint.direction} {endpoint.topic} as {endpoint.type}"
                + "".join(f", and {e.node.path} {e.direction} it as {e.type}" for e in rivals),
                property=endpoint.port,
                expected=expected,
                actual=endpoint.type,
                related=tuple(rival.node.path for rival in rivals),
            )
            severity = severity_of(endpoint, *rivals, subject=subject)
            yield _judged(problem, endpoint, severity, subject)


_STATIC, _MOVING = "/tf_static", "/tf"
_KEPT = "transient_local"


@rule("K57", "static-transforms")
@rule("Q03", "wrong-durability", scope="stage", formerly="durability-of-a-topic")
def static_transforms(subject: ModelSubject) -> Iterator[Problem]:
    """Moving transforms are sent once, or static ones are not kept.

    Why: with Static Publisher on, a transform is sent only at the first tick, and stored for later
    subscribers. On `/tf_static` tf2 requests stored messages and accepts no others. A transform
    that is sent once never moves again: the robot stays where it was at the first tick. What a lab
    asks of the durability of other topics is judged here, too.

    Fix: enable Static Publisher for `/tf_static` only, and for transforms that never change. What
    moves belongs on `/tf`, with Static Publisher off. Clear QoS Profile of live data.

    Example: a Publish Raw Transform Tree on `/tf_static` with Static Publisher off.
    """
    if isinstance(subject, StageSubject) and not subject.checkpoint.topics:
        return
    for endpoint in endpoints(subject.stage):
        is_sent = endpoint.direction == "publishes" and endpoint.runs and endpoint.topic
        if not is_sent or endpoint.qos is None or plays_role(endpoint, subject):
            continue
        wanted = wanted_topic(endpoint, subject)
        asked = None if wanted is None else wanted.durability
        ports = None if endpoint.node.type is None else endpoint.node.type.tf
        problem = None
        if ports is not None and ports.static is not None:
            problem = _of_transforms(endpoint, endpoint.qos, ports.static, subject)
        elif asked not in (None, endpoint.qos.durability):
            problem = Problem(
                endpoint.node.path,
                f"publishes {endpoint.topic} with durability {endpoint.qos.durability}",
                property=endpoint.port,
                expected=asked,
                actual=endpoint.qos.durability,
            )
        if problem is not None:
            yield _judged(problem, endpoint, severity_of(endpoint, subject=subject), subject)


def _judged(
    problem: Problem, endpoint: Endpoint, severity: Severity | None, subject: ModelSubject
) -> Problem:
    """Return the problem of an endpoint, in a lab with its repair.

    There it is a warning at a topic of which nothing is asked.
    """
    if not isinstance(subject, StageSubject):
        return replace(problem, severity=severity)
    wanted, path = wanted_topic(endpoint, subject), endpoint.node.path
    severity = "warning" if wanted is None else severity
    return replace(
        problem,
        severity=severity,
        handout=None if wanted is None else wanted.handout,
        fix=removal_or_repair(subject, path, problem.property, severity),
        assumes=assumed(endpoint, subject),
    )


def _of_transforms(
    endpoint: Endpoint, qos: Qos, switch: str, subject: ModelSubject
) -> Problem | None:
    """Return what is wrong with how transforms are sent: `switch` has them sent once."""
    node, topic = endpoint.node, str(endpoint.topic)
    is_once = effective_value(node, switch, live_nodes(subject.stage)) is True
    is_kept, is_for_static = qos.durability == _KEPT, topic.endswith(_STATIC)
    how = "once, at the first tick" if is_once else "without keeping it for tf2"
    moves = moving_source(node, subject.stage) if is_for_static else None
    if moves is not None and (is_once or not is_kept):
        belongs = topic.removesuffix(_STATIC) + _MOVING
        return Problem(
            node.path,
            f"publishes {topic} {how}; the pose from {moves.path} changes and belongs on {belongs}",
            property=switch if is_once else endpoint.port,
            expected="False" if is_once else belongs,
            actual="True" if is_once else topic,
            related=(moves.path,),
        )
    if is_kept if is_for_static else not is_once:
        return None
    return Problem(
        node.path,
        f"publishes {topic} {how}",
        property=switch,
        expected=str(is_for_static),
        actual=str(is_once),
    )
