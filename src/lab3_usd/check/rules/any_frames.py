"""Rules about the TF tree that hold with and without a lab: one tree, one publisher of each edge.

Each listener of tf2 is judged by itself: what is sent in other domains, or on other topics, never
meets.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from lab3_usd.check.lab_frames import TfView, self_target_problems
from lab3_usd.check.lab_topics import once_there
from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import frame_places, rule
from lab3_usd.facts.domains import are_surely_one
from lab3_usd.facts.frame_targets import tf_ports
from lab3_usd.facts.frames import (
    Edge,
    HeardTree,
    frames_in,
    heard_trees,
    is_tree_known,
    known_tops,
    shared_tf_topics,
)
from lab3_usd.facts.message_frames import message_frames, odometry_pairs
from lab3_usd.facts.tree import Tree, tree_of
from lab3_usd.model.changes import SetValue
from lab3_usd.model.finding import Place, Problem, Severity

TransformsSubject = LintSubject | TfView


def _trees(subject: TransformsSubject) -> tuple[HeardTree, ...]:
    """Return the transforms, by listener, that no other rule finds fault with."""
    return heard_trees(subject.stage) if isinstance(subject, LintSubject) else subject.trees()


def _are_one(edges: Iterable[Edge], subject: TransformsSubject) -> bool:
    """Whether domains of one name are one: in a lab, whose environment names none but its own."""
    return isinstance(subject, TfView) or are_surely_one(edge.domain for edge in edges)


def _is_asked(edge: Edge, subject: TransformsSubject) -> bool:
    """Whether a lab asks for a transform, of the node that sends it."""
    return isinstance(subject, TfView) and subject.is_asked(edge)


def _assumed(edges: Iterable[Edge], subject: TransformsSubject) -> tuple[Place, ...]:
    """Return what a problem of transforms rests on: the names and namespaces, or the types."""
    if isinstance(subject, TfView):
        return subject.assumed(edges)
    edges = tuple(edges)
    publishers = {edge.publisher for edge in edges}
    causes = (subject.live[path] for path in dict.fromkeys(edge.cause for edge in edges))
    return (
        *((node.path, port) for node in causes for port in tf_ports(node).names),
        *(
            (shared.prim, subject.platform.ros.namespace_attribute)
            for shared in shared_tf_topics(subject.stage)
            if any(publishers & {*paths} for paths in shared.publishers.values())
        ),
    )


def _severity(clashes: Iterable[Sequence[Edge]], subject: TransformsSubject) -> Severity | None:
    """Return how grave it is that transforms clash: a warning where none of them surely do."""
    is_sure = any(
        all(edge.sure for edge in edges) and _are_one(edges, subject) for edges in clashes
    )
    return None if is_sure else "warning"


def _right(edges: Sequence[Edge], subject: TransformsSubject) -> Edge:
    """Return the transform that stays: the one that a lab asks for, else the first."""
    return next((edge for edge in edges if _is_asked(edge, subject)), edges[0])


def _others(edges: Iterable[Edge], site: Edge) -> tuple[str, ...]:
    return tuple(dict.fromkeys(e.publisher for e in edges if e.publisher != site.publisher))


@rule("K50", "multiple-parents", formerly="frame-of-two-parents")
@rule("T03", "two-parents", scope="frames")
def two_parents(subject: TransformsSubject) -> Iterator[Problem]:
    """A frame has two parents.

    Why: tf2 keeps the latest transform. The frame, and everything below it, jumps from one parent
    to the other with every message.

    Fix: decide which publisher places the frame, and delete or correct the other. All graphs of the
    stage count, also those under `/Graph`, as far as they publish in one domain on one topic.

    Example: `/Graph/Frames` publishes `{root} -> {link}` beside `{base} -> {link}` of another
    graph.
    """
    for heard in _trees(subject):
        clashes: dict[str, list[tuple[Edge, Edge]]] = {}
        for child in heard.tree.several_parents:
            if child not in heard.tree.cycle:
                edges = [e for e in heard.tree.by_child[child] if e.parent != child]
                right = _right(edges, subject)
                for edge in edges:
                    if edge.parent != right.parent:
                        clashes.setdefault(edge.cause, []).append((edge, right))
        for cause, pairs in clashes.items():
            wrong = [edge for edge, _ in pairs]
            sites = "; ".join(dict.fromkeys(f"{e.parent} -> {e.child}" for e in wrong))
            children = tuple(dict.fromkeys(edge.child for edge in wrong))
            names = ", ".join(f"'{child}'" for child in children)
            rivals = [edge for child in children for edge in heard.tree.by_child[child]]
            yield Problem(
                cause,
                f"publishes {sites}; so {names} {'have' if len(children) > 1 else 'has'} two "
                "parents",
                expected=", ".join(dict.fromkeys(f"{e.parent} -> {e.child}" for _, e in pairs)),
                actual=sites,
                related=_others(rivals, wrong[0]),
                severity=_severity(pairs, subject),
                covers=frame_places(*children),
                assumes=_assumed((edge for pair in pairs for edge in pair), subject),
            )


@rule("K54", "duplicate-transform", formerly="transform-of-two-publishers")
@rule("T04", "transform-published-twice", scope="frames")
def duplicate_transform(subject: TransformsSubject) -> Iterator[Problem]:
    """A transform is published twice.

    Why: tf2 mixes the two streams. If their times differ, it warns of old data continuously, and
    the frame jitters between two poses.

    Fix: delete one of the publishers, most often a copy of the whole graph. If two target prims
    have one frame name, remove one of them.

    Example: `{tree_graph_name}` was copied to `/World`, and both publish `{root} -> {base}`.
    """
    for heard in _trees(subject):
        again: dict[str, list[tuple[Edge, Edge]]] = {}
        for edges in heard.tree.several_publishers.values():
            right = _right(edges, subject)
            for edge in edges:
                if edge.publisher != right.publisher:
                    again.setdefault(edge.publisher, []).append((edge, right))
        for publisher, pairs in again.items():
            twice = dict.fromkeys((edge.parent, edge.child) for edge, _ in pairs)
            sites = ", ".join(f"{parent} -> {child}" for parent, child in twice)
            rivals = [edge for pair in twice for edge in heard.tree.several_publishers[pair]]
            own = [edge for edge, _ in pairs]
            lists = subject.exchanged(own) if isinstance(subject, TfView) else ()
            yield Problem(
                publisher,
                f"publishes {sites}, which another node publishes as well",
                actual=sites,
                related=_others(rivals, pairs[0][0]),
                severity=_severity(pairs, subject),
                assumes=(*_assumed(own, subject), once_there(publisher), *lists),
            )
        for same in _of_several_prims(heard.tree):
            prims = " and ".join(dict.fromkeys(str(edge.prim) for edge in same))
            yield Problem(
                same[0].cause,
                f"gives the frame '{same[0].child}' to {prims}",
                expected="one prim for each frame",
                actual=prims,
                severity=_severity([same], subject),
                covers=frame_places(same[0].child),
            )


def _of_several_prims(heard: Tree[Edge]) -> Iterator[list[Edge]]:
    """Yield the transforms that one publisher sends for more than one prim, by parent and child."""
    sent: dict[tuple[str, str], list[Edge]] = {}
    for edge in heard.edges:
        if edge.parent != edge.child:
            sent.setdefault((edge.parent, edge.child), []).append(edge)
    for pair, edges in sent.items():
        if pair not in heard.several_publishers and len({edge.prim for edge in edges}) > 1:
            yield edges


@rule("K51", "self-transform", formerly="frame-below-itself")
@rule("T09", "frame-is-its-own-parent", scope="frames")
def self_transform(subject: TransformsSubject) -> Iterator[Problem]:
    """A frame is its own parent.

    Why: tf2 rejects such a transform (TF_SELF_TRANSFORM) and logs an error for every message. Isaac
    Sim omits the parent prim only if a robot root is the target, not if the parent prim itself is
    listed. If an articulation root above it is the target, the other frames still arrive: a
    warning. Where the lab asks for no parent prim, they arrive below it, and its own frame not at
    all: an error.

    Fix: remove the parent prim from the Target Prims of Isaac Compute Transform Tree. It is the
    parent of the other frames, and another node places it. If the node names its frames itself,
    correct the names.

    Example: Parent Prim is `{robot}/{base}`, and so is one of the Target Prims.
    """
    if isinstance(subject, TfView):
        yield from self_target_problems(subject)
    for heard in _trees(subject):
        own: dict[tuple[str, str], Edge] = {}
        for edge in heard.tree.self_parents:
            own.setdefault((edge.cause, edge.child), edge)
        for (cause, frame), edge in own.items():
            yield Problem(
                cause,
                f"publishes '{frame}' as its own parent",
                actual=f"{frame} -> {frame}",
                related=() if edge.publisher == cause else (edge.publisher,),
                severity=_severity([(edge,)], subject),
                covers=frame_places(frame),
                assumes=_assumed([edge], subject),
            )


@rule("K52", "tf-cycle", formerly="frames-in-a-ring")
@rule("T05", "frame-cycle", scope="frames", formerly="ring-of-frames")
def frame_cycle(subject: TransformsSubject) -> Iterator[Problem]:
    """The transforms form a cycle.

    Why: tf2 needs a tree. In a cycle it finds no root and refuses every lookup that reaches it.

    Fix: delete the transform that closes the cycle. Most often its parent and child are exchanged.

    Example: a second publisher sends `{link} -> {base}` beside `{base} -> {link}`.
    """
    for heard in _trees(subject):
        cycle = heard.tree.cycle
        inside = [
            edge
            for edge in heard.tree.edges
            if edge.parent in cycle and edge.child in cycle and edge.parent != edge.child
        ]
        if inside:
            is_sure = _are_one(inside, subject)
            is_sure = is_sure and bool(tree_of(edge for edge in inside if edge.sure).cycle)
            site = next(
                (edge for edge in reversed(inside) if not _is_asked(edge, subject)), inside[-1]
            )
            yield Problem(
                site.cause,
                f"{site.parent} -> {site.child} closes a cycle of the frames {', '.join(cycle)}",
                actual=f"{site.parent} -> {site.child}",
                related=_others(inside, site),
                severity=None if is_sure else "warning",
                assumes=_assumed([site], subject),
            )


@rule("K53", "disconnected-trees", severity="warning", formerly="trees-apart")
@rule("T06", "disconnected-frames", scope="frames", formerly="frames-not-connected")
def disconnected_frames(subject: TransformsSubject) -> Iterator[Problem]:
    """The transforms form disconnected trees.

    Why: tf2 cannot transform between two trees, so sensor data in one cannot be placed in the
    other. {localization?}From localization on, the one tree of the lab begins at the frame of the
    map. {/}Without a lab, a node outside the stage, such as localization, may connect them: a
    warning.

    Fix: publish the frame below a frame of the robot, or delete its publisher. {wheels?}The child
    of the odometry's transform must be the root of the robot's. {/}A node with an empty Parent Prim
    puts its frames below `world`, which is a frame of few robots.

    Example: a second Isaac Compute Transform Tree has no parent prim and publishes `world ->
    {link}`.
    """
    view = subject if isinstance(subject, TfView) else None
    for heard in _trees(subject):
        tops = known_tops(heard, subject.stage) if view is None else view.tops(heard)
        if not tops or heard.tree.below(*tops) >= heard.tree.frames:
            continue
        for edges, frames in heard.tree.parts:
            loose = [edge for edge in edges if edge.parent != edge.child]
            is_cyclic = any(edge.child in heard.tree.cycle for edge in loose)
            if loose and not is_cyclic and frames.isdisjoint(tops):
                names = ", ".join(dict.fromkeys(f"{edge.parent} -> {edge.child}" for edge in loose))
                joins = _joining_frame(loose, heard.tree, subject)
                yield Problem(
                    loose[0].cause,
                    f"publishes {names}, which is not connected to '{tops[0]}'",
                    actual=names,
                    hint=_JOINS.format(joins[0].prim, joins[0].value) if joins else None,
                    fix=joins,
                    likely=True,
                    severity=_severity(((edge,) for edge in loose), subject),
                    assumes=_assumed(loose, subject),
                    covers=tuple((edit.prim, edit.property) for edit in joins),
                    identity=min(frames - {edge.child for edge in loose}, default=""),
                )


_JOINS = "set the child frame of {} to {}, as the odometry message of the same pose names it"


def _joining_frame(
    loose: Sequence[Edge], whole: Tree[Edge], subject: TransformsSubject
) -> tuple[SetValue, ...]:
    """Return what names the child of a loose transform as the message of the same pose does.

    It does where that frame is in another tree.
    """
    publishers = {edge.publisher for edge in loose}
    own = {edge.child for edge in loose} | {edge.parent for edge in loose}
    other_frames = {frame for _, frames in whole.parts for frame in frames} - own
    return tuple(
        SetValue(transform.node.path, transform.ports[1], "string", message.frames[1])
        for message, transform in odometry_pairs(subject.stage)
        if publishers == {transform.node.path}
        and message.frames[0] == transform.frames[0]
        and message.frames[1] in other_frames
        and not transform.node.sources(transform.ports[1])
    )[:1]


@rule("K55", "unpublished-frame", severity="warning", formerly="frame-of-nobody")
@rule("T11", "frame-id-not-in-tree", scope="frames", formerly="frame-id-outside-the-tree")
def unpublished_frame(subject: TransformsSubject) -> Iterator[Problem]:
    """The stage does not publish the frame of a message.

    Why: a subscriber asks tf2 for the frame and waits forever, unless another node, such as a robot
    state publisher, sends it. Isaac Sim reports no error. The defaults `sim_lidar` and `sim_camera`
    are seldom frames of a robot.

    Fix: set the frame id of the publisher to a frame that the stage publishes (for a sensor, its
    own), or publish that frame{wheels?} (for odometry, from its frame to that of the robot){/}.

    Example: an IMU publisher keeps its default frame id, and no transform places that frame.
    """
    view = subject if isinstance(subject, TfView) else None
    if view is None and not is_tree_known(subject.stage):
        return
    for named in message_frames(subject.stage) if view is None else view.message_frames():
        node, domain = named.endpoint.node, named.endpoint.domain.name
        frames = frames_in(subject.stage, domain) if view is None else view.frames_in(domain)
        if frames and named.name not in frames:
            is_free = view is not None and node.path not in view.role_specs
            hidden = () if view is None else [unknown.prim for unknown in view.hidden]
            yield Problem(
                node.path,
                f"{named.port} is '{named.name}', a frame that the stage does not publish",
                property=named.port,
                expected=", ".join(sorted(frames)),
                actual=named.name,
                severity="warning" if is_free else None,
                assumes=((node.path, named.port),),
                rests_on=subject.stage.unknown(*hidden),
            )
