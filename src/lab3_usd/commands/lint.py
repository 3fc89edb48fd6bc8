"""`lab3 lint`: judge any stage of Isaac Sim, without a spec."""

from __future__ import annotations

import sys
from typing import Any

import click

from lab3_usd.commands.steps.configuring import config_options, with_config
from lab3_usd.commands.steps.report_options import native_option, report_options, view_options


@click.command("lint")
@click.argument("paths", nargs=-1, required=True)
@click.option(
    "--isaac",
    "release",
    metavar="RELEASE",
    help="Judge by this release of Isaac Sim (5.0, 5.1, 6.0), where defaults and ports differ.",
)
@native_option
@report_options
@config_options
@view_options
def command(paths: tuple[str, ...], **options: Any) -> None:  # noqa: ANN401 - one entry per option
    """Judge any stage of Isaac Sim by what its graphs do.

    PATHS are stage files, or folders with stages in them or below. Stages only have to work: what
    is found are nodes that never compute or compute on zeros, dead wires, topics, frames, robots
    and sensors that do not fit together. Exit status: 0 nothing found, 1 findings, 2 wrong usage
    or no such path, 3 the tool itself failed.
    """
    from lab3_usd.commands.steps.linting import run  # noqa: PLC0415 - keeps --help fast

    sys.exit(run([*paths], with_config(paths, options)))
