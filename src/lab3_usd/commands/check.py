"""`lab3 check`: judge stages, folders of stages, and submissions."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import Struct
from msgspec.structs import replace

from lab3_usd import hooks
from lab3_usd.commands.shared.configuration import (
    ConfigOptions,
    asset_places,
    config_options,
    configured,
    force_exclude_option,
    path_text,
    unexcluded,
)
from lab3_usd.commands.shared.options import (
    ReportOptions,
    ViewOptions,
    assets_option,
    checkpoint_option,
    native_option,
    recorded,
    refuse_options,
    report_options,
    view_options,
)
from lab3_usd.commands.shared.paths import Input, MapInput
from lab3_usd.data import program
from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from lab3_usd.commands.shared.judging import Judge
    from lab3_usd.commands.shared.reporting import Reporting
    from lab3_usd.pipeline.results import Results, Target


class CheckOptions(Struct, frozen=True):
    """By what stages are judged: at which checkpoint, and with which supplied files.

    `native` adds the validators of OpenUSD, and `sim` a dry run of each stage.
    """

    checkpoint: str | None
    starter: str | None
    maps: str | None
    native: bool
    sim: bool
    submission: bool
    require_evidence: bool
    untrusted: bool
    force_exclude: bool


@click.command("check")
@click.argument("paths", nargs=-1, required=True, type=Input())
@checkpoint_option("Check for this checkpoint, regardless of the name.")
@click.option("--starter", type=Input(), help="The supplied starter, to compare with.")
@click.option("--maps", type=MapInput(), help="Folder that holds the map files.")
@click.option("--sim", is_flag=True, help="Also simulate each stage; its failed checks are notes.")
@assets_option
@native_option
@report_options
@click.option(
    "--submission",
    is_flag=True,
    help="Check folders as submissions: missing stages, deliverables and checklists count.",
)
@click.option("--require-evidence", is_flag=True, help="Missing evidence is an error.")
@click.option(
    "--untrusted",
    is_flag=True,
    help="Check untrusted submissions as `lab3 grade` does; needs --starter.",
)
@config_options
@force_exclude_option
@view_options
@recorded("asked", CheckOptions)
def command(
    paths: tuple[str, ...],
    asked: CheckOptions,
    report: ReportOptions,
    configuration: ConfigOptions,
    view: ViewOptions,
) -> None:
    """Check stages and submissions against the lab.

    PATHS are stage files, folders of stages, or submission folders. The checkpoint is read from
    each file name. In a folder without a report or a video, missing files are not yet faults,
    unless --submission is given. With --untrusted, PATHS are untrusted submissions: folders or
    archives.

    Exit code: 0 no errors, 1 errors or not judged, 2 wrong usage or no such path, 3 the program
    itself failed.
    """
    if asked.untrusted:
        _refuse_trust(asked, report, configuration, view)
        configuration = replace(configuration, isolated=True)
    config = configured(paths, configuration)
    judged = unexcluded(paths, config) if asked.force_exclude else paths
    asked = replace(
        asked,
        starter=asked.starter or path_text(config.starter),
        maps=asked.maps or path_text(config.maps),
    )
    from lab3_usd.commands.shared.judging import judge_and_report
    from lab3_usd.commands.shared.reporting import Reporting, refuse_unusable

    shared = tuple(file for file in (asked.starter, asked.maps) if file is not None)
    refuse_unusable((*paths, *shared), report)
    reporting = Reporting(report, view, config, asked.starter, plays=asked.sim)
    if asked.untrusted:
        judge = _untrusting_judge(asked.starter, configuration.assets)
    else:
        judge = _judge(shared, asked, reporting)
    sys.exit(judge_and_report(judged, judge, reporting))


def _refuse_trust(
    asked: CheckOptions, report: ReportOptions, configuration: ConfigOptions, view: ViewOptions
) -> None:
    """Refuse options that open untrusted files outside a worker, or judge by them.

    Raises:
        UsageError: such an option is given.
    """
    trusting: dict[str, object] = {
        "--checkpoint": asked.checkpoint,
        "--maps": asked.maps,
        "--sim": asked.sim,
        "--native": asked.native,
        "--require-evidence": asked.require_evidence,
        "--config": configuration.config_file,
        "--watch": view.watch,
    }
    refuse_options(trusting, "is for files that are trusted, and not for --untrusted")
    if report.form == "html":
        raise UsageError(
            f"--format html opens the stages again: use the page that {program()} grade writes"
        )
    if report.form == "gradescope":
        raise UsageError(
            f"--format gradescope plays the stages: use {program()} grade --format gradescope"
        )


def _untrusting_judge(starter: str | None, assets: tuple[str, ...]) -> Judge:
    """Return the judge of untrusted submissions: one after the other, each in a worker.

    Raises:
        UsageError: there is no starter.
    """
    from lab3_usd.commands.shared.judging import Judge

    if starter is None:
        raise UsageError("--untrusted needs the instructor's starter: give --starter")
    file = Path(starter)
    places = asset_places(assets)
    return Judge(
        find=hooks.find_untrusted,
        judge=lambda work, _jobs: hooks.judge_untrusted(
            work, file, places, lambda line: click.echo(f"{program()}: {line}", err=True)
        ),
        module="lab3_usd.check.checker",
    )


def _judge(shared: tuple[str, ...], asked: CheckOptions, reporting: Reporting) -> Judge:
    """Return the judge of stages and submissions.

    Raises:
        UsageError: the checkpoint is unknown, or usd-core has no validators.
    """
    from lab3_usd.commands.shared.judging import Judge
    from lab3_usd.commands.shared.reporting import GRADESCOPE, wants_native
    from lab3_usd.pipeline import entries
    from lab3_usd.pipeline.stage import JudgeSettings, checkpoint_number
    from lab3_usd.spec.load.loader import load_lab

    number, starter, maps = asked.checkpoint, asked.starter, asked.maps
    config, is_gradescope = reporting.config, reporting.report.form == GRADESCOPE
    settings = JudgeSettings(
        checkpoint=None if number is None else checkpoint_number(number, load_lab().checkpoints),
        starter=None if starter is None else Path(starter),
        maps=None if maps is None else Path(maps),
        require_evidence=asked.require_evidence,
        config=config,
        heeds_ignores=not is_gradescope,
        native=wants_native(is_given=asked.native, select=config.select),
        handed_in=asked.submission or is_gradescope,
    )

    def judge(targets: list[Target], jobs: int) -> Iterator[Results]:
        opened = entries.with_kept_starter(settings) if reporting.view.watch else settings
        return entries.judge_all(opened, targets, jobs)

    return Judge(
        find=lambda path: entries.find_entries(path, settings),
        judge=judge,
        module="lab3_usd.check.checker",
        shared=shared,
        renew=entries.with_kept_starter.cache_clear,
    )
