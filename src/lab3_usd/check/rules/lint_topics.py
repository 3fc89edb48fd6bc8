"""Rules about topics, services and their types, and about the names of tokens and frames."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import TYPE, VERSION, can_become
from lab3_usd.check.rules.any_topics import severity_of
from lab3_usd.facts.domains import are_surely_one, domain_of
from lab3_usd.facts.endpoints import (
    PROFILE,
    Endpoint,
    endpoints,
    namespace_of,
    qos_of,
    ros_name,
    running_endpoints,
    used_topics,
)
from lab3_usd.facts.execution_order import is_switched_on, nodes_with
from lab3_usd.facts.frame_targets import NAME_OVERRIDE, frame_of_prim
from lab3_usd.facts.frames import all_edges
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.wires import connections
from lab3_usd.isaac.messages import NAMED, why_no_message, why_no_service
from lab3_usd.isaac.node_types import KIND, NodeType
from lab3_usd.model.changes import ClearValue, Edit, SetValue
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.qos import Qos, refusal, unmatched
from lab3_usd.model.stage import Node, StageModel

# A name from which no more is stripped than what everybody writes: a slash before.
_WHOLE = r"^/?([A-Za-z0-9].*[A-Za-z0-9]|[A-Za-z0-9])$"


@rule("K42", "invalid-qos", formerly="refused-profile")
def invalid_qos(subject: LintSubject) -> Iterator[Problem]:
    """A QoS profile cannot be read, or has a policy that does not exist.

    Why: a profile is JSON with eight fields, and Isaac Sim requires all of them: the three times
    with a decimal point (`0.0`), the depth without one. If a field is missing, misspelt or has
    another form, the node fails and neither publishes nor subscribes.

    Fix: clear QoS Profile, or connect it to a ROS2 QoS Profile node.

    Example: `inputs:qosProfile = '{"reliability": "bestEffort"}'`.
    """
    for endpoint in endpoints(subject.stage):
        written = effective_value(endpoint.node, PROFILE, subject.live)
        profile = qos_of(endpoint.node, subject.live, static=False)
        if profile is not None and not profile.is_known:
            yield Problem(
                endpoint.node.path,
                f"its QoS profile has a policy `unknown`, with which ROS 2 opens nothing: "
                f"{endpoint.topic} is not there",
                property=PROFILE,
                expected="policies that are known",
                actual=str(profile),
            )
        elif endpoint.qos is None and isinstance(written, str) and written:
            yield Problem(
                endpoint.node.path,
                f"{PROFILE} is not a profile that Isaac Sim can read: {endpoint.topic} is not "
                "opened",
                property=PROFILE,
                expected="JSON with all eight fields, or nothing",
                actual=written,
            )


@rule("K43", "incompatible-qos", formerly="profiles-do-not-meet")
def incompatible_qos(subject: LintSubject) -> Iterator[Problem]:
    """Publisher and subscriber have incompatible QoS profiles.

    Why: a reliable subscriber receives nothing from a best-effort publisher, and a transient-local
    subscriber nothing from a volatile publisher.

    Fix: give both the same profile.

    Example: `/cmd_vel` is published as Sensor Data and subscribed with the default.
    """
    makers: dict[tuple[str | None, str], list[Endpoint]] = {}
    for maker in running_endpoints(subject.stage, "publishes"):
        makers.setdefault((maker.topic, maker.domain.name), []).append(maker)
    for taker in running_endpoints(subject.stage, "subscribes"):
        for maker in makers.get((taker.topic, taker.domain.name), ()):
            if maker.qos and taker.qos and (asked := refusal(taker.qos, maker.qos)):
                yield Problem(
                    taker.node.path,
                    f"{taker.topic} does not arrive: the subscriber asks for {asked}",
                    property=PROFILE,
                    expected=str(maker.qos),
                    actual=str(taker.qos),
                    related=(maker.node.path,),
                    severity=severity_of(maker, taker, subject=subject),
                )


@rule("K98", "unmatched-peer", severity="warning")
def unmatched_peer(subject: LintSubject) -> Iterator[Problem]:
    """The usual peer of a topic cannot be matched with its endpoint.

    Why: a subscriber that asks for more than the publisher offers receives nothing (DDS). A default
    publisher, as those of teleop and Nav2, offers reliable, volatile, no deadline and no lease;
    `tf2_ros` listens to `/tf` as reliable.

    Fix: clear QoS Profile, or give your own peers the same profile.

    Example: `/cmd_vel` is subscribed as transient local, so that teleop moves nothing.
    """
    directions: dict[str, set[str]] = {}
    for endpoint in endpoints(subject.stage):
        directions.setdefault(endpoint.topic or "", set()).add(endpoint.direction)
    for endpoint in endpoints(subject.stage):
        if endpoint.qos is None or not endpoint.runs:
            continue
        why = unmatched(endpoint.direction, endpoint.type or "", endpoint.qos)
        offered = bool(directions[endpoint.topic or ""] - {endpoint.direction})
        if why and not offered:  # else K43 says so of the two
            yield Problem(
                endpoint.node.path,
                f"{endpoint.topic}: {why}",
                property=PROFILE,
                expected=str(Qos()),
                actual=str(endpoint.qos),
            )


@rule("K35", "unknown-token", formerly="value-not-offered")
def unknown_token(subject: LintSubject) -> Iterator[Problem]:
    """A token is not among the choices of its input.

    Why: the node rejects the value with an error, or uses another one.

    Fix: choose one of the values that the Property panel offers.

    Example: `inputs:type = "depth_image"` on a ROS2 Camera Helper, which offers `depth`.
    """
    # One of the inputs that a type grows may take some values only, as its own may.
    for node, kind in nodes_with(
        lambda kind: kind if kind.grows or any(p.allowed for p in kind.ports.values()) else None,
        subject.stage,
    ):
        for name in node.ports:
            port = kind.port(name)
            if port is None or not port.allowed:
                continue
            value = effective_value(node, name, subject.live)
            choices = (*port.allowed, *kind.message)
            if isinstance(value, str) and value not in ("", port.default, *choices):
                near = likely_name(value, port.allowed)
                moved = subject.platform.get(kind.moved.get(value, "") if name == KIND else "")
                other = None if moved is None else moved.ui_name
                later = subject.platform.changes.tokens.get(node.type_name, {}).get(name, {})
                nearest = later.get(value) if near is None and moved is None else None
                expected = other or near or nearest or ", ".join(port.allowed)
                instead = f"; {nearest} comes nearest" if nearest else did_you_mean(near)
                yield Problem(
                    node.path,
                    f"{name} is {display(value)}, which {subject.title(node)} does not offer"
                    f"{f'; {other} does it now' if other else instead}",
                    property=name,
                    expected=expected,
                    actual=value,
                    hint=f"replace the node by a {other}" if other else None,
                    fix=_setting(node, name, expected if expected in port.allowed else "")
                    if moved is None
                    else _becoming(node, moved, subject),
                    likely=nearest is not None,
                )


def _becoming(node: Node, kind: NodeType, subject: LintSubject) -> tuple[Edit, ...]:
    """Return what makes a node one of another type that has all of its wired ports."""
    if not can_become(node, kind, subject.stage):
        return ()
    return (
        SetValue(node.path, TYPE, "token", kind.type),
        SetValue(node.path, VERSION, "int", kind.version),
        *(
            ClearValue(node.path, name)
            for name, state in node.ports.items()
            if state.value is not None and kind.port(name) is None
        ),
    )


def _setting(node: Node, name: str, value: str) -> tuple[Edit, ...]:
    """Return what gives an input the value that was likely meant; a connected one has none."""
    port = None if node.type is None else node.type.port(name)
    if port is None or not value or node.sources(name):
        return ()
    return (SetValue(node.path, name, port.usd_type, value),)


@rule("K37", "topic-name")
def topic_name(subject: LintSubject) -> Iterator[Problem]:
    """ROS 2 rejects or changes the name of a topic.

    Why: ROS 2 rejects a name with spaces, dashes or a leading digit, and there is no publisher. The
    bridge strips everything except letters and digits from both ends of a name, which is a note:
    the topic is the shorter name.

    Fix: use letters, digits, underscores and slashes, and begin with a letter.

    Example: `inputs:topicName = "camera-1/rgb image"`.
    """
    refused: set[str] = set()
    for node, kind in nodes_with(lambda kind: kind if kind.role else None, subject.stage):
        for port in (*used_topics(node, kind, subject.live), *kind.services):
            written = effective_value(node, port, subject.live)
            if not isinstance(written, str):
                continue
            topic = ros_name("", written)
            if topic is None:
                fault = f"{display(written)}, which ROS 2 rejects"
                text = f"{port} is {fault if written else 'empty: there is no topic'}"
                yield Problem(node.path, text, property=port, actual=written)
            elif re.match(_WHOLE, written) is None:
                yield Problem(
                    node.path,
                    f"{port} is {display(written)}, but the topic becomes {topic}",
                    property=port,
                    expected=topic,
                    actual=written,
                    severity="note",
                )
        namespace = namespace_of(node, subject.stage, subject.live)
        if namespace and namespace not in refused and ros_name(namespace, "topic") is None:
            refused.add(namespace)
            yield Problem(
                node.path,
                f"the namespace of its topics is {display(namespace)}, which ROS 2 rejects",
                expected="letters, digits, underscores and slashes, a letter first",
                actual=namespace,
            )


@rule("K38", "frame-name", severity="warning")
def frame_name(subject: LintSubject) -> Iterator[Problem]:
    """A frame name is empty, ends in a slash or white space, or is that of another prim.

    Why: tf2 rejects an empty name and a leading slash. A name with a space is a different frame, so
    no transform is found for the message. If name overrides exchange the names of two prims, each
    frame is where the other should be.

    Fix: write the name as in the TF tree, without a slash and without white space. Clear the name
    overrides of prims that have each other's names.

    Example: `inputs:frameId = "/base_scan"`.
    """
    for node, port, value, is_stripped in _written_frames(subject):
        is_padded = value != value.strip()
        if not value or is_padded or (value.startswith("/") and not is_stripped):
            fault = "begins with a slash" if not is_padded else "has white space around it"
            fault = f"is {display(value)}, which {fault}" if value else "is empty"
            yield Problem(
                node.path,
                f"{port} {fault}",
                property=port,
                expected=value.strip().lstrip("/") or "the name of a frame",
                actual=value,
                fix=_setting(node, port, value.strip().lstrip("/")),
            )
    yield from _exchanged_names(subject.stage)


def _written_frames(subject: LintSubject) -> Iterator[tuple[Node, str, str, bool]]:
    """Yield the frames that nodes send: node, port, name, and whether tf2 strips its slash."""
    for node, kind in nodes_with(lambda kind: kind if kind.topics else None, subject.stage):
        if subject.runs(node.path) and is_switched_on(node, subject.live):
            topics = used_topics(node, kind, subject.live)
            is_pair = any(topic.endswith("Right") for topic in topics)
            for port in kind.frames:
                value = effective_value(node, port, subject.live)
                if isinstance(value, str) and (is_pair or not port.endswith("Right")):
                    yield node, port, value, kind.tf is not None


def _exchanged_names(stage: StageModel) -> Iterator[Problem]:
    """Yield prims of one robot whose overrides are each the name of another prim with one."""
    paths = dict.fromkeys(edge.prim for edge in all_edges(stage) if edge.prim)
    bodies, by_robot = joined_bodies(stage), dict[str, dict[str, str]]()
    for path in paths:
        if frame_of_prim(path, stage) != path.rpartition("/")[2]:
            by_robot.setdefault(bodies.owner(path), {})[path] = frame_of_prim(path, stage)
    for renamed in by_robot.values():
        own = {path.rpartition("/")[2] for path in renamed}
        exchanged = [path for path, name in renamed.items() if name in own]
        if {renamed[path] for path in exchanged} == own and len(exchanged) == len(own):
            named = ", ".join(f"{path.rpartition('/')[2]} '{renamed[path]}'" for path in exchanged)
            yield Problem(
                exchanged[0],
                f"{NAME_OVERRIDE} gives prims each other's names: {named}",
                property=NAME_OVERRIDE,
                expected=exchanged[0].rpartition("/")[2],
                actual=renamed[exchanged[0]],
                related=tuple(exchanged[1:]),
                rests_on=stage.unknown(*exchanged),
            )


def _naming(subject: LintSubject) -> Iterator[tuple[Node, NodeType, tuple[str, str, str]]]:
    """Yield the nodes that name a message or service, by package, folder and name."""
    for node, kind in nodes_with(
        lambda kind: kind if all(name in kind.ports for name in NAMED) else None, subject.stage
    ):
        package, folder, name = (str(effective_value(node, n, subject.live) or "") for n in NAMED)
        if package and folder and name:
            yield node, kind, (package, folder, name)


@rule("K18", "unknown-message")
def unknown_message(subject: LintSubject) -> Iterator[Problem]:
    """A generic node names an impossible message or service.

    Why: Isaac Sim logs that it does not exist or is not available in the ROS 2 environment, and
    nothing is sent or received. A package that ROS 2 Humble does not have may be somebody's own.

    Fix: give package, subfolder and name as `ros2 interface list` shows them, without an ending.

    Example: `inputs:messageName = "Float32.msg"`, or the package `geometry_msg`.
    """
    for node, kind, named in _naming(subject):
        why = (why_no_service if kind.role == "service" else why_no_message)(*named)
        if why:
            text = f"{'/'.join(named)} does not exist: {why}"
            yield Problem(node.path, text, property=NAMED[2], actual="/".join(named))


@rule("K19", "service-types")
def service_types(subject: LintSubject) -> Iterator[Problem]:
    """Nodes of one service have different types.

    Why: ROS 2 connects only clients and servers of one type. A response of another type than its
    request is written into the memory of a message that it is not.

    Fix: give all nodes of the service the same package and name.

    Example: the request is `std_srvs/srv/SetBool`, and its response `std_srvs/srv/Trigger`.
    """
    types = {
        node.path: (node, "/".join(named))
        for node, kind, named in _naming(subject)
        if kind.role == "service"
    }
    for wire in connections(subject.stage) if types else ():
        kind = wire.node.type
        if wire.source is None or kind is None or wire.port not in kind.ports or kind.services:
            continue  # a response has no name: it gets its server
        first, second = types.get(wire.source.path), types.get(wire.node.path)
        if wire.kind == "data" and first and second and first[1] != second[1]:
            yield _differ(second, first, "answers")
    for first, second in combinations(types.values(), 2):
        one, other = (_service(node, subject) for node, _ in (first, second))
        domains = [domain_of(node, subject.live, subject.platform) for node, _ in (first, second)]
        if one and one == other and first[1] != second[1] and are_surely_one(domains):
            yield _differ(second, first, f"has {one} in common with")


def _differ(second: tuple[Node, str], first: tuple[Node, str], does: str) -> Problem:
    (node, kind), (other, expected) = second, first
    return Problem(
        node.path,
        f"its type is {kind}, and it {does} {other.path}, which has {expected}",
        property=NAMED[2],
        expected=expected,
        actual=kind,
        related=(other.path,),
    )


def _service(node: Node, subject: LintSubject) -> str:
    """Return the full name of the service of a node, '' where it has none or a wire brings it."""
    port = next(iter(node.type.services if node.type is not None else ()), "")
    written = effective_value(node, port, subject.live) if port else None
    if not isinstance(written, str):
        return ""
    space = namespace_of(node, subject.stage, subject.live)
    return ros_name(space, written) or ""
