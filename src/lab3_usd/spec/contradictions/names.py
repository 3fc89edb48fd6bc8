"""Topics and frames of a lab that its graphs, `ros.yaml` and texts spell differently."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Literal

from msgspec import Struct

from lab3_usd.isaac.node_types import INPUT, KIND
from lab3_usd.isaac.topics import (
    STATIC,
    TRANSFORMS,
    frame_ports,
    product_input,
    resolved_topic,
    topic_switch,
)
from lab3_usd.isaac.values import Value
from lab3_usd.spec.graph import GraphSpec, NodeSpec
from lab3_usd.spec.lab import CHECKPOINTS, ROS, SCENE, SUBMISSION, Lab
from lab3_usd.spec.ros import FROM_THE_FIRST, NavigationSpec, TopicSpec
from lab3_usd.spec.scene import stands_within
from lab3_usd.spec.submission import example_of


class LabFault(Struct, frozen=True):
    """One thing that is wrong in the description of a lab.

    `key` leads to the value in `file`, `other` is the place that it contradicts. With an error the
    lab is refused; a warning says what is left out.
    """

    file: str
    key: str
    message: str
    other: str = ""
    severity: Literal["error", "warning"] = "error"

    @property
    def place(self) -> str:
        """What the line and column in `file` are found by."""
        return f"{self.file}: {self.key}: {self.message}"

    def __str__(self) -> str:
        """Write the fault in one line."""
        other = f" ({self.other})" if self.other else ""
        return f"{self.place}{other}"


def nearest_name(name: str, names: Iterable[str]) -> str | None:
    """Return the known name that was likely meant, None where none is like it."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(name, tuple(names), 1)), None)


def likely(name: str, names: Iterable[str]) -> str:
    """Return the end of a sentence about an unknown name: which one was likely meant."""
    meant = nearest_name(name, names)
    return f", '{meant}' is" if meant else ""


class GraphTopic(Struct, frozen=True):
    """A topic of one node; `type` is its message type, None where the spec does not say.

    `frames` are those that a message names: of its header, then its child's; '' where a wire says.
    """

    name: str
    type: str | None
    is_subscribed: bool
    graph: str
    role: str
    place: str
    frames: tuple[str, ...] = ()


class GraphFrame(Struct, frozen=True):
    """A transform that one node gives, or a frame that it only names (`parent` is None then)."""

    parent: str | None
    child: str
    file: str
    key: str

    @property
    def place(self) -> str:
        """File and key."""
        return f"{self.file}: {self.key}"


def file_of(graph: GraphSpec) -> str:
    """Name the file of a graph."""
    return f"{graph.name}.yaml"


def spec_value(node: NodeSpec, port: str) -> Value | None:
    """Return what an input has by the spec: the value set there, else the default."""
    value = next((setting.value for setting in node.settings if setting.port == port), None)
    if value is not None:
        return value
    declared = node.type.port(port)
    return None if declared is None else declared.default


def graph_topics(lab: Lab) -> Iterator[GraphTopic]:
    """Yield the topics that the graphs publish and subscribe."""
    for graph, node, port in _topic_ports(lab):
        topic = _topic(lab, graph, node, port)
        if topic:
            message = node.type.message
            yield GraphTopic(
                name=topic,
                type=message.get("") or message.get(str(spec_value(node, KIND))),
                is_subscribed=node.type.role == "subscriber",
                graph=graph.name,
                role=node.role,
                place=f"{file_of(graph)}: {node.role}: {_short(port)}",
                frames=tuple(
                    ""
                    if (node.role, of_frame) in graph.wired_inputs
                    else str(spec_value(node, of_frame) or "")
                    for of_frame in frame_ports(node.type, port)
                ),
            )


@lru_cache(maxsize=64)
def transform_topics(lab: Lab) -> frozenset[str]:
    """Return the topics of the lab's transforms: those of its graphs, else those of tf2 itself."""
    topics = {topic.name for topic in graph_topics(lab) if topic.type == TRANSFORMS}
    moving = {topic.removesuffix(STATIC) for topic in topics}
    twins = {f"{topic}{STATIC}" for topic in moving}
    return frozenset(moving | twins or lab.platform.ros.tree_topics)


