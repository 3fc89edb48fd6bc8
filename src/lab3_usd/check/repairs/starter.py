"""Gives the findings of a comparison with the starter their repairs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from msgspec.structs import replace

from lab3_usd.check.repairs.findings import repair_by
from lab3_usd.model.finding import Finding
from lab3_usd.model.repair import Activate, ApplySchema, Edit, Restore

_MISSING, _SCHEMA, _PLACE, _ADDED = "U01", "U03", "U05", "U07"
_ABSENT = "missing"
_POSE = "xformOpOrder"


def with_starter_repairs(
    findings: Iterable[Finding], is_supplied: Callable[[str], bool]
) -> Iterator[Finding]:
    """Yield the findings, those that have one right repair together with it.

    What stands elsewhere than in the starter has none: nothing is supplied at its path.
    Of several differences of a prim the first is repaired; the next one is found after that.
    """
    for each in findings:
        is_there = each.rule == _ADDED or is_supplied(each.prim)
        edits = tuple(_edits(each)) if is_there else ()
        yield replace(each, fix=repair_by(edits)) if edits and each.severity != "note" else each


def _edits(finding: Finding) -> Iterator[Edit]:
    if finding.rule == _MISSING and finding.actual != _ABSENT:
        yield Activate(finding.prim)
    elif finding.rule == _SCHEMA and finding.expected:
        yield ApplySchema(finding.prim, finding.expected)
    elif finding.property or finding.rule == _PLACE:
        yield Restore(finding.prim, finding.property or _POSE)
    elif finding.rule != _ADDED:
        yield Restore(finding.prim)
