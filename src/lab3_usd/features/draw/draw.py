"""`lab3 draw`: pictures of Action Graphs and of the TF tree."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import Struct

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.commands.shared.configuration import use_config
from lab3_usd.commands.shared.options import (
    assets_option,
    checkpoint_option,
    echo,
    isaac_option,
    recorded,
    scene_option,
    write_into,
    written_folder,
)
from lab3_usd.commands.shared.paths import Input
from lab3_usd.data import program
from lab3_usd.errors import EXIT_CRASH, UsageError
from lab3_usd.report.picture.picture_file import ENDINGS, encoder, file_names
from lab3_usd.report.picture.svg import THEMES, Theme

if TYPE_CHECKING:
    from lab3_usd.check.registry import Parameters
    from lab3_usd.model.finding import Crash
    from lab3_usd.report.picture.model import Picture
    from lab3_usd.spec.lab import Lab

TREE = "TF"


class DrawOptions(Struct, frozen=True):
    """How a stage is read and judged, and how its pictures look."""

    form: str
    checkpoint: str | None
    lint: bool
    theme: Theme
    all_ports: bool
    force: bool
    scene: str | None
    release: str | None
    assets: tuple[str, ...]


@click.command("draw")
@click.argument("target", metavar="FILE|GRAPH", type=Input())
@written_folder("Folder for the pictures; created if it does not exist.", "pictures")
@click.option(
    "--format",
    "form",
    type=click.Choice(list(ENDINGS)),
    default="svg",
    show_default=True,
    help="Format of the pictures; png needs the extra lab3-usd[png].",
)
@checkpoint_option("Check the stage for this checkpoint.")
@click.option("--lint", is_flag=True, help="Mark the findings of lab3 lint.")
@isaac_option
@click.option(
    "--theme",
    type=click.Choice(THEMES),
    default="auto",
    show_default=True,
    help="Colours of svg and png; auto follows the reader's system (png: light).",
)
@click.option("--all-ports", is_flag=True, help="Draw unused ports as well.")
@scene_option
@assets_option
@recorded("asked", DrawOptions)
def command(target: str, folder: Path, asked: DrawOptions) -> None:
    """Draw each Action Graph and the TF tree of a stage, with its faults marked.

    FILE is a stage; its checkpoint is read from its name, or given with --checkpoint. A stage
    without one is drawn as it is. With --lint, the findings of lab3 lint are marked. GRAPH is the
    name of a graph of the lab, or TF, and draws the correct one.
    """
    from lab3_usd.spec.load.loader import load_lab

    parameters = use_config(Path(target), asked.assets).parameters
    lab = load_lab()
    path = Path(target)
    if asked.lint and asked.checkpoint is not None:
        raise UsageError("--lint and --checkpoint exclude each other")
    if asked.lint:
        drawing = _linted(path, asked, parameters)
    elif target in lab.graphs or target == TREE:
        if asked.release is not None:
            raise UsageError("--isaac goes with a stage: the lab names the release of its graphs")
        drawing = Drawing([_reference(lab, target, every_port=asked.all_ports)], "")
    elif path.suffix or path.exists():
        drawing = _of_stage(lab, path, asked)
    else:
        names = ", ".join([*lab.graphs, TREE])
        raise UsageError(
            f"'{target}' is neither a stage file nor a graph of the lab; graphs are {names}"
        )
    encode = encoder(asked.form, asked.theme)
    if not drawing.pictures:
        raise UsageError(
            f"{target}: has no Action Graph and no TF tree, so there is nothing to draw"
        )
    free = file_names(drawing.stem, drawing.pictures)
    paths = (folder / f"{name}.{ENDINGS[asked.form]}" for name in free)
    pictures = zip(paths, map(encode, drawing.pictures), strict=True)
    write_into(folder, dict(pictures), force=asked.force)
    for crash in drawing.crashes:
        echo(f"{program()}: rule {crash.rule} failed: {crash.error}", err=True)
    if drawing.crashes:
        sys.exit(EXIT_CRASH)


class Drawing(Struct, frozen=True):
    """The pictures of one target, what their file names begin with, and the rules that failed."""

    pictures: list[Picture]
    stem: str
    crashes: tuple[Crash, ...] = ()


def _reference(lab: Lab, name: str, *, every_port: bool) -> Picture:
    from lab3_usd.report.pictures.graph_picture import spec_picture
    from lab3_usd.report.pictures.tf_picture import spec_frames_picture

    if name == TREE:
        return spec_frames_picture(lab.frames)
    return spec_picture(lab.graphs[name], every_port=every_port)


def _of_stage(lab: Lab, path: Path, asked: DrawOptions) -> Drawing:
    from lab3_usd.check.checker import judge
    from lab3_usd.pipeline.any_stage import lab_in_release, read_any
    from lab3_usd.pipeline.stage import checkpoint_of
    from lab3_usd.report.pictures.graph_picture import stage_pictures

    number, every_port = checkpoint_of(path.name, lab, asked.checkpoint), asked.all_ports
    if asked.release is not None:
        lab = lab_in_release(lab, asked.release, number)
    stage = read_any(path, lab.platform, asked.scene or "")
    stem = f"{path.stem}-"
    if number is None:
        bare = list(stage_pictures(lab, None, stage, every_port=every_port))
        if bare:
            click.echo(
                f"{program()}: {path} names no checkpoint; drawn as it is, not judged", err=True
            )
        return Drawing(bare, stem)
    checkpoint = lab.checkpoints[number]
    judged = judge(lab, checkpoint, stage)
    pictures = stage_pictures(lab, checkpoint, stage, judged.findings, every_port=every_port)
    return Drawing(list(pictures), stem, judged.crashes)


def _linted(path: Path, asked: DrawOptions, parameters: Parameters) -> Drawing:
    """Draw a stage with what the linter finds; findings elsewhere than in its graphs are listed."""
    from lab3_usd.check.lint import lint
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.pipeline.any_stage import lint_platform, read_any
    from lab3_usd.report.pictures.graph_picture import linted_pictures

    platform = lint_platform(asked.release or BASE)
    stage = read_any(path, platform, asked.scene or "")
    linted = lint(LintSubject(stage, parameters=parameters))
    pictures = linted_pictures(stage, linted.findings, every_port=asked.all_ports)
    return Drawing(list(pictures), f"{path.stem}-", linted.crashes)
