"""Rules about what the saved outputs show of topics: types, rates, messages, publishers, QoS."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lab3_usd.check.finding import Problem
from lab3_usd.check.in_short import in_short
from lab3_usd.check.registry import rule
from lab3_usd.check.subjects_lab import (
    Endpoint,
    EvidenceSubject,
    Message,
    Scalar,
    Shown,
    best,
)
from lab3_usd.spec.ros_spec import TopicSpec

_PLAY = "press Play, and look that the node which publishes it has its execution wire and context"


def _source(topic: TopicSpec) -> str:
    """Say what to do where nobody publishes a topic."""
    return topic.source or _PLAY


def _topics(subject: EvidenceSubject) -> list[TopicSpec]:
    return [topic for topic in subject.ros.topics.values() if topic.since <= subject.until]


@rule("E02", "topic-type-shown", scope="evidence")
def topic_type_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A topic has another message type than the table of J3, or did not exist.

    Why: a subscriber of the right type never hears a publisher of another; both stay silent.

    Fix: set the type of the publishing node in the graph, press Play, and save the output again.

    Example: `ros2 topic type /scan` says `sensor_msgs/msg/PointCloud2`.
    """
    for topic in _topics(subject):

        def judge(shown: Shown[tuple[str, ...]], topic: TopicSpec = topic) -> list[Problem]:
            if shown.fact == (topic.type,):
                return []
            actual = " and ".join(shown.fact) or "no type"
            message = f"{topic.name} has {actual}, expected {topic.type}"
            hint = None if shown.fact else _source(topic)
            return [Problem(shown.file, message, topic.name, topic.type, actual, "J3", hint=hint)]

        yield from best(subject.evidence.topic_type.get(topic.name, ()), judge)


@rule("E03", "topic-not-listed", scope="evidence", severity="warning")
def topic_not_listed(subject: EvidenceSubject) -> Iterator[Problem]:
    """Topics of the lab are in none of the topic lists.

    Why: the final list (J2) is taken while everything runs; what it lacks was not published.

    Fix: save `ros2 topic list` again while Isaac Sim plays and localization runs.

    Example: `/map` is missing, because the list was saved before the map server was started.
    """
    lists = subject.evidence.topic_list.get("", ())
    if not lists:
        return
    names = {name for shown in lists for name in shown.fact}
    missing = [t for t in _topics(subject) if not t.optional and t.name not in names]
    if len(missing) == 1:
        (topic,) = missing
        message = f"{topic.name} is not in the list of topics"
        yield Problem(
            lists[-1].file, message, topic.name, handout=topic.handout, hint=_source(topic)
        )
    elif missing:
        absent = ", ".join(topic.name for topic in missing)
        message = f"{len(missing)} topics are not in the list of topics; was it saved early?"
        yield Problem(lists[-1].file, message, expected=absent, handout="J2")


@rule("E04", "topic-rate", scope="evidence")
def topic_rate(subject: EvidenceSubject) -> Iterator[Problem]:
    """`ros2 topic hz` of a live stream shows no rate above zero.

    Why: the topic exists but no message arrives: Isaac Sim is stopped, or the execution wire of
    the publisher is missing.

    Fix: press Play, check the dashed wires of the graph, and measure again.

    Example: `WARNING: topic [/scan] does not appear to be published yet`.
    """
    for topic in _topics(subject):
        if topic.rate is None:
            continue

        def judge(shown: Shown[float], topic: TopicSpec = topic) -> list[Problem]:
            if shown.fact > 0:
                return []
            message = f"{topic.name} shows no rate, expected more than zero"
            hint = _source(topic)
            return [
                Problem(shown.file, message, topic.name, "> 0 Hz", "0 Hz", topic.rate, hint=hint)
            ]

        yield from best(subject.evidence.topic_hz.get(topic.name, ()), judge)


