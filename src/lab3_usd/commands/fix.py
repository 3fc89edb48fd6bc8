"""`lab3 fix`: repair what the check finds in a stage."""

from __future__ import annotations

import difflib
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from lab3_usd.commands.steps.options import (
    assets_option,
    checkpoint_number,
    config_options,
    with_config,
)
from lab3_usd.commands.steps.reporting import selected_findings
from lab3_usd.errors import UsageError
from lab3_usd.files import refuse_existing, write_whole
from lab3_usd.fix.repairing import USELESS, Fixed, FixOptions, check_result, fix_linted, fix_stage
from lab3_usd.judge.entries import JudgeSettings, checkpoint_at
from lab3_usd.model.finding import Finding, site_of
from lab3_usd.report.safe_text import visible
from lab3_usd.spec.isaac import BASE
from lab3_usd.spec.load.loader import load_lab

_TEXT = b"#usda"


def run(stage: Path, options: Mapping[str, Any]) -> int:
    """Repair a stage, write and print what was asked for, and return the exit status.

    Raises:
        UsageError: the options do not go together, or a file cannot be written.
        StageError: the stage cannot be opened.
    """
    _check_options(stage, options)
    settings = FixOptions(
        unsafe=options["unsafe"],
        root_only=options["output"] is not None,
        starter=options["starter"],
        wanted=lambda findings: selected_findings(findings, str(stage), options),
        heeds_ignores=True,
    )
    if options["lint"]:
        fixed = fix_linted(stage, options["release"] or BASE, settings)
    else:
        lab, number = load_lab(), options["checkpoint"]
        given = None if number is None else checkpoint_number(number, lab.checkpoints)
        checkpoint = checkpoint_at(str(stage), JudgeSettings(given, config=options["config"]), lab)
        fixed = fix_stage(stage, checkpoint, lab, settings)
    if options["diff"]:
        for line in _diffs(fixed):
            click.echo(line, nl=False)
    else:
        _write(stage, fixed, options)
        _print_findings(stage, fixed, options)
    remain = any(finding.severity == "error" or finding.fix is not None for finding in fixed.left)
    return 1 if remain else 0


def _check_options(stage: Path, options: Mapping[str, Any]) -> None:
    ways = [name for name in ("diff", "output", "in_place") if options[name]]
    if len(ways) > 1:
        raise UsageError("--diff, --output and --in-place exclude each other")
    if options["release"] is not None and not options["lint"]:
        raise UsageError("--isaac goes with --lint")
    if not stage.is_file():
        raise UsageError(f"{stage}: there is no such file")
    output = options["output"]
    if output is not None and output.suffix.lower() != stage.suffix.lower():
        raise UsageError(f"{output}: must end in {stage.suffix}, as the stage does")
    if output is not None and output.exists() and output.samefile(stage):
        raise UsageError(f"{output}: is the stage itself; use --in-place")


def _diffs(fixed: Fixed) -> Iterator[str]:
    """Yield a unified diff of each text file; of others it is said that they differ."""
    for path, data in fixed.files.items():
        name, old = _shown(path), path.read_bytes()
        if not data.startswith(_TEXT):
            yield f"Binary file {name} differs\n"
            continue
        before, after = (text.decode().splitlines(keepends=True) for text in (old, data))
        yield from difflib.unified_diff(before, after, name, name)


def _write(stage: Path, fixed: Fixed, options: Mapping[str, Any]) -> None:
    if options["output"] is not None:
        data = next(iter(fixed.files.values()), stage.read_bytes())
        refuse_existing(options["output"], force=options["force"])
        check_result(fixed, data, options["output"])
        write_whole(options["output"], data, force=options["force"])
        click.echo(f"written: {_shown(options['output'])}")
    if options["in_place"]:
        _replace(fixed, keep=not options["no_orig"], force=options["force"])


def _replace(fixed: Fixed, *, keep: bool, force: bool) -> None:
    """Replace the files of a stage, after the last of them was checked."""
    for path, data in fixed.files.items():
        check_result(fixed, data, path)
    for path in fixed.files if keep else ():
        original = path.with_name(f"{path.name}.orig")
        write_whole(original, path.read_bytes(), force=force)
        original.chmod(path.stat().st_mode)
    for path, data in fixed.files.items():
        mode = path.stat().st_mode
        write_whole(path, data, force=True)
        path.chmod(mode)
        click.echo(f"written: {_shown(path)}")


def _shown(path: Path) -> str:
    return visible(os.path.relpath(path) if path.is_absolute() else str(path))


def _print_findings(stage: Path, fixed: Fixed, options: Mapping[str, Any]) -> None:
    for finding in fixed.repaired:
        click.echo(f"repaired {_line(finding)}")
    for finding in fixed.left:
        why = _why_left(finding, fixed, unsafe=options["unsafe"])
        click.echo(f"{why} {finding.severity} {_line(finding)}")
    written = options["output"] is not None or options["in_place"]
    hint = "" if written or not fixed.files else "; give --diff, --output or --in-place"
    counts = f"{len(fixed.repaired)} repaired, {len(fixed.left)} left"
    click.echo(f"{_shown(stage)}: {counts}{hint}")


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
@click.argument("stage", type=click.Path(path_type=Path))
@click.option("--checkpoint", metavar="NN", help="Judge at this checkpoint, whatever the name.")
@click.option("--starter", type=click.Path(), help="Take what is missing from this starter.")
@click.option("--lint", is_flag=True, help="Repair what lab3 lint finds, without a spec.")
@click.option("--isaac", "release", metavar="RELEASE", help="With --lint: as for lab3 lint.")
@click.option("--diff", is_flag=True, help="Print what would change, and write nothing.")
@click.option("--unsafe", is_flag=True, help="Also add, remove and move prims.")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), help="Write the repaired stage here."
)
@click.option("--in-place", is_flag=True, help="Replace the file; the old one stays as NAME.orig.")
@click.option("--no-orig", is_flag=True, help="With --in-place: keep no NAME.orig.")
@click.option("--force", is_flag=True, help="Replace an output or a NAME.orig that exists.")
@click.option(
    "--select", multiple=True, metavar="RULES", help="Only these rules (W01) or families (W)."
)
@click.option("--ignore", multiple=True, metavar="RULES", help="Not these rules or families.")
@assets_option
@config_options
def command(stage: Path, **options: Any) -> None:
    """Repair a stage.

    Values, connections, targets, types and schemas are repaired; prims are added, removed and
    moved with --unsafe only. In a text stage no other line changes. Without --diff, --output or
    --in-place the repairs are only listed. Exit status: 0 nothing is left, 1 errors or repairs
    are left, 2 wrong usage.
    """
    sys.exit(run(stage, with_config([str(stage)], options)))
