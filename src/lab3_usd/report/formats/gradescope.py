"""The results.json of a Gradescope autograder: a test for each item of the rubric."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Finding, Report, StageResult
from lab3_usd.model.grade import GradeItem
from lab3_usd.report.entries import by_group, crashes, gaps, site, summarize, summary_line
from lab3_usd.report.formats.markdown import code, escaped
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import json_text

VISIBILITIES = ("hidden", "after_due_date", "after_published", "visible")
Json = dict[str, Any]


def render(report: Report, _rules: Rules | None, options: Options) -> str:
    """Return the results of one submission: the points of its grade, if any, and what was found.

    Raises:
        UsageError: Gradescope knows no such visibility.
    """
    if options.visibility not in VISIBILITIES:
        names = ", ".join(VISIBILITIES)
        raise UsageError(f"there is no visibility '{options.visibility}'; Gradescope knows {names}")
    outputs = dict(named for result in report.results for named in _found(result))
    grade = options.grade
    tests = [] if grade is None else [_test(item, outputs) for item in grade.items]
    for submission in report.submissions:
        items = [
            f"- {escaped(item.section)} {escaped(item.text)}: **{escaped(item.state)}**"
            + (f" \\({escaped(item.because)}\\)" if item.because else "")
            for item in submission.checklist
        ]
        outputs[f"Submission {submission.path}"] = _output(submission.findings, "\n".join(items))
    tests += ({"name": name, "output": output} for name, output in outputs.items() if output)
    overview = [escaped(summary_line(summarize(report)))]
    overview += ["No points: no stage is of a checkpoint"] if grade is None else []
    overview += [f"Not judged: {escaped(gap)} \\({code(path)}\\)" for path, gap in gaps(report)]
    overview += [
        f"Rule {escaped(crash.rule)} crashed on {code(path)}: {code(crash.error)}"
        for path, crash in crashes(report)
    ]
    document = {
        "score": 0.0 if grade is None else grade.earned,
        "visibility": options.visibility,
        "output": "\n\n".join(overview),
        "output_format": "md",
        "test_output_format": "md",
        "test_name_format": "text",
        "tests": tests,
    }
    return json_text(document, 2)


def _test(item: GradeItem, outputs: dict[str, str]) -> Json:
    """Return the test of an item, with the findings of its groups, each once."""
    lost: list[str] = []
    for line in item.lost:
        lost.append(f"- {escaped(line.text)}")
        lost += (f"    - {escaped(below.text)}" for below in line.below)
    blocks = ["\n".join(lost), *(outputs.pop(name, "") for name in item.groups)]
    return {
        "name": item.title,
        "score": item.earned,
        "max_score": item.points,
        "status": "passed" if item.state == "full" else "failed",
        "visibility": item.visibility,
        "output": "\n\n".join(filter(None, blocks)),
    }


def _found(result: StageResult) -> Iterator[tuple[str, str]]:
    """Yield what was found of each group of requirements, and of everything else."""
    title = f"Checkpoint {result.checkpoint}" if result.checkpoint else result.path
    groups = by_group(result.requirements)
    left = list(result.findings)
    for group, requirements in groups.items():
        inside = [finding for finding in left if group in finding.prim.split("/")]
        left = [finding for finding in left if finding not in inside]
        missed = [requirement for requirement in requirements if not requirement.met]
        listed = "\n".join(f"- {escaped(requirement.title)}" for requirement in missed)
        rest = [f"Not met:\n\n{listed}"] if missed else []
        left_open = sum(not requirement.judged for requirement in requirements)
        if left_open:
            rest.append(f"{left_open} of {len(requirements)} not judged")
        yield f"{title}: {group}", _output(inside, "\n\n".join(rest))
    if left:
        yield f"{title}: everything else" if groups else title, _output(left)


def _output(findings: Collection[Finding], rest: str = "") -> str:
    """Return findings as a list, and the `rest` below."""
    items = []
    for finding in findings:
        handout = f" \\(handout {escaped(finding.handout)}\\)" if finding.handout else ""
        hint = f" {escaped(finding.hint)}" if finding.hint else ""
        head = f"- **{escaped(finding.severity)} {escaped(finding.rule)}** {code(site(finding))}"
        items.append(f"{head}: {escaped(finding.message)}{handout}{hint}")
    return "\n\n".join(filter(None, ("\n".join(items), rest)))
