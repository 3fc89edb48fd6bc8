"""A report as a flat list of findings, with fingerprints and counts by rule."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from zlib import crc32

from msgspec import Struct

from lab3_usd.data import program
from lab3_usd.model.finding import (
    SEVERITIES,
    Crash,
    Finding,
    NodeCoverage,
    Report,
    Requirement,
    Score,
    Severity,
)
from lab3_usd.report.safe_text import visible

CHECKLIST_STATES = {
    "met": "met",
    "not met": "not met",
    "not shown": "not shown",
    "person": "for a person to judge",
}
# What a finding says, in the order of every table and record of findings.
FINDING_FIELDS = (
    "rule", "name", "severity", "prim", "property", "message", "expected", "actual",
    "layer", "line", "column", "handout", "hint", "related",
)  # fmt: skip
_NAMED = 3  # assets or types in the line that counts nodes


def fingerprinted(report: Report) -> Iterator[tuple[ReportedFinding, str]]:
    """Yield every finding with a fingerprint that survives edits elsewhere in the file.

    It names rule, prim and property, or what the finding is about instead, never the line; the
    number after the colon counts findings of one file that agree in these.
    """
    seen: dict[tuple[str, str], int] = {}
    for entry in entries(report):
        finding = entry.finding
        place = (finding.prim, finding.property or "")
        digest = fingerprint(
            finding.rule, *(place if finding.identity is None else (finding.identity,))
        )
        key = (entry.path, digest)
        seen[key] = seen.get(key, 0) + 1
        yield entry, f"{digest}:{seen[key]}"


def fingerprint(*parts: str) -> str:
    """Return 32 hexadecimal digits that stand for `parts`."""
    from hashlib import sha256

    return sha256("\0".join(parts).encode("utf-8", "backslashreplace")).hexdigest()[:32]


def fault_id(finding: Finding) -> str:
    """Return a fingerprint of rule, severity, site and message: 8 hexadecimal digits.

    A fault that is carried along from stage to stage has one; the line does not matter.
    """
    parts = (finding.rule, finding.severity, finding.prim, finding.property, finding.message)
    text = "\0".join(part or "" for part in parts)
    return format(crc32(text.encode("utf-8", "backslashreplace")), "08x")


class ReportedFinding(Struct, frozen=True):
    """A finding with the path that was checked and the checkpoint of a stage."""

    path: str
    checkpoint: str | None
    finding: Finding

    @property
    def file(self) -> str:
        """The file to open: the layer that holds the fault where it is known."""
        return self.finding.layer or self.path


class Summary(Struct, frozen=True):
    """How many files were checked, passed and were not judged, and how many findings there are.

    `hidden` counts those that a baseline hides, by severity.
    """

    files: int
    passed: int
    not_judged: int
    errors: int
    warnings: int
    notes: int
    hidden: dict[Severity, int] = {}


def entries(report: Report) -> Iterator[ReportedFinding]:
    """Yield every finding in the order of the report: the stages, then the submissions."""
    for result in report.results:
        for finding in result.findings:
            yield ReportedFinding(result.path, result.checkpoint, finding)
    for submission in report.submissions:
        for finding in submission.findings:
            yield ReportedFinding(submission.path, None, finding)


def crashes(report: Report) -> Iterator[tuple[str, Crash]]:
    """Yield every rule that crashed, with the path that was checked."""
    for result in report.results:
        for crash in result.crashes:
            yield result.path, crash
    for submission in report.submissions:
        for crash in submission.crashes:
            yield submission.path, crash


def gaps(report: Report) -> Iterator[tuple[str, str]]:
    """Yield what matters and could not be judged, with the path of the stage."""
    for result in report.results:
        for gap in result.gaps:
            yield result.path, gap


class Remark(Struct, frozen=True):
    """What a report says beside its findings of a path: a gap, what a baseline hides, a crash.

    `title` says which of these it is, and `rule` which rule crashed.
    """

    path: str
    title: str
    severity: Severity
    text: str
    rule: str = ""

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        return self.text if self.title == "baseline" else f"{self.title}: {self.text}"


def remarks(report: Report) -> Iterator[Remark]:
    """Yield what was not judged, what a baseline hides, and the rules that crashed."""
    for path, gap in gaps(report):
        yield Remark(path, "not judged", "warning", gap)
    for path, findings in hidden_findings(report):
        yield Remark(path, "baseline", "note", hidden_text(severity_counts(findings)))
    for path, crash in crashes(report):
        yield Remark(path, f"{crash.rule} crashed", "error", crash.error, crash.rule)


def hidden_findings(report: Report) -> Iterator[tuple[str, tuple[Finding, ...]]]:
    """Yield the findings that a baseline hides of each stage and submission, where there are."""
    yield from ((result.path, result.hidden) for result in report.results if result.hidden)
    yield from ((folder.path, folder.hidden) for folder in report.submissions if folder.hidden)


def by_group(requirements: Iterable[Requirement]) -> dict[str, list[Requirement]]:
    """Return requirements by the graph or part of the scene that they belong to."""
    groups: dict[str, list[Requirement]] = {}
    for requirement in requirements:
        groups.setdefault(requirement.group, []).append(requirement)
    return groups


def severity_counts(findings: Iterable[Finding]) -> dict[Severity, int]:
    """Count findings by severity, the gravest first; none is left out."""
    severities = [finding.severity for finding in findings]
    return {name: severities.count(name) for name in SEVERITIES if name in severities}


def hidden_text(counts: Mapping[Severity, int]) -> str:
    """Say what a baseline hides: `the baseline hides 2 errors, 1 note`; '' for nothing."""
    listed = ", ".join(plural(count, severity) for severity, count in counts.items())
    return f"the baseline hides {listed}" if listed else ""


def summarize(report: Report) -> Summary:
    """Count files, passes and findings."""
    counts = severity_counts(entry.finding for entry in entries(report))
    return Summary(
        files=len(report.results),
        passed=sum(result.verdict == "pass" for result in report.results),
        not_judged=sum(result.verdict == "not judged" for result in report.results),
        errors=counts.get("error", 0),
        warnings=counts.get("warning", 0),
        notes=counts.get("note", 0),
        hidden=severity_counts(
            chain.from_iterable(findings for _, findings in hidden_findings(report))
        ),
    )


def site(finding: Finding) -> str:
    """Return the path of the faulty prim or property, as the Stage panel accepts it."""
    return f"{finding.prim}.{finding.property}" if finding.property else finding.prim


def is_lint(report: Report) -> bool:
    """Whether no lab asks for anything in it."""
    return not report.submissions and all(r.checkpoint is None for r in report.results)


def is_repairable(finding: Finding) -> bool:
    """Whether `lab3 fix` repairs it without further options."""
    return finding.fix is not None and finding.fix.safe


def how_to_repair(finding: Finding, *, lint: bool) -> str:
    """Return the hint of a finding, and the command that does it where one can."""
    hint = (finding.hint or "").removesuffix(".")
    if finding.fix is None:
        return finding.hint or ""
    options = f"{' --lint' if lint else ''}{'' if finding.fix.safe else ' --unsafe'}"
    return f"{hint}; or {program()} fix{options}" if hint else f"{program()} fix{options}"


def relative_path(path: str, root: str | None) -> str:
    """Return `path` with forward slashes, relative to `root` (the current folder) if below it.

    Decided by the text alone: a link stays the file that was given.
    """
    base = os.path.normpath(Path.cwd() / (root or ""))
    whole = os.path.normpath(Path.cwd() / path)
    try:
        return Path(whole).relative_to(base).as_posix()
    except ValueError:
        return Path(whole).as_posix()


def statistics_table(report: Report) -> list[str]:
    """Return the table of faults by rule as lines, the most frequent first; empty for none."""
    paths_by_rule: dict[tuple[str, str, Severity], list[str]] = {}
    for entry in entries(report):
        finding = entry.finding
        key = (finding.rule, finding.name, finding.severity)
        paths_by_rule.setdefault(key, []).append(entry.path)
    if not paths_by_rule:
        return []

    def order(key: tuple[str, str, Severity]) -> tuple[int, str, int]:
        return -len(paths_by_rule[key]), key[0], SEVERITIES.index(key[2])

    rows: list[tuple[object, ...]] = [("findings", "files", "severity", "rule")]
    for key in sorted(paths_by_rule, key=order):
        rule, name, severity = key
        paths = paths_by_rule[key]
        rows.append((len(paths), len({*paths}), severity, visible(f"{rule} {name}")))
    return [f"{row[0]:>8}  {row[1]:>5}  {row[2]:<8}  {row[3]}" for row in rows]


def summary_line(summary: Summary) -> str:
    """Return the line that ends a report: files, verdicts and findings."""
    failed = summary.files - summary.passed - summary.not_judged
    counts = [
        plural(summary.errors, "error"),
        plural(summary.warnings, "warning"),
        plural(summary.notes, "note"),
    ]
    files = f"{plural(summary.files, 'file')}: {summary.passed} passed, {failed} failed"
    files += f", {summary.not_judged} not judged" if summary.not_judged else ""
    return "; ".join(filter(None, (files, ", ".join(counts), hidden_text(summary.hidden))))


def score_text(score: Score) -> str:
    """Return how many requirements are met: `202 of 215 met`, and how many were not judged."""
    text = f"{score.earned:g} of {score.possible:g} met"
    return f"{text}, {score.not_judged:g} not judged" if score.not_judged else text


def plural(count: int, noun: str) -> str:
    """Return a count with its noun."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def missing_line(assets: Iterable[str]) -> str:
    """Say what a stage leads to that cannot be found, and that it could hold more; '' for none."""
    names = list(dict.fromkeys(assets))
    if len(names) > 1:
        return f"{len(names)} assets cannot be found, and could hold more: {names[0]} and others"
    return f"{names[0]} cannot be found, and could hold more" if names else ""


