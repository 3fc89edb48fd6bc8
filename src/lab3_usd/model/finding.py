"""What a check says: problems that rules yield, findings and results that reports read."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

from msgspec import Struct, field

from lab3_usd.model.repair import Repair

Severity = Literal["error", "warning", "note"]
Verdict = Literal["pass", "fail", "unreadable"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


class Problem(Struct, frozen=True):
    """What a rule yields: the site (prim and property) and what is wrong there.

    `severity` is None where the rule's own severity holds. `handout` names the section of the
    handout that asks for it (`C9`, `8.11`).
    """

    prim: str
    message: str
    property: str | None = None
    expected: str | None = None
    actual: str | None = None
    handout: str | None = None
    related: tuple[str, ...] = ()
    severity: Severity | None = None
    hint: str | None = None


class Finding(Struct, frozen=True):
    """One fault at its place, as every report shows it (see `schema/report-1.json`)."""

    rule: str
    name: str
    severity: Severity
    prim: str
    message: str
    property: str | None = None
    expected: str | None = None
    actual: str | None = None
    layer: str | None = None
    line: int | None = None
    column: int | None = None
    handout: str | None = None
    hint: str | None = None
    related: tuple[str, ...] = ()
    fix: Repair | None = None


Site = tuple[str, str, str | None]


def family_of(rule: str) -> str:
    """Return the letters that the id of a rule begins with."""
    return rule.rstrip("0123456789")


def is_among(rule: str, names: Collection[str]) -> bool:
    """Whether a rule is one of these: ids of rules, and families."""
    return rule in names or family_of(rule) in names


def site_of(finding: Finding) -> Site:
    """Return rule, prim and property: what tells findings of one stage apart."""
    return finding.rule, finding.prim, finding.property


class Score(Struct, frozen=True):
    """Requirements met and asked, over one group or one file."""

    earned: float
    possible: float


REQUIREMENT_KINDS = ("node", "setting", "wire", "target", "scene", "frame")


class Requirement(Struct, frozen=True):
    """One thing a checkpoint asks for, and whether the stage meets it.

    `id` is stable across files (`ROS_Drive/wire/make_array.input0`); `group` is the graph or
    scene part it belongs to, `kind` one of `REQUIREMENT_KINDS`.
    """

    id: str
    group: str
    kind: str
    title: str
    met: bool
    handout: str | None = None


class Crash(Struct, frozen=True):
    """A rule that failed itself: neither a pass nor a student's mistake."""

    rule: str
    error: str


class StageResult(Struct, frozen=True):
    """The judgement of one file at one checkpoint; without a spec there is none."""

    path: str
    checkpoint: str | None
    verdict: Verdict
    score: Score
    findings: tuple[Finding, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    crashes: tuple[Crash, ...] = ()


class Report(Struct, frozen=True):
    """The results of one run, in the order the files were given."""

    results: tuple[StageResult, ...]
    submissions: tuple[Submission, ...] = ()


class ChecklistItem(Struct, frozen=True):
    """One line of the handout's checklists: met, not met, not shown, or for a person to judge."""

    section: str
    text: str
    state: Literal["met", "not met", "not shown", "person"]
    because: str = ""


class Submission(Struct, frozen=True):
    """What is said of a student's folder as a whole, beside its stages."""

    path: str
    findings: tuple[Finding, ...] = ()
    checklist: tuple[ChecklistItem, ...] = ()
    crashes: tuple[Crash, ...] = field(default=())
