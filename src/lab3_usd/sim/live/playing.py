"""Plays a stage in real time: messages go out as they are made, commands come from outside."""

from __future__ import annotations

import time
from collections.abc import Callable

from msgspec import Struct

from lab3_usd.sim.execution.drive import RATE
from lab3_usd.sim.live.link import Link
from lab3_usd.sim.play import Player, unknown_in

BEHIND = 0.25  # seconds that are caught up; what is behind by more goes on from there


class Lived(Struct, frozen=True):
    """What came of it: seconds that were played, in how many of the clock; messages by topic."""

    played: float
    took: float
    commands: int
    sent: dict[tuple[str, str], int]
    lost: int
    away: tuple[tuple[str, int], ...]  # topics of other domains, which were not sent
    not_simulated: dict[str, str]


def play_live(player: Player, link: Link, done: Callable[[int], bool]) -> Lived:
    """Play frame by frame, until it is done after so many frames, or until Ctrl-C."""
    network = player.world.network
    away: dict[tuple[str, int], None] = {}
    begun = due = time.monotonic()
    frames = 0
    try:
        while not done(frames):
            for twist in link.commands():
                player.hear(twist)
            player.step()
            frames += 1
            for message in network.sent:
                if message.away is None:
                    link.publish(message)
                else:
                    away[message.topic, message.away] = None
            network.sent.clear()
            due = paced(due + 1.0 / RATE)
    except KeyboardInterrupt:
        pass
    took = time.monotonic() - begun
    return Lived(
        frames / RATE,
        took,
        player.commands,
        dict(sorted(link.sent.items())),
        link.lost,
        tuple(away),
        unknown_in(player.world),
    )


def paced(due: float) -> float:
    """Wait until a frame is due, and return when it was; late frames follow at once."""
    now = time.monotonic()
    if now < due:
        time.sleep(due - now)
        return due
    return max(due, now - BEHIND)
