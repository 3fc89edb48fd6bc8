"""Single findings as text: site, message, lines of the file, repair and section."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator

from msgspec import Struct

from lab3_usd.model.finding import Finding
from lab3_usd.report.entries import site
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import visible
from lab3_usd.report.source_excerpt import Excerpt, excerpt_lines
from lab3_usd.report.text.ansi import paint

NARROWEST = 40
LABEL = 10
INDENT = "  "


REPAIRABLE = "[*]"


class Page(Struct, frozen=True):
    """What stays the same through one report."""

    options: Options
    rules: Rules
    excerpts: dict[tuple[str, int], Excerpt]
    shows_source: bool = True

    @property
    def width(self) -> int:
        """The columns to fill."""
        return max(self.options.width, NARROWEST)

    @property
    def color(self) -> bool:
        """Whether to colour."""
        return self.options.color

    @property
    def verbose(self) -> bool:
        """Whether to tell everything."""
        return self.options.verbosity == "verbose"


def is_repairable(finding: Finding) -> bool:
    """Whether `lab3 fix` repairs it without being told more."""
    return finding.fix is not None and finding.fix.safe


def finding_blocks(found: Iterable[tuple[Finding, str]], page: Page) -> Iterator[str]:
    """Yield the lines of findings, each with the stages that have it, or "".

    Notes are lines without space between them unless the report is verbose.
    """
    explained: set[str] = set()  # the rules whose reason has been given
    is_in_notes = False
    for finding, where in found:
        is_line = finding.severity == "note" and not page.verbose
        if not (is_line and is_in_notes):
            yield ""
        if is_line:
            told = f" ({where})" if where else ""
            yield from _heading(finding, page, f"{site(finding)}: {finding.message}{told}")
        else:
            yield from _finding_lines(finding, where, page, explained)
        is_in_notes = is_line


def _finding_lines(finding: Finding, where: str, page: Page, explained: set[str]) -> Iterator[str]:
    yield from _heading(finding, page, site(finding))
    if where:
        yield INDENT + paint(visible(where), "dim", color=page.color)
    yield from wrapped(finding.message, INDENT, page.width)
    yield from _frame(finding, page)
    yield from _details(finding, page)
    if page.verbose and finding.rule not in explained:
        explained.add(finding.rule)
        yield from _why(finding, page)


def _heading(finding: Finding, page: Page, rest: str) -> Iterator[str]:
    mark = f" {REPAIRABLE}" if is_repairable(finding) else ""
    start = f"{finding.severity} {finding.rule}{mark} {finding.name}"
    first, *more = wrapped(f"{start} {rest}", "", page.width, hanging=INDENT)
    yield first.replace(
        finding.severity, paint(finding.severity, finding.severity, color=page.color), 1
    )
    yield from more


def _frame(finding: Finding, page: Page) -> Iterator[str]:
    if not page.shows_source or finding.layer is None or finding.line is None:
        return
    place = f"{finding.layer}:{finding.line}"
    if finding.column is not None:
        place = f"{place}:{finding.column}"
    yield INDENT + paint(visible(place), "dim", color=page.color)
    excerpt = page.excerpts.get((finding.layer, finding.line))
    if excerpt is None:
        return
    room = page.width - len(INDENT)
    for line in excerpt_lines(excerpt, finding.line, finding.column, room):
        yield INDENT + paint(line, _frame_style(line, finding), color=page.color)


def _frame_style(line: str, finding: Finding) -> str:
    if line.startswith(">"):
        return "plain"
    return finding.severity if line.endswith("^") and line.split() == ["|", "^"] else "dim"


def _details(finding: Finding, page: Page) -> Iterator[str]:
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


def _why(finding: Finding, page: Page) -> Iterator[str]:
    rule = page.rules.get(finding.rule)
    reason = rule.section("Why") if rule is not None else ""
    if reason:
        yield from _labelled("why", reason, page)


def _labelled(label: str, value: str, page: Page) -> Iterator[str]:
    hanging = INDENT + " " * LABEL
    first, *more = wrapped(value, hanging, page.width) or [hanging]
    shown = paint(f"{label:<{LABEL}}", "dim", color=page.color)
    yield (INDENT + shown + first[len(hanging) :]).rstrip()
    yield from more


def wrapped(value: str, indent: str, width: int, hanging: str | None = None) -> list[str]:
    """Return text in lines of at most `width` columns; `hanging` indents all but the first."""
    return textwrap.wrap(
        visible(value),
        width,
        initial_indent=indent,
        subsequent_indent=indent if hanging is None else hanging,
        break_long_words=False,
        break_on_hyphens=False,
    )
