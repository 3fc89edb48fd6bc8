"""`lab3 fix`: repair what the check finds in a stage."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from lab3_usd.commands.shared.options import (
    assets_option,
    checkpoint_number,
    complete_checkpoints,
    config_options,
    echo_folded,
    given_words,
    lab_words,
    rules_options,
    with_config,
)
from lab3_usd.commands.shared.paths import Input
from lab3_usd.commands.shared.reporting import selected_findings
from lab3_usd.commands.shared.writing import (
    check_ways,
    diffs,
    replaced,
    shown,
    writing_options,
)
from lab3_usd.data import program
from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.files import (
    absence,
    is_script_file,
    refuse_existing,
    refuse_shared,
    write_whole,
)
from lab3_usd.fix.repairing import USELESS, Fixed, FixOptions, check_result, fix_linted, fix_stage
from lab3_usd.installation import command_line
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import Finding, site_of
from lab3_usd.pipeline.entries import checkpoint_at
from lab3_usd.pipeline.entries import find_stages as find_linted
from lab3_usd.pipeline.stage import JudgeSettings
from lab3_usd.report.safe_text import visible
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint
from lab3_usd.stage.read.opening import check_file
from lab3_usd.stage.read.watched_files import used_files


def run(paths: Sequence[str], options: Mapping[str, Any]) -> int:
    """Repair stages, write and print what was asked for, and return the exit status.

    Raises:
        UsageError: the options do not go together, or a file cannot be written.
        StageError: there is no stage at a path, or the only one cannot be opened.
    """
    stages = [stage for path in paths for stage in _stages(Path(path), options)]
    _check_options(stages, options)
    if len(stages) == 1:
        return _fix(stages[0], options)
    return max(_fix_one_of_several(stage, options) for stage in stages)


def _fix_one_of_several(stage: Path, options: Mapping[str, Any]) -> int:
    try:
        return _fix(stage, options)
    except Lab3Error as error:  # which the other stages do not wait for
        click.echo(f"{program()}: {visible(str(error))}", err=True)
        return 2


def _stages(path: Path, options: Mapping[str, Any]) -> Iterator[Path]:
    """Yield a stage, or those in and below a folder that can be judged."""
    if not path.is_dir():
        if is_script_file(path):
            _check_script(path, options)
        else:
            check_file(path)
        yield path
        return
    files = [Path(entry.path) for entry in find_linted(str(path), options["config"])]
    if not options["lint"] and options["checkpoint"] is None:
        files = [file for file in files if named_checkpoint(file.name, load_lab().files)]
    if not files:
        raise UsageError(
            f"{path}: holds no stage of a checkpoint, nor does a folder in it; "
            "--lint repairs stages of any name"
        )
    yield from files


def _check_script(path: Path, options: Mapping[str, Any]) -> None:
    """Refuse to judge a script by a lab.

    Raises:
        UsageError: its findings are not those of lint, or there is no such file.
    """
    if not path.exists():
        raise UsageError(absence(path, "file or folder"))
    if not options["lint"]:
        raise UsageError(f"{path}: is a script and no stage; --lint repairs scripts")


def _check_options(stages: Sequence[Path], options: Mapping[str, Any]) -> None:
    check_ways(stages, options)
    for name, value in (("--isaac", "release"), ("--from", "moved_from")):
        if options[value] is not None and not options["lint"]:
            raise UsageError(f"{name} goes with --lint")


def _fix(stage: Path, options: Mapping[str, Any]) -> int:
    settings = FixOptions(
        unsafe=options["unsafe"],
        root_only=options["output"] is not None,
        starter=options["starter"],
        wanted=lambda findings: selected_findings(findings, str(stage), options),
        heeds_ignores=True,
    )
    if is_script_file(stage):
        from lab3_usd.fix.scripts import fix_script

        fixed = fix_script(stage, options["release"] or BASE, settings)
    elif options["lint"]:
        fixed = fix_linted(stage, options["release"] or BASE, settings, options["moved_from"] or "")
    else:
        lab, number = load_lab(), options["checkpoint"]
        given = None if number is None else checkpoint_number(number, lab.checkpoints)
        checkpoint = checkpoint_at(
            str(stage), JudgeSettings(checkpoint=given, config=options["config"]), lab
        )
        fixed = fix_stage(stage, checkpoint, lab, settings)
    if options["diff"]:
        for line in diffs(fixed.files, fixed.states):
            click.echo(line, nl=False)
        return 1 if fixed.files else 0
    if options["output"] is not None:
        data = next(iter(fixed.files.values()), stage.read_bytes())
        refuse_existing(options["output"], force=options["force"])
        _refuse_layers([options["output"]], stage, options["starter"])
        check_result(fixed, data, options["output"])
        write_whole(options["output"], data, force=options["force"])
        click.echo(f"written: {shown(options['output'])}")
    elif options["in_place"]:
        _refuse_layers(fixed.files, options["starter"])
        _replace(fixed, keep=not options["no_orig"], force=options["force"])
    _print_findings(stage, fixed, options)
    is_preview = not (options["output"] or options["in_place"]) and fixed.files
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


def _replace(fixed: Fixed, *, keep: bool, force: bool) -> None:
    """Replace the files of a stage, after the last of them was checked."""
    for path, data in fixed.files.items():
        if not force:
            refuse_shared(path)
        check_result(fixed, data, path)
    for line in replaced(fixed.files, fixed.states, keep=keep):
        click.echo(line)


def _print_findings(stage: Path, fixed: Fixed, options: Mapping[str, Any]) -> None:
    written = options["output"] is not None or options["in_place"]
    for finding in fixed.repaired:
        echo_folded(f"{'repaired' if written else 'would repair'} {_line(finding)}")
    for finding in fixed.left:
        why = _why_left(finding, fixed, unsafe=options["unsafe"])
        echo_folded(f"{why} {finding.severity} {_line(finding)}")
    done = "repaired" if written else "would be repaired"
    click.echo(f"{shown(stage)}: {len(fixed.repaired)} {done}, {len(fixed.left)} left")
    if fixed.files and not written:
        context = click.get_current_context()
        called = (program(), *lab_words(context), str(context.command.name))
        words = command_line(*called, shown(stage), *given_words(context))
        click.echo(f"to repair: {words} --in-place")


def _why_left(finding: Finding, fixed: Fixed, *, unsafe: bool) -> str:
    why = fixed.left_out.get(site_of(finding))
    if why is None and finding.fix is None:
        return "left"
    if why is None and finding.fix and not (unsafe or finding.fix.safe):
        return "needs --unsafe"
    return f"left out (its repair {why or USELESS})"


def _line(finding: Finding) -> str:
    site = finding.prim + (f".{finding.property}" if finding.property else "")
    return visible(f"{finding.rule} {site}: {finding.message}")


@click.command("fix")
@click.argument("paths", nargs=-1, required=True, metavar="STAGE...", type=Input())
@click.option(
    "--checkpoint",
    metavar="NN",
    shell_complete=complete_checkpoints,
    help="Judge at this checkpoint, regardless of the name.",
)
@click.option("--starter", type=Input(), help="Restore missing parts from this starter.")
@click.option("--lint", is_flag=True, help="Repair the findings of lab3 lint.")
@click.option(
    "--isaac",
    "release",
    metavar="RELEASE",
    help="With --lint: judge by this release of Isaac Sim.",
)
@click.option(
    "--from",
    "moved_from",
    metavar="RELEASE",
    help="With --lint: also what this release, which the stage comes from, does otherwise.",
)
@click.option("--unsafe", is_flag=True, help="Also add, remove and move prims, and what is likely.")
@writing_options("repaired")
@click.option(
    "--force",
    is_flag=True,
    help="Replace an existing output, or a file that is read-only, hard-linked or another user's.",
)
@rules_options
@assets_option
@config_options
def command(paths: tuple[str, ...], **options: Any) -> None:
    """Repair stages.

    Values, connections, targets, types and schemas are repaired; --unsafe also adds, removes and
    moves prims. In a text stage no other line changes. In a folder all stages with a checkpoint in
    their names are repaired; with --lint, all stages. Without --diff, --output or --in-place the
    repairs are only listed.

    Exit status: 0 nothing is left, 1 errors or repairs are left, or would be made, 2 wrong usage;
    with --diff 1 if something would change.
    """
    sys.exit(run(paths, with_config(paths, options)))
