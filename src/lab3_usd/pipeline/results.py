"""The result of a stage: its verdict, and its findings in order, located and not ignored."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.registry import Scope, all_rules, families, rule_names
from lab3_usd.check.rule_runs import run_rule
from lab3_usd.errors import StageError
from lab3_usd.model.finding import Crash, Finding, IgnoreNote, StageResult, Submission, ordered

UNREADABLE, UNUSED = "F01", "F06"
STAGE_ENDINGS = (".usd", ".usda", ".usdc", ".usdz", ".uda")


def is_stage_file(name: str) -> bool:
    """Whether a file of this name in a folder is a stage; hidden files are left by programs."""
    return not name.startswith(".") and name.lower().endswith(STAGE_ENDINGS)


_WITHOUT_SPEC: frozenset[Scope] = frozenset({"model", "lint", "own"})
_WITH_SPEC: frozenset[Scope] = frozenset(
    {"model", "graph", "stage", "robot", "world", "frames", "requirements", "own"}
)

Results = tuple[tuple[StageResult, ...], tuple[Submission, ...]]


class Target(Struct, frozen=True):
    """A path to judge: a stage, or the folder of a submission."""

    path: str
    is_submission: bool = False


def without_ignored(result: StageResult, more: Collection[Scope]) -> StageResult:
    """Return the result of a stage without what its notes ignore, and with the unused notes.

    A note about rules that did not run is for another command. `more` are the scopes that ran
    besides those of a check, or of the linter.

    Raises:
        StageError: the file cannot be opened any more.
    """
    if result.verdict == "unreadable":
        return result
    from lab3_usd.stage.read.opening import open_stage

    path = Path(result.path)
    stage = open_stage(path)
    notes = _notes_in(stage, result.path)
    if not notes:
        return result
    scopes = (_WITHOUT_SPEC if result.checkpoint is None else _WITH_SPEC).union(more)
    used = {note for note in notes for finding in result.findings if note.covers(finding)}
    kept = [
        finding for finding in result.findings if not any(note.covers(finding) for note in notes)
    ]
    for note in notes:
        named = [
            rule for rule in all_rules().values() if note.rule and rule.id.startswith(note.rule)
        ]
        is_for_others = named and not any(rule.scope in scopes for rule in named)
        if note not in used and not is_for_others:
            unused = unused_note(note)
            kept += unused if note.written else located_findings(list(unused), path, stage)
    return with_findings(result, kept)


def _notes_in(stage: Any, given: str) -> tuple[IgnoreNote, ...]:
    """Return the notes of a stage; a rule that is named there counts as its id."""
    from lab3_usd.stage.layer_text import read_ignore_notes

    return tuple(
        replace(note, rule=rule_names().get(note.rule.lower(), note.rule))
        for note in read_ignore_notes(stage, given)
    )


def without_noted(findings: Sequence[Finding], stage: Any, path: Path) -> tuple[Finding, ...]:
    """Return what no note in an open stage ignores, of findings that have no places yet."""
    notes = _notes_in(stage, str(path))
    if not notes:
        return tuple(findings)
    pairs = zip(findings, located_findings(findings, path, stage), strict=True)
    return tuple(
        finding for finding, placed in pairs if not any(note.covers(placed) for note in notes)
    )


def unused_note(note: IgnoreNote) -> Iterator[Finding]:
    """Yield the finding about a note that ignores nothing."""
    why = "there is no such finding here"
    if note.misspelt:
        why = "a suppression begins its comment, as in # lab3: ignore[P01]"
    elif not note.rule:
        why = "it names no rule"
    elif note.rule not in families() and note.rule not in all_rules():
        why = "there is no such rule"
    for finding in run_rule(all_rules()[UNUSED], (note, why), None).findings:
        yield replace(finding, layer=note.layer or None, line=note.written)


_OLDER = "go back to an older copy of the file"
_AGAIN = "save the stage again, or name another file"
_REPEAT = "open the stage of the checkpoint before, repeat this part, and save it under this name"


def unreadable_result(path: str, checkpoint: str | None, reason: StageError | str) -> StageResult:
    """Return the result for a file that no stage can be read from."""
    line, column = (reason.line, reason.column) if isinstance(reason, StageError) else (None, None)
    text = str(reason).removeprefix(f"{path}: ")
    ways = [f"correct line {line} in a text editor"] if line else []
    repairs = [_OLDER, _REPEAT] if checkpoint else [_OLDER if line else _AGAIN]
    hint: str | None = "; or ".join([*ways, *repairs])
    if isinstance(reason, StageError) and reason.repair:
        hint = reason.repair
        text = text.removesuffix(f"; {hint}")
    finding = Finding(
        UNREADABLE,
        "unreadable-file",
        "error",
        "/",
        text,
        layer=path,
        line=line,
        column=column,
        hint=hint,
        unopened="stage",
    )
    return StageResult(path, checkpoint, (finding,))


ENDED, FAILED = "the process that read it ended", "this program failed"


def crashed(path: str, checkpoint: str | None, how: str, what: str = ENDED) -> StageResult:
    """Return the result for a file at which the process that read it ended, and how it did.

    `what` says so where that was something else.
    """
    reason = f"{what} ({how})"
    result = unreadable_result(path, checkpoint, reason)
    if what == FAILED:
        hint = "the file may be right: please report this, with the file"
        result = replace(result, findings=tuple(replace(f, hint=hint) for f in result.findings))
    return replace(result, crashes=(Crash(UNREADABLE, reason),))


def with_findings(result: StageResult, findings: Iterable[Finding]) -> StageResult:
    """Return a result with other findings, in order."""
    return replace(result, findings=ordered(findings))


def located_findings(
    findings: Collection[Finding], path: Path | str, stage: Any
) -> Iterator[Finding]:
    """Yield findings of an open stage with their layer, line and column."""
    if not findings:
        return
    from lab3_usd.stage.layer_text import locate

    places = locate(stage, str(path), [(finding.prim, finding.property) for finding in findings])
    for finding in findings:
        place = places[finding.prim, finding.property]
        yield replace(finding, layer=place.layer or None, line=place.line, column=place.column)
