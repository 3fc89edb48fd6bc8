"""The report for people: each fault with its line, its repair and its section of the handout."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.data import program
from lab3_usd.model.finding import (
    ChecklistItem,
    Crash,
    Finding,
    Report,
    StageResult,
    Submission,
    Verdict,
)
from lab3_usd.report.entries import (
    CHECKLIST_STATES,
    coverage_line,
    entries,
    hidden_text,
    is_lint,
    is_repairable,
    plural,
    score_text,
    severity_counts,
    site,
    statistics_table,
    summarize,
    summary_line,
)
from lab3_usd.report.grouped_stages import (
    Block,
    ReportedFault,
    Stage,
    blocks,
    faults,
    next_step,
    to_come_text,
)
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import Excerpt, excerpt_lines, folded, paint, read_excerpts, visible
from lab3_usd.spec.load.loader import load_lab

LABEL = 10
INDENT = "  "
REPAIRABLE = "[*]"
FEW = 3  # of one section, that are listed even where they are not refuted
MOST = 3  # errors to repair first
_NUMBERED = "   "
_NAMED = 3  # files in a command; else their folder


class Page(Struct, frozen=True):
    """What stays the same through one report."""

    options: Options
    rules: Rules
    excerpts: dict[tuple[str, int], Excerpt]
    shows_source: bool = True

    @property
    def width(self) -> int:
        """The columns to fill."""
        return self.options.width

    @property
    def color(self) -> bool:
        """Whether to colour."""
        return self.options.color

    @property
    def verbose(self) -> bool:
        """Whether everything is reported in full."""
        return self.options.verbosity == "verbose"


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the report as text, with ANSI colours when `options.color` asks for them.

    Stages of a folder that belong to different checkpoints are reported together: each fault once,
    with the stages that have it. quiet: only the summary lines. normal: errors and warnings in
    full, each note in one line; without a lab, one line counts the notes. verbose: everything in
    full, with the effect of each fault on the robot, and the whole checklist.
    """
    quiet = options.verbosity == "quiet"
    findings = [entry.finding for entry in entries(report)]
    shows_source = options.source == "always" or (
        options.source == "auto" and len(report.results) == 1 and not report.submissions
    )
    excerpts = read_excerpts(findings if shows_source and not quiet else ())
    page = Page(options, rules or {}, excerpts, shows_source)
    sections = [section for block in _blocks(report) for section in _sections(block, page)]
    if options.statistics:
        sections.append(statistics_table(report))
    lines: list[str] = []
    for section in sections:
        # Files without findings stand close together, so that the others stand out.
        if len(section) > 1 and lines and lines[-1]:
            lines.append("")
        lines += section
        if len(section) > 1:
            lines.append("")
    lines.append(summary_line(summarize(report)))
    if not quiet:
        lines += _repair_lines(report, options)
    return "\n".join(lines) + "\n"


def _repair_lines(report: Report, options: Options) -> Iterator[str]:
    """Say how many findings can be repaired, and by which command."""
    fixable = [entry for entry in entries(report) if entry.finding.fix is not None]
    if not fixable:
        return
    count = sum(is_repairable(entry.finding) for entry in fixable)
    paths = list(dict.fromkeys(entry.path for entry in fixable))
    folders = {str(Path(path).parent) for path in paths}
    named = paths if len(paths) <= _NAMED else [*folders] if len(folders) == 1 else []
    lint = ["--lint"] if is_lint(report) else []
    command = [program(), *options.lab, "fix", *lint, *named, *options.given]
    more = f"; {len(fixable) - count} more with --unsafe" if 0 < count < len(fixable) else ""
    from lab3_usd.installation import command_line

    words = command_line(*command, *([] if count else ["--unsafe"]))
    mark = f"{REPAIRABLE} " if count else ""
    findings = plural(count or len(fixable), "finding")
    yield visible(f"{mark}{findings} can be repaired: {words}{more}")


