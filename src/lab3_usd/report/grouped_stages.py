"""Groups the stages of a report, and lists each fault once with all stages that have it."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.data import program
from lab3_usd.model.finding import (
    SEVERITIES,
    Finding,
    Report,
    SectionKey,
    Severity,
    StageResult,
    Submission,
    Verdict,
    section_key,
)
from lab3_usd.report.entries import by_group, hidden_text, severity_counts

if TYPE_CHECKING:
    from lab3_usd.spec.lab import Lab

Stages = tuple[int, ...]


class Part(Struct, frozen=True):
    """Requirements met and asked of one graph or scene part, and those that were not judged."""

    name: str
    met: int
    asked: int
    not_judged: int = 0


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

    @property
    def counts(self) -> dict[Severity, int]:
        """How many findings the stage has, by severity."""
        return severity_counts(self.result.findings)


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
        checkpoints = [stage.result.checkpoint for stage in self.stages]
        return bool(checkpoints) and self.submission is None and not any(checkpoints)

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
    def counts(self) -> dict[Severity, int]:
        """How many findings there are by severity; one that is carried along counts each time."""
        findings = [finding for stage in self.stages for finding in stage.result.findings]
        findings += () if self.submission is None else self.submission.findings
        return severity_counts(findings)

    @property
    def hidden(self) -> str:
        """What the baseline hides, in words; '' for nothing."""
        findings = [finding for stage in self.stages for finding in stage.result.hidden]
        findings += () if self.submission is None else self.submission.hidden
        return hidden_text(severity_counts(findings))

    @property
    def verdict(self) -> Verdict:
        """The worst severity in a stage or the submission."""
        verdicts = {stage.result.verdict for stage in self.stages}
        findings = () if self.submission is None else self.submission.findings
        if "fail" in verdicts or any(finding.severity == "error" for finding in findings):
            return "fail"
        ranked: tuple[Verdict, ...] = ("unreadable", "not judged")
        return next((verdict for verdict in ranked if verdict in verdicts), "pass")

    def span(self, indexes: Collection[int]) -> str:
        """Name some of the stages in short: `02 to 05, 08`; all of them where some are files."""
        if not self.is_one_student:
            return ", ".join(stage.label for stage in self.stages if stage.index in indexes)
        places = (place for place, stage in enumerate(self.stages) if stage.index in indexes)
        return _spans(places, [stage.label for stage in self.stages])


def _spans(places: Iterable[int], labels: Sequence[str]) -> str:
    """Name some of the labels: `03`, `03, 04`, `02 to 05, 08`."""
    spans: list[str] = []
    few = 2
    for _, run in groupby(enumerate(places), key=lambda pair: pair[1] - pair[0]):
        names = [labels[place] for _, place in run]
        spans += names if len(names) <= few else [f"{names[0]} to {names[-1]}"]
    return ", ".join(spans)


def blocks(report: Report, lab: Lab | None, *, graded: bool = False) -> list[Block]:
    """Return a block for each submission with its stages, and one for the stages beside them.

    Stages keep the order of the report within their block, and are numbered over the page. Those
    that are graded are all of one submission, which is known by the student and not by a folder.
    """
    left = [*report.results]
    groups: list[tuple[str, list[StageResult], Submission | None]] = []
    for submission in report.submissions:
        inside = [
            result for result in left if graded or Path(result.path).is_relative_to(submission.path)
        ]
        left = [result for result in left if result not in inside]
        groups.append((submission.path, inside, submission))
    if left or not groups:
        groups.insert(0, (_common_folder(left), left, None))
    numbered: list[Block] = []
    count = 0
    for path, results, owner in groups:
        stages = tuple(_stages(results, path, lab, count))
        numbered.append(Block(f"b{len(numbered)}", path, stages, owner))
        count += len(results)
    return numbered


def short_path(path: str, folder: str) -> str:
    """Return `path` as seen from `folder` where it lies below it, else as it is."""
    try:
        return Path(path).relative_to(folder).as_posix() if folder else path
    except ValueError:
        return path


def _common_folder(results: Sequence[StageResult]) -> str:
    folders = [str(Path(result.path).parent) for result in results]
    try:
        return os.path.commonpath(folders) if folders else ""
    except ValueError:  # absolute and relative ones, or two drives
        return ""


def _stages(
    results: Sequence[StageResult], folder: str, lab: Lab | None, first: int
) -> Iterator[Stage]:
    times = Counter(result.checkpoint for result in results)
    for index, result in enumerate(results, start=first):
        file = short_path(result.path, folder)
        number = result.checkpoint or ""
        checkpoint = None if lab is None else lab.checkpoints.get(number)
        yield Stage(
            index=index,
            label=number if number and times[number] == 1 else file,
            title="" if checkpoint is None else checkpoint.title,
            file=file,
            result=result,
            parts=tuple(
                Part(
                    name,
                    met=sum(each.met for each in group if each.judged),
                    asked=len(group),
                    not_judged=sum(not each.judged for each in group),
                )
                for name, group in by_group(result.requirements).items()
            ),
        )


class Spot(Struct, frozen=True):
    """A place in a file: as it is shown, and the file itself with line and column."""

    text: str
    file: str
    line: int | None = None
    column: int | None = None


class ReportedFault(Struct, frozen=True):
    """A finding, and all the stages that have it.

    A fault that is carried along from file to file is one fault: `finding` is that of the first.
    `spots` are its places in the files. `is_cause` says that other
    faults follow from it: something that the stage refers to was not opened.
    """

    id: str
    finding: Finding
    stages: Stages
    spots: tuple[Spot, ...]
    is_cause: bool = False


def faults(block: Block, *, graded: bool = False) -> list[ReportedFault]:
    """Return the different faults of a block: by severity, then as the handout has its sections.

    Where they cost points, what was not opened comes before what is missing for it.
    """
    findings = [
        (stage.index, finding) for stage in block.stages for finding in stage.result.findings
    ]
    if block.submission is not None:
        findings += [(-1, finding) for finding in block.submission.findings]  # of no stage
    occurrences: dict[Finding, list[tuple[int, Finding]]] = {}
    for index, finding in findings:
        # Where it stands differs from file to file, and so does what else it concerns.
        key = replace(finding, layer=None, line=None, column=None, related=())
        occurrences.setdefault(key, []).append((index, finding))
    causes = set(_causes(occurrences)) if graded else set()

    def order(finding: Finding) -> tuple[bool, int, SectionKey]:
        severity = SEVERITIES.index(finding.severity)
        return finding not in causes, severity, section_key(finding.handout)

    ordered: list[ReportedFault] = []
    for key in sorted(occurrences, key=order):
        same = occurrences[key]
        first = same[0][1]
        related = max((finding.related for _, finding in same), key=len)
        spots = {spot.text: spot for _, finding in same for spot in _spots(finding, block)}
        ordered.append(
            ReportedFault(
                id=f"{block.id}-f{len(ordered) + 1}",
                finding=replace(first, related=related),
                stages=tuple(dict.fromkeys(index for index, _ in same if index >= 0)),
                spots=tuple(spot for spot in spots.values() if spot.text != first.prim),
                is_cause=key in causes,
            )
        )
    return ordered


def _causes(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield what was not opened: of assets, those where something is wrong at or below the prim."""
    wrong = sorted(f"{finding.prim}/" for finding in findings if finding.severity == "error")
    for finding in findings:
        below = f"{finding.prim}/"
        at = bisect_left(wrong, below)
        is_wrong = at < len(wrong) and wrong[at].startswith(below)
        if finding.unopened == "file" or (finding.unopened == "asset" and is_wrong):
            yield finding


