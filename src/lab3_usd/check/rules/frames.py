"""Rules about single TF frames: each one required is there, below the right parent, and named."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.absence import is_at_or_below, is_hidden
from lab3_usd.check.computed_frames import expands, tf_ports
from lab3_usd.check.finding import Problem
from lab3_usd.check.frame_names import NAME_OVERRIDE, frame_name
from lab3_usd.check.frames import Edge, sure
from lab3_usd.check.link_tree import LINK_API, ROBOT_API
from lab3_usd.check.physics import BODY_API
from lab3_usd.check.registry import rule
from lab3_usd.check.rules import (  # noqa: F401 - their rules
    frame_ids,
    frame_tree,
    lost_frames,
    odom_parent,
    own_parent,
)
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.tf_view import (
    Maker,
    TfView,
    frame_makers,
    frames_in_words,
    judged_elsewhere,
    lacks_the_camera_only,
    lists_its_parent,
    missing_frames,
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
        if not lists_its_parent(maker.node, view) and not lacks_the_camera_only(maker, view):
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
            f"nothing publishes {frames_in_words(frames)}{nowhere}{why}",
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
        f"'{actual}' is the parent of {frames_in_words(frames)}, expected '{expected}'",
        property=site[1],
        expected=expected,
        actual=actual,
        handout=view.subject.lab.frames.handout,
        severity=None if sure(edges) else "warning",
    )
