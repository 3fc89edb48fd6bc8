"""Repairs a stage: judges it, makes the edits, and judges it again until nothing is left to do."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.checker import Judgement, judge
from lab3_usd.check.lint.subject import LintSubject
from lab3_usd.check.linter import lint
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.errors import StageError, UsageError
from lab3_usd.files import temporary_beside
from lab3_usd.fix.attempts import Attempt, most_helpful, weight
from lab3_usd.fix.layer_bytes import new_bytes
from lab3_usd.judge.ignoring import without_noted
from lab3_usd.judge.lint import lint_lab
from lab3_usd.judge.starter import open_against_starter, open_starter
from lab3_usd.model.finding import Finding, Score, Site, StageResult, ordered, site_of
from lab3_usd.model.repair import MovePrim, Repair
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.load.isaac_types import load_isaac_types
from lab3_usd.stage.edit.apply import apply_edit
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.read.opening import open_stage, quiet
from lab3_usd.stage.read.reader import read_model
from lab3_usd.stage.read.time_samples import release_start_values

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
        return tuple(each for each in self.after if each.severity != "note")

    @property
    def repaired(self) -> tuple[Finding, ...]:
        """The errors and warnings that are gone."""
        kept = {site_of(each) for each in self.after}
        return tuple(
            each for each in self.before if each.severity != "note" and site_of(each) not in kept
        )


@quiet()
def fix_stage(path: Path, checkpoint: str, lab: Lab, options: FixOptions) -> Fixed:
    """Repair in memory what the check finds in a stage; no file is written.

    Raises:
        StageError: the stage cannot be opened, or a rule failed.
    """
    asked = lab.checkpoints[checkpoint]
    starter = None if options.starter is None else open_starter(Path(options.starter), lab)

    def found(file: Path, stage: Any) -> Iterable[Finding]:  # noqa: ANN401 - pxr has no types
        judged = judge(lab, asked, read_model(stage, lab, str(file)))
        findings = _said(file, judged)
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

    def found(file: Path, stage: Any) -> Iterable[Finding]:  # noqa: ANN401 - pxr has no types
        model = read_model(stage, lab, str(file))
        return _said(file, lint(LintSubject(lab, load_isaac_types(), model, release)))

    return _fixed(path, found, (lab, lab.checkpoints[lab.first]), options)


def _said(file: Path, judged: Judgement | RuleResults) -> tuple[Finding, ...]:
    if judged.crashes:
        message = f"{file}: rule {judged.crashes[0].rule} failed: {judged.crashes[0].error}"
        raise StageError(message)
    return tuple(ordered(judged.findings))


def _fixed(
    path: Path,
    found: Callable[[Path, Any], Iterable[Finding]],
    asked: tuple[Lab, Checkpoint],
    options: FixOptions,
) -> Fixed:
    """Judge a stage, repair it, and judge it again; what is restored is as `asked` builds it."""
    if path.suffix.lower() == _PACKAGE:
        message = f"{path}: is a package, which is not repaired; unpack it and repair its stage"
        raise StageError(message)
    stage = open_stage(path)

    def judged(file: Path, stage: Any) -> tuple[Finding, ...]:  # noqa: ANN401 - pxr has no types
        try:
            findings = tuple(found(file, stage))
            heed = options.heeds_ignores
            return options.wanted(without_noted(findings, stage, file) if heed else findings)
        finally:
            release_start_values(stage)  # which edits are about to change

    before = judged(path, stage)
    sites = dict.fromkeys(site_of(each) for each in before if _repair_of(each, options))
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
        files = {Path(each.layer.realPath): new_bytes(each) for each in edited}
        changed = {name: data for name, data in files.items() if name.read_bytes() != data}
        return Attempt(after, tuple(made), changed)

    def _made(self, findings: Iterable[Finding]) -> list[Repair]:
        """Make the repairs of these findings, each edit once, and return them.

        Prims are moved last: the other edits name them where they were found.
        """
        asked = (each for each in findings if site_of(each) not in self.left_out)
        repairs = [fix for each in asked if (fix := _repair_of(each, self.options))]
        edits = dict.fromkeys(edit for each in repairs for edit in each.edits)
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
        message = f"{target} cannot be written ({error.strerror})"
        raise UsageError(message) from error
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
        message = f"{target}: the repaired stage would be worse than before; nothing was written"
        raise StageError(message)
