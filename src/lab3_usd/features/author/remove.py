"""`lab3 remove`: remove what `lab3 add` adds."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from lab3_usd.commands.shared.configuration import use_config
from lab3_usd.commands.shared.options import recorded
from lab3_usd.commands.shared.paths import Input
from lab3_usd.commands.shared.writing import (
    WritingOptions,
    check_ways,
    print_diff,
    shown,
    write_edited,
    writing_options,
)
from lab3_usd.errors import UsageError
from lab3_usd.features.author.requests import (
    EditOptions,
    edit_options,
    finding_fields,
    kind_and_stage,
    removal_options,
    to_write,
)

if TYPE_CHECKING:
    from lab3_usd.author.removing import Removed
    from lab3_usd.author.request import Options


@click.command("remove")
@click.argument("words", nargs=-1, required=True, metavar="KIND STAGE", type=Input())
@removal_options
@writing_options("remaining")
@edit_options
@recorded("asked", EditOptions)
def command(
    words: tuple[str, ...], request: Options, writing: WritingOptions, asked: EditOptions
) -> None:
    """Remove a graph that lab3 add added, or one that does the same.

    The graph goes, and the parents that were added with it; of a graph that was extended, the new
    nodes. A text stage is then as it was, to the byte. --robot and --prim say whose graph it is.
    Further options of lab3 add are taken and make no difference, so that the words that added a
    graph remove it.

    Exit code: 0 done or shown, 1 the result would have new errors, or with --diff a change, 2
    refused.
    """
    from lab3_usd.author.removing import remove_graph
    from lab3_usd.author.request import Request
    from lab3_usd.isaac.releases import BASE

    kind, stage = kind_and_stage(words, has_file=False)
    check_ways([stage], writing)
    use_config(stage, asked.assets)
    try:
        removed = remove_graph(stage, Request(kind, request), asked.release or BASE)
        files = {} if removed.data is None else {stage: removed.data}
        states = {stage: removed.state}
        if writing.diff:
            sys.exit(print_diff(files, states))
        is_worse = any(finding.severity == "error" for finding in removed.new)
        is_refused = is_worse and not asked.force
        lines: list[str] = []
        if files and not is_refused and (writing.output or writing.in_place):
            lines += write_edited(
                stage, files, states, writing, force=asked.force, first_alone=True
            )
    except UsageError as error:
        raise UsageError(f"{shown(stage)}: {error}") from error
    if asked.form == "json":
        document = {
            "stage": str(stage),
            "graph": removed.graph,
            "added_by_lab3": not removed.is_foreign,
            "removed": list(removed.prims),
            "written": bool(lines),
            "findings": [*map(finding_fields, removed.new)],
        }
        click.echo(json.dumps(document, indent=2, ensure_ascii=False))
        sys.exit(1 if is_refused else 0)
    for line in (*_text(removed, kind, shown(stage), is_written=bool(lines)), *lines):
        click.echo(line)
    if is_refused:
        click.echo("nothing is written: the new errors are above; --force writes all the same")
    elif not lines:
        click.echo(to_write())
    sys.exit(1 if is_refused else 0)


def _text(removed: Removed, kind: str, name: str, *, is_written: bool) -> Iterator[str]:
    if removed.is_foreign:
        says = f"was not added by lab3, but does what lab3 add {kind} adds"
        yield f"{name}: {removed.graph} {says}"
    yield f"{name}: {'removed' if is_written else 'would remove'} {', '.join(removed.prims)}"
    for finding in removed.new:
        yield f"  lint      new {finding.severity} {finding.rule} {finding.prim}: {finding.message}"