def _blocks(report: Report) -> Iterator[Block]:
    """Yield the blocks of a report, stages that belong together in the order of the lab."""
    if is_lint(report):
        yield from blocks(report, None)
        return
    lab = load_lab()
    order = list(lab.checkpoints)
    for block in blocks(report, lab):
        if block.is_one_student and all(stage.label in order for stage in block.stages):
            stages = sorted(block.stages, key=lambda stage: order.index(stage.label))
            yield replace(block, stages=tuple(stages))
        else:
            yield block


def _sections(block: Block, page: Page) -> Iterator[list[str]]:
    """Yield the lines of a block: of all stages together, or of each and of the submission."""
    quiet = page.options.verbosity == "quiet"
    if not page.options.each and block.is_one_student:
        lines = _student_lines(block, page)
        yield from [[line] for line in lines] if quiet else [lines]
        return
    for result in (stage.result for stage in block.stages):
        lines = [_stage_heading(result, page), *_crash_lines(result.crashes, page)]
        if not quiet:
            lines += _unknown_lines(result, page)
            lines += _finding_lines(result, page)
        yield [*lines, *_not_judged_line([result], page)]
    if block.submission is not None:
        lines = [*_submission_heading(block.submission, page)]
        if not quiet:
            findings = ((finding, "") for finding in block.submission.findings)
            lines += _finding_blocks(findings, page)
            lines += _outlook(block.submission, block.verdict, page)
        yield lines


def _finding_lines(result: StageResult, page: Page) -> Iterator[str]:
    """Yield the findings of a stage; the notes of one that no lab asks for are counted only."""
    is_counted = result.checkpoint is None and not page.verbose
    notes = [finding for finding in result.findings if is_counted and finding.severity == "note"]
    listed = (finding for finding in result.findings if finding not in notes)
    yield from _finding_blocks(((finding, "") for finding in listed), page)
    yield from _counted_notes(notes, page)


def _student_lines(block: Block, page: Page) -> list[str]:
    """Return the lines of stages that were saved one after the other."""
    lines = []
    for stage in block.stages:
        lines.append(_stage_heading(stage.result, page))
        if page.options.verbosity != "quiet":
            lines += _unknown_lines(stage.result, page)
    for stage in block.stages:
        lines += (f"{line} (in {stage.label})" for line in _crash_lines(stage.result.crashes, page))
    if block.submission is not None:
        lines += _submission_heading(block.submission, page)
    if page.options.verbosity == "quiet":
        return lines
    lines += _fault_lines(block, page)
    lines += _not_judged_line([stage.result for stage in block.stages], page)
    if block.submission is not None:
        lines += _outlook(block.submission, block.verdict, page)
    return lines


def _submission_heading(submission: Submission, page: Page) -> Iterator[str]:
    heading = paint(visible(submission.path), "heading", color=page.color)
    if submission.to_come:
        yield to_come_text(submission.to_come, tuple(load_lab().checkpoints))
    if submission.handed_in or submission.findings or submission.hidden:
        what = "submission" if submission.handed_in else "folder"
        yield f"{heading}: {what}{_finding_counts(submission)}"
    yield from _crash_lines(submission.crashes, page)


def _outlook(submission: Submission, verdict: Verdict, page: Page) -> Iterator[str]:
    """Yield the checklist of what was handed in, and else the next step; verbose has both."""
    if submission.handed_in or page.verbose:
        yield from _checklist_lines(submission.checklist, page)
    if not submission.handed_in:
        yield ""
        following = next_step(submission, verdict, load_lab(), page.options.lab)
        yield from _labelled("next", following, page)


def _stage_heading(result: StageResult, page: Page) -> str:
    path = paint(visible(result.path), "heading", color=page.color)
    verdict = paint(result.verdict, result.verdict, color=page.color)
    checkpoint = f"checkpoint {visible(result.checkpoint)}, " if result.checkpoint else ""
    heading = f"{path}: {checkpoint}{verdict}"
    if result.score.possible:
        heading = f"{heading}, {score_text(result.score)}"
    return heading + _finding_counts(result)


