"""The findings of a block as the page shows them: merged over its stages, by handout section."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec.structs import replace

from lab3_usd.check.finding import SEVERITIES, Finding
from lab3_usd.report.excerpt import read_excerpts
from lab3_usd.report.frame import code_frame
from lab3_usd.report.html_blocks import short_path
from lab3_usd.report.html_model import (
    Block,
    Card,
    Chapter,
    Excerpts,
    Fault,
    Line,
    Link,
    Section,
)
from lab3_usd.spec.spec import Lab

FRAME_WIDTH = 96
_NOT_OPENED = ("F03", "Z01", "Z02")
_NOT_FOUND = "F02"  # is about one prim, for which other files may do as well
MOST_FRAMES = 80  # in one block: a page stays small whatever a stage holds
_SECTION = re.compile(r"(?:([A-Z])(?=\d|$))?(\d+)?(?:\.(\d+))?")
_Key = tuple[int, str, int, int, str]


def faults(block: Block, *, graded: bool = False) -> list[Fault]:
    """Return the different faults of a block, in the order of the handout's sections.

    Where they cost points, what was not opened comes before what is missing for it.
    """
    found: dict[Finding, list[tuple[int, Finding]]] = {}
    for index, finding in _findings(block):
        # Where it stands differs from file to file, and so does what else it concerns.
        key = replace(finding, layer=None, line=None, column=None, related=())
        found.setdefault(key, []).append((index, finding))
    causes = set(_causes(found)) if graded else set()
    order = sorted(found, key=lambda finding: (finding not in causes, *_order(finding)))
    return [
        _fault(f"{block.id}-f{n}", found[key], block, is_cause=key in causes)
        for n, key in enumerate(order, 1)
    ]


def _causes(found: Iterable[Finding]) -> Iterator[Finding]:
    """Yield what was not opened, as far as something is wrong where it belongs."""
    wrong = sorted(f"{each.prim}/" for each in found if each.severity == "error")
    for each in found:
        below = f"{each.prim}/"
        at = bisect_left(wrong, below)
        is_wrong = at < len(wrong) and wrong[at].startswith(below)
        if each.rule in _NOT_OPENED or (each.rule == _NOT_FOUND and is_wrong):
            yield each


def _fault(
    name: str, seen: Sequence[tuple[int, Finding]], block: Block, *, is_cause: bool
) -> Fault:
    stages = tuple(dict.fromkeys(index for index, _ in seen if index >= 0))
    places = dict.fromkeys(_place(finding, block) for _, finding in seen)
    first = seen[0][1]
    related = max((finding.related for _, finding in seen), key=len)
    shown = tuple(place for place in places if place not in {"", first.prim})
    return Fault(name, replace(first, related=related), stages, shown, is_cause)


def _findings(block: Block) -> Iterator[tuple[int, Finding]]:
    """Yield every finding with the number of its stage, -1 for those of the submission."""
    for stage in block.stages:
        yield from ((stage.index, finding) for finding in stage.result.findings)
    if block.submission is not None:
        yield from ((-1, finding) for finding in block.submission.findings)


def _place(finding: Finding, block: Block) -> str:
    if not finding.layer:
        return ""
    numbers = [finding.line, finding.column if finding.line else None]
    place = short_path(finding.layer, block.path)
    return ":".join([place, *(str(number) for number in numbers if number is not None)])


def _order(finding: Finding) -> tuple[_Key, int]:
    return section_key(finding.handout), SEVERITIES.index(finding.severity)


def section_key(name: str | None) -> _Key:
    """Return what sorts sections as the handout has them: 4.4, Parts A to J, 6.1, 8.11, none."""
    found = _SECTION.match(name or "")
    letter, number, below = found.groups() if found else (None, None, None)
    before_the_parts = 5
    if letter:
        place = 1
    elif number:
        place = 0 if int(number) <= before_the_parts else 2
    else:
        place = 3
    return place, letter or "", int(number or 0), int(below or 0), name or ""


def cards(
    block: Block, found: Iterable[Fault], links: Mapping[str, tuple[Link, ...]]
) -> Iterator[Card]:
    """Yield a card for each fault, with the lines of its file where those can be read."""
    all_faults = list(found)
    excerpts = read_excerpts(fault.finding for fault in all_faults[:MOST_FRAMES])
    for fault in all_faults:
        frame = tuple(_frame(fault.finding, excerpts))
        yield Card(fault, block.span(fault.stages), frame, links.get(fault.id, ()))


def _frame(finding: Finding, excerpts: Excerpts) -> Iterator[Line]:
    if not finding.layer or not finding.line:
        return
    excerpt = excerpts.get((finding.layer, finding.line))
    if excerpt is None:
        return
    for row in code_frame(excerpt, finding.line, finding.column, FRAME_WIDTH):
        gutter, bar, text = row.partition(" |")
        yield Line(gutter + bar, text, is_hit=row.startswith(">"))


def chapters(found: Sequence[Card], lab: Lab) -> tuple[Chapter, ...]:
    """Group cards, which are in order already, by section and those by part of the handout."""
    titles: dict[str, str] = {}
    for each in lab.checkpoints.values():
        titles.setdefault(each.part, each.title)
    sections: dict[tuple[str, str], list[Card]] = {}
    for card in found:
        name = card.fault.finding.handout or ""
        title = "Not opened" if card.fault.is_cause else _chapter(name, titles)
        sections.setdefault((title, name), []).append(card)
    parts: dict[str, list[Section]] = {}
    for (title, name), inside in sections.items():
        parts.setdefault(title, []).append(Section(name, tuple(inside)))
    return tuple(Chapter(title, tuple(inside)) for title, inside in parts.items())


def by_severity(found: Iterable[Chapter]) -> tuple[Chapter, ...]:
    """Return chapters by the worst that is in them, those alike in the order they come in.

    Causes of other faults are the worst.
    """

    def worst(chapter: Chapter) -> int:
        inside = [card.fault for section in chapter.sections for card in section.cards]
        return min(
            -1 if fault.is_cause else SEVERITIES.index(fault.finding.severity) for fault in inside
        )

    return tuple(sorted(found, key=worst))


def _chapter(section: str, titles: Mapping[str, str]) -> str:
    _, letter, number, _, _ = section_key(section)
    if letter:
        title = titles.get(letter, "")
        return f"Part {letter}: {title}" if title else f"Part {letter}"
    return f"Section {number}" if number else "Beside the handout"