def coverage_line(coverage: NodeCoverage) -> str:
    """Say how many nodes were not judged, or only in part, and what they wait for; '' for none."""
    if not coverage.nodes and coverage.built is None:
        return "there are no graph nodes to judge"
    parts = [] if coverage.built is None else [built_line(coverage)]
    if coverage.judged < coverage.nodes:
        left_out = coverage.nodes - coverage.judged
        waiting = _counted(coverage.waiting, "needs", "need")
        unknown = _counted(coverage.unknown, "has the unknown type", "have the unknown type")
        listed = "; ".join(filter(None, (waiting, unknown)))
        parts.append(f"{left_out} of {plural(coverage.nodes, 'node')} not judged ({listed})")
    if coverage.partly:
        count = sum(coverage.partly.values())
        listed = _counted(coverage.partly, "needs", "need")
        parts.append(f"{plural(count, 'node')} only partly checked ({listed})")
    return (", " if coverage.built is None else "; ").join(filter(None, parts))


def built_line(coverage: NodeCoverage) -> str:
    """Say how much of the graphs of a script was read, and how much only a run tells."""
    built = coverage.built
    if built is None or not built.graphs:
        return ""
    graphs = plural(built.graphs, "graph")
    read = f"{graphs}, {plural(coverage.nodes, 'node')}, {plural(built.wires, 'wire')} read"
    if not built.unknown:
        return read
    unknown = plural(len(built.unknown), "value")
    return f"{read}; not known before it runs: {unknown} (-v lists them)"


def _counted(counts: Mapping[str, int], one: str, several: str) -> str:
    """Return counts by name, the most first, with the verb that goes with them."""
    ranked = sorted(counts.items(), key=lambda entry: (-entry[1], entry[0]))
    named = [f"{count} {one if count == 1 else several} {name}" for name, count in ranked[:_NAMED]]
    further = sum(count for _, count in ranked[_NAMED:])
    return ", ".join([*named, *([f"{further} more"] if further else [])])
