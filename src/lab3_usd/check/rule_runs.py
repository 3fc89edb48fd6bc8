"""Runs rules over one subject, and keeps what they found, what was not judged, and which failed."""

from __future__ import annotations

import re
import traceback
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.manual import in_words_of
from lab3_usd.check.registry import SUPPLIED, TF, Rule, Scope, holds_without_lab, rules_of
from lab3_usd.errors import StageError
from lab3_usd.model.changes import repair_by
from lab3_usd.model.finding import Crash, Finding, NodeCoverage, NotJudged, Problem, Requirement
from lab3_usd.model.stage import StageModel, once_per_stage

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Lab

PACKAGE = __name__.partition(".")[0]


class RuleResults(Struct, frozen=True):
    """What rules found, which of them failed themselves, and what they could not judge.

    `gaps` are what matters of that, for a whole stage. `left_open` are the findings that rest on a
    missing asset. `requirements` are what a checkpoint asks of a stage, `coverage` counts the
    nodes of one that is judged without a spec.
    """

    findings: tuple[Finding, ...] = ()
    crashes: tuple[Crash, ...] = ()
    not_judged: tuple[NotJudged, ...] = ()
    gaps: tuple[str, ...] = ()
    left_open: tuple[Finding, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    coverage: NodeCoverage | None = None


def run_family(scope: Scope, family: str, subject: Any, lab: Lab | None) -> RuleResults:
    """Run every rule of a family in the order of their ids."""
    return run_rules(rules_of(scope, family), (subject,), lab)


def run_rule(rule: Rule, subject: Any, lab: Lab | None) -> RuleResults:
    """Run one rule over its subject."""
    return run_rules((rule,), (subject,), lab)


def run_rules(rules: Iterable[Rule], subjects: Collection[Any], lab: Lab | None) -> RuleResults:
    """Run each rule over all subjects; a rule that fails itself is a crash, never a pass.

    A problem that rests on what a missing asset would say is no finding: it is not judged.
    `lab` gives sections and names for what a rule says; None for a stage of no lab.

    Raises:
        StageError: a file turns out to be damaged, which is no fault of the rule.
    """
    findings: list[Finding] = []
    left_open: list[Finding] = []
    crashes: list[Crash] = []
    # A site that a rule comes to by several ways is not judged once.
    not_judged: dict[NotJudged, None] = {}
    for rule in rules:
        for subject in subjects:
            try:
                for yielded in problems_of(rule, subject):
                    problem = _as_judged(yielded, rule, subject)
                    asset = problem.rests_on
                    kept = findings if asset is None else left_open
                    kept.append(finding_of(rule, problem, lab))
                    if asset is not None:
                        entry = NotJudged(rule.id, problem.prim, problem.property, asset.asset)
                        not_judged[entry] = None
            except StageError:  # noqa: PERF203 - one rule that fails leaves the others to run
                raise
            except Exception as error:  # noqa: BLE001 - whatever a rule raises is its crash
                crashes.append(Crash(rule.id, _where_it_failed(error)))
    return RuleResults(
        tuple(findings), tuple(crashes), tuple(not_judged), left_open=tuple(left_open)
    )


def _where_it_failed(error: Exception) -> str:
    """Say what a rule raised, and at which line of it: its author has to find that."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    own = [frame for frame in frames if PACKAGE not in Path(frame.filename).parts] or frames
    place = f", at {Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""
    return f"{type(error).__name__}: {error}{place}"


def _as_judged(problem: Problem, rule: Rule, subject: Any) -> Problem:
    """Return a problem with what a lab asks for there, and in the words of its file."""
    if holds_without_lab(rule):
        from lab3_usd.check.demands import with_demand

        problem = with_demand(problem, subject)
    stage = getattr(subject, "stage", None)
    return _as_written(problem, stage) if isinstance(stage, StageModel) else problem


def problems_of(rule: Rule, subject: Any) -> Iterator[Problem]:
    """Return what a rule finds; one about robots looks at each robot of a stage.

    One about the world around a robot looks at a stage without robots as well.
    """
    if rule.scope == "robot" or (rule.scope == "world" and subject.robots):
        return chain.from_iterable(map(rule.check, subject.robots))
    if rule.scope == "world":
        return rule.check(subject.without_robot)
    return rule.check(subject)


def merge_results(results: Iterable[RuleResults]) -> RuleResults:
    """Return everything that several runs found, in their order."""
    runs = list(results)
    return RuleResults(
        tuple(finding for run in runs for finding in run.findings),
        tuple(crash for run in runs for crash in run.crashes),
        tuple(entry for run in runs for entry in run.not_judged),
    )


def _part_of(rule: Rule, problem: Problem, lab: Lab | None) -> tuple[str, ...]:
    """Return the part that the rules of a scope are about, wherever their findings stand."""
    if rule.scope == "starter":
        from lab3_usd.spec.scene import SCENE_GROUP

        return (SCENE_GROUP if lab is None else lab.scene.group_of(problem.prim or "/"),)
    return (TF,) if rule.scope == "frames" else ()


def finding_of(rule: Rule, problem: Problem, lab: Lab | None) -> Finding:
    """Stamp the rule's id, name and severity on what it yielded."""
    section = None if lab is None else lab.handout.rules.get(rule.id)
    severity = problem.severity or rule.severity
    repair = repair_by(problem.fix) if problem.fix and severity != "note" else None
    if repair is not None and problem.likely:
        repair = replace(repair, safe=False)
    return Finding(
        rule=rule.id,
        name=rule.name,
        severity=severity,
        prim=problem.prim or "/",
        property=problem.property,
        message=problem.message,
        expected=problem.expected,
        actual=problem.actual,
        handout=problem.handout or section,
        hint=problem.hint or in_words_of(lab, rule.hint) or None,
        related=problem.related,
        fix=repair,
        unopened=problem.unopened,
        unmet=problem.unmet,
        absent=problem.absent,
        costs=problem.costs or _part_of(rule, problem, lab),
        assumes=problem.assumes,
        covers=problem.covers,
        if_supplied=problem.if_supplied,
        supplied=rule.family in SUPPLIED,
        counted=rule.counted,
        identity=problem.identity,
        span=problem.span,
        comes_first=problem.comes_first,
    )


def _as_written(problem: Problem, stage: StageModel) -> Problem:
    """Return a problem with the names that its file has for ports, as another release calls them.

    They stand in its place, its words and its edits.
    """
    written = _written_ports(stage)
    if not written:
        return problem
    names = written.get(problem.prim, {})
    message, hint = problem.message, problem.hint
    for name, other in names.items():
        message = message.replace(name, other)
        if hint is not None:
            hint = re.sub(rf"\b{name.partition(':')[2]}\b", other.partition(":")[2], hint)
    return replace(
        problem,
        message=message,
        hint=hint,
        property=names.get(problem.property or "", problem.property),
        fix=tuple(_edit_as_written(edit, written) for edit in problem.fix),
    )


@once_per_stage
def _written_ports(stage: StageModel) -> dict[str, Mapping[str, str]]:
    """Return the names that the file has for ports, by node, of those that have such names."""
    return {node.path: node.written_ports for node in stage.nodes() if node.written_ports}


def _edit_as_written(edit: Any, written: Mapping[str, Mapping[str, str]]) -> Any:
    names = written.get(edit.prim, {})
    changes: dict[str, Any] = {}
    if getattr(edit, "property", None) in names:
        changes["property"] = names[edit.property]
    if getattr(edit, "to", None) in names:
        changes["to"] = names[edit.to]
    if getattr(edit, "sources", ()):
        ends = (path.rpartition(".") for path in edit.sources)
        changes["sources"] = tuple(
            f"{prim}.{written.get(prim, {}).get(port, port)}" for prim, _, port in ends
        )
    return replace(edit, **changes) if changes else edit
