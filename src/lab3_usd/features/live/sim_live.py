"""`lab3 sim --live`: plays a stage in real time, driven by the topics of its commands."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lab3_usd.commands.shared.options import all_of
from lab3_usd.errors import UsageError
from lab3_usd.features.sim.additions import SimAddition, SimOptions
from lab3_usd.installation import install_command

if TYPE_CHECKING:
    from lab3_usd.features.live.dds import DdsLink
    from lab3_usd.sim.timeline import Player
    from lab3_usd.spec.lab import Lab

LONGEST = 86400.0  # seconds
SLOW = 0.95  # times real time, below which the last line names the speed
_NOT_WITH = ("drive", "page", "bag")
_EXTRA = ("cyclonedds", "rosbags")
OPTIONS = all_of(
    click.option(
        "--live",
        is_flag=True,
        help="Run in real time over DDS, driven by the topics of commands (extra live).",
    ),
    click.option("--seconds", type=float, metavar="S", help="End --live after this many seconds."),
)


class Added(SimAddition, frozen=True):
    """Whether a stage is played live, and for how many simulated seconds; None until Ctrl-C."""

    live: bool
    seconds: float | None

    def refuse(self, asked: SimOptions) -> None:
        """Refuse what does not go together, before anything is played.

        Raises:
            UsageError: options do not go together, or the extra is not installed.
        """
        seconds = self.seconds
        given = click.get_current_context().params
        refused = [f"--{name}" for name in _NOT_WITH if given.get(name) is not None]
        refused += ["--format json"] if asked.form == "json" else []
        message = ""
        if not self.live:
            message = "--seconds is for --live only" if seconds is not None else ""
        elif refused:
            message = (
                f"--live and {refused[0]} do not go together: it is driven over ROS, not judged"
            )
        elif seconds is not None and not 0 < seconds <= LONGEST:
            message = f"--seconds {seconds:g}: is not between 0 and {LONGEST:.0f}"
        elif any(find_spec(name) is None for name in _EXTRA):
            message = f"--live needs the extra live: {install_command('live')}"
        if message:
            raise UsageError(message)

    def plays_instead(self, stage: Path, lab: Lab, checkpoint: str, topic: str) -> bool:
        """Play live if that is asked for."""
        if self.live:
            play(stage, lab, checkpoint, topic, self.seconds)
        return self.live


def play(stage: Path, lab: Lab, checkpoint: str, topic: str, seconds: float | None) -> None:
    """Play a stage until Ctrl-C, or for so many simulated seconds.

    Raises:
        UsageError: DDS does not start.
        StageError: the stage cannot be read.
    """
    from lab3_usd.features.live.dds import DdsLink, play_live
    from lab3_usd.report.behaviour.text import WHAT_IT_IS
    from lab3_usd.report.safe_text import printable
    from lab3_usd.sim.dry_run import scene_of
    from lab3_usd.sim.execution.drive import RATE
    from lab3_usd.sim.judge.topics import expected_at
    from lab3_usd.sim.robots import expected_of, robots_of
    from lab3_usd.sim.timeline import player_of

    scene, platform = scene_of(stage, lab.platform), lab.platform
    if checkpoint:
        wanted = expected_at(lab, lab.checkpoints[checkpoint])
    else:
        robots = robots_of(scene, platform, topic)
        wanted = expected_of(robots[0] if robots else None)
    player = player_of(scene, platform, wanted)
    player.world.network.environment = os.environ.get("ROS_DOMAIN_ID", "")

    def tell(topic: str, kind: str, domain: int) -> None:
        click.echo(printable(f"listens to {topic} ({kind}) in domain {domain}"))

    with closing(DdsLink(wanted.domain)) as link:
        click.echo(f"{printable(str(stage))}: {WHAT_IT_IS}")
        click.echo("live on 127.0.0.1; Ctrl-C ends")
        frames = math.inf if seconds is None else seconds * RATE
        played, took = play_live(player, link, lambda count: count >= frames, tell, topic)
    for line in closing_lines(player, link, played, took):
        click.echo(printable(line))


def closing_lines(player: Player, link: DdsLink, played: float, took: float) -> Iterator[str]:
    """Yield the last lines: topics, time, and what was left out."""
    from lab3_usd.sim.timeline import unknown_in

    yield ""
    several = len({domain for *_, domain in link.sent}) > 1
    for (topic, kind, domain), count in sorted(link.sent.items()):
        where = f" in domain {domain}" if several else ""
        yield f"{topic:<20} {kind:<27} {count} sent{where}"
    if not link.sent:
        yield "nothing was sent"
    yield ""
    for topic, kind, domain in sorted(link.unsent):
        where = f" in domain {domain}" if several else ""
        yield f"not sent: {topic} ({kind}){where}: a dry run does not make its content"
    for domain, reason in sorted(link.refused.items()):
        yield f"not sent or heard: what is in domain {domain}: DDS does not start there: {reason}"
    for prim, node in player.program.nodes.items():
        if node.failure is not None:
            yield f"failed: {prim}: {node.failure.reason}"
    for prim, reason in unknown_in(player.world).items():
        yield f"not simulated: {prim}: {reason}"
    if link.lost:
        yield f"{link.lost} messages were lost, because a subscriber does not keep up"
    rate = played / took if took else 1.0
    slow = f", at {rate:.2f} times real time: this computer is too slow" if rate < SLOW else ""
    yield f"{played:.1f} s played{slow}; {player.world.network.count} commands received"
