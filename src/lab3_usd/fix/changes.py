"""The lines that each repair would change, for reports that show them."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from pathlib import Path

from lab3_usd.errors import StageError
from lab3_usd.fix.layer_bytes import new_bytes
from lab3_usd.model.finding import Report, Site, StageResult, site_of
from lab3_usd.model.repair import Repair, TextChange
from lab3_usd.spec.lab import Lab
from lab3_usd.stage.edit.apply import apply_edit
from lab3_usd.stage.edit.contents import is_text
from lab3_usd.stage.edit.session import EditedLayer, EditSession
from lab3_usd.stage.read.opening import open_stage, quiet

Changes = Mapping[tuple[str, Site], tuple[TextChange, ...]]


@quiet()
def text_changes(report: Report, lab: Lab, starter: str | None) -> Changes:
    """Return what the safe repair of each finding changes in text files, each by itself.

    What is restored is taken from the starter, None for the bundled one.
    """
    return {key: lines for each in report.results for key, lines in _changes(each, lab, starter)}


def _changes(
    result: StageResult, lab: Lab, starter: str | None
) -> Iterator[tuple[tuple[str, Site], tuple[TextChange, ...]]]:
    repairs = {site_of(each): each.fix for each in result.findings if each.fix and each.fix.safe}
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
        for each in session.edited.values():
            name = path if each.layer == root else str(each.layer.realPath)
            yield from _hunks(each, name) if is_text(each.layer) else ()
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
