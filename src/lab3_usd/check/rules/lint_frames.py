"""Rules about frames: one topic for a tree, odometry, and transforms that never change."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.articulations import moving_source
from lab3_usd.facts.endpoints import Endpoint, endpoints
from lab3_usd.facts.execution_order import effective_value
from lab3_usd.facts.frames import Edge, heard_trees
from lab3_usd.facts.written_names import odometry_pairs
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node


@rule("K58", "tree-on-two-topics", scope="lint", severity="warning")
def tree_on_two_topics(subject: LintSubject) -> Iterator[Problem]:
    """One TF tree is spread over two topics.

    Why: a tf2 listener subscribes to one topic for moving transforms. A namespace, such as
    `isaac:namespace` on the robot, moves some of them to another topic, and the tree is
    disconnected.

    Fix: publish all transforms of a robot on the same topic: give all nodes the same namespace.

    Example: `odom -> base_link` on `/tf`, and `base_link -> wheel` on `/robot1/tf`.
    """
    trees = heard_trees(subject.stage, subject.platform)
    for heard in trees:
        tops = heard.tree.roots
        hanging = [edge for edge in heard.tree.edges if edge.parent in tops]
        for other in trees:
            if heard.topic == other.topic or heard.domain != other.domain:
                continue
            if _share_edges(other.tree.edges, heard.tree.edges):
                continue
            known = {edge.child: edge for edge in other.tree.edges if edge.parent != edge.child}
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


def _share_edges(one: Iterable[Edge], other: Iterable[Edge]) -> bool:
    """Whether both have a transform of the same frames: each is the tree of a robot of its own."""
    pairs = ({(edge.parent, edge.child) for edge in edges} for edges in (one, other))
    return not next(pairs).isdisjoint(next(pairs))


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
