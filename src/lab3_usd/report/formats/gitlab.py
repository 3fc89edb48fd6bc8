"""The Code Quality report of GitLab: an array of issues in its merge request widget."""

from __future__ import annotations

from lab3_usd.model.finding import Report, Severity
from lab3_usd.report.entries import fingerprint, fingerprinted, relative_path, remarks, site
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import json_text, visible

# Of GitLab's five; `blocker` is left to a rule that failed itself.
SEVERITY_NAMES: dict[Severity, str] = {"error": "major", "warning": "minor", "note": "info"}


def render(report: Report, _rules: Rules | None, options: Options) -> str:
    """Return the array of issues; GitLab shows one of several that share a fingerprint."""
    issues: list[dict[str, object]] = []
    for entry, fingerprint_text in fingerprinted(report):
        finding = entry.finding
        file = relative_path(entry.file, options.root)
        issues.append(
            {
                "description": visible(f"{site(finding)}: {finding.message}"),
                "check_name": finding.rule,
                "fingerprint": fingerprint(entry.path, fingerprint_text),
                "severity": SEVERITY_NAMES[finding.severity],
                "location": {"path": file, "lines": {"begin": finding.line or 1}},
            }
        )
    for remark in remarks(report):
        file = relative_path(remark.path, options.root)
        # What is not stable in the text of a crash must not make another issue of it.
        parts = (remark.rule, "crash") if remark.rule else (remark.title, remark.text)
        issues.append(
            {
                "description": visible(remark.sentence),
                "check_name": remark.rule or remark.title,
                "fingerprint": fingerprint(file, *parts),
                "severity": "blocker" if remark.rule else SEVERITY_NAMES[remark.severity],
                "location": {"path": file, "lines": {"begin": 1}},
            }
        )
    return json_text(issues, 2)
