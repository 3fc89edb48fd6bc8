"""Rules about the TF tree as a whole: one parent and one publisher each, no ring, one root."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.lab_topics import repeating_graphs
from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.tf.cycles import frames_in_cycles
from lab3_usd.check.tf.frames import Edge, certain_edges
from lab3_usd.check.tf.lab_frames import TfView, is_reported_elsewhere
from lab3_usd.model.finding import Problem


def _open_edges(view: TfView) -> list[Edge]:
    """Return the transforms that no other rule finds fault with."""
    return [edge for edge in view.edges if not is_reported_elsewhere(edge, view)]


def _is_asked(edge: Edge, view: TfView) -> bool:
    return (edge.parent, edge.child) in view.subject.lab.frames.edges


def _site(edges: list[Edge], view: TfView) -> Edge:
    """Return the transform to put right: of a node that plays no role, else one nobody asks for."""
    strange = [edge for edge in edges if edge.cause not in view.role_specs]
    unasked = [edge for edge in edges if not _is_asked(edge, view)]
    return next(iter([*strange, *unasked, *edges]))


def _others(edges: list[Edge], site: Edge) -> tuple[str, ...]:
    return tuple(dict.fromkeys(e.publisher for e in edges if e.publisher != site.publisher))


@rule("T03", "two-parents", scope="frames")
def two_parents(view: TfView) -> Iterator[Problem]:
    """A frame has two parents.

    Why: tf2 keeps the latest transform. The frame, and the robot with it, jumps from one parent to
    the other with every message.

    Fix: decide which publisher places the frame, and delete or correct the other. All graphs of the
    stage count, also those under `/Graph`.

    Example: `/Graph/ROS_Odometry` publishes `{root} -> {link}` beside the lab's `{base} -> {link}`.
    """
    rings = set(frames_in_cycles(_open_edges(view)))
    clashes: dict[str, list[tuple[Edge, list[Edge]]]] = {}
    for child, edges in view.children.items():
        if not _has_parents(edges) or child in rings:
            continue
        if not any(is_reported_elsewhere(edge, view) for edge in edges):
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
            handout=view.subject.lab.frames.handout,
            related=_others(everything, found[0][0]),
            severity=None if any(_has_parents(certain_edges(e)) for _, e in found) else "warning",
        )


def _has_parents(edges: list[Edge]) -> bool:
    """Whether the transforms of one frame lead from more than one parent."""
    return len({edge.parent for edge in edges}) > 1


@rule("T04", "transform-published-twice", scope="frames")
def transform_published_twice(view: TfView) -> Iterator[Problem]:
    """The same transform is published twice: by two nodes, or for two prims of one name.

    Why: tf2 mixes the two streams. If their times differ, it warns of old data continuously, and
    the frame jitters between two poses.

    Fix: delete one of the publishers, most often a copy of the whole graph. If two target prims
    have one frame name, remove one of them.

    Example: `{last_graph_name}` was copied to `/World`, and both publish `{root} -> {base}`.
    """
    subject = view.subject
    twice: dict[str, list[tuple[Edge, list[Edge]]]] = {}
    for edges in _same_transforms(view).values():
        if _has_publishers(edges):
            site = _site(edges, view)
            twice.setdefault(site.publisher, []).append((site, edges))
    copies = repeating_graphs(subject)
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
            severity=None
            if any(_has_publishers(certain_edges(e)) for _, e in found)
            else "warning",
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


@rule("T05", "ring-of-frames", scope="frames")
def ring_of_frames(view: TfView) -> Iterator[Problem]:
    """The transforms form a cycle.

    Why: tf2 needs a tree. In a cycle it finds no root and refuses every lookup that reaches it.

    Fix: delete the transform that closes the cycle. Most often its parent and child are exchanged.

    Example: a second publisher sends `{link} -> {base}` beside `{base} -> {link}`.
    """
    edges = _open_edges(view)
    ring = frames_in_cycles(edges)
    if ring:
        inside = [edge for edge in edges if edge.parent in ring and edge.child in ring]
        site = _site(inside, view)
        yield Problem(
            site.cause,
            f"{site.parent} -> {site.child} closes a ring of the frames {', '.join(ring)}",
            actual=f"{site.parent} -> {site.child}",
            handout=view.subject.lab.frames.handout,
            related=_others(inside, site),
            severity=None if frames_in_cycles(certain_edges(edges)) else "warning",
        )


@rule("T06", "frames-not-connected", scope="frames")
def frames_not_connected(view: TfView) -> Iterator[Problem]:
    """A transform is not connected to the tree of the robot.

    Why: tf2 cannot transform between two trees. From localization on, the one tree begins at the
    frame of the map.

    Fix: publish the frame below a frame of the robot, or delete its publisher. A node with an empty
    Parent Prim puts its frames below `world`, which is not a frame of this lab.

    Example: a second Isaac Compute Transform Tree has no parent prim and publishes `world ->
    {link}`.
    """
    subject = view.subject
    edges = _open_edges(view)
    ring = frames_in_cycles(edges)
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
            severity=None if certain_edges(found) else "warning",
        )


def _tops(subject: StageSubject) -> tuple[str, ...]:
    """Return the frames at the top: what localization adds counts once it runs."""
    frames = subject.lab.frames
    is_localized = frames.above and subject.checkpoint.localization
    return (frames.above, frames.root) if is_localized else (frames.root,)


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
