"""Judges one stage at one checkpoint: reads it, matches its graphs, runs the rules."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.check.candidates import relocated
from lab3_usd.check.diagnosis import diagnose
from lab3_usd.check.finding import (
    Crash,
    Finding,
    Requirement,
    Score,
    StageResult,
    Verdict,
)
from lab3_usd.check.judged import finding_of
from lab3_usd.check.located import located
from lab3_usd.check.merging import match_all
from lab3_usd.check.model import Node, StageModel
from lab3_usd.check.registry import Rule, rules_of
from lab3_usd.check.requirements import (
    frame_requirements,
    graph_requirements,
    scene_requirements,
    score,
)
from lab3_usd.check.robot_place import is_root_articulated, lab_at, lost_graphs, robot_homes
from lab3_usd.check.sensor_place import sensor_homes
from lab3_usd.check.subject import GraphSubject, Outcome, StageSubject
from lab3_usd.errors import StageError, UsageError
from lab3_usd.spec.articulated import lab_of_root
from lab3_usd.spec.loader import load_lab
from lab3_usd.spec.spec import Checkpoint, Lab

_NUMBER = re.compile(r"^Lab3_(\d\d)(?!\d)")
GRAPH_FAMILIES = ("G", "N", "P", "R", "W")
STAGE_FAMILIES = ("F", "S", "L", "C", "T", "Q", "G", "N", "P")  # which have rules of both scopes
UNREADABLE = "F01"
EXTRA_NODE = "N02"
# Which rule says more of a prim, or of its property, than each of these does.
SAYS_MORE = {"R03": "T01", "T11": EXTRA_NODE}


def checkpoint_of(name: str, lab: Lab) -> str | None:
    """Return the checkpoint number that a file name begins with (`Lab3_03...`), else None."""
    found = _NUMBER.match(name)
    return found[1] if found is not None and found[1] in lab.checkpoints else None


def check_stage(
    path: str | Path, checkpoint: str | None = None, lab: Lab | None = None
) -> StageResult:
    """Judge the stage at `path`, at the checkpoint given or else named by the file.

    The result holds every finding at its place, the requirements met and asked, and the rules
    that crashed. A file that cannot be read is a result as well, with the verdict `unreadable`.

    Raises:
        UsageError: the checkpoint is unknown, or neither given nor in the file name.
    """
    lab = lab or load_lab()
    found = checkpoint or checkpoint_of(Path(path).name, lab)
    if found is None:
        message = f"{path}: names no checkpoint (Lab3_NN...); give one with --checkpoint"
        raise UsageError(message)
    if found not in lab.checkpoints:
        message = f"there is no checkpoint '{found}'; known are {', '.join(lab.checkpoints)}"
        raise UsageError(message)
    from lab3_usd.stage.opening import open_stage, quiet  # noqa: PLC0415 - pxr, only when needed
    from lab3_usd.stage.reader import read_model  # noqa: PLC0415

    try:
        with quiet():
            stage = open_stage(Path(path))
            judged = judge(lab, lab.checkpoints[found], read_model(stage, lab, str(path)))
    except StageError as error:
        return unreadable(str(path), found, str(error))
    return _result(str(path), found, judged, stage)


def unreadable(path: str, checkpoint: str, reason: str) -> StageResult:
    """Return the result for a file that no stage can be read from."""
    text = reason.removeprefix(f"{path}: ")
    hint = "open the stage in Isaac Sim, save it again as .usda, and hand in that file"
    finding = Finding(UNREADABLE, "unreadable-file", "error", "/", text, layer=path, hint=hint)
    return StageResult(path, checkpoint, "unreadable", Score(0.0, 0.0), (finding,))


class Judgement(Struct, frozen=True):
    """What the rules say of a stage, before findings are given lines."""

    findings: tuple[Finding, ...]
    requirements: tuple[Requirement, ...]
    crashes: tuple[Crash, ...]


def judge(lab: Lab, checkpoint: Checkpoint, stage: StageModel) -> Judgement:
    """Run every rule over a stage, which is read as they ask.

    Raises:
        StageError: the file turns out to be damaged.
    """
    try:
        return _judge(lab, checkpoint, stage)
    finally:
        # What rules derive holds what they were given, and so the stage.
        stage.derived.clear()


def _judge(lab: Lab, checkpoint: Checkpoint, stage: StageModel) -> Judgement:
    live = {node.path: node for node in stage.nodes()}
    homes = robot_homes(lab, stage)
    placed = lab_at(lab, homes)
    if is_root_articulated(placed, stage):
        placed = lab_of_root(placed)
    robot = homes.get(lab.scene["robot"]["path"], "")
    subjects = [*_graph_subjects(placed, checkpoint, stage, live, robot)]
    run = _Run([], [])
    for found in rules_of("graph", *GRAPH_FAMILIES):
        for subject in subjects:
            run.rule(found, subject)
    whole = StageSubject(
        lab=placed,
        checkpoint=checkpoint,
        stage=stage,
        roles={subject.spec.name: subject.roles for subject in subjects},
        blamed=frozenset(each.prim for each in run.findings if each.severity == "error"),
        homes=homes,
        lost={subject.spec.name: subject.lost_with for subject in subjects if subject.lost_with},
    )
    for found in rules_of("stage", *STAGE_FAMILIES):
        run.rule(found, whole)
    run.findings[:] = _one_story_each(run.findings)
    requirements = [item for subject in subjects for item in graph_requirements(subject)]
    requirements += scene_requirements(whole, run.findings, lab)
    requirements += frame_requirements(whole)
    outcome = Outcome(whole, tuple(requirements), tuple(run.findings))
    for found in rules_of("outcome", *STAGE_FAMILIES):
        run.rule(found, outcome)
    return Judgement(tuple(run.findings), outcome.requirements, tuple(run.crashes))


def _one_story_each(told: list[Finding]) -> list[Finding]:
    """Leave out what another finding says better.

    That a node is not asked for goes where an error says what harm it does, and the frame id of
    one that should be deleted goes.
    """
    harmful = {each.prim for each in told if each.severity == "error"}
    left = [each for each in told if each.rule != EXTRA_NODE or each.prim not in harmful]
    sites = {(each.rule, each.prim, each.property) for each in left}
    return [
        each
        for each in left
        if not any(
            (SAYS_MORE.get(each.rule), each.prim, name) in sites for name in (each.property, None)
        )
    ]


class _Run(Struct, frozen=True):
    """The findings and crashes of one run, in the order in which the rules speak."""

    findings: list[Finding]
    crashes: list[Crash]

    def rule(self, found: Rule, subject: Any) -> None:  # noqa: ANN401 - the scope decides
        """Run one rule; a rule that crashes is recorded, never a pass.

        Raises:
            StageError: the file turns out to be damaged, which is no fault of the rule.
        """
        try:
            for problem in found.check(subject):
                finding = finding_of(found, problem)
                if not any(_is_same(finding, told) for told in self.findings):
                    self.findings.append(finding)
        except StageError:
            raise
        except Exception as error:  # noqa: BLE001 - whatever a rule raises is its crash
            self.crashes.append(Crash(found.id, f"{type(error).__name__}: {error}"))


def _is_same(one: Finding, other: Finding) -> bool:
    """Whether two findings say the same: graphs that were built in one may share a node."""
    if (one.rule, one.prim, one.property) != (other.rule, other.prim, other.property):
        return False
    return one.message == other.message


def _graph_subjects(
    lab: Lab, checkpoint: Checkpoint, stage: StageModel, live: Mapping[str, Node], robot: str
) -> Iterator[GraphSubject]:
    """Yield every graph of the checkpoint; `robot` is where the robot stands elsewhere."""
    homes = sensor_homes(lab, stage)
    specs = {name: relocated(spec, homes) for name, spec in lab.graphs.items()}
    matched = match_all(specs, stage, lab.catalog.scripts)
    roles = {name: matched[name] for name in checkpoint.graphs}
    lost = lost_graphs(specs, roles, robot, stage)
    for name in checkpoint.graphs:
        yield GraphSubject(
            lab=lab,
            checkpoint=checkpoint,
            spec=specs[name],
            roles=roles[name],
            stage=stage,
            live=live,
            wire_faults=diagnose(specs[name], roles[name], live),
            lost_with=lost.get(name, ""),
        )


def _result(path: str, checkpoint: str, judged: Judgement, stage: Any) -> StageResult:  # noqa: ANN401
    findings = judged.findings
    # Notes ask for no repair: a stage that passes is not read a second time for them.
    if any(each.severity != "note" for each in findings):
        findings = tuple(located(findings, path, stage))
    findings = ordered(findings)
    has_errors = any(each.severity == "error" for each in findings)
    verdict: Verdict = "fail" if has_errors or judged.crashes else "pass"
    return StageResult(
        path=path,
        checkpoint=checkpoint,
        verdict=verdict,
        score=score(judged.requirements),
        findings=findings,
        requirements=judged.requirements,
        crashes=judged.crashes,
    )


def ordered(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Sort findings by place and rule, which no run and no hash seed changes."""
    return tuple(
        sorted(findings, key=lambda each: (each.prim, each.property or "", each.rule, each.message))
    )
