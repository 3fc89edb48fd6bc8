"""What the HTML page shows, as plain data: blocks of stages, faults, pictures and topics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

from msgspec import Struct

from lab3_usd.check.finding import (
    ChecklistItem,
    Crash,
    Finding,
    Severity,
    StageResult,
    Submission,
    Verdict,
)
from lab3_usd.report.excerpt import Excerpt

Stages = tuple[int, ...]


class Part(Struct, frozen=True):
    """Requirements met and asked of one graph or scene part."""

    name: str
    met: int
    asked: int


class Stage(Struct, frozen=True):
    """One stage on the page; `index` is its number on the page, `label` its short name."""

    index: int
    label: str
    title: str
    file: str
    result: StageResult
    parts: tuple[Part, ...] = ()

    def part(self, name: str) -> Part | None:
        """Return the requirements of one part, None where the checkpoint asks for none."""
        return next((part for part in self.parts if part.name == name), None)

    def count(self, severity: Severity) -> int:
        """Return how many findings of one severity the stage has."""
        return sum(each.severity == severity for each in self.result.findings)


class Block(Struct, frozen=True):
    """Stages that belong together: one submission, or the files that were given beside it."""

    id: str
    path: str
    stages: tuple[Stage, ...]
    submission: Submission | None = None

    @property
    def name(self) -> str:
        """The name to show: the only file, else the folder."""
        if self.submission is None and len(self.stages) == 1:
            return self.stages[0].file
        return PurePath(self.path).name or self.path

    @property
    def matrix(self) -> dict[str, tuple[Part | None, ...]]:
        """The parts by name, each with its requirements in every stage."""
        names = dict.fromkeys(part.name for stage in self.stages for part in stage.parts)
        return {name: tuple(stage.part(name) for stage in self.stages) for name in names}

    @property
    def passed(self) -> int:
        """How many of the stages pass."""
        return sum(stage.result.verdict == "pass" for stage in self.stages)

    @property
    def verdict(self) -> Verdict:
        """The worst that is said of a stage or of the submission."""
        verdicts = {stage.result.verdict for stage in self.stages}
        about = () if self.submission is None else self.submission.findings
        if "fail" in verdicts or any(finding.severity == "error" for finding in about):
            return "fail"
        return "unreadable" if "unreadable" in verdicts else "pass"

    def span(self, indexes: Sequence[int]) -> str:
        """Name some of the stages in short: `02-05, 08`, with a dash for all in between."""
        runs: list[list[Stage]] = []
        for stage in self.stages:
            if stage.index not in indexes:
                continue
            if runs and runs[-1][-1].index == stage.index - 1:
                runs[-1].append(stage)
            else:
                runs.append([stage])
        return ", ".join(_run(run) for run in runs)


def _run(stages: Sequence[Stage]) -> str:
    first, last = stages[0].label, stages[-1].label
    numbered = all(stage.label == stage.result.checkpoint for stage in stages)
    few = 2
    if not numbered or len(stages) <= few:
        return ", ".join(stage.label for stage in stages)
    return f"{first}\N{EN DASH}{last}"


class Fault(Struct, frozen=True):
    """A finding, and all the stages that have it.

    A fault that is carried along from file to file is one fault: `finding` is that of the first.
    `places` are the files with line and column, as editors take them. `is_cause` says that other
    faults follow from it: something that the stage refers to was not opened.
    """

    id: str
    finding: Finding
    stages: Stages
    places: tuple[str, ...]
    is_cause: bool = False


class Link(Struct, frozen=True):
    """The way from a fault to its port: the element to go to, and the part of the picture.

    `view` is the box of an SVG view (`x y width height`), empty for the graph as a whole.
    """

    target: str
    picture: str
    title: str
    stages: Stages
    view: str = ""


class Drawn(Struct, frozen=True):
    """One picture with the stages it shows; `svg` is None where the page has no room for it."""

    id: str
    title: str
    kind: str
    stages: Stages
    size: tuple[float, float]
    faults: int = 0
    svg: str | None = None
    lines: tuple[str, ...] = ()


class Line(Struct, frozen=True):
    """One line of a code frame: the gutter, the text, and whether it is the line of the fault."""

    gutter: str
    text: str
    is_hit: bool


class Card(Struct, frozen=True):
    """A fault as it is shown, with its code frame and its places in the pictures."""

    fault: Fault
    span: str
    frame: tuple[Line, ...] = ()
    links: tuple[Link, ...] = ()


class Section(Struct, frozen=True):
    """The faults against one section of the handout."""

    name: str
    cards: tuple[Card, ...]


class Chapter(Struct, frozen=True):
    """The sections of one part of the handout."""

    title: str
    sections: tuple[Section, ...]


class Topic(Struct, frozen=True):
    """One row of the topic table, and the stages that have it."""

    cells: tuple[str, ...]
    stages: Stages


class Checks(Struct, frozen=True):
    """The lines of the handout's checklist for one section."""

    name: str
    items: tuple[ChecklistItem, ...]


class View(Struct, frozen=True):
    """Everything that the page shows of one block."""

    block: Block
    chapters: tuple[Chapter, ...]
    graphs: tuple[Drawn, ...]
    trees: tuple[Drawn, ...]
    topics: tuple[Topic, ...]
    checks: tuple[Checks, ...]
    crashes: tuple[tuple[str, Crash], ...] = ()

    @property
    def cards(self) -> tuple[Card, ...]:
        """Every card, in the order of the page."""
        return tuple(
            card
            for chapter in self.chapters
            for section in chapter.sections
            for card in section.cards
        )

    def count(self, severity: Severity) -> int:
        """Return how many different faults of one severity there are."""
        return sum(card.fault.finding.severity == severity for card in self.cards)


Excerpts = dict[tuple[str, int], Excerpt]
