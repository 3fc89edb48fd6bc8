"""One line for each finding, `file:line:column: RULE message`, as editors parse it."""

from __future__ import annotations

from lab3_usd.model.finding import Report
from lab3_usd.report.entries import entries, remarks, site
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import visible


def render(report: Report, _rules: Rules | None, _options: Options) -> str:
    """Return the findings; one without a known line stands at the start of its file."""
    lines = []
    for entry in entries(report):
        finding = entry.finding
        place = f"{entry.file}:{finding.line or 1}:{finding.column or 1}"
        lines.append(f"{place}: {finding.rule} {finding.message} ({site(finding)})")
    lines += [f"{remark.path}:1:1: {remark.sentence}" for remark in remarks(report)]
    return "".join(visible(line) + "\n" for line in lines)
