"""What the HTML page shows, as plain data: blocks of stages, faults, pictures and topics."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.model.finding import (
    ChecklistItem,
    Crash,
    Severity,
)
from lab3_usd.report.blocks import Block, Stages
from lab3_usd.report.faults import Fault
from lab3_usd.report.source_excerpt import Excerpt


class Link(Struct, frozen=True):
    """The way from a fault to its port: the element to go to, and the part of the picture.

    `view` is the box of an SVG view (`x y width height`), empty for the graph as a whole.
    """

    target: str
    picture: str
    title: str
    stages: Stages
    view: str = ""


class PagePicture(Struct, frozen=True):
    """One picture with the stages it shows; `svg` is None where the page has no room for it."""

    id: str
    title: str
    kind: str
    stages: Stages
    size: tuple[float, float]
    faults: int = 0
    svg: str | None = None
    lines: tuple[str, ...] = ()


class ExcerptLine(Struct, frozen=True):
    """One line of a code frame: the gutter, the text, and whether it is the line of the fault."""

    gutter: str
    text: str
    is_hit: bool


class Card(Struct, frozen=True):
    """A fault as it is shown, with its code frame and its places in the pictures."""

    fault: Fault
    span: str
    excerpt: tuple[ExcerptLine, ...] = ()
    links: tuple[Link, ...] = ()


class Section(Struct, frozen=True):
    """The faults against one section of the handout."""

    name: str
    cards: tuple[Card, ...]


class Chapter(Struct, frozen=True):
    """The sections of one part of the handout."""

    title: str
    sections: tuple[Section, ...]


class Rank(Struct, frozen=True):
    """The chapters of one severity; what was not opened stands before all, without one."""

    severity: Severity | None
    chapters: tuple[Chapter, ...]

    @property
    def cards(self) -> tuple[Card, ...]:
        """Every card, in the order of the page."""
        sections = (section for chapter in self.chapters for section in chapter.sections)
        return tuple(card for section in sections for card in section.cards)


class Topic(Struct, frozen=True):
    """One row of the topic table, and the stages that have it."""

    cells: tuple[str, ...]
    stages: Stages


class ChecklistSection(Struct, frozen=True):
    """The lines of the handout's checklist for one section."""

    name: str
    items: tuple[ChecklistItem, ...]


class BlockView(Struct, frozen=True):
    """Everything that the page shows of one block."""

    block: Block
    ranks: tuple[Rank, ...]
    graphs: tuple[PagePicture, ...]
    trees: tuple[PagePicture, ...]
    topics: tuple[Topic, ...]
    checks: tuple[ChecklistSection, ...]
    crashes: tuple[tuple[str, Crash], ...] = ()

    @property
    def cards(self) -> tuple[Card, ...]:
        """Every card, in the order of the page."""
        return tuple(card for rank in self.ranks for card in rank.cards)

    def count(self, severity: Severity) -> int:
        """Return how many different faults of one severity there are."""
        return sum(card.fault.finding.severity == severity for card in self.cards)


Excerpts = dict[tuple[str, int], Excerpt]
