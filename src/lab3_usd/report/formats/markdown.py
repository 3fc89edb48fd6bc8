"""GitHub-flavoured Markdown: a table for each file, for pull requests, wikis and Gradescope."""

from __future__ import annotations

import re
from collections.abc import Iterable

from lab3_usd.model.finding import Crash, Finding, Report, StageResult, Submission
from lab3_usd.report.entries import (
    hidden_text,
    how_to_repair,
    is_lint,
    score_text,
    severity_counts,
    site,
    summarize,
    summary_line,
)
from lab3_usd.report.grouped_stages import to_come_text
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import visible
from lab3_usd.spec.load.loader import load_lab

HEADING = ("Severity", "Rule", "Where", "What is wrong", "Hint", "Handout")
# Everything that CommonMark or GitHub may take for markup; a backslash before it keeps it text.
_MARKUP = re.compile(r"([\\`*_{}\[\]<>()#+.!|~&$^:@=-])")


def render(report: Report, _rules: Rules | None, _options: Options) -> str:
    """Return a heading, a table for each file and a summary."""
    is_of_lab = not is_lint(report)
    blocks = [f"# {load_lab().title} check" if is_of_lab else "# Isaac Sim lint"]
    for result in report.results:
        blocks.append(f"## {code(result.path)}")
        verdict = f"**{escaped(result.verdict)}**"
        score = escaped(score_text(result.score))
        blocks.append(
            f"Checkpoint {escaped(result.checkpoint)}: {verdict}, {score}"
            if result.checkpoint
            else verdict
        )
        blocks += [f"Not judged: {escaped(gap)}" for gap in result.gaps]
        blocks += _hidden(result)
        if result.findings:
            blocks.append(findings_table(result.findings, lint=not is_of_lab))
        blocks += _crashes(result.crashes)
    for submission in report.submissions:
        if submission.handed_in or submission.findings or submission.hidden:
            blocks.append(f"## {code(submission.path)}")
        blocks += _hidden(submission)
        if submission.to_come:
            blocks.append(escaped(to_come_text(submission.to_come, tuple(load_lab().checkpoints))))
        if submission.findings:
            blocks.append(findings_table(submission.findings))
        if submission.checklist and submission.handed_in:
            rows = (
                (
                    escaped(item.section),
                    escaped(item.text),
                    escaped(item.state),
                    escaped(item.because),
                )
                for item in submission.checklist
            )
            blocks.append(table(("Handout", "Item", "State", "Because"), rows))
        blocks += _crashes(submission.crashes)
    blocks.append(escaped(summary_line(summarize(report))))
    return "\n\n".join(blocks) + "\n"


def escaped(value: str) -> str:
    """Return a string so escaped that Markdown shows it as it is, on one line."""
    return _MARKUP.sub(r"\\\1", visible(value))


def code(value: str) -> str:
    """Return a string as a code span, also within a table."""
    shown = visible(value).replace("|", "\\|")
    ticks = "`" * (1 + max((len(run) for run in re.findall("`+", shown)), default=0))
    padded = f" {shown} " if shown.startswith("`") or shown.endswith("`") else shown
    return f"{ticks}{padded}{ticks}" if shown.strip() else ""


def table(heading: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table of cells that are Markdown already."""
    names = list(heading)
    lines = [names, ["---"] * len(names), *(list(row) for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def findings_table(findings: Iterable[Finding], *, lint: bool = False) -> str:
    """Return the table of findings, with the handout's sections where there is a handout."""
    rows = (
        (
            escaped(finding.severity),
            escaped(f"{finding.rule} {finding.name}"),
            code(site(finding)),
            escaped(finding.message),
            escaped(how_to_repair(finding, lint=lint)),
            escaped(finding.handout or ""),
        )
        for finding in findings
    )
    if lint:
        return table(HEADING[:-1], (row[:-1] for row in rows))
    return table(HEADING, rows)


def _hidden(result: StageResult | Submission) -> list[str]:
    said = hidden_text(severity_counts(result.hidden))
    return [escaped(said[:1].upper() + said[1:])] if said else []


def _crashes(crashes: Iterable[Crash]) -> list[str]:
    return [f"Rule {escaped(crash.rule)} crashed: {code(crash.error)}" for crash in crashes]