def _topic_ports(lab: Lab) -> Iterator[tuple[GraphSpec, NodeSpec, str]]:
    """Yield the inputs that name topics in use: the second of a pair is where it gets an image."""
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            for port in node.type.topics if node.type.role else ():
                product = product_input(port)
                is_first = port == node.type.topics[0]
                is_wired = (node.role, product) in graph.wired_inputs
                if is_first or product not in node.type.ports or is_wired:
                    yield graph, node, port


def _topic(lab: Lab, graph: GraphSpec, node: NodeSpec, port: str) -> str:
    """Return the name of a topic, '' where it is switched off or has none."""
    switch = topic_switch(port)
    if switch in node.type.ports and spec_value(node, switch) is not True:
        return ""
    namespace = spec_value(node, f"{INPUT}{lab.platform.ros.namespace}") or _namespace(
        lab, graph, node
    )
    return resolved_topic(str(spec_value(node, port) or ""), str(namespace))


def _namespace(lab: Lab, graph: GraphSpec, node: NodeSpec) -> str:
    """Return the namespace that prims give to a node, as Isaac Sim joins them.

    They stand above the node, above the sensor of a helper; of a TF publisher the outermost counts.
    """
    prims = graph.named_prims(graph.behind(node.role))
    sensors = (sensor.path for sensor in lab.sensors.values() if sensor.path in prims)
    is_helper = any(product_input(port) in node.type.ports for port in node.type.topics)
    place = next(sensors, "") if is_helper else ""
    place = place or f"{graph.path}/{node.role}"
    above = [
        name for path, name in sorted(lab.scene.namespaces.items()) if stands_within(place, path)
    ]
    return "/".join(above[:1] if node.type.tf is not None else above)


def _short(port: str) -> str:
    return port.partition(":")[2]


def graph_frames(lab: Lab) -> Iterator[GraphFrame]:
    """Yield the transforms that the graphs publish."""
    for graph in lab.graphs.values():
        for node in graph.nodes.values():
            tf = node.type.tf
            if tf is None:
                continue
            if tf.names:
                parent, child = (str(spec_value(node, port) or "") for port in tf.names)
                key = f"{node.role}: {_short(tf.names[1])}"
                yield GraphFrame(parent, child, file_of(graph), key)
            if tf.prims:
                yield from _frames_of_prims(lab, graph, node, tf.prims)


def _frames_of_prims(
    lab: Lab, graph: GraphSpec, node: NodeSpec, ports: tuple[str, ...]
) -> Iterator[GraphFrame]:
    targets = {target.port: target.prims for target in node.targets}
    parents = (lab.frame_of(path) for path in targets.get(ports[0], ()))
    above = next(parents, lab.platform.world_frame)
    links = {robot.path: robot.link_paths for robot in lab.scene.robots}
    for path in targets.get(ports[1], ()):
        # The root of an articulation stands for its links.
        for name in map(lab.frame_of, links.get(path) or (path,)):
            if name != above:
                key = f"{node.role}: {_short(ports[1])}"
                yield GraphFrame(above, name, file_of(graph), key)


def named_frames(lab: Lab) -> Iterator[GraphFrame]:
    """Yield the frames that messages of the graphs name."""
    for graph, node, topic in _topic_ports(lab):
        for port in frame_ports(node.type, topic):
            frame = str(spec_value(node, port) or "")
            if frame:
                yield GraphFrame(None, frame, file_of(graph), f"{node.role}: {_short(port)}")


TREE = "frames: edges"
FRAME_FIELDS = ("header.frame_id", "child_frame_id")
_FRAME_COMMAND = "tf2_echo"


def frame_contradictions(lab: Lab) -> Iterator[LabFault]:
    """Yield what contradicts the TF tree, where a checkpoint asks for it."""
    if not any(point.frames for point in lab.checkpoints.values()):
        return
    given = list(graph_frames(lab))
    yield from _double_parents(lab)
    yield from _misplaced_localization(lab)
    yield from _forbidden(lab, given)
    yield from _too_early_frames(lab, given)
    yield from _unpublished(lab, given)
    localization = lab.frames.localization
    edges = (*lab.frames.edges, *(() if localization is None else (localization.edge,)))
    tree = dict.fromkeys(frame for edge in edges for frame in edge)  # in the order of the file
    named = [(frame.file, frame.key, frame.child) for frame in (*given, *named_frames(lab))]
    for file, key, frame in (*named, *_references(lab)):
        if frame not in tree:
            message = f"'{frame}' is not a frame of the tree{likely(frame, tree)}"
            yield LabFault(file, key, message, f"{CHECKPOINTS}: {TREE}")


