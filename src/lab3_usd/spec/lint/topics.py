"""Topics that `ros.yaml`, Nav2's parameters or a text spell otherwise than the graphs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from lab3_usd.spec.files import ROS, SUBMISSION
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.fault import LabFault, nearest
from lab3_usd.spec.lint.graph_names import GraphTopic, graph_topics
from lab3_usd.spec.ros import FROM_THE_FIRST, NavigationSpec, TopicSpec

_ABOUT_TOPICS, _ABOUT_NODES = "topic_", "lifecycle"  # how the kinds of such commands begin
_NAME = re.compile(r"(?<!\S)/[A-Za-z_]\w*(?:/\w+)*")


def topic_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield every topic that is not the one of the graphs."""
    given = list(graph_topics(lab))
    for topic in lab.ros.topics.values():
        yield from _about_topic(lab, topic, given)
    for each in given:
        if each.name not in lab.ros.topics:
            message = f"'{each.name}' is missing, so that no saved output of it is judged"
            yield LabFault(ROS, "topics", message, each.place, "warning")
    if lab.checkpoints[lab.last].localization and lab.ros.navigation is not None:
        yield from _navigation(lab, lab.ros.navigation, given)
    yield from _commands(lab)
    for line in lab.submission.checklist:
        key = f"checklist: {line.section}: '{line.text}'"
        yield from misspelled(lab, line.text, SUBMISSION, key)


def _about_topic(lab: Lab, topic: TopicSpec, given: list[GraphTopic]) -> Iterator[LabFault]:
    key = f"topics: {topic.name}"
    ends = [each for each in given if each.is_subscribed == topic.subscribed]
    same = [each for each in ends if each.name == topic.name]
    if not same:
        if (topic.source is None and not topic.optional) or topic.subscribed:
            does = "subscribes to" if topic.subscribed else "publishes"
            message = f"no node of a graph {does} '{topic.name}'"
            yield LabFault(ROS, key, message, _likely(lab, topic, ends))
        return
    for each in same:
        if each.type is not None and each.type != topic.type:
            message = f"'type' is {topic.type}, but the graph's messages are {each.type}"
            yield LabFault(ROS, key, message, each.place)
    yield from _too_early(lab, topic, same)


def _too_early(lab: Lab, topic: TopicSpec, same: list[GraphTopic]) -> Iterator[LabFault]:
    """Yield that a topic is asked for before the graph that has it."""
    first = next(
        (
            (checkpoint.id, each)
            for checkpoint in lab.checkpoints.values()
            for each in same
            if each.graph in checkpoint.graphs
        ),
        None,
    )
    since = topic.since if topic.since != FROM_THE_FIRST else lab.first
    if first is None or since not in lab.checkpoints or not lab.is_after(first[0], since):
        return
    message = f"'from' is {since}, but the graph comes with checkpoint {first[0]}"
    yield LabFault(ROS, f"topics: {topic.name}", message, first[1].place)


def _likely(lab: Lab, topic: TopicSpec, ends: Iterable[GraphTopic]) -> str:
    """Return the place in the graphs where the topic has another name, as it seems."""
    free = [each for each in ends if each.name not in lab.ros.topics]
    alike = [each for each in free if each.type == topic.type]
    by_name = {each.name: each for each in alike or free}
    meant = nearest(topic.name, by_name) or next(iter(by_name if alike else ()), None)
    return f"{by_name[meant].place} is '{meant}'" if meant else ""


def _navigation(
    lab: Lab, navigation: NavigationSpec, given: list[GraphTopic]
) -> Iterator[LabFault]:
    """Yield the topics of Nav2's parameters that nobody has."""
    wanted = {
        "scan_topic": (navigation.scan_topic, False),
        "odom_topic": (navigation.odom_topic, False),
        "velocity_topic": (navigation.velocity_topic, True),
    }
    for key, (name, is_subscribed) in wanted.items():
        ends = {each.name: each for each in given if each.is_subscribed == is_subscribed}
        if name not in ends:
            does = "subscribes to" if is_subscribed else "publishes"
            message = f"no node of a graph {does} '{name}'"
            meant = nearest(name, ends)
            other = f"{ends[meant].place} is '{meant}'" if meant else f"{ROS}: topics"
            yield LabFault(ROS, f"navigation: {key}", message, other)
    if navigation.map_topic not in lab.ros.topics:
        message = f"'{navigation.map_topic}' is none of the topics"
        yield LabFault(ROS, "navigation: map_topic", message, f"{ROS}: topics")


def _commands(lab: Lab) -> Iterator[LabFault]:
    """Yield the commands about topics and nodes that the lab does not have."""
    topics, nodes = _known_topics(lab), lab.ros.lifecycle.nodes
    for number, command in enumerate(lab.ros.commands, start=1):
        kind, name = command.kind.name, command.of
        key = f"command {number} ({kind}): of"
        if kind.startswith(_ABOUT_TOPICS) and name and name not in topics:
            yield LabFault(ROS, key, f"'{name}' is none of the topics", f"{ROS}: topics")
        if kind == _ABOUT_NODES and name not in nodes:
            message = f"'{name}' is none of the lifecycle nodes"
            yield LabFault(ROS, key, message, f"{ROS}: lifecycle: nodes")


def _known_topics(lab: Lab) -> set[str]:
    goal = lab.ros.goal
    of_goal = () if goal is None else (goal.status, goal.pose, goal.robot)
    return {*lab.ros.topics, *lab.ros.system.topics, *of_goal}


def misspelled(lab: Lab, text: str, file: str, key: str) -> Iterator[LabFault]:
    """Yield the topics in a text that are nearly, but not quite, topics of the lab."""
    navigation = lab.ros.navigation
    known = _known_topics(lab) | set(() if navigation is None else navigation.rviz.values())
    for name in _NAME.findall(text):
        meant = nearest(name, known)
        if name not in known and meant:
            message = f"'{name}' is no topic, '{meant}' is"
            yield LabFault(file, key, message, f"{ROS}: topics: {meant}")
