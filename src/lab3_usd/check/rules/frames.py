"""Rules about single TF frames: each one required is there, below the right parent, and named."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.absence import is_at_or_below, is_hidden
from lab3_usd.check.computed_frames import expands, listed_targets, parent_prim, tf_ports
from lab3_usd.check.finding import Problem, Severity
from lab3_usd.check.frame_names import NAME_OVERRIDE, frame_name
from lab3_usd.check.frames import Edge, sure
from lab3_usd.check.link_tree import LINK_API, ROBOT_API
from lab3_usd.check.model import Node
from lab3_usd.check.physics import BODY_API
from lab3_usd.check.registry import rule
from lab3_usd.check.rules import (  # noqa: F401 - their rules
    frame_ids,
    frame_tree,
    lost_frames,
    odom_parent,
)
from lab3_usd.check.running import doubt
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.tf_view import (
    Maker,
    TfView,
    differs_from_spec,
    frame_makers,
    judged_elsewhere,
    lacks_the_camera_only,
    lists_its_parent,
    missing_frames,
    self_pairs,
    tf_view,
)


@rule("T01", "missing-frame", scope="stage")
def missing_frame(subject: StageSubject) -> Iterator[Problem]:
    """A frame of the required TF tree is not published.

    Why: RViz, AMCL and Nav2 cannot place what has no transform: without `base_scan` the scan is
    dropped, without `Camera_1` the image has no place. The robot root as a target gives only the
    prims below it that carry IsaacLinkAPI, IsaacSiteAPI or IsaacReferencePointAPI; what it lists
    as its links plays no part. A target with the articulation root gives the bodies at and below
    it: for `base_footprint`, beside which the links stand, that is itself alone.

    Fix: select the Isaac Compute Transform Tree node and add the prim of the frame to Target
    Prims. Where the prim carries a name override, clear it.

    Example: `inputs:targetPrims` names five links and not
    `/turtlebot3_burger/base_footprint/Camera_1`, so that nothing publishes `Camera_1`.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    for maker in frame_makers(view):
        if not lists_its_parent(maker.node) and not lacks_the_camera_only(maker, view):
            yield from _missing_of(maker, missing_frames(maker, view), view)


def _missing_of(maker: Maker, missing: list[str], view: TfView) -> Iterator[Problem]:
    stage = view.subject.stage
    targets = maker.node.targets(maker.port)
    renamed = {frame for frame in missing if frame_name(maker.homes[frame], stage) != frame}
    for frame in sorted(renamed):
        yield Problem(
            maker.homes[frame],
            f"the prim's frame is named '{frame_name(maker.homes[frame], stage)}' by its override",
            property=NAME_OVERRIDE,
            expected=frame,
            actual=frame_name(maker.homes[frame], stage),
            handout=maker.handout,
        )
    rest = [frame for frame in missing if frame not in renamed]
    why = _why_not_all(maker, rest, view)
    together = len(rest) == len(maker.homes) or (bool(why) and bool(rest))
    strangers = [
        path for path in targets if stage.prim(path) is None and not is_hidden(stage, path)
    ]
    nowhere = f"; {', '.join(strangers)} is not in the scene" if strangers else ""
    for frames in [rest] if together else [[frame] for frame in rest]:
        yield Problem(
            maker.node.path,
            f"nothing publishes {_listed(frames)}{nowhere}{why}",
            property=maker.port,
            expected=", ".join(maker.homes[frame] for frame in frames),
            actual=", ".join(targets) or "no targets",
            handout=maker.handout,
        )


def _why_not_all(maker: Maker, missing: list[str], view: TfView) -> str:
    """Say why the robot, which is one of the targets, does not give all of its links."""
    robot: str = view.subject.lab.scene["robot"]["path"]
    prim = view.subject.stage.prim(robot)
    if prim is None or robot not in maker.node.targets(maker.port):
        return ""
    homes = [maker.homes[frame] for frame in missing]
    if not expands(robot, maker.node, view.subject.stage):
        lack = "links of Isaac Sim's robot schema" if ROBOT_API in prim.apis else ROBOT_API
        return f"; {robot} stands for itself, not for its links, for it has no {lack}"
    links = [home for home in homes if is_at_or_below(home, robot) and _is_body(home, view)]
    return f"; {robot} does not give {', '.join(links)} without {LINK_API}" if links else ""


def _is_body(path: str, view: TfView) -> bool:
    prim = view.subject.stage.prim(path)
    return prim is not None and BODY_API in prim.apis


def _listed(frames: list[str]) -> str:
    names = ", ".join(f"'{frame}'" for frame in frames)
    return f"the frame {names}" if len(frames) == 1 else f"the frames {names}"


