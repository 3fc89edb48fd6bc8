"""Rules about the TF tree as a whole, and about the frame above the robot's odometry."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from msgspec import Struct

from lab3_usd.check.lab_frames import TfView, is_reported_elsewhere, repeating_graphs
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import edits_of_harm
from lab3_usd.facts.execution_order import effective_value, running_nodes
from lab3_usd.facts.frame_targets import tf_ports
from lab3_usd.facts.frames import Edge, certain_edges
from lab3_usd.facts.tree import frames_in_cycles
from lab3_usd.isaac.node_types import NodeType, TfPorts
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.stage import AbsentPrim, Node, PortState, once_per_stage


@once_per_stage
def _open_edges(view: TfView) -> tuple[Edge, ...]:
    """Return the transforms that no other rule finds fault with."""
    return tuple(edge for edge in view.edges if not is_reported_elsewhere(edge, view))


def _is_asked(edge: Edge, view: TfView) -> bool:
    return (edge.parent, edge.child) in view.subject.lab.frames.edges


def _site(edges: list[Edge], view: TfView) -> Edge:
    """Return the transform to repair: of a node without a role, else one that is not required."""
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

    Example: `/Graph/Frames` publishes `{root} -> {link}` beside the lab's `{base} -> {link}`.
    """
    rings = set(frames_in_cycles(_open_edges(view)))
    clashes: dict[str, list[tuple[Edge, list[Edge]]]] = {}
    for child, edges in view.children.items():
        if not _has_parents(edges) or child in rings:
            continue
        if not any(is_reported_elsewhere(edge, view) for edge in edges):
            site = _site(edges, view)
            clashes.setdefault(site.cause, []).append((site, edges))
    for cause, clashing in clashes.items():
        everything = [edge for _, edges in clashing for edge in edges]
        sites = "; ".join(f"{site.parent} -> {site.child}" for site, _ in clashing)
        names = ", ".join(f"'{site.child}'" for site, _ in clashing)
        many = len(clashing) > 1
        is_sure = any(_has_parents(certain_edges(edges)) for _, edges in clashing)
        severity: Severity | None = None if is_sure else "warning"
        yield Problem(
            cause,
            f"publishes {sites}; so {names} {'have' if many else 'has'} two parents",
            expected=", ".join(
                f"{e.parent} -> {e.child}" for e in everything if _is_asked(e, view)
            ),
            actual=sites,
            handout=view.subject.lab.frames.handout,
            related=_others(everything, clashing[0][0]),
            severity=severity,
            fix=edits_of_harm(view.subject, cause, severity=severity),
            frames=tuple(site.child for site, _ in clashing),
        )


def _has_parents(edges: list[Edge]) -> bool:
    """Whether the transforms of one frame lead from more than one parent."""
    return len({edge.parent for edge in edges}) > 1


@rule("T04", "transform-published-twice", scope="frames")
def transform_published_twice(view: TfView) -> Iterator[Problem]:
    """A transform is published twice.

    Why: tf2 mixes the two streams. If their times differ, it warns of old data continuously, and
    the frame jitters between two poses.

    Fix: delete one of the publishers, most often a copy of the whole graph. If two target prims
    have one frame name, remove one of them.

    Example: `{tree_graph_name}` was copied to `/World`, and both publish `{root} -> {base}`.
    """
    subject = view.subject
    twice: dict[str, list[tuple[Edge, list[Edge]]]] = {}
    for edges in _same_transforms(view).values():
        if _has_publishers(edges):
            site = _site(edges, view)
            twice.setdefault(site.publisher, []).append((site, edges))
    copies = repeating_graphs(subject)
    for publisher, clashing in twice.items():
        if publisher.rpartition("/")[0] in copies:
            continue  # the rule of topics says that the whole graph is there twice
        sites = ", ".join(f"{site.parent} -> {site.child}" for site, _ in clashing)
        is_sure = any(_has_publishers(certain_edges(edges)) for _, edges in clashing)
        severity: Severity | None = None if is_sure else "warning"
        yield Problem(
            publisher,
            f"publishes {sites}, which another node publishes as well",
            actual=sites,
            handout=subject.lab.frames.handout,
            related=_others([edge for _, edges in clashing for edge in edges], clashing[0][0]),
            severity=severity,
            fix=edits_of_harm(subject, publisher, severity=severity),
        )
    for edges in _same_transforms(view).values():
        if not _has_publishers(edges) and len({edge.prim for edge in edges}) > 1:
            yield _of_two_prims(edges, subject)


