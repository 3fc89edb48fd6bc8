"""Judges a stage against its starter: what changed, and what the starter excuses."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.check.repairs import with_starter_repairs
from lab3_usd.check.requirements import with_other_faults
from lab3_usd.check.rule_runs import RuleResults, run_family
from lab3_usd.check.scene_requirements import is_met, scene_items
from lab3_usd.errors import StageError
from lab3_usd.judge.results import located, score_of, unreadable
from lab3_usd.model.changes import Site, repair_by
from lab3_usd.model.finding import Finding, Requirement, StageResult, ordered
from lab3_usd.model.physics import JOINT_ENABLED
from lab3_usd.spec.lab import Lab

_FAMILY = "U"
_EXCUSED = "S"  # the family of the scene, which the starter brings
_UNITS = "S02"
# The rules that relate to the prim which causes what they tell, and by which of its properties.
_CAUSES = {"S12": JOINT_ENABLED, "S19": "xformOp:translate"}
# What another size or place of a link's shape brings about; the change itself tells how to undo it.
_FOLLOWS = {"S19": re.compile(r"radius|height|size|axis|points|xformOp:\w+")}
_Fault = tuple[str, str, str | None, str | None]


class Starter(Struct, frozen=True):
    """An open starter, and what the rules of the scene say of it: no student's fault."""

    path: Path
    stage: Any
    faults: frozenset[_Fault] = frozenset()


class _ReportedSites(Struct, frozen=True):
    """What the other rules have told: the sites they blame, and the prims they relate to."""

    faulty_sites: frozenset[Site]
    related_prims: frozenset[str] = frozenset()


def open_starter(path: Path, lab: Lab, *, trusted: bool = True) -> Starter:
    """Open a starter to compare stages with; the faults of one that is not trusted excuse nothing.

    Raises:
        StageError: the file cannot be opened.
    """
    from lab3_usd.stage.read.opening import (
        open_stage,
    )
    from lab3_usd.stage.read.reader import read_model

    stage = open_stage(path)
    if not trusted:
        return Starter(path, stage)
    first = next(iter(lab.checkpoints.values()))
    judged = judge(lab, first, read_model(stage, lab, str(path)))
    return Starter(path, stage, frozenset(_fault(finding) for finding in judged.findings))


def _fault(finding: Finding) -> _Fault:
    return finding.rule, finding.prim, finding.property, finding.actual


def against_starter(result: StageResult, starter: Starter, lab: Lab) -> StageResult:
    """Return the result of a stage together with what it changed of the starter.

    A fault of the scene that the starter has as well, value for value, is not the student's: its
    findings go, and the requirements that failed by it are met.
    """
    if result.verdict == "unreadable":
        return result
    from lab3_usd.stage.read.opening import open_stage

    return open_against_starter(result, open_stage(Path(result.path)), starter, lab)


def open_against_starter(
    result: StageResult,
    stage: Any,
    starter: Starter,
    lab: Lab,
) -> StageResult:
    """Return the result of an open stage together with what it changed of the starter."""
    kept = tuple(finding for finding in result.findings if not _is_excused(finding, starter))
    kept += tuple(_units(finding for finding in result.findings if _is_excused(finding, starter)))
    told = [finding for finding in kept if finding.severity != "note"]
    blamed = {(finding.prim, finding.property) for finding in told}
    reported = _ReportedSites(
        frozenset(blamed.union(*map(_causes, told))),
        frozenset(path for finding in told for path in finding.related),
    )
    beside = _Beside(starter, stage, Path(result.path), result.checkpoint or "", lab)
    try:
        judged = _compared(beside, reported)
        kept = tuple(_undone(kept, beside, frozenset(blamed)))
    except StageError as error:  # of a prim that nothing else asks for
        return unreadable(result.path, result.checkpoint, str(error))
    kept = tuple(finding for finding in kept if not _follows(finding, judged.findings))
    requirements = result.requirements
    if len(kept) != len(result.findings):
        requirements = tuple(_again(result, kept, lab))
    findings = ordered((*kept, *judged.findings))
    requirements = with_other_faults(requirements, judged.findings, {})
    crashes = (*result.crashes, *judged.crashes)
    is_bad = crashes or any(finding.severity == "error" for finding in findings)
    return replace(
        result,
        verdict="fail" if is_bad else "pass",
        score=score_of(requirements),
        findings=findings,
        requirements=requirements,
        crashes=crashes,
    )


