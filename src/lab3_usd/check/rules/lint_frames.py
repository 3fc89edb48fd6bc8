"""Rules about frames: one topic for a tree, and odometry that agrees with its transform."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.frames import Edge, HeardTree, heard_trees
from lab3_usd.facts.message_frames import odometry_pairs
from lab3_usd.model.finding import Problem


@rule("K58", "tree-on-two-topics", scope="lint", severity="warning")
def tree_on_two_topics(subject: LintSubject) -> Iterator[Problem]:
    """One TF tree is spread over two topics.

    Why: a tf2 listener subscribes to one topic for moving transforms. A namespace, such as
    `isaac:namespace` on the robot, moves some of them to another topic, and the tree is
    disconnected.

    Fix: publish all transforms of a robot on the same topic: give all nodes the same namespace.

    Example: `odom -> base_link` on `/tf`, and `base_link -> wheel` on `/robot1/tf`.
    """
    trees = heard_trees(subject.stage)
    carriers: dict[tuple[str, str], dict[int, Edge]] = {}  # by domain and frame: where it is placed
    for number, other in enumerate(trees):
        for edge in other.tree.edges:
            if edge.parent != edge.child:
                carriers.setdefault((other.domain, edge.child), {})[number] = edge
    for heard in trees:
        tops, own = frozenset(heard.tree.roots), _frames(heard)
        hanging = [edge for edge in heard.tree.edges if edge.parent in tops]
        lost_in: dict[int, tuple[Edge, Edge]] = {}
        for lost in hanging:
            for number, carrier in carriers.get((heard.domain, lost.parent), {}).items():
                lost_in.setdefault(number, (lost, carrier))
        for number, (lost, carrier) in sorted(lost_in.items(), key=lambda each: each[0]):
            # Trees with a transform of the same frames are those of robots of their own.
            is_other = trees[number].topic != heard.topic
            if is_other and own.isdisjoint(_frames(trees[number])):
                yield Problem(
                    lost.cause,
                    f"publishes {lost.parent} -> {lost.child} on {lost.topic}, but "
                    f"{carrier.publisher} publishes {carrier.parent} -> {carrier.child} on "
                    f"{carrier.topic}",
                    expected=carrier.topic,
                    actual=lost.topic,
                    related=(carrier.publisher,),
                )


def _frames(heard: HeardTree) -> set[tuple[str, str]]:
    """Return the frames of the transforms of a tree."""
    return {(edge.parent, edge.child) for edge in heard.tree.edges}


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
    for pair in odometry_pairs(subject.stage):
        if pair.sent and pair.message != pair.transform:
            yield Problem(
                pair.publisher.path,
                f"the message names {' -> '.join(pair.message)}, but {pair.tree.path} publishes "
                f"{' -> '.join(pair.transform)}",
                property=pair.port,
                expected=" -> ".join(pair.transform),
                actual=" -> ".join(pair.message),
                related=(pair.tree.path,),
                assumes=pair.names,
            )
