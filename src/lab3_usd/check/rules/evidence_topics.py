"""Rules about what the saved outputs show of topics: types, rates, messages, publishers, QoS."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from lab3_usd.check.registry import rule
from lab3_usd.check.rules.files import is_equal, shortened
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder import (
    EvidenceSubject,
    Fact,
    ListedEndpoint,
    Message,
    Observation,
    Outputs,
    Scalar,
    judge_best,
)
from lab3_usd.spec.ros import MapFacts, TopicSpec

_PLAY = "press Play, and check the execution wire and the context of the node that publishes it"
_DURABILITIES = ("volatile", "transient_local")


def _source(topic: TopicSpec) -> str:
    """Return the repair for a topic without a publisher."""
    return topic.source or _PLAY


def _topics(subject: EvidenceSubject) -> list[TopicSpec]:
    return [topic for topic in subject.ros.topics.values() if subject.asks_from(topic.since)]


def _judged(
    subject: EvidenceSubject,
    outputs: Outputs[Fact],
    judge: Callable[[Observation[Fact], TopicSpec], Iterator[Problem]],
) -> Iterator[Problem]:
    """Judge the outputs of one command for each topic of the lab."""
    for topic in _topics(subject):

        def judge_one(shown: Observation[Fact], topic: TopicSpec = topic) -> list[Problem]:
            return list(judge(shown, topic))

        yield from judge_best(outputs.get(topic.name, ()), judge_one)


@rule("E02", "topic-type-shown", scope="evidence")
def topic_type_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A topic has another message type, or did not exist.

    Why: a subscriber never receives messages from a publisher of another type. Neither reports an
    error.

    Fix: set the type of the publishing node in the graph, press Play, and save the output again.

    Example: `ros2 topic type {scan}` says `sensor_msgs/msg/PointCloud2`.
    """
    yield from _judged(subject, subject.evidence.topic_type, _wrong_type)


def _wrong_type(shown: Observation[tuple[str, ...]], topic: TopicSpec) -> Iterator[Problem]:
    if shown.fact != (topic.type,):
        actual = " and ".join(shown.fact) or "no type"
        message = f"{topic.name} has {actual}, expected {topic.type}"
        hint = None if shown.fact else _source(topic)
        yield Problem(shown.file, message, topic.name, topic.type, actual, hint=hint)


@rule("E03", "topic-not-listed", scope="evidence", severity="warning")
def topic_not_listed(subject: EvidenceSubject) -> Iterator[Problem]:
    """A topic of the lab is in no saved topic list.

    Why: the final list is saved while everything runs. A topic that is not in it was not published.

    Fix: save `ros2 topic list` again while the whole system runs.

    Example: `{scan}` is missing, because the list was saved before Play was pressed.
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
        yield Problem(lists[-1].file, message, expected=absent)


@rule("E04", "topic-rate", scope="evidence")
def topic_rate(subject: EvidenceSubject) -> Iterator[Problem]:
    """`ros2 topic hz` shows no rate above zero.

    Why: the topic exists but no message arrives: Isaac Sim is stopped, or the execution connection
    of the publisher is missing.

    Fix: press Play, check the execution connections of the graph, and measure again.

    Example: `WARNING: topic [{scan}] does not appear to be published yet`.
    """
    yield from _judged(subject, subject.evidence.topic_hz, _without_rate)


def _without_rate(shown: Observation[float], topic: TopicSpec) -> Iterator[Problem]:
    if topic.rate is not None and not shown.fact > 0:
        message = f"{topic.name} shows no rate, expected more than zero"
        hint = _source(topic)
        yield Problem(shown.file, message, topic.name, "> 0 Hz", "0 Hz", topic.rate, hint=hint)


@rule("E05", "message-shown", scope="evidence")
def message_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A message has another frame, or no message arrived.

    Why: {navigation?}RViz and Nav2 look{else}a subscriber looks{/} up the frame in the TF tree. A
    message in a frame that is not in the tree is dropped.

    Fix: set the frame id of the publishing node, and echo one message again.

    Example: `header.frame_id` of `{scan}` is the default of its node instead of `{lidar_link}`.
    """
    yield from _judged(subject, subject.evidence.topic_echo, _wrong_message)


