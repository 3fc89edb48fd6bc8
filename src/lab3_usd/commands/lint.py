"""`lab3 lint`: judge any stage of Isaac Sim, without a spec."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from lab3_usd.commands.shared.options import (
    assets_option,
    config_options,
    from_option,
    isaac_option,
    leave_broken_lab,
    native_option,
    report_options,
    scene_option,
    view_options,
    with_config,
)
from lab3_usd.commands.shared.paths import Input
from lab3_usd.errors import UsageError

# What lab3 fix asks for besides the options of lab3 lint.
_AS_FIX = {
    "unsafe": False,
    "starter": None,
    "checkpoint": None,
    "no_orig": False,
    "force": False,
}


@click.command("lint")
@click.argument("paths", nargs=-1, required=True, type=Input())
@isaac_option
@from_option
@click.option("--fix", is_flag=True, help="List the repairs that lab3 fix --lint would make.")
@click.option("--diff", is_flag=True, help="With --fix: print the changes.")
@click.option("--in-place", is_flag=True, help="With --fix: make the repairs.")
@scene_option
@assets_option
@native_option
@report_options
@config_options
@view_options
def command(paths: tuple[str, ...], **options: Any) -> None:
    """Judge any stage of Isaac Sim by what its graphs do, and the graphs that scripts build.

    PATHS are stages, Python scripts and notebooks, or folders with some in them or below. A script
    is read and never run; --stage names the scene that it loads. Findings are nodes that never
    compute or use unset inputs, dead wires, and topics, frames, robots and sensors that do not fit
    together. --fix lists the repairs of findings that have only one; --output FILE, or --in-place,
    which keeps NAME.orig, writes the repaired stage.

    Exit status: 0 no findings, 1 findings or not judged, 2 wrong usage or no such path, 3 the
    program itself failed.
    """
    options = with_config(paths, options)
    leave_broken_lab()
    if options["fix"]:
        from lab3_usd.commands.fix import run as repair

        output = None if options["output"] is None else Path(options["output"])
        sys.exit(repair(paths, {**_AS_FIX, **options, "lint": True, "output": output}))
    if options["diff"] or options["in_place"]:
        raise UsageError("--diff and --in-place go with --fix")
    from lab3_usd.commands.shared.judging import Judge, run
    from lab3_usd.commands.shared.reporting import refuse_unusable, wants_native

    refuse_unusable(paths, options)
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.pipeline.any_stage import AUTO, lint_platform
    from lab3_usd.pipeline.entries import find_stages, judge_all
    from lab3_usd.pipeline.stage import JudgeSettings

    settings = JudgeSettings(
        of_lab=False,
        heeds_ignores=True,
        native=wants_native(options),
        config=options["config"],
        release=options["release"] or BASE,
        moved_from=options["moved_from"] or "",
        scene=options["scene"] or "",
    )
    for release in (settings.release, settings.moved_from):
        if release not in ("", AUTO):
            lint_platform(release)  # which refuses an unknown one
    judge = Judge(
        find=lambda path: find_stages(path, options["config"], alone=len(paths) == 1),
        judge=lambda targets, jobs: judge_all(settings, targets, jobs),
        module="lab3_usd.check.lint",
    )
    sys.exit(run(paths, judge, options))