def _double_parents(lab: Lab) -> Iterator[LabFault]:
    for tree in lab.frames.each:
        parents: dict[str, str] = {}
        for parent, child in tree.edges:
            key = f"{TREE}: {parent} -> {child}"
            if parent == child:
                yield LabFault(CHECKPOINTS, key, f"'{child}' is its own parent")
            elif parents.setdefault(child, parent) != parent:
                message = f"'{child}' has two parents, '{parents[child]}' and '{parent}'"
                other = f"{CHECKPOINTS}: {TREE}: {parents[child]} -> {child}"
                yield LabFault(CHECKPOINTS, key, message, other)
            if lab.frames.is_forbidden((parent, child)):
                other = f"{CHECKPOINTS}: frames: forbidden"
                yield LabFault(CHECKPOINTS, key, "is required and forbidden", other)


def _forbidden(lab: Lab, given: list[GraphFrame]) -> Iterator[LabFault]:
    """Yield the transforms of graphs that place a frame that nothing may place."""
    for frame in given:
        is_wrong = lab.frames.is_forbidden((frame.parent or "", frame.child))
        if is_wrong or frame.child in lab.frames.guarded:
            message = f"publishes {frame.parent} -> {frame.child}, which nothing may"
            other = f"{CHECKPOINTS}: frames: forbidden"
            if frame.child in lab.frames.reserved:
                other = f"{CHECKPOINTS}: frames: localization"
            yield LabFault(frame.file, frame.key, message, other)


def _too_early_frames(lab: Lab, given: list[GraphFrame]) -> Iterator[LabFault]:
    """Yield that the tree is asked for before any graph that publishes a part of it."""
    first = next(point for point in lab.checkpoints.values() if point.frames)
    makers = {frame.child: frame for frame in reversed(given)}
    asked = [child for _, child in lab.frames.edges if child in makers]
    if asked and first.unsent.issuperset(asked):
        message = f"asks for the frame '{asked[0]}', which a later checkpoint publishes"
        key = f"checkpoints: '{lab.key_of(first.id)}': adds: frames"
        yield LabFault(CHECKPOINTS, key, message, makers[asked[0]].place)


def _misplaced_localization(lab: Lab) -> Iterator[LabFault]:
    """Yield that localization places a frame that is not there, or has a parent already."""
    localization = lab.frames.localization
    if localization is None or not lab.frames.edges:
        return
    (above, root), key = localization.edge, "frames: localization: edge"
    parents = {child: parent for parent, child in lab.frames.edges}
    frames = [frame for edge in lab.frames.edges for frame in edge]
    if root not in frames:
        message = f"'{root}' is not a frame of the tree{likely(root, frames)}"
        yield LabFault(CHECKPOINTS, key, message, f"{CHECKPOINTS}: {TREE}")
    elif parents.get(root, above) != above:
        parent = parents[root]
        message = f"'{root}' has another parent, '{parent}'"
        yield LabFault(CHECKPOINTS, key, message, f"{CHECKPOINTS}: {TREE}: {parent} -> {root}")


def _unpublished(lab: Lab, given: list[GraphFrame]) -> Iterator[LabFault]:
    """Yield the transforms of the tree that no node of a graph gives."""
    published = {frame.child for frame in given}
    for parent, child in lab.frames.edges:
        if parent == child:
            continue
        key = f"{TREE}: {parent} -> {child}"
        makers = [graph_frame for graph_frame in given if graph_frame.child == child]
        if not makers:
            message = f"no node of a graph publishes the frame '{child}'"
            places = ", ".join(dict.fromkeys(frame.place for frame in given))
            nobody = "no graph has a node that does"
            published_by = f"frames are published by {places}" if places else nobody
            yield LabFault(CHECKPOINTS, key, message, published_by)
        elif all(maker.parent != parent for maker in makers) and parent not in published:
            message = f"the graphs publish '{child}' below '{makers[0].parent}'"
            yield LabFault(CHECKPOINTS, key, message, makers[0].place)


