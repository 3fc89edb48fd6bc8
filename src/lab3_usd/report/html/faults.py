"""The findings of a block for the page, merged over its stages, by severity and section."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby

from lab3_usd.model.finding import Finding, Severity, section_key
from lab3_usd.report.blocks import Block
from lab3_usd.report.faults import Fault
from lab3_usd.report.html.model import Card, Chapter, ExcerptLine, Excerpts, Link, Rank, Section
from lab3_usd.report.source_excerpt import excerpt_lines, read_excerpts
from lab3_usd.spec.lab import Lab

EXCERPT_WIDTH = 96
MOST_EXCERPTS = 80  # in one block: a page stays small whatever a stage holds


def cards(
    block: Block, found: Iterable[Fault], links: Mapping[str, tuple[Link, ...]]
) -> Iterator[Card]:
    """Yield a card for each fault, with the lines of its file where those can be read."""
    all_faults = list(found)
    excerpts = read_excerpts(fault.finding for fault in all_faults[:MOST_EXCERPTS])
    for fault in all_faults:
        frame = tuple(_excerpt(fault.finding, excerpts))
        yield Card(fault, block.span(fault.stages), frame, links.get(fault.id, ()))


def _excerpt(finding: Finding, excerpts: Excerpts) -> Iterator[ExcerptLine]:
    if not finding.layer or not finding.line:
        return
    excerpt = excerpts.get((finding.layer, finding.line))
    if excerpt is None:
        return
    for row in excerpt_lines(excerpt, finding.line, finding.column, EXCERPT_WIDTH):
        gutter, bar, text = row.partition(" |")
        yield ExcerptLine(gutter + bar, text, is_hit=row.startswith(">"))


def ranks(found: Sequence[Card], lab: Lab) -> tuple[Rank, ...]:
    """Group cards, which are in order already, by severity, part and section of the handout."""
    titles: dict[str, list[str]] = {}
    for each in lab.checkpoints.values():
        titles.setdefault(each.part, []).append(each.title)
    return tuple(
        Rank(severity, tuple(_chapters(list(inside), titles)))
        for severity, inside in groupby(found, key=_severity)
    )


def _severity(card: Card) -> Severity | None:
    return None if card.fault.is_cause else card.fault.finding.severity


def _chapters(found: Iterable[Card], titles: Mapping[str, list[str]]) -> Iterator[Chapter]:
    parts: dict[str, dict[str, list[Card]]] = {}
    for card in found:
        name = card.fault.finding.handout or ""
        title = "Not opened" if card.fault.is_cause else _chapter(name, titles)
        parts.setdefault(title, {}).setdefault(name, []).append(card)
    for title, sections in parts.items():
        inside = (Section(name, tuple(cards)) for name, cards in sections.items())
        yield Chapter(title, tuple(inside))


def _chapter(section: str, titles: Mapping[str, list[str]]) -> str:
    """Name the part of the handout that a section is in, by the checkpoint of that part."""
    part = max((each for each in titles if _is_in(section, each)), key=len, default="")
    _, letter, number, _, _ = section_key(section)
    if part:
        name = f"Part {part}" if len(part) == 1 else part
        return f"{name}: {titles[part][0]}" if len(titles[part]) == 1 else name
    if letter:
        return f"Part {letter}"
    return f"Section {number}" if number else section or "Beside the handout"


def _is_in(section: str, part: str) -> bool:
    """Whether a section is of a part: A5 of A, 4.5 of 4, Ex 3.2 of Ex 3, but Ex 31 is not."""
    if not part or not section.startswith(part):
        return False
    last, following = part[-1], section[len(part) : len(part) + 1]
    return not (last.isdigit() and following.isdigit()) and not (
        last.isalpha() and following.isalpha()
    )
