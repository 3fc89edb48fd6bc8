"""`lab3 check`: judge stages, folders of stages, and submissions."""

from __future__ import annotations

import sys
from typing import Any

import click

from lab3_usd.commands.options import split_rules


@click.command("check")
@click.argument("paths", nargs=-1, required=True)
@click.option("--checkpoint", metavar="NN", help="Judge at this checkpoint, whatever the name.")
@click.option("--starter", type=click.Path(), help="The supplied starter, to compare with.")
@click.option("--maps", type=click.Path(), help="Folder that holds the map files.")
@click.option(
    "--format",
    "form",
    default="text",
    metavar="NAME",
    show_default=True,
    help="How to report: text, json, sarif, ... (a wrong name lists them all).",
)
@click.option("--output", "-o", type=click.Path(), help="Write the report to this file.")
@click.option(
    "--select", multiple=True, metavar="RULES", help="Only these rules (W01) or families (W)."
)
@click.option("--ignore", multiple=True, metavar="RULES", help="Not these rules or families.")
@click.option(
    "--fail-on",
    type=click.Choice(["error", "warning"]),
    default="error",
    show_default=True,
    help="Exit 1 from this severity on.",
)
@click.option("--exit-zero", is_flag=True, help="Exit 0 whatever is found.")
@click.option("--require-evidence", is_flag=True, help="Missing evidence is an error.")
@click.option(
    "--jobs",
    "-j",
    type=click.IntRange(1, 256),
    default=1,
    metavar="N",
    show_default=True,
    help="Judge N files or submissions at once, each in a process of its own.",
)
@click.option("--quiet", "-q", is_flag=True, help="Only the summary lines.")
@click.option("--verbose", "-v", is_flag=True, help="Also why each rule matters.")
@click.option("--statistics", is_flag=True, help="Count the faults by rule.")
def command(paths: tuple[str, ...], **options: Any) -> None:  # noqa: ANN401 - one entry per option
    """Check stages and submissions against the lab.

    PATHS are stage files, folders of stages, or submission folders. The checkpoint is read from
    each file's name (Lab3_03...). Exit status: 0 nothing found, 1 findings, 2 wrong usage or no
    such path, 3 the tool itself failed.
    """
    from lab3_usd.commands.checking import run  # noqa: PLC0415 - keeps --help fast

    options["select"] = split_rules(options["select"])
    options["ignore"] = split_rules(options["ignore"])
    sys.exit(run([*paths], options))
