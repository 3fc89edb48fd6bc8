"""The report as one HTML page that needs nothing else: no network, and no script for reading."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from lab3_usd.check.finding import SEVERITIES, ChecklistItem, Crash, Report
from lab3_usd.check.registry import Rule
from lab3_usd.report.formats import Options, Rules
from lab3_usd.report.html_blocks import blocks
from lab3_usd.report.html_faults import by_severity, cards, chapters, faults
from lab3_usd.report.html_model import Block, Checks, View
from lab3_usd.report.html_pictures import gallery, topics
from lab3_usd.report.html_stages import look
from lab3_usd.report.html_templates import fill
from lab3_usd.report.statistics import plural
from lab3_usd.report.text_checklist import STATES
from lab3_usd.report.tool import NAME, tool_version
from lab3_usd.report.topic_table import COLUMNS
from lab3_usd.spec.loader import load_lab
from lab3_usd.spec.spec import Lab

HEADINGS = ("Why", "Fix", "Example")
Manual = tuple[str, tuple[tuple[str, str], ...]]


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the page; the stages are read again from their paths, for pictures and tables.

    The page forbids itself the network and every script and style but its own. A stage that is
    no longer where it was is reported without pictures. With a grade, everything belongs to the
    one submission, and faults come before notes.
    """
    sheet = options.sheet
    lab = load_lab()
    found = blocks(report, lab, graded=sheet is not None)
    views = tuple(_view(block, lab, graded=sheet is not None) for block in found)
    return fill(
        "report.html.j2",
        views=views,
        sheet=sheet,
        rules=_manuals(views, rules or {}),
        severities=SEVERITIES,
        states=STATES,
        columns=COLUMNS,
        plural=plural,
        tool=f"{NAME} {tool_version()}",
    )


def _view(block: Block, lab: Lab, *, graded: bool) -> View:
    found = faults(block, graded=graded)
    looked = {stage.index: look(stage.result, lab) for stage in block.stages}
    seen = {index: each for index, each in looked.items() if each is not None}
    shown = gallery(block, seen, found)
    parts = chapters(list(cards(block, found, shown.links)), lab)
    return View(
        block=block,
        chapters=by_severity(parts) if graded else parts,
        graphs=tuple(each for each in shown.pictures if each.kind == "graph"),
        trees=tuple(each for each in shown.pictures if each.kind == "frames"),
        topics=topics(seen),
        checks=tuple(_checks(() if block.submission is None else block.submission.checklist)),
        crashes=tuple(_crashes(block)),
    )


def _checks(items: Iterable[ChecklistItem]) -> Iterator[Checks]:
    sections: dict[str, list[ChecklistItem]] = {}
    for item in items:
        sections.setdefault(item.section, []).append(item)
    for name, inside in sections.items():
        yield Checks(name, tuple(inside))


def _crashes(block: Block) -> Iterator[tuple[str, Crash]]:
    for stage in block.stages:
        yield from ((stage.file, crash) for crash in stage.result.crashes)
    if block.submission is not None:
        yield from ((block.path, crash) for crash in block.submission.crashes)


def _manuals(views: Iterable[View], rules: Mapping[str, Rule]) -> dict[str, Manual]:
    """Return the rules that found something: the name and the manual's paragraphs by heading."""
    names = {card.fault.finding.rule for view in views for card in view.cards}
    found = [rules[name] for name in sorted(names) if name in rules]
    return {rule.id: (rule.name, tuple(_paragraphs(rule.manual))) for rule in found}


def _paragraphs(manual: str) -> Iterator[tuple[str, str]]:
    for part in manual.split("\n\n"):
        text = " ".join(part.split())
        heading = next((each for each in HEADINGS if text.startswith(f"{each}: ")), "")
        yield heading, text.removeprefix(f"{heading}: ")
