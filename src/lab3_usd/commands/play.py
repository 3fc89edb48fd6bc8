"""`lab3 play`: write the script that plays the stages in Isaac Sim itself."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.options import script_options
from lab3_usd.data import program
from lab3_usd.deliverables.scripts import fill_template
from lab3_usd.errors import UsageError
from lab3_usd.sim.execution.drive import COMMANDS, RATE, Leg, fixed_drive
from lab3_usd.sim.judge.topics import expected_at
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import example_of

_NAMES = ("", "-again", "-domain")  # what a bag is called beside its stage, by session


def isaac_script(lab: Lab, script: Path) -> str:
    """Return the script for the Python of Isaac Sim; it has not been run there.

    Raises:
        UsageError: the lab has no topic to drive its robot by.
    """
    wanted = expected_at(lab, [*lab.checkpoints.values()][-1])
    topic = wanted.commands
    if not topic:
        raise UsageError(
            f"{lab.title} has no topic of velocity commands to send; play its stages by hand, "
            "and record them with: ros2 bag record --all"
        )
    package, kind = lab.topics[topic].type.rsplit("/", 1)
    domain = lab.ros.system.domain
    drives = [
        (name, session.environment or "0", " ".join(map(_leg_text, session.legs)))
        for name, session in zip(_NAMES, fixed_drive(wanted.limits), strict=True)
    ]
    return fill_template(
        "play.py.j2",
        program=program(),
        title=lab.title,
        script=script.name,
        stages=[example_of(checkpoint.file) for checkpoint in lab.checkpoints.values()],
        drives=drives,
        package=package.replace("/", "."),
        kind=kind,
        topic=topic,
        domain=domain,
        setup=lab.ros.system.setup,
        rate=round(RATE),
        every=round(RATE / COMMANDS),
    )


def _leg_text(leg: Leg) -> str:
    """Write a leg: its seconds, and what is sent in it."""
    return ",".join(f"{number:g}" for number in (round(leg.seconds, 4), *(leg.command or ())))


@click.command("play")
@script_options
def command(script: Path, *, force: bool) -> None:
    """Write the script that plays the stages in Isaac Sim itself, and records them.

    For the Python of Isaac Sim 6.0.1, on a computer that also has ROS 2: it opens each stage of the
    lab without a window, drives the robot as `lab3 sim` does, and records bags for `lab3 bag`. It
    has not been run in Isaac Sim.
    """
    from lab3_usd.files import write_whole
    from lab3_usd.spec.load.loader import load_lab

    write_whole(script, isaac_script(load_lab(), script).encode(), force=force)
    click.echo(script)
