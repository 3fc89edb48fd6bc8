"""`lab3 play`: write the script that plays the stages in Isaac Sim itself."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.steps.options import script_options


@click.command("play")
@script_options
def command(script: Path, *, force: bool) -> None:
    """Write the script that plays the stages in Isaac Sim itself, and records what they do.

    For Isaac Sim 6.0.1's own Python, on a computer that also has ROS 2: it opens each stage of the
    lab without a window, drives the robot as `lab3 sim` does, and records bags for `lab3 bag`. It
    has not been run in Isaac Sim.
    """
    from lab3_usd.files import write_whole  # noqa: PLC0415 - only this command needs these
    from lab3_usd.sim.isaac_script import isaac_script  # noqa: PLC0415
    from lab3_usd.spec.load.loader import load_lab  # noqa: PLC0415

    write_whole(script, isaac_script(load_lab(), script).encode(), force=force)
    click.echo(script)
