"""The lines of text files that the repair of each finding changes, each by itself.

A file is read once for all repairs, and of a repair only the lines between its first and its last
edit are looked at.
"""

from __future__ import annotations

import difflib
import itertools
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import StageError
from lab3_usd.files import is_script_file, lines_of
from lab3_usd.fix.source_tree import read_blocks
from lab3_usd.fix.splices import Splice, spliced
from lab3_usd.fix.text_editor import new_bytes, prim_splices
from lab3_usd.model.changes import (
    Activate,
    ApplySchema,
    ClearValue,
    Connect,
    RemoveSchema,
    RenameProperty,
    Repair,
    Restore,
    Retarget,
    SetType,
    SetValue,
    TextChange,
)
from lab3_usd.model.finding import Report, Site, site_of
from lab3_usd.model.prims import is_at_or_below, upwards
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import lab_of_team
from lab3_usd.stage.edit.repairs import apply_edit
from lab3_usd.stage.edit.session import (
    EditedLayer,
    EditSession,
    Reference,
    is_text,
    layer_from,
    same_prim,
)
from lab3_usd.stage.read.opening import open_stage, quiet

Changes = Mapping[tuple[str, Site], tuple[TextChange, ...]]
_OF_ONE_PRIM = (
    *(SetValue, ClearValue, Connect, Retarget, RenameProperty),
    *(ApplySchema, RemoveSchema, Activate, SetType, Restore),
)


class _Source(Struct):
    """The text of a layer, and where its lines begin."""

    text: str
    starts: Sequence[int]


@quiet()
def text_changes(report: Report, lab: Lab, starter: str | None) -> Changes:
    """Return what the safe repair of each finding changes in text files, each by itself.

    What is restored is taken from the starter, None for the bundled one.
    """
    changes: dict[tuple[str, Site], tuple[TextChange, ...]] = {}
    for result in report.results:
        repairs = {
            site_of(finding): finding.fix
            for finding in result.findings
            if finding.fix and finding.fix.safe
        }
        if not repairs or is_script_file(result.path):  # whose repairs are the fix command's
            continue
        stage = open_stage(Path(result.path))
        number = result.checkpoint or lab.first
        own = lab_of_team(lab, [(result.path, number)] if result.checkpoint else [])
        right = Reference(own.at(number), own.checkpoints[number], starter)
        session = EditSession(stage, own.platform, right)
        for site, repair in repairs.items():
            lines = tuple(_lines(session, repair, result.path))
            if lines:
                changes[result.path, site] = lines
    _source.cache_clear()
    return changes


def _lines(session: EditSession, repair: Repair, path: str) -> Iterator[TextChange]:
    """Yield the lines of a repair; where more than single prims change, whole layers are kept."""
    if _is_of_single_prims(repair):
        changes = _edited_lines(replace(session, by_prim=True, edited={}), repair, path)
        if changes is not None:
            yield from changes
            return
    yield from _edited_lines(replace(session, edited={}), repair, path) or ()


def _is_of_single_prims(repair: Repair) -> bool:
    """Whether a repair changes nothing but prims and their properties, and renames no other."""
    kinds = {type(edit) for edit in repair.edits}
    is_whole = any(
        edit.prim == "/" or (isinstance(edit, Restore) and edit.property is None)
        for edit in repair.edits
    )
    return (
        kinds <= {*_OF_ONE_PRIM}
        and not is_whole
        and (RenameProperty not in kinds or len(repair.edits) == 1)
    )


def _edited_lines(session: EditSession, repair: Repair, path: str) -> list[TextChange] | None:
    """Return the lines of a repair, as far as it can be written; None where all is to be kept."""
    changes: list[TextChange] = []
    try:
        for edit in repair.edits:
            apply_edit(session, edit)
        root = session.stage.GetRootLayer()
        for edited in session.edited.values():
            if is_text(edited.layer):
                name = path if edited.layer == root else str(edited.layer.realPath)
                differences = (_lines_of_prims if session.by_prim else _lines_of_layer)(
                    edited, name
                )
                if differences is None:
                    return None
                changes += differences
    except StageError:  # the repair cannot be written as text
        return None if session.by_prim else changes
    finally:
        session.close()
    return changes


