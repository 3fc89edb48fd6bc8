"""What the HTML page shows, as plain data: blocks of stages, their content and faults."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.data import program
from lab3_usd.errors import Lab3Error, StageError
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.frames import (
    all_edges,
    all_unresolved_frames,
    edges_on,
    unknown_publishers,
    unresolved_frames,
)
from lab3_usd.installation import command_line
from lab3_usd.model.finding import ChecklistItem, Crash, Finding, Severity, StageResult, section_key
from lab3_usd.model.stage import StageModel
from lab3_usd.report.entries import coverage_line, is_repairable, severity_counts
from lab3_usd.report.grouped_stages import Block, ReportedFault, Spot, Stage, Stages
from lab3_usd.report.options import Options
from lab3_usd.report.picture.model import Picture
from lab3_usd.report.pictures.graph_picture import linted_pictures, stage_pictures
from lab3_usd.report.safe_text import excerpt_lines, read_excerpts
from lab3_usd.report.tf_tree import TreeReport, as_lines
from lab3_usd.report.topic_table import TopicReport, cells
from lab3_usd.spec.contradictions.names import transform_topics
from lab3_usd.spec.lab import Checkpoint, Lab


class StageContent(Struct, frozen=True):
    """Pictures, TF tree as text, and topics as table cells of one stage."""

    pictures: tuple[Picture, ...] = ()
    tree: tuple[str, ...] = ()
    topics: tuple[tuple[str, ...], ...] = ()


def read_content(result: StageResult, lab: Lab) -> StageContent | None:
    """Return the content of the stage of a result, None if it cannot be read."""
    if result.verdict == "unreadable":
        return None
    from lab3_usd.stage.read.stage_reader import read_stage

    try:
        platform = lab.platform.in_release(result.release or lab.platform.release)
        model = read_stage(Path(result.path), platform)
    except (Lab3Error, OSError, ValueError):
        return None
    checkpoint = lab.checkpoints.get(result.checkpoint or "")
    try:
        topics = model.platform.ros.tree_topics if checkpoint is None else transform_topics(lab)
        if checkpoint is None or not topics:  # none is named: all count
            edges, hidden = all_edges(model), all_unresolved_frames(model)
        else:
            edges, hidden = edges_on(topics, model), unresolved_frames(topics, model)
        unknown = unknown_publishers(topics, model)
        reserved = lab.frames.reserved if result.checkpoint else {}
        tree = TreeReport(result.path, edges, unknown, reserved, hidden)
        pictures = (
            linted_pictures(model, result.findings)
            if checkpoint is None
            else _pictures(lab, checkpoint, model, result.findings)
        )
        sent = TopicReport(result.path, endpoints(model), edges, hidden)
        return StageContent(
            pictures=tuple(pictures),
            tree=tuple(as_lines(tree)),
            topics=tuple(tuple(cells(endpoint, sent)) for endpoint in sent.endpoints),
        )
    except StageError:  # it is damaged where no rule has looked
        return None


def _pictures(
    lab: Lab, checkpoint: Checkpoint, model: StageModel, findings: Sequence[Finding]
) -> tuple[Picture, ...]:
    """Return the pictures of a stage, which its copies for other checkpoints share."""
    from lab3_usd.stage.read.opening import cached

    # Nothing that a picture shows depends on what the file is called.
    compared = tuple(replace(finding, layer=None) for finding in findings)
    flags = (checkpoint.graphs, checkpoint.frames, checkpoint.localization)
    key = ("pictures", id(model), lab.at(checkpoint.id), *flags, compared)
    return cached(key, lambda: tuple(stage_pictures(lab, checkpoint, model, compared)))


class PortLink(Struct, frozen=True):
    """A link from a fault to its port: the element, and the part of the picture.

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
    severity: Severity = "error"
    svg: str | None = None
    lines: tuple[str, ...] = ()


class Card(Struct, frozen=True):
    """A fault as it is shown, with its code frame and its places in the pictures.

    Of a line of the frame, there are the gutter, the text, and whether it is that of the fault.
    `command` is what to type where the report was made, or in the graded folder, to have it
    repaired; empty where nothing repairs it.
    """

    fault: ReportedFault
    span: str
    command: str = ""
    excerpt: tuple[tuple[str, str, bool], ...] = ()
    links: tuple[PortLink, ...] = ()


# The cards by severity (None of what was not opened), part and section of the handout.
Ranks = Mapping[Severity | None, Mapping[str, Mapping[str, Sequence[Card]]]]


def _left_out(stage: Stage) -> Iterator[str]:
    """Yield what was not judged of a stage, nothing where all of it was."""
    coverage = stage.result.coverage
    if coverage is not None and not coverage.is_whole:
        yield coverage_line(coverage)


