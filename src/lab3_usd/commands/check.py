"""`lab3 check`: judge stages, folders of stages, and submissions."""

from __future__ import annotations

import sys
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lab3_usd.commands.steps.options import (
    assets_option,
    config_options,
    native_option,
    report_options,
    view_options,
    with_config,
)

if TYPE_CHECKING:
    from lab3_usd.commands.steps.judging import Judge
    from lab3_usd.judge.results import Entry, Results


@click.command("check")
@click.argument("paths", nargs=-1, required=True)
@click.option("--checkpoint", metavar="NN", help="Judge at this checkpoint, whatever the name.")
@click.option("--starter", type=click.Path(), help="The supplied starter, to compare with.")
@click.option("--maps", type=click.Path(), help="Folder that holds the map files.")
@click.option("--sim", is_flag=True, help="Also play each stage, and note what goes wrong.")
@assets_option
@native_option
@report_options
@click.option("--require-evidence", is_flag=True, help="Missing evidence is an error.")
@config_options
@view_options
def command(paths: tuple[str, ...], **options: Any) -> None:
    """Check stages and submissions against the lab.

    PATHS are stage files, folders of stages, or submission folders. The checkpoint is read from
    each file's name. Exit status: 0 nothing found, 1 findings or not judged, 2 wrong usage or no
    such path, 3 the tool itself failed.
    """
    options = with_config(paths, options)
    shared = tuple(options[name] for name in ("starter", "maps") if options[name] is not None)
    from lab3_usd.commands.steps.judging import run
    from lab3_usd.commands.steps.reporting import refuse_unusable

    refuse_unusable((*paths, *shared), options)
    sys.exit(run(paths, _judge(shared, options), options))


def _judge(shared: tuple[str, ...], options: Mapping[str, Any]) -> Judge:
    """Say how stages and submissions are found and judged.

    Raises:
        UsageError: the checkpoint is unknown, or usd-core has no validators.
    """
    from lab3_usd.commands.steps.judging import Judge
    from lab3_usd.commands.steps.options import checkpoint_number
    from lab3_usd.commands.steps.reporting import wants_native
    from lab3_usd.judge import entries
    from lab3_usd.spec.load.loader import load_lab

    number, starter, maps = (options[name] for name in ("checkpoint", "starter", "maps"))
    settings = entries.JudgeSettings(
        checkpoint=None if number is None else checkpoint_number(number, load_lab().checkpoints),
        starter=None if starter is None else Path(starter),
        maps=None if maps is None else Path(maps),
        require_evidence=options["require_evidence"],
        config=options["config"],
        heeds_ignores=True,
        native=wants_native(options),
    )

    def judge(work: list[Entry], jobs: int) -> Generator[Results]:
        opened = entries.with_kept_starter(settings) if options["watch"] else settings
        return entries.judge_entries(work, opened, jobs)

    return Judge(
        find=lambda path: entries.find_entries(path, settings),
        judge=judge,
        module="lab3_usd.check.checker",
        shared=shared,
        renew=entries.with_kept_starter.cache_clear,
    )
