"""`lab3 record`: write the script that plays the stages in Isaac Sim itself."""

from __future__ import annotations

from pathlib import Path

import click

from lab3_usd.commands.shared.options import echo, written_file
from lab3_usd.data import program
from lab3_usd.deliverables.nav2_templates import fill_template
from lab3_usd.errors import UsageError
from lab3_usd.sim.execution.drive import COMMANDS, RATE, Leg, fixed_drive
from lab3_usd.sim.judge.topics import expected_of_each
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.submission import example_of

_NAMES = ("", "-again", "-domain")  # what a bag is called beside its stage, by session


def isaac_script(lab: Lab, script: Path) -> str:
    """Return the script for the Python of Isaac Sim; it has not been run there.

    Raises:
        UsageError: the lab has no topic to drive its robots by.
    """
    each = expected_of_each(lab, [*lab.checkpoints.values()][-1]).values()
    driven = {wanted.commands: fixed_drive(wanted.limits) for wanted in each if wanted.commands}
    if not driven:
        raise UsageError(
            f"{lab.title} has no topic of velocity commands to send; play its stages by hand, "
            "and record them with: ros2 bag record --all"
        )
    package, kind = lab.topics[next(iter(driven))].type.rsplit("/", 1)
    domain = lab.ros.system.domain
    drives = [
        (name, sessions[0].environment or "0", [" ".join(map(_leg_text, s.legs)) for s in sessions])
        for name, *sessions in zip(_NAMES, *driven.values(), strict=True)
    ]
    return fill_template(
        Path(__file__).with_name("play.py.j2"),
        program=program(),
        title=lab.title,
        script=script.name,
        stages=[example_of(checkpoint.file, lab.team) for checkpoint in lab.checkpoints.values()],
        drives=drives,
        package=package.replace("/", "."),
        kind=kind,
        topics=[*driven],
        domain=domain,
        setup=lab.ros.system.setup,
        rate=round(RATE),
        every=round(RATE / COMMANDS),
    )


def _leg_text(leg: Leg) -> str:
    """Write a leg: its seconds, and what is sent in it."""
    return ",".join(f"{number:g}" for number in (round(leg.seconds, 4), *(leg.command or ())))


@click.command("record")
@written_file("script", "Where to write the script.")
def command(script: Path, *, force: bool) -> None:
    """Write a script that plays the stages in Isaac Sim itself, and records bags.

    For the Python of Isaac Sim 6.0.1, on a computer that also has ROS 2: it opens each stage of the
    lab without a window, drives the robot as `lab3 sim` does, and records bags for `lab3 bag`. It
    has not been run in Isaac Sim.
    """
    from lab3_usd.files import make_folder, write_whole
    from lab3_usd.spec.load.loader import load_lab

    make_folder(script.parent)
    write_whole(script, isaac_script(load_lab(), script).encode(), force=force)
    echo(script)
