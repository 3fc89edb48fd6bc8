"""Stages to ask several commands of: the lab's and their faults, other robots, cases of rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import quick_yaml
from agreement import Contradiction, NoAnswerError, answers, answers_of, contradictions
from breaking import broken, correct_stage, the_lab
from fault_stages import STAGES
from linting import broken_robot
from menu_graphs import MENUS, with_menus
from places import REPOSITORY, SHARED, TESTS
from pxr import Usd
from robot_kinds import KINDS
from two_judges import all_faults

CHECKPOINT = "05"
Make = Callable[[], Usd.Stage]


def _table(name: str) -> dict[str, Any]:
    table: dict[str, Any] = quick_yaml.load((TESTS / f"{name}.yaml").read_text(encoding="utf-8"))
    return table


CONTRADICTORY = _table("contradictions")


class Subject(NamedTuple):
    """A stage: made, or a file; without a checkpoint it is not the lab's."""

    name: str
    make: Make | Path
    checkpoint: str = ""


def contradictions_of(subject: Subject, drive: str = "") -> list[Contradiction]:
    """Ask all commands about one stage, whose robots are driven as `drive` says."""
    make, checkpoint = subject.make, subject.checkpoint
    try:
        if isinstance(make, Path):
            said = answers(make, checkpoint, drive)
        else:
            said = answers_of(make(), checkpoint, drive)
    except NoAnswerError as error:
        return [Contradiction("crashes", str(error), subject.name)]
    return contradictions(said, subject.name)


@cache
def all_subjects() -> tuple[Subject, ...]:
    return (
        *_of_the_lab(),
        *_of_rules(),
        *_of_others(),
        *_files(),
    )


def once_contradictory() -> tuple[Subject, ...]:
    """Return the stages of tests/contradictions.yaml."""
    return tuple(
        Subject(name, _case(case), case.get("checkpoint", ""))
        for name, case in CONTRADICTORY["stages"].items()
    )


def _case(case: dict[str, Any]) -> Make | Path:
    if "file" in case:
        return REPOSITORY / case["file"]
    if "checkpoint" in case:
        return partial(broken, case["checkpoint"], case["steps"])
    return partial(broken_robot, case["robot"], case["steps"])


def _of_the_lab() -> Iterator[Subject]:
    for number in the_lab().checkpoints:
        yield Subject(f"built {number}", partial(correct_stage, number), number)
    for kind, (change, _) in STAGES.items():
        yield Subject(f"fault stage: {kind}", partial(_changed, change), CHECKPOINT)
    for fault in all_faults():
        yield Subject(f"sweep: {fault.name}", partial(_changed, fault.break_it), CHECKPOINT)


def _changed(change: Callable[[Usd.Stage], None]) -> Usd.Stage:
    stage = correct_stage(CHECKPOINT)
    change(stage)
    return stage


def _cases(folder: str) -> Iterator[tuple[str, Any, Any, list[dict[str, Any]]]]:
    """Yield the steps of the case files: what triggers a rule, and what only looks like it."""
    for path in sorted((TESTS / folder).glob("*.yaml")):
        case = quick_yaml.load(path.read_text(encoding="utf-8"))
        for name, entry in {"": case, **case.get("more", {})}.items():
            yield f"{path.stem} {name}".strip(), case, entry, entry["break"]
        for name, entry in {"clear": case["clear"], **case.get("alike", {})}.items():
            known = entry if isinstance(entry, dict) else {"steps": entry}
            yield f"{path.stem} {name}", case, known, known["steps"]


def _of_rules() -> Iterator[Subject]:
    for name, case, entry, steps in _cases("cases"):
        checkpoint = entry.get("checkpoint", case.get("checkpoint", CHECKPOINT))
        yield Subject(f"case: {name}", partial(broken, checkpoint, steps), checkpoint)
    for name, case, entry, steps in _cases("lint_cases"):
        robot = entry.get("robot", case.get("robot", "rover"))
        yield Subject(f"lint case: {name}", partial(broken_robot, robot, steps))


def _of_others() -> Iterator[Subject]:
    for name, make in KINDS.items():
        yield Subject(f"robot: {name}", make)
    for name, seed in _table("robot_faults").items():
        make = partial(broken_robot, seed["robot"], seed["break"])
        yield Subject(f"fault: {name}", make)
    for name in MENUS:
        yield Subject(f"menu: {name}", partial(with_menus, name))
    for name, case in _table("lint_legal").items():
        known = case if isinstance(case, dict) else {"steps": case}
        make = partial(broken_robot, known.get("robot", "rover"), known["steps"])
        yield Subject(f"legal: {name}", make)
    for name, robots in _table("lint_faults").items():
        for robot, seed in robots.items():
            yield Subject(f"fault: {name} ({robot})", partial(broken_robot, robot, seed["break"]))


def _files() -> Iterator[Subject]:
    for path in sorted((REPOSITORY / "docs" / "examples").glob("*.usd*")):
        yield Subject(f"example: {path.name}", path)
    for path in sorted((SHARED / "corpus").rglob("*.usd*")):
        if "payloads" not in path.parts:
            yield Subject(f"corpus: {path.stem}", path)
