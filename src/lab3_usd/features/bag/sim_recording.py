"""`lab3 sim --bag`: records a run as a bag."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lab3_usd.commands.shared.paths import OutputFolder
from lab3_usd.errors import UsageError
from lab3_usd.features.sim.additions import SimAddition, SimOptions
from lab3_usd.installation import install_command

if TYPE_CHECKING:
    from lab3_usd.sim.outcome import DryRun
    from lab3_usd.spec.lab import Lab

OPTIONS = click.option(
    "--bag", type=OutputFolder(path_type=Path), help="Record it as a bag (MCAP) in this new folder."
)


class Added(SimAddition, frozen=True):
    """The new folder of the bag, if a run is recorded."""

    bag: Path | None

    def refuse(self, _asked: SimOptions) -> None:
        """Refuse a bag that cannot be written, before anything is played.

        Raises:
            UsageError: it is there already, or the extra is not installed.
        """
        if self.bag is not None and self.bag.exists():
            raise UsageError(f"--bag {self.bag}: exists already; name a new folder")
        if self.bag is not None and find_spec("rosbags") is None:
            raise UsageError(f"--bag needs the extra sim: {install_command('sim')}")

    def lines_after(self, run: DryRun, lab: Lab) -> Iterator[str]:
        """Record the run, and yield what the bags hold."""
        if self.bag is not None and run.plays:
            yield from record_run(run, lab, self.bag)


def record_run(run: DryRun, lab: Lab, bag: Path) -> Iterator[str]:
    """Write a run as a bag for each domain, and yield what each holds, and what it cannot hold."""
    from lab3_usd.report.safe_text import printable
    from lab3_usd.sim.bag.writer import tape_of, tape_of_plays, write_bags

    first, *further = run.plays.values()
    tape = tape_of(first)
    if run.scene is not None and further:
        tape = tape_of_plays(run.scene, lab.platform, [first, *further])
    for written in write_bags(bag, tape):
        holds = f"{written.messages} messages on {written.topics} topics"
        yield printable(f"recorded: {written.folder}: {holds}")
        if written.left_out:
            yield printable(f"  without content, so not recorded: {', '.join(written.left_out)}")
    told = {(command.domain, command.topic) for command in tape.commands}
    for robot in run.behaviour.robots:
        if (robot.domain, robot.topic) not in told:
            yield printable(f"  commands on {robot.topic} come in another play: not recorded")
