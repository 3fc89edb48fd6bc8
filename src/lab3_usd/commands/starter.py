"""`lab3 starter`: write the starter scene of the lab."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.options import echo, written_file


@click.command("starter")
@written_file("target", "The stage to write; its name ends in .usda.")
def command(target: Path, *, force: bool) -> None:
    """Write the starter scene of the lab, as its starter.yaml describes it.

    In the bundled lab it is a robot with physics in a closed room, with neither graphs nor sensors.
    """
    from lab3_usd.stage.write.starter import build_starter

    build_starter(target, force=force)
    echo(target)
