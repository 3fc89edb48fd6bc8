"""Rules about the TF tree as a whole: one parent and one publisher each, no ring, one root."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.finding import Problem
from lab3_usd.check.frames import Edge, sure
from lab3_usd.check.registry import rule
from lab3_usd.check.rings import frames_in_rings
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.tf_view import TfView, judged_elsewhere, tf_view
from lab3_usd.check.topic_view import copied_graphs


def _open_edges(view: TfView) -> list[Edge]:
    """Return the transforms that no other rule finds fault with."""
    return [edge for edge in view.edges if not judged_elsewhere(edge, view)]


def _is_asked(edge: Edge, view: TfView) -> bool:
    return (edge.parent, edge.child) in view.subject.lab.frames.edges


def _site(edges: list[Edge], view: TfView) -> Edge:
    """Return the transform to put right: of a node that plays no role, else one nobody asks for."""
    strange = [edge for edge in edges if edge.cause not in view.played]
    unasked = [edge for edge in edges if not _is_asked(edge, view)]
    return next(iter([*strange, *unasked, *edges]))


def _others(edges: list[Edge], site: Edge) -> tuple[str, ...]:
    return tuple(dict.fromkeys(e.publisher for e in edges if e.publisher != site.publisher))


@rule("T03", "two-parents", scope="stage")
def two_parents(subject: StageSubject) -> Iterator[Problem]:
    """A frame has two parents.

    Why: tf2 keeps the transform that came last, so that the frame jumps from one parent to the
    other with every message, and the robot with it.

    Fix: decide which publisher places the frame, and delete or correct the other. All graphs of
    the stage count, those under `/Graph` too.

    Example: `/Graph/ROS_Odometry` publishes `odom -> base_link` beside the lab's
    `base_footprint -> base_link`.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    rings = set(frames_in_rings(_open_edges(view)))
    clashes: dict[str, list[tuple[Edge, list[Edge]]]] = {}
    for child, edges in view.children.items():
        if not _has_parents(edges) or child in rings:
            continue
        if not any(judged_elsewhere(edge, view) for edge in edges):
            site = _site(edges, view)
            clashes.setdefault(site.cause, []).append((site, edges))
    for cause, found in clashes.items():
        everything = [edge for _, edges in found for edge in edges]
        sites = "; ".join(f"{site.parent} -> {site.child}" for site, _ in found)
        names = ", ".join(f"'{site.child}'" for site, _ in found)
        many = len(found) > 1
        yield Problem(
            cause,
            f"publishes {sites}; so {names} {'have' if many else 'has'} two parents",
            expected=", ".join(
                f"{e.parent} -> {e.child}" for e in everything if _is_asked(e, view)
            ),
            actual=sites,
            handout=subject.lab.frames.handout,
            related=_others(everything, found[0][0]),
            severity=None if any(_has_parents(sure(e)) for _, e in found) else "warning",
        )


def _has_parents(edges: list[Edge]) -> bool:
    """Whether the transforms of one frame lead from more than one parent."""
    return len({edge.parent for edge in edges}) > 1


