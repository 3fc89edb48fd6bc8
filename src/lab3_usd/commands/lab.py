"""`lab3 lab`: check the description of a lab, or start one."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import click

from lab3_usd.data import data_folder
from lab3_usd.describe.lab import describe_lab, refuse_existing_folder, write_folder
from lab3_usd.errors import EXIT_FOUND, UsageError
from lab3_usd.judge.stage import check_stage
from lab3_usd.model.finding import StageResult
from lab3_usd.spec.load.compiled import load_isaac_types
from lab3_usd.spec.load.lab import assemble
from lab3_usd.spec.load.loader import load_lab


def make_lab(folder: Path, stage: Path) -> int:
    """Write a lab after a stage, say what it holds, and return the exit code.

    Raises:
        StageError: the stage cannot be read.
        UsageError: it has no robot or graph, or the folder exists.
    """
    refuse_existing_folder(folder)
    if not stage.is_file():
        raise UsageError(f"{stage}: there is no such file")
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
    errors = [finding for finding in results[0].findings if finding.severity == "error"]
    for error in errors:
        click.echo(f"error {error.rule} {error.prim}: {error.message}")
    for gap in results[0].gaps:
        click.echo(f"not judged: {gap}")
    score = results[0].score
    counts = f"{score.earned:g} of {score.possible:g} met"
    click.echo(f"{stage}: checkpoint {last}, {results[0].verdict}, {counts}")
    return 0 if results[0].verdict == "pass" else EXIT_FOUND


@click.group("lab")
def command() -> None:
    """Check the description of a lab, or start one after a stage."""


@command.command("check")
@click.argument("folder", metavar="[DIR]", required=False, type=click.Path(path_type=Path))
def check(folder: Path | None) -> None:
    """Hold the files of a lab against each other.

    DIR is a folder in the form of graphs/, by default that of --lab, else the bundled one. Each
    finding names file, key, and the place that it contradicts. Exit status: 0 nothing found, 1
    findings, 2 a file that cannot be read.
    """
    from lab3_usd.data import lab_folder
    from lab3_usd.grade.rubric import scoring_faults
    from lab3_usd.spec.contradictions.references import lab_faults

    if folder is not None and not folder.is_dir():
        raise UsageError(f"{folder}: there is no such folder")
    lab = assemble(folder or lab_folder())
    faults = list(lab_faults(lab))
    # Points and checklists are held against a lab that agrees with itself.
    if all(fault.severity != "error" for fault in faults):
        faults += scoring_faults(lab)
    for fault in faults:
        click.echo(f"{fault.severity} {fault}")
    numbers = Counter(fault.severity for fault in faults)
    counts = (
        f"{numbers[word]} {word}{'s' * (numbers[word] != 1)}" for word in ("error", "warning")
    )
    click.echo(f"{lab.title}: {', '.join(counts)}")
    if faults:
        sys.exit(EXIT_FOUND)


@command.command("new")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--from",
    "stage",
    required=True,
    type=click.Path(path_type=Path),
    metavar="STAGE",
    help="A stage that works: what it holds is what the lab asks for.",
)
def new(folder: Path, stage: Path) -> None:
    """Read a first description of a lab off a stage.

    DIR is a new folder in the form of graphs/: graphs with their values away from the defaults,
    robot, sensors, the TF tree, topics, and a checkpoint for each graph. The last one has the name
    of STAGE, which is then checked. Exit status: 0 it passes, 1 it does not, 2 the stage or the
    folder cannot be used.
    """
    sys.exit(make_lab(folder, stage))
