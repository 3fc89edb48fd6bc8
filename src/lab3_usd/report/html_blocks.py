"""The stages of a report as the page groups them: by submission, with short names."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from lab3_usd.check.finding import Report, StageResult, Submission
from lab3_usd.report.html_model import Block, Part, Stage
from lab3_usd.spec.spec import Lab


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
        checkpoint = lab.checkpoints.get(result.checkpoint)
        yield Stage(
            index=index,
            label=result.checkpoint if times[result.checkpoint] == 1 else file,
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
