"""What feeds a node over wires of data: which commands move a robot, and whose pose is sent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import Struct

from lab3_usd.facts.articulations import commands
from lab3_usd.facts.endpoints import running_endpoints
from lab3_usd.facts.execution_order import live_nodes, running_nodes
from lab3_usd.facts.followed_bodies import Followed, followed_bodies
from lab3_usd.facts.frame_targets import tf_ports
from lab3_usd.facts.frames import tf2_name
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.reaching_values import Nodes, effective_value, live_sources
from lab3_usd.facts.sensor_topics import frame_prims
from lab3_usd.model.prims import Matrix, Prim
from lab3_usd.model.stage import Node, StageModel, listed_once, once_per_stage
from lab3_usd.model.transforms import Vector, distance

_APART = 0.02  # metres between places that are two


def feeding_nodes(node: Node, live: Nodes) -> list[Node]:
    """Return the nodes whose values reach a node, itself first."""
    nodes = {node.path: node}
    ahead = [node]
    while ahead:
        taker = ahead.pop()
        for port, state in taker.ports.items():
            if not state.sources:
                continue
            declared = None if taker.type is None else taker.type.port(port)
            if declared is not None and declared.is_execution:
                continue
            for source, _ in live_sources(taker, port, live):
                if source.path not in nodes:
                    nodes[source.path] = source
                    ahead.append(source)
    return list(nodes.values())


@once_per_stage
def used_nodes(stage: StageModel) -> frozenset[str]:
    """Return the paths of the nodes that run or may run, and of those whose values they use."""
    live = live_nodes(stage)
    return frozenset(
        source.path
        for node in running_nodes(stage).values()
        for source in feeding_nodes(node, live)
    )


@once_per_stage
def commanded_robots(stage: StageModel) -> Mapping[tuple[str, str], str]:
    """Return the first body of the robot that each topic of commands moves, by domain and topic.

    A topic that moves several robots is left out.
    """
    live, bodies = live_nodes(stage), joined_bodies(stage)
    topics = {
        end.node.path: (end.domain.name, str(end.topic))
        for end in running_endpoints(stage, "subscribes")
    }
    moved: dict[tuple[str, str], set[str]] = {}
    for command in commands(stage):
        robots = {robot for root in command.roots if (robot := bodies.owner(root))}
        for node in feeding_nodes(command.node, live) if robots else ():
            if node.path in topics:
                moved.setdefault(topics[node.path], set()).update(robots)
    return {key: robots.pop() for key, robots in moved.items() if len(robots) == 1}


@once_per_stage
def robot_spaces(stage: StageModel) -> Mapping[tuple[str, str], str]:
    """Return the namespaces in which one robot alone is commanded, by domain, with its first body.

    What is below a namespace counts as in it.
    """
    spaces: dict[tuple[str, str], set[str]] = {}
    for (domain, topic), robot in commanded_robots(stage).items():
        space = topic.rpartition("/")[0]
        while space:
            spaces.setdefault((domain, space), set()).add(robot)
            space = space.rpartition("/")[0]
    return {key: robots.pop() for key, robots in spaces.items() if len(robots) == 1}


class MisnamedPose(Struct, frozen=True, eq=False):
    """The pose of a body that is sent as that of another one, which moves against it or is apart.

    `publisher` sends it as the pose of `frame`, which is the frame of `prim`. `away` is how many
    metres it stands from it, 0 where it moves against it.
    """

    followed: Followed
    publisher: str
    frame: str
    prim: str
    away: float = 0.0


@listed_once
def misnamed_poses(stage: StageModel) -> Iterator[MisnamedPose]:
    """Yield the poses of bodies that are sent under the frame of another one."""
    live, bodies = live_nodes(stage), joined_bodies(stage)
    prims_of = frame_prims(stage)
    moving: dict[tuple[str, str], set[str]] = {}  # by domain and frame: what it moves with
    starts: dict[tuple[str, str], dict[Vector, None]] = {}  # and where it stands
    followers = {followed.node.path: followed for followed in followed_bodies(stage)}
    for end in running_endpoints(stage, "publishes") if followers else ():
        kind = end.node.type
        frames = () if kind is None else (tf_ports(end.node).names or kind.frames)
        if len(frames) != len(("parent", "child")):
            continue
        name = effective_value(end.node, frames[1], live)
        name = tf2_name(name) if isinstance(name, str) else ""
        key = (end.domain.name, name)
        prims = prims_of.get(key, ())
        for node in feeding_nodes(end.node, live) if prims else ():
            followed = followers.get(node.path)
            body = None if followed is None else followed.body
            if followed is None or body is None or not bodies.carrier(body.path):
                continue
            if key not in moving:
                moving[key] = set(map(bodies.rigid_of, prims))
                ends = [stage.prim(path) for path in prims]
                worlds = [end.world for end in ends if end is not None and end.world is not None]
                is_known = len(worlds) == len(prims)
                starts[key] = dict.fromkeys(map(_start, worlds)) if is_known else {}
            if bodies.rigid_of(body.path) not in moving[key]:
                yield MisnamedPose(followed, end.node.path, name, prims[0])
            elif away := _away(body, starts[key], stage):
                yield MisnamedPose(followed, end.node.path, name, prims[0], away)


def _start(world: Matrix) -> Vector:
    return world[12], world[13], world[14]


def _away(body: Prim, starts: Mapping[Vector, None], stage: StageModel) -> float:
    """Return how far a body stands from the nearest place, 0 where one is there."""
    start = None if body.world is None else _start(body.world)
    if start is None or start in starts or not starts:
        return 0.0
    away = min(distance(start, end) for end in starts) * stage.meters_per_unit
    return away if away > _APART else 0.0
