"""`lab3 diff`: the differences between two stages."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec.structs import replace

from lab3_usd.commands.shared.configuration import use_config
from lab3_usd.commands.shared.options import (
    assets_option,
    isaac_option,
    terminal_width,
    text_or_json,
    write_into,
)
from lab3_usd.commands.shared.paths import Input, OutputFolder
from lab3_usd.errors import EXIT_FOUND, UsageError
from lab3_usd.files import copy_beside, original_of

if TYPE_CHECKING:
    from lab3_usd.diff import Comparison
    from lab3_usd.report.picture.model import Picture


@click.command("diff")
@click.argument("before", type=Input(path_type=Path))
@click.argument("after", type=Input(path_type=Path))
@text_or_json
@click.option(
    "--pictures",
    type=OutputFolder(path_type=Path),
    metavar="FOLDER",
    help="Draw each graph that differs into this folder, as SVG.",
)
@click.option("--force", is_flag=True, help="Replace pictures that exist.")
@isaac_option
@assets_option
def command(
    before: Path,
    after: Path,
    form: str,
    pictures: Path | None,
    release: str | None,
    assets: tuple[str, ...],
    *,
    force: bool,
) -> None:
    """List the differences between two stages.

    Nodes, values, wires, targets, the robot and scene, topics and frames are compared.

    The composed scenes are compared, as Isaac Sim opens them: order of properties, layout of the
    text, comments, explicit defaults and positions in the graph editor make no difference. Exit
    code: 0 equal, 1 different, 2 unreadable or wrong usage, 3 the program itself failed.
    """
    # pxr and the specs are slow to import, and `lab3 --help` needs neither.
    from lab3_usd.diff import compare_stages
    from lab3_usd.pipeline.any_stage import lab_in_release
    from lab3_usd.report import diff_report
    from lab3_usd.spec.load.loader import load_lab

    use_config(before, assets)
    lab = load_lab()
    lab = lab if release is None else lab_in_release(lab, release)
    with opened_original(before) as first, opened_original(after) as second:
        comparison = compare_stages(first, second, lab)
    named = replace(comparison.diff, before=str(before), after=str(after))
    comparison = replace(comparison, diff=named)
    if pictures is not None:
        from lab3_usd.report.picture.picture_file import encoder, file_names

        drawn = list(_pictures(comparison))
        paths = (pictures / f"{name}.svg" for name in file_names("", drawn))
        files = dict(zip(paths, map(encoder("svg"), drawn), strict=True))
        write_into(pictures, files, force=force, err=True)
    if form == "json":
        click.echo(diff_report.render(comparison.diff), nl=False)
    else:
        click.echo("\n".join(diff_report.lines(comparison.diff, terminal_width())))
    if comparison.diff.changes:
        sys.exit(EXIT_FOUND)


@contextmanager
def opened_original(path: Path) -> Iterator[Path]:
    """Give what `lab3 fix` kept as NAME.orig the ending of a stage, beside it, for a while."""
    original = original_of(path)
    if original is None or not path.is_file():
        yield path
        return
    with copy_beside(path, path.read_bytes(), original.suffix) as copy:
        yield copy


def _pictures(comparison: Comparison) -> Iterator[Picture]:
    """Yield a picture of each graph that differs."""
    from lab3_usd.report.pictures.diff_picture import GraphVersions, diff_picture

    for pair in comparison.pairs.graphs:
        graph = pair.after or pair.before
        if graph is None:
            continue
        tops = tuple(
            f"{version.path}/" for version in (pair.before, pair.after) if version is not None
        )
        changes = [
            change for change in comparison.diff.changes if f"{change.path}/".startswith(tops)
        ]
        if changes:
            versions = GraphVersions(graph.name, graph.path, pair.nodes, comparison.pairs.path)
            yield diff_picture(versions, changes)


def changes_to(path: Path, content: bytes) -> Iterator[str]:
    """Yield the differences between a stage and what it would hold: `lab3 fix --diff`.

    In a folder where nothing can be written copies of both stand elsewhere.

    Raises:
        StageError: one of them cannot be opened.
    """
    from tempfile import TemporaryDirectory

    from lab3_usd.diff import compare_stages
    from lab3_usd.report import diff_report
    from lab3_usd.spec.load.loader import load_lab
    from lab3_usd.stage.edit.session import anchored

    with TemporaryDirectory(prefix="lab3-diff-") as folder, ExitStack() as stack:
        before = path
        try:
            after = stack.enter_context(copy_beside(path, content))
        except UsageError:
            before, after = (Path(folder, f"{name}{path.suffix}") for name in ("before", "after"))
            anchored(path.read_bytes(), path, before)
            anchored(content, path, after)
        compared = compare_stages(before, after, load_lab()).diff
    named = replace(compared, before=str(path), after="repaired")
    yield from diff_report.lines(named, terminal_width())
