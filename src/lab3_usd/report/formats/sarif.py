"""SARIF 2.1.0 for code scanning: rules with their manuals, results with both kinds of location."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lab3_usd.check.registry import Rule
from lab3_usd.data import rule_address
from lab3_usd.model.finding import Report, site_of
from lab3_usd.report.entries import (
    ReportedFinding,
    crashes,
    entries,
    fingerprinted,
    relative_path,
    remarks,
    site,
)
from lab3_usd.report.options import NAME, Options, Rules, tool_version
from lab3_usd.report.safe_text import json_text, visible

VERSION = "2.1.0"
SCHEMA = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)
ROOT = "%SRCROOT%"
FINGERPRINT = "ruleAndSite/v1"
_LINK = re.compile(r"\[(?=[^\[\]]*\]\()")
Json = dict[str, Any]


def render(report: Report, rules: Rules | None, options: Options) -> str:
    """Return one run with a result for each finding; without `rules` their manuals are left out."""
    names = {entry.finding.rule: entry.finding.name for entry in entries(report)}
    names = dict(sorted(names.items()))
    index = {rule_id: position for position, rule_id in enumerate(names)}
    manuals = rules or {}
    notifications: list[Json] = []
    for remark in remarks(report):
        place = {"physicalLocation": {"artifactLocation": file_uri(remark.path, options.root)}}
        notification = {
            "level": remark.severity,
            "message": sarif_message(remark.sentence),
            "locations": [place],
        }
        if remark.rule:
            notification["associatedRule"] = {"id": remark.rule}
        notifications.append(notification)
    invocation: Json = {"executionSuccessful": not any(crashes(report))}
    if notifications:
        invocation["toolExecutionNotifications"] = notifications
    driver = {
        "name": NAME,
        "version": tool_version(),
        "rules": [
            _descriptor(rule_id, name, manuals.get(rule_id)) for rule_id, name in names.items()
        ],
    }
    run = {
        "tool": {"driver": driver},
        "invocations": [invocation],
        "columnKind": "unicodeCodePoints",
        "results": [
            {
                "ruleIndex": index[entry.finding.rule],
                **_result(entry, fingerprint_text, options.root),
                **_fixes(entry, options),
            }
            for entry, fingerprint_text in fingerprinted(report)
        ],
    }
    return json_text({"$schema": SCHEMA, "version": VERSION, "runs": [run]}, 2)


def sarif_message(text: str) -> Json:
    """Return a message whose braces and brackets stay text (SARIF 3.11.5 and 3.11.6)."""
    plain = visible(text).replace("{", "{{").replace("}", "}}")
    return {"text": _LINK.sub(r"\\[", plain)}


def file_uri(path: str, root: str | None) -> Json:
    """Return the place of a file: relative to the root where below it, else absolute."""
    relative = relative_path(path, root)
    if Path(relative).is_absolute():
        return {"uri": Path(relative).as_uri()}
    return {"uri": quote(relative.encode("utf-8", "surrogateescape")), "uriBaseId": ROOT}


def _descriptor(rule_id: str, name: str, rule: Rule | None) -> Json:
    if rule is None:
        return {"id": rule_id, "name": name}
    address = "" if rule.scope == "own" else rule_address(rule_id)
    first = " ".join(rule.manual.partition("\n\n")[0].split())
    return {
        "id": rule_id,
        "name": name,
        "shortDescription": {"text": first},
        "fullDescription": {"text": rule.section("Why") or first},
        "help": {"text": rule.manual},
        **({"helpUri": address} if address else {}),
        "defaultConfiguration": {"level": rule.severity},
    }


def _result(entry: ReportedFinding, fingerprint_text: str, root: str | None) -> Json:
    finding = entry.finding
    text = f"{finding.message}. {finding.hint}" if finding.hint else finding.message
    physical: Json = {"artifactLocation": file_uri(entry.file, root)}
    if finding.line:
        physical["region"] = {"startLine": finding.line}
        if finding.column:
            physical["region"]["startColumn"] = finding.column
    logical = {
        "name": finding.property or finding.prim.rpartition("/")[2],
        "fullyQualifiedName": site(finding),
        "kind": "property" if finding.property else "object",
    }
    result = {
        "ruleId": finding.rule,
        "level": finding.severity,
        "message": sarif_message(text),
        "locations": [{"physicalLocation": physical, "logicalLocations": [logical]}],
        "partialFingerprints": {FINGERPRINT: fingerprint_text},
    }
    if finding.related:
        result["relatedLocations"] = [
            {"logicalLocations": [{"fullyQualifiedName": prim, "kind": "object"}]}
            for prim in dict.fromkeys(finding.related)
        ]
    properties = {
        "checkpoint": entry.checkpoint,
        "expected": finding.expected,
        "actual": finding.actual,
        "handout": finding.handout,
    }
    given = {key: value for key, value in properties.items() if value is not None}
    return {**result, "properties": given} if given else result


def _fixes(entry: ReportedFinding, options: Options) -> Json:
    """Return the lines that the repair changes, file by file; nothing where there is none."""
    changes = options.changes.get((entry.path, site_of(entry.finding)))
    if not changes or entry.finding.fix is None:
        return {}
    replacements: dict[str, list[Json]] = {}
    for change in changes:
        region = {
            "startLine": change.first + 1,
            "startColumn": 1,
            "endLine": change.last + 1,
            "endColumn": 1,
        }
        replacement = {"deletedRegion": region, "insertedContent": {"text": change.text}}
        replacements.setdefault(change.file, []).append(replacement)
    artifacts = [
        {"artifactLocation": file_uri(file, options.root), "replacements": lines}
        for file, lines in replacements.items()
    ]
    return {
        "fixes": [
            {"description": sarif_message(entry.finding.fix.title), "artifactChanges": artifacts}
        ]
    }
