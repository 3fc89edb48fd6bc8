"""Judging any stage of Isaac Sim without a spec.

Running the rules, and the repairs of what they find.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.check.registry import import_rules, rules_of
from lab3_usd.check.repairs import TYPE, modern_types
from lab3_usd.check.ros.running import LintSubject
from lab3_usd.check.rule_runs import RuleResults, merge_results, run_rule
from lab3_usd.model.changes import ApplySchema, Connect, Edit, RenameProperty, SetValue, repair_by
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import Node
from lab3_usd.spec.catalog import Port, can_connect

import_rules("F", "K")


def lint(subject: LintSubject) -> RuleResults:
    """Run every rule over a stage, which is read as they ask.

    Raises:
        StageError: the file turns out to be damaged.
    """
    try:
        files = merge_results(run_rule(rule, subject, None) for rule in rules_of("model", "F"))
        stage = merge_results(run_rule(rule, subject, None) for rule in rules_of("lint", "K"))
        # What cannot be found leaves the verdict open; whether it should be there is not known.
        notes = replace(
            files, findings=tuple(replace(finding, severity="note") for finding in files.findings)
        )
        repairs = tuple(with_lint_repairs(stage.findings, subject))
        return merge_results((notes, replace(stage, findings=repairs)))
    finally:
        # What rules derive holds what they were given, and so the stage.
        subject.stage.judged.clear()


_Edits = Iterator[Edit]


def with_lint_repairs(findings: Iterable[Finding], subject: LintSubject) -> Iterator[Finding]:
    """Yield the findings, those that have one right repair together with it."""
    for finding in findings:
        is_open = finding.severity != "note" and finding.fix is None
        repaired = _BY_RULE.get(finding.rule) if is_open else None
        edits = tuple(repaired(finding, subject)) if repaired else ()
        yield replace(finding, fix=repair_by(edits)) if edits else finding


def _dead_wire(finding: Finding, subject: LintSubject) -> _Edits:
    """Leave out a dead wire where a live one feeds the input as well."""
    node, port = _port(finding, subject)
    if node is not None and port is not None and finding.severity == "warning":
        live = (source for source in node.sources(port.name) if source != finding.actual)
        yield Connect(node.path, port.name, port.usd_type, tuple(live))


def _unknown_port(finding: Finding, subject: LintSubject) -> _Edits:
    """Take the port that was likely meant, at either end of a wire."""
    node, port = _port(finding, subject)
    if node is None or finding.expected is None:
        return
    if finding.related:  # of the end where the wire leaves
        if port is None or not _fits(subject.live[finding.related[0]], finding.expected, port):
            return
        meant = f"{finding.related[0]}.{finding.expected}"
        sources = (
            meant if source == finding.actual else source for source in node.sources(port.name)
        )
        yield Connect(node.path, port.name, port.usd_type, tuple(sources))
    elif port is None and finding.expected not in node.ports and finding.property:
        yield RenameProperty(node.path, finding.property, finding.expected)


def _fits(source: Node, name: str, target: Port) -> bool:
    found = None if source.type is None else source.type.port(name)
    return found is not None and can_connect(found, target)


def _type_name(finding: Finding, _subject: LintSubject) -> _Edits:
    if finding.expected:
        yield SetValue(finding.prim, TYPE, "token", finding.expected)


def _old_types(finding: Finding, subject: LintSubject) -> _Edits:
    nodes = (subject.live[each] for each in finding.related if each in subject.live)
    yield from modern_types(nodes, subject.catalog)


def _offered_value(finding: Finding, subject: LintSubject) -> _Edits:
    """Set the value that was likely meant, of those that an input offers."""
    node, port = _port(finding, subject)
    if node is not None and port is not None and finding.expected in port.allowed:
        yield from _set(node, port, str(finding.expected))


def _frame_name(finding: Finding, subject: LintSubject) -> _Edits:
    """Take the slash off the name of a frame."""
    node, port = _port(finding, subject)
    name = str(node.value(port.name)) if node is not None and port is not None else ""
    if node is not None and port is not None and name.lstrip("/") not in ("", name):
        yield from _set(node, port, name.lstrip("/"))


def _set(node: Node, port: Port, value: str) -> _Edits:
    if not node.sources(port.name):
        yield SetValue(node.path, port.name, port.usd_type, value)


def _sensor_schema(finding: Finding, _subject: LintSubject) -> _Edits:
    if finding.expected:
        yield ApplySchema(finding.prim, finding.expected)


def _port(finding: Finding, subject: LintSubject) -> tuple[Node | None, Port | None]:
    """Return the node and the port that a finding is about."""
    node = subject.live.get(finding.prim)
    kind = None if node is None else node.type
    return node, None if kind is None or finding.property is None else kind.port(finding.property)


_BY_RULE: Mapping[str, Callable[[Finding, LintSubject], _Edits]] = {
    "K20": _dead_wire,
    "K21": _unknown_port,
    "K30": _type_name,
    "K31": _old_types,
    "K35": _offered_value,
    "K38": _frame_name,
    "K71": _sensor_schema,
}
