"""`lab3 lab`: check the description of a lab, or start one."""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from lab3_usd.commands.shared.options import echo, write_into
from lab3_usd.commands.shared.paths import Input, OutputFolder
from lab3_usd.data import data_folder, lab_folder, program
from lab3_usd.errors import EXIT_FOUND, SpecError, UsageError
from lab3_usd.grade.lab_schemas import FOLDER, schema_of, schema_texts, with_schema
from lab3_usd.new_lab.checkpoints import Step
from lab3_usd.new_lab.lab import describe_lab, refuse_existing_folder, write_folder
from lab3_usd.pipeline.results import STAGE_ENDINGS
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.report.entries import plural, score_text
from lab3_usd.report.safe_text import printable
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.contradictions.names import LabFault
from lab3_usd.spec.contradictions.scene import KnownScene
from lab3_usd.spec.lab import STARTER, Lab
from lab3_usd.spec.load.loader import assemble, load_lab
from lab3_usd.spec.load.starter import load_starter_spec
from lab3_usd.spec.positions import written_place
from lab3_usd.stage.read.stage_reader import read_stage


def make_lab(folder: Path, stages: Sequence[Path]) -> int:
    """Write a lab from its stages, check them against it, and return the exit code.

    Raises:
        StageError: a stage cannot be read.
        UsageError: the last one has no robot or graph, the stages are no checkpoints of one lab, or
            the folder exists.
    """
    refuse_existing_folder(folder)
    _refuse_missing(stages)
    lab = load_lab(data_folder("graphs"))
    description = describe_lab(stages, lab)
    named = {name: with_schema(name, text) for name, text in description.files.items()}
    write_folder(folder, {**named, **schema_texts()})
    for name in description.files:
        echo(folder / name)
    echo(folder / FOLDER)
    for reason in description.left_out:
        echo(f"left out: {reason}")
    try:
        described = assemble(folder)
    except SpecError as error:
        echo(f"error {error}")
        echo(f"{folder}: cannot be loaded, no stage was judged by it")
        return EXIT_FOUND
    faults = _say_faults(described, stages)
    passes = not faults
    undecided = [fault for fault in faults if fault.severity == "error"]
    for fault in undecided:
        place = written_place(folder, fault.place)
        echo(f"to be decided by you: {place}: {fault.key}")
    if undecided:
        then = f"then run {program()} lab check {folder}"
        echo(f"{folder}: no stage was judged, as no command loads this lab yet; {then}")
        return EXIT_FOUND
    steps = description.steps[-len(stages) :]
    for stage, step in zip(stages, steps, strict=True):
        passes = _judge(stage, step, described) and passes
    return 0 if passes else EXIT_FOUND


def _refuse_missing(stages: Sequence[Path]) -> None:
    for stage in stages:
        if not stage.is_file():
            raise UsageError(f"{stage}: there is no such file")


def _say_faults(lab: Lab, stages: Sequence[Path], *, build: bool = False) -> list[LabFault]:
    """Print and return contradictions in a lab, and names that no stage has.

    Points and checklists are held against a lab that agrees with itself, and with `build` so are
    the stages that it describes, whose starter it describes.

    Raises:
        SpecError: the description of the starter is wrong.
        StageError: a stage cannot be read.
    """
    from lab3_usd.grade.rubric import scoring_faults
    from lab3_usd.spec.contradictions.references import lab_faults

    if (lab.folder / STARTER).is_file():
        load_starter_spec(lab.folder)
    faults = list(lab_faults(lab, [_known(stage, lab) for stage in stages]))
    if all(fault.severity != "error" for fault in faults):
        faults += scoring_faults(lab)
        if build and (lab.folder / STARTER).is_file():
            from lab3_usd.pipeline.described import described_faults

            told = {(fault.file, fault.key) for fault in faults}
            built = described_faults(lab)
            faults += [fault for fault in built if (fault.file, fault.key) not in told]
    for fault in faults:
        place = written_place(lab.folder, fault.place)
        echo(f"{fault.severity} {fault}" + (f", at {place}" if place else ""))
    numbers = Counter(fault.severity for fault in faults)
    counts = ", ".join(plural(numbers[word], word) for word in ("error", "warning"))
    echo(f"{lab.title}: {counts}")
    return faults


def _known(path: Path, lab: Lab) -> KnownScene:
    """Return the prims of a stage; those below a missing asset are unknown."""
    stage = read_stage(path, lab.platform)
    prims = frozenset(name for name, prim in stage.prims.items() if prim.present)
    open_below = tuple(f"{asset.prim.rstrip('/')}/" for asset in stage.unresolved)
    assets = {name: prim.assets for name, prim in stage.prims.items() if prim.assets}
    return KnownScene(path.name, prims, open_below, assets)


