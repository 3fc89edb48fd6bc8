"""The bodies that nodes follow, and the inputs that change as those move."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec import Struct

from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.ros.running import live_sources
from lab3_usd.model.absent_prims import is_unresolved
from lab3_usd.model.prims import Prim
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import INPUT, OUTPUT
from lab3_usd.spec.isaac import BodyOf


class Followed(Struct, frozen=True, eq=False):
    """A node that follows a body: the prim that it names, and the one that stands for it.

    `body` is None where a robot lists no link.
    """

    node: Node
    asked: BodyOf
    prim: Prim
    body: Prim | None

    @property
    def port(self) -> str:
        """The input that names the prim."""
        return INPUT + self.asked.prim

    @property
    def is_body(self) -> bool:
        """Whether there is anything to follow."""
        return self.body is not None and _is_body(self.body, self.asked)


def followed_bodies(subject: LintSubject) -> Iterator[Followed]:
    """Yield the nodes that follow a prim of which the stage tells everything."""
    stage = subject.stage
    for node in subject.live.values():
        asked = _asked(node, subject)
        prim = None if asked is None else stage.prim(_first(node.targets(INPUT + asked.prim)))
        if asked is None or prim is None:
            continue  # of a target that is not there another rule speaks
        path = prim.path
        if asked.robot in prim.apis and not _is_body(prim, asked):
            path = _first(_links(prim, asked, subject))
        if not any(is_unresolved(stage, each) for each in (prim.path, path)):
            yield Followed(node, asked, prim, stage.prim(path))


def _first(paths: Iterable[str]) -> str:
    return next(iter(paths), "")


def _is_body(prim: Prim, asked: BodyOf) -> bool:
    return bool(set(prim.apis) & set(asked.schemas))


def _asked(node: Node, subject: LintSubject) -> BodyOf | None:
    return None if node.type is None else subject.types.bodies.get(node.type.type)


def _links(robot: Prim, asked: BodyOf, subject: LintSubject, depth: int = 8) -> Iterator[str]:
    """Yield the links of a robot and of the robots that it lists; what is not known of as well."""
    if asked.link in robot.apis:
        yield robot.path
    elif asked.robot in robot.apis and depth:
        for path in robot.relationships.get(asked.links, ()):
            listed = subject.stage.prim(path)
            if listed is not None:
                yield from _links(listed, asked, subject, depth - 1)
            elif is_unresolved(subject.stage, path):
                yield path


def moving_source(node: Node, subject: LintSubject) -> Node | None:
    """Return the node that follows a body and gives what comes into another one, None for none."""
    for port in node.ports:
        for source, out in live_sources(node, port, subject.live):
            asked = _asked(source, subject)
            if asked is not None and out.removeprefix(OUTPUT) in asked.gives:
                return source
    return None