@rule("T02", "wrong-parent-frame", scope="stage")
def wrong_parent_frame(subject: StageSubject) -> Iterator[Problem]:
    """A required frame hangs below another parent than the lab asks for.

    Why: the robot's frames must come together in `base_footprint`, which odometry moves; what
    hangs elsewhere stays behind when the robot drives.

    Fix: let Isaac Compute Transform Tree have `base_footprint` as its Parent Prim and publish each
    frame there only. Where the parent prim carries a name override, clear it.

    Example: `/Graph/tf` publishes `base_link -> base_scan`, and the lab's own node no longer names
    `base_scan`.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    wrong: dict[tuple[str, str], list[Edge]] = {}
    for parent, child in subject.lab.frames.edges:
        edges = view.children.get(child, [])
        if edges and not any(_is_right(edge, parent, view) for edge in edges):
            wrong.setdefault((edges[0].cause, edges[0].parent), []).append(edges[0])
    for (cause, actual), edges in wrong.items():
        if not any(judged_elsewhere(edge, view) for edge in edges):
            yield _wrong_parent(cause, actual, edges, view)


def _is_right(edge: Edge, parent: str, view: TfView) -> bool:
    if edge.parent == parent:
        return True
    return parent == view.subject.lab.frames.deeper_under and _hangs_below(edge, parent, view)


def _hangs_below(edge: Edge, top: str, view: TfView) -> bool:
    """Whether the node that gives this frame leads from it up to `top`, as with a robot's links."""
    above = {other.child: other.parent for other in view.edges if other.cause == edge.cause}
    seen: set[str] = set()
    name = edge.child
    while name in above and name not in seen and name != top:
        seen.add(name)
        name = above[name]
    return name == top


def _wrong_parent(cause: str, actual: str, edges: list[Edge], view: TfView) -> Problem:
    frames = [edge.child for edge in edges]
    expected = next(p for p, child in view.subject.lab.frames.edges if child == frames[0])
    node = view.live[cause]
    ports = tf_ports(node)
    port = next(iter(ports.names or ports.prims))
    site: tuple[str, str] = (cause, port)
    prim = next(iter(node.targets(port)), None)
    if cause in view.played and prim and frame_name(prim, view.subject.stage) != expected:
        site = (prim, NAME_OVERRIDE)
    return Problem(
        site[0],
        f"'{actual}' is the parent of {_listed(frames)}, expected '{expected}'",
        property=site[1],
        expected=expected,
        actual=actual,
        handout=view.subject.lab.frames.handout,
        severity=None if sure(edges) else "warning",
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
    parent, targets = parent_prim(node), listed_targets(node)
    if lists_its_parent(node):
        yield _listed_parent(node, view)
        return
    for pair in self_pairs(node, view):
        named = f"{pair.prim} is named '{pair.child}' as the parent frame is"
        inside = f"{pair.target} stands for its bodies, the parent prim {parent} among them"
        is_inside = pair.prim == parent
        yield Problem(
            node.path,
            f"{inside if is_inside else named}: '{pair.child}' is its own parent",
            property=tf_ports(node).prims[1],
            expected="the links themselves as targets" if is_inside else "a frame of another name",
            actual=", ".join(targets),
            handout=view.subject.lab.frames.handout,
            severity="warning" if is_inside else None,
            hint=f"name the links, not {pair.target}" if is_inside else f"rename {pair.prim}",
        )


def _listed_parent(node: Node, view: TfView) -> Problem:
    """Say that the parent prim is a target, and which frames that target does not give."""
    parent, targets = parent_prim(node), listed_targets(node)
    makers = [maker for maker in frame_makers(view) if maker.node.path == node.path]
    lost = [(frame, maker) for maker in makers for frame in missing_frames(maker, view)]
    losing = f", and nothing publishes {_listed([frame for frame, _ in lost])}" if lost else ""
    wanted = [path for path in targets if path != parent]
    wanted += [maker.homes[frame] for frame, maker in lost]
    return Problem(
        node.path,
        f"{parent} is the parent prim and a target: its frame is its own parent{losing}",
        property=tf_ports(node).prims[1],
        expected=", ".join(wanted) or f"targets without {parent}",
        actual=", ".join(targets),
        handout=view.subject.lab.frames.handout,
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
        if missing and lacks_the_camera_only(maker, view):
            homes = ", ".join(maker.homes[frame] for frame in missing)
            yield Problem(
                maker.node.path,
                f"the robot root alone does not publish {_listed(missing)}",
                property=maker.port,
                expected=f"{', '.join(maker.node.targets(maker.port))}, {homes}",
                actual=", ".join(maker.node.targets(maker.port)),
                handout=maker.handout,
                hint=f"add {homes} as a second target",
            )
