"""The parts of the report for people on a terminal.

Findings, checklists, and what to repair first.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import groupby

from msgspec import Struct

from lab3_usd.model.finding import ChecklistItem, Finding
from lab3_usd.report.blocks import Block, Fault, Stage, Stages, faults
from lab3_usd.report.entries import site
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import Excerpt, excerpt_lines, paint, visible

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
            place = f" ({where})" if where else ""
            yield from _heading(finding, page, f"{site(finding)}: {finding.message}{place}")
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
    text = f"{finding.message} {finding.expected}"
    others = [prim for prim in finding.related if prim not in text]
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


FEW = 3  # of one section, that are listed even where they are not refuted
STATES = {
    "met": "met",
    "not met": "not met",
    "not shown": "not shown",
    "person": "for a person to judge",
}


def checklist_lines(
    items: tuple[ChecklistItem, ...], options: Options, width: int
) -> Iterator[str]:
    """Yield a line that counts the items, and each by its section.

    Those met only when verbose, and many of one section that are not refuted as a count.
    """
    if not items:
        return
    yield ""
    yield f"checklist: {_counts(items)}"
    shown = [item for item in items if item.state != "met" or options.verbosity == "verbose"]
    for section, members in groupby(shown, key=lambda item: item.section):
        yield f"  {visible(section)}"
        yield from _section_lines(list(members), options, width)


def _section_lines(items: list[ChecklistItem], options: Options, width: int) -> Iterator[str]:
    others = [item for item in items if item.state != "not met"]
    is_short = len(others) > FEW and options.verbosity != "verbose"
    for item in items:
        if not is_short or item.state == "not met":
            yield from _item_lines(item, width, color=options.color)
    if is_short:
        yield f"    {_counts(others)}; --verbose lists them"


def _counts(items: Collection[ChecklistItem]) -> str:
    counts = [(sum(item.state == state for item in items), state) for state in STATES]
    return ", ".join(f"{count} {STATES[state]}" for count, state in counts if count)


def _item_lines(item: ChecklistItem, width: int, *, color: bool) -> Iterator[str]:
    because = f": {item.because}" if item.because else ""
    indent = " " * 15
    first, *more = textwrap.wrap(
        visible(f"{item.text}{because}"),
        width,
        initial_indent=indent,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [indent]
    state = paint(f"{item.state:<9}", item.state, color=color)
    yield f"    {state}  {first[len(indent) :]}"
    yield from more


MOST = 3
_NUMBERED = "   "


def fault_lines(block: Block, page: Page) -> Iterator[str]:
    """Yield what to repair first, and each fault once with the stages that have it."""
    found = faults(block)
    yield from _repair_order(found, block, page)
    blamed = ((fault.finding, _where_found(fault.stages, block)) for fault in found)
    yield from finding_blocks(blamed, page)


def _repair_order(found: Sequence[Fault], block: Block, page: Page) -> Iterator[str]:
    """Yield the few errors whose repair wins most checkpoints, and then most points.

    Where there are hardly more errors than that, nothing is said.
    """
    errors = [fault for fault in found if fault.finding.severity == "error" and fault.stages]
    if len(errors) <= MOST:
        return
    points = page.options.points
    first = sorted(errors, key=lambda fault: _gain(fault, block, points), reverse=True)[:MOST]
    yield ""
    yield paint("Repair these first", "heading", color=page.color)
    for number, fault in enumerate(first, 1):
        heading = f"{fault.finding.rule} {site(fault.finding)}"
        stands = f"in {_plural_checkpoints(fault.stages, block)}: {fault.finding.message}"
        start = f"{number}. "
        yield from wrapped(start + heading, INDENT, page.width, INDENT + _NUMBERED)
        yield from wrapped(stands, INDENT + _NUMBERED, page.width)


def _gain(fault: Fault, block: Block, points: Mapping[str, float]) -> tuple[int, float]:
    held = [stage.result.checkpoint for stage in block.stages if stage.index in fault.stages]
    return len(held), sum(points.get(checkpoint or "", 0.0) for checkpoint in held)


def _plural_checkpoints(stages: Stages, block: Block) -> str:
    """Name the checkpoints of some stages: `checkpoint 03`, `checkpoints 03 to 08`."""
    names = _spans([stage for stage in block.stages if stage.index in stages], block)
    return f"checkpoint{'s' if len(stages) > 1 else ''} {names}"


def _where_found(stages: Stages, block: Block) -> str:
    """Say which stages of a folder have a fault, and which no longer has it.

    `since 01, also in 02 to 08`; `in 03`; `since 02, also in 03 to 07, repaired in 08`. Empty for
    what is no stage's.
    """
    having = [stage for stage in block.stages if stage.index in stages]
    if not having:
        return ""
    first, *others = having
    first_seen = f"since {first.label}, also in {_spans(others, block)}" if others else ""
    later = block.stages[block.stages.index(having[-1]) + 1 :]
    repaired = next((stage for stage in later if stage.result.verdict != "unreadable"), None)
    last = f", repaired in {repaired.label}" if repaired is not None else ""
    return (first_seen or f"in {first.label}") + last


def _spans(stages: Sequence[Stage], block: Block) -> str:
    """Name stages in short: `03`, `03, 04`, `02 to 05, 08`."""
    order = {stage.index: place for place, stage in enumerate(block.stages)}
    runs = groupby(enumerate(stages), key=lambda pair: order[pair[1].index] - pair[0])
    return ", ".join(_span([stage for _, stage in run]) for _, run in runs)


def _span(run: Sequence[Stage]) -> str:
    few = 2
    if len(run) <= few:
        return ", ".join(stage.label for stage in run)
    return f"{run[0].label} to {run[-1].label}"
