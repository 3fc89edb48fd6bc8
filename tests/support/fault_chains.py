"""Chains of stages: a right one, then one mistake more in each."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from failing_students import Mistake, mistakes
from grade_files import LAB, stage, starter
from pxr import Sdf, Usd

from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.rubric import Rubric, load_rubric
from lab3_usd.grade.scoring import Grade, StageFacts, SubmissionFacts, facts_of, grade_facts
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.pipeline.starter_comparison import Starter, against_starter, open_starter

LONGEST = 4
TRIED = 60  # mistakes for one chain


@cache
def _known() -> tuple[Mistake, ...]:
    return tuple(mistake for mistake in mistakes() if mistake.changes)


@cache
def opened_starter() -> Starter:
    return open_starter(starter(), LAB)


@cache
def rubric() -> Rubric:
    return load_rubric(None, LAB)


def chain(number: int, checkpoint: str) -> Iterator[tuple[str, Grade]]:
    """Yield the grades of a submission as its stage of a checkpoint gets one mistake after another.

    The same ones for the same number; first without any. What is no fault by itself is left out.
    So is what changes the same as another, which it could repair, and what leaves nothing of
    another: the mistakes of a stage are then not one more. Where little is left to break, a chain
    is shorter.
    """
    chance = random.Random(f"{number} {checkpoint}")  # noqa: S311 - no secret
    made: list[Mistake] = []
    yield "right", grade_with(checkpoint)
    for mistake in chance.sample(_known(), TRIED):
        if _stands_beside(mistake, made, checkpoint) and judged(checkpoint, mistake).faults:
            made.append(mistake)
            yield mistake.name, grade_with(checkpoint, *made)
        if len(made) == LONGEST:
            return


def _stands_beside(mistake: Mistake, made: list[Mistake], checkpoint: str) -> bool:
    """Whether a stage with a mistake more has all of them, in whatever order they are made."""
    lines = _lines(checkpoint, *made, mistake)
    without = ([other for other in made if other is not one] for one in made)
    return (
        lines != _lines(checkpoint, *made)
        and lines == _lines(checkpoint, mistake, *made)
        and all(lines != _lines(checkpoint, *others, mistake) for others in without)
    )


def _lines(checkpoint: str, *made: Mistake) -> list[str]:
    return sorted(_broken(checkpoint, *made)[1].splitlines())


@lru_cache(200)
def _broken(checkpoint: str, *made: Mistake) -> tuple[Sdf.Layer, str]:
    """Return the right stage of a checkpoint after mistakes, to be copied, and its text."""
    if not made:
        layer = Sdf.Layer.FindOrOpen(str(stage(checkpoint)))
        return layer, layer.ExportToString()
    before, text = _broken(checkpoint, *made[:-1])
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(before)
    return layer, made[-1].made_in(Usd.Stage.Open(layer), text)


@cache
def grade_with(checkpoint: str, *made: Mistake) -> Grade:
    """Return the grade of a submission of right stages, with mistakes in that of a checkpoint."""
    stages = [StageFacts(other, other, readable=True) for other in LAB.checkpoints]
    stages[[*LAB.checkpoints].index(checkpoint)] = played(checkpoint, *made)
    return grade_facts(rubric(), SubmissionFacts(tuple(stages)))


@cache
def judged(checkpoint: str, *made: Mistake) -> StageFacts:
    """Return what a grade needs to know of a stage with mistakes, without a dry run."""
    with _judged(checkpoint, made) as facts:
        return facts.stages[0]


def played(checkpoint: str, *made: Mistake) -> StageFacts:
    """Return what a grade needs to know of a stage with mistakes."""
    with _judged(checkpoint, made) as facts:
        return with_dry_runs(facts, LAB, {}).stages[0]


@contextmanager
def _judged(checkpoint: str, made: Sequence[Mistake]) -> Iterator[SubmissionFacts]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / stage(checkpoint).name
        path.write_text(_broken(checkpoint, *made)[1])
        result = against_starter(check_stage(path, checkpoint, LAB), opened_starter(), LAB)
        yield facts_of([result], rubric().required)


def drops(number: int, checkpoint: str) -> list[str]:
    """Return where a chain does not hold: a mistake more earned more."""
    found = []
    names: list[str] = []
    last: Grade | None = None
    for name, grade in chain(number, checkpoint):
        names.append(name)
        if last is not None and (
            grade.earned > last.earned or (grade.percent or 0) > (last.percent or 0)
        ):
            steps = " + ".join(names)
            items = [
                f"{after.id} {before.earned:g} -> {after.earned:g}"
                for before, after in zip(last.items, grade.items, strict=True)
                if after.earned > before.earned
            ]
            found.append(f"{checkpoint}: {steps}: {', '.join(items)}")
        last = grade
    return found
