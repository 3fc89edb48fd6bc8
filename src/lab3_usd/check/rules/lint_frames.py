"""Rules about frames: one tree, one publisher of each edge, and transforms that never change."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.articulations import moving_source
from lab3_usd.facts.domains import are_surely_one, domain_of
from lab3_usd.facts.endpoints import Endpoint, endpoints
from lab3_usd.facts.execution_order import effective_value
from lab3_usd.facts.frames import Edge, is_tree_known, moved_edges, published_edges, tree_of_tf2
from lab3_usd.facts.tree import frames_in_cycles
from lab3_usd.facts.written_names import message_frames, odometry_pairs
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.stage import Node


def _is_of_same_prim(one: Edge, other: Edge) -> bool:
    """Whether one node lists a prim twice: both transforms are the same, and tf2 takes one."""
    same_node = (one.publisher, one.cause) == (other.publisher, other.cause)
    return same_node and one.prim == other.prim is not None


def _grave(*edges: Edge) -> Severity | None:
    is_sure = all(edge.sure for edge in edges) and are_surely_one(edge.domain for edge in edges)
    return None if is_sure else "warning"


@rule("K50", "multiple-parents", scope="lint", formerly="frame-of-two-parents")
def multiple_parents(subject: LintSubject) -> Iterator[Problem]:
    """A frame has two parents.

    Why: tf2 keeps the latest transform. The frame, and everything below it, jumps from one parent
    to the other with every message.

    Fix: decide which publisher places the frame, and delete or correct the other.

    Example: `odom -> base_link` and `base_footprint -> base_link`, by two graphs.
    """
    first: dict[tuple[str, str], Edge] = {}
    judged: set[tuple[str, str]] = set()
    trees = tree_of_tf2(subject.stage, subject.platform)
    rings = {heard.domain: heard.tree.cycle for heard in trees}
    for edge in published_edges(subject.stage, subject.platform):
        if edge.child == edge.parent or edge.child in rings[edge.domain.name]:
            continue
        known = first.setdefault((edge.domain.name, edge.child), edge)
        if known.parent != edge.parent and (edge.cause, edge.child) not in judged:
            judged.add((edge.cause, edge.child))
            yield Problem(
                edge.cause,
                f"publishes {edge.parent} -> {edge.child}, and {known.publisher} publishes "
                f"{known.parent} -> {edge.child}",
                expected="one parent",
                actual=f"{edge.parent} -> {edge.child}",
                related=(known.publisher,),
                severity=_grave(known, edge),
            )


@rule("K51", "self-transform", scope="lint", formerly="frame-below-itself")
def self_transform(subject: LintSubject) -> Iterator[Problem]:
    """A frame is its own parent.

    Why: tf2 rejects the transform and logs a line for every message.

    Fix: remove the parent prim from the target prims, or correct the frame names.

    Example: Parent Prim and Target Prims of Isaac Compute Transform Tree name the same link.
    """
    judged: set[tuple[str, str]] = set()
    for edge in published_edges(subject.stage, subject.platform):
        if edge.parent == edge.child and (edge.cause, edge.child) not in judged:
            judged.add((edge.cause, edge.child))
            yield Problem(
                edge.cause,
                f"publishes {edge.parent} -> {edge.child}: the frame is its own parent",
                actual=f"{edge.parent} -> {edge.child}",
                related=() if edge.publisher == edge.cause else (edge.publisher,),
                severity=_grave(edge),
            )


@rule("K52", "tf-cycle", scope="lint", formerly="frames-in-a-ring")
def tf_cycle(subject: LintSubject) -> Iterator[Problem]:
    """The transforms form a cycle.

    Why: a cycle has no root: tf2 cannot look up any transform in it.

    Fix: exchange parent and child of the transform that closes the cycle, or delete it.

    Example: `odom -> base_link` and `base_link -> odom`.
    """
    for heard in tree_of_tf2(subject.stage, subject.platform):
        edges = [edge for edge in heard.tree.edges if edge.parent != edge.child]
        frames = frames_in_cycles(edges)
        inside = [edge for edge in edges if edge.parent in frames and edge.child in frames]
        if not inside:
            continue
        last = inside[-1]
        yield Problem(
            last.cause,
            f"publishes {last.parent} -> {last.child}, which closes a cycle of {', '.join(frames)}",
            actual=f"{last.parent} -> {last.child}",
            related=tuple(dict.fromkeys(e.publisher for e in inside if e is not last)),
            severity=_grave(*inside),
        )


@rule("K53", "disconnected-trees", scope="lint", severity="warning", formerly="trees-apart")
def disconnected_trees(subject: LintSubject) -> Iterator[Problem]:
    """The transforms form disconnected trees.

    Why: no transform leads from one tree to the other, so sensor data cannot be placed on the map.
    A node outside the stage, such as localization, may connect them.

    Fix: give the trees a common frame: the child of the odometry's transform must be the root of
    the robot's.

    Example: `odom -> base_link` beside `chassis -> wheel_left`.
    """
    is_known = is_tree_known(subject.stage, subject.platform)
    trees = tree_of_tf2(subject.stage, subject.platform) if is_known else ()
    for (largest, known), *others in (heard.tree.parts for heard in trees):
        for edges, frames in others:
            yield Problem(
                edges[0].cause,
                f"publishes the tree of {', '.join(sorted(frames))}, which is not connected to "
                f"that of {', '.join(sorted(known))}",
                related=(largest[0].publisher,),
            )


@rule("K58", "tree-on-two-topics", scope="lint", severity="warning")
def tree_on_two_topics(subject: LintSubject) -> Iterator[Problem]:
    """One TF tree is spread over two topics.

    Why: a tf2 listener subscribes to one topic for moving transforms. A namespace, such as
    `isaac:namespace` on the robot, moves some of them to another topic, and the tree is
    disconnected.

    Fix: publish all transforms of a robot on the same topic: give all nodes the same namespace.

    Example: `odom -> base_link` on `/tf`, and `base_link -> wheel` on `/robot1/tf`.
    """
    trees: dict[tuple[str, str], list[Edge]] = {}
    for edge in (
        *published_edges(subject.stage, subject.platform),
        *moved_edges(subject.stage, subject.platform),
    ):
        if edge.parent != edge.child:
            topic = edge.topic.removesuffix(_STATIC).removesuffix(_MOVING)
            trees.setdefault((topic, edge.domain.name), []).append(edge)
    for (topic, domain), below in trees.items():
        placed = {edge.child for edge in below}
        hanging = [edge for edge in below if edge.parent not in placed]
        for (other_topic, other_domain), above in trees.items():
            if topic == other_topic or domain != other_domain or _share_edges(above, below):
                continue
            known = {edge.child: edge for edge in above}
            lost = next((edge for edge in hanging if edge.parent in known), None)
            if lost is not None:
                carrier = known[lost.parent]
                yield Problem(
                    lost.cause,
                    f"publishes {lost.parent} -> {lost.child} on {lost.topic}, but "
                    f"{carrier.publisher} publishes {carrier.parent} -> {carrier.child} on "
                    f"{carrier.topic}",
                    expected=carrier.topic,
                    actual=lost.topic,
                    related=(carrier.publisher,),
                )


def _share_edges(one: list[Edge], other: list[Edge]) -> bool:
    """Whether both have a transform of the same frames: each is the tree of a robot of its own."""
    pairs = ({(edge.parent, edge.child) for edge in edges} for edges in (one, other))
    return not next(pairs).isdisjoint(next(pairs))


@rule("K54", "duplicate-transform", scope="lint", formerly="transform-of-two-publishers")
def duplicate_transform(subject: LintSubject) -> Iterator[Problem]:
    """A transform is published twice.

    Why: tf2 mixes both streams. If their times or poses differ, the frame jitters.

    Fix: delete one of the publishers, or remove one of two target prims with the same name.

    Example: two graphs publish `odom -> base_link`.
    """
    first: dict[tuple[str, str, str], Edge] = {}
    for edge in published_edges(subject.stage, subject.platform):
        known = first.setdefault((edge.domain.name, edge.parent, edge.child), edge)
        is_same = known is edge or _is_of_same_prim(known, edge)
        if not is_same and edge.parent != edge.child:
            same = "also for another prim" if known.publisher == edge.publisher else known.publisher
            by = "" if known.publisher == edge.publisher else " publishes as well"
            yield Problem(
                edge.cause,
                f"publishes {edge.parent} -> {edge.child}, {'which ' if by else ''}{same}{by}",
                actual=f"{edge.parent} -> {edge.child}",
                related=(known.publisher,) if by else (),
                severity=_grave(known, edge),
            )


@rule("K55", "unpublished-frame", scope="lint", severity="warning", formerly="frame-of-nobody")
def unpublished_frame(subject: LintSubject) -> Iterator[Problem]:
    """The stage does not publish the frame of a message.

    Why: without a transform no node can place the message, unless another node, such as a robot
    state publisher, sends it. The defaults `sim_lidar` and `sim_camera` are seldom frames of a
    robot.

    Fix: use a frame of the tree (for a sensor, its own), or publish the transform to this frame
    (for odometry, from its frame to that of the robot).

    Example: a scan in the frame `sim_lidar`, while the tree has `base_scan`.
    """
    is_known = is_tree_known(subject.stage, subject.platform)
    trees = tree_of_tf2(subject.stage, subject.platform) if is_known else ()
    domains = {heard.domain: heard.tree.edges for heard in trees}
    for node, port, value in message_frames(subject.stage, subject.platform):
        edges = domains.get(domain_of(node, subject.live).name, ())
        frames = {name for edge in edges for name in (edge.parent, edge.child)}
        if frames and value and value.lstrip("/") not in frames:
            yield Problem(
                node.path,
                f"{port} is '{value}', a frame that the stage does not publish",
                property=port,
                expected=", ".join(sorted(frames)),
                actual=value,
            )


@rule(
    "K56",
    "odometry-tf-mismatch",
    scope="lint",
    severity="warning",
    formerly="odometry-and-transform-differ",
)
def odometry_tf_mismatch(subject: LintSubject) -> Iterator[Problem]:
    """Odometry message and transform name different frames.

    Why: both give the pose of the robot. With different names they describe different frames, and
    localization can use neither.

    Fix: use the same two frames in both nodes.

    Example: the message has `odom` and `base_link`, the transform `odom -> base_footprint`.
    """
    for pair in odometry_pairs(subject.stage, subject.platform):
        if pair.message != pair.transform:
            yield Problem(
                pair.publisher.path,
                f"the message names {' -> '.join(pair.message)}, but {pair.tree.path} publishes "
                f"{' -> '.join(pair.transform)}",
                property=pair.port,
                expected=" -> ".join(pair.transform),
                actual=" -> ".join(pair.message),
                related=(pair.tree.path,),
            )


_STATIC, _MOVING = "/tf_static", "/tf"


@rule("K57", "static-transforms", scope="lint")
def static_transforms(subject: LintSubject) -> Iterator[Problem]:
    """Moving transforms are sent once, or static ones repeatedly.

    Why: with Static Publisher on, a transform is sent only at the first tick, and stored for later
    subscribers. On `/tf_static` tf2 requests stored messages and accepts no others. A transform
    that is sent once never moves again: the robot stays where it was at the first tick.

    Fix: enable Static Publisher for `/tf_static` only, and for transforms that never change.
    Odometry belongs on `/tf`, with Static Publisher off.

    Example: a Publish Raw Transform Tree on `/tf_static` with Static Publisher off.
    """
    for endpoint in endpoints(subject.stage, subject.platform):
        ports = None if endpoint.node.type is None else endpoint.node.type.tf
        if not (endpoint.runs and endpoint.topic and endpoint.qos and ports and ports.static):
            continue
        is_once = effective_value(endpoint.node, ports.static, subject.live) is True
        is_kept = endpoint.qos.durability == "transient_local"
        is_for_static = endpoint.topic.endswith(_STATIC)
        moves = (
            moving_source(endpoint.node, subject.stage, subject.platform) if is_for_static else None
        )
        if moves is not None and (is_once or not is_kept):
            yield _moving(endpoint, moves, ports.static if is_once else None)
        elif not is_kept if is_for_static else is_once:
            how = "without keeping it for tf2" if is_for_static else "once, at the first tick"
            yield Problem(
                endpoint.node.path,
                f"publishes {endpoint.topic} {how}",
                property=ports.static,
                expected=str(is_for_static),
                actual=str(is_once),
                severity=None if endpoint.sure else "warning",
            )


def _moving(endpoint: Endpoint, moves: Node, switch: str | None) -> Problem:
    """Say that what moves belongs on another topic; `switch` is on where it is sent once."""
    topic = str(endpoint.topic)
    belongs = topic.removesuffix(_STATIC) + _MOVING
    how = "once, at the first tick" if switch else "without keeping it for tf2"
    return Problem(
        endpoint.node.path,
        f"publishes {topic} {how}; the pose from {moves.path} changes and belongs on {belongs}",
        property=switch or endpoint.port,
        expected="False" if switch else belongs,
        actual="True" if switch else topic,
        related=(moves.path,),
        severity=None if endpoint.sure else "warning",
    )
