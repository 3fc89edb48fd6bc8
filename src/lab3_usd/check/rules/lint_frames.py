"""Rules about frames, and about whose bodies and sensors a node publishes, on whose topic."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.lint_motion import misnamed
from lab3_usd.facts.endpoints import running_endpoints
from lab3_usd.facts.execution_order import nodes_of
from lab3_usd.facts.feeding import commanded_robots, feeding_nodes, misnamed_poses, robot_spaces
from lab3_usd.facts.frame_targets import listed_targets, parent_prim, tf_ports
from lab3_usd.facts.frames import Edge, HeardTree, all_edges, heard_trees, shared_tf_topics
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.message_frames import odometry_pairs
from lab3_usd.model.finding import Place, Problem
from lab3_usd.model.physics import ARTICULATION_API
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import Node

_TWO = 2  # bodies that make a robot


@rule("K88", "another-robot", severity="warning")
def another_robot(subject: LintSubject) -> Iterator[Problem]:
    """A node publishes a part of another robot.

    Why: odometry, transforms or scans of one robot show how another one moves. Isaac Sim reports
    nothing. A robot is what joints connect; its topics are those in the namespace of its commands,
    its frames those of its prims.

    Fix: choose the prim of the right robot again. In a copy of a graph, every target is still that
    of the first robot.

    Example: Isaac Compute Odometry for `/robot1/odom` names `/World/robot2/base_link`.
    """
    told: set[Place] = set()
    for problem in (*_by_namespace(subject), *_by_frame(subject), *_by_parent(subject)):
        place = (problem.prim, problem.property)
        if place not in told:
            told.add(place)
            yield problem


def _by_namespace(subject: LintSubject) -> Iterator[Problem]:
    """Yield what shows another robot than the one that is commanded in the namespace."""
    spaces = robot_spaces(subject.stage)
    bodies = joined_bodies(subject.stage)
    robots = set(commanded_robots(subject.stage).values())
    robots |= {bodies.owner(root.path) for root in subject.stage.with_api(ARTICULATION_API)} - {""}
    parents = _parent_prims(subject)
    for end in running_endpoints(subject.stage, "publishes"):
        around = ((end.domain.name, space) for space in upwards(end.topic or ""))
        robot = next((spaces[space] for space in around if space in spaces), "")
        for node, port, prim in _shown(end.node, subject) if robot else ():
            owner = bodies.owner(prim)
            if owner not in robots or owner == robot:
                continue
            # A transform of another robot's root may say where that is.
            if not (tf_ports(node).prims and _is_root(prim, parents, subject)):
                yield Problem(
                    node.path,
                    f"{port} is {prim}, and {end.topic} is in the namespace of the commands of "
                    f"{robot}",
                    property=port,
                    expected=f"a prim of the robot of {robot}",
                    actual=prim,
                    related=() if node is end.node else (end.node.path,),
                    rests_on=subject.stage.unknown(prim, robot),
                )


def _shown(publisher: Node, subject: LintSubject) -> Iterator[tuple[Node, str, str]]:
    """Yield the prims that a node publishes about: who names them, where, and which."""
    for node in feeding_nodes(publisher, subject.live):
        ports = tf_ports(node).prims
        for port, state in node.ports.items():
            if port not in ports[:1]:  # what the others are relative to
                yield from ((node, port, path) for path in state.targets)


def _by_frame(subject: LintSubject) -> Iterator[Problem]:
    """Yield odometry that names the frame of another robot."""
    bodies = joined_bodies(subject.stage)
    for pose in misnamed_poses(subject.stage):
        path = pose.followed.prim.path
        if bodies.owner(pose.prim) not in {"", bodies.owner(path)}:
            yield misnamed(pose, "another robot", subject.stage.unknown(pose.prim, path))


def _by_parent(subject: LintSubject) -> Iterator[Problem]:
    """Yield transforms of links that hang below the frame of another robot.

    Those of another robot's root may be meant: they say where it is.
    """
    bodies, prims_above = joined_bodies(subject.stage), _parent_prims(subject)
    makers = dict.fromkeys(edge.cause for edge in all_edges(subject.stage) if edge.prim)
    parents = {path: parent_prim(subject.live[path]) for path in makers}
    owners = {path: bodies.owner(prim) for path, prim in parents.items() if prim}
    for path, owner in owners.items():
        node = subject.live[path]
        owner_of = {target: bodies.owner(target) for target in listed_targets(node)}
        foreign = {
            target: robot
            for target, robot in owner_of.items()
            if robot not in {"", owner}
            and bodies.sizes[robot] >= _TWO
            and not _is_root(target, prims_above, subject)
        }
        is_whole = len(foreign) == sum(bool(robot) for robot in owner_of.values())
        wrong = [
            target for target, robot in foreign.items() if is_whole or robot in owners.values()
        ]
        if owner and bodies.sizes[owner] >= _TWO and wrong:
            port = tf_ports(node).prims[1]
            yield Problem(
                path,
                f"{port} has {', '.join(wrong)} of another robot than {parents[path]}, below "
                "which they hang",
                property=port,
                expected=f"prims of the robot of {parents[path]}",
                actual=", ".join(wrong),
                rests_on=subject.stage.unknown(parents[path], *wrong),
            )


def _parent_prims(subject: LintSubject) -> frozenset[str]:
    """Return the prims below whose frames nodes hang others."""
    makers = nodes_of(lambda kind: kind.tf, subject.stage)
    return frozenset(map(parent_prim, makers))


def _is_root(path: str, parents: frozenset[str], subject: LintSubject) -> bool:
    """Whether a prim stands for all of a robot: the links of some tree hang below it."""
    prim = subject.stage.prim(path)
    is_articulation = prim is not None and ARTICULATION_API in prim.apis
    return is_articulation or path in parents or not joined_bodies(subject.stage).carrier(path)


@rule("K59", "shared-tf-topic", severity="warning")
def shared_tf_topic(subject: LintSubject) -> Iterator[Problem]:
    """A namespace above several robots joins their transforms.

    Why: of several `isaac:namespace` above a TF publisher only the outermost counts, where all of
    them count for other topics. The robots' topics are separate, but their transforms are not: a
    listener in the namespace of one robot receives no TF, and equal frame names of several robots
    collide.

    Fix: set Node Namespace on each TF publisher, or remove the namespace from the common prim.

    Example: `isaac:namespace` is `fleet` on `/World` and `robot1` and `robot2` on the robots: both
    publish on `/fleet/tf`.
    """
    name = subject.platform.ros.namespace_attribute
    for shared in shared_tf_topics(subject.stage):
        yield Problem(
            shared.prim,
            f"{name} puts the transforms of {' and '.join(shared.publishers)} on {shared.topic}",
            property=name,
            related=tuple(path for paths in shared.publishers.values() for path in paths),
            severity="error" if shared.clashes else None,
        )


@rule("K58", "tree-on-two-topics", severity="warning")
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


@rule("K56", "odometry-tf-mismatch", severity="warning", formerly="odometry-and-transform-differ")
def odometry_tf_mismatch(subject: LintSubject) -> Iterator[Problem]:
    """Odometry message and transform name different frames.

    Why: both give the pose of the robot. With different names they describe different frames, and
    localization can use neither.

    Fix: use the same two frames in both nodes.

    Example: the message has `odom` and `base_link`, the transform `odom -> base_footprint`.
    """
    for message, transform in odometry_pairs(subject.stage):
        if message.sent and message.frames != transform.frames:
            actual, expected = (" -> ".join(pose.frames) for pose in (message, transform))
            tree = transform.node.path
            yield Problem(
                message.node.path,
                f"the message names {actual}, but {tree} publishes {expected}",
                property=message.ports[1],
                expected=expected,
                actual=actual,
                related=(tree,),
                assumes=(*message.names, *transform.names),
            )