def _spots(finding: Finding, block: Block) -> Iterator[Spot]:
    """Yield where a finding stands in a file, written as editors take it, if it does."""
    if not finding.layer:
        return
    line, column = finding.line, finding.column if finding.line else None
    numbers = (str(number) for number in (line, column) if number is not None)
    text = ":".join([short_path(finding.layer, block.path), *numbers])
    yield Spot(text, finding.layer, line, column)


def to_come_text(to_come: Collection[str], checkpoints: Sequence[str]) -> str:
    """Say which checkpoints have no stage: `01: no stage; 03 to 08: not begun`."""
    places = [place for place, number in enumerate(checkpoints) if number in to_come]
    begun = max((p for p in range(len(checkpoints)) if p not in places), default=-1)
    skipped = _spans([place for place in places if place < begun], checkpoints)
    ahead = _spans([place for place in places if place > begun], checkpoints)
    texts = (skipped and f"{skipped}: no stage", ahead and f"{ahead}: not begun")
    return "; ".join(filter(None, texts))


def next_step(
    submission: Submission, verdict: Verdict, lab: Lab, lab_words: tuple[str, ...] = ()
) -> str:
    """Say what comes next in a folder that is worked on: a part of the handout, or handing in.

    `lab_words` are those with which the command line named the lab.
    """
    numbers = list(lab.checkpoints)
    begun = [number for number in numbers if number not in submission.to_come]
    following = numbers[numbers.index(begun[-1]) + 1 :] if begun else numbers
    first = "repair the errors; then " if verdict in {"fail", "unreadable"} else ""
    if not following:
        from lab3_usd.installation import command_line

        command = command_line(program(), *lab_words, "check", submission.path, "--submission")
        return f"{first}{command} says what else is handed in"
    checkpoint = lab.checkpoints[following[0]]
    added = ", ".join((*checkpoint.new_sensors, *checkpoint.new))
    adds = f" adds {added}" if added else " changes no graph"
    text = f"{first}Part {checkpoint.part} of the handout ({checkpoint.title}){adds}"
    ending = lab.submission.stages.endings[0]
    return f"{text}; save the stage as {checkpoint.file}{ending}"