def _references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    """Yield file, key and frame of everything beside the graphs that names one."""
    frames = lab.frames
    for name in frames.deeper:
        yield CHECKPOINTS, "frames: deeper_under", name
    for forbidden in frames.forbidden_transforms:
        yield CHECKPOINTS, "frames: forbidden: child", forbidden.child
    for name in () if frames.localization is None else frames.localization.chain:
        yield CHECKPOINTS, "frames: localization: chain", name
    for robot in lab.scene.robots:
        if robot.base_frame:
            yield SCENE, f"{robot.key}: base_frame", lab.frame_of(robot.base)
    yield from _ros_references(lab)


def _ros_references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    for topic in lab.ros.topics.values():
        for field, value in (topic.fields or {}).items():
            if field in FRAME_FIELDS:
                yield ROS, f"topics: {topic.name}: fields: {field}", value
    navigation = lab.ros.navigation if lab.checkpoints[lab.last].localization else None
    for parameter in () if navigation is None else navigation.frames:
        yield ROS, f"navigation: frames: {parameter.node}.{parameter.name}", parameter.frame
    for number, command in enumerate(lab.ros.commands, start=1):
        if command.kind.name == _FRAME_COMMAND:
            for key, name in (("of", command.of), ("to", command.to)):
                yield ROS, f"command {number} ({command.kind.name}): {key}", name


_ABOUT_TOPICS, _ABOUT_NODES = "topic_", "lifecycle"  # how the kinds of such commands begin
_NAME = re.compile(r"(?<!\S)/[A-Za-z_]\w*(?:/\w+)*")