@rule("E05", "message-shown", scope="evidence")
def message_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A message carries another frame than the handout asks for, or none arrived.

    Why: RViz and Nav2 look the frame up in the TF tree; a scan in `sim_lidar` has no place there
    and is dropped.

    Fix: set the frame id of the publishing node, and echo one message again.

    Example: `header.frame_id` of `/scan` is `sim_lidar` instead of `base_scan`.
    """
    for topic in _topics(subject):

        def judge(shown: Shown[Message], topic: TopicSpec = topic) -> list[Problem]:
            if not shown.fact:
                message = f"no message of {topic.name} arrived"
                hint = _source(topic)
                return [Problem(shown.file, message, topic.name, handout=topic.handout, hint=hint)]
            return list(_differing(shown, topic, dict(topic.fields or {})))

        yield from best(subject.evidence.topic_echo.get(topic.name, ()), judge)


@rule("E06", "map-message", scope="evidence")
def map_message(subject: EvidenceSubject) -> Iterator[Problem]:
    """The published map has another resolution, size or origin than the handout's.

    Why: map_server publishes what it loaded: another file than the one handed in, or a changed
    one, and AMCL matches the scan with it.

    Fix: start localization with the path of the supplied map file (H2), and echo `/map` again.

    Example: `info.width` is 384 instead of 177.
    """
    for topic in _topics(subject):
        expected = {
            path: getattr(subject.facts, fact) for path, fact in (topic.map_fields or {}).items()
        }

        def judge(
            shown: Shown[Message],
            topic: TopicSpec = topic,
            expected: dict[str, Scalar] = expected,
        ) -> list[Problem]:
            return list(_differing(shown, topic, expected))

        yield from best(subject.evidence.topic_echo.get(topic.name, ()), judge)


def _differing(
    shown: Shown[Message], topic: TopicSpec, expected: dict[str, Scalar]
) -> Iterator[Problem]:
    """Compare the fields that a message shows; one that was cut away shows nothing."""
    for path, wanted in expected.items():
        actual = shown.fact.get(path, wanted)
        if not _same(actual, wanted):
            said = in_short(actual)
            message = f"{path} of {topic.name} is {said}, expected {wanted}"
            yield Problem(shown.file, message, topic.name, str(wanted), said, topic.handout)


def _same(actual: Scalar, wanted: Scalar) -> bool:
    if isinstance(actual, (int, float)) and isinstance(wanted, (int, float)):
        # A map's resolution is a float32 in the message.
        return math.isclose(actual, wanted, rel_tol=1e-6, abs_tol=1e-9)
    return actual == wanted


@rule("E07", "qos-durability", scope="evidence")
def qos_durability(subject: EvidenceSubject) -> Iterator[Problem]:
    """A publisher has another durability than the table of G6.

    Why: a subscriber that asks for transient local hears no volatile publisher at all; and a map
    that is not retained never reaches an RViz that was started later.

    Fix: leave `qosProfile` at its default in the graphs; `/map` comes from map_server, which needs
    no setting.

    Example: `/scan` is published transient local.
    """
    for topic in _topics(subject):
        if topic.durability is None:
            continue

        def judge(shown: Shown[tuple[Endpoint, ...]], topic: TopicSpec = topic) -> list[Problem]:
            wrong = [e for e in shown.fact if e.publishes and _differs(e, topic.durability or "")]
            return [
                Problem(
                    shown.file,
                    f"{each.node} publishes {topic.name} with durability {each.durability}, "
                    f"expected {topic.durability}",
                    topic.name,
                    topic.durability,
                    each.durability,
                    "G6",
                )
                for each in wrong
            ]

        yield from best(subject.evidence.topic_info.get(topic.name, ()), judge)


def _differs(endpoint: Endpoint, durability: str) -> bool:
    known = {"volatile", "transient_local"}
    return endpoint.durability in known and endpoint.durability != durability


@rule("E14", "topic-publishers", scope="evidence")
def topic_publishers(subject: EvidenceSubject) -> Iterator[Problem]:
    """A topic has no publisher, or two where one is right.

    Why: two sources of `/odom` or `/scan` disagree, and everything that listens jumps between
    them. Several publishers of `/tf` are normal.

    Fix: find the graph that publishes it again, often one made by a menu of Isaac Sim, and
    delete it.

    Example: `Publisher count: 2` for `/odom`.
    """
    for topic in _topics(subject):

        def judge(shown: Shown[tuple[Endpoint, ...]], topic: TopicSpec = topic) -> list[Problem]:
            publishers = [endpoint.node for endpoint in shown.fact if endpoint.publishes]
            most = topic.publishers if topic.publishers is not None else len(publishers)
            least = 0 if topic.optional or topic.subscribed else 1
            if least <= len(publishers) <= most:
                return []
            message = f"{topic.name} has {len(publishers)} publishers, expected {most or least}"
            found = Problem(
                shown.file,
                message,
                topic.name,
                handout="J7",
                related=tuple(node for node in publishers if node),
                actual=str(len(publishers)),
                hint=None if publishers else _source(topic),
            )
            return [found]

        yield from best(subject.evidence.topic_info.get(topic.name, ()), judge)
