"""The stages of a report in blocks: those of one submission, or of one folder, belong together."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath

from msgspec import Struct

from lab3_usd.model.finding import Report, Severity, StageResult, Submission, Verdict
from lab3_usd.spec.lab import Lab

Stages = tuple[int, ...]


class Part(Struct, frozen=True):
    """Requirements met and asked of one graph or scene part."""

    name: str
    met: int
    asked: int


class Stage(Struct, frozen=True):
    """One stage on the page; `index` is its number on the page, `label` its short name."""

    index: int
    label: str
    title: str
    file: str
    result: StageResult
    parts: tuple[Part, ...] = ()

    def part(self, name: str) -> Part | None:
        """Return the requirements of one part, None where the checkpoint asks for none."""
        return next((part for part in self.parts if part.name == name), None)

    def count(self, severity: Severity) -> int:
        """Return how many findings of one severity the stage has."""
        return sum(each.severity == severity for each in self.result.findings)


class Block(Struct, frozen=True):
    """Stages that belong together: one submission, or the files that were given beside it."""

    id: str
    path: str
    stages: tuple[Stage, ...]
    submission: Submission | None = None

    @property
    def name(self) -> str:
        """The name to show: the only file, else the folder."""
        if self.submission is None and len(self.stages) == 1:
            return self.stages[0].file
        return PurePath(self.path).name or self.path

    @property
    def is_one_student(self) -> bool:
        """Whether the stages were saved one after the other: each is of another checkpoint."""
        numbered = all(stage.label == stage.result.checkpoint for stage in self.stages)
        return numbered and len(self.stages) > 1

    @property
    def is_linted(self) -> bool:
        """Whether no lab asks for anything here: the stages were judged without a checkpoint."""
        read = [each.result.checkpoint for each in self.stages]
        return bool(read) and self.submission is None and not any(read)

    @property
    def unit(self) -> str:
        """What a reader counts here."""
        return "stage" if self.is_linted else "checkpoint"

    @property
    def matrix(self) -> dict[str, tuple[Part | None, ...]]:
        """The parts by name, each with its requirements in every stage."""
        names = dict.fromkeys(part.name for stage in self.stages for part in stage.parts)
        return {name: tuple(stage.part(name) for stage in self.stages) for name in names}

    @property
    def passed(self) -> int:
        """How many of the stages pass."""
        return sum(stage.result.verdict == "pass" for stage in self.stages)

    @property
    def verdict(self) -> Verdict:
        """The worst that is said of a stage or of the submission."""
        verdicts = {stage.result.verdict for stage in self.stages}
        about = () if self.submission is None else self.submission.findings
        if "fail" in verdicts or any(finding.severity == "error" for finding in about):
            return "fail"
        return "unreadable" if "unreadable" in verdicts else "pass"

    def span(self, indexes: Sequence[int]) -> str:
        """Name some of the stages in short: `02-05, 08`, with a dash for all in between."""
        runs: list[list[Stage]] = []
        for stage in self.stages:
            if stage.index not in indexes:
                continue
            if runs and runs[-1][-1].index == stage.index - 1:
                runs[-1].append(stage)
            else:
                runs.append([stage])
        return ", ".join(_run(run) for run in runs)


def _run(stages: Sequence[Stage]) -> str:
    first, last = stages[0].label, stages[-1].label
    numbered = all(stage.label == stage.result.checkpoint for stage in stages)
    few = 2
    if not numbered or len(stages) <= few:
        return ", ".join(stage.label for stage in stages)
    return f"{first}\N{EN DASH}{last}"


def blocks(report: Report, lab: Lab, *, graded: bool = False) -> list[Block]:
    """Return a block for each submission with its stages, and one for the stages beside them.

    Stages keep the order of the report within their block, and are numbered over the page. Those
    that are graded are all of one submission, which is known by the student and not by a folder.
    """
    left = [*report.results]
    groups: list[tuple[str, list[StageResult], Submission | None]] = []
    for submission in report.submissions:
        inside = [result for result in left if graded or _is_below(result.path, submission.path)]
        left = [result for result in left if result not in inside]
        groups.append((submission.path, inside, submission))
    if left or not groups:
        groups.insert(0, (_common(left), left, None))
    found: list[Block] = []
    count = 0
    for path, results, about in groups:
        stages = tuple(_stages(results, path, lab, count))
        found.append(Block(f"b{len(found)}", path, stages, about))
        count += len(results)
    return found


def short_path(path: str, folder: str) -> str:
    """Return `path` as seen from `folder` where it lies below it, else as it is."""
    try:
        return Path(path).relative_to(folder).as_posix() if folder else path
    except ValueError:
        return path


def _is_below(path: str, folder: str) -> bool:
    return Path(path).is_relative_to(folder)


def _common(results: Sequence[StageResult]) -> str:
    folders = [str(Path(result.path).parent) for result in results]
    try:
        return os.path.commonpath(folders) if folders else ""
    except ValueError:  # absolute and relative ones, or two drives
        return ""


def _stages(results: Sequence[StageResult], folder: str, lab: Lab, first: int) -> Iterable[Stage]:
    times = Counter(result.checkpoint for result in results)
    for index, result in enumerate(results, start=first):
        file = short_path(result.path, folder)
        checkpoint = lab.checkpoints.get(result.checkpoint or "")
        yield Stage(
            index=index,
            label=result.checkpoint
            if result.checkpoint and times[result.checkpoint] == 1
            else file,
            title="" if checkpoint is None else checkpoint.title,
            file=file,
            result=result,
            parts=_parts(result),
        )


def _parts(result: StageResult) -> tuple[Part, ...]:
    asked: dict[str, list[bool]] = {}
    for requirement in result.requirements:
        asked.setdefault(requirement.group, []).append(requirement.met)
    return tuple(Part(name, sum(met), len(met)) for name, met in asked.items())