def topic_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield every topic that is not the one of the graphs."""
    given = list(graph_topics(lab))
    for topic in lab.ros.topics.values():
        yield from _about_topic(lab, topic, given)
    for graph_topic in given:
        if graph_topic.name not in lab.ros.topics:
            message = f"'{graph_topic.name}' is missing: no saved output of it is judged"
            yield LabFault(ROS, "topics", message, graph_topic.place, "warning")
    if lab.checkpoints[lab.last].localization and lab.ros.navigation is not None:
        yield from _navigation(lab, lab.ros.navigation, given)
    yield from _commands(lab)
    for line in lab.submission.checklist:
        key = f"checklist: {line.section}: '{line.text}'"
        yield from misspelled(lab, line.text, SUBMISSION, key)


def _about_topic(lab: Lab, topic: TopicSpec, given: list[GraphTopic]) -> Iterator[LabFault]:
    key = f"topics: {topic.name}"
    ends = [graph_topic for graph_topic in given if graph_topic.is_subscribed == topic.subscribed]
    same = [end for end in ends if end.name == topic.name]
    if not same:
        if (topic.source is None and not topic.optional) or topic.subscribed:
            does = "subscribes to" if topic.subscribed else "publishes"
            message = f"no node of a graph {does} '{topic.name}'"
            yield LabFault(ROS, key, message, _other_name(lab, topic, ends))
        return
    for graph_topic in same:
        if graph_topic.type is not None and graph_topic.type != topic.type:
            message = f"'type' is {topic.type}, but the graph's messages are {graph_topic.type}"
            yield LabFault(ROS, key, message, graph_topic.place)
    count = sum(not end.is_subscribed for end in same)
    if topic.publishers is not None and topic.source is None and topic.publishers != count:
        message = f"'publishers' is {topic.publishers}, but {count} of the graphs' nodes are"
        yield LabFault(ROS, f"{key}: publishers", message, same[0].place)
    yield from _other_frames(topic, same)
    yield from _too_early(lab, topic, same)


def _other_frames(topic: TopicSpec, same: list[GraphTopic]) -> Iterator[LabFault]:
    """Yield the frames of messages that no graph writes, where the specs say which ones they do."""
    for number, field in enumerate(FRAME_FIELDS):
        said = (topic.fields or {}).get(field, "")
        named = {end.frames[number]: end.place for end in same if len(end.frames) > number}
        if said and named and "" not in named and said not in named:
            frame, place = next(iter(named.items()))
            message = f"'{said}' is not the frame of the graph, '{frame}' is"
            yield LabFault(ROS, f"topics: {topic.name}: fields: {field}", message, place)


def _too_early(lab: Lab, topic: TopicSpec, same: list[GraphTopic]) -> Iterator[LabFault]:
    """Yield that a topic is asked for before the graph that has it."""
    first = next(
        (
            (checkpoint.id, graph_topic)
            for checkpoint in lab.checkpoints.values()
            for graph_topic in same
            if graph_topic.graph in checkpoint.graphs
        ),
        None,
    )
    since = topic.since if topic.since != FROM_THE_FIRST else lab.first
    if first is None or since not in lab.checkpoints or not lab.is_after(first[0], since):
        return
    asked, comes = map(lab.key_of, (since, first[0]))
    message = f"'from' is {asked}, but the graph comes with checkpoint {comes}"
    yield LabFault(ROS, f"topics: {topic.name}", message, first[1].place)


def _other_name(lab: Lab, topic: TopicSpec, ends: Iterable[GraphTopic]) -> str:
    """Return the place in the graphs where the topic has another name, as it seems."""
    free = [end for end in ends if end.name not in lab.ros.topics]
    alike = [graph_topic for graph_topic in free if graph_topic.type == topic.type]
    by_name = {graph_topic.name: graph_topic for graph_topic in alike or free}
    meant = nearest_name(topic.name, by_name) or next(iter(by_name if alike else ()), None)
    return f"{by_name[meant].place} is '{meant}'" if meant else ""


def _navigation(
    lab: Lab, navigation: NavigationSpec, given: list[GraphTopic]
) -> Iterator[LabFault]:
    """Yield the topics of Nav2's parameters that do not exist."""
    wanted = {
        "scan_topic": (navigation.scan_topic, False),
        "odom_topic": (navigation.odom_topic, False),
        "velocity_topic": (navigation.velocity_topic, True),
    }
    for key, (name, is_subscribed) in wanted.items():
        ends = {topic.name: topic for topic in given if topic.is_subscribed == is_subscribed}
        topic = lab.ros.topics.get(name)
        is_elsewhere = topic is not None and topic.source is not None and not topic.subscribed
        if name not in ends and not is_elsewhere:
            does = "subscribes to" if is_subscribed else "publishes"
            message = f"no node of a graph {does} '{name}'"
            meant = nearest_name(name, ends)
            other = f"{ends[meant].place} is '{meant}'" if meant else f"{ROS}: topics"
            yield LabFault(ROS, f"navigation: {key}", message, other)
    if navigation.map_topic not in lab.ros.topics:
        message = f"'{navigation.map_topic}' is not a topic"
        yield LabFault(ROS, "navigation: map_topic", message, f"{ROS}: topics")


def _commands(lab: Lab) -> Iterator[LabFault]:
    """Yield the commands about topics and nodes that the lab does not have."""
    topics, nodes = _known_topics(lab), lab.ros.lifecycle.nodes
    for number, command in enumerate(lab.ros.commands, start=1):
        kind, name = command.kind.name, command.of
        key = f"command {number} ({kind}): of"
        if kind.startswith(_ABOUT_TOPICS) and name and name not in topics:
            yield LabFault(ROS, key, f"'{name}' is not a topic", f"{ROS}: topics")
        if kind == _ABOUT_NODES and name not in nodes:
            message = f"'{name}' is not a lifecycle node"
            yield LabFault(ROS, key, message, f"{ROS}: lifecycle: nodes")


def _known_topics(lab: Lab) -> set[str]:
    goal = lab.ros.goal
    of_goal = () if goal is None else (goal.status, goal.pose, goal.robot)
    return {*lab.ros.topics, *lab.ros.system.topics, *of_goal}


def misspelled(lab: Lab, text: str, file: str, key: str) -> Iterator[LabFault]:
    """Yield the topics in a text that are nearly, but not quite, topics of the lab."""
    navigation = lab.ros.navigation
    topics = _known_topics(lab) | set(() if navigation is None else navigation.rviz.values())
    for name in _NAME.findall(example_of(text, lab.team)):
        meant = None if name in topics else nearest_name(name, topics)
        if meant:
            message = f"'{name}' is not a topic, '{meant}' is"
            yield LabFault(file, key, message, f"{ROS}: topics: {meant}")
