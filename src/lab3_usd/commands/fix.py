"""`lab3 fix`: repair what the check finds in a stage."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from lab3_usd.commands.steps.configuring import config_options, with_config


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
@config_options
def command(stage: Path, **options: Any) -> None:  # noqa: ANN401 - one entry per option
    """Repair a stage.

    Values, connections, targets, types and schemas are repaired; prims are added, removed and
    moved with --unsafe only. In a text stage no other line changes. Without --diff, --output or
    --in-place the repairs are only listed. Exit status: 0 nothing is left, 1 errors or repairs
    are left, 2 wrong usage.
    """
    from lab3_usd.commands.steps.fixing import run  # noqa: PLC0415 - keeps --help fast

    sys.exit(run(stage, with_config([str(stage)], options)))
