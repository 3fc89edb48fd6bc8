"""`lab3 lint`: check any Isaac Sim stage, without a lab."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from msgspec import Struct

from lab3_usd.commands.shared.configuration import (
    ConfigOptions,
    config_options,
    configured,
    force_exclude_option,
    leave_broken_lab,
    path_text,
    unexcluded,
)
from lab3_usd.commands.shared.options import (
    ReportOptions,
    ViewOptions,
    assets_option,
    from_option,
    isaac_option,
    native_option,
    recorded,
    report_options,
    scene_option,
    view_options,
)
from lab3_usd.commands.shared.paths import Input
from lab3_usd.errors import UsageError


class LintOptions(Struct, frozen=True):
    """By what stages are judged, and whether they are repaired.

    `native` adds the validators of OpenUSD.
    """

    release: str | None
    moved_from: str | None
    scene: str | None
    native: bool
    fix: bool
    diff: bool
    in_place: bool
    unsafe: bool
    force_exclude: bool


@click.command("lint")
@click.argument("paths", nargs=-1, required=True, type=Input())
@isaac_option
@from_option
@click.option("--fix", is_flag=True, help="List the repairs that lab3 fix --lint would make.")
@click.option("--diff", is_flag=True, help="With --fix: print the changes.")
@click.option("--in-place", is_flag=True, help="With --fix: make the repairs.")
@click.option("--unsafe", is_flag=True, help="With --fix: the likely repairs, too.")
@scene_option
@assets_option
@native_option
@report_options
@config_options
@force_exclude_option
@view_options
@recorded("asked", LintOptions)
def command(
    paths: tuple[str, ...],
    asked: LintOptions,
    report: ReportOptions,
    configuration: ConfigOptions,
    view: ViewOptions,
) -> None:
    """Check any Isaac Sim stage, or script: do graphs, topics, frames and joints work together?

    PATHS are stages, Python scripts and notebooks, or folders with some in them or below. A script
    is read and never run; --stage names the scene that it loads. Findings are nodes that never
    compute or use unset inputs, dead wires, and topics, frames, robots and sensors that do not fit
    together. --fix lists the repairs of findings that have only one; --output FILE, or --in-place,
    which keeps NAME.orig, writes the repaired stage.

    Exit code: 0 no errors, 1 errors or not judged, 2 wrong usage or no such path, 3 the program
    itself failed.
    """
    config = configured(paths, configuration)
    judged = unexcluded(paths, config) if asked.force_exclude else paths
    leave_broken_lab()
    if asked.fix:
        from lab3_usd.commands.fix import RepairOptions, repair_stages
        from lab3_usd.commands.shared.writing import WritingOptions

        output = None if report.output is None else Path(report.output)
        repair = RepairOptions(
            lint=True, unsafe=asked.unsafe, release=asked.release, moved_from=asked.moved_from
        )
        writing = WritingOptions(asked.diff, output, asked.in_place)
        sys.exit(repair_stages(judged, repair, writing, config) if judged else 0)
    if asked.diff or asked.in_place or asked.unsafe:
        raise UsageError("--diff, --in-place and --unsafe go with --fix")
    from lab3_usd.commands.shared.judging import Judge, judge_and_report
    from lab3_usd.commands.shared.reporting import Reporting, refuse_unusable, wants_native

    refuse_unusable(paths, report)
    from lab3_usd.isaac.releases import BASE
    from lab3_usd.pipeline.any_stage import AUTO, lint_platform
    from lab3_usd.pipeline.entries import find_stages, judge_all
    from lab3_usd.pipeline.stage import JudgeSettings

    settings = JudgeSettings(
        of_lab=False,
        heeds_ignores=True,
        native=wants_native(is_given=asked.native, select=config.select),
        config=config,
        release=asked.release or BASE,
        moved_from=asked.moved_from or "",
        scene=asked.scene or "",
    )
    for release in (settings.release, settings.moved_from):
        if release not in ("", AUTO):
            lint_platform(release)  # which refuses an unknown one
    judge = Judge(
        find=lambda path: find_stages(path, config, alone=len(paths) == 1),
        judge=lambda targets, jobs: judge_all(settings, targets, jobs),
        module="lab3_usd.check.lint",
    )
    reporting = Reporting(report, view, config, path_text(config.starter))
    sys.exit(judge_and_report(judged, judge, reporting))
