"""JUnit XML as Jenkins and Surefire define it: a suite per file, a case per requirement."""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.etree import ElementTree as ET

from lab3_usd.model.finding import Finding, Report, Requirement, StageResult, Submission
from lab3_usd.report.entries import hidden_text, severity_counts, site
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import visible

DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>\n'
COUNTED = {"tests": "testcase", "failures": "testcase/failure", "errors": "testcase/error"}


def render(report: Report, _rules: Rules | None, _options: Options) -> str:
    """Return the suites.

    A case is a requirement, or a rule that found something: an error fails it, a warning or note
    is its output. A rule that failed itself is an error, what could not be judged is skipped.
    """
    suites = ET.Element("testsuites", name="lab3")
    for result in report.results:
        suites.append(_suite(result, result.requirements))
    for submission in report.submissions:
        suites.append(_suite(submission))
    _count(suites, ".//")
    ET.indent(suites)
    return DECLARATION + ET.tostring(suites, encoding="unicode") + "\n"


def _suite(
    result: StageResult | Submission, requirements: Iterable[Requirement] = ()
) -> ET.Element:
    suite = ET.Element("testsuite", name=visible(result.path), time="0")
    # Jenkins reads `package.Class`, split at the dots.
    stem = re.sub(r"\.[^./\\]+$", "", result.path)
    parts = (visible(part).replace(".", "_") for part in re.split(r"[/\\]+", stem) if part)
    classname = ".".join(parts)
    for requirement in requirements:
        case = _case(suite, f"{classname}.{requirement.group}", requirement.id)
        if not requirement.met:
            _outcome(case, "failure", requirement.kind, f"not met: {requirement.title}", [])
        elif not requirement.judged:
            ET.SubElement(case, "skipped", {"message": "only a missing asset could tell"})
    _add_findings(suite, f"{classname}.rules", result.findings)
    gaps = result.gaps if isinstance(result, StageResult) else ()
    if gaps:
        case = _case(suite, f"{classname}.rules", "not judged")
        ET.SubElement(case, "skipped", {"message": visible("; ".join(gaps))})
    if result.hidden:
        case = _case(suite, f"{classname}.rules", "baseline")
        ET.SubElement(case, "system-out").text = hidden_text(severity_counts(result.hidden))
    for crash in result.crashes:
        case = _case(suite, f"{classname}.rules", f"{crash.rule} crashed")
        _outcome(case, "error", crash.rule, crash.error, [])
    if len(suite) == 0:
        # Jenkins takes a suite without cases for a run that broke off.
        _case(suite, f"{classname}.rules", "no findings")
    _count(suite, "./")
    skipped = len(suite.findall("testcase/skipped"))
    if skipped:
        suite.set("skipped", str(skipped))
    return suite


def _count(element: ET.Element, below: str) -> None:
    for name, path in COUNTED.items():
        element.set(name, str(len(element.findall(below + path))))


def _case(suite: ET.Element, classname: str, name: str) -> ET.Element:
    names = {"classname": visible(classname), "name": visible(name), "time": "0"}
    return ET.SubElement(suite, "testcase", names)


def _add_findings(suite: ET.Element, classname: str, findings: Iterable[Finding]) -> None:
    by_rule: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        by_rule.setdefault((finding.rule, finding.name), []).append(finding)
    for (rule_id, name), members in by_rule.items():
        case = _case(suite, classname, f"{rule_id} {name}")
        errors = [finding for finding in members if finding.severity == "error"]
        milder = [finding for finding in members if finding.severity != "error"]
        if errors:
            # One element for all: Jenkins keeps a single failure of a case.
            lines = [line for finding in errors for line in _lines(finding)]
            _outcome(case, "failure", rule_id, errors[0].message, lines)
        if milder:
            lines = [line for finding in milder for line in _lines(finding)]
            ET.SubElement(case, "system-out").text = _text(lines)


def _outcome(case: ET.Element, tag: str, kind: str, message: str, lines: list[str]) -> None:
    outcome = ET.SubElement(case, tag, {"type": visible(kind), "message": visible(message)})
    outcome.text = _text(lines or [message])


def _lines(finding: Finding) -> list[str]:
    place = f" ({finding.layer}:{finding.line})" if finding.layer and finding.line else ""
    lines = [f"{finding.severity}: {site(finding)}: {finding.message}{place}"]
    if finding.hint:
        lines.append(f"  {finding.hint}")
    return lines


def _text(lines: list[str]) -> str:
    return "\n".join(visible(line) for line in lines)