def _lines_of_layer(edited: EditedLayer, name: str) -> list[TextChange]:
    content = Path(edited.layer.realPath).read_bytes()
    before, after = lines_of(content.decode()), lines_of(new_bytes(edited, content).decode())
    return [*_differences(before, after, 0, name)]


def _lines_of_prims(edited: EditedLayer, name: str) -> list[TextChange] | None:
    """Return the lines that change; None where the new text of a prim does not say what it is."""
    source = _source(edited.layer.realPath)
    text, starts = source.text, source.starts
    by_prim = prim_splices(text, edited)
    if not all(_is_said(text, top, splices, edited) for top, splices in by_prim.items()):
        return None
    splices = [splice for several in by_prim.values() for splice in several]
    if not splices:
        return []
    first = bisect_right(starts, min(splice.start for splice in splices)) - 1
    last = bisect_right(starts, max(splice.end for splice in splices))
    start = starts[first]
    for more in itertools.count():  # lines like the last that changes may follow
        stop = starts[last + more] if last + more < len(starts) else len(text)
        before = lines_of(text[start:stop])
        after = lines_of(spliced(text, splices, start, stop))
        shorter = min(len(before), len(after))
        if stop == len(text) or _equal_count(before, after, shorter) < shorter:
            break
    return [*_differences(before, after, first, name)]


@lru_cache(maxsize=8)
def _source(path: str) -> _Source:
    text = Path(path).read_bytes().decode()
    ends = itertools.accumulate(len(line) for line in lines_of(text))
    return _Source(text, [0, *ends][:-1] or [0])


def _is_said(text: str, top: str, splices: Sequence[Splice], edited: EditedLayer) -> bool:
    """Whether the new text of a prim, read by itself, says what its layer holds."""
    block = read_blocks(text).get(top)
    if block:
        cuts = [Splice(inner.start, inner.end, "") for inner in block.inner]
        new = spliced(text, [*splices, *cuts], block.start, block.end)
    else:  # a new prim with what is below it
        new = "".join(splice.text for splice in splices)
    above = [path.rpartition("/")[2] for path in [*upwards(top)][:0:-1]]
    opened, closed = "".join(f'over "{name}" {{\n' for name in above), "}\n" * len(above)
    written = layer_from(f"#usda 1.0\n{opened}{new}\n{closed}")
    prims = [top] if block else [path for path in edited.touched if is_at_or_below(path, top)]
    return written is not None and all(same_prim(written, edited.layer, path) for path in prims)


def _differences(
    before: Sequence[str], after: Sequence[str], first: int, name: str
) -> Iterator[TextChange]:
    """Yield the lines that differ; `first` is the number of the first line that is given.

    Most of a file stays: only what stands between its first and last changed line is matched.
    """
    shorter = min(len(before), len(after))
    head = _equal_count(before, after, shorter)
    tail = _equal_count(reversed(before), reversed(after), shorter - head)
    old, new = before[head : len(before) - tail], after[head : len(after) - tail]
    matcher = difflib.SequenceMatcher(None, old, new, autojunk=False)
    for kind, start, stop, begin, end in matcher.get_opcodes():
        if kind != "equal":
            at = first + head
            yield TextChange(name, at + start, at + stop, "".join(new[begin:end]))


def _equal_count(before: Iterable[str], after: Iterable[str], most: int) -> int:
    """Return how many of the first lines are equal, at most so many."""
    pairs = itertools.islice(zip(before, after, strict=False), most)
    return next((place for place, (old, new) in enumerate(pairs) if old != new), most)
