"""What of a play belongs to one robot: the topics and frames by which it is judged."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from lab3_usd.facts.tree import SentTransform
from lab3_usd.facts.tree import tree_of as build_tree
from lab3_usd.isaac.topics import TRANSFORMS
from lab3_usd.model.dry_run import Scene
from lab3_usd.sim.arms import shown_prims
from lab3_usd.sim.execution.recording import Message, kept_transforms
from lab3_usd.sim.judge.expectations import Trial, in_root
from lab3_usd.sim.nodes.transforms import frame_name
from lab3_usd.sim.robots import Robot

_KEPT = "_static"  # what the topic of transforms that are kept has more


def _heard_on(message: Message) -> str:
    """Return the TF topic that listeners read together with a message's: /tf for /tf_static."""
    return message.topic.removesuffix(_KEPT) if message.static else message.topic


def _is_of_another(node: str, robot: Robot, robots: Sequence[Robot], played: Trial) -> bool:
    """Whether the transforms of a node are those of another robot, or of several by one name.

    Those of no robot are held against the one that has odometry.
    """
    prims = shown_prims(played, node)
    machines = ((each.name, each.machine) for each in robots if each.machine is not None)
    names = {name for name, machine in machines if machine.is_named_by(prims)}
    if not names:
        return bool(prims) or (len(robots) > 1 and not robot.odometry)
    rest = names - {robot.name}
    ends = {name.rpartition("/")[2] for name in rest}
    return bool(rest) and (names == rest or robot.name.rpartition("/")[2] in ends)


def own_view(robot: Robot, robots: Sequence[Robot], played: Trial, scene: Scene) -> Trial:
    """Return the play of a robot with the topics and frames that are its own.

    What hangs above the frame of its odometry is left out: the robot is seen from there.
    """
    messages = [message for message in played.recording.messages if message.away is None]
    nodes = dict.fromkeys(message.node for message in messages if message.type == TRANSFORMS)
    away = {node for node in nodes if _is_of_another(node, robot, robots, played)}
    messages = [message for message in messages if message.node not in away]
    first = next((message for message in messages if message.node == robot.odometry), None)
    named = first.data.child if first is not None else ""
    base = named or (frame_name(scene.prims[robot.body]) if robot.body else "")
    root = first.frame if first is not None else ""
    tf = [m for m in messages if m.type == TRANSFORMS]
    of_base = [m for m in tf if any(child == base for _, child in m.frames)]
    # One that is kept for ever is heard beside the others, and never moves.
    has_base = (_heard_on(m) for m in sorted(of_base, key=lambda m: m.static))
    topics = {message.node: message.topic for message in messages}
    wanted = replace(
        played.wanted,
        odometry=first.topic if first is not None else "",
        transforms=next(has_base, ""),
        scan=topics.get(robot.scan, ""),
        base=base,
    )
    heard = build_tree(
        SentTransform(*frames, m.node)
        for m in tf
        for frames in m.frames
        if _heard_on(m) == wanted.transforms
    )
    root = root or next(reversed(heard.above(base)), base)
    below = [
        replace(m, data=tuple(frame for frame in m.transforms if frame.child != root))
        if any(child == root for _, child in m.frames)
        else m
        for m in messages
    ]
    recording = replace(
        played.recording, messages=below, static=kept_transforms(below), _sorted={}, _trees={}
    )
    trial = replace(
        played,
        recording=recording,
        wanted=replace(wanted, root=root),
        start=robot.start,
    )
    sent = recording.topic(wanted.transforms, 0)
    place = in_root(trial, base, sent[0]) if sent else None
    return trial if place is None else replace(trial, start=robot.start.then(place.inverse()))
