"""Problems, findings and results of a check, and how nodes, ports and values are written.

Findings have one order everywhere, and notes in a stage may ignore them on purpose.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Literal

from msgspec import Struct, field

from lab3_usd.isaac.values import Value
from lab3_usd.model.build import Span
from lab3_usd.model.changes import Edit, Repair
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import Node, Unknown, UnresolvedAsset

if TYPE_CHECKING:
    from lab3_usd.spec.graph import NodeSpec

_SECTION = r"(?:([A-Z])(?=\d|$))?(\d+)?(?:\.(\d+))?"
_NUMBER, _DIGITS = r"\d+", 6
SectionKey = tuple[int, str, int, int, str]

Severity = Literal["error", "warning", "note"]
Verdict = Literal["pass", "fail", "not judged", "unreadable"]
Unopened = Literal["", "stage", "file", "asset"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


# A prim and a property of it, None for all of the prim. A prim that ends in `/` is what lies below
# it, a property that ends in `*` each that begins so, and `port[/World/Prim]` one target of a port.
# A name in brackets, or the id of a requirement as the prim, is what no property says.
Place = tuple[str, str | None]


class Problem(Struct, frozen=True):
    """What a rule yields: the site (prim and property) and what is wrong there.

    `severity` is None where the rule's own severity holds. `handout` names the section of the
    handout that asks for it (`C9`, `8.11`). `fix` are the edits that repair it, which is `likely`
    where they are only the likely ones; `unmet` are the ids of
    the requirements that it fails; if the prim is `absent`, also all requirements of it and of
    what is below it. A problem that fails none costs points of the parts in `costs` (a graph, a
    sensor, Scene, TF); if none is named, of the part that holds its site. `unopened` is what
    could not be opened: the stage itself, a file of it or beside it, an asset at the prim.
    `rests_on` is the missing asset that could refute the problem, which is then not judged.

    `assumes` are the sites that must be right for this problem to count: if one of them has a
    problem of at least the same severity, only that one is reported (`check.fold`). `covers` are
    further sites that the problem is about: with a starter, a change there is not reported, and
    undoing it is the repair. `if_supplied` is the hint of
    the warning that stays where the starter has the problem itself. `identity` says which problem
    of its rule it is where its site does not: one of the whole stage is shown at some node of it.
    `span` is the part of the script that it is about, where its site does not tell. `comes_first`
    puts it before others of its severity.
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
    fix: tuple[Edit, ...] = ()
    likely: bool = False
    unmet: tuple[str, ...] = ()
    absent: bool = False
    costs: tuple[str, ...] = ()
    assumes: tuple[Place, ...] = ()
    covers: tuple[Place, ...] = ()
    unopened: Unopened = ""
    if_supplied: str = ""
    rests_on: UnresolvedAsset | None = None
    identity: str | None = None
    span: Span | None = None
    comes_first: bool = False


class Finding(Struct, frozen=True):
    """One fault at its place, as every report shows it (see `schema/report-2.json`).

    No report shows what follows `fix`, which is the problem's own, except for `supplied`: whether
    the rule judges what the starter brings. `counted` is the rule's, too.
    """

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
    unopened: Unopened = ""
    unmet: tuple[str, ...] = ()
    absent: bool = False
    costs: tuple[str, ...] = ()
    assumes: tuple[Place, ...] = ()
    covers: tuple[Place, ...] = ()
    if_supplied: str = ""
    supplied: bool = False
    counted: tuple[str, str] = ("", "")
    identity: str | None = None
    span: Span | None = None
    comes_first: bool = False


Site = tuple[str, str, str | None]


class IgnoreNote(Struct, frozen=True):
    """A rule or family that is ignored at one place; '' where the note names none.

    A note in the custom data of a prim is about that prim and all below it, one of a property
    about that alone. A comment has no prim: it is about one `line` of a `layer`, and stands at
    the line `written`. One that is `misspelt` only looks like a note.
    """

    rule: str
    prim: str = ""
    property: str | None = None
    layer: str = ""
    line: int | None = None
    written: int | None = None
    misspelt: bool = False

    def covers(self, finding: Finding) -> bool:
        """Whether the note is about a finding."""
        if not is_among(finding.rule, (self.rule,)):
            return False
        if not self.prim:
            return finding.layer == self.layer and finding.line == self.line
        if self.property is not None:
            return (finding.prim, finding.property) == (self.prim, self.property)
        return is_at_or_below(finding.prim, self.prim)


