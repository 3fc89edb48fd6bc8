"""Rules about target lists that give a frame its own parent, or that F9 offers and lose one."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.computed_frames import Pair, listed_targets, parent_prim, tf_ports
from lab3_usd.check.finding import Problem, Severity
from lab3_usd.check.model import Node
from lab3_usd.check.registry import rule
from lab3_usd.check.running import doubt
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.tf_view import (
    TfView,
    differs_from_spec,
    frame_makers,
    frames_in_words,
    lacks_the_camera_only,
    lists_its_parent,
    missing_frames,
    self_pairs,
    tf_view,
)


@rule("T09", "frame-is-its-own-parent", scope="stage")
def frame_is_its_own_parent(subject: StageSubject) -> Iterator[Problem]:
    """A transform leads from a frame to itself.

    Why: tf2 rejects a frame that is its own parent (TF_SELF_TRANSFORM) and logs an error for every
    message. Isaac Sim leaves the parent prim out only where a robot root is the target, not where
    it is listed itself, with the articulation root or without. Where an articulation root above
    it is the target, the other frames arrive all the same: a warning.

    Fix: take the parent prim out of the Target Prims of Isaac Compute Transform Tree: it is the
    frame that the others hang below, and odometry places it.

    Example: Parent Prim is `/turtlebot3_burger/base_footprint`, and so is one of the Target Prims.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    # What a node of the lab would send is judged even where its wires are wrong.
    judged = {path: node for path, node in view.live.items() if path in view.played}
    for path, node in {**judged, **view.running}.items():
        for problem in () if differs_from_spec(path, view) else _own_parents(node, view):
            doubtful = doubt(subject.stage, subject.lab, path)
            yield replace(problem, severity=doubtful or problem.severity)
    strangers = (edge for edge in view.edges if edge.cause not in {*view.played, *subject.blamed})
    for edge in strangers:
        if edge.parent == edge.child != view.odom and edge.target is None:
            severity: Severity | None = None if edge.sure else "warning"
            message = f"publishes '{edge.child}' as its own parent"
            yield Problem(edge.cause, message, severity=severity)


def _own_parents(node: Node, view: TfView) -> Iterator[Problem]:
    parent = parent_prim(node)
    pairs = self_pairs(node, view)
    around = next((pair.target for pair in pairs if pair.prim == parent), "")
    if lists_its_parent(node, view):
        what = f"{parent} is the parent prim and a target: its frame is its own parent"
        others = [path for path in listed_targets(node) if path != parent]
        yield _self_problem(node, what, others, view)
    elif around:
        what = (
            f"{around} stands for its bodies, the parent prim {parent} among them: "
            "its frame is its own parent"
        )
        found = _self_problem(node, what, _instead(around, node, view), view)
        yield replace(found, severity="warning", hint=f"name the links, not {around}")
    else:
        yield from (_named_alike(node, pair, view) for pair in pairs)


def _instead(around: str, node: Node, view: TfView) -> list[str]:
    """Return the targets with every required prim in the place of one that stands for them."""
    makers = [maker for maker in frame_makers(view) if maker.node.path == node.path]
    required = [home for maker in makers for home in maker.homes.values()]
    return [*required, *(path for path in listed_targets(node) if path != around)]


def _self_problem(node: Node, what: str, wanted: list[str], view: TfView) -> Problem:
    """Say what is its own parent, and which frames the targets do not give."""
    makers = [maker for maker in frame_makers(view) if maker.node.path == node.path]
    lost = {frame: m.homes[frame] for m in makers for frame in missing_frames(m, view)}
    losing = f", and nothing publishes {frames_in_words(list(lost))}" if lost else ""
    return Problem(
        node.path,
        f"{what}{losing}",
        property=tf_ports(node).prims[1],
        expected=", ".join(dict.fromkeys([*wanted, *lost.values()])) or "the links as targets",
        actual=", ".join(listed_targets(node)),
        handout=view.subject.lab.frames.handout,
    )


def _named_alike(node: Node, pair: Pair, view: TfView) -> Problem:
    return Problem(
        node.path,
        f"{pair.prim} is named as the parent frame is: '{pair.child}' is its own parent",
        property=tf_ports(node).prims[1],
        expected="a frame of another name",
        actual=", ".join(listed_targets(node)),
        handout=view.subject.lab.frames.handout,
        hint=f"rename {pair.prim} or take it out of the target prims",
    )


@rule("T10", "robot-root-alone", scope="stage", severity="warning")
def robot_root_alone(subject: StageSubject) -> Iterator[Problem]:
    """The robot root is the only target prim, and the camera is no link of the robot.

    Why: a robot root stands for the prims of its subtree that carry IsaacLinkAPI, IsaacSiteAPI or
    IsaacReferencePointAPI, whatever it lists as its links. A camera carries none of them unless
    somebody applied it, so that its frame is missing from the tree that the lab requires, and
    RViz has no place for the image. The robot drives and navigates all the same, and F9 allows
    this target: it costs no points.

    Fix: keep `/turtlebot3_burger` and add `/turtlebot3_burger/base_footprint/Camera_1` as a second
    target prim.

    Example: the Target Prims of Isaac Compute Transform Tree are `/turtlebot3_burger`, as F9
    allows, and `Camera_1` is not published.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    for maker in frame_makers(view):
        missing = missing_frames(maker, view)
        is_told = bool(self_pairs(maker.node, view))
        if missing and lacks_the_camera_only(maker, view) and not is_told:
            homes = ", ".join(maker.homes[frame] for frame in missing)
            yield Problem(
                maker.node.path,
                f"the robot root alone does not publish {frames_in_words(missing)}",
                property=maker.port,
                expected=f"{', '.join(maker.node.targets(maker.port))}, {homes}",
                actual=", ".join(maker.node.targets(maker.port)),
                handout=maker.handout,
                hint=f"add {homes} as a second target",
            )
