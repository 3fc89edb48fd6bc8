"""The report for people: grouped by file, each fault with its line, its repair and its section."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.finding import (
    SEVERITIES,
    Crash,
    Finding,
    Report,
    StageResult,
    Submission,
)
from lab3_usd.report.entries import entries, site, summarize
from lab3_usd.report.escape import visible
from lab3_usd.report.excerpt import Excerpt, read_excerpts
from lab3_usd.report.formats import Options, Rules
from lab3_usd.report.frame import code_frame
from lab3_usd.report.paint import paint
from lab3_usd.report.statistics import plural, statistics_table, summary_line
from lab3_usd.report.text_checklist import checklist_lines

NARROWEST = 40
LABEL = 10
INDENT = "  "


class _Page(Struct, frozen=True):
    """What stays the same through one report."""

    options: Options
    rules: Rules
    excerpts: dict[tuple[str, int], Excerpt]

    @property
    def width(self) -> int:
        return max(self.options.width, NARROWEST)

    @property
    def color(self) -> bool:
        return self.options.color

    @property
    def verbose(self) -> bool:
        return self.options.verbosity == "verbose"


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the report as text, with ANSI colours when `options.color` asks for them.

    quiet: the lines that sum up. normal: warnings and errors in full, notes in a line. verbose:
    all in full, with what each rule's fault does on the robot, and the whole checklist.
    """
    quiet = options.verbosity == "quiet"
    found = [] if quiet else [entry.finding for entry in entries(report)]
    page = _Page(options, rules or {}, read_excerpts(found))
    sections = [_stage_section(result, page) for result in report.results]
    sections += [_submission_section(submission, page) for submission in report.submissions]
    if options.statistics:
        sections.append(statistics_table(report))
    lines = [*_spaced(sections), summary_line(summarize(report))]
    return "\n".join(lines) + "\n"


def _spaced(sections: list[list[str]]) -> list[str]:
    # Files without findings stand close together, so that the others stand out.
    lines: list[str] = []
    for section in sections:
        if len(section) > 1 and lines and lines[-1]:
            lines.append("")
        lines += section
        if len(section) > 1:
            lines.append("")
    return lines


def _stage_section(result: StageResult, page: _Page) -> list[str]:
    lines = [_stage_heading(result, page), *_crash_lines(result.crashes, page)]
    if page.options.verbosity != "quiet":
        lines += _finding_blocks(result.findings, page)
    return lines


def _submission_section(submission: Submission, page: _Page) -> list[str]:
    heading = paint(visible(submission.path), "heading", color=page.color)
    lines = [f"{heading}: submission{_counts(submission.findings)}"]
    lines += _crash_lines(submission.crashes, page)
    if page.options.verbosity != "quiet":
        lines += _finding_blocks(submission.findings, page)
        lines += checklist_lines(submission.checklist, page.options, page.width)
    return lines


def _stage_heading(result: StageResult, page: _Page) -> str:
    path = paint(visible(result.path), "heading", color=page.color)
    verdict = paint(result.verdict, result.verdict, color=page.color)
    heading = f"{path}: checkpoint {visible(result.checkpoint)}, {verdict}"
    if result.score.possible:
        heading = f"{heading}, {result.score.earned:g} of {result.score.possible:g} met"
    return heading + _counts(result.findings)


def _counts(findings: tuple[Finding, ...]) -> str:
    severities = [finding.severity for finding in findings]
    return "".join(
        f", {plural(severities.count(severity), severity)}"
        for severity in SEVERITIES
        if severity in severities
    )


def _crash_lines(crashes: tuple[Crash, ...], page: _Page) -> Iterator[str]:
    for crash in crashes:
        label = paint("crash", "error", color=page.color)
        yield f"{label} {visible(f'{crash.rule}: {crash.error}')}"


def _finding_blocks(findings: tuple[Finding, ...], page: _Page) -> Iterator[str]:
    explained: set[str] = set()
    for finding in findings:
        if finding.severity == "note" and not page.verbose:
            yield ""
            yield from _heading(finding, page, f"{site(finding)}: {finding.message}")
            continue
        yield ""
        yield from _heading(finding, page, site(finding))
        yield from _wrapped(finding.message, INDENT, page.width)
        yield from _frame(finding, page)
        yield from _details(finding, page)
        if page.verbose and finding.rule not in explained:
            explained.add(finding.rule)
            yield from _why(finding, page)


def _heading(finding: Finding, page: _Page, rest: str) -> Iterator[str]:
    start = f"{finding.severity} {finding.rule} {finding.name}"
    first, *more = _wrapped(f"{start} {rest}", "", page.width, hanging=INDENT)
    yield first.replace(
        finding.severity, paint(finding.severity, finding.severity, color=page.color), 1
    )
    yield from more


def _frame(finding: Finding, page: _Page) -> Iterator[str]:
    if finding.layer is None or finding.line is None:
        return
    place = f"{finding.layer}:{finding.line}"
    if finding.column is not None:
        place = f"{place}:{finding.column}"
    yield INDENT + paint(visible(place), "dim", color=page.color)
    excerpt = page.excerpts.get((finding.layer, finding.line))
    if excerpt is None:
        return
    room = page.width - len(INDENT)
    for line in code_frame(excerpt, finding.line, finding.column, room):
        yield INDENT + paint(line, _frame_style(line, finding), color=page.color)


def _frame_style(line: str, finding: Finding) -> str:
    if line.startswith(">"):
        return "plain"
    return finding.severity if line.endswith("^") and line.split() == ["|", "^"] else "dim"


def _details(finding: Finding, page: _Page) -> Iterator[str]:
    for label, value in (("expected", finding.expected), ("actual", finding.actual)):
        if value is not None and value not in finding.message:
            yield from _labelled(label, value, page)
    told = f"{finding.message} {finding.expected}"
    others = [prim for prim in finding.related if prim not in told]
    if others:
        yield from _labelled("see also", " ".join(others), page)
    if finding.hint:
        yield from _labelled("hint", " ".join(finding.hint.split()), page)
    if finding.handout:
        yield from _labelled("handout", finding.handout, page)


def _why(finding: Finding, page: _Page) -> Iterator[str]:
    rule = page.rules.get(finding.rule)
    reason = rule.section("Why") if rule is not None else ""
    if reason:
        yield from _labelled("why", reason, page)


def _labelled(label: str, value: str, page: _Page) -> Iterator[str]:
    hanging = INDENT + " " * LABEL
    first, *more = _wrapped(value, hanging, page.width) or [hanging]
    shown = paint(f"{label:<{LABEL}}", "dim", color=page.color)
    yield (INDENT + shown + first[len(hanging) :]).rstrip()
    yield from more


def _wrapped(value: str, indent: str, width: int, hanging: str | None = None) -> list[str]:
    return textwrap.wrap(
        visible(value),
        width,
        initial_indent=indent,
        subsequent_indent=indent if hanging is None else hanging,
        break_long_words=False,
        break_on_hyphens=False,
    )
