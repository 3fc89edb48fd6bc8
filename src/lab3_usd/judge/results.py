"""Makes results of stages: verdicts, findings in order and at their places in the files."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.model.finding import (
    Crash,
    Finding,
    Requirement,
    Score,
    StageResult,
    Submission,
    Verdict,
    ordered,
)

UNREADABLE = "F01"
STAGE_ENDINGS = (".usd", ".usda", ".usdc", ".usdz", ".uda")


Results = tuple[tuple[StageResult, ...], tuple[Submission, ...]]


class Entry(Struct, frozen=True):
    """A path to judge: a stage, or the folder of a submission."""

    path: str
    is_submission: bool = False


def unreadable(path: str, checkpoint: str | None, reason: str) -> StageResult:
    """Return the result for a file that no stage can be read from."""
    text = reason.removeprefix(f"{path}: ")
    hint = "open the stage in Isaac Sim, save it again as .usda, and hand in that file"
    finding = Finding(UNREADABLE, "unreadable-file", "error", "/", text, layer=path, hint=hint)
    return StageResult(path, checkpoint, "unreadable", Score(0.0, 0.0), (finding,))


def crashed(path: str, checkpoint: str | None, how: str) -> StageResult:
    """Return the result for a file at which the process that read it ended, and how it did."""
    reason = f"the process that read it ended ({how})"
    crash = Crash(UNREADABLE, reason)
    return replace(unreadable(path, checkpoint, reason), crashes=(crash,))


def verdict_of(findings: Iterable[Finding], crashes: Collection[Crash]) -> Verdict:
    """Return the verdict on a stage that could be read."""
    has_errors = any(each.severity == "error" for each in findings)
    return "fail" if has_errors or crashes else "pass"


def score_of(requirements: Collection[Requirement]) -> Score:
    """Count the requirements met and asked."""
    return Score(float(sum(each.met for each in requirements)), float(len(requirements)))


def with_findings(result: StageResult, findings: Iterable[Finding]) -> StageResult:
    """Return a result with other findings, in order, and the verdict that they give."""
    new = ordered(findings)
    unread = result.verdict == "unreadable"
    verdict: Verdict = "unreadable" if unread else verdict_of(new, result.crashes)
    return replace(result, findings=new, verdict=verdict)


def located(findings: Collection[Finding], path: Path | str, stage: Any) -> Iterator[Finding]:  # noqa: ANN401 - pxr has no types
    """Yield findings of an open stage with their layer, line and column."""
    if not findings:
        return
    from lab3_usd.stage.text.source_locations import locate  # noqa: PLC0415 - only with findings

    places = locate(stage, str(path), [(each.prim, each.property) for each in findings])
    for each in findings:
        place = places[each.prim, each.property]
        yield replace(each, layer=place.layer or None, line=place.line, column=place.column)