def _of_two_prims(edges: list[Edge], subject: StageSubject) -> Problem:
    prims = " and ".join(dict.fromkeys(str(edge.prim) for edge in edges))
    severity: Severity | None = None if edges[0].sure else "warning"
    return Problem(
        edges[0].cause,
        f"gives the frame '{edges[0].child}' to {prims}",
        expected="one prim for each frame",
        actual=prims,
        handout=subject.lab.frames.handout,
        severity=severity,
        fix=edits_of_harm(subject, edges[0].cause, severity=severity),
        frames=(edges[0].child,),
    )


def _has_publishers(edges: list[Edge]) -> bool:
    return len({edge.publisher for edge in edges}) > 1


def _same_transforms(view: TfView) -> dict[tuple[str, str], list[Edge]]:
    transforms: dict[tuple[str, str], list[Edge]] = {}
    for edge in _open_edges(view):
        transforms.setdefault((edge.parent, edge.child), []).append(edge)
    return transforms


@rule("T05", "frame-cycle", scope="frames", formerly="ring-of-frames")
def frame_cycle(view: TfView) -> Iterator[Problem]:
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
        severity: Severity | None = None if frames_in_cycles(certain_edges(edges)) else "warning"
        yield Problem(
            site.cause,
            f"{site.parent} -> {site.child} closes a cycle of the frames {', '.join(ring)}",
            actual=f"{site.parent} -> {site.child}",
            handout=view.subject.lab.frames.handout,
            related=_others(inside, site),
            severity=severity,
            fix=edits_of_harm(view.subject, site.cause, severity=severity),
        )


@rule("T06", "disconnected-frames", scope="frames", formerly="frames-not-connected")
def disconnected_frames(view: TfView) -> Iterator[Problem]:
    """A transform is not connected to the robot's tree.

    Why: tf2 cannot transform between two trees. {localization?}From localization on, the one tree
    begins at the frame of the map.{/}

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
    for cause, unconnected in loose.items():
        names = ", ".join(f"{edge.parent} -> {edge.child}" for edge in unconnected)
        severity: Severity | None = None if certain_edges(unconnected) else "warning"
        yield Problem(
            cause,
            f"publishes {names}, which is not connected with '{_tops(subject)[0]}'",
            actual=names,
            handout=subject.lab.frames.handout,
            severity=severity,
            fix=edits_of_harm(subject, cause, severity=severity),
        )


def _tops(subject: StageSubject) -> tuple[str, ...]:
    """Return the frames at the top: what localization adds counts once it runs."""
    frames = subject.lab.frames
    is_localized = frames.above and subject.checkpoint.localization
    return (frames.above, frames.root) if is_localized else (frames.root,)


def _reached_from(tops: tuple[str, ...], edges: Iterable[Edge]) -> set[str]:
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


_DELETED = "deactivated"


class _Placement(Struct, frozen=True):
    """A node that places `odom`: below which frame, and why nothing receives it, if so."""

    node: str
    parent: str | None
    port: str | None
    unheard: str = ""


@rule("T07", "odom-below-another-frame", scope="frames", needs="guarded root")
def odom_below_another_frame(view: TfView) -> Iterator[Problem]:
    """A publisher places `odom` below another frame.

    Why: AMCL publishes `map -> odom`. With a second parent the frame jumps between the two, and
    navigation loses the robot. A publisher that nothing triggers is reported too: one connection
    more, and it publishes. A deactivated one is a note.

    Fix: if it is the publisher of the lab, set Parent Frame ID to `{root}` and Child Frame ID to
    `{base}`. Delete or deactivate any other one. Isaac Sim's menu for odometry creates one named
    TFWorld2Odom below `/Graph/ROS_Odometry`.

    Example: `/Graph/ROS_Odometry/TFWorld2Odom` publishes `world -> {root}`.
    """
    subject = view.subject
    placements = list(_placements(view)) if view.odom else []
    for placement in placements:
        if placement.parent != subject.lab.frames.above:
            yield _placed(placement, view)
    known = {placement.node for placement in placements}
    for path in view.live_nodes:
        if path not in known and _is_forbidden_name(path, subject):
            yield Problem(
                path,
                "a node of this name publishes what the lab must not have",
                handout=subject.lab.frames.guard_handout,
                fix=edits_of_harm(subject, path),
            )
    yield from _put_away(subject)


def _placements(view: TfView) -> Iterator[_Placement]:
    seen = set()
    for edge in view.edges:
        if edge.child == view.odom and edge.cause not in seen:
            seen.add(edge.cause)
            port = _wrong_port(edge.parent, tf_ports(view.live_nodes[edge.cause]), view)
            yield _Placement(edge.cause, edge.parent, port)
    for path, node in view.live_nodes.items():
        names = tf_ports(node).names
        if (
            names
            and path not in seen
            and effective_value(node, names[1], view.live_nodes) == view.odom
        ):
            parent = effective_value(node, names[0], view.live_nodes)
            parent = parent if isinstance(parent, str) else None
            runs = path in running_nodes(view.subject.stage, view.subject.lab.platform)
            unheard = ", though not on a topic of tf2" if runs else ", though nothing triggers it"
            yield _Placement(path, parent, _wrong_port(parent, tf_ports(node), view), unheard)


def _wrong_port(parent: str | None, ports: TfPorts, view: TfView) -> str | None:
    """Return the setting to correct: the child's name where the parent's is right as it is."""
    right = {parent for parent, _ in view.subject.lab.frames.edges}
    if ports.names:
        return ports.names[1] if parent in right else ports.names[0]
    return ports.prims[1] if ports.prims else None


def _asked(placement: _Placement, view: TfView) -> tuple[str, str | None]:
    """Return what is expected of the node, and the hint where it is one that the lab needs.

    The publisher that the lab asks for must not be deleted: it places the robot in `odom`.
    """
    if placement.node not in view.role_specs:
        return "no such publisher", None
    up, down = next(edge for edge in view.subject.lab.frames.edges if edge[0] == view.odom)
    hint = f"set Parent Frame ID to `{up}` and Child Frame ID to `{down}`; keep the node"
    has_names = bool(tf_ports(view.live_nodes[placement.node]).names)
    return f"{up} -> {down}", hint if has_names else None


def _placed(placement: _Placement, view: TfView) -> Problem:
    frames = view.subject.lab.frames
    parent = "an unknown frame" if placement.parent is None else placement.parent
    expected, hint = _asked(placement, view)
    may = f"only {frames.localization.by} may" if frames.localization else "nothing may"
    return Problem(
        placement.node,
        f"publishes {parent} -> {view.odom}{placement.unheard}; {may} place '{view.odom}'",
        property=placement.port,
        expected=expected,
        actual=f"{parent} -> {view.odom}",
        handout=frames.guard_handout,
        hint=hint,
        fix=edits_of_harm(view.subject, placement.node, placement.port),
        frames=(view.odom,),
    )


def _is_forbidden_name(path: str, subject: StageSubject) -> bool:
    """Whether the prim has a forbidden name, a copy's number left aside."""
    forbidden = subject.lab.frames.forbidden
    name = re.sub(r"_\d+$", "", path.rpartition("/")[2])
    return forbidden is not None and name in forbidden.nodes


