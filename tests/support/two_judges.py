"""Every single fault of a stage before two judges: the rules, and the robot in a dry run."""

from __future__ import annotations

import atexit
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import quick_yaml
from breaking import correct_stage, judged, the_lab
from dry_runs import differences, driven, faults
from msgspec import Struct, convert
from places import REPOSITORY, TESTS
from pxr import Usd
from random_edits import edit
from sabotage import Fault, graph_faults

from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.pipeline.starter_comparison import against_starter, open_starter
from lab3_usd.sim.execution.drive import fixed_drive
from lab3_usd.sim.execution.recording import Recording
from lab3_usd.stage.write.starter import build_starter

sys.path.insert(0, str(REPOSITORY / "benchmarks"))

from sweep import scene_faults

TABLE = TESTS / "disagreements.yaml"


class Row(Struct, frozen=True):
    """A difference that is known: which faults, and why the judges see them otherwise."""

    title: str
    faults: tuple[str, ...]  # regular expressions for whole names
    happens: str
    reason: str

    def holds(self, fault: str) -> bool:
        return any(re.fullmatch(each, fault) for each in self.faults)


@cache
def table() -> dict[str, object]:
    content: dict[str, object] = quick_yaml.load(TABLE.read_text(encoding="utf-8"))
    return content


@cache
def known_rows(section: str = "disagreements") -> list[Row]:
    return convert(table()[section], list[Row])


def idle_rows(names: Iterable[str], section: str = "disagreements") -> list[str]:
    """Return the rows that are about none of these faults."""
    known = list(names)
    return [row.title for row in known_rows(section) if not any(map(row.holds, known))]


DRIVE = fixed_drive()
CHECKPOINT = "05"


class Verdicts(Struct, frozen=True):
    """What both judges say of one fault."""

    fault: str
    rules: tuple[str, ...]  # ids of errors and warnings
    robot: tuple[str, ...]  # checks of the dry run that fail
    says: str

    @property
    def agree(self) -> bool:
        """Whether both find something."""
        return bool(self.rules) == bool(self.robot)


def all_faults() -> list[Fault]:
    lab = the_lab()
    asked = lab.checkpoints[CHECKPOINT]
    return [*graph_faults(lab, asked), *scene_faults(asked)]


def verdicts(fault: Fault) -> Verdicts:
    stage = correct_stage(CHECKPOINT)
    fault.break_it(stage)
    found = judged(stage, CHECKPOINT).findings
    rules = tuple(each.rule for each in found if each.severity != "note")
    bad = faults(driven(stage, DRIVE))
    return Verdicts(
        fault.name,
        rules,
        tuple(each.name for each in bad),
        "; ".join(each.message for each in bad),
    )


def crosscheck(every: int = 1, start: int = 0) -> Iterator[Verdicts]:
    for fault in all_faults()[start::every]:
        yield verdicts(fault)


def wrong(found: Sequence[Verdicts]) -> list[str]:
    """Say what the table does not explain, and what it explains though the judges agree."""
    rows = known_rows()
    said = []
    for each in found:
        row = next((row for row in rows if row.holds(each.fault)), None)
        if each.robot and not each.rules:
            said.append(f"{each.fault}: the rules are silent, the robot: {each.says}")
        elif not each.agree and row is None:
            said.append(f"{each.fault}: {each.rules} say so, the robot does not")
        elif each.agree and row is not None:
            said.append(f"{each.fault}: both see it ({each.says}), the table says otherwise")
    return said


class Silence(Struct, frozen=True):
    """An edit by chance: what it changes of what the robot does, and what the rules say of it."""

    edit: str
    changes: tuple[str, ...]
    rules: tuple[str, ...]

    @property
    def is_silent(self) -> bool:
        """Whether the robot does something else and nobody says so."""
        return bool(self.changes) and not self.rules


@cache
def _unedited() -> Recording:
    return driven(correct_stage(CHECKPOINT), DRIVE).recording


@cache
def _starter() -> Path:
    folder = TemporaryDirectory()
    atexit.register(folder.cleanup)
    path = Path(folder.name) / "starter.usda"
    build_starter(path)
    return path


def silent(number: int) -> Silence:
    """Make the edit of this number and ask both judges; the rules get the starter as well."""
    stage = correct_stage(CHECKPOINT)
    edited = edit(stage, number)
    changes = differences(_unedited(), driven(stage, DRIVE).recording)
    told = list(judged(stage, CHECKPOINT).findings)
    if changes and not any(each.severity != "note" for each in told):
        told += _against_starter(stage, number)
    rules = tuple(each.rule for each in told if each.severity != "note")
    return Silence(f"{number} {edited.kind}: {edited.text}", tuple(changes), rules)


def _against_starter(stage: Usd.Stage, number: int) -> tuple[Finding, ...]:
    path = _starter().with_name(f"edited-{number}.usda")
    stage.GetRootLayer().Export(str(path))
    starter = open_starter(_starter(), the_lab())
    result = against_starter(check_stage(path, CHECKPOINT), starter, the_lab())
    path.unlink()
    assert result.crashes == ()
    return result.findings


def unexplained(edits: Sequence[Silence]) -> list[str]:
    """Say which edits change what the robot does and are told by nobody."""
    return [
        f"{each.edit}: silent, though {'; '.join(each.changes[:3])}"
        for each in edits
        if each.is_silent and not any(re.search(pattern, each.edit) for pattern in known_silence())
    ]


def idle_silence(edits: Sequence[Silence]) -> list[str]:
    """Return the patterns of the table that no silent edit has."""
    quiet = [each.edit for each in edits if each.is_silent]
    return [
        pattern
        for pattern in known_silence()
        if not any(re.search(pattern, each) for each in quiet)
    ]


def known_silence() -> list[str]:
    return list(convert(table()["silent_edits"] or {}, dict[str, str]))
