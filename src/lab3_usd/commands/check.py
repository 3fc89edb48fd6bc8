"""`lab3 check`: judge stages, folders of stages, and submissions."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lab3_usd import features
from lab3_usd.commands.shared.options import (
    asset_places,
    assets_option,
    complete_checkpoints,
    config_options,
    native_option,
    report_options,
    view_options,
    with_config,
)
from lab3_usd.commands.shared.paths import Input, MapInput
from lab3_usd.data import program
from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from lab3_usd.commands.shared.judging import Judge
    from lab3_usd.pipeline.results import Results, Target


@click.command("check")
@click.argument("paths", nargs=-1, required=True, type=Input())
@click.option(
    "--checkpoint",
    metavar="NN",
    shell_complete=complete_checkpoints,
    help="Judge at this checkpoint, regardless of the name.",
)
@click.option("--starter", type=Input(), help="The supplied starter, to compare with.")
@click.option("--maps", type=MapInput(), help="Folder that holds the map files.")
@click.option("--sim", is_flag=True, help="Also play each stage, and note its faults.")
@assets_option
@native_option
@report_options
@click.option(
    "--submission",
    is_flag=True,
    help="Judge folders as submissions: missing stages, deliverables and checklists count.",
)
@click.option("--require-evidence", is_flag=True, help="Missing evidence is an error.")
@click.option(
    "--untrusted",
    is_flag=True,
    help="Judge untrusted submissions as `lab3 grade` does; needs --starter.",
)
@config_options
@view_options
def command(paths: tuple[str, ...], **options: Any) -> None:
    """Check stages and submissions against the lab.

    PATHS are stage files, folders of stages, or submission folders. The checkpoint is read from
    each file name. In a folder without a report or a video, missing files are not yet faults,
    unless --submission is given. With --untrusted, PATHS are untrusted submissions: folders or
    archives.

    Exit status: 0 no findings, 1 findings or not judged, 2 wrong usage or no such path, 3 the
    program itself failed.
    """
    if options["untrusted"]:
        options = {**options, "isolated": True}
        _refuse_trust(options)
    options = with_config(paths, options)
    shared = tuple(options[name] for name in ("starter", "maps") if options[name] is not None)
    from lab3_usd.commands.shared.judging import run
    from lab3_usd.commands.shared.reporting import refuse_unusable

    refuse_unusable((*paths, *shared), options)
    judge = _untrusting_judge(options) if options["untrusted"] else _judge(shared, options)
    sys.exit(run(paths, judge, options))


_TRUSTING = ("checkpoint", "maps", "sim", "native", "require_evidence", "config_file", "watch")


def _refuse_trust(options: Mapping[str, Any]) -> None:
    """Refuse options that open untrusted files outside a worker, or judge by them.

    Raises:
        UsageError: such an option is given, or no starter.
    """
    for name in _TRUSTING:
        if options[name]:
            option = "--config" if name == "config_file" else f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} is for files that are trusted, and not for --untrusted")
    if options["form"] == "html":
        raise UsageError(
            f"--format html opens the stages again: use the page that {program()} grade writes"
        )
    if options["form"] == "gradescope":
        raise UsageError(
            f"--format gradescope plays the stages: use {program()} grade --format gradescope"
        )
    if options["starter"] is None:
        raise UsageError("--untrusted needs the instructor's starter: give --starter")


def _untrusting_judge(options: Mapping[str, Any]) -> Judge:
    """Return the judge of untrusted submissions: one after the other, each in a worker."""
    from lab3_usd.commands.shared.judging import Judge

    starter, assets = Path(options["starter"]), asset_places(options["assets"])
    return Judge(
        find=features.find_untrusted,
        judge=lambda work, _jobs: features.judge_untrusted(work, starter, assets, _notify),
        module="lab3_usd.check.checker",
    )


def _notify(line: str) -> None:
    click.echo(f"{program()}: {line}", err=True)


def _judge(shared: tuple[str, ...], options: Mapping[str, Any]) -> Judge:
    """Return the judge of stages and submissions.

    Raises:
        UsageError: the checkpoint is unknown, or usd-core has no validators.
    """
    from lab3_usd.commands.shared.judging import Judge
    from lab3_usd.commands.shared.options import checkpoint_number
    from lab3_usd.commands.shared.reporting import wants_native
    from lab3_usd.pipeline import entries
    from lab3_usd.pipeline.stage import JudgeSettings
    from lab3_usd.spec.load.loader import load_lab

    number, starter, maps = (options[name] for name in ("checkpoint", "starter", "maps"))
    settings = JudgeSettings(
        checkpoint=None if number is None else checkpoint_number(number, load_lab().checkpoints),
        starter=None if starter is None else Path(starter),
        maps=None if maps is None else Path(maps),
        require_evidence=options["require_evidence"],
        config=options["config"],
        heeds_ignores=options["form"] != "gradescope",
        native=wants_native(options),
        handed_in=options["submission"] or options["form"] == "gradescope",
    )

    def judge(targets: list[Target], jobs: int) -> Iterator[Results]:
        opened = entries.with_kept_starter(settings) if options["watch"] else settings
        return entries.judge_all(opened, targets, jobs)

    return Judge(
        find=lambda path: entries.find_entries(path, settings),
        judge=judge,
        module="lab3_usd.check.checker",
        shared=shared,
        renew=entries.with_kept_starter.cache_clear,
    )