def _put_away(subject: StageSubject) -> Iterator[Problem]:
    """Note the publishers that somebody deactivated, as 8.11 advises."""
    platform = subject.lab.platform
    gone = [prim for graph in subject.stage.graphs for prim in graph.absent if graph.active]
    for absent in (*gone, *subject.stage.absent):
        kind = platform.get(absent.type_name)
        named = _is_forbidden_name(absent.path, subject)
        if absent.reason == _DELETED and (named or _places_odom(kind, absent, subject)):
            yield _note(absent.path, subject)
    for graph in subject.stage.graphs:
        for node in () if graph.active else graph.nodes:
            if _is_forbidden_name(node.path, subject) or _places_odom(node.type, node, subject):
                yield _note(node.path, subject)


def _places_odom(kind: NodeType | None, given: AbsentPrim | Node, subject: StageSubject) -> bool:
    if kind is None or kind.tf is None or not kind.tf.names:
        return False
    port = kind.tf.names[1]
    ports: Mapping[str, PortState] = given.ports
    value = ports[port].value if port in ports else kind.ports[port].default
    return value == subject.lab.frames.unplaced != ""


def _note(path: str, subject: StageSubject) -> Problem:
    return Problem(
        path,
        "is deactivated and publishes nothing; it can be deleted",
        handout=subject.lab.frames.guard_handout,
        severity="note",
    )


@rule("T08", "competes-with-localization", scope="frames", needs="localization")
def competes_with_localization(view: TfView) -> Iterator[Problem]:
    """The stage publishes `map -> odom`, as localization does.

    Why: AMCL corrects the robot's pose by moving `odom` in `map`. A second publisher of the same
    transform resets it in every frame, and the robot jumps.

    Fix: if it is the publisher of the lab, set Parent Frame ID to `{root}` and Child Frame ID to
    `{base}`. Delete any other one from the stage. Localization places this frame while the system
    runs.

    Example: a Publish Raw Transform Tree has Parent Frame ID `map` and Child Frame ID `odom`.
    """
    subject = view.subject
    localization = subject.lab.frames.localization
    if localization is None:
        return
    (parent, child), by = localization.edge, localization.by
    for placement in _placements(view):
        if placement.parent == parent:
            expected, hint = _asked(placement, view)
            yield Problem(
                placement.node,
                f"publishes {parent} -> {child}, which {by} publishes",
                property=placement.port,
                expected=expected,
                actual=f"{parent} -> {child}",
                handout=localization.handout,
                hint=hint,
                fix=edits_of_harm(subject, placement.node, placement.port),
            )
