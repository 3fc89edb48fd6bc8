"""Judges a stage against its starter: what changed, and what the starter excuses."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.check.fold import fold
from lab3_usd.check.registry import Demand
from lab3_usd.check.requirements import demands_of, unmet_by, with_named_faults, with_other_faults
from lab3_usd.check.rule_runs import RuleResults, run_family
from lab3_usd.errors import StageError
from lab3_usd.model.changes import Site, repair_by
from lab3_usd.model.finding import Finding, StageResult, ordered
from lab3_usd.pipeline.results import located_findings, unreadable_result
from lab3_usd.spec.lab import Lab

_FAMILY = "U"
_SHAPED, _PLACED = "collision", "place"  # what is asked of links and joints
_FaultKey = tuple[str, str, str | None, str | None]


class Starter(Struct, frozen=True):
    """An open starter, and its own faults, which are not the student's."""

    path: Path
    stage: Any
    faults: frozenset[_FaultKey] = frozenset()


class _ReportedSites(Struct, frozen=True):
    """What the other rules have reported: the sites they blame, and the prims they relate to."""

    faulty_sites: frozenset[Site]
    related_prims: frozenset[str] = frozenset()


def open_starter(path: Path, lab: Lab, *, trusted: bool = True) -> Starter:
    """Open a starter to compare stages with; the faults of one that is not trusted excuse nothing.

    Raises:
        StageError: the file cannot be opened.
    """
    from lab3_usd.stage.read.opening import open_stage
    from lab3_usd.stage.read.stage_reader import read_model

    stage = open_stage(path)
    if not trusted:
        return Starter(path, stage)
    first = next(iter(lab.checkpoints.values()))
    judged = judge(lab, first, read_model(stage, lab.platform, str(path)))
    return Starter(path, stage, frozenset(_fault(finding) for finding in judged.findings))


def opened_starter(starter: Path | Starter, lab: Lab) -> Starter:
    """Return a starter that may be open already.

    Raises:
        StageError: the file cannot be opened.
    """
    return open_starter(starter, lab) if isinstance(starter, Path) else starter


def _fault(finding: Finding) -> _FaultKey:
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
    result: StageResult, stage: Any, starter: Starter, lab: Lab
) -> StageResult:
    """Return the result of an open stage together with what it changed of the starter."""
    excused = [
        finding
        for finding in result.findings
        if finding.supplied and _fault(finding) in starter.faults
    ]
    kept = tuple(finding for finding in result.findings if finding not in excused)
    kept += tuple(_starter_warnings(excused))
    faults = [finding for finding in kept if finding.severity != "note"]
    blamed = {(finding.prim, finding.property) for finding in faults}
    reported = _ReportedSites(
        frozenset(blamed.union(*map(_causes, faults))),
        frozenset(path for finding in faults for path in finding.related),
    )
    beside = _Beside(starter, stage, Path(result.path), result.checkpoint or "", lab)
    try:
        judged = _compared(beside, reported)
        kept = tuple(_with_undoing(kept, beside, frozenset(blamed)))
    except StageError as error:  # of a prim that nothing else asks for
        return unreadable_result(result.path, result.checkpoint, error)
    changes = [*map(id, judged.findings)]
    kept = tuple(each for each in fold((*kept, *judged.findings)) if id(each) not in changes)
    excused_ids = unmet_by(result.findings) - unmet_by(kept)
    requirements = tuple(
        replace(requirement, met=True) if requirement.id in excused_ids else requirement
        for requirement in result.requirements
    )
    requirements = tuple(with_named_faults(requirements, judged.findings))
    requirements = with_other_faults(requirements, judged.findings, {})
    return replace(
        result,
        findings=ordered((*kept, *judged.findings)),
        requirements=requirements,
        crashes=(*result.crashes, *judged.crashes),
    )


def _causes(finding: Finding) -> Iterator[Site]:
    """Yield what may cause a fault besides its site: the properties that the finding names."""
    yield from finding.covers
    for path in finding.related:
        prim, dot, name = path.partition(".")
        if dot:
            yield prim, name


def _with_undoing(
    findings: Collection[Finding], beside: _Beside, blamed: frozenset[Site]
) -> Iterator[Finding]:
    """Yield the findings; what a change of the starter causes is repaired by undoing the change."""
    caused = [
        finding
        for finding in findings
        if finding.severity != "note" and any(name is not None for _, name in finding.covers)
    ]
    changes = _compared(beside, _ReportedSites(blamed)).findings if caused else ()
    for finding in findings:
        sites = {*_causes(finding)} if finding in caused else ()
        fixes = [change.fix for change in changes if (change.prim, change.property) in sites]
        edits = tuple(edit for fix in fixes if fix for edit in fix.edits)
        yield replace(finding, fix=repair_by(edits)) if edits else finding


def _starter_warnings(excused: Iterable[Finding]) -> Iterator[Finding]:
    """Yield the warning that stays of what the starter has wrong as well: one for each hint."""
    by_hint: dict[str, list[Finding]] = {}
    for finding in excused:
        if finding.if_supplied:
            by_hint.setdefault(finding.if_supplied, []).append(finding)
    for hint, findings in by_hint.items():
        wrong = "; ".join(finding.message for finding in findings)
        message = f"{wrong}: so it is in the starter, whose fault it is"
        yield replace(findings[0], severity="warning", message=message, hint=hint)


class _Beside(Struct, frozen=True, eq=False):
    """An open stage of a checkpoint beside its starter."""

    starter: Starter
    stage: Any
    path: Path
    checkpoint: str
    lab: Lab


def _is_about(demand: Demand, what: str) -> bool:
    return demand.id.split("/")[1] == what


def _compared(beside: _Beside, reported: _ReportedSites) -> RuleResults:
    from lab3_usd.stage.compare.stages import compare_starter
    from lab3_usd.stage.read.opening import stage_errors

    stage, lab = beside.stage, beside.lab
    with stage_errors(beside.path):
        comparison = compare_starter(beside.starter.stage, stage, lab, beside.checkpoint)
    demands = demands_of(lab, lab.checkpoints[beside.checkpoint])
    subject = replace(
        comparison,
        shaped={demand.prim: demand.id for demand in demands if _is_about(demand, _SHAPED)},
        placed={demand.prim: demand.id for demand in demands if _is_about(demand, _PLACED)},
        faulty_sites=reported.faulty_sites,
        related_prims=reported.related_prims,
        supplied=frozenset(
            change.prim
            for change in comparison.changes
            if beside.starter.stage.GetPrimAtPath(change.prim)
        ),
    )
    judged = run_family("starter", _FAMILY, subject, lab)
    findings = located_findings(judged.findings, beside.path, stage)
    return replace(judged, findings=tuple(findings))