def family_of(rule: str) -> str:
    """Return the letters that the id of a rule begins with."""
    return rule.rstrip("0123456789")


def id_order(rule: str) -> tuple[str, int, str]:
    """Return what ids of rules are sorted by: letters, then numbers, K100 after K99."""
    family = family_of(rule)
    return family, len(rule) - len(family), rule


def is_among(rule: str, names: Collection[str]) -> bool:
    """Whether a rule is one of these: ids of rules, and families."""
    return rule in names or family_of(rule) in names


def configured_severity(rule: str, usual: Severity, configured: Mapping[str, Severity]) -> Severity:
    """Return the severity that is configured for a rule, else for its family, else the usual."""
    return configured.get(rule, configured.get(family_of(rule), usual))


def site_of(finding: Finding) -> Site:
    """Return the key of a finding within a stage: its rule and place, or what it is about."""
    if finding.identity is not None:
        return finding.rule, finding.identity, None
    return finding.rule, finding.prim, finding.property


class Score(Struct, frozen=True):
    """Requirements that are known to be met, asked, and not judged, of a stage."""

    earned: float
    possible: float
    not_judged: float = 0.0


REQUIREMENT_KINDS = ("node", "setting", "wire", "target", "variable", "scene", "frame")


class Requirement(Struct, frozen=True):
    """One thing a checkpoint asks for, and whether the stage meets it.

    `id` is stable across files (`ROS_Drive/wire/make_array.input0`); `group` is the graph or
    scene part it belongs to, `kind` one of `REQUIREMENT_KINDS`. One that is not `judged` counts as
    met, and only a missing asset could tell. A number that is not met and `slight` is so near that
    the robot does the same.
    """

    id: str
    group: str
    kind: str
    title: str
    met: bool
    handout: str | None = None
    judged: bool = True
    slight: bool = False


class NotJudged(Struct, frozen=True):
    """What a rule does not judge at a site, because an asset is missing."""

    rule: str
    prim: str
    property: str | None
    asset: str


class BuiltParts(Struct, frozen=True):
    """What was read of the graphs that a script builds, and what is not known before it runs."""

    graphs: int = 0
    wires: int = 0
    values: int = 0
    unknown: tuple[Unknown, ...] = ()


class NodeCoverage(Struct, frozen=True):
    """How many nodes a stage without a spec has, and which of them could not be judged.

    `waiting` counts nodes that the stage only overrides, by the missing asset that would define
    them; `unknown` nodes of unknown types, by type; `partly` judged nodes at which a rule left
    something open, by asset. `built` is what a script builds beside nodes, None for a stage.
    """

    nodes: int = 0
    waiting: dict[str, int] = {}
    unknown: dict[str, int] = {}
    partly: dict[str, int] = {}
    built: BuiltParts | None = None

    @property
    def judged(self) -> int:
        """The number of nodes that were judged, in part at least."""
        return self.nodes - sum(self.waiting.values()) - sum(self.unknown.values())

    @property
    def is_whole(self) -> bool:
        """Whether there were nodes, and each was judged whole."""
        is_read = self.built is None or not self.built.unknown
        return self.judged == self.nodes > 0 and not self.partly and is_read


class Crash(Struct, frozen=True):
    """A rule that raised an exception: neither a pass nor a student's mistake."""

    rule: str
    error: str


