"""The bodies that nodes follow, as odometry does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec import Struct

from lab3_usd.facts.execution_order import live_nodes, nodes_in
from lab3_usd.facts.reaching_values import live_sources
from lab3_usd.isaac.behaviour import BodyOf
from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset, listed_once


class Followed(Struct, frozen=True, eq=False):
    """A node that follows a body: the prim that it names, and the one that stands for it.

    `body` is None where a robot lists no link; `unknown` is a missing asset that could tell more.
    """

    node: Node
    asked: BodyOf
    prim: Prim
    body: Prim | None
    unknown: UnresolvedAsset | None

    @property
    def port(self) -> str:
        """The input that names the prim."""
        return INPUT + self.asked.prim

    @property
    def is_body(self) -> bool:
        """Whether there is anything to follow."""
        return self.body is not None and _is_body(self.body, self.asked)


@listed_once
def followed_bodies(stage: StageModel) -> Iterator[Followed]:
    """Yield the nodes that follow a prim."""
    for node, demand in nodes_in(stage.platform.bodies, stage):
        prim = stage.prim(_first(node.targets(INPUT + demand.prim)))
        if prim is None:
            continue
        path = prim.path
        is_robot = demand.robot in prim.apis and is_release_within(
            stage.platform.release, demand.robot_since, ""
        )
        if is_robot and not _is_body(prim, demand):
            path = _first(_links(prim, demand, stage))
        yield Followed(node, demand, prim, stage.prim(path), stage.unknown(prim.path, path))


def _first(paths: Iterable[str]) -> str:
    return next(iter(paths), "")


def _is_body(prim: Prim, demand: BodyOf) -> bool:
    return not prim.placeless and bool(set(prim.apis) & set(demand.schemas))


def _links(robot: Prim, demand: BodyOf, stage: StageModel, depth: int = 8) -> Iterator[str]:
    """Yield the links of a robot and of the robots that it lists, and those that are unknown."""
    if demand.link in robot.apis:
        yield robot.path
    elif demand.robot in robot.apis and depth:
        for path in robot.relationships.get(demand.links, ()):
            listed = stage.prim(path)
            if listed is not None:
                yield from _links(listed, demand, stage, depth - 1)
            elif stage.unknown(path):
                yield path


def moving_source(node: Node, stage: StageModel) -> Node | None:
    """Return the node that follows a body and gives what comes into another one, None for none."""
    for port in node.ports:
        for source, out in live_sources(node, port, live_nodes(stage)):
            kind = source.type
            demand = None if kind is None else stage.platform.bodies.get(kind.type)
            if demand is not None and out.removeprefix(OUTPUT) in demand.gives:
                return source
    return None
