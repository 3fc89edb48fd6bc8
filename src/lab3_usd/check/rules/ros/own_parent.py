"""Rules about target lists that give a frame its own parent, or that F9 offers and lose one."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.registry import rule
from lab3_usd.check.ros.running import severity_if_uncertain
from lab3_usd.check.tf.lab_frames import (
    TfView,
    differs_from_spec,
    frame_list_text,
    frame_sources,
    lacks_only_the_camera,
    lists_its_parent,
    missing_frames,
    self_parent_pairs,
)
from lab3_usd.check.tf.target_frames import Pair, listed_targets, parent_prim, tf_ports
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.stage import Node


@rule("T09", "frame-is-its-own-parent", scope="frames")
def frame_is_its_own_parent(view: TfView) -> Iterator[Problem]:
    """A frame is its own parent.

    Why: tf2 rejects such a transform (TF_SELF_TRANSFORM) and logs an error for every message. Isaac
    Sim omits the parent prim only if a robot root is the target, not if the parent prim itself is
    listed. If an articulation root above it is the target, the other frames still arrive: a
    warning.

    Fix: remove the parent prim from the Target Prims of Isaac Compute Transform Tree. It is the
    parent of the other frames, and odometry places it.

    Example: Parent Prim is `{robot}/{base}`, and so is one of the Target Prims.
    """
    subject = view.subject
    # What a node of the lab would send is judged even where its wires are wrong.
    judged = {path: node for path, node in view.live_nodes.items() if path in view.role_specs}
    for path, node in {**judged, **view.running}.items():
        if not listed_targets(node) or differs_from_spec(path, view):
            continue
        for problem in _own_parents(node, view):
            doubtful = severity_if_uncertain(subject.stage, subject.lab, path)
            yield replace(problem, severity=doubtful or problem.severity)
    strangers = (
        edge for edge in view.edges if edge.cause not in {*view.role_specs, *subject.faulty_prims}
    )
    for edge in strangers:
        if edge.parent == edge.child != view.odom and edge.target is None:
            severity: Severity | None = None if edge.sure else "warning"
            message = f"publishes '{edge.child}' as its own parent"
            yield Problem(edge.cause, message, severity=severity)


def _own_parents(node: Node, view: TfView) -> Iterator[Problem]:
    parent = parent_prim(node)
    pairs = self_parent_pairs(node, view)
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
    makers = [maker for maker in frame_sources(view) if maker.node.path == node.path]
    required = [home for maker in makers for home in maker.prims.values()]
    return [*required, *(path for path in listed_targets(node) if path != around)]


def _self_problem(node: Node, what: str, wanted: list[str], view: TfView) -> Problem:
    """Say what is its own parent, and which frames the targets do not give."""
    makers = [maker for maker in frame_sources(view) if maker.node.path == node.path]
    lost = {frame: m.prims[frame] for m in makers for frame in missing_frames(m, view)}
    losing = f", and nothing publishes {frame_list_text(list(lost))}" if lost else ""
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


@rule("T10", "robot-root-alone", scope="frames", severity="warning")
def robot_root_alone(view: TfView) -> Iterator[Problem]:
    """The robot root is the only target prim, and the camera is not a link of the robot.

    Why: a robot root gives the prims below it with IsaacLinkAPI, IsaacSiteAPI or
    IsaacReferencePointAPI. The links in its robot schema do not matter. A camera has none of these
    schemas by default. Its frame is then missing from the required tree, and RViz cannot place the
    image. The robot still drives and navigates, and the handout allows this target: it costs no
    points.

    Fix: keep `{robot}` and add `{camera}` as a second target prim.

    Example: the Target Prims of Isaac Compute Transform Tree are `{robot}`, and `{camera_name}` is
    not published.
    """
    for maker in frame_sources(view):
        missing = missing_frames(maker, view)
        is_told = bool(self_parent_pairs(maker.node, view))
        if missing and lacks_only_the_camera(maker, view) and not is_told:
            homes = ", ".join(maker.prims[frame] for frame in missing)
            yield Problem(
                maker.node.path,
                f"the robot root alone does not publish {frame_list_text(missing)}",
                property=maker.port,
                expected=f"{', '.join(maker.node.targets(maker.port))}, {homes}",
                actual=", ".join(maker.node.targets(maker.port)),
                handout=maker.handout,
                hint=f"add {homes} as a second target",
            )
