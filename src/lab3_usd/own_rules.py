"""What custom rules are written with, and how they are tested.

from lab3_usd.own_rules import Problem, Subject, own_rule

@own_rule("ACME01", "no-graphs", severity="warning")
def no_graphs(subject: Subject) -> Iterator[Problem]:
    \"\"\"The stage has no Action Graph.\"\"\"
    if not any(subject.graphs()):
        yield Problem("/", "there is no Action Graph")
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from lab3_usd.check.lint import lint
from lab3_usd.check.match.rule_inputs import LintSubject as Subject
from lab3_usd.check.own_rules import own_rule
from lab3_usd.errors import SpecError
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.frames import heard_trees
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.fix.repairing import repair_open_stage
from lab3_usd.model.changes import (
    ApplySchema,
    ClearValue,
    Connect,
    Edit,
    RemovePrim,
    RemoveSchema,
    Retarget,
    SetValue,
    repair_by,
)
from lab3_usd.model.finding import Problem
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.yaml_file import as_record, read_yaml

__all__ = [
    "ApplySchema",
    "Connect",
    "Problem",
    "RemovePrim",
    "Retarget",
    "RuleCase",
    "SetValue",
    "Subject",
    "effective_value",
    "endpoints",
    "heard_trees",
    "own_rule",
    "rule_cases",
]


class RuleCase(Struct, frozen=True):
    """A stage, the edits made in it, and what one rule should find then: `PRIM PROPERTY` each."""

    rule: str
    name: str
    stage: Path
    edits: tuple[Edit, ...]
    expect: tuple[str, ...]

    def __str__(self) -> str:
        """Name the case."""
        return f"{self.rule} {self.name}"

    def found(self) -> tuple[str, ...]:
        """Return what the rule finds, as `expect` has it.

        Raises:
            RuntimeError: the rule fails itself.
            StageError: the stage cannot be opened.
        """
        stage = open_stage(self.stage)
        try:
            repair_open_stage(repair_by(self.edits), stage)
            model = read_model(stage, lint_platform(), str(self.stage))
            results = lint(Subject(model))
        finally:
            stage.Reload()  # the layers are shared by all who open them
        for crash in results.crashes:
            if crash.rule == self.rule:
                raise RuntimeError(f"{self.rule}: {crash.error}")
        return tuple(
            sorted(
                f"{finding.prim} {finding.property or ''}".strip()
                for finding in results.findings
                if finding.rule == self.rule
            )
        )


_Step = dict[str, str | list[Any]]  # of one verb and its arguments
_Steps = tuple[_Step, ...]


class _Trigger(Struct, frozen=True, forbid_unknown_fields=True):
    """A way to trigger the rule."""

    expect: tuple[str, ...]
    steps: _Steps = field(name="break")


class _Cases(_Trigger, frozen=True, forbid_unknown_fields=True):
    """A file of cases: what triggers the rule, what does not (`clear`), and more of both."""

    stage: str
    clear: _Steps
    more: dict[str, _Trigger] = {}
    alike: dict[str, _Steps] = {}


def _set(place: str, value: Any) -> Edit:
    made = tuple(value) if isinstance(value, list) else value
    kinds = {bool: "bool", int: "int", float: "double", str: "token"}
    return SetValue(*_parts(place), kinds.get(type(made), "token[]"), made)


def _parts(place: str) -> tuple[str, str]:
    prim, _, name = place.partition(".")
    return prim, name


_VERBS: dict[str, Callable[..., Edit]] = {
    "set": _set,
    "clear": lambda place: ClearValue(*_parts(place)),
    "connect": lambda place, *sources: Connect(*_parts(place), "token", sources),
    "disconnect": lambda place: Connect(*_parts(place), "token"),
    "targets": lambda place, *prims: Retarget(*_parts(place), prims),
    "schema": ApplySchema,
    "schema off": RemoveSchema,
    "remove": RemovePrim,
}


def rule_cases(folder: Path) -> list[RuleCase]:
    """Return the cases of the rules that have a YAML file here, named as they are (`ACME01.yaml`).

    A file names a `stage`, relative to itself. `break` are steps, and `expect` is what the rule
    finds then: `PRIM PROPERTY` each. After the steps of `clear` it finds nothing. `more` has
    further pairs of `break` and `expect`, `alike` further steps after which nothing is found, each
    by a name. A step is `VERB: PLACE` or `VERB: [PLACE, ARGUMENTS]`: `set` a value, `clear` it,
    `connect` to sources, `disconnect`, let a relationship have `targets`, apply a `schema` or take
    it off (`schema off`), `remove` a prim.

    Raises:
        SpecError: a file is no such file.
    """
    return [case for file in sorted(folder.glob("*.yaml")) for case in _cases_in(file)]


def _cases_in(file: Path) -> Iterator[RuleCase]:
    cases = as_record(read_yaml(file), _Cases, file.name)
    triggers = {"break": _Trigger(expect=cases.expect, steps=cases.steps), **cases.more}
    further = {"clear": cases.clear, **cases.alike}
    all_cases = [(name, case.steps, case.expect) for name, case in triggers.items()]
    all_cases += [(name, steps, ()) for name, steps in further.items()]
    for name, steps, expect in all_cases:
        edits = tuple(_edit(step, f"{file.name}: {name}") for step in steps)
        yield RuleCase(file.stem, name, file.parent / cases.stage, edits, tuple(sorted(expect)))


def _edit(step: _Step, where: str) -> Edit:
    for verb, arguments in step.items():
        if len(step) != 1 or verb not in _VERBS:
            break
        given = arguments if isinstance(arguments, list) else [arguments]
        try:
            return _VERBS[verb](*given)
        except (TypeError, AttributeError) as error:
            raise SpecError(f"{where}: {verb} does not take {given}") from error
    raise SpecError(f"{where}: {', '.join(step)} is not a step; known are {', '.join(_VERBS)}")
