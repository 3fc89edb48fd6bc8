"""The report as one self-contained HTML page, readable without network and scripts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from lab3_usd.check.registry import Rule
from lab3_usd.model.finding import SEVERITIES, ChecklistItem, Crash, Report
from lab3_usd.report.blocks import Block, blocks, faults
from lab3_usd.report.entries import plural
from lab3_usd.report.html.model import BlockView, ChecklistSection, cards, ranks, read_content
from lab3_usd.report.html.pictures import gallery, topics
from lab3_usd.report.html.templates import fill
from lab3_usd.report.options import NAME, Options, Rules, tool_version
from lab3_usd.report.text import STATES
from lab3_usd.report.topic_table import COLUMNS
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

HEADINGS = ("Why", "Fix", "Example")
Manual = tuple[str, tuple[tuple[str, str], ...]]


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the page; the stages are read again from their paths, for pictures and tables.

    The page forbids itself the network and every script and style but its own. A stage that is
    no longer where it was is reported without pictures. With a grade, everything belongs to the
    one submission, and faults come before notes.
    """
    summary = options.grade
    lab = load_lab()
    found = blocks(report, lab, graded=summary is not None)
    views = tuple(_view(block, lab, graded=summary is not None) for block in found)
    return fill(
        "report.html.j2",
        more_style="maps.css" if options.dry_runs else "",
        dry_runs=options.dry_runs,
        views=views,
        lab_title=lab.title,
        summary=summary,
        rules=_manuals(views, rules or {}),
        severities=SEVERITIES,
        states=STATES,
        columns=COLUMNS,
        plural=plural,
        tool=f"{NAME} {tool_version()}",
    )


def _view(block: Block, lab: Lab, *, graded: bool) -> BlockView:
    found = faults(block, graded=graded)
    read = {stage.index: read_content(stage.result, lab) for stage in block.stages}
    contents = {index: content for index, content in read.items() if content is not None}
    shown = gallery(block, contents, found)
    return BlockView(
        block=block,
        ranks=ranks(list(cards(block, found, shown.links)), lab),
        graphs=tuple(picture for picture in shown.pictures if picture.kind == "graph"),
        trees=tuple(
            page_picture for page_picture in shown.pictures if page_picture.kind == "frames"
        ),
        topics=topics(contents),
        checks=tuple(
            _checklist_sections(() if block.submission is None else block.submission.checklist)
        ),
        crashes=tuple(_crashes(block)),
    )


def _checklist_sections(items: Iterable[ChecklistItem]) -> Iterator[ChecklistSection]:
    sections: dict[str, list[ChecklistItem]] = {}
    for item in items:
        sections.setdefault(item.section, []).append(item)
    for name, inside in sections.items():
        yield ChecklistSection(name, tuple(inside))


def _crashes(block: Block) -> Iterator[tuple[str, Crash]]:
    for stage in block.stages:
        yield from ((stage.file, crash) for crash in stage.result.crashes)
    if block.submission is not None:
        yield from ((block.path, crash) for crash in block.submission.crashes)


def _manuals(views: Iterable[BlockView], rules: Mapping[str, Rule]) -> dict[str, Manual]:
    """Return the rules that found something: the name and the manual's paragraphs by heading."""
    names = {card.fault.finding.rule for view in views for card in view.cards}
    found = [rules[name] for name in sorted(names) if name in rules]
    return {rule.id: (rule.name, tuple(_paragraphs(rule.manual))) for rule in found}


def _paragraphs(manual: str) -> Iterator[tuple[str, str]]:
    for part in manual.split("\n\n"):
        text = " ".join(part.split())
        heading = next((word for word in HEADINGS if text.startswith(f"{word}: ")), "")
        yield heading, text.removeprefix(f"{heading}: ")
