"""Decides the lines of the handout's checklists by what was found."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Mapping
from typing import Literal

from msgspec import Struct

from lab3_usd.model.finding import ChecklistItem, Finding, StageResult
from lab3_usd.model.folder import Evidence, Listing
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.ros import RosSpec
from lab3_usd.spec.submission import ChecklistSpec, SubmissionSpec

State = Literal["met", "not met", "not shown", "person"]
_Verdict = tuple[State, str]
# The gravest verdict on any part of a line is the line's.
_ORDER: tuple[State, ...] = ("not met", "not shown", "person", "met")
_EVIDENCE = "E"


class ChecklistInput(Struct, frozen=True):
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
        readable = [result for result in self.results.values() if result.verdict != "unreadable"]
        return readable[-1] if readable else None

    def errors(self) -> Iterator[Finding]:
        """Yield the errors of the last stage and of the submission as a whole."""
        stage = self.last.findings if self.last is not None else ()
        yield from (finding for finding in (*stage, *self.findings) if finding.severity == "error")


def decide_checklist(given: ChecklistInput) -> tuple[ChecklistItem, ...]:
    """Return every line of the checklists with its state and the reason."""
    items = []
    for line in given.spec.checklist:
        verdicts = list(_verdicts(line, given))
        gravest = min((state for state, _ in verdicts), key=_ORDER.index)
        reasons = dict.fromkeys(why for state, why in verdicts if state == gravest and why)
        items.append(ChecklistItem(line.section, line.text, gravest, "; ".join(reasons)))
    return tuple(items)


def _verdicts(line: ChecklistSpec, given: ChecklistInput) -> Iterator[_Verdict]:
    if line.stages:
        yield _stages(line.stages, given)
    if line.requirements:
        yield _requirements(line.requirements, given)
    if line.rules:
        yield from _rules(line.rules, given)
    for name in line.shown:
        yield _shown(name, given)
    for name in line.deliverables:
        deliverable, count = (
            given.spec.deliverables[name],
            len(given.listing.deliverables.get(name, ())),
        )
        expected = f"at least {deliverable.at_least} expected"
        is_complete = count >= deliverable.at_least
        reason = "" if is_complete else f"{deliverable.title}: {count} found, {expected}"
        yield ("met" if is_complete else "not shown"), reason
    if line.person:
        yield "person", line.person


def _stages(which: str, given: ChecklistInput) -> _Verdict:
    if which == "all":
        handed_in = {
            number
            for number, stage in given.listing.stages.items()
            if stage.naming in {"right", "misplaced"}
        }
        checkpoints = given.lab.checkpoints
        wrong = [checkpoints[number].file for number in checkpoints if number not in handed_in]
        return ("not met", f"missing or misnamed: {', '.join(wrong)}") if wrong else ("met", "")
    number = given.lab.last if which == "last" else which
    result = given.results.get(number)
    if result is None:
        return "not shown", f"{given.lab.checkpoints[number].file} is missing"
    if result.verdict == "unreadable":
        return "not met", f"{result.path} cannot be read"
    return "met", ""


def _requirements(patterns: tuple[str, ...], given: ChecklistInput) -> _Verdict:
    last = given.last
    if last is None:
        return "not shown", "no stage could be read"
    by_id = {requirement.id: requirement for requirement in last.requirements}
    for pattern in patterns:
        requirements = [by_id[name] for name in fnmatch.filter(by_id, pattern)]
        if not requirements:
            return "not met", f"checkpoint {last.checkpoint} is the last, and does not have it yet"
        missed = [requirement for requirement in requirements if not requirement.met]
        if missed:
            more = f" and {len(missed) - 1} more" if len(missed) > 1 else ""
            return "not met", f"{missed[0].group}: {missed[0].title}{more}"
    return "met", ""


def _rules(rules: tuple[str, ...], given: ChecklistInput) -> Iterator[_Verdict]:
    for error in given.errors():
        if error.rule in rules:
            yield "not met", f"{error.rule}: {error.message}"
            return
    for note in given.findings:
        # A note on saved output says that it does not show what it is there for.
        if note.rule in rules and note.rule.startswith(_EVIDENCE) and note.severity == "note":
            yield "not shown", f"{note.rule}: {note.message}"
            return


def _shown(name: str, given: ChecklistInput) -> _Verdict:
    kind, _, target = name.partition(" ")
    outputs: Mapping[str, object] = getattr(given.evidence, kind)
    if not outputs.get(target):
        return "not shown", f"no output of `{_command(kind, target, given)}`"
    sites = {target, " -> ".join(target.split())}
    for error in given.errors():
        if error.rule.startswith(_EVIDENCE) and error.property in sites and target:
            return "not met", f"{error.rule}: {error.message}"
    return "met", ""


def _command(kind: str, target: str, given: ChecklistInput) -> str:
    """Return the command whose output would show it, else the name of the output."""
    for command in given.ros.commands:
        goal = given.ros.goal
        is_goal = kind == "goals" and goal is not None and command.of == goal.status
        if is_goal or (command.kind.name, command.target) == (kind, target):
            return command.line
    return f"{kind.replace('_', ' ')} {target}".strip()
