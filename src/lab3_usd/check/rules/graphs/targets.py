"""Rules about relationships: which prims a node works on."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from lab3_usd.check.match.conformance import target_matches, targets_handout_prims, targets_prims
from lab3_usd.check.match.subject import GraphSubject
from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem
from lab3_usd.model.formatting import format_paths
from lab3_usd.model.stage import Node
from lab3_usd.spec.graph import NodeSpec, Target


def _targets(subject: GraphSubject) -> Iterator[tuple[Node, NodeSpec, Target]]:
    """Yield each relationship that is judged as a list of prims."""
    for node, spec in subject.matched():
        for target in spec.targets:
            if target.port not in spec.frames_from:
                yield node, spec, target


def _problem(node: Node, target: Target, message: str) -> Problem:
    return Problem(
        prim=node.path,
        property=target.port,
        message=message,
        expected=format_paths(target.prims),
        actual=format_paths(node.targets(target.port)),
        handout=target.handout,
        hint="select the node, clear the field in the Property panel, "
        f"pick {format_paths(target.prims)}",
    )


def _awaits_its_sensor(subject: GraphSubject, node: Node, target: Target) -> bool:
    """Whether a relationship names where the lab has a sensor that stands elsewhere."""
    spec = subject.lab.graphs[subject.spec.name].nodes[subject.roles.role_of[node.path]]
    named = [each.prims for each in spec.targets if each.port == target.port]
    return named != [target.prims] and any(targets_prims(node, target, each) for each in named)


@rule("R01", "missing-target", scope="graph")
def missing_target(subject: GraphSubject) -> Iterator[Problem]:
    """A required relationship of a node has no target.

    Why: without its target the node does nothing: it has no articulation to drive, no sensor to
    render, or no body for odometry. Isaac Compute Transform Tree without a parent prim puts its
    frames below `world`, separate from the robot.

    Fix: select the node, click the target field in the Property panel and choose the prim.

    Example: Articulation Controller without a target prim: the robot does not move.
    """
    for node, _, target in _targets(subject):
        if not node.targets(target.port):
            state, asked = node.state(target.port), format_paths(target.prims)
            message = f"{target.port} names no prim, expected {asked}"
            if state is not None and state.usd_type != "rel":
                message = f"{target.port} is an attribute, expected a relationship to {asked}"
            yield _problem(node, target, message)


@rule("R02", "wrong-target", scope="graph")
def wrong_target(subject: GraphSubject) -> Iterator[Problem]:
    """A relationship targets another prim than the handout asks for.

    Why: the node works on the wrong prim. A lidar helper on a camera publishes nothing. Odometry of
    a wheel rotates on the spot.

    Fix: select the node, clear the field in the Property panel and choose the prim named here.

    Example: Isaac Create Render Product of the lidar graph with the camera as its camera prim. If
    the articulation root is on the robot root, `{base}` for the Articulation Controller is a
    warning: the handout asks for it, but Isaac Sim finds no articulation there.
    """
    for node, _, target in _targets(subject):
        actual = node.targets(target.port)
        if _awaits_its_sensor(subject, node, target):
            continue  # the sensor is to be moved back, and then it is the target
        if actual and not target_matches(node, target):
            message = (
                f"{target.port} is {format_paths(actual)}, expected {format_paths(target.prims)}"
            )
            yield _problem(node, target, message)
        if targets_handout_prims(node, target):
            root = format_paths(target.prims)
            message = (
                f"{target.port} is {format_paths(actual)} as in the handout, but the articulation"
            )
            message += f" root is on {root}: no articulation is found, and nothing moves"
            yield replace(_problem(node, target, message), severity="warning")


@rule("R03", "unknown-target", scope="graph", severity="warning")
def unknown_target(subject: GraphSubject) -> Iterator[Problem]:
    """A target list names a prim that does not exist.

    Why: Isaac Sim skips the target with a warning in the console, and its frame is missing.

    Fix: select the node, and remove the target in the Property panel or choose the intended prim.

    Example: Isaac Compute Transform Tree with a target that was renamed later.
    """
    for node, spec in subject.matched():
        asked = {path for target in spec.targets for path in target.prims}
        for port in spec.frames_from:
            for path in node.targets(port):
                if path not in asked and not _exists(subject, path):
                    message = f"{port} names {path}, which does not exist"
                    yield Problem(node.path, message, port, None, path, spec.handout)


def _exists(subject: GraphSubject, path: str) -> bool:
    if subject.stage.prim(path) is not None or path in subject.live_nodes:
        return True
    return subject.stage.unresolved_above(path) is not None
