"""Judges a student's whole folder: its stages, maps, parameters, saved output and files."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.checker import check_stage, checkpoint_of, ordered
from lab3_usd.check.checklist import Known, decide
from lab3_usd.check.finding import Finding, StageResult, Submission
from lab3_usd.check.folder_lab import (
    Given,
    judge_maps,
    judge_parameters,
    judge_shown,
    lone_stage_notes,
    map_findings,
    read_shown,
)
from lab3_usd.check.folder_starter import Starters, find_starters
from lab3_usd.check.judged import join, run_family
from lab3_usd.check.submitted import SubmissionSubject
from lab3_usd.check.unchanged import Starter, against_starter
from lab3_usd.lab.submission import folder_named, list_submission
from lab3_usd.spec.loader import load_lab

__all__ = [
    "FolderResult",
    "FolderSettings",
    "check_folder",
    "is_submission",
    "lone_stage_notes",
    "map_findings",
]


class FolderSettings(Struct, frozen=True):
    """What a folder is judged with: the supplied starter, and a folder of maps beside it.

    With `require_evidence`, saved output that is missing is an error instead of a note.
    """

    starter: Path | Starter | None = None
    maps: Path | None = None
    require_evidence: bool = False


class FolderResult(Struct, frozen=True):
    """The results of the stages in the order of their checkpoints, and of the folder itself."""

    results: tuple[StageResult, ...]
    submission: Submission


def is_submission(folder: Path) -> bool:
    """Whether a folder is a submission: it has the folder of stages, or several of the stages."""
    lab = load_lab()
    if folder_named(folder, lab.submission.folders.stages):
        return True
    try:
        numbered = [each for each in folder.iterdir() if checkpoint_of(each.name, lab)]
    except OSError:
        return False
    return len(numbered) > 1


def check_folder(folder: Path, settings: FolderSettings) -> FolderResult:
    """Judge every stage at its checkpoint, and the folder as a whole.

    Raises:
        StageError: the starter that was given cannot be opened.
    """
    lab = load_lab()
    spec = lab.submission
    given = Given(folder, list_submission(folder, lab, spec), lab, lab.ros, spec)
    starters = find_starters(folder, given.listing, settings.starter, lab)
    results = dict(_results(given, starters))
    evidence = read_shown(given)
    until = max(given.listing.stages, default=_last(given))
    required = settings.require_evidence
    judged = join((
        run_family("submission", "X", _subject(given, results, starters)),
        judge_maps(given, settings.maps, _last_stage(results)),
        judge_parameters(given),
        judge_shown(given, evidence, _last(given) if required else until, required=required),
    ))  # fmt: skip
    findings = ordered(_with_files(judged.findings, folder))
    known = Known(lab, spec, given.ros, given.listing, results, findings, evidence)
    submission = Submission(str(folder), findings, decide(known), judged.crashes)
    return FolderResult(tuple(results.values()), submission)


def _last(given: Given) -> str:
    return max(given.lab.checkpoints)


def _results(given: Given, starters: Starters) -> Iterator[tuple[str, StageResult]]:
    """Judge the files that USD can open; the others have a finding of their own."""
    endings = (*given.spec.stages.endings, *given.spec.stages.openable)
    for number, stage in given.listing.stages.items():
        if PurePosixPath(stage.path).suffix.lower() not in endings:
            continue
        result = check_stage(str(given.folder / stage.path), number, given.lab)
        if starters.compared is not None:
            result = against_starter(result, starters.compared, given.lab)
        yield number, result


def _subject(
    given: Given, results: Mapping[str, StageResult], starters: Starters
) -> SubmissionSubject:
    return SubmissionSubject(
        lab=given.lab,
        spec=given.spec,
        listing=given.listing,
        results=results,
        digests={number: _digest(Path(each.path)) for number, each in results.items()},
        starter=starters.submitted,
    )


def _digest(path: Path) -> str:
    """Return what tells a file from others; its own path where it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return str(path)


def _last_stage(results: Mapping[str, StageResult]) -> Path | None:
    readable = [each.path for each in results.values() if each.verdict != "unreadable"]
    return Path(readable[-1]) if readable else None


def _with_files(findings: Iterable[Finding], folder: Path) -> Iterator[Finding]:
    """Add the file to open to findings whose site is a file of the folder."""
    for each in findings:
        path = folder / each.prim
        is_file = not path.is_symlink() and path.is_file()
        yield replace(each, layer=str(path)) if is_file else each
