"""What `lab3 check` judges of one path: a stage at its checkpoint, or a whole submission."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec.structs import replace

from lab3_usd.check.checker import UNREADABLE, check_stage, checkpoint_of, ordered, unreadable
from lab3_usd.check.finding import Crash, Finding, StageResult, Submission, Verdict
from lab3_usd.commands.options import checkpoint_number
from lab3_usd.errors import UsageError
from lab3_usd.spec.loader import load_lab
from lab3_usd.spec.spec import Lab

if TYPE_CHECKING:
    from lab3_usd.check.unchanged import Starter

Judged = tuple[tuple[StageResult, ...], tuple[Submission, ...]]


class Entry(NamedTuple):
    """A path to judge: a stage, or the folder of a submission."""

    path: str
    is_submission: bool


def checkpoint_at(path: str, options: Mapping[str, Any], lab: Lab) -> str:
    """Return the checkpoint to judge a file at.

    Raises:
        UsageError: there is no such checkpoint, or neither options nor name give one.
    """
    given = options["checkpoint"]
    if given is not None:
        return checkpoint_number(given, lab.checkpoints)
    found = checkpoint_of(Path(path).name, lab)
    if found is None:
        message = f"{path}: the name gives no checkpoint (Lab3_NN); give one with --checkpoint"
        raise UsageError(message)
    return found


def judge_entry(options: Mapping[str, Any], entry: Entry) -> Judged:
    """Judge a stage or a submission."""
    if entry.is_submission:
        return _judge_submission(entry.path, options)
    lab = load_lab()
    checkpoint = checkpoint_at(entry.path, options, lab)
    from lab3_usd.stage.opening import kept_open  # noqa: PLC0415 - pxr, only when it is needed

    with kept_open():
        result = check_stage(entry.path, checkpoint, lab)
        if options["starter"] is not None:
            result = _against_starter(result, options["starter"], lab)
    if lab.checkpoints[checkpoint].localization:
        result = _with(result, [*_about_maps(checkpoint, options, lab)])
    return (result,), ()


def crashed_entry(options: Mapping[str, Any], entry: Entry, how: str) -> Judged:
    """Return the result for a path at which the process that judged it ended."""
    reason = f"the process that read it ended ({how})"
    crash = Crash(UNREADABLE, reason)
    if entry.is_submission:
        return (), (Submission(entry.path, crashes=(crash,)),)
    result = unreadable(entry.path, checkpoint_at(entry.path, options, load_lab()), reason)
    return (replace(result, crashes=(crash,)),), ()


def _judge_submission(path: str, options: Mapping[str, Any]) -> Judged:
    from lab3_usd.check.folder import FolderSettings, check_folder  # noqa: PLC0415

    settings = FolderSettings(
        starter=_path(options["starter"]),
        maps=_path(options["maps"]),
        require_evidence=options["require_evidence"],
    )
    found = check_folder(Path(path), settings)
    return found.results, (found.submission,)


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def _against_starter(result: StageResult, starter: str, lab: Lab) -> StageResult:
    from lab3_usd.check.unchanged import against_starter  # noqa: PLC0415 - only with --starter

    return against_starter(result, open_starter_once(starter, lab), lab)


@lru_cache(maxsize=1)
def open_starter_once(path: str, lab: Lab) -> Starter:
    """Open the starter once for all the stages that are compared with it."""
    from lab3_usd.check.unchanged import open_starter  # noqa: PLC0415

    return open_starter(Path(path), lab)


def _about_maps(checkpoint: str, options: Mapping[str, Any], lab: Lab) -> Iterable[Finding]:
    from lab3_usd.check.folder import lone_stage_notes, map_findings  # noqa: PLC0415

    if options["maps"] is None:
        return lone_stage_notes(checkpoint, lab)
    return map_findings(Path(options["maps"]), lab)


def _with(result: StageResult, more: list[Finding]) -> StageResult:
    if not more:
        return result
    findings = ordered((*result.findings, *more))
    return replace(result, findings=findings, verdict=verdict_of(result, findings))


def verdict_of(result: StageResult, findings: Iterable[Finding]) -> Verdict:
    """Return the verdict on a stage of which these findings are told."""
    if result.verdict == "unreadable":
        return "unreadable"
    has_errors = any(each.severity == "error" for each in findings)
    return "fail" if has_errors or result.crashes else "pass"
