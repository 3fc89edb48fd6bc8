"""What `lab3 tf` and `lab3 topics` share: their options, what they read, and how they end."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click
from msgspec import Struct

from lab3_usd.commands.shared.configuration import leave_broken_lab, use_config
from lab3_usd.commands.shared.options import (
    Option,
    all_of,
    assets_option,
    echo,
    isaac_option,
    recorded,
    scene_option,
)
from lab3_usd.commands.shared.paths import Input, OutputFile

if TYPE_CHECKING:
    from lab3_usd.model.stage import Node, StageModel
    from lab3_usd.report.picture.model import Picture


class PublishedOptions(Struct, frozen=True):
    """How a stage is read, and how what it publishes is shown."""

    form: str
    picture: Path | None
    force: bool
    verbose: bool
    scene: str | None
    release: str | None
    assets: tuple[str, ...]


def published_options(forms: Sequence[str], what: str, drawing: str, verbose: str) -> Option:
    """Return the stage and the options of a command that lists what a stage publishes."""
    return all_of(
        click.argument("stage", type=Input(path_type=Path)),
        click.option(
            "--format",
            "form",
            type=click.Choice(forms),
            default="text",
            show_default=True,
            help=f"Format of the {what}.",
        ),
        click.option(
            "--graph",
            "picture",
            type=OutputFile(path_type=Path),
            help=f"{drawing} does, into a .svg, .png, .dot or .mmd.",
        ),
        click.option("--force", is_flag=True, help="With --graph: replace a picture that exists."),
        click.option("-v", "--verbose", is_flag=True, help=verbose),
        scene_option,
        isaac_option,
        assets_option,
        recorded("asked", PublishedOptions),
    )


class PublishedStage(NamedTuple):
    """A stage that was read, its nodes of unknown types, and what was not judged, in words."""

    model: StageModel
    unknown: tuple[Node, ...]
    not_judged: str


def read_published(path: Path, asked: PublishedOptions) -> PublishedStage:
    """Read any stage, or a script over the scene that it loads, by the platform of lint.

    Raises:
        StageError: the file cannot be opened, or builds no graph.
        UsageError: a stage is given a scene, or the release is not known.
    """
    from lab3_usd.check.lint import lint
    from lab3_usd.check.match.rule_inputs import LintSubject
    from lab3_usd.facts.stalled_nodes import nodes_of_unknown_type
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.model.finding import NodeCoverage
    from lab3_usd.pipeline.any_stage import lint_platform, read_any
    from lab3_usd.report.entries import coverage_line
    from lab3_usd.report.safe_text import printable

    use_config(path, asked.assets)
    leave_broken_lab()
    model = read_any(path, lint_platform(asked.release or BASE), asked.scene or "")
    coverage = lint(LintSubject(model)).coverage or NodeCoverage()
    unknown = tuple(nodes_of_unknown_type(model))
    return PublishedStage(model, unknown, printable(coverage_line(coverage)))


def write_published(picture: Picture, path: Path, *, force: bool) -> None:
    """Write a picture, and print its path."""
    from lab3_usd.report.picture.picture_file import write_picture

    write_picture(picture, path, force)
    echo(path)


def print_published(lines: Iterable[str], stage: PublishedStage, mark: str = "") -> None:
    """Print lines, and behind a mark what could add to them."""
    from lab3_usd.report.entries import missing_line
    from lab3_usd.report.safe_text import folded, printable
    from lab3_usd.report.topic_table import WIDTH

    missing = printable(missing_line(asset.asset for asset in stage.model.unresolved))
    texts = filter(None, (stage.not_judged, missing))
    rest = [line for text in texts for line in folded(mark + text, WIDTH, rest=" " * len(mark))]
    click.echo("\n".join([*lines, *rest]))
