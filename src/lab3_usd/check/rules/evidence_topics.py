"""Rules about what the saved outputs show of topics: types, rates, messages, publishers, QoS."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from lab3_usd.check.registry import rule
from lab3_usd.check.rules.files import is_equal, shortened
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder import (
    ABOVE_ZERO,
    SHOWN,
    EvidenceSubject,
    Fact,
    ListedEndpoint,
    Message,
    Observation,
    Outputs,
    Scalar,
    judge_best,
)
from lab3_usd.spec.ros import TopicSpec

_PLAY = "press Play, and check the execution wire and the context of the node that publishes it"
_DURABILITIES = ("volatile", "transient_local")
_MANY = 100  # values of a list, of which `ros2 topic echo` prints the first 128
_ENDS = 2  # the first and the last angle of a scan
_WHOLE = 6.1  # radians of a circle, less a step or two


def _source(topic: TopicSpec) -> str:
    """Return the repair for a topic without a publisher."""
    return topic.source or _PLAY


def _topics(subject: EvidenceSubject) -> list[TopicSpec]:
    return [topic for topic in subject.ros.topics.values() if subject.asks_from(topic.since)]


def _judged(
    subject: EvidenceSubject,
    outputs: Outputs[Fact],
    judge: Callable[[TopicSpec, Observation[Fact]], Iterator[Problem]],
) -> Iterator[Problem]:
    """Judge the outputs of one command for each topic of the lab."""
    for topic in _topics(subject):
        yield from judge_best(outputs.get(topic.name, ()), partial(judge, topic))


@rule("E02", "topic-type-shown", scope="evidence")
def topic_type_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A topic has another message type, or did not exist.

    Why: a subscriber never receives messages from a publisher of another type. Neither reports an
    error.

    Fix: set the type of the publishing node in the graph, press Play, and save the output again.

    Example: `ros2 topic type {scan}` says `sensor_msgs/msg/PointCloud2`.
    """
    told = set()
    for problem in _judged(subject, subject.evidence.topic_type, _wrong_type):
        told.add(problem.property)
        yield problem
    listed = _judged(subject, subject.evidence.listed_type, _wrong_type)
    yield from (problem for problem in listed if problem.property not in told)


def _wrong_type(topic: TopicSpec, shown: Observation[tuple[str, ...]]) -> Iterator[Problem]:
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
    if missing:
        first = missing[0]
        topics = [topic.name for topic in missing]
        yield not_listed(lists[-1].file, "topics", topics, first.handout, _source(first))


def not_listed(
    file: str, what: str, names: list[str], handout: str | None, hint: str | None = None
) -> Problem:
    """Return what a saved list lacks; of many, it was most likely saved too early."""
    if len(names) == 1:
        message = f"{names[0]} is not in the list of {what}"
        return Problem(file, message, names[0], handout=handout, hint=hint)
    message = f"{len(names)} {what} are not in the list of {what}; was it saved early?"
    return Problem(file, message, expected=", ".join(names))


@rule("E04", "topic-rate", scope="evidence")
def topic_rate(subject: EvidenceSubject) -> Iterator[Problem]:
    """`ros2 topic hz` shows no rate above zero.

    Why: the topic exists but no message arrives: Isaac Sim is stopped, or the execution connection
    of the publisher is missing.

    Fix: press Play, check the execution connections of the graph, and measure again.

    Example: `WARNING: topic [{scan}] does not appear to be published yet`.
    """
    yield from _judged(subject, subject.evidence.topic_hz, _without_rate)


def _without_rate(topic: TopicSpec, shown: Observation[float]) -> Iterator[Problem]:
    if topic.rate is not None and not shown.fact > 0:
        message = f"{topic.name} shows no rate, expected more than zero"
        hint = _source(topic)
        yield Problem(shown.file, message, topic.name, "> 0 Hz", "0 Hz", topic.rate, hint=hint)


