"""The report as one self-contained HTML page, readable without network and scripts."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.model.finding import SEVERITIES, ChecklistItem, Report
from lab3_usd.report.entries import CHECKLIST_STATES, plural, summarize, summary_line
from lab3_usd.report.grouped_stages import Block, blocks, faults, next_step, to_come_text
from lab3_usd.report.html.model import (
    BlockView,
    cards,
    editor_link,
    ranked_cards,
    read_content,
)
from lab3_usd.report.html.pictures import gallery, topic_rows
from lab3_usd.report.html.templates import fill_page
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.topic_table import COLUMNS
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

HEADINGS = ("Why", "Fix", "Example", "Basis")


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the page; the stages are read again from their paths, for pictures and tables.

    The page forbids itself the network and every script and style but its own. A stage that is
    no longer where it was is reported without pictures. With a grade, everything belongs to the
    one submission, and faults come before notes.
    """
    summary = options.grade
    lab = load_lab()
    graded = summary is not None
    views = tuple(_view(block, lab, options) for block in blocks(report, lab, graded=graded))
    names = {card.fault.finding.rule for view in views for card in view.cards}
    quoted = [rules[name] for name in sorted(names) if name in rules] if rules else []
    maps = ("maps.css",) if report.dry_runs else ()
    return fill_page(
        "report.html.j2",
        ("report.css", *maps, "picture.css", "picture.js", "report.js"),
        dry_runs=report.dry_runs,
        views=views,
        lab_title=lab.title,
        totals=summary_line(summarize(report)),
        summary=summary,
        rules={rule.id: (rule.name, tuple(_paragraphs(rule.manual))) for rule in quoted},
        severities=SEVERITIES,
        states=CHECKLIST_STATES,
        columns=COLUMNS,
        plural=plural,
        editor=options.editor,
        editor_link=editor_link,
    )


def _view(block: Block, lab: Lab, options: Options) -> BlockView:
    block_faults = faults(block, graded=options.grade is not None)
    models = {stage.index: read_content(stage.result, lab) for stage in block.stages}
    contents = {index: content for index, content in models.items() if content is not None}
    pictures, links = gallery(block, contents, block_faults)
    crashes = [(stage.file, crash) for stage in block.stages for crash in stage.result.crashes]
    checks: dict[str, list[ChecklistItem]] = {}
    to_come = following = ""
    if block.submission is not None:
        to_come = to_come_text(block.submission.to_come, tuple(lab.checkpoints))
        if not block.submission.handed_in:
            following = next_step(block.submission, block.verdict, lab, options.lab)
        crashes += [(block.path, crash) for crash in block.submission.crashes]
        # What is still worked on has handed in nothing yet.
        for item in block.submission.checklist if block.submission.handed_in else ():
            checks.setdefault(item.section, []).append(item)
    page_cards = tuple(cards(block, block_faults, links, options=options))
    return BlockView(
        block=block,
        cards=page_cards,
        ranks=ranked_cards(page_cards, lab),
        graphs=tuple(picture for picture in pictures if picture.kind != "frames"),
        trees=tuple(picture for picture in pictures if picture.kind == "frames"),
        topics=topic_rows(contents),
        checks=checks,
        to_come=to_come,
        following=following,
        crashes=tuple(crashes),
    )


def _paragraphs(manual: str) -> Iterator[tuple[str, str]]:
    """Yield the paragraphs of a rule's manual, each with its heading, '' for none."""
    for part in manual.split("\n\n"):
        text = " ".join(part.split())
        heading = next((word for word in HEADINGS if text.startswith(f"{word}: ")), "")
        yield heading, text.removeprefix(f"{heading}: ")
