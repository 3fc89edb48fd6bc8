"""`lab3 build`: the checkpoint stages from one starter."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from lab3_usd.commands.shared.options import (
    complete_checkpoints,
    echo,
    written_folder,
)
from lab3_usd.commands.shared.paths import Input, refuse_inputs
from lab3_usd.data import program
from lab3_usd.errors import EXIT_FOUND


@click.command("build")
@click.argument("starter", required=False, type=Input(path_type=Path))
@written_folder("Folder for the checkpoint files; created if it does not exist.")
@click.option(
    "--through",
    metavar="NN",
    shell_complete=complete_checkpoints,
    help="Stop after this checkpoint.",
)
@click.option(
    "--only", metavar="NN", shell_complete=complete_checkpoints, help="Build only this checkpoint."
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["usda", "usdc"]),
    default=None,
    help="Text (.usda) or binary (.usd); by default as in the lab.",
)
@click.option(
    "--lidar-asset",
    metavar="URL",
    help="Reference this lidar asset, as the Create menu does, instead of describing one.",
)
def command(
    starter: Path | None,
    folder: Path,
    through: str | None,
    only: str | None,
    form: str | None,
    lidar_asset: str | None,
    force: bool,  # noqa: FBT001 - click passes it by name
) -> None:
    """Build the stage of each checkpoint, with everything that the lab requires up to it.

    STARTER is the supplied scene, by default that of the lab. It is opened read-only.
    """
    from lab3_usd.spec.load.loader import load_lab
    from lab3_usd.stage.write.builder import BuildOptions, StarterError, build_files, plan_files

    if lidar_asset == "":  # a reference to nothing would be one to the stage itself
        raise click.UsageError("--lidar-asset needs an address")
    lab = load_lab()
    numbers = _numbers(list(lab.checkpoints), through, only)
    form = form or ("usda" if lab.submission.stages.endings[0] == ".usda" else "usdc")
    options = BuildOptions(form, lidar_asset, force)
    plan = plan_files(lab, folder, numbers, form)
    refuse_inputs(plan)
    try:
        files = build_files(lab, starter, plan, options)
    except StarterError as error:
        echo(f"{program()}: {error}:", err=True)
        for reason in error.reasons:
            echo(f"  {reason}", err=True)
        sys.exit(EXIT_FOUND)
    for file in files:
        echo(str(file))
    if starter is not None:
        _warn_of_deviations(starter)


def _numbers(numbers: list[str], through: str | None, only: str | None) -> list[str]:
    """Return the checkpoints to build."""
    if through is not None and only is not None:
        raise click.UsageError("give --through or --only, not both")
    chosen = only if only is not None else through
    if chosen is None:
        return numbers
    from lab3_usd.pipeline.stage import checkpoint_number

    number = checkpoint_number(chosen, numbers)
    return [number] if only is not None else numbers[: numbers.index(number) + 1]


def _warn_of_deviations(starter: Path) -> None:
    """Print a warning for each deviation of a usable starter from the handout.

    What the first checkpoint adds is none of it.
    """
    from msgspec.structs import replace

    from lab3_usd.pipeline.stage import check_stage
    from lab3_usd.spec.load.loader import load_lab
    from lab3_usd.stage.read.opening import open_stage
    from lab3_usd.stage.write.starter import deviations

    lab = load_lab()
    for prim, message in deviations(lab, open_stage(starter)):
        echo(f"warning: {prim}: {message}", err=True)
    added = {"graphs": (), "new": (), "sensors": (), "new_sensors": ()}
    bare = replace(lab.checkpoints[lab.first], **added, frames=False, topics=False)
    lab = replace(lab, checkpoints={**lab.checkpoints, lab.first: bare})
    for finding in check_stage(starter, lab.first, lab).findings:
        if finding.severity != "note":
            echo(f"warning: {finding.prim}: {finding.message}", err=True)
