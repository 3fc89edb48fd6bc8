"""Chains of stages: a right one, then one mistake more in each."""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from failing_class import Mistake, mistakes
from grade_files import LAB, stage, starter
from pxr import Sdf, Usd

from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.rubric import Rubric, load_rubric
from lab3_usd.grade.scoring import Grade, StageFacts, SubmissionFacts, facts_of, grade_facts
from lab3_usd.judge.stage import check_stage
from lab3_usd.judge.starter import Starter, against_starter, open_starter

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
    yield "right", _graded_alone(None, checkpoint)
    for mistake in chance.sample(_known(), TRIED):
        layer = stage_with(checkpoint, *made, mistake)
        if not made and _is_fault(mistake, checkpoint):
            yield mistake.name, _graded_alone(mistake, checkpoint)
        elif _stands_beside(mistake, made, layer, checkpoint) and _is_fault(mistake, checkpoint):
            yield mistake.name, grade_with(layer, checkpoint)
        else:
            continue
        made.append(mistake)
        if len(made) == LONGEST:
            return


def _stands_beside(
    mistake: Mistake, made: list[Mistake], layer: Sdf.Layer, checkpoint: str
) -> bool:
    """Whether a stage with a mistake more has all of them, in whatever order they are made."""
    lines = _lines(layer)
    without = ([other for other in made if other is not one] for one in made)
    return (
        lines != _lines(stage_with(checkpoint, *made))
        and lines == _lines(stage_with(checkpoint, mistake, *made))
        and all(lines != _lines(stage_with(checkpoint, *others, mistake)) for others in without)
    )


@cache
def _is_fault(mistake: Mistake, checkpoint: str) -> bool:
    return bool(facts_in(stage_with(checkpoint, mistake), checkpoint, play=False).faults)


@cache
def _graded_alone(mistake: Mistake | None, checkpoint: str) -> Grade:
    """Return the grade of a stage with at most one mistake."""
    return grade_with(stage_with(checkpoint, *filter(None, [mistake])), checkpoint)


def stage_with(checkpoint: str, *made: Mistake) -> Sdf.Layer:
    """Return the right stage of a checkpoint after mistakes."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(stage(checkpoint))))
    for mistake in made:
        mistake.make(Usd.Stage.Open(layer))
    return layer


def _lines(layer: Sdf.Layer) -> list[str]:
    return sorted(layer.ExportToString().splitlines())


def grade_with(layer: Sdf.Layer, checkpoint: str) -> Grade:
    """Return the grade of a submission of right stages, with this one of a checkpoint."""
    stages = [StageFacts(other, other, readable=True) for other in LAB.checkpoints]
    stages[[*LAB.checkpoints].index(checkpoint)] = facts_in(layer, checkpoint, play=True)
    return grade_facts(rubric(), SubmissionFacts(tuple(stages)))


def facts_in(layer: Sdf.Layer, checkpoint: str, *, play: bool) -> StageFacts:
    with TemporaryDirectory() as folder:
        path = Path(folder) / stage(checkpoint).name
        layer.Export(str(path))
        result = against_starter(check_stage(path, checkpoint, LAB), opened_starter(), LAB)
        facts = facts_of([result], rubric().required)
        (only,) = with_dry_runs(facts, LAB, {}).stages if play else facts.stages
    return only


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
