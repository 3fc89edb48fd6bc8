"""Rules about nodes that change the scene or the run while it plays."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.lab_topics import role_specs
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import TF, rule
from lab3_usd.check.requirements import demands_of
from lab3_usd.check.robot.ground import planes
from lab3_usd.check.rules.world import at_rest
from lab3_usd.facts.changes import effect_on_run, writing_nodes, written_paths
from lab3_usd.facts.execution_order import live_nodes, severity_if_uncertain
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.isaac.behaviour import WriterPorts
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.changes import RemovePrim
from lab3_usd.model.finding import Problem, Severity, node_title
from lab3_usd.model.physics import SCENE
from lab3_usd.model.prims import is_at_or_below


@rule("N13", "scene-written", scope="stage")
def scene_written(subject: StageSubject) -> Iterator[Problem]:
    """A node changes the scene, commands the robot, or ends the run.

    Why: the written values replace the saved ones. It is an error if the node moves, disables or
    commands the robot or its ground, changes a node of the lab, or stops the simulation. Any other
    node that writes is a warning: the lab needs none. A node that is never triggered, or only by a
    key or the mouse, is not a fault.

    Fix: delete the node, or aim it at a prim that is not part of the lab.

    Example: Write Prim Attribute sets `drive:angular:physics:targetVelocity` of `{joint}`.
    """
    stage, lab = subject.stage, subject.lab
    live, played = live_nodes(stage), role_specs(subject)
    extra = {node.path for roles in subject.roles.values() for node in roles.extra}
    for node, ports in writing_nodes(stage):
        if node.path in played:
            continue  # the lab asks for it
        path, effect = node.path, effect_on_run(node, ports, live)
        written = written_paths(node, ports, live)
        hit = next(
            (at for at in written if _takes(at, ports, subject) and _is_of_lab(at, subject)), ""
        )
        name = effective_value(node, INPUT + ports.property, live) if ports.property else ""
        is_seen_only = (
            isinstance(name, str) and bool(name) and name.startswith(lab.platform.appearance)
        )
        is_harmful = bool(effect) or (bool(hit) and not is_seen_only)
        if not is_harmful and (path in extra or ports.is_view):
            continue  # the rule of extra nodes reports it
        what = f"{hit}.{name}" if hit and isinstance(name, str) and name else hit
        effect = effect or f"changes {what or ports.what} while the simulation runs"
        message = f"{node_title(node)} {effect}"
        severity: Severity | None = "warning"
        if is_harmful:
            severity = severity_if_uncertain(stage, path)
        role, robot = played.get(hit), lab.scene.robot_of(hit or "")
        yield Problem(
            path,
            message,
            expected="no node that writes",
            actual=node.saved_type,
            handout=role.handout if role is not None else (robot or lab.scene.robot).handout,
            related=(hit,) if hit else (),
            severity=severity,
            fix=(RemovePrim(path),),
            unmet=_unmet(hit, subject) if is_harmful and hit else (),
            # What ends the run ends the work of each graph.
            costs=(*subject.roles, TF) if is_harmful and not hit else (),
        )


def _takes(path: str, ports: WriterPorts, subject: StageSubject) -> bool:
    """Whether a prim can be written by a node of this type."""
    prim = subject.stage.prim(path) if ports.schemas else None
    return not ports.schemas or (prim is not None and not {*ports.schemas}.isdisjoint(prim.apis))


def _is_of_lab(path: str, subject: StageSubject) -> bool:
    """Whether a prim is, holds or belongs to the robot, what carries it, or a graph of the lab."""
    if subject.lab.scene.robot_of(path) or path in role_specs(subject):
        return True
    robots = [robot.path for robot in subject.lab.scene.robots]
    parts = [*robots, *(prim.path for robot in subject.robots for prim in planes(robot))]
    parts += [prim.path for prim in subject.stage.of_type(SCENE) if prim.present]
    parts += [roles.graph.path for roles in subject.roles.values() if roles.graph is not None]
    return any(is_at_or_below(part, path) for part in parts)


def _unmet(path: str, subject: StageSubject) -> tuple[str, ...]:
    """Return what a lab asks of a prim, else that the robot stays as it is."""
    for name, roles in subject.roles.items():
        if path in roles.role_of:
            return (f"{name}/node/{roles.role_of[path]}",)
    demands = demands_of(subject.lab, subject.checkpoint)
    robot = subject.lab.scene.robot_of(path) or subject.lab.scene.robot
    return tuple(demand.id for demand in demands if demand.prim == path) or (at_rest(robot),)
