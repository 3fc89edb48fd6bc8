"""What a bag is to hold: messages and commands of one play, in which every robot is driven."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from msgspec import Struct

from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import Scene
from lab3_usd.sim.execution.drive import RATE, Leg, Session, command_frames
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.judge.expectations import Trial
from lab3_usd.sim.timeline import content_of, player_of


class SentCommand(NamedTuple):
    """A command: seconds after Play, where it comes, and the leg that says what it is."""

    at: float
    domain: int
    topic: str
    leg: Leg


class Tape(Struct, frozen=True):
    """What came from Play to Stop; `home` is the domain of messages that name none."""

    messages: tuple[Message, ...]
    commands: tuple[SentCommand, ...]
    home: int

    def domain(self, message: Message) -> int:
        """Return the domain in which a message came."""
        return self.home if message.away is None else message.away


def tape_of(trial: Trial) -> Tape:
    """Return the first session of a run: after another Play the robot is back where it began."""
    wanted = trial.wanted
    commands = (
        SentCommand((frame + 1) / RATE, wanted.domain, wanted.commands, leg)
        for frame, leg in command_frames(trial.drive[0])
    )
    messages = (message for message in trial.recording.messages if not message.session)
    return Tape(tuple(messages), tuple(commands), wanted.domain)


def tape_of_plays(scene: Scene, platform: Platform, plays: Sequence[Trial]) -> Tape:
    """Play a stage with the commands of several plays at once, those of each of its robots.

    What one robot hears on a topic, another does as well.
    """
    sessions: dict[tuple[int, str], Session] = {}
    for wanted, session in ((play.wanted, play.drive[0]) for play in plays):
        if wanted.commands:
            sessions.setdefault((wanted.domain, wanted.commands), session)
    player = player_of(scene, platform, plays[0].wanted)
    network = player.world.network
    network.is_open = True
    told: dict[int, list[tuple[tuple[int, str], Leg]]] = {}
    frames = 0
    for place, session in sessions.items():
        for frame, leg in command_frames(session):
            told.setdefault(frame, []).append((place, leg))
        frames = max(frames, sum(round(leg.seconds * RATE) for leg in session.legs))
    commands = []
    for frame in range(frames):
        for place, leg in told.get(frame, ()):
            network.tell(content_of(leg), place)
            commands.append(SentCommand((frame + 1) / RATE, *place, leg))
        player.step()
    return Tape(tuple(network.sent), tuple(commands), network.commands.domain)
