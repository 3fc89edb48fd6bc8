"""How the parts of a behaviour are put into words."""

from __future__ import annotations

from lab3_usd.model.dry_run.behaviour import Behaviour, Leg

WHAT_IT_IS = "a dry run from published node source, not Isaac Sim"
WHAT_A_RECORDING_IS = "a recording of the running system"
LOOKS = {
    "topics": "every topic comes, of its type, from one node, in the lab's domain",
    "rest": "stands still without a command, after one, and when told to go sideways",
    "follows": "follows commands in sense and size",
    "limits": "commands beyond the limits are cut down to them",
    "odometry": "odometry starts at 0 and agrees with the motion",
    "clock": "the clock runs, and never back",
    "stamps": "all stamps are of the clock",
    "tree": "TF is one tree, with one parent and one publisher for each frame",
    "moving frames": "TF moves the base as odometry does",
    "mounted": "lidar and camera go with the robot",
    "scan": "scans come at their rate and show the walls where they are",
    "camera": "image and info belong together, in the frame of an upright camera that looks ahead",
    "again": "drives again after Stop and Play, whatever ROS_DOMAIN_ID says",
}


LOOKS_OF_A_RECORDING = {
    **LOOKS,
    "topics": "every topic comes, of its type",
    "odometry": "the speeds of odometry are those of its way",
    "tree": "TF is one tree, with one parent for each frame",
    "scan": "scans come at their rate, and rays come back",
    "messages": "every message is of the type that its topic says",
    "QoS": "each topic is offered as it is asked for",
    "rates": "what is to stream streams, and its stamps go on",
    "headers": "the headers name the frames that are asked for",
    "frames": "each frame keeps its parent, and its transforms come without gaps",
    "way": "all in all the robot goes as far as it is told",
    "localization": "localization ties the map to odometry",
    "goal": "the last goal was reached",
}


def rate(hz: float) -> str:
    """Return a rate in messages a second; what comes once has none."""
    return f"{hz:.1f}".removesuffix(".0") + " Hz" if hz else "once"


def leg_text(leg: Leg) -> str:
    """Return what was told and done in one leg."""
    parts = []
    if leg.told[0]:
        parts.append(f"{leg.done[0]:+.2f} m of {leg.told[0]:+.2f}")
    if leg.told[1]:
        parts.append(f"{leg.done[1]:+.0f} degrees of {leg.told[1]:+.0f}")
    return f"{leg.name} {' and '.join(parts) or f'{leg.done[0]:.2f} m'}"


def sum_text(found: Behaviour) -> str:
    """Return how the checks came out."""
    verdicts = [each.verdict for each in found.checks]
    bad, unsure = verdicts.count("bad"), verdicts.count("not-simulated")
    said = f"{len(verdicts)} checks: {verdicts.count('ok')} ok, {bad} bad"
    return f"{said}, {unsure} not simulated" if unsure else said
