"""The steps of `lab3 lab new`: describe a stage, write the folder, check the stage by it."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.data import data_folder
from lab3_usd.describe.description import describe_lab
from lab3_usd.describe.folder import refuse_existing_folder, write_folder
from lab3_usd.errors import EXIT_FOUND, UsageError
from lab3_usd.judge.stage import check_stage
from lab3_usd.model.finding import StageResult
from lab3_usd.spec.load.assemble import assemble
from lab3_usd.spec.load.isaac_types import load_isaac_types
from lab3_usd.spec.load.loader import load_lab


def make_lab(folder: Path, stage: Path) -> int:
    """Write a lab after a stage, say what it holds, and return the exit code.

    Raises:
        StageError: the stage cannot be read.
        UsageError: it has no robot or graph, or the folder exists.
    """
    refuse_existing_folder(folder)
    if not stage.is_file():
        message = f"{stage}: there is no such file"
        raise UsageError(message)
    lab = load_lab(data_folder("graphs"))
    description = describe_lab(stage, lab, load_isaac_types().catalog)
    results: list[StageResult] = []
    last = description.steps[-1].id
    write_folder(
        folder,
        description.files,
        lambda written: results.append(check_stage(stage, last, assemble(written))),
    )
    for name in description.files:
        click.echo(folder / name)
    for line in description.left_out:
        click.echo(f"left out: {line}")
    errors = [each for each in results[0].findings if each.severity == "error"]
    for each in errors:
        click.echo(f"error {each.rule} {each.prim}: {each.message}")
    score = results[0].score
    counts = f"{score.earned:g} of {score.possible:g} met"
    click.echo(f"{stage}: checkpoint {last}, {results[0].verdict}, {counts}")
    return EXIT_FOUND if errors or results[0].crashes else 0
