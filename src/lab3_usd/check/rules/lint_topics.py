"""Rules about topics, and about the values and names of tokens, topics and frames."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.check.ros.clocks import CLOCK, Stamp, stamps
from lab3_usd.check.ros.contexts import Domain, are_surely_one, domain_of, may_meet
from lab3_usd.check.ros.running import LintSubject, effective_value
from lab3_usd.check.ros.topics import (
    KIND,
    PROFILE,
    TRANSFORMS,
    Endpoint,
    Qos,
    did_you_mean,
    endpoints,
    likely_name,
)
from lab3_usd.check.tf.trees import refused_namespaces, written_frames, written_topics
from lab3_usd.model.changes import Edit, SetValue
from lab3_usd.model.finding import Problem, Severity, display
from lab3_usd.model.stage import Node


def _running(subject: LintSubject, direction: str) -> list[Endpoint]:
    found = endpoints(subject.stage, subject.lab)
    return [
        endpoint
        for endpoint in found
        if endpoint.runs and endpoint.topic and endpoint.direction == direction
    ]


def _grave(*ends: Endpoint) -> Severity | None:
    """Return the severity of a fault between these, milder where one of them only may run."""
    is_sure = all(end.sure for end in ends) and are_surely_one(end.domain for end in ends)
    return None if is_sure else "warning"


@rule("K40", "two-publishers", scope="lint")
def two_publishers(subject: LintSubject) -> Iterator[Problem]:
    """A topic has two publishers.

    Why: subscribers get both streams mixed: two clocks make time jump back, two odometries make
    the robot jump. Only transforms may have several publishers, as those of a robot's `/tf`.

    Fix: delete the second publisher, most often a copy of the whole graph; or give each robot a
    namespace or topics of its own. A node that publishes two topics needs two names.

    Example: two robots publish their joints on `/joint_states`.
    """
    together: dict[tuple[str, str], list[Endpoint]] = {}
    for endpoint in _running(subject, "publishes"):
        is_tree = endpoint.topic in subject.lab.policy.tree_topics or endpoint.type == TRANSFORMS
        if not is_tree:
            key = (str(endpoint.topic), endpoint.domain.name)
            together.setdefault(key, []).append(endpoint)
    for (topic, _), (first, *others) in together.items():
        for other in others:
            same_type = None in (first.type, other.type) or first.type == other.type
            if same_type:  # of two types the rule of types speaks
                is_own = other.node.path == first.node.path
                yield Problem(
                    other.node.path,
                    f"{other.port} and {first.port} are both {topic}"
                    if is_own
                    else f"publishes {topic}, which {first.node.path} publishes as well",
                    property=other.port,
                    expected="a topic of its own" if is_own else "one publisher",
                    actual=topic,
                    related=() if is_own else (first.node.path,),
                    severity=_grave(first, other),
                )


@rule("K41", "two-types", scope="lint")
def two_types(subject: LintSubject) -> Iterator[Problem]:
    """A topic is used with two message types.

    Why: ROS 2 connects only publishers and subscribers of one type. `ros2 topic echo`, RViz and
    recordings fail where a name has two.

    Fix: give one of them another topic.

    Example: a camera's depth image and its depth points are both published on `/depth`.
    """
    first: dict[tuple[str, str], Endpoint] = {}
    ends = [*_running(subject, "publishes"), *_running(subject, "subscribes")]
    for endpoint in (end for end in ends if end.type is not None):
        known = first.setdefault((str(endpoint.topic), endpoint.domain.name), endpoint)
        if known.type != endpoint.type:
            yield Problem(
                endpoint.node.path,
                f"{endpoint.direction} {endpoint.topic} as {endpoint.type}, and "
                f"{known.node.path} {known.direction} it as {known.type}",
                property=endpoint.port,
                expected=known.type,
                actual=endpoint.type,
                related=(known.node.path,),
                severity=_grave(known, endpoint),
            )


@rule("K42", "invalid-qos", scope="lint", formerly="refused-profile")
def refused_profile(subject: LintSubject) -> Iterator[Problem]:
    """A QoS profile cannot be read.

    Why: a profile is JSON with eight fields, all of which Isaac Sim asks for: the three times with
    a point (`0.0`), the depth without one. With one missing, misspelt or written otherwise the node
    fails and neither publishes nor subscribes.

    Fix: clear QoS Profile, or wire it from a ROS2 QoS Profile node.

    Example: `inputs:qosProfile = '{"reliability": "bestEffort"}'`.
    """
    for endpoint in endpoints(subject.stage, subject.lab):
        written = endpoint.node.value(PROFILE)
        is_wired = bool(endpoint.node.sources(PROFILE))
        if endpoint.qos is None and isinstance(written, str) and written and not is_wired:
            yield Problem(
                endpoint.node.path,
                f"{PROFILE} is not a profile that Isaac Sim can read: {endpoint.topic} is not "
                "opened",
                property=PROFILE,
                expected="JSON with all eight fields, or nothing",
                actual=written,
            )


@rule("K43", "incompatible-qos", scope="lint", formerly="profiles-do-not-meet")
def profiles_do_not_meet(subject: LintSubject) -> Iterator[Problem]:
    """A publisher and a subscriber of one topic have QoS profiles that do not go together.

    Why: a subscriber that asks for reliable delivery gets nothing from a best-effort publisher, one
    that asks for stored messages nothing from a volatile publisher.

    Fix: give both the same profile.

    Example: `/cmd_vel` is published as Sensor Data and subscribed with the default.
    """
    publishers = _running(subject, "publishes")
    for taker in _running(subject, "subscribes"):
        for maker in publishers:
            is_one = (maker.topic, maker.domain.name) == (taker.topic, taker.domain.name)
            if is_one and maker.qos is not None and taker.qos is not None:
                mismatch = _mismatch(maker.qos, taker.qos)
                if mismatch:
                    yield Problem(
                        taker.node.path,
                        f"{taker.topic} does not arrive: {mismatch}",
                        property=PROFILE,
                        expected=str(maker.qos),
                        actual=str(taker.qos),
                        related=(maker.node.path,),
                        severity=_grave(maker, taker),
                    )


def _mismatch(maker: Qos, taker: Qos) -> str:
    if taker.reliability == "reliable" and maker.reliability == "best_effort":
        return "the subscriber asks for reliable, the publisher offers best effort"
    if taker.durability == "transient_local" and maker.durability == "volatile":
        return "the subscriber asks for transient local, the publisher offers volatile"
    return ""


@rule("K44", "two-clocks", scope="lint", severity="warning")
def two_clocks(subject: LintSubject) -> Iterator[Problem]:
    """The stage publishes the clock on several topics.

    Why: nodes that use simulation time listen to `/clock` alone. A clock on another topic, as in
    the namespace of a robot, serves only who was told of it.

    Fix: publish one clock, on `/clock`.

    Example: two robots publish `/robot_1/clock` and `/robot_2/clock`.
    """
    clocks = [end for end in _running(subject, "publishes") if end.type == CLOCK]
    for endpoint in clocks:
        others = [
            clock
            for clock in clocks
            if clock.topic != endpoint.topic and clock.domain.name == endpoint.domain.name
        ]
        if others and endpoint.topic != "/clock":
            yield Problem(
                endpoint.node.path,
                f"publishes a clock on {endpoint.topic}; another clock is on {others[0].topic}",
                property=endpoint.port,
                expected="/clock",
                actual=endpoint.topic,
                related=tuple(other.node.path for other in others),
            )


@rule("K45", "system-time", scope="lint", severity="warning")
def system_time(subject: LintSubject) -> Iterator[Problem]:
    """A message is stamped with the time of the computer, while others have simulation time.

    Why: the two clocks are decades apart. No transform has the time of the message, so that no
    node can place it.

    Fix: wire Time Stamp from Isaac Read Simulation Time, and switch Use System Time off.

    Example: `inputs:useSystemTime = 1` on a lidar helper, beside a `/clock` of simulation time.
    """
    every = list(stamps(subject))
    simulated = {stamp.domain.name: stamp for stamp in every[::-1] if stamp.clock == "simulation"}
    for stamp in every:
        other = simulated.get(stamp.domain.name)
        if other is not None and stamp.clock == "system":
            yield Problem(
                stamp.node.path,
                f"{stamp.topic} is stamped with system time, {other.topic} with simulation time",
                property=stamp.port,
                expected="simulation time",
                actual="system time",
                related=(other.node.path,),
            )


@rule(
    "K46",
    "stamps-restart",
    scope="lint",
    severity="note",
    counted=("time that restarts", "times that restart"),
)
def stamps_restart(subject: LintSubject) -> Iterator[Problem]:
    """Time restarts on Stop for some messages, and goes on for others.

    Why: after Stop and Play the messages that restart are older than the clock says, and are
    dropped or not placed until time has caught up.

    Fix: choose the same Reset On Stop for all nodes that read simulation time, and the same Reset
    Simulation Time On Stop for the helpers.

    Example: `/clock` has `resetOnStop = 0` while the lidar helper keeps its default, which is on.
    """
    simulated = [stamp for stamp in stamps(subject) if stamp.clock == "simulation"]
    leading: dict[str, Stamp] = {}  # by domain: the clock, else the first message
    for stamp in sorted(simulated, key=lambda stamp: not stamp.is_clock):
        leading.setdefault(stamp.domain.name, stamp)
    for stamp in simulated:
        first = leading[stamp.domain.name]
        if {stamp.restarts, first.restarts} == {True, False}:
            yield Problem(
                stamp.node.path,
                f"the time of {stamp.topic} {_restarts(stamp)} on Stop, that of {first.topic} "
                f"{_restarts(first)}",
                property=stamp.port,
                related=(first.node.path,),
            )


def _restarts(stamp: Stamp) -> str:
    return "restarts" if stamp.restarts else "continues"


@rule("K47", "no-clock", scope="lint", severity="warning")
def no_clock(subject: LintSubject) -> Iterator[Problem]:
    """Messages have simulation time, and nobody publishes the clock.

    Why: nodes that use simulation time wait forever for a `/clock`. Others compare the stamps,
    which begin near 0, with the time of the computer, and find no transform.

    Fix: add a ROS2 Publish Clock in the same domain, with its time from Isaac Read Simulation Time.

    Example: a graph with an odometry and transforms alone.
    """
    stamped: dict[Domain, list[Stamp]] = {}
    for stamp in stamps(subject):
        if stamp.clock == "simulation":
            stamped.setdefault(stamp.domain, []).append(stamp)
    clocks = [
        node
        for node in subject.live.values()
        if node.type is not None and node.type.message.get("") == CLOCK
    ]
    # A script or a node of an unknown type may send it; of one that is not in the scene, and of one
    # that never runs, other rules speak.
    is_known = (
        not (subject.stage.scripts or subject.stage.absent)
        and all(graph.active for graph in subject.graphs())
        and all(node.type is not None for node in subject.live.values())
    )
    for domain, simulated in stamped.items() if is_known else ():
        if not any(may_meet(domain, domain_of(clock, subject.live)) for clock in clocks):
            first, count = simulated[0], len(simulated)
            others = "" if count == 1 else f", as {count - 1} more"
            yield Problem(
                first.node.path,
                f"{first.topic} has simulation time{others}, and no /clock is published",
                expected="a publisher of /clock",
                related=tuple(dict.fromkeys(stamp.node.path for stamp in simulated[1:])),
                rests_on=next(iter(subject.stage.unresolved), None),
            )


@rule("K34", "value-type", scope="lint", formerly="value-of-another-type")
def value_of_another_type(subject: LintSubject) -> Iterator[Problem]:
    """A value is declared with a type that the port does not have.

    Why: Isaac Sim makes the port with its own type and leaves the value out, so that the default
    counts.

    Fix: delete the node, add it again and set the value in the Property panel.

    Example: `inputs:wheelRadius` written as a string by a script, although it is a double.

    Basis: ports have the types of Isaac Sim's source. What Kit makes of a value of another type
    is not public; the pairs that earlier releases saved are taken.
    """
    for node in subject.live.values():
        for name, state in node.ports.items():
            port = None if node.type is None else node.type.port(name)
            if port is None or state.value is None or port.is_union or port.is_target:
                continue
            if state.usd_type not in ("", port.usd_type, *_SAME.get(port.usd_type, ())):
                yield Problem(
                    node.path,
                    f"{name} has type {state.usd_type}, expected {port.usd_type}",
                    property=name,
                    expected=port.usd_type,
                    actual=state.usd_type,
                )


# Files of earlier releases declare these otherwise, and are read all the same.
_SAME = {
    "string": ("token",),
    "token": ("string",),
    "uint64": ("uint", "int", "int64"),
    "uint": ("int", "uint64"),
    "double": ("float",),
    "float": ("double",),
    "vector3d": ("double3",),
}


@rule("K35", "unknown-token", scope="lint", formerly="value-not-offered")
def value_not_offered(subject: LintSubject) -> Iterator[Problem]:
    """An input holds a token that it does not offer.

    Why: the node refuses the value with an error, or takes another one.

    Fix: choose one of the values that the Property panel offers.

    Example: `inputs:type = "depth_image"` on a ROS2 Camera Helper, which offers `depth`.
    """
    for node in subject.live.values():
        for name in node.ports:
            port = None if node.type is None else node.type.port(name)
            if port is None or not port.allowed:
                continue
            value = effective_value(node, name, subject.live)
            known = (*port.allowed, *(() if node.type is None else node.type.message))
            if isinstance(value, str) and value not in ("", port.default, *known):
                near = likely_name(value, port.allowed)
                other = _other_node(node, value, subject) if name == KIND else None
                expected = other or near or ", ".join(port.allowed)
                yield Problem(
                    node.path,
                    f"{name} is {display(value)}, which {subject.title(node)} does not offer"
                    f"{f'; {other} does it now' if other else did_you_mean(near)}",
                    property=name,
                    expected=expected,
                    actual=value,
                    hint=f"replace the node by a {other}" if other else None,
                    fix=_setting(node, name, expected if expected in port.allowed else ""),
                )


def _other_node(node: Node, kind: str, subject: LintSubject) -> str | None:
    """Return the title of the type of nodes that publishes this kind of messages now."""
    moved = None if node.type is None else subject.catalog.get(node.type.moved.get(kind, ""))
    return None if moved is None else moved.ui_name


def _setting(node: Node, name: str, value: str) -> tuple[Edit, ...]:
    """Return what gives an input the value that was likely meant; a connected one has none."""
    port = None if node.type is None else node.type.port(name)
    if port is None or not value or node.sources(name):
        return ()
    return (SetValue(node.path, name, port.usd_type, value),)


@rule("K37", "topic-name", scope="lint")
def topic_name(subject: LintSubject) -> Iterator[Problem]:
    """ROS 2 refuses the name of a topic or namespace, or the bridge changes that of a topic.

    Why: the bridge strips whatever is no letter or digit from both ends of a name, and ROS 2
    refuses what is left where it holds spaces, dashes or a digit first. A name that is refused
    gives no publisher; one that is changed gives a topic that nobody looks for.

    Fix: write letters, digits, underscores and slashes, a letter first.

    Example: `inputs:topicName = "camera-1/rgb image"`.
    """
    for name in written_topics(subject):
        if name.resolved is None:
            yield Problem(
                name.node.path,
                f"{name.port} is {display(name.written)}, which ROS 2 refuses"
                if name.written
                else f"{name.port} is empty: there is no topic",
                property=name.port,
                actual=name.written,
            )
        elif name.is_changed:
            yield Problem(
                name.node.path,
                f"{name.port} is {display(name.written)}, but the topic becomes {name.resolved}",
                property=name.port,
                expected=name.resolved,
                actual=name.written,
                severity="warning",
            )
    for node, namespace in refused_namespaces(subject):
        yield Problem(
            node.path,
            f"the namespace of its topics is {display(namespace)}, which ROS 2 refuses",
            expected="letters, digits, underscores and slashes, a letter first",
            actual=namespace,
        )


@rule("K38", "frame-name", scope="lint", severity="warning")
def frame_name(subject: LintSubject) -> Iterator[Problem]:
    """The name of a frame is empty, or begins with a slash.

    Why: tf2 refuses an empty name and one that begins with a slash: no transform is found for the
    message.

    Fix: write the name as in the TF tree, without a slash.

    Example: `inputs:frameId = "/base_scan"`.
    """
    for node, port, value in written_frames(subject):
        is_stripped = node.type is not None and node.type.tf is not None  # by tf2
        if not value or (value.startswith("/") and not is_stripped):
            fault = "is empty" if not value else f"is {display(value)}, which begins with a slash"
            yield Problem(
                node.path,
                f"{port} {fault}",
                property=port,
                expected=value.lstrip("/") or "the name of a frame",
                actual=value,
                fix=_setting(node, port, value.lstrip("/")),
            )
