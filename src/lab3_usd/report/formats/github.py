"""Annotations of GitHub Actions: workflow commands that mark the line in the pull request."""

from __future__ import annotations

from lab3_usd.model.finding import Report, Severity
from lab3_usd.report.entries import (
    entries,
    how_to_repair,
    is_lint,
    relative_path,
    remarks,
    site,
)
from lab3_usd.report.options import Options, Rules
from lab3_usd.report.safe_text import visible

COMMANDS: dict[Severity, str] = {"error": "error", "warning": "warning", "note": "notice"}


def render(report: Report, _rules: Rules | None, options: Options) -> str:
    """Return one workflow command a line."""
    lines = []
    for entry in entries(report):
        finding = entry.finding
        properties = {"file": relative_path(entry.file, options.root)}
        if finding.line:
            properties["line"] = str(finding.line)
            if finding.column:
                properties["col"] = str(finding.column)
        properties["title"] = f"{finding.rule} {finding.name}"
        texts = [site(finding), finding.message]
        texts += filter(None, [how_to_repair(finding, lint=is_lint(report))])
        if finding.handout:
            texts.append(f"handout {finding.handout}")
        message = "\n".join(map(visible, texts))
        lines.append(_command(COMMANDS[finding.severity], properties, message))
    for remark in remarks(report):
        properties = {"file": relative_path(remark.path, options.root), "title": remark.title}
        lines.append(_command(COMMANDS[remark.severity], properties, visible(remark.text)))
    return "".join(line + "\n" for line in lines)


def escape_data(text: str) -> str:
    """Escape the message of a workflow command, which ends with the line."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def escape_property(text: str) -> str:
    """Escape the value of a property, which ends with a comma or two colons."""
    return escape_data(visible(text)).replace(":", "%3A").replace(",", "%2C")


def _command(name: str, properties: dict[str, str], message: str) -> str:
    listed = ",".join(f"{key}={escape_property(value)}" for key, value in properties.items())
    return f"::{name} {listed}::{escape_data(message)}"
