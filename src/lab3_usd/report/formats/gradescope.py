"""The results.json of a Gradescope autograder: a test for each group of requirements."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from typing import Any

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Finding, Report, Requirement, StageResult
from lab3_usd.report.entries import crashes, gaps, site, summarize, summary_line
from lab3_usd.report.formats.markdown import code, text
from lab3_usd.report.options import Options, Rules

VISIBILITIES = ("hidden", "after_due_date", "after_published", "visible")
Json = dict[str, Any]


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the results; a requirement is worth one point.

    Raises:
        UsageError: Gradescope knows no such visibility.
    """
    del rules
    if options.visibility not in VISIBILITIES:
        known = ", ".join(VISIBILITIES)
        raise UsageError(f"there is no visibility '{options.visibility}'; Gradescope knows {known}")
    tests = [test for result in report.results for test in _stage_tests(result)]
    for submission in report.submissions:
        items = [
            f"- {text(item.section)} {text(item.text)}: **{text(item.state)}**"
            + (f" \\({text(item.because)}\\)" if item.because else "")
            for item in submission.checklist
        ]
        name = f"Submission {submission.path}"
        tests.append(_test(name, 0, 0, submission.findings, "\n".join(items)))
    overview = [text(summary_line(summarize(report)))]
    overview += [f"Not judged: {text(gap)} \\({code(path)}\\)" for path, gap in gaps(report)]
    overview += [
        f"Rule {text(crash.rule)} crashed on {code(path)}: {code(crash.error)}"
        for path, crash in crashes(report)
    ]
    document = {
        "score": sum(test["score"] for test in tests),
        "visibility": options.visibility,
        "output": "\n\n".join(overview),
        "output_format": "md",
        "test_output_format": "md",
        "test_name_format": "text",
        "tests": tests,
    }
    return json.dumps(document, indent=2) + "\n"


def _stage_tests(result: StageResult) -> Iterator[Json]:
    title = f"Checkpoint {result.checkpoint}" if result.checkpoint else result.path
    groups: dict[str, list[Requirement]] = {}
    for requirement in result.requirements:
        groups.setdefault(requirement.group, []).append(requirement)
    left = list(result.findings)
    for group, requirements in groups.items():
        inside = [finding for finding in left if group in finding.prim.split("/")]
        left = [finding for finding in left if finding not in inside]
        missed = [requirement for requirement in requirements if not requirement.met]
        listed = "\n".join(f"- {text(requirement.title)}" for requirement in missed)
        possible = len(requirements)
        earned = possible - len(missed)
        rest = f"Not met:\n\n{listed}" if missed else ""
        left_open = sum(not requirement.judged for requirement in requirements)
        if left_open:
            rest = "\n\n".join(filter(None, (rest, f"{left_open} of {possible} not judged")))
        yield _test(f"{title}: {group}", earned, possible, inside, rest)
    if not groups:
        yield _test(title, result.score.earned, result.score.possible, left)
    elif left:
        yield _test(f"{title}: everything else", 0, 0, left)


def _test(
    name: str, earned: float, possible: float, findings: Collection[Finding], rest: str = ""
) -> Json:
    """Return a test; its output is the findings, then the `rest`."""
    failed = earned < possible or any(finding.severity == "error" for finding in findings)
    items = []
    for finding in findings:
        handout = f" \\(handout {text(finding.handout)}\\)" if finding.handout else ""
        hint = f" {text(finding.hint)}" if finding.hint else ""
        head = f"- **{text(finding.severity)} {text(finding.rule)}** {code(site(finding))}"
        items.append(f"{head}: {text(finding.message)}{handout}{hint}")
    return {
        "name": name,
        "score": float(earned),
        "max_score": float(possible),
        "status": "failed" if failed else "passed",
        "output": "\n\n".join(block for block in ("\n".join(items), rest) if block),
    }
