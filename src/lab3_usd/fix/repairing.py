"""Repairs a stage.

Judges it, makes the edits, and judges it again until nothing is left to repair.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.checker import Judgement, judge
from lab3_usd.check.lint import lint
from lab3_usd.check.ros.running import LintSubject
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.errors import StageError, UsageError
from lab3_usd.files import temporary_beside
from lab3_usd.fix.text_editor import new_bytes
from lab3_usd.judge.lint import lint_lab
from lab3_usd.judge.results import without_noted
from lab3_usd.judge.stage import checkpoint_of
from lab3_usd.judge.starter import open_against_starter, open_starter
from lab3_usd.model.changes import MovePrim, Repair, TextChange
from lab3_usd.model.finding import Finding, Report, Score, Site, StageResult, ordered, site_of
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.load.compiled import load_isaac_types
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import EditedLayer, EditSession, is_text
from lab3_usd.stage.read.opening import open_stage, quiet
from lab3_usd.stage.read.properties import release_start_values
from lab3_usd.stage.read.reader import read_model

WORSE = "would make the stage worse"
USELESS = "does not help"


class Attempt(Struct, frozen=True):
    """What came of some repairs: the findings afterwards, and the new bytes of each file.

    `error` says why the result cannot be used; '' where it can.
    """

    after: tuple[Finding, ...]
    repairs: tuple[Repair, ...] = ()
    files: dict[Path, bytes] = {}
    error: str = ""


class Chosen(Struct, frozen=True):
    """The repairs that were made, and why each of the others was left out."""

    attempt: Attempt
    left_out: dict[Site, str]


def weight(findings: Iterable[Finding]) -> tuple[int, int]:
    """Count errors and warnings."""
    severities = [finding.severity for finding in findings]
    return severities.count("error"), severities.count("warning")


def most_helpful(sites: Sequence[Site], attempt: Callable[[frozenset[Site]], Attempt]) -> Chosen:
    """Repair as many of these findings as do no harm.

    All are tried at once. Where that brings something new to find, leaves one of them as it was,
    or cannot be written, each half is tried by itself, and so on down to a single repair.
    """
    kept: frozenset[Site] = frozenset()
    best, left_out = attempt(kept), {}
    waiting = [tuple(sites)] if sites else []
    while waiting:
        some = waiting.pop(0)
        tried = attempt(kept.union(some))
        useless = any(_said(each, tried) == _said(each, best) != [] for each in some)
        is_right = _helps(tried, best) or (len(some) == 1 and _is_harmless(tried, best, some[0]))
        if is_right and not useless:
            kept, best = kept.union(some), tried
        elif len(some) == 1:
            left_out[some[0]] = tried.error or (USELESS if is_right else WORSE)
        else:
            half = len(some) // 2
            waiting[:0] = [some[:half], some[half:]]
    return Chosen(best, left_out)


def _said(site: Site, attempt: Attempt) -> list[str]:
    """Return what is said at a site of which there is a repair."""
    return [
        finding.message for finding in attempt.after if finding.fix and site_of(finding) == site
    ]


def _helps(tried: Attempt, best: Attempt) -> bool:
    """Whether something is repaired, and nothing is found that was not found before."""
    known = {site_of(finding) for finding in best.after}
    is_new = any(
        site_of(finding) not in known for finding in tried.after if finding.severity != "note"
    )
    return not (tried.error or is_new) and weight(tried.after) < weight(best.after)


def _is_harmless(tried: Attempt, best: Attempt, site: Site) -> bool:
    """Whether no more is found than before, and no error away from what was repaired.

    An error there may have been hidden behind the repaired one; elsewhere the repair brought it.
    """
    if tried.error or weight(tried.after) > weight(best.after):
        return False
    known = {site_of(finding) for finding in best.after if finding.severity == "error"}
    repaired = {*_repaired(finding for finding in best.after if site_of(finding) == site)}
    return all(
        site_of(finding) in known or _is_among(finding, repaired)
        for finding in tried.after
        if finding.severity == "error"
    )


def _repaired(findings: Iterable[Finding]) -> Iterable[str]:
    """Yield the prims that findings are about, and those which their repairs edit."""
    for finding in findings:
        yield finding.prim
        for edit in finding.fix.edits if finding.fix else ():
            yield edit.to if isinstance(edit, MovePrim) else edit.prim


def _is_among(finding: Finding, prims: Collection[str]) -> bool:
    """Whether a finding, with all that it relates to, is about these prims or some below them."""
    paths = (finding.prim, *(each.partition(".")[0] for each in finding.related))
    return all(any(is_at_or_below(path, prim) for prim in prims) for path in paths)


_PACKAGE = ".usdz"
_ROUNDS = 8  # a missing graph needs three: the graph, its connections, what those bring to light


class FixOptions(Struct, frozen=True):
    """Which repairs are made, and where: `wanted` keeps the findings that are to be repaired.

    With `heeds_ignores`, what notes in the stage ignore on purpose is none of them.
    """

    unsafe: bool = False
    root_only: bool = False
    starter: str | None = None
    wanted: Callable[[Iterable[Finding]], tuple[Finding, ...]] = tuple
    heeds_ignores: bool = False


class Fixed(Struct, frozen=True):
    """What came of a repair: the findings before and after, and the new bytes of each file.

    `left_out` says why a repair was not made. `judge_again` judges the stage in another file as
    this one was judged.
    """

    root: Path
    before: tuple[Finding, ...]
    after: tuple[Finding, ...]
    repairs: tuple[Repair, ...]
    files: dict[Path, bytes]
    left_out: dict[Site, str]
    judge_again: Callable[[Path], tuple[Finding, ...]]

    @property
    def left(self) -> tuple[Finding, ...]:
        """The errors and warnings that remain."""
        return tuple(finding for finding in self.after if finding.severity != "note")

    @property
    def repaired(self) -> tuple[Finding, ...]:
        """The errors and warnings that are gone."""
        kept = {site_of(finding) for finding in self.after}
        return tuple(
            finding
            for finding in self.before
            if finding.severity != "note" and site_of(finding) not in kept
        )


@quiet()
def fix_stage(path: Path, checkpoint: str, lab: Lab, options: FixOptions) -> Fixed:
    """Repair in memory what the check finds in a stage; no file is written.

    Raises:
        StageError: the stage cannot be opened, or a rule failed.
    """
    asked = lab.checkpoints[checkpoint]
    starter = None if options.starter is None else open_starter(Path(options.starter), lab)

    def found(file: Path, stage: Any) -> Iterable[Finding]:
        judged = judge(lab, asked, read_model(stage, lab, str(file)))
        findings = _findings_of(file, judged)
        if starter is None:
            return findings
        result = StageResult(str(file), asked.id, "fail", Score(0.0, 0.0), findings)
        return open_against_starter(result, stage, starter, lab).findings

    return _fixed(path, found, (lab, asked), options)


@quiet()
def fix_linted(path: Path, release: str, options: FixOptions) -> Fixed:
    """Repair in memory what the linter finds in a stage; no file is written.

    Raises:
        StageError: the stage cannot be opened, or a rule failed.
        UsageError: the release is not known.
    """
    lab = lint_lab(release)

    def found(file: Path, stage: Any) -> Iterable[Finding]:
        model = read_model(stage, lab, str(file))
        return _findings_of(file, lint(LintSubject(lab, load_isaac_types(), model, release)))

    return _fixed(path, found, (lab, lab.checkpoints[lab.first]), options)


def _findings_of(file: Path, judged: Judgement | RuleResults) -> tuple[Finding, ...]:
    if judged.crashes:
        raise StageError(f"{file}: rule {judged.crashes[0].rule} failed: {judged.crashes[0].error}")
    return tuple(ordered(judged.findings))


def _fixed(
    path: Path,
    found: Callable[[Path, Any], Iterable[Finding]],
    asked: tuple[Lab, Checkpoint],
    options: FixOptions,
) -> Fixed:
    """Judge a stage, repair it, and judge it again; what is restored is as `asked` builds it."""
    if path.suffix.lower() == _PACKAGE:
        raise StageError(
            f"{path}: is a package, which is not repaired; unpack it and repair its stage"
        )
    stage = open_stage(path)

    def judged(file: Path, stage: Any) -> tuple[Finding, ...]:
        try:
            findings = tuple(found(file, stage))
            heed = options.heeds_ignores
            return options.wanted(without_noted(findings, stage, file) if heed else findings)
        finally:
            release_start_values(stage)  # which edits are about to change

    before = judged(path, stage)
    sites = dict.fromkeys(site_of(finding) for finding in before if _repair_of(finding, options))
    first = EditSession(stage, *asked, options.root_only, options.starter)

    def attempt(kept: frozenset[Site]) -> Attempt:
        again = _Rounds(replace(first, edited={}), options, frozenset(sites) - kept)
        return again.attempt(before, lambda: judged(path, stage))

    chosen = most_helpful(tuple(sites), attempt)
    made = chosen.attempt
    return Fixed(
        root=path,
        before=before,
        after=made.after,
        repairs=made.repairs,
        files=made.files,
        left_out=chosen.left_out,
        judge_again=lambda copy: judged(copy, open_stage(copy)),
    )


def _repair_of(finding: Finding, options: FixOptions) -> Repair | None:
    fix = finding.fix if finding.severity != "note" else None
    return fix if fix and (options.unsafe or fix.safe) else None


class _Rounds(Struct, frozen=True, eq=False):
    """Edits the layers of a session until nothing is left to do, but for some repairs."""

    session: EditSession
    options: FixOptions
    left_out: frozenset[Site]

    def attempt(
        self, before: tuple[Finding, ...], judged: Callable[[], tuple[Finding, ...]]
    ) -> Attempt:
        """Return what comes of the repairs; the layers hold again what they held before."""
        try:
            return self._attempt(before, judged)
        except StageError as error:
            return Attempt(before, error=str(error))
        finally:
            self.session.close()

    def _attempt(
        self, before: tuple[Finding, ...], judged: Callable[[], tuple[Finding, ...]]
    ) -> Attempt:
        after, made = before, dict[Repair, None]()
        for _ in range(_ROUNDS):
            repairs = self._made(after)
            found = judged() if repairs else after
            made.update(dict.fromkeys(repairs))
            if found == after:
                break
            after = found
        edited = self.session.edited.values()
        files = {Path(layer.layer.realPath): new_bytes(layer) for layer in edited}
        changed = {name: data for name, data in files.items() if name.read_bytes() != data}
        return Attempt(after, tuple(made), changed)

    def _made(self, findings: Iterable[Finding]) -> list[Repair]:
        """Make the repairs of these findings, each edit once, and return them.

        Prims are moved last: the other edits name them where they were found.
        """
        asked = (finding for finding in findings if site_of(finding) not in self.left_out)
        repairs = [fix for finding in asked if (fix := _repair_of(finding, self.options))]
        edits = dict.fromkeys(edit for repair in repairs for edit in repair.edits)
        for edit in sorted(edits, key=lambda each: isinstance(each, MovePrim)):
            apply_edit(self.session, edit)
        return repairs


@quiet()
def check_result(fixed: Fixed, data: bytes, target: Path) -> None:
    """Open and judge the bytes of a repaired file where they are going to stand.

    A file beside the root layer is not the repaired stage: it holds what was judged in memory.

    Raises:
        StageError: no stage can be opened from them, or there is more to find than before.
        UsageError: nothing can be written there.
    """
    is_whole = {*fixed.files} <= {fixed.root.resolve()}
    try:
        temporary = temporary_beside(target, target.suffix)
    except OSError as error:
        raise UsageError(f"{target} cannot be written ({error.strerror})") from error
    try:
        temporary.write_bytes(data)
        if is_whole:
            found = fixed.judge_again(temporary)
        else:
            open_stage(temporary)
            found = fixed.after
    finally:
        temporary.unlink(missing_ok=True)
    if weight(found) > weight(fixed.before):
        raise StageError(
            f"{target}: the repaired stage would be worse than before; nothing was written"
        )


def repair_open_stage(repair: Repair, stage: Any) -> None:
    """Make the edits of a repair in the layers of a stage; no file is written."""
    lab = load_lab()
    checkpoint = checkpoint_of(Path(stage.GetRootLayer().realPath).name, lab) or lab.first
    session = EditSession(stage, lab, lab.checkpoints[checkpoint])
    for edit in sorted(repair.edits, key=lambda each: isinstance(each, MovePrim)):
        apply_edit(session, edit)


Changes = Mapping[tuple[str, Site], tuple[TextChange, ...]]


@quiet()
def text_changes(report: Report, lab: Lab, starter: str | None) -> Changes:
    """Return what the safe repair of each finding changes in text files, each by itself.

    What is restored is taken from the starter, None for the bundled one.
    """
    return {
        key: lines for result in report.results for key, lines in _changes(result, lab, starter)
    }


def _changes(
    result: StageResult, lab: Lab, starter: str | None
) -> Iterator[tuple[tuple[str, Site], tuple[TextChange, ...]]]:
    repairs = {
        site_of(finding): finding.fix
        for finding in result.findings
        if finding.fix and finding.fix.safe
    }
    if not repairs:
        return
    stage, asked = open_stage(Path(result.path)), lab.checkpoints[result.checkpoint or lab.first]
    for site, repair in repairs.items():
        session = EditSession(stage, lab, asked, starter=starter)
        lines = tuple(_lines(session, repair, result.path))
        if lines:
            yield (result.path, site), lines


def _lines(session: EditSession, repair: Repair, path: str) -> Iterator[TextChange]:
    try:
        for edit in repair.edits:
            apply_edit(session, edit)
        root = session.stage.GetRootLayer()
        for layer in session.edited.values():
            name = path if layer.layer == root else str(layer.layer.realPath)
            yield from _hunks(layer, name) if is_text(layer.layer) else ()
    except StageError:  # the repair cannot be written as text
        return
    finally:
        session.close()


def _hunks(edited: EditedLayer, name: str) -> Iterator[TextChange]:
    before = Path(edited.layer.realPath).read_bytes().decode().splitlines(keepends=True)
    after = new_bytes(edited).decode().splitlines(keepends=True)
    matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
    for kind, first, last, start, stop in matcher.get_opcodes():
        if kind != "equal":
            yield TextChange(name, first, last, "".join(after[start:stop]))
