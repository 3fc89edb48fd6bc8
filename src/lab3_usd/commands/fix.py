"""`lab3 fix`: repair what the check finds in a stage."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import click
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.commands.shared.configuration import (
    ConfigOptions,
    config_options,
    configured,
    path_text,
)
from lab3_usd.commands.shared.options import (
    assets_option,
    checkpoint_option,
    echo_folded,
    given_words,
    lab_words,
    recorded,
    release_option,
    rules_options,
)
from lab3_usd.commands.shared.paths import Input
from lab3_usd.commands.shared.writing import (
    WritingOptions,
    check_ways,
    print_diff,
    shown,
    write_edited,
    writing_options,
)
from lab3_usd.config.settings import Config, selected
from lab3_usd.data import program
from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.files import absence, is_script_file
from lab3_usd.fix.repairing import USELESS, Fixed, FixOptions, check_result, fix_linted, fix_stage
from lab3_usd.installation import command_line
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import Finding, site_of
from lab3_usd.pipeline.entries import find_stages as find_linted
from lab3_usd.pipeline.stage import JudgeSettings, checkpoint_at, known_checkpoint
from lab3_usd.report.entries import site
from lab3_usd.report.safe_text import visible
from lab3_usd.spec.load.loader import lab_of_team, load_lab
from lab3_usd.spec.submission import named_checkpoint
from lab3_usd.stage.read.opening import check_file
from lab3_usd.stage.read.watched_files import used_files


class RepairOptions(Struct, frozen=True):
    """What is repaired: the findings of lint or of a checkpoint, with what is likely or not.

    `starter` is the one that missing parts come from. With `force`, any file is replaced.
    """

    lint: bool = False
    unsafe: bool = False
    starter: str | None = None
    checkpoint: str | None = None
    release: str | None = None
    moved_from: str | None = None
    force: bool = False


def repair_stages(
    paths: Sequence[str], repair: RepairOptions, writing: WritingOptions, config: Config
) -> int:
    """Repair stages, write and print what was asked for, and return the exit status.

    Raises:
        UsageError: the options do not go together, or a file cannot be written.
        StageError: there is no stage at a path, or the only one cannot be opened.
    """
    stages = [stage for path in paths for stage in _stages(Path(path), repair, config)]
    check_ways(stages, writing)
    if len(stages) == 1:
        return _fix(stages[0], _repair_of(stages[0], repair, config), writing, config)
    return max(_fix_one_of_several(stage, repair, writing, config) for stage in stages)


def _repair_of(stage: Path, repair: RepairOptions, config: Config) -> RepairOptions:
    """Return how a stage is repaired: as lint judges it where nothing names a checkpoint.

    Raises:
        UsageError: the options do not go together.
    """
    is_said = repair.lint or repair.checkpoint is not None or repair.starter is not None
    if not is_said and not has_checkpoint(stage, config):
        click.echo(f"{program()}: {stage}: names no checkpoint: repaired as with --lint", err=True)
        repair = replace(repair, lint=True)
    for name, release in (("--isaac", repair.release), ("--from", repair.moved_from)):
        if release is not None and not repair.lint:
            raise UsageError(f"{name} goes with --lint")
    return replace(repair, starter=repair.starter or path_text(config.starter))


def has_checkpoint(stage: Path, config: Config) -> bool:
    """Whether the name of a stage, or the configuration, gives it a checkpoint."""
    if is_script_file(stage):
        return False
    return known_checkpoint(str(stage), JudgeSettings(config=config), load_lab()) is not None


def _fix_one_of_several(
    stage: Path, repair: RepairOptions, writing: WritingOptions, config: Config
) -> int:
    try:
        return _fix(stage, _repair_of(stage, repair, config), writing, config)
    except Lab3Error as error:  # which the other stages do not wait for
        click.echo(f"{program()}: {visible(str(error))}", err=True)
        return 2


def _stages(path: Path, repair: RepairOptions, config: Config) -> Iterator[Path]:
    """Yield a stage, or those in and below a folder that can be judged."""
    if not path.is_dir():
        if not is_script_file(path):
            check_file(path)
        elif not path.exists():
            raise UsageError(absence(path, "file or folder"))
        yield path
        return
    files = [Path(entry.path) for entry in find_linted(str(path), config)]
    if not repair.lint and repair.checkpoint is None:
        files = [file for file in files if named_checkpoint(file.name, load_lab().files)]
    if not files:
        raise UsageError(
            f"{path}: holds no stage of a checkpoint, nor does a folder in it; "
            "--lint repairs stages of any name"
        )
    yield from files


def _fix(stage: Path, repair: RepairOptions, writing: WritingOptions, config: Config) -> int:
    settings = FixOptions(
        unsafe=repair.unsafe,
        root_only=writing.output is not None,
        starter=repair.starter,
        wanted=lambda findings: selected(findings, str(stage), config),
        heeds_ignores=True,
        parameters=config.parameters,
    )
    if is_script_file(stage):
        from lab3_usd.fix.scripts import fix_script

        fixed = fix_script(stage, repair.release or BASE, settings)
    elif repair.lint:
        fixed = fix_linted(stage, repair.release or BASE, settings, repair.moved_from or "")
    else:
        lab = load_lab()
        given = JudgeSettings(checkpoint=repair.checkpoint, config=config)
        checkpoint = checkpoint_at(str(stage), given, lab)
        lab = lab_of_team(lab, [(str(stage), checkpoint)])
        fixed = fix_stage(stage, checkpoint, lab, settings)
    if writing.diff:
        return print_diff(fixed.files, fixed.states)
    if writing.output is not None:
        _refuse_layers([writing.output], stage, repair.starter)
    elif writing.in_place:
        _refuse_layers(fixed.files, repair.starter)
    if writing.output is not None or writing.in_place:
        check = partial(check_result, fixed)
        edited = stage, fixed.files, fixed.states
        for line in write_edited(*edited, writing, force=repair.force, check=check):
            click.echo(line)
    _print_findings(stage, fixed, repair, writing)
    is_preview = not (writing.output or writing.in_place) and fixed.files
    remain = any(finding.severity == "error" or finding.fix is not None for finding in fixed.left)
    return 1 if remain or is_preview else 0


def _refuse_layers(outputs: Iterable[Path], *stages: Path | str | None) -> None:
    """Refuse to write over a file of a stage that is only read.

    Raises:
        UsageError: an output is one.
    """
    existing = [path for path in outputs if path.exists()]
    for stage in stages if existing else ():
        used = frozenset[str]() if stage is None else used_files(Path(stage))
        for path in existing:
            if os.path.realpath(path) in used:
                raise UsageError(f"{path}: is a file of {stage}, which this command reads")


def _print_findings(
    stage: Path, fixed: Fixed, repair: RepairOptions, writing: WritingOptions
) -> None:
    written = writing.output is not None or writing.in_place
    for finding in fixed.repaired:
        echo_folded(f"{'repaired' if written else 'would repair'} {_line(finding)}")
    for finding in fixed.left:
        why = _why_left(finding, fixed, unsafe=repair.unsafe)
        echo_folded(f"{why} {finding.severity} {_line(finding)}")
        if why == _LEFT and finding.severity == "error":
            echo_folded(f"    {_by_hand(finding)}")
    done = "repaired" if written else "would be repaired"
    click.echo(f"{shown(stage)}: {len(fixed.repaired)} {done}, {len(fixed.left)} left")
    if fixed.files and not written:
        context = click.get_current_context()
        called = (program(), *lab_words(context), str(context.command.name))
        words = command_line(*called, shown(stage), *given_words(context))
        click.echo(f"to repair: {words} --in-place")


_LEFT = "left"  # to the user


def _by_hand(finding: Finding) -> str:
    """Say why no repair is made, or what is to be done in its place."""
    if finding.hint:
        return f"repair it by hand: {visible(finding.hint)}"
    return f"no repair is certain: {program()} rule {finding.rule} says how"


def _why_left(finding: Finding, fixed: Fixed, *, unsafe: bool) -> str:
    why = fixed.left_out.get(site_of(finding))
    if why is None and finding.fix is None:
        return _LEFT
    if why is None and finding.fix and not (unsafe or finding.fix.safe):
        return "needs --unsafe"
    return f"left out (its repair {why or USELESS})"


def _line(finding: Finding) -> str:
    return visible(f"{finding.rule} {site(finding)}: {finding.message}")


@click.command("fix")
@click.argument("paths", nargs=-1, required=True, metavar="STAGE...", type=Input())
@checkpoint_option("Check for this checkpoint, regardless of the name.")
@click.option("--starter", type=Input(), help="Restore missing parts from this starter.")
@click.option("--lint", is_flag=True, help="Repair the findings of lab3 lint.")
@release_option("--isaac", "release", "With --lint: check for this release of Isaac Sim.")
@release_option(
    "--from",
    "moved_from",
    "With --lint: also repair what differs in this release, from which the stage comes.",
)
@click.option(
    "--unsafe",
    is_flag=True,
    help="Also add, remove and move prims, and make repairs that are only probable.",
)
@writing_options("repaired")
@click.option(
    "--force",
    is_flag=True,
    help="Replace an existing output, or a file that is read-only, hard-linked or another user's.",
)
@rules_options
@assets_option
@config_options
@recorded("repair", RepairOptions)
def command(
    paths: tuple[str, ...],
    repair: RepairOptions,
    writing: WritingOptions,
    configuration: ConfigOptions,
) -> None:
    """Repair stages.

    A stage or script that names no checkpoint is repaired as with --lint. Values, connections,
    targets, types and schemas are repaired; --unsafe also adds, removes and moves prims. In a text
    stage no other line changes. In a folder all stages with a checkpoint in their names are
    repaired; with --lint, all stages. Without --diff, --output or --in-place the repairs are only
    listed.

    Exit code: 0 nothing is left, 1 errors or repairs are left, or would be made, 2 wrong usage;
    with --diff 1 if something would change.
    """
    config = configured(paths, configuration)
    sys.exit(repair_stages(paths, repair, writing, config))
