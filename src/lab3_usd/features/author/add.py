"""`lab3 add`: add ROS 2 graphs for the robots and sensors of any stage."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lab3_usd.commands.shared.configuration import use_config
from lab3_usd.commands.shared.options import file_option, recorded, width
from lab3_usd.commands.shared.paths import Input, OutputFile
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
    request_options,
    to_write,
)
from lab3_usd.files import copy_beside, write_whole

if TYPE_CHECKING:
    from lab3_usd.author.adding import Added, Addition, AddOptions
    from lab3_usd.author.request import Options, Request
    from lab3_usd.model.dry_run import Check
    from lab3_usd.model.finding import Finding

_KINDS = """\b
Kinds:
  clock         simulation time on /clock
  drive         /cmd_vel to wheels left and right, two or more
  ackermann     steering commands to a car
  holonomic     /cmd_vel to wheels with rollers
  odometry      where the robot is, and the frames of its links
  tf            the frames of links, or of --targets
  joints        joint states; --commands subscribes to commands
  camera        pictures and camera info; --publish chooses
  lidar         a laser scan, a point cloud
  imu           accelerations and turning
  publisher     one value of std_msgs
  differential  wheels without ROS; --keyboard drives with WASD
  position      joints of an arm at positions, without ROS
  velocity      joints at speeds, without ROS
  gripper       fingers that open and close, without ROS"""
_LABEL, _WIDEST, _NARROWEST = 10, 34, 60  # columns of the text


class AddingOptions(EditOptions, frozen=True):
    """Where requests come from, and how their graphs are made, checked and shown."""

    requests: Path | None
    replace: bool
    layer: Path | None
    check_drive: bool


@click.command("add")
@click.argument("words", nargs=-1, required=True, metavar="KIND STAGE", type=Input())
@file_option(
    "--file",
    "requests",
    text="Add what this YAML file lists instead of KIND; replace what differs.",
)
@request_options
@click.option("--replace", is_flag=True, help="Replace a graph that has other values.")
@writing_options("extended")
@click.option(
    "--layer",
    type=OutputFile(path_type=Path),
    metavar="FILE",
    help="Write a layer over the stage with the graphs alone.",
)
@click.option("--check-drive", is_flag=True, help="Simulate the result and check its messages.")
@edit_options
@recorded("asked", AddingOptions)
def command(
    words: tuple[str, ...], request: Options, writing: WritingOptions, asked: AddingOptions
) -> None:
    """Add Action Graphs for ROS 2 to any stage.

    Robot, wheels, sizes, frames and names come from the stage; each line says what from, and which
    option changes it. The result is only shown unless --in-place, --output or --layer writes it.

    Exit code: 0 done, shown, or nothing to add; 1 the result would have new findings, with
    --check-drive does not drive as it should, or with --diff is a change; 2 refused.
    """
    from lab3_usd.author.adding import AddOptions
    from lab3_usd.author.request import Request, requests_of_file
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.pipeline.any_stage import lint_platform

    kind, stage = kind_and_stage(words, has_file=asked.requests is not None)
    check_ways([stage], writing, layer=asked.layer)
    config = use_config(stage, asked.assets)
    if asked.requests is None:
        requests = [Request(kind, request)]
    else:
        recipes = lint_platform(asked.release or BASE).recipes
        requests = requests_of_file(asked.requests, recipes)
    settings = AddOptions(
        asked.release or BASE,
        force=asked.force,
        replaces=asked.replace or not kind,
        parameters=config.parameters,
    )
    try:
        if asked.layer is not None:
            status = _add_layer(stage, requests, settings, asked, asked.layer)
        else:
            status = _add(stage, requests, settings, asked, writing)
    except UsageError as error:
        raise UsageError(f"{shown(stage)}: {error}") from error
    sys.exit(status)


command.help = f"{cleandoc(command.help or '')}\n\n{_KINDS}"


def _add(
    stage: Path,
    requests: Sequence[Request],
    settings: AddOptions,
    asked: AddingOptions,
    writing: WritingOptions,
) -> int:
    from lab3_usd.author.adding import add_graphs, check_added

    added = add_graphs(stage, requests, settings)
    files = {} if added.data is None else {stage: added.data}
    states = {stage: added.state}
    if writing.diff:
        return print_diff(files, states)
    played = _played(added) if asked.check_drive else ()
    is_wanted = bool(writing.output or (writing.in_place and files))
    lines: list[str] = []
    if is_wanted and not _is_refused(added, asked, played):
        check = partial(check_added, added)
        lines += write_edited(
            stage, files, states, writing, force=asked.force, check=check, first_alone=True
        )
    written = writing.output or stage if lines else None
    return _report(added, asked, played, written, lines, shown(stage))


def _add_layer(
    stage: Path,
    requests: Sequence[Request],
    settings: AddOptions,
    asked: AddingOptions,
    target: Path,
) -> int:
    """Write a layer over the stage; one that is there already is extended.

    Raises:
        UsageError: the file is something else, or cannot be written.
    """
    from lab3_usd.author.adding import add_graphs
    from lab3_usd.stage.edit.added import layer_over, sublayers
    from lab3_usd.stage.read.opening import ENDINGS

    if target.suffix.lower() not in ENDINGS[:-1]:
        raise UsageError(f"--layer {target}: a layer ends in {', '.join(ENDINGS[:-1])}")
    is_there = target.exists()
    if is_there and stage.resolve() not in [path.resolve() for path in sublayers(target)]:
        raise UsageError(f"--layer {target}: is another file, and no layer over {stage}")
    content = target.read_bytes() if is_there else layer_over(stage, target).encode()
    with copy_beside(target, content, ".usda") as layer:
        added = add_graphs(layer, requests, settings)
    played = _played(added) if asked.check_drive else ()
    lines: list[str] = []
    if added.data is not None and not _is_refused(added, asked, played):
        write_whole(target, added.data, force=is_there)
        lines.append(f"written: {shown(target)}, over {shown(stage)}")
    return _report(added, asked, played, target if lines else None, lines, shown(target))


def _is_refused(added: Added, asked: AddingOptions, played: Sequence[Check]) -> bool:
    """Whether nothing may be written: for new findings, or for what the dry run shows."""
    is_worse = bool(added.new) or any(check.verdict == "bad" for check in played)
    return is_worse and not asked.force


def _report(
    added: Added,
    asked: AddingOptions,
    played: Sequence[Check],
    written: Path | None,
    lines: Sequence[str],
    name: str,
) -> int:
    is_refused = _is_refused(added, asked, played)
    if asked.form == "json":
        click.echo(_as_json(added, played, written))
        return 1 if is_refused else 0
    played_lines = _play_lines(played) if asked.check_drive else ()
    for line in (*_text(added, name, is_written=written is not None), *played_lines, *lines):
        click.echo(line)
    if is_refused:
        why = "the new findings are" if added.new else "what the robot does not do is"
        click.echo(f"nothing is written: {why} above; --force writes all the same")
    elif added.data is not None and written is None:
        click.echo(to_write())
    return 1 if is_refused else 0


def _text(added: Added, name: str, *, is_written: bool) -> Iterator[str]:
    holes = [hole for addition in added.additions for hole in addition.holes]
    columns = _columns([(hole.label, hole.shown, hole.source) for hole in holes])
    for addition in added.additions:
        yield f"{name}: {_headline(addition, is_written=is_written)}"
        for hole in addition.holes:
            yield from _row(columns, hole.label, hole.shown, hole.source, hole.option)
        for note in addition.notes:
            yield from _row(columns, "note", note)
    if not (added.awaited or added.new):
        yield from _row(columns, "lint", "no new finding")
    for finding, how in added.awaited:
        yield from _row(columns, "lint", f"{_line(finding)}; {how}")
    for finding in added.new:
        yield from _row(columns, "lint", f"new {finding.severity} {_line(finding)}")


def _columns(rows: Sequence[tuple[str, str, str]]) -> tuple[int, int, int]:
    """Return how wide labels, values and sources are, without the longest of them."""
    widths = [
        max((len(text) for text in column if len(text) <= _WIDEST), default=0)
        for column in zip(*rows, strict=True)
    ]
    label, value, source = widths or (0, 0, 0)
    return max(_LABEL, label + 2), value, source


def _headline(addition: Addition, *, is_written: bool) -> str:
    if addition.is_there:
        return f"nothing to add, {addition.graph} does it"
    count = f"{addition.nodes} node{'s' * (addition.nodes != 1)}"
    if addition.replaced:
        verb = "replaced" if is_written else "would replace"
        return f"{verb} {addition.replaced} by {addition.graph}, {count}"
    if addition.extends:
        verb = "extended" if is_written else "would extend"
        return f"{verb} {addition.graph}, {count} more"
    return f"{'added' if is_written else 'would add'} {addition.graph}, {count}"


def _row(
    columns: tuple[int, int, int], label: str, value: str, source: str = "", option: str = ""
) -> Iterator[str]:
    """Yield a fact in columns: what it is, what it rests on, and which option changes it."""
    from lab3_usd.report.safe_text import folded, visible

    first, second, third = columns
    start = f"  {label:<{first}}"
    rest = " " * len(start)
    line = f"{start}{value:<{second}}  {source:<{third}}  {option}".rstrip()
    if source and len(line) <= max(width(), _NARROWEST):
        yield visible(line)
        return
    yield from folded(visible(value), max(width(), _NARROWEST), start, rest)
    if source:
        yield visible(f"{rest}{'':<{second}}  {source:<{third}}  {option}".rstrip())


def _line(finding: Finding) -> str:
    from lab3_usd.report.entries import site

    return f"{finding.rule} {site(finding)}: {finding.message}"


def _as_json(added: Added, played: Sequence[Check], written: Path | None) -> str:
    document = {
        "stage": str(added.path),
        "written": None if written is None else str(written),
        "changed": added.data is not None,
        "additions": [
            {
                "kind": addition.request.kind,
                "graph": addition.graph,
                "nodes": addition.nodes,
                "state": "there" if addition.is_there else "extends" if addition.extends else "new",
                "replaced": addition.replaced or None,
                "facts": [
                    {"name": h.label, "value": h.shown, "source": h.source, "option": h.option}
                    for h in addition.holes
                ],
                "notes": list(addition.notes),
            }
            for addition in added.additions
        ],
        "awaited": [finding_fields(each) | {"resolved_by": how} for each, how in added.awaited],
        "findings": [*map(finding_fields, added.new)],
        "played": [
            {"name": check.name, "verdict": check.verdict, "text": check.text} for check in played
        ],
    }
    return json.dumps(document, indent=2, ensure_ascii=False)


def _played(added: Added) -> tuple[Check, ...]:
    """Play the result beside the stage, as `lab3 sim` does, before anything is written."""
    from lab3_usd.sim.dry_run import dry_run
    from lab3_usd.spec.load.loader import load_lab

    with copy_beside(added.path, added.data or added.state.content) as copy:
        return dry_run(copy, load_lab(), "").behaviour.checks


def _play_lines(played: Sequence[Check]) -> Iterator[str]:
    from lab3_usd.report.entries import plural

    failing = [check for check in played if check.verdict != "ok"]
    count = f"{plural(len(played), 'check')}, {len(played) - len(failing)} ok"
    yield from _row(_columns([]), "play", count if played else "nothing to judge")
    for check in failing:
        told = f"{check.verdict} {check.name}: {check.text}"
        yield from _row(_columns([]), "play", told)
