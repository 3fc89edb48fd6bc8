"""The report on a terminal in parts: findings, checklists, and what to repair first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from msgspec import Struct

from lab3_usd.data import program
from lab3_usd.model.finding import ChecklistItem, Finding, Submission, Verdict
from lab3_usd.report.entries import is_repairable, site
from lab3_usd.report.grouped_stages import Block, ReportedFault, Stage, Stages, faults
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import Excerpt, excerpt_lines, folded, paint, visible

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Lab

NARROWEST = 40
LABEL = 10
INDENT = "  "
REPAIRABLE = "[*]"
FEW = 3  # of one section, that are listed even where they are not refuted
STATES = {
    "met": "met",
    "not met": "not met",
    "not shown": "not shown",
    "person": "for a person to judge",
}
MOST = 3  # errors to repair first
_NUMBERED = "   "


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
        """Whether everything is reported in full."""
        return self.options.verbosity == "verbose"


def finding_blocks(findings: Iterable[tuple[Finding, str]], page: Page) -> Iterator[str]:
    """Yield the lines of findings, each with the stages that have it, or "".

    Notes are lines without space between them unless the report is verbose.
    """
    explained: set[str] = set()  # the rules whose reason has been given
    follows_note = False
    for finding, stages in findings:
        is_line = finding.severity == "note" and not page.verbose
        if not (is_line and follows_note):
            yield ""
        follows_note = is_line
        if is_line:
            place = f" ({stages})" if stages else ""
            yield from _heading(finding, page, f"{site(finding)}: {finding.message}{place}")
            continue
        yield from _heading(finding, page, site(finding))
        handout = f"; handout {finding.handout}" if finding.handout else ""
        place = f" ({stages}{handout})" if stages else ""
        yield from wrapped(f"{finding.message}{place}", INDENT, page.width)
        yield from _frame(finding, page)
        yield from _details(finding, page)
        if finding.handout and not stages:
            yield from labelled("handout", finding.handout, page)
        rule = page.rules.get(finding.rule)
        if page.verbose and rule is not None and finding.rule not in explained:
            explained.add(finding.rule)
            reason = rule.section("Why")
            if reason:
                yield from labelled("why", reason, page)


def counted_notes(findings: Sequence[Finding], page: Page) -> Iterator[str]:
    """Yield the line that counts notes by their rules, the most frequent first; none for none."""
    counts = Counter((finding.counted, finding.name) for finding in findings)
    texts = [
        f"{count} {counted[count > 1] or name}" for (counted, name), count in counts.most_common()
    ]
    if texts:
        pronoun = "it" if len(findings) == 1 else "them"
        yield ""
        yield from wrapped(f"{', '.join(texts)}; -v lists {pronoun}", "", page.width)


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
        style = finding.severity if line.split() == ["|", "^"] else "dim"
        yield INDENT + paint(line, "plain" if line.startswith(">") else style, color=page.color)


def _details(finding: Finding, page: Page) -> Iterator[str]:
    for label, value in (("expected", finding.expected), ("actual", finding.actual)):
        if value is not None and _last_name(value) not in finding.message:
            yield from labelled(label, value, page)
    text = f"{finding.message} {finding.expected}"
    related = [prim for prim in finding.related if prim not in text]
    if related:
        yield from labelled("see also", " ".join(related), page)
    if finding.hint:
        yield from labelled("hint", " ".join(finding.hint.split()), page)


def _last_name(value: str) -> str:
    """Return the last name of the path of a prim or property, which tells it from its siblings."""
    return value.rpartition("/")[2] if value.startswith("/") else value


def labelled(label: str, value: str, page: Page) -> Iterator[str]:
    """Yield a text with its label in the column before it."""
    hanging = INDENT + " " * LABEL
    first, *more = wrapped(value, hanging, page.width) or [hanging]
    shown = paint(f"{label:<{LABEL}}", "dim", color=page.color)
    yield (INDENT + shown + first[len(hanging) :]).rstrip()
    yield from more


def wrapped(value: str, indent: str, width: int, hanging: str | None = None) -> list[str]:
    """Return text in lines of at most `width` columns; `hanging` indents all but the first."""
    return folded(visible(value), width, indent, indent if hanging is None else hanging)


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
    verbose = options.verbosity == "verbose"
    listed = [item for item in items if item.state != "met" or verbose]
    for section, members in groupby(listed, key=lambda item: item.section):
        yield f"  {visible(section)}"
        section_items = list(members)
        unrefuted = [item for item in section_items if item.state != "not met"]
        is_short = len(unrefuted) > FEW and not verbose
        for item in section_items:
            if not is_short or item.state == "not met":
                yield from _item_lines(item, width, color=options.color)
        if is_short:
            yield f"    {_counts(unrefuted)}; --verbose lists them"


def _counts(items: Collection[ChecklistItem]) -> str:
    counts = [(sum(item.state == state for item in items), state) for state in STATES]
    return ", ".join(f"{count} {STATES[state]}" for count, state in counts if count)


def _item_lines(item: ChecklistItem, width: int, *, color: bool) -> Iterator[str]:
    because = f": {item.because}" if item.because else ""
    indent = " " * 15
    first, *more = wrapped(f"{item.text}{because}", indent, width) or [indent]
    state = paint(f"{item.state:<9}", item.state, color=color)
    yield f"    {state}  {first[len(indent) :]}"
    yield from more


def fault_lines(block: Block, page: Page) -> Iterator[str]:
    """Yield what to repair first, and each fault once with the stages that have it."""
    block_faults = faults(block)
    yield from _repair_order(block_faults, block, page)
    findings = ((fault.finding, _stages_text(fault.stages, block)) for fault in block_faults)
    yield from finding_blocks(findings, page)


def _repair_order(block_faults: Sequence[ReportedFault], block: Block, page: Page) -> Iterator[str]:
    """Yield the few errors whose repair wins most checkpoints, and then most points.

    There are none if there are hardly more errors, or all are in the same stages.
    """
    errors = [fault for fault in block_faults if fault.finding.severity == "error" and fault.stages]
    if len(errors) <= MOST or len({fault.stages for fault in errors}) == 1:
        return

    def gain(fault: ReportedFault) -> tuple[int, float]:
        held = [stage.result.checkpoint for stage in block.stages if stage.index in fault.stages]
        return len(held), sum(page.options.points.get(number or "", 0.0) for number in held)

    yield ""
    yield paint("Repair these first", "heading", color=page.color)
    for number, fault in enumerate(sorted(errors, key=gain, reverse=True)[:MOST], 1):
        heading = f"{number}. {fault.finding.rule} {site(fault.finding)}"
        stages = [stage for stage in block.stages if stage.index in fault.stages]
        noun = "checkpoints" if len(fault.stages) > 1 else "checkpoint"
        message = f"in {noun} {_spans(stages, block)}: {fault.finding.message}"
        yield from wrapped(heading, INDENT, page.width, INDENT + _NUMBERED)
        yield from wrapped(message, INDENT + _NUMBERED, page.width)


def _stages_text(stages: Stages, block: Block) -> str:
    """Say which stages of a folder have a fault, and which no longer has it.

    `since 01, also in 02 to 08`; `in 03`; `since 02, also in 03 to 07, repaired in 08`. Empty for
    what is no stage's.
    """
    having = [stage for stage in block.stages if stage.index in stages]
    if not having:
        return ""
    first, *repeats = having
    first_seen = f"since {first.label}, also in {_spans(repeats, block)}" if repeats else ""
    later = block.stages[block.stages.index(having[-1]) + 1 :]
    repaired = next((stage for stage in later if stage.result.verdict != "unreadable"), None)
    last = f", repaired in {repaired.label}" if repaired is not None else ""
    return (first_seen or f"in {first.label}") + last


def _spans(stages: Sequence[Stage], block: Block) -> str:
    """Name stages in short, by their labels."""
    places = {stage.index: place for place, stage in enumerate(block.stages)}
    return _short(
        [places[stage.index] for stage in stages], [stage.label for stage in block.stages]
    )


def _short(places: Iterable[int], labels: Sequence[str]) -> str:
    """Name some of the labels: `03`, `03, 04`, `02 to 05, 08`."""
    spans: list[str] = []
    few = 2
    for _, run in groupby(enumerate(places), key=lambda pair: pair[1] - pair[0]):
        names = [labels[place] for _, place in run]
        spans += names if len(names) <= few else [f"{names[0]} to {names[-1]}"]
    return ", ".join(spans)


def to_come_text(to_come: Collection[str], checkpoints: Sequence[str]) -> str:
    """Say which checkpoints have no stage: `01: no stage; 03 to 08: not begun`."""
    places = [place for place, number in enumerate(checkpoints) if number in to_come]
    begun = max((p for p in range(len(checkpoints)) if p not in places), default=-1)
    skipped = _short([place for place in places if place < begun], checkpoints)
    ahead = _short([place for place in places if place > begun], checkpoints)
    texts = (skipped and f"{skipped}: no stage", ahead and f"{ahead}: not begun")
    return "; ".join(filter(None, texts))


def next_step(
    submission: Submission, verdict: Verdict, lab: Lab, lab_words: tuple[str, ...] = ()
) -> str:
    """Say what comes next in a folder that is worked on: a part of the handout, or handing in.

    `lab_words` are those with which the command line named the lab.
    """
    numbers = list(lab.checkpoints)
    begun = [number for number in numbers if number not in submission.to_come]
    following = numbers[numbers.index(begun[-1]) + 1 :] if begun else numbers
    first = "repair the errors; then " if verdict in {"fail", "unreadable"} else ""
    if not following:
        from lab3_usd.installation import command_line

        command = command_line(program(), *lab_words, "check", submission.path, "--submission")
        return f"{first}{command} says what else is handed in"
    checkpoint = lab.checkpoints[following[0]]
    added = ", ".join((*checkpoint.new_sensors, *checkpoint.new))
    adds = f" adds {added}" if added else " changes no graph"
    text = f"{first}Part {checkpoint.part} of the handout ({checkpoint.title}){adds}"
    ending = lab.submission.stages.endings[0]
    return f"{text}; save the stage as {checkpoint.file}{ending}"
