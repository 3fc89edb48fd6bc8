"""Decides the lines of the handout's checklists by what was found."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from fnmatch import translate
from functools import cache
from typing import Literal

from msgspec import Struct

from lab3_usd.check.finding import ChecklistItem, Finding, Requirement, StageResult
from lab3_usd.check.subjects_lab import Evidence
from lab3_usd.check.submitted import Listing
from lab3_usd.spec.ros_spec import RosSpec
from lab3_usd.spec.spec import Lab
from lab3_usd.spec.submission_spec import ChecklistSpec, SubmissionSpec

State = Literal["met", "not met", "not shown", "person"]
_Verdict = tuple[State, str]
# The gravest verdict on any part of a line is the line's.
_ORDER: tuple[State, ...] = ("not met", "not shown", "person", "met")
_EVIDENCE = "E"


class Known(Struct, frozen=True):
    """Everything that is known of a submission when its checklists are decided."""

    lab: Lab
    spec: SubmissionSpec
    ros: RosSpec
    listing: Listing
    results: Mapping[str, StageResult]
    findings: tuple[Finding, ...]
    evidence: Evidence

    @property
    def last(self) -> StageResult | None:
        """The last stage that could be read."""
        readable = [each for each in self.results.values() if each.verdict != "unreadable"]
        return readable[-1] if readable else None

    def errors(self) -> Iterator[Finding]:
        """Yield the errors of the last stage and of the submission as a whole."""
        stage = self.last.findings if self.last is not None else ()
        yield from (each for each in (*stage, *self.findings) if each.severity == "error")


def decide(known: Known) -> tuple[ChecklistItem, ...]:
    """Return every line of the checklists with its state and the reason."""
    return tuple(_item(line, known) for line in known.spec.checklist)


def _item(line: ChecklistSpec, known: Known) -> ChecklistItem:
    verdicts = list(_verdicts(line, known))
    state = min((state for state, _ in verdicts), key=_ORDER.index)
    reasons = dict.fromkeys(why for found, why in verdicts if found == state and why)
    return ChecklistItem(line.section, line.text, state, "; ".join(reasons))


def _verdicts(line: ChecklistSpec, known: Known) -> Iterator[_Verdict]:
    if line.stages:
        yield _stages(line.stages, known)
    if line.requirements:
        yield _requirements(line.requirements, known)
    if line.rules:
        yield from _rules(line.rules, known)
    for name in line.shown:
        yield _shown(name, known)
    for name in line.deliverables:
        yield _deliverable(name, known)
    if line.person:
        yield "person", line.person


def _stages(which: str, known: Known) -> _Verdict:
    if which == "all":
        wrong = [
            checkpoint.file
            for number, checkpoint in known.lab.checkpoints.items()
            if not _is_handed_in(number, known)
        ]
        return ("not met", f"missing or misnamed: {', '.join(wrong)}") if wrong else ("met", "")
    number = max(known.lab.checkpoints) if which == "last" else which
    result = known.results.get(number)
    if result is None:
        return "not shown", f"{known.lab.checkpoints[number].file} is missing"
    if result.verdict == "unreadable":
        return "not met", f"{result.path} cannot be read"
    return "met", ""


def _is_handed_in(number: str, known: Known) -> bool:
    stage = known.listing.stages.get(number)
    return stage is not None and stage.how in {"right", "misplaced"}


def _requirements(patterns: tuple[str, ...], known: Known) -> _Verdict:
    last = known.last
    if last is None:
        return "not shown", "no stage could be read"
    for pattern in patterns:
        is_asked = _matcher(pattern)
        asked = [each for each in last.requirements if is_asked(each.id)]
        if not asked:
            return "not met", f"checkpoint {last.checkpoint} is the last, and does not have it yet"
        missed = [each for each in asked if not each.met]
        if missed:
            return "not met", _titles(missed)
    return "met", ""


@cache
def _matcher(pattern: str) -> Callable[[str], re.Match[str] | None]:
    """Return what tells whether a name fits a pattern of the lab's with `*`."""
    return re.compile(translate(pattern)).match


def _titles(missed: list[Requirement]) -> str:
    more = f" and {len(missed) - 1} more" if len(missed) > 1 else ""
    return f"{missed[0].group}: {missed[0].title}{more}"


def _rules(rules: tuple[str, ...], known: Known) -> Iterator[_Verdict]:
    for found in known.errors():
        if found.rule in rules:
            yield "not met", f"{found.rule}: {found.message}"
            return
    for found in known.findings:
        # A note on saved output says that it does not show what it is there for.
        if found.rule in rules and found.rule.startswith(_EVIDENCE) and found.severity == "note":
            yield "not shown", f"{found.rule}: {found.message}"
            return


def _shown(name: str, known: Known) -> _Verdict:
    kind, _, target = name.partition(" ")
    outputs: Mapping[str, object] = getattr(known.evidence, kind)
    if not outputs.get(target):
        return "not shown", f"no output of `{_command(kind, target, known)}`"
    sites = {target, " -> ".join(target.split())}
    for found in known.errors():
        if found.rule.startswith(_EVIDENCE) and found.property in sites and target:
            return "not met", f"{found.rule}: {found.message}"
    return "met", ""


def _command(kind: str, target: str, known: Known) -> str:
    """Return the command whose output would show it."""
    for command in known.ros.commands:
        is_goal = kind == "goals" and command.of == known.ros.goal.status
        if is_goal or (command.kind.name, command.target) == (kind, target):
            return command.line
    return _name_of(kind, target)


def _name_of(kind: str, target: str) -> str:
    """Name an output for which the lab has no command."""
    return f"{kind.replace('_', ' ')} {target}".strip()


def _deliverable(name: str, known: Known) -> _Verdict:
    wanted, found = known.spec.deliverables[name], known.listing.found.get(name, ())
    if len(found) >= wanted.at_least:
        return "met", ""
    return "not shown", f"{wanted.title}: {len(found)} found, at least {wanted.at_least} expected"