@rule("E05", "message-shown", scope="evidence")
def message_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A message has another frame, size or content, or no message arrived.

    Why: {navigation?}RViz and Nav2 look{else}a subscriber looks{/} up the frame in the TF tree. A
    message in a frame that is not in the tree is dropped, as is one whose time stays 0.{lidar?} A
    scan without a distance, or of a part of the circle, shows no walls.{/}

    Fix: set the frame id, the size or the time stamp of the publishing node, and echo one message
    again.

    Example: `header.frame_id` of `{scan}` is the default of its node instead of `{lidar_link}`.
    """
    yield from _judged(subject, subject.evidence.topic_echo, _wrong_message)


def _wrong_message(topic: TopicSpec, shown: Observation[Message]) -> Iterator[Problem]:
    if shown.fact:
        yield from _differing(topic, shown, {**(topic.fields or {}), **topic.content})
        yield from _hollow(topic, shown)
        return
    message = f"no message of {topic.name} arrived"
    yield Problem(shown.file, message, topic.name, handout=topic.handout, hint=_source(topic))


def _hollow(topic: TopicSpec, shown: Observation[Message]) -> Iterator[Problem]:
    """Yield a time that stands at 0, a part of a circle, and lists without a measured value.

    A field that was cut away shows nothing.
    """
    fact, faults = shown.fact, list[tuple[str, str, str]]()
    times = [fact.get(path) for path in topic.time]
    if times and all(time == 0 for time in times):
        faults.append((topic.time[0].rpartition(".")[0], "0", "a time above 0"))
    angles = [a for path in topic.circle if isinstance(a := fact.get(path), (int, float))]
    if len(angles) == len(topic.circle) == _ENDS and angles[1] - angles[0] < _WHOLE:
        covered = f"{math.degrees(angles[1] - angles[0]):.0f} degrees"
        faults.append((" to ".join(topic.circle), covered, "the whole circle"))
    for name in topic.measured:
        count, positive = fact.get(f"{name}.{SHOWN}"), fact.get(f"{name}.{ABOVE_ZERO}")
        is_enough = isinstance(count, int) and (count == 0 or count >= _MANY)
        if is_enough and not positive:
            actual = f"at most 0 in all {count} values" if count else "empty"
            faults.append((name, actual, "distances above 0"))
    for path, actual, expected in faults:
        message = f"{path} of {topic.name} is {actual}, expected {expected}"
        yield Problem(shown.file, message, topic.name, expected, actual, topic.handout)


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
    facts = subject.facts

    def wrong_map(topic: TopicSpec, shown: Observation[Message]) -> Iterator[Problem]:
        expected = {path: getattr(facts, fact) for path, fact in (topic.map_fields or {}).items()}
        return _differing(topic, shown, expected)

    yield from _judged(subject, subject.evidence.topic_echo, wrong_map)


def _differing(
    topic: TopicSpec, shown: Observation[Message], expected: Mapping[str, Scalar]
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
    topic: TopicSpec, shown: Observation[tuple[ListedEndpoint, ...]]
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
    """A topic has no publisher, or more than one, or nobody subscribes to a command.

    Why: two sources disagree, and subscribers jump between them. Several publishers of `/tf` are
    normal. Commands to which nothing subscribes move no robot.

    Fix: find the second graph that publishes it and delete it. Often a menu of Isaac Sim created
    it.

    Example: `Publisher count: 2` for `{scan}`.
    """
    yield from _judged(subject, subject.evidence.topic_info, _wrong_publishers)
    yield from _judged(subject, subject.evidence.topic_hearers, _without_hearer)


def _without_hearer(topic: TopicSpec, shown: Observation[int]) -> Iterator[Problem]:
    if topic.subscribed and not shown.fact:
        message = f"{topic.name} has no subscription, expected that of the lab's graph"
        yield Problem(shown.file, message, topic.name, "1", "0", topic.handout, hint=_source(topic))


def _wrong_publishers(
    topic: TopicSpec, shown: Observation[tuple[ListedEndpoint, ...]]
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
