"""`lab3 check`: judge stages, folders of stages, and submissions."""

from __future__ import annotations

import sys
from typing import Any

import click

from lab3_usd.commands.steps.configuring import config_options, with_config
from lab3_usd.commands.steps.report_options import native_option, report_options, view_options


@click.command("check")
@click.argument("paths", nargs=-1, required=True)
@click.option("--checkpoint", metavar="NN", help="Judge at this checkpoint, whatever the name.")
@click.option("--starter", type=click.Path(), help="The supplied starter, to compare with.")
@click.option("--maps", type=click.Path(), help="Folder that holds the map files.")
@click.option("--sim", is_flag=True, help="Also play each stage, and note what goes wrong.")
@native_option
@report_options
@click.option("--require-evidence", is_flag=True, help="Missing evidence is an error.")
@config_options
@view_options
def command(paths: tuple[str, ...], **options: Any) -> None:  # noqa: ANN401 - one entry per option
    """Check stages and submissions against the lab.

    PATHS are stage files, folders of stages, or submission folders. The checkpoint is read from
    each file's name. Exit status: 0 nothing found, 1 findings, 2 wrong usage or no
    such path, 3 the tool itself failed.
    """
    from lab3_usd.commands.steps.checking import run  # noqa: PLC0415 - keeps --help fast

    sys.exit(run([*paths], with_config(paths, options)))
