"""References to checkpoints, deliverables and saved output that do not exist."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from lab3_usd.spec.files import CHECKPOINTS, ROS, SCENE, SUBMISSION
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.fault import LabFault
from lab3_usd.spec.ros import FROM_THE_FIRST
from lab3_usd.spec.submission import ChecklistSpec

_ANY_STAGES = ("", "all", "last")
_GOALS = "goals"  # saved output that is read from a topic and from a log


def checkpoint_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield each reference to a checkpoint that the lab does not have."""
    known = ", ".join(lab.checkpoints)
    for file, key, checkpoint in _references(lab):
        if checkpoint not in lab.checkpoints:
            message = f"there is no checkpoint '{checkpoint}'"
            yield LabFault(file, key, message, f"{CHECKPOINTS} has {known}")


def _references(lab: Lab) -> Iterator[tuple[str, str, str]]:
    """Yield file, key and checkpoint of everything that names one."""
    if lab.frames.localization is not None:
        yield CHECKPOINTS, "frames: localization: from", lab.frames.localization.since
    until = lab.scene.robot.pose_is_error_until
    if until:
        yield SCENE, "robot: pose_is_error_until", until
    for name in lab.submission.stages.differ:
        yield SUBMISSION, "stages: differ", name
    for line in lab.submission.checklist:
        if line.stages not in _ANY_STAGES:
            yield SUBMISSION, _line_key(line, "stages"), line.stages
    for key, since in _since(lab):
        if since != FROM_THE_FIRST:
            yield ROS, f"{key}: from", since


def _since(lab: Lab) -> Iterator[tuple[str, str]]:
    ros = lab.ros
    for name, topic in ros.topics.items():
        yield f"topics: {name}", topic.since
    for name, node in ros.lifecycle.nodes.items():
        yield f"lifecycle: nodes: {name}", node.since
    for name, node in ros.nodes.items():
        yield f"nodes: {name}", node.since
    if ros.goal is not None:
        yield "goal", ros.goal.since
    for number, command in enumerate(ros.commands, start=1):
        yield f"command {number} ({command.kind.name} {command.target})", command.since


def _line_key(line: ChecklistSpec, key: str) -> str:
    return f"checklist: {line.section}: '{line.text}': {key}"


def checklist_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what the checklists name and nobody hands in or saves."""
    saved = {(each.kind.name, each.target) for each in lab.ros.commands} | {(_GOALS, "")}
    for line in lab.submission.checklist:
        for name in line.deliverables:
            if name not in lab.submission.deliverables:
                message = f"there is no deliverable '{name}'"
                yield LabFault(
                    SUBMISSION,
                    _line_key(line, "deliverables"),
                    message,
                    _known("deliverables", lab.submission.deliverables),
                )
        for shown in line.shown:
            kind, _, target = shown.partition(" ")
            if (kind, target) not in saved:
                message = f"no command of {ROS} saves '{shown}'"
                targets = [what for name, what in saved if name == kind]
                where = f"{ROS}: commands"
                other = _known(f"{where} with kind {kind}", sorted(targets)) if targets else where
                yield LabFault(SUBMISSION, _line_key(line, "shown"), message, other)


def _known(where: str, names: Collection[str]) -> str:
    return f"{where}: {', '.join(names)}"