class StageResult(Struct, frozen=True):
    """The judgement of one file at one checkpoint; without a spec there is none.

    `gaps` say what matters and could not be judged: with one, a stage without errors is no pass.
    `hidden` are findings that a baseline knows: no report lists them, and each says how many.
    `release` is the one that a stage without a spec was read by, '' for that of the lab.
    """

    path: str
    checkpoint: str | None
    findings: tuple[Finding, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    crashes: tuple[Crash, ...] = ()
    not_judged: tuple[NotJudged, ...] = ()
    coverage: NodeCoverage | None = None
    gaps: tuple[str, ...] = ()
    hidden: tuple[Finding, ...] = ()
    release: str = ""

    @property
    def verdict(self) -> Verdict:
        """What is said of the stage in a word; hidden findings do not fail it."""
        if any(finding.unopened == "stage" for finding in (*self.findings, *self.hidden)):
            return "unreadable"
        if self.crashes or any(finding.severity == "error" for finding in self.findings):
            return "fail"
        return "not judged" if self.gaps else "pass"

    @property
    def score(self) -> Score:
        """The requirements, counted."""
        judged = [requirement.met for requirement in self.requirements if requirement.judged]
        asked = len(self.requirements)
        return Score(float(sum(judged)), float(asked), float(asked - len(judged)))

    @property
    def is_beside_the_point(self) -> bool:
        """Whether it is a script that builds no graph, which is no fault."""
        built = None if self.coverage is None else self.coverage.built
        is_empty = built is not None and not built.graphs and not self.findings
        return is_empty and len(self.gaps) == 1 and self.verdict == "not judged"


class Report(Struct, frozen=True):
    """The results of one run, in the order the files were given.

    `accepted` are the paths of stages whose gaps a baseline knows, each of them. `dry_runs` are
    what a page shows of stages that were played, by their paths.
    """

    results: tuple[StageResult, ...]
    submissions: tuple[Submission, ...] = ()
    accepted: tuple[str, ...] = ()
    dry_runs: Mapping[str, object] = {}


class ChecklistItem(Struct, frozen=True):
    """One line of the handout's checklists: met, not met, not shown, or for a person to judge."""

    section: str
    text: str
    state: Literal["met", "not met", "not shown", "person"]
    because: str = ""


class Submission(Struct, frozen=True):
    """The findings about a student's folder as a whole, beside its stages.

    `to_come` are the checkpoints without a stage, in a folder that is worked on (`handed_in` is
    False) and not handed in. `hidden` are findings that a baseline knows.
    """

    path: str
    findings: tuple[Finding, ...] = ()
    checklist: tuple[ChecklistItem, ...] = ()
    crashes: tuple[Crash, ...] = field(default=())
    handed_in: bool = True
    to_come: tuple[str, ...] = ()
    hidden: tuple[Finding, ...] = ()


def section_key(name: str | None) -> SectionKey:
    """Return what sorts sections as the handout has them: 4.4, Parts A to J, 6.1, 8.11, none.

    Sections of another form, as `Ex 9` and `Ex 10`, are sorted by their words and numbers.
    """
    match = re.match(_SECTION, name or "")
    letter, number, below = match.groups() if match else (None, None, None)
    before_the_parts = 5
    if letter:
        place = 1
    elif number:
        place = 0 if int(number) <= before_the_parts else 2
    else:
        place = 3 if name else 4
    words = re.sub(_NUMBER, lambda digits: digits[0].zfill(_DIGITS), name or "")
    return place, letter or "", int(number or 0), int(below or 0), words


def ordered(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Sort findings by severity, what comes first in it, section of the handout, place and rule.

    No run and no hash seed changes the order.
    """
    return tuple(sorted(findings, key=_key))


def _key(finding: Finding) -> tuple[int, bool, SectionKey, str, str, str, str]:
    return (
        SEVERITIES.index(finding.severity),
        not finding.comes_first,
        section_key(finding.handout),
        finding.prim,
        finding.property or "",
        finding.rule,
        finding.message,
    )


MOST_ITEMS = 12  # of a list; whoever reads a message wants no more
MOST_LETTERS = 200


def display(value: Value | Unknown | None) -> str:
    """Return a value as a person would read it in the Property panel, in one line."""
    if value is None:
        return "not set"
    if isinstance(value, Unknown):
        return f"{{{value.why}}}"
    if isinstance(value, float):
        return f"{value:.7g}"  # as many digits as a float32 holds
    if isinstance(value, tuple):
        return f"[{_first(tuple(display(item) for item in value[: MOST_ITEMS + 1]), len(value))}]"
    if not isinstance(value, str):
        return str(value)
    short = value if len(value) <= MOST_LETTERS else f"{value[:MOST_LETTERS]}..."
    return f"'{short}'" if short.isprintable() else repr(short)  # repr shows what is invisible


def _first(items: tuple[str, ...], count: int) -> str:
    more = count - MOST_ITEMS
    return ", ".join(items) if more <= 0 else f"{', '.join(items[:MOST_ITEMS])} and {more} more"


def short_source(path: str | None) -> str:
    """Return `node.outputs:port` of a full property path."""
    return "nothing" if path is None else path.rpartition("/")[2]


def role_title(node: NodeSpec) -> str:
    """Return a node's title as the handout writes it."""
    return node.type.handout_name


def node_title(node: Node) -> str:
    """Return a node's title in the editor, else its type as saved."""
    name = node.type_name or "a node without a type"
    return name if node.type is None else node.type.handout_name


def format_paths(paths: tuple[str, ...]) -> str:
    """Return prim paths in one line."""
    return _first(paths, len(paths)) if paths else "no prim"