def _finding_counts(result: StageResult | Submission) -> str:
    """Return how many findings there are, and how many more the baseline hides."""
    counts = severity_counts(result.findings)
    listed = "".join(f", {plural(count, severity)}" for severity, count in counts.items())
    hidden = hidden_text(severity_counts(result.hidden))
    return f"{listed}; {hidden}" if hidden else listed


def _unknown_lines(result: StageResult, page: Page) -> Iterator[str]:
    """Yield what matters and could not be judged, and the nodes that were not."""
    for gap in result.gaps:
        yield from _wrapped(f"not judged: {gap}", INDENT, page.width)
    coverage = "" if result.coverage is None else coverage_line(result.coverage)
    if coverage:
        yield from _wrapped(coverage, INDENT, page.width)
    built = None if result.coverage is None else result.coverage.built
    for value in built.unknown if built is not None and page.verbose else ():
        yield from _wrapped(f"line {value.line}: {value.why}", INDENT * 2, page.width)


def _not_judged_line(results: Sequence[StageResult], page: Page) -> Iterator[str]:
    """Yield how many things were not judged in any of the stages, nothing for none."""
    count = len({entry for result in results for entry in result.not_judged})
    if count and page.verbose:
        verb, pronoun = ("was", "it") if count == 1 else ("were", "they")
        coverages = [result.coverage for result in results]
        is_script = any(each is not None and each.built is not None for each in coverages)
        place = "the scenes that scripts load" if is_script else "assets that were not found"
        yield ""
        yield f"{plural(count, 'thing')} {verb} not judged: {pronoun} may be in {place}"


def _crash_lines(crashes: tuple[Crash, ...], page: Page) -> Iterator[str]:
    for crash in crashes:
        label = paint("crash", "error", color=page.color)
        yield f"{label} {visible(f'{crash.rule}: {crash.error}')}"


def _finding_blocks(findings: Iterable[tuple[Finding, str]], page: Page) -> Iterator[str]:
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
        yield from _wrapped(f"{finding.message}{place}", INDENT, page.width)
        yield from _frame(finding, page)
        yield from _details(finding, page)
        if finding.handout and not stages:
            yield from _labelled("handout", finding.handout, page)
        rule = page.rules.get(finding.rule)
        if page.verbose and rule is not None and finding.rule not in explained:
            explained.add(finding.rule)
            reason = rule.section("Why")
            if reason:
                yield from _labelled("why", reason, page)


def _counted_notes(findings: Sequence[Finding], page: Page) -> Iterator[str]:
    """Yield the line that counts notes by their rules, the most frequent first; none for none."""
    counts = Counter((finding.counted, finding.name) for finding in findings)
    texts = [
        f"{count} {counted[count > 1] or name}" for (counted, name), count in counts.most_common()
    ]
    if texts:
        pronoun = "it" if len(findings) == 1 else "them"
        yield ""
        yield from _wrapped(f"{', '.join(texts)}; -v lists {pronoun}", "", page.width)


def _heading(finding: Finding, page: Page, rest: str) -> Iterator[str]:
    mark = f" {REPAIRABLE}" if is_repairable(finding) else ""
    start = f"{finding.severity} {finding.rule}{mark} {finding.name}"
    first, *more = _wrapped(f"{start} {rest}", "", page.width, hanging=INDENT)
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
        if value is None:
            continue
        # The last name of a path tells a prim or property from its siblings.
        name = value.rpartition("/")[2] if value.startswith("/") else value
        if name not in finding.message:
            yield from _labelled(label, value, page)
    text = f"{finding.message} {finding.expected}"
    related = [prim for prim in finding.related if prim not in text]
    if related:
        yield from _labelled("see also", " ".join(related), page)
    if finding.hint:
        yield from _labelled("hint", " ".join(finding.hint.split()), page)


