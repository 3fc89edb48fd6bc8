"""The Code Quality report of GitLab: an array of issues in its merge request widget."""

from __future__ import annotations

from lab3_usd.model.finding import Report, Severity
from lab3_usd.report.entries import (
    crashes,
    fingerprint,
    fingerprinted,
    gaps,
    hidden,
    relative_path,
    site,
)
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import json_text, visible

# Of GitLab's five; `blocker` is left to a rule that failed itself.
SEVERITY_NAMES: dict[Severity, str] = {"error": "major", "warning": "minor", "note": "info"}


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return the array of issues; GitLab shows one of several that share a fingerprint."""
    del rules
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
    entries = [(path, "not judged", f"not judged: {gap}", "minor") for path, gap in gaps(report)]
    entries += [(path, "baseline", text, "info") for path, text in hidden(report)]
    for path, name, text, severity in entries:
        file = relative_path(path, options.root)
        issues.append(
            {
                "description": visible(text),
                "check_name": name,
                "fingerprint": fingerprint(file, name, text.removeprefix("not judged: ")),
                "severity": severity,
                "location": {"path": file, "lines": {"begin": 1}},
            }
        )
    for path, crash in crashes(report):
        file = relative_path(path, options.root)
        issues.append(
            {
                "description": visible(f"rule {crash.rule} crashed: {crash.error}"),
                "check_name": crash.rule,
                "fingerprint": fingerprint(file, crash.rule, "crash"),
                "severity": "blocker",
                "location": {"path": file, "lines": {"begin": 1}},
            }
        )
    return json_text(issues, 2)