class BlockView(Struct, frozen=True):
    """Everything that the page shows of one block; `to_come` says which stages are not begun.

    `topics` are the rows of the table of topics, with the stages that have each, `checks` the lines
    of the handout's checklist by section. `following` is the next step in a folder that is worked
    on.
    """

    block: Block
    cards: tuple[Card, ...]
    ranks: Ranks
    graphs: tuple[PagePicture, ...]
    trees: tuple[PagePicture, ...]
    topics: Mapping[tuple[str, ...], Stages]
    checks: Mapping[str, Sequence[ChecklistItem]]
    to_come: str
    following: str
    crashes: tuple[tuple[str, Crash], ...]

    @property
    def unknown(self) -> tuple[tuple[str, str], ...]:
        """Why stages could not be judged, with the file of each."""
        return tuple(
            (stage.file, text)
            for stage in self.block.stages
            for text in (*stage.result.gaps, *_left_out(stage))
            if stage.result.verdict == "not judged" or text in stage.result.gaps
        )

    @property
    def partly(self) -> tuple[tuple[str, str], ...]:
        """What could not be judged of stages that were, with the file of each."""
        return tuple(
            (stage.file, text)
            for stage in self.block.stages
            if stage.result.verdict != "not judged"
            for text in _left_out(stage)
        )

    @property
    def counts(self) -> dict[Severity, int]:
        """How many different faults there are, by severity."""
        return severity_counts(card.fault.finding for card in self.cards)


EXCERPT_WIDTH = 96
MOST_EXCERPTS = 80  # in one block: a page stays small whatever a stage holds


def cards(
    block: Block,
    faults: Sequence[ReportedFault],
    links: Mapping[str, tuple[PortLink, ...]],
    *,
    options: Options,
) -> Iterator[Card]:
    """Yield a card for each fault, with the lines of its file where those can be read."""
    excerpts = read_excerpts(fault.finding for fault in faults[:MOST_EXCERPTS])
    for fault in faults:
        frame: list[tuple[str, str, bool]] = []
        finding = fault.finding
        excerpt = excerpts.get((finding.layer or "", finding.line or 0))
        if excerpt is not None and finding.line:
            for row in excerpt_lines(excerpt, finding.line, finding.column, EXCERPT_WIDTH):
                gutter, bar, text = row.partition(" |")
                frame.append((gutter + bar, text, row.startswith(">")))
        command = "" if finding.fix is None else _fix_command(block, fault, options)
        span, ways = block.span(fault.stages), links.get(fault.id, ())
        yield Card(fault, span, command, tuple(frame), ways)


def _fix_command(block: Block, fault: ReportedFault, options: Options) -> str:
    """Return what repairs a fault, for the shell of this system; graded files are named as such."""
    graded = options.grade is not None
    stages = [stage for stage in block.stages if stage.index in fault.stages]
    paths = [stage.file if graded else stage.result.path for stage in stages]
    if len(paths) > 1 and block.submission is not None:
        paths = ["." if graded else block.path]
    lint = ["--lint"] if block.is_linted else []
    only = ["--select", fault.finding.rule]  # of an option that is given twice the last one counts
    unsafe = [] if is_repairable(fault.finding) else ["--unsafe"]
    words = ["fix", *lint, *paths, *options.given, *only, *unsafe, "--in-place"]
    return command_line(program(), *options.lab, *words)


def editor_link(spot: Spot) -> str:
    """Return the address at which VS Code opens a file at its line; '' where there is none."""
    path = Path(spot.file)
    if spot.line is None or not path.is_file():
        return ""
    rooted = f"/{path.absolute().as_posix()}".replace("//", "/", 1)
    numbers = ":".join(str(number) for number in (spot.line, spot.column) if number is not None)
    return f"vscode://file{quote(rooted, safe='/:')}:{numbers}"


def ranked_cards(page_cards: Iterable[Card], lab: Lab) -> Ranks:
    """Group cards, which are in order already, by severity, part and section of the handout."""
    titles: dict[str, list[str]] = {}
    for checkpoint in lab.checkpoints.values():
        titles.setdefault(checkpoint.part, []).append(checkpoint.title)
    ranks: dict[Severity | None, dict[str, dict[str, list[Card]]]] = {}
    for card in page_cards:
        section = card.fault.finding.handout or ""
        severity = None if card.fault.is_cause else card.fault.finding.severity
        chapter = "Not opened" if card.fault.is_cause else _chapter_title(section, titles)
        sections = ranks.setdefault(severity, {}).setdefault(chapter, {})
        sections.setdefault(section, []).append(card)
    return ranks


def _chapter_title(section: str, titles: Mapping[str, list[str]]) -> str:
    """Name the part of the handout that a section is in, by the checkpoint of that part."""
    part = max((title for title in titles if _is_in_part(section, title)), key=len, default="")
    _, letter, number, _, _ = section_key(section)
    if part:
        name = f"Part {part}" if len(part) == 1 else part
        return f"{name}: {titles[part][0]}" if len(titles[part]) == 1 else name
    if letter:
        return f"Part {letter}"
    return f"Section {number}" if number else section or "Beside the handout"


def _is_in_part(section: str, part: str) -> bool:
    """Whether a section is of a part: A5 of A, 4.5 of 4, Ex 3.2 of Ex 3, but Ex 31 is not."""
    if not part or not section.startswith(part):
        return False
    last, following = part[-1], section[len(part) : len(part) + 1]
    return not (last.isdigit() and following.isdigit()) and not (
        last.isalpha() and following.isalpha()
    )