@rule("T04", "transform-published-twice", scope="stage")
def transform_published_twice(subject: StageSubject) -> Iterator[Problem]:
    """The same transform is sent twice: by two publishers, or by one for two prims of one name.

    Why: tf2 mixes the two streams; where their times differ it warns of old data without end, and
    the frame jitters between two poses.

    Fix: delete one of the publishers, most often a copy of the whole graph. Of two target prims
    that have one frame name, take one out.

    Example: `ROS_OdomTF` was copied to `/World`, and both publish `odom -> base_footprint`.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    twice: dict[str, list[tuple[Edge, list[Edge]]]] = {}
    for edges in _same_transforms(view).values():
        if _has_publishers(edges):
            site = _site(edges, view)
            twice.setdefault(site.publisher, []).append((site, edges))
    copies = copied_graphs(subject)
    for publisher, found in twice.items():
        if publisher.rpartition("/")[0] in copies:
            continue  # the rule of topics says that the whole graph is there twice
        sites = ", ".join(f"{site.parent} -> {site.child}" for site, _ in found)
        yield Problem(
            publisher,
            f"publishes {sites}, which another node publishes as well",
            actual=sites,
            handout=subject.lab.frames.handout,
            related=_others([edge for _, edges in found for edge in edges], found[0][0]),
            severity=None if any(_has_publishers(sure(e)) for _, e in found) else "warning",
        )
    for edges in _same_transforms(view).values():
        if not _has_publishers(edges) and len({edge.prim for edge in edges}) > 1:
            yield _of_two_prims(edges, subject)


def _of_two_prims(edges: list[Edge], subject: StageSubject) -> Problem:
    prims = " and ".join(dict.fromkeys(str(edge.prim) for edge in edges))
    return Problem(
        edges[0].cause,
        f"gives the frame '{edges[0].child}' to {prims}",
        expected="one prim for each frame",
        actual=prims,
        handout=subject.lab.frames.handout,
        severity=None if edges[0].sure else "warning",
    )


def _has_publishers(edges: list[Edge]) -> bool:
    return len({edge.publisher for edge in edges}) > 1


def _same_transforms(view: TfView) -> dict[tuple[str, str], list[Edge]]:
    found: dict[tuple[str, str], list[Edge]] = {}
    for edge in _open_edges(view):
        found.setdefault((edge.parent, edge.child), []).append(edge)
    return found


@rule("T05", "ring-of-frames", scope="stage")
def ring_of_frames(subject: StageSubject) -> Iterator[Problem]:
    """The transforms lead round in a ring.

    Why: tf2 needs a tree; in a ring it finds no root and refuses every lookup that meets it.

    Fix: delete the transform that leads back, most often one that names parent and child the wrong
    way round.

    Example: a second publisher sends `base_link -> base_footprint` beside
    `base_footprint -> base_link`.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    edges = _open_edges(view)
    ring = frames_in_rings(edges)
    if ring:
        inside = [edge for edge in edges if edge.parent in ring and edge.child in ring]
        site = _site(inside, view)
        yield Problem(
            site.cause,
            f"{site.parent} -> {site.child} closes a ring of the frames {', '.join(ring)}",
            actual=f"{site.parent} -> {site.child}",
            handout=subject.lab.frames.handout,
            related=_others(inside, site),
            severity=None if frames_in_rings(sure(edges)) else "warning",
        )


@rule("T06", "frames-not-connected", scope="stage")
def frames_not_connected(subject: StageSubject) -> Iterator[Problem]:
    """A transform is not connected with the tree of the robot.

    Why: tf2 cannot transform between two trees. From localization on the one tree begins at `map`
    and must run map, odom, base_footprint, base_scan.

    Fix: publish the frame below a frame of the robot, or delete its publisher. A node whose Parent
    Prim is empty hangs its frames below `world`, which is no frame of this lab.

    Example: a second Isaac Compute Transform Tree has no parent prim and publishes
    `world -> Lidar2D`.
    """
    if not subject.checkpoint.frames:
        return
    view = tf_view(subject)
    edges = _open_edges(view)
    ring = frames_in_rings(edges)
    reached = _reached_from(_tops(subject), edges)
    if {child for _, child in subject.lab.frames.edges} - reached:
        return  # the tree itself is broken, which other rules say
    loose: dict[str, list[Edge]] = {}
    for edge in edges:
        if edge.parent not in reached and edge.child not in reached and edge.child not in ring:
            loose.setdefault(edge.cause, []).append(edge)
    for cause, found in loose.items():
        names = ", ".join(f"{edge.parent} -> {edge.child}" for edge in found)
        yield Problem(
            cause,
            f"publishes {names}, which is not connected with '{_tops(subject)[0]}'",
            actual=names,
            handout=subject.lab.frames.handout,
            severity=None if sure(found) else "warning",
        )


def _tops(subject: StageSubject) -> tuple[str, ...]:
    """Return the frames at the top: what localization adds counts once it runs."""
    edge = subject.lab.frames.localization_edge
    return edge if subject.checkpoint.localization else edge[1:]


def _reached_from(tops: tuple[str, ...], edges: list[Edge]) -> set[str]:
    below: dict[str, list[str]] = {}
    for edge in edges:
        below.setdefault(edge.parent, []).append(edge.child)
    reached: set[str] = set()
    ahead = list(tops)
    while ahead:
        name = ahead.pop()
        if name not in reached:
            reached.add(name)
            ahead.extend(below.get(name, ()))
    return reached