def _causes(finding: Finding) -> Iterator[Site]:
    """Yield what may cause a fault besides its site: related properties, prims and those above."""
    for each in finding.related:
        prim, dot, name = each.partition(".")
        if dot:
            yield prim, name
    for path in finding.related if finding.rule in _CAUSES else ():
        above = path
        while above:
            yield above, _CAUSES[finding.rule]
            above = above.rpartition("/")[0]


def _undone(
    findings: Collection[Finding], beside: _Beside, blamed: frozenset[Site]
) -> Iterator[Finding]:
    """Yield the findings; what a change of the starter causes is repaired by undoing the change."""
    caused = [
        finding for finding in findings if finding.rule in _CAUSES and finding.severity != "note"
    ]
    changes = _compared(beside, _ReportedSites(blamed)).findings if caused else ()
    for finding in findings:
        sites = {*_causes(finding)} if finding in caused else ()
        fixes = [change.fix for change in changes if (change.prim, change.property) in sites]
        edits = tuple(edit for fix in fixes if fix for edit in fix.edits)
        yield replace(finding, fix=repair_by(edits)) if edits else finding


def _follows(finding: Finding, changes: Collection[Finding]) -> bool:
    """Whether what is found of a link follows from a change of a shape below it."""
    cause = _FOLLOWS.get(finding.rule)
    return cause is not None and any(
        change.prim.startswith(f"{finding.prim}/") and cause.fullmatch(change.property or "")
        for change in changes
        if change.rule.startswith(_FAMILY) and change.severity == "error"
    )


def _is_excused(finding: Finding, starter: Starter) -> bool:
    return finding.rule.startswith(_EXCUSED) and _fault(finding) in starter.faults


def _units(excused: Iterable[Finding]) -> Iterator[Finding]:
    """Yield one warning for units and an up axis that are the starter's fault."""
    told = [finding for finding in excused if finding.rule == _UNITS]
    if told:
        wrong = "; ".join(finding.message for finding in told)
        message = f"{wrong}: so it is in the starter, whose fault it is"
        hint = "tell your instructor; the starter needs other units or another up axis"
        yield replace(told[0], severity="warning", message=message, hint=hint)


def _again(result: StageResult, kept: Collection[Finding], lab: Lab) -> Iterator[Requirement]:
    """Judge the requirements of the scene again, by the findings that were kept."""
    items = {item.id: item for item in scene_items(lab, lab.checkpoints[result.checkpoint or ""])}
    for requirement in result.requirements:
        item = items.get(requirement.id)
        yield requirement if item is None else replace(requirement, met=is_met(item, kept))


class _Beside(Struct, frozen=True, eq=False):
    """An open stage of a checkpoint beside its starter."""

    starter: Starter
    stage: Any
    path: Path
    checkpoint: str
    lab: Lab

    def has_supplied(self, path: str) -> bool:
        """Whether something stands at a path of the starter, or the layer itself is meant."""
        return bool(self.starter.stage.GetPrimAtPath(path))


def _compared(beside: _Beside, reported: _ReportedSites) -> RuleResults:
    from lab3_usd.stage.compare.starter import (
        compare_starter,
    )
    from lab3_usd.stage.read.opening import stage_errors

    stage, lab = beside.stage, beside.lab
    with stage_errors(beside.path):
        found = compare_starter(beside.starter.stage, stage, lab, beside.checkpoint)
    subject = replace(
        found, faulty_sites=reported.faulty_sites, related_prims=reported.related_prims
    )
    judged = run_family("starter", _FAMILY, subject, lab)
    repaired = with_starter_repairs(judged.findings, beside.has_supplied)
    findings = located(tuple(repaired), beside.path, stage)
    return replace(judged, findings=tuple(findings))
