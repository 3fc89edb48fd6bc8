"""What a stage does in a dry run, in words that two states of it can be compared by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lab3_usd.errors import StageError
from lab3_usd.isaac.platform import Platform
from lab3_usd.sim.any_stage import play_any
from lab3_usd.sim.judge.expectations import Trial

_MOVED = 1e-3  # metres or radians; less is numerical noise


def effects_of(stage: Any, platform: Platform) -> frozenset[str]:
    """Return what an open stage does in a dry run: which nodes publish what, and what moves.

    Nothing is known of one that cannot be played. `lab3 fix` calls it before and after repairs.
    """
    from lab3_usd.stage.read.opening import quiet
    from lab3_usd.stage.read.scene import read_scene

    try:
        with quiet():
            played = play_any(read_scene(stage, platform), platform, None)
    except StageError:
        return frozenset()
    # The first play shows the messages of all.
    sent = {(message.node, message.type) for message in played.plays[0].trial.recording.messages}
    pairs = zip(played.robots, played.plays, strict=False)
    moving = [robot for robot, play in pairs if _moves(play.trial)]
    return frozenset(
        (
            *(f"{node} publishes {kind}" for node, kind in sent),
            *(f"{robot.controller} moves its robot" for robot in moving),
        )
    )


def _moves(play: Trial) -> bool:
    places: list[tuple[float, ...]] = [
        (pose.x, pose.y, pose.heading) for pose in play.recording.path
    ]
    joints: list[tuple[float, ...]] = [
        tuple(held.positions.values()) for held in play.recording.held
    ]
    return any(_differ(states) for states in (places, joints))


def _differ(states: Sequence[tuple[float, ...]]) -> bool:
    """Whether any number of some states differs from that of the first one."""
    return any(
        abs(now - first) > _MOVED
        for state in states[1:]
        for first, now in zip(states[0], state, strict=False)
    )
