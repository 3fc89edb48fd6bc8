"""Built stages to break or rewrite, and what the rules of the scene say of them."""

from __future__ import annotations

from breaking import correct_stage
from pxr import Usd
from scene_changes import Change

from lab3_usd.check.fold import fold
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Rule, rules_of
from lab3_usd.check.requirements import with_unmet
from lab3_usd.check.rule_runs import finding_of, problems_of
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.read.stage_reader import read_model

built = correct_stage
FAMILIES = ("F", "S", "L", "C")
OF_ALL_SENSORS = "D08"


def model_of(stage: Usd.Stage) -> StageModel:
    with quiet():
        return read_model(stage, load_lab().platform, "stage.usda")


def stage_rules() -> dict[str, Rule]:
    """The rules about files, scene and sensors that judge a stage, by id."""
    of_robots = (*rules_of("robot", *FAMILIES), *rules_of("world", *FAMILIES))
    found = (*rules_of("model", "F"), *rules_of("stage", *FAMILIES, "D"), *of_robots)
    by_id = {rule.id: rule for rule in found if rule.id[0] in FAMILIES or rule.id == OF_ALL_SENSORS}
    return dict(sorted(by_id.items()))


def findings_of(stage: Usd.Stage, checkpoint: str) -> list[Finding]:
    """What the rules about files, scene and sensors say."""
    lab = load_lab()
    subject = StageSubject(lab, lab.checkpoints[checkpoint], model_of(stage), {})
    findings = (
        finding_of(rule, problem, lab)
        for rule in stage_rules().values()
        for problem in problems_of(rule, subject)
        if problem.rests_on is None
    )
    return [*with_unmet(fold(findings), subject, lab)]


def told(stage: Usd.Stage, checkpoint: str) -> list[tuple[str, str, str | None]]:
    """Rule, prim and property of everything that is said of the stage."""
    return [
        (finding.rule, finding.prim, finding.property) for finding in findings_of(stage, checkpoint)
    ]


def found_after(checkpoint: str, *changes: Change) -> list[Finding]:
    """What is said of a built checkpoint after these changes."""
    stage = built(checkpoint)
    for change in changes:
        change(stage)
    return findings_of(stage, checkpoint)


def told_after(checkpoint: str, *changes: Change) -> list[tuple[str, str, str | None]]:
    """Rule, prim and property of everything that is said of it."""
    return [(each.rule, each.prim, each.property) for each in found_after(checkpoint, *changes)]