def _wrong_message(shown: Observation[Message], topic: TopicSpec) -> Iterator[Problem]:
    if shown.fact:
        yield from _differing(shown, topic, topic.fields or {})
        return
    message = f"no message of {topic.name} arrived"
    yield Problem(shown.file, message, topic.name, handout=topic.handout, hint=_source(topic))


@rule("E06", "map-message", scope="evidence", needs="map")
def map_message(subject: EvidenceSubject) -> Iterator[Problem]:
    """The published map has another resolution, size or origin.

    Why: map_server loaded another file than the one handed in, or a changed one, and AMCL matches
    the scan with it.

    Fix: start localization with the path of the supplied map file, and echo `{map_topic}` again.

    Example: `info.width` is 384 instead of 177.
    """
    if subject.facts is None:
        return
    judge = partial(_wrong_map, subject.facts)
    yield from _judged(subject, subject.evidence.topic_echo, judge)


def _wrong_map(facts: MapFacts, shown: Observation[Message], topic: TopicSpec) -> Iterator[Problem]:
    expected = {path: getattr(facts, fact) for path, fact in (topic.map_fields or {}).items()}
    yield from _differing(shown, topic, expected)


def _differing(
    shown: Observation[Message], topic: TopicSpec, expected: Mapping[str, Scalar]
) -> Iterator[Problem]:
    """Compare the fields that a message shows; one that was cut away shows nothing."""
    for path, wanted in expected.items():
        actual = shown.fact.get(path, wanted)
        if not is_equal(actual, wanted):  # a map's resolution is a float32 in the message
            actual_text = shortened(actual)
            message = f"{path} of {topic.name} is {actual_text}, expected {wanted}"
            yield Problem(shown.file, message, topic.name, str(wanted), actual_text, topic.handout)


@rule("E07", "qos-durability", scope="evidence")
def qos_durability(subject: EvidenceSubject) -> Iterator[Problem]:
    """A publisher has another durability.

    Why: a subscriber that requests transient local receives nothing from a volatile publisher.
    {map?}A volatile map never reaches an RViz that was started later.{/}

    Fix: leave `qosProfile` at its default in the graphs. {map?}`{map_topic}` comes from map_server,
    which needs no setting.{/}

    Example: `{scan}` is published transient local.
    """
    yield from _judged(subject, subject.evidence.topic_info, _wrong_durability)


def _wrong_durability(
    shown: Observation[tuple[ListedEndpoint, ...]], topic: TopicSpec
) -> Iterator[Problem]:
    wanted = topic.durability
    for endpoint in shown.fact if wanted is not None else ():
        actual = endpoint.durability
        if endpoint.publishes and actual in _DURABILITIES and actual != wanted:
            message = f"{endpoint.node} publishes {topic.name} with durability {actual}, "
            message += f"expected {wanted}"
            yield Problem(shown.file, message, topic.name, wanted, actual)


@rule("E14", "topic-publishers", scope="evidence")
def topic_publishers(subject: EvidenceSubject) -> Iterator[Problem]:
    """A topic has no publisher, or more than one.

    Why: two sources disagree, and subscribers jump between them. Several publishers of `/tf` are
    normal.

    Fix: find the second graph that publishes it and delete it. Often a menu of Isaac Sim created
    it.

    Example: `Publisher count: 2` for `{scan}`.
    """
    yield from _judged(subject, subject.evidence.topic_info, _wrong_publishers)


def _wrong_publishers(
    shown: Observation[tuple[ListedEndpoint, ...]], topic: TopicSpec
) -> Iterator[Problem]:
    publishers = [endpoint.node for endpoint in shown.fact if endpoint.publishes]
    most = topic.publishers if topic.publishers is not None else len(publishers)
    least = 0 if topic.optional or topic.subscribed else 1
    if not least <= len(publishers) <= most:
        yield Problem(
            shown.file,
            f"{topic.name} has {len(publishers)} publishers, expected {most or least}",
            topic.name,
            related=tuple(node for node in publishers if node),
            actual=str(len(publishers)),
            hint=None if publishers else _source(topic),
        )