def _labelled(label: str, value: str, page: Page) -> Iterator[str]:
    """Yield a text with its label in the column before it."""
    hanging = INDENT + " " * LABEL
    first, *more = _wrapped(value, hanging, page.width) or [hanging]
    shown = paint(f"{label:<{LABEL}}", "dim", color=page.color)
    yield (INDENT + shown + first[len(hanging) :]).rstrip()
    yield from more


def _wrapped(value: str, indent: str, width: int, hanging: str | None = None) -> list[str]:
    """Return text in lines of at most `width` columns; `hanging` indents all but the first."""
    return folded(visible(value), width, indent, indent if hanging is None else hanging)


def _checklist_lines(items: tuple[ChecklistItem, ...], page: Page) -> Iterator[str]:
    """Yield a line that counts the items, and each by its section.

    Those met only when verbose, and many of one section that are not refuted as a count.
    """
    if not items:
        return
    yield ""
    yield f"checklist: {_state_counts(items)}"
    listed = [item for item in items if item.state != "met" or page.verbose]
    for section, members in groupby(listed, key=lambda item: item.section):
        yield f"  {visible(section)}"
        section_items = list(members)
        unrefuted = [item for item in section_items if item.state != "not met"]
        is_short = len(unrefuted) > FEW and not page.verbose
        for item in section_items:
            if not is_short or item.state == "not met":
                yield from _item_lines(item, page)
        if is_short:
            yield f"    {_state_counts(unrefuted)}; --verbose lists them"


def _state_counts(items: Collection[ChecklistItem]) -> str:
    counts = [(sum(item.state == state for item in items), state) for state in CHECKLIST_STATES]
    return ", ".join(f"{count} {CHECKLIST_STATES[state]}" for count, state in counts if count)


def _item_lines(item: ChecklistItem, page: Page) -> Iterator[str]:
    because = f": {item.because}" if item.because else ""
    indent = " " * 15
    first, *more = _wrapped(f"{item.text}{because}", indent, page.width) or [indent]
    state = paint(f"{item.state:<9}", item.state, color=page.color)
    yield f"    {state}  {first[len(indent) :]}"
    yield from more


def _fault_lines(block: Block, page: Page) -> Iterator[str]:
    """Yield what to repair first, and each fault once with the stages that have it."""
    block_faults = faults(block)
    yield from _repair_order(block_faults, block, page)
    findings = ((fault.finding, _stages_text(fault, block)) for fault in block_faults)
    yield from _finding_blocks(findings, page)


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
        noun = "checkpoints" if len(fault.stages) > 1 else "checkpoint"
        message = f"in {noun} {block.span(fault.stages)}: {fault.finding.message}"
        yield from _wrapped(heading, INDENT, page.width, INDENT + _NUMBERED)
        yield from _wrapped(message, INDENT + _NUMBERED, page.width)


def _stages_text(fault: ReportedFault, block: Block) -> str:
    """Say which stages of a folder have a fault, and which no longer has it.

    `since 01, also in 02 to 08`; `in 03`; `since 02, also in 03 to 07, repaired in 08`. Empty for
    what is no stage's. One that does not ask for what is at fault has repaired nothing.
    """
    having = [stage for stage in block.stages if stage.index in fault.stages]
    if not having:
        return ""
    label, repeats = having[0].label, [stage.index for stage in having[1:]]
    since = f"since {label}, also in {block.span(repeats)}" if repeats else f"in {label}"
    later = block.stages[block.stages.index(having[-1]) + 1 :]
    repaired = next((each for each in later if _asks_again(fault, having[-1], each)), None)
    last = f", repaired in {repaired.label}" if repaired is not None else ""
    return since + last


def _asks_again(fault: ReportedFault, stage: Stage, later: Stage) -> bool:
    """Whether a later stage is judged by what a fault of an earlier one fails, or by its parts."""
    if later.result.verdict == "unreadable":
        return False
    asked = later.result.requirements
    if fault.finding.unmet:
        return {*fault.finding.unmet} <= {requirement.id for requirement in asked}
    groups = {requirement.group for requirement in stage.result.requirements}
    return groups <= {requirement.group for requirement in asked}
