"""Repairs a stage: judges it, makes the edits, and judges it again until nothing is left to do."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from msgspec import Struct

from lab3_usd.check.checker import judge
from lab3_usd.errors import StageError, UsageError
from lab3_usd.files import temporary_beside
from lab3_usd.fix.layer_bytes import new_bytes
from lab3_usd.model.finding import Finding
from lab3_usd.model.order import ordered
from lab3_usd.model.repair import MovePrim, Repair
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.stage.edit.apply import apply_edit
from lab3_usd.stage.edit.session import EditSession
from lab3_usd.stage.read.opening import open_stage, quiet
from lab3_usd.stage.read.reader import read_model

_PACKAGE = ".usdz"
_ROUNDS = 8  # a missing graph needs three: the graph, its connections, what those bring to light


class FixOptions(Struct, frozen=True):
    """Which repairs are made, and where: `wanted` says of a finding whether to repair it."""

    unsafe: bool = False
    root_only: bool = False
    starter: str | None = None
    wanted: Callable[[Finding], bool] = lambda _: True


class Fixed(Struct, frozen=True):
    """What came of a repair: the findings before and after, and the new bytes of each file.

    `judge_again` judges the stage in another file as this one was judged.
    """

    root: Path
    before: tuple[Finding, ...]
    after: tuple[Finding, ...]
    repairs: tuple[Repair, ...]
    files: dict[Path, bytes]
    judge_again: Callable[[Path], tuple[Finding, ...]]

    @property
    def left(self) -> tuple[Finding, ...]:
        """The errors and warnings that remain."""
        return tuple(each for each in self.after if each.severity != "note")

    @property
    def repaired(self) -> tuple[Finding, ...]:
        """The errors and warnings that are gone."""
        kept = {(each.rule, each.prim, each.property) for each in self.after}
        told = (each for each in self.before if each.severity != "note")
        return tuple(each for each in told if (each.rule, each.prim, each.property) not in kept)


def _weight(findings: Iterable[Finding]) -> tuple[int, int]:
    severities = [each.severity for each in findings]
    return severities.count("error"), severities.count("warning")


@quiet()
def fix_stage(path: Path, checkpoint: str, lab: Lab, options: FixOptions) -> Fixed:
    """Repair a stage in memory; no file is written.

    Raises:
        StageError: the stage cannot be opened, or a repaired layer cannot be written as text.
    """
    if path.suffix.lower() == _PACKAGE:
        message = f"{path}: is a package, which is not repaired; unpack it and repair its stage"
        raise StageError(message)
    asked = lab.checkpoints[checkpoint]
    session = EditSession(open_stage(path), lab, asked, options.root_only, options.starter)

    def judged(stage: Any) -> tuple[Finding, ...]:  # noqa: ANN401 - pxr has no types
        return tuple(each for each in _findings(stage, lab, asked, path) if options.wanted(each))

    try:
        before = after = judged(session.stage)
        made: list[Repair] = []
        for _ in range(_ROUNDS):
            repairs = _repaired(session, after, options)
            if not repairs:
                break
            made += repairs
            after = judged(session.stage)
        files = {Path(each.layer.realPath): new_bytes(each) for each in session.edited.values()}
    finally:
        session.close()
    changed = {name: data for name, data in files.items() if name.read_bytes() != data}
    return Fixed(path, before, after, tuple(made), changed, lambda copy: judged(open_stage(copy)))


def _findings(stage: Any, lab: Lab, checkpoint: Checkpoint, path: Path) -> tuple[Finding, ...]:  # noqa: ANN401
    judged = judge(lab, checkpoint, read_model(stage, lab, str(path)))
    if judged.crashes:
        message = f"{path}: rule {judged.crashes[0].rule} failed: {judged.crashes[0].error}"
        raise StageError(message)
    return tuple(ordered(judged.findings))


def _repaired(
    session: EditSession, findings: Iterable[Finding], options: FixOptions
) -> list[Repair]:
    """Make the repairs of these findings, each edit once, and return them.

    Prims are moved last: the other edits name them where they were found.
    """
    repairs = [each.fix for each in findings if each.fix and (options.unsafe or each.fix.safe)]
    edits = dict.fromkeys(edit for each in repairs for edit in each.edits)
    for edit in sorted(edits, key=lambda each: isinstance(each, MovePrim)):
        apply_edit(session, edit)
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
    if _weight(found) > _weight(fixed.before):
        message = f"{target}: the repaired stage would be worse than before; nothing was written"
        raise StageError(message)
