"""`lab3 lint`: judge any stage of Isaac Sim, without a spec."""

from __future__ import annotations

import sys
from typing import Any

import click

from lab3_usd.commands.steps.options import (
    assets_option,
    config_options,
    native_option,
    report_options,
    view_options,
    with_config,
)


@click.command("lint")
@click.argument("paths", nargs=-1, required=True)
@click.option(
    "--isaac",
    "release",
    metavar="RELEASE",
    help="Judge by this release of Isaac Sim (5.0 to 6.2), where defaults and ports differ.",
)
@assets_option
@native_option
@report_options
@config_options
@view_options
def command(paths: tuple[str, ...], **options: Any) -> None:
    """Judge any stage of Isaac Sim by what its graphs do.

    PATHS are stage files, or folders with stages in them or below. Stages only have to work: what
    is found are nodes that never compute or compute on zeros, dead wires, topics, frames, robots
    and sensors that do not fit together. Exit status: 0 nothing found, 1 findings or
    not judged, 2 wrong usage or no such path, 3 the tool itself failed.
    """
    options = with_config(paths, options)
    from lab3_usd.commands.steps.judging import Judge, run
    from lab3_usd.commands.steps.reporting import refuse_unusable, wants_native

    refuse_unusable(paths, options)
    from lab3_usd.judge.lint import LintSettings, find_stages, lint_lab, lint_stages
    from lab3_usd.spec.isaac import BASE

    settings = LintSettings(
        options["release"] or BASE, heeds_ignores=True, native=wants_native(options)
    )
    lint_lab(settings.release)  # which refuses an unknown one
    judge = Judge(
        find=lambda path: find_stages(path, options["config"]),
        judge=lambda entries, jobs: lint_stages(entries, settings, jobs),
        module="lab3_usd.check.lint",
    )
    sys.exit(run(paths, judge, options))
