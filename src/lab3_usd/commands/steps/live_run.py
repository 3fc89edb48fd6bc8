"""Plays a stage for other programs of ROS 2 on this computer, and says what was sent and heard."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lab3_usd.errors import UsageError

if TYPE_CHECKING:
    from lab3_usd.sim.behaviour.evidence import Interface
    from lab3_usd.sim.live.playing import Lived
    from lab3_usd.spec.lab import Lab

LONGEST = 86400.0  # seconds
SLOW = 0.95  # times real time: what is below is said
_NOT_WITH = ("drive", "page", "bag")
_EXTRA = ("cyclonedds", "rosbags")


def check_live(options: Mapping[str, Any]) -> None:
    """Refuse what does not go together, before anything is played.

    Raises:
        UsageError: options do not go together, or the extra is not installed.
    """
    seconds = options["seconds"]
    others = [f"--{each}" for each in _NOT_WITH if options[each] is not None]
    others += ["--format json"] if options["form"] == "json" else []
    message = ""
    if not options["live"]:
        message = "--seconds is for --live only" if seconds is not None else ""
    elif others:
        message = f"--live and {others[0]} do not go together: it is driven over ROS, not judged"
    elif seconds is not None and not 0 < seconds <= LONGEST:
        message = f"--seconds {seconds:g}: is not between 0 and {LONGEST:.0f}"
    elif any(find_spec(each) is None for each in _EXTRA):
        message = "--live needs the extra lab3-usd[live]: pip install 'lab3-usd[live]'"
    if message:
        raise UsageError(message)


def live(stage: Path, lab: Lab, checkpoint: str, seconds: float | None) -> None:
    """Play a stage until Ctrl-C, or for so many simulated seconds.

    Raises:
        UsageError: DDS does not start.
        StageError: the stage cannot be read.
    """
    from lab3_usd.report.safe_text import printable  # noqa: PLC0415 - see sim
    from lab3_usd.sim.behaviour.ros_interface import interface  # noqa: PLC0415
    from lab3_usd.sim.dry_run import scene_of  # noqa: PLC0415
    from lab3_usd.sim.live.link import Link  # noqa: PLC0415 - of the extra
    from lab3_usd.sim.live.playing import play_live  # noqa: PLC0415
    from lab3_usd.sim.play import player_of  # noqa: PLC0415

    wanted = interface(lab, lab.checkpoints[checkpoint])
    player = player_of(scene_of(stage), lab.catalog, wanted)
    player.world.network.environment = os.environ.get("ROS_DOMAIN_ID", "")
    with closing(Link(wanted.domain, wanted.commands)) as link:
        _say_what(stage, wanted)
        lived = play_live(player, link, _after(seconds))
    for line in said_of(lived):
        click.echo(printable(line))


def _say_what(stage: Path, wanted: Interface) -> None:
    from lab3_usd.report.behaviour.words import WHAT_IT_IS  # noqa: PLC0415 - see sim
    from lab3_usd.report.safe_text import printable  # noqa: PLC0415

    click.echo(f"{printable(str(stage))}: {WHAT_IT_IS}")
    click.echo(
        f"live in domain {wanted.domain} on 127.0.0.1, "
        f"commands from {wanted.commands or 'nowhere'}; Ctrl-C ends"
    )


def _after(seconds: float | None) -> Callable[[int], bool]:
    from lab3_usd.sim.execution.drive import RATE  # noqa: PLC0415

    return lambda frames: seconds is not None and frames >= seconds * RATE


def said_of(lived: Lived) -> Iterator[str]:
    """Yield what is said in the end: topics, time, and what was left out."""
    yield ""
    for (topic, kind), count in lived.sent.items():
        yield f"{topic:<20} {kind:<27} {count} sent"
    if not lived.sent:
        yield "nothing was sent"
    yield ""
    for topic, domain in lived.away:
        yield f"not sent: {topic}, as it is in domain {domain}"
    for prim, reason in lived.not_simulated.items():
        yield f"not simulated: {prim}: {reason}"
    if lived.lost:
        yield f"{lived.lost} messages were lost, as a program that listens does not keep up"
    rate = lived.played / lived.took if lived.took else 1.0
    slow = f", at {rate:.2f} times real time: this computer is too slow" if rate < SLOW else ""
    yield f"{lived.played:.1f} s played{slow}; {lived.commands} commands heard"
