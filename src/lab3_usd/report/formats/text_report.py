"""The report for people: each fault with its line, its repair and its section of the handout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec.structs import replace

from lab3_usd.data import program
from lab3_usd.model.finding import Crash, Report, StageResult, Submission
from lab3_usd.report.entries import (
    coverage_line,
    entries,
    hidden_text,
    is_lint,
    is_repairable,
    plural,
    score_text,
    severity_counts,
    statistics_table,
    summarize,
    summary_line,
)
from lab3_usd.report.grouped_stages import Block, blocks
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import paint, read_excerpts, visible
from lab3_usd.report.text import (
    INDENT,
    REPAIRABLE,
    Page,
    checklist_lines,
    counted_notes,
    fault_lines,
    finding_blocks,
    labelled,
    next_step,
    to_come_text,
    wrapped,
)
from lab3_usd.spec.load.loader import load_lab


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the report as text, with ANSI colours when `options.color` asks for them.

    Stages of one folder, each of another checkpoint, are reported together: a fault once, with the
    stages that have it. quiet: the lines that sum up. normal: warnings and errors in full, notes in
    a line each, or in one that counts them where no lab asks for anything. verbose: all in full,
    with what each rule's fault does on the robot, and the whole checklist.
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


_NAMED = 3  # files in a command; else their folder


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
            lines += finding_blocks(findings, page)
            lines += _outlook(block, page)
        yield lines


def _finding_lines(result: StageResult, page: Page) -> Iterator[str]:
    """Yield the findings of a stage; the notes of one that no lab asks for are counted only."""
    is_counted = result.checkpoint is None and not page.verbose
    notes = [finding for finding in result.findings if is_counted and finding.severity == "note"]
    listed = (finding for finding in result.findings if finding not in notes)
    yield from finding_blocks(((finding, "") for finding in listed), page)
    yield from counted_notes(notes, page)


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
    lines += fault_lines(block, page)
    lines += _not_judged_line([stage.result for stage in block.stages], page)
    if block.submission is not None:
        lines += _outlook(block, page)
    return lines


def _submission_heading(submission: Submission, page: Page) -> Iterator[str]:
    heading = paint(visible(submission.path), "heading", color=page.color)
    if submission.to_come:
        yield to_come_text(submission.to_come, tuple(load_lab().checkpoints))
    if submission.handed_in or submission.findings or submission.hidden:
        what = "submission" if submission.handed_in else "folder"
        yield f"{heading}: {what}{_counts(submission)}"
    yield from _crash_lines(submission.crashes, page)


def _outlook(block: Block, page: Page) -> Iterator[str]:
    """Yield the checklist of what was handed in, and else the next step; verbose has both."""
    submission = block.submission
    if submission is None:
        return
    if submission.handed_in or page.verbose:
        yield from checklist_lines(submission.checklist, page.options, page.width)
    if not submission.handed_in:
        yield ""
        yield from labelled(
            "next", next_step(submission, block.verdict, load_lab(), page.options.lab), page
        )


def _stage_heading(result: StageResult, page: Page) -> str:
    path = paint(visible(result.path), "heading", color=page.color)
    verdict = paint(result.verdict, result.verdict, color=page.color)
    checkpoint = f"checkpoint {visible(result.checkpoint)}, " if result.checkpoint else ""
    heading = f"{path}: {checkpoint}{verdict}"
    if result.score.possible:
        heading = f"{heading}, {score_text(result.score)}"
    return heading + _counts(result)


def _counts(result: StageResult | Submission) -> str:
    """Return how many findings there are, and how many more the baseline hides."""
    counts = severity_counts(result.findings)
    listed = "".join(f", {plural(count, severity)}" for severity, count in counts.items())
    hidden = hidden_text(severity_counts(result.hidden))
    return f"{listed}; {hidden}" if hidden else listed


def _unknown_lines(result: StageResult, page: Page) -> Iterator[str]:
    """Yield what matters and could not be judged, and the nodes that were not."""
    for gap in result.gaps:
        yield from wrapped(f"not judged: {gap}", INDENT, page.width)
    coverage = "" if result.coverage is None else coverage_line(result.coverage)
    if coverage:
        yield from wrapped(coverage, INDENT, page.width)
    built = None if result.coverage is None else result.coverage.built
    for value in built.unknown if built is not None and page.verbose else ():
        yield from wrapped(f"line {value.line}: {value.why}", INDENT * 2, page.width)


def _not_judged_line(results: Sequence[StageResult], page: Page) -> Iterator[str]:
    """Yield how many things were not judged in any of the stages, nothing for none."""
    count = len({entry for result in results for entry in result.not_judged})
    if count and page.verbose:
        verb, pronoun = ("was", "it") if count == 1 else ("were", "they")
        yield ""
        yield (
            f"{plural(count, 'thing')} {verb} not judged: "
            f"{pronoun} may be in {_where_else(results)}"
        )


def _where_else(results: Sequence[StageResult]) -> str:
    """Say where what was not judged may be: of scripts, in what they load."""
    coverages = [result.coverage for result in results]
    is_script = any(each is not None and each.built is not None for each in coverages)
    return "the scenes that scripts load" if is_script else "assets that were not found"


def _crash_lines(crashes: tuple[Crash, ...], page: Page) -> Iterator[str]:
    for crash in crashes:
        label = paint("crash", "error", color=page.color)
        yield f"{label} {visible(f'{crash.rule}: {crash.error}')}"
