"""Judges one submission inside its bounds: from the files that were handed in to points."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from msgspec import Struct, to_builtins
from msgspec.structs import replace

from lab3_usd.check.registry import Rule, all_rules
from lab3_usd.check.rule_runs import finding_of
from lab3_usd.data import TEAM_VARIABLE, own_team
from lab3_usd.errors import UnknownTeamError
from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.gradebook import write_reports
from lab3_usd.grade.intake.archives import ArchiveError, holds_nothing
from lab3_usd.grade.intake.guard import check_layer
from lab3_usd.grade.intake.staging import StagedSubmission, stage_submission
from lab3_usd.grade.intake.submission_copy import FILE_LEFT_OUT, TooLargeError
from lab3_usd.grade.intake.submission_folder import AMBIGUOUS
from lab3_usd.grade.rubric import Rubric
from lab3_usd.grade.scoring import Grade, SubmissionFacts, facts_of, grade_facts
from lab3_usd.grade.shared_reports import SHARED
from lab3_usd.grade.workers.worker_messages import (
    FAILED_OVER_IT,
    TOOL_FAILED,
    Json,
    PoolSettings,
    Task,
    status_of,
)
from lab3_usd.model.finding import Crash, Finding, Report, Submission, ordered
from lab3_usd.pipeline.folder import FolderResult, check_folder
from lab3_usd.pipeline.results import UNREADABLE, with_findings
from lab3_usd.pipeline.stage import JudgeSettings
from lab3_usd.pipeline.starter_comparison import Starter
from lab3_usd.report.entries import plural
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import lab_of_team, load_lab
from lab3_usd.spec.submission import has_teams, team_in, team_of
from lab3_usd.stage.graph_signature import files_read, graph_signature
from lab3_usd.stage.read.opening import PLACEHOLDER
from lab3_usd.stage.sandboxed_open import BlockedAsset, FileBounds, opening_within

# What remarks name: stages left aside, no map, another map.
_UNJUDGED, _ABOUT_MAPS = "X13", ("M10", "M11")
_SOMEBODY = "submission"
_EMPTY = hashlib.sha256().hexdigest()


class GradingSetup(Struct, frozen=True):
    """What every submission of a class is judged with.

    `starter` is open already, and `allowed` are the files that it consists of. `supplied` are the
    folders in which the grader has assets of servers.
    """

    lab: Lab
    rubric: Rubric
    starter: Starter | None
    allowed: frozenset[str]
    supplied: tuple[str, ...]
    settings: PoolSettings


def grade_submission(
    setup: GradingSetup, task: Task, scratch: Path, announce: Callable[[str], None]
) -> Json:
    """Copy a submission into `scratch`, judge the copy, and return everything to be recorded.

    Sets the working directory to the copy for as long as it takes.
    """
    limits, merge = setup.settings.limits, setup.settings.merge
    try:
        staged = stage_submission(task.sources, scratch, limits, merge=merge)
        if task.known and task.known == staged.digest:
            return {"status": "known", "digest": staged.digest}
        with _team_named(setup.lab, task):
            graded = grade_staged(setup, task, staged, announce)
    except (TooLargeError, ArchiveError, UnknownTeamError) as error:
        status = "too large" if isinstance(error, TooLargeError) else "unreadable"
        return ungraded_record(setup.rubric, task.student, status, str(error), task.name)
    if setup.settings.with_report:
        graded["place"] = staged.folder.relative_to(scratch).as_posix()
    return graded


@contextlib.contextmanager
def _team_named(lab: Lab, task: Task) -> Iterator[None]:
    """Judge with the values of the team that a submission is called after.

    Names of files say it where they have a place for it, and whoever grades may have said it.

    Raises:
        UnknownTeamError: the lab has no values for it.
    """
    is_asked = bool(lab.by_team) and not has_teams(lab.files) and not own_team()
    team = next(filter(None, map(team_in, (task.student, task.name))), "") if is_asked else ""
    if not team:
        yield
        return
    os.environ[TEAM_VARIABLE] = team
    try:
        lab_of_team(lab, [("", lab.first)])
        yield
    finally:
        del os.environ[TEAM_VARIABLE]


def grade_staged(
    setup: GradingSetup, task: Task, staged: StagedSubmission, announce: Callable[[str], None]
) -> Json:
    """Judge the copy of a submission, and return everything to be recorded."""
    asked = setup.settings
    bounds = FileBounds(
        root=staged.folder.resolve(),
        check=partial(check_layer, limits=asked.limits),
        allowed=setup.allowed,
        supplied=setup.supplied,
        starter="" if setup.starter is None else os.path.realpath(setup.starter.path),
        broken=task.broken,
        announce=announce,
        graphs=tuple(spec.path for spec in setup.lab.graphs.values()),
        nesting=asked.limits.nesting,
        digests=staged.digests,
    )
    with _inside(staged.folder), opening_within(bounds):
        folder = check_folder(
            Path(),
            JudgeSettings(starter=setup.starter, handed_in=True),
            supplied_map=asked.supplied_map,
            may_open=partial(_may_open, bounds),
            digests=staged.digests,
        )
        label = task.student if asked.named else _SOMEBODY
        judged = _completed(folder, label, staged, bounds.found.values(), task.broken)
        facts = facts_of(
            judged.results,
            setup.rubric.required,
            judged.submission.findings,
            judged.submission.checklist,
        )
        crashes = facts.crashes
        lab = lab_of_team(setup.lab, ((stage.path, stage.checkpoint) for stage in facts.stages))
        facts = with_dry_runs(facts, lab, staged.digests)
        played = {path: how for path, how in facts.crashes.items() if path not in crashes}
        judged = _with_crashes(
            judged, {path: f"the dry run failed ({how})" for path, how in played.items()}
        )
        points = grade_facts(setup.rubric, facts, late=task.late)
        work = _work(facts, setup.lab, staged.digests)
        # Of stages without faults only the last is pictured: its pictures show what they do.
        bounds.closed = {
            result.path
            for result in judged.results[:-1]
            if all(finding.severity == "note" for finding in result.findings)
        }
        report = Report(judged.results, (judged.submission,))
        remarks = tuple(remark.text for remark in staged.remarks)
        remarks += tuple(
            f"{finding.prim}: {finding.message}"
            for finding in judged.submission.findings
            if finding.rule == _UNJUDGED
            or (finding.rule in _ABOUT_MAPS and finding.severity != "note")
        )
        remarks += tuple(
            f"{stage}: {asset} was not submitted; the grader's file replaces it"
            for stage, asset in bounds.lent.items()
        )
        fields: Json = {} if asked.named else {SHARED: True}
        reports = {}  # as files; whoever asks for the report as data writes none
        if asked.with_report:
            fields["report"] = to_builtins(report)
        else:
            name = task.name if asked.named else ""
            reports = write_reports(report, setup.rubric, points, name, remarks)
    return {
        **fields,
        **_record(points, facts, _status(judged, task.broken, staged)),
        "remarks": list(remarks),
        "attention": [*_attention(judged, staged)],
        "work": work,
        **_team(facts, setup.lab),
        "digest": staged.digest,
        "verdicts": {result.checkpoint: result.verdict for result in judged.results},
        "crashes": [crash.rule for _, crash in _crashes(judged)],
        "reports": reports,
    }


def _team(facts: SubmissionFacts, lab: Lab) -> Json:
    """Return what names of stages say in the place of a team, where those of the lab have one."""
    if not has_teams(lab.files):
        return {}
    stems = ((Path(stage.path).stem, lab.files[stage.checkpoint]) for stage in facts.stages)
    teams = dict.fromkeys(team for stem, name in stems if (team := team_of(stem, name)))
    return {"team": ", ".join(teams)}


def _attention(judged: FolderResult, staged: StagedSubmission) -> Iterator[str]:
    """Yield why a grader has to look at a submission that has a grade."""
    if any(AMBIGUOUS in remark.text for remark in staged.remarks):
        yield "ambiguous"
    left_aside = any(finding.rule == _UNJUDGED for finding in judged.submission.findings)
    if left_aside or any(result.verdict == "not judged" for result in judged.results):
        yield "not judged in part"


def _work(facts: SubmissionFacts, lab: Lab, digests: Mapping[str, str]) -> Json:
    """Return what tells this work from that of others: its files, and what the last one says."""
    stages = [
        stage
        for stage in facts.stages
        if stage.readable and lab.checkpoints[stage.checkpoint].graphs
    ]
    files = {
        stage.checkpoint: _digest_of_all(stage.path, digests)
        for stage in stages
        if stage.path in digests
    }
    return {"files": files, "likeness": graph_signature(Path(stages[-1].path)) if stages else ""}


def _digest_of_all(path: str, digests: Mapping[str, str]) -> str:
    """Return the digest of a stage, with those of its further layers where it has any."""
    names = map(os.path.relpath, files_read(Path(path)))
    digests_beside = sorted({digests[name] for name in names if name in digests})
    if digests_beside in ([], [digests[path]]):
        return digests[path]
    return hashlib.sha256("".join((digests[path], *digests_beside)).encode()).hexdigest()


def _may_open(bounds: FileBounds, name: str) -> str:
    """Announce what may end this process, and refuse what did."""
    bounds.announce(name)
    return bounds.broken.get(name, "")


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def ungraded_record(rubric: Rubric, student: str, status: str, reason: str, name: str = "") -> Json:
    """Return the record of a submission that could not be judged, with a report of the reason."""
    facts = SubmissionFacts()
    points = grade_facts(rubric, facts)
    report = ungraded_report(student, reason)
    return {
        **_record(points, facts, (status, reason)),
        "remarks": [],
        "work": {},
        "digest": "",
        "verdicts": {},
        "crashes": [FILE_LEFT_OUT] if reason.startswith((FAILED_OVER_IT, TOOL_FAILED)) else [],
        "reports": write_reports(report, rubric, points, name),
    }


def ungraded_report(student: str, reason: str) -> Report:
    """Return the report of a submission that could not be judged."""
    finding = _finding(all_rules()[FILE_LEFT_OUT], student, reason)
    return Report((), (Submission(student, (finding,)),))


def _record(points: Grade, facts: SubmissionFacts, status: tuple[str, str]) -> Json:
    record: Json = to_builtins(points)
    return {"status": status[0], "reason": status[1], **record, "facts": to_builtins(facts)}


def _status(
    judged: FolderResult,
    broken: Mapping[str, str],
    staged: StagedSubmission,
) -> tuple[str, str]:
    for path, how in broken.items():
        return status_of(how), f"{path}: {how}"
    if not judged.results:
        because = "; ".join(f"{file.path}: {file.reason}" for file in staged.refused[:1])
        if any(holds_nothing(file.reason) for file in staged.refused):
            return "unreadable", because  # what it holds may be all that was handed in
        return "empty", because or "holds no stage of a checkpoint"
    if all(staged.digests.get(result.path) == _EMPTY for result in judged.results):
        stages = plural(len(judged.results), "stage")
        return "unreadable", f"{stages} of 0 bytes: {PLACEHOLDER}; hand in the file"
    crashes = _crashes(judged)
    if any(crash.error.startswith(MemoryError.__name__) for _, crash in crashes):
        raise MemoryError  # in a rule, which is not at fault
    for path, crash in crashes[:1]:
        named = crash.rule in {UNREADABLE, FILE_LEFT_OUT}
        how = crash.error if named else f"rule {crash.rule} failed ({crash.error})"
        return status_of(FAILED_OVER_IT), f"{path}: {how}; please report it"
    return "graded", ""


def _crashes(judged: FolderResult) -> Sequence[tuple[str, Crash]]:
    """Return what this program failed at, with the file."""
    crashes = [(result.path, crash) for result in judged.results for crash in result.crashes]
    return [*crashes, *((judged.submission.path, crash) for crash in judged.submission.crashes)]


def _with_crashes(judged: FolderResult, failures: Mapping[str, str]) -> FolderResult:
    """Add to the results of stages how this program failed over them, by their paths."""
    results = tuple(
        replace(result, crashes=(*result.crashes, Crash(UNREADABLE, failures[result.path])))
        if result.path in failures
        else result
        for result in judged.results
    )
    return FolderResult(results, judged.submission)


def _completed(
    judged: FolderResult,
    student: str,
    staged: StagedSubmission,
    blocked: Iterable[BlockedAsset],
    broken: Mapping[str, str],
) -> FolderResult:
    """Add to the results what was left out, and at which files this program failed before.

    Reports to students say what is wrong, and not how a program would change it.
    """
    rules = all_rules()
    grave: dict[str, list[Finding]] = {}
    for asset in blocked:
        if asset.is_error:
            finding = _finding(rules["Z02"], asset.asset, asset.reason)
            grave.setdefault(asset.stage, []).append(replace(finding, layer=asset.stage))
    results = tuple(
        with_findings(result, _bare((*result.findings, *grave.get(result.path, ()))))
        for result in judged.results
    )
    ours = {path: how for path, how in broken.items() if how.startswith(FAILED_OVER_IT)}
    stages = {result.path for result in results}
    crashes = tuple(
        Crash(FILE_LEFT_OUT, f"{path}: {how}") for path, how in ours.items() if path not in stages
    )
    files = [_finding(rules[file.rule], file.path, file.reason) for file in staged.refused]
    files += [_finding(rules[remark.rule], remark.path, remark.text) for remark in staged.remarks]
    about = replace(
        judged.submission,
        path=student,
        findings=ordered(_bare((*judged.submission.findings, *files))),
        crashes=(*judged.submission.crashes, *crashes),
    )
    return _with_crashes(FolderResult(results, about), ours)


def _bare(findings: Iterable[Finding]) -> Iterable[Finding]:
    return (replace(finding, fix=None) for finding in findings)


def _finding(rule: Rule, *arguments: str) -> Finding:
    (problem,) = rule.check(*arguments)
    return finding_of(rule, problem, load_lab())