def _judge(stage: Path, step: Step, lab: Lab) -> bool:
    """Check and play a stage, print faults and results, and return whether it passes both."""
    result = check_stage(stage, step.id, lab)
    for finding in result.findings:
        if finding.severity == "error":
            echo(f"error {finding.rule} {finding.prim}: {printable(finding.message)}")
    for gap in result.gaps:
        echo(f"not judged: {printable(str(gap))}")
    shown = f"{stage}: checkpoint {step.id}, {result.verdict}, {score_text(result.score)}"
    is_played = bool(lab.checkpoints[step.id].graphs)
    if not is_played:
        echo(shown)
        return result.verdict == "pass"
    behaviour = dry_run(stage, lab, step.id).behaviour
    for check in behaviour.checks:
        if check.verdict == "bad":
            echo(f"sim: {check.name}: {printable(check.text)}")
    if behaviour.verdict == "not judged":
        echo(f"sim: not judged: {printable(behaviour.missing)}")
    echo(f"{shown}; sim {behaviour.verdict}")
    return result.verdict == "pass" and behaviour.verdict == "ok"


@click.group("lab")
def command() -> None:
    """Check the description of a lab, or write one from its stages."""


@command.command("check")
@click.argument("folder", metavar="[DIR]", required=False, type=Input(path_type=Path))
@click.option(
    "--from",
    "stages",
    multiple=True,
    type=Input(path_type=Path),
    metavar="STAGE",
    help="A stage of the lab: a target that neither a stage nor the starter has is an error.",
)
def check(folder: Path | None, stages: tuple[Path, ...]) -> None:
    """Find contradictions between the files of a lab, and with stages.

    DIR is a folder in the form of graphs/, by default that of --lab, else the bundled one. Each
    finding names file, key, and the place that it contradicts.

    Exit code: 0 nothing found, 1 findings, 2 a file that cannot be read.
    """
    if folder is not None and not folder.is_dir():
        raise UsageError(f"{folder}: there is no such folder")
    _refuse_missing(stages)
    lab = assemble(folder or lab_folder())
    if _say_faults(lab, stages, build=True):
        sys.exit(EXIT_FOUND)


@command.command("new")
@click.argument("folder", metavar="DIR", type=OutputFolder(path_type=Path))
@click.argument("stages", metavar="STAGE...", nargs=-1, type=Input(path_type=Path))
@click.option(
    "--from",
    "more",
    multiple=True,
    type=Input(path_type=Path),
    metavar="STAGE",
    help="One more STAGE; may be repeated.",
)
def new(folder: Path, stages: tuple[Path, ...], more: tuple[Path, ...]) -> None:
    """Write a first description of a lab from its solution stages.

    STAGE is a working stage, whose content defines the lab: one for each checkpoint, in their
    order, or one with everything; or a folder, or a pattern with *, whose stages come in the order
    of their numbers.

    DIR is a new folder in the form of graphs/: graphs with the values that the stages set, robot,
    sensors, the TF tree, topics, points, and a checkpoint for each STAGE, with what it adds to the
    one before. For a single STAGE, named after the last checkpoint, each graph is one. The lab is
    then checked, and each STAGE checked and played by it.

    Exit code: 0 all of it passes, 1 something does not, 2 a stage or the folder cannot be used.
    """
    chosen = list(chosen_stages([*more, *stages]))
    if not chosen:
        raise click.UsageError("name a stage, or a folder with stages")
    sys.exit(make_lab(folder, chosen))


def chosen_stages(given: Sequence[Path]) -> Iterator[Path]:
    """Yield the stages that are named; those of a folder or a pattern in order of their numbers."""
    for path in given:
        files = [path]
        if path.is_dir():
            files = [file for file in path.iterdir() if file.suffix.lower() in STAGE_ENDINGS]
        elif "*" in path.name and not path.exists():
            files = [*path.parent.glob(path.name)]
        yield from sorted(
            files,
            key=lambda file: [  # 2 before 10
                (int(part), "") if part.isdigit() else (0, part)
                for part in re.split(r"(\d+)", file.name)
            ],
        )


@command.command("schema")
@click.argument("file", required=False)
@click.option(
    "--output",
    "-o",
    "folder",
    type=OutputFolder(path_type=Path, file_okay=False),
    help="Write all schemas here.",
)
@click.option("--force", is_flag=True, help="With --output: replace files that exist.")
def schema(file: str | None, folder: Path | None, *, force: bool) -> None:
    """Print the JSON schema of a file of a lab, or write all schemas.

    FILE is its name, such as scene.yaml; a name of none of the fixed files is that of a graph.
    Editors that read YAML complete and check a file whose first line names its schema, as `lab new`
    writes it.
    """
    if (file is None) == (folder is None):
        raise click.UsageError("name a file, or a folder with --output")
    if file is not None:
        click.echo(json.dumps(schema_of(Path(file).name), indent=1, ensure_ascii=False))
    if folder is not None:
        files = {folder / Path(name).name: text.encode() for name, text in schema_texts().items()}
        others = {
            path: text
            for path, text in files.items()
            if not (path.is_file() and path.read_bytes() == text)
        }
        write_into(folder, others, force=force)
