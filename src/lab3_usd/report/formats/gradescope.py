"""The results.json of a Gradescope autograder: a test for each group of requirements."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from lab3_usd.errors import UsageError
from lab3_usd.model.finding import Finding, Report, Requirement, StageResult, Submission
from lab3_usd.report.entries import crashes, site, summarize, summary_line
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
    tests += [_submission_test(submission) for submission in report.submissions]
    document = {
        "score": sum(test["score"] for test in tests),
        "visibility": options.visibility,
        "output": _overview(report),
        "output_format": "md",
        "test_output_format": "md",
        "test_name_format": "text",
        "tests": tests,
    }
    return json.dumps(document, indent=2) + "\n"


def _overview(report: Report) -> str:
    lines = [text(summary_line(summarize(report)))]
    lines += [
        f"Rule {text(crash.rule)} crashed on {code(path)}: {code(crash.error)}"
        for path, crash in crashes(report)
    ]
    return "\n\n".join(lines)


def _stage_tests(result: StageResult) -> list[Json]:
    title = f"Checkpoint {result.checkpoint}" if result.checkpoint else result.path
    groups: dict[str, list[Requirement]] = {}
    for requirement in result.requirements:
        groups.setdefault(requirement.group, []).append(requirement)
    tests = []
    left = list(result.findings)
    for group, requirements in groups.items():
        inside = [finding for finding in left if _belongs(finding, group)]
        left = [finding for finding in left if finding not in inside]
        tests.append(_group_test(f"{title}: {group}", requirements, inside))
    if not groups:
        earned, possible = result.score.earned, result.score.possible
        tests.append(_test(title, earned, possible, left))
    elif left:
        tests.append(_test(f"{title}: everything else", 0, 0, left))
    return tests


def _belongs(finding: Finding, group: str) -> bool:
    return group in finding.prim.split("/")


def _group_test(name: str, requirements: list[Requirement], findings: list[Finding]) -> Json:
    missed = [requirement for requirement in requirements if not requirement.met]
    earned = len(requirements) - len(missed)
    test = _test(name, earned, len(requirements), findings)
    if missed:
        listed = "\n".join(f"- {text(requirement.title)}" for requirement in missed)
        blocks = [block for block in (test["output"], f"Not met:\n\n{listed}") if block]
        test["output"] = "\n\n".join(blocks)
    return test


def _submission_test(submission: Submission) -> Json:
    test = _test(f"Submission {submission.path}", 0, 0, submission.findings)
    lines = [
        f"- {text(item.section)} {text(item.text)}: **{text(item.state)}**"
        + (f" \\({text(item.because)}\\)" if item.because else "")
        for item in submission.checklist
    ]
    blocks = [block for block in (test["output"], "\n".join(lines)) if block]
    test["output"] = "\n\n".join(blocks)
    return test


def _test(name: str, earned: float, possible: float, findings: Iterable[Finding]) -> Json:
    found = list(findings)
    failed = earned < possible or any(finding.severity == "error" for finding in found)
    return {
        "name": name,
        "score": float(earned),
        "max_score": float(possible),
        "status": "failed" if failed else "passed",
        "output": "\n".join(_item(finding) for finding in found),
    }


def _item(finding: Finding) -> str:
    handout = f" \\(handout {text(finding.handout)}\\)" if finding.handout else ""
    hint = f" {text(finding.hint)}" if finding.hint else ""
    head = f"- **{text(finding.severity)} {text(finding.rule)}** {code(site(finding))}"
    return f"{head}: {text(finding.message)}{handout}{hint}"
