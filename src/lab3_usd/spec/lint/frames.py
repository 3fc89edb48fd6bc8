"""Frames that no graph publishes, and names that are no frames of the tree."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.spec.files import CHECKPOINTS, ROS, SCENE
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.fault import LabFault, nearest
from lab3_usd.spec.lint.graph_names import GraphFrame, graph_frames, named_frames

TREE = "frames: edges"
_FRAME_FIELDS = ("header.frame_id", "child_frame_id")
_FRAME_COMMAND = "tf2_echo"


def frame_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what contradicts the TF tree, where a checkpoint asks for it."""
    if not lab.checkpoints[lab.last].frames:
        return
    given = list(graph_frames(lab))
    yield from _double_parents(lab)
    yield from _unpublished(lab, given)
    tree = _tree(lab)
    for file, key, frame in (*_graph_references(lab, given), *_references(lab)):
        if frame not in tree:
            meant = nearest(frame, tree)
            hint = f", '{meant}' is" if meant else ""
            message = f"'{frame}' is no frame of the tree{hint}"
            yield LabFault(file, key, message, f"{CHECKPOINTS}: {TREE}")


def _tree(lab: Lab) -> dict[str, None]:
    """Return the frames of the running system, in the order of the file."""
    localization = lab.frames.localization
    edges = (*lab.frames.edges, *(() if localization is None else (localization.edge,)))
    return dict.fromkeys(frame for edge in edges for frame in edge)


def _double_parents(lab: Lab) -> Iterator[LabFault]:
    parents: dict[str, str] = {}
    for parent, child in lab.frames.edges:
        if parents.setdefault(child, parent) != parent:
            message = f"'{child}' has two parents, '{parents[child]}' and '{parent}'"
            other = f"{CHECKPOINTS}: {TREE}: {parents[child]} -> {child}"
            yield LabFault(CHECKPOINTS, f"{TREE}: {parent} -> {child}", message, other)
    for forbidden in filter(lab.frames.is_forbidden, lab.frames.edges):
        message = "is required and forbidden"
        key = f"{TREE}: {forbidden[0]} -> {forbidden[1]}"
        yield LabFault(CHECKPOINTS, key, message, f"{CHECKPOINTS}: frames: forbidden")


def _unpublished(lab: Lab, given: list[GraphFrame]) -> Iterator[LabFault]:
    """Yield the transforms of the tree that no node of a graph gives."""
    published = {each.child for each in given}
    for parent, child in lab.frames.edges:
        key = f"{TREE}: {parent} -> {child}"
        makers = [each for each in given if each.child == child]
        if not makers:
            message = f"no node of a graph publishes the frame '{child}'"
            yield LabFault(CHECKPOINTS, key, message, _places(given))
        elif all(each.parent != parent for each in makers) and parent not in published:
            message = f"the graphs publish '{child}' below '{makers[0].parent}'"
            yield LabFault(CHECKPOINTS, key, message, makers[0].place)


def _places(given: list[GraphFrame]) -> str:
    places = ", ".join(dict.fromkeys(each.place for each in given))
    return f"frames are published by {places}" if places else "no graph has a node that does"


def _graph_references(lab: Lab, given: list[GraphFrame]) -> Iterator[tuple[str, str, str]]:
    for each in (*given, *named_frames(lab)):
        yield each.file, each.key, each.child


def _references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    """Yield file, key and frame of everything beside the graphs that names one."""
    frames = lab.frames
    if frames.deeper_under:
        yield CHECKPOINTS, "frames: deeper_under", frames.deeper_under
    if frames.forbidden is not None:
        yield CHECKPOINTS, "frames: forbidden: child", frames.forbidden.child
    for name in () if frames.localization is None else frames.localization.chain:
        yield CHECKPOINTS, "frames: localization: chain", name
    yield SCENE, "robot: base_frame", lab.scene.robot.base_frame
    yield from _ros_references(lab)


def _ros_references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    for topic in lab.ros.topics.values():
        for field, value in (topic.fields or {}).items():
            if field in _FRAME_FIELDS:
                yield ROS, f"topics: {topic.name}: fields: {field}", value
    navigation = lab.ros.navigation if lab.checkpoints[lab.last].localization else None
    for each in () if navigation is None else navigation.frames:
        yield ROS, f"navigation: frames: {each.node}.{each.name}", each.frame
    for number, command in enumerate(lab.ros.commands, start=1):
        if command.kind.name == _FRAME_COMMAND:
            for key, name in (("of", command.of), ("to", command.to)):
                yield ROS, f"command {number} ({command.kind.name}): {key}", name
