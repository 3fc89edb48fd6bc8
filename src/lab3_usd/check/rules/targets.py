"""Rules about relationships: which prims a node works on."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.finding import Problem
from lab3_usd.check.met import follows_handout, target_met
from lab3_usd.check.model import Node
from lab3_usd.check.registry import rule
from lab3_usd.check.say import listed
from lab3_usd.check.subject import GraphSubject
from lab3_usd.spec.spec import NodeSpec, Target


def _targets(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec, Target]]:
    """Yield each relationship that is judged as a list of prims."""
    for role, spec in subject.spec.nodes.items():
        node = subject.roles.node_of[role]
        for target in spec.targets if node is not None else ():
            if node is not None and target.port not in spec.frames_from:
                yield node, spec, target


def _problem(node: Node, target: Target, message: str) -> Problem:
    return Problem(
        prim=node.path,
        property=target.port,
        message=message,
        expected=listed(target.prims),
        actual=listed(node.targets(target.port)),
        handout=target.handout,
        hint=f"select the node, clear the field in the Property panel, pick {listed(target.prims)}",
    )


@rule("R01", "missing-target", scope="graph")
def missing_target(subject: GraphSubject) -> Iterator[Problem]:
    """A relationship that a node needs names no prim.

    Why: without its prim the node does nothing: no articulation to drive, no sensor to render,
    no body whose odometry is computed. Isaac Compute Transform Tree without a parent prim hangs
    its frames below `world`, apart from the robot.

    Fix: select the node, click the picker of the field in the Property panel and choose the prim.

    Example: Articulation Controller without a target prim: the robot does not move.
    """
    for node, _, target in _targets(subject):
        if not node.targets(target.port):
            message = f"{target.port} names no prim, expected {listed(target.prims)}"
            yield _problem(node, target, message)


@rule("R02", "wrong-target", scope="graph")
def wrong_target(subject: GraphSubject) -> Iterator[Problem]:
    """A relationship names another prim than the handout asks for.

    Why: the node works on the wrong prim: a lidar helper on a camera publishes nothing, odometry
    of a wheel turns on the spot.

    Fix: select the node, clear the field in the Property panel and choose the prim named here.

    Example: Isaac Create Render Product of the lidar graph with the camera as its camera prim.
    Where the articulation root is on the robot root, `base_footprint` for the Articulation
    Controller is a warning: the handout asks for it, and Isaac Sim finds no articulation there.
    """
    for node, _, target in _targets(subject):
        actual = node.targets(target.port)
        if actual and not target_met(node, target):
            message = f"{target.port} is {listed(actual)}, expected {listed(target.prims)}"
            yield _problem(node, target, message)
        if follows_handout(node, target):
            root = listed(target.prims)
            message = f"{target.port} is {listed(actual)} as in the handout, but the articulation"
            message += f" root is on {root}: no articulation is found, and nothing moves"
            yield replace(_problem(node, target, message), severity="warning")


@rule("R03", "unknown-target", scope="graph", severity="warning")
def unknown_target(subject: GraphSubject) -> Iterator[Problem]:
    """A list of target prims names a prim that does not exist.

    Why: Isaac Sim skips it with a warning in the console; what it should have given is missing.

    Fix: select the node, and remove the entry in the Property panel or pick the prim that is meant.

    Example: Isaac Compute Transform Tree with a target that was renamed later.
    """
    for role, spec in subject.spec.nodes.items():
        node = subject.roles.node_of[role]
        asked = {path for target in spec.targets for path in target.prims}
        for port in spec.frames_from if node is not None else ():
            for path in node.targets(port) if node is not None else ():
                if path not in asked and node is not None and not _exists(subject, path):
                    message = f"{port} names {path}, which does not exist"
                    yield Problem(node.path, message, port, None, path, spec.handout)


def _exists(subject: GraphSubject, path: str) -> bool:
    if subject.stage.prim(path) is not None or path in subject.live:
        return True
    return subject.stage.unresolved_above(path) is not None
