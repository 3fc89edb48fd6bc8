"""Looks up where TF has a frame at the time of a message."""

from __future__ import annotations

import math

from lab3_usd.model.dry_run.affine import HERE, Affine, rotation
from lab3_usd.model.transform_math import length, minus
from lab3_usd.sim.behaviour.evidence import Evidence
from lab3_usd.sim.execution.record import Message, Transform

PLACE = (0.02, math.radians(2.0))  # of a sensor, between TF and where it is


def _frames_at(evidence: Evidence, message: Message) -> dict[str, tuple[str, Transform]]:
    found: dict[str, tuple[str, Transform]] = {}
    for each in evidence.recording.topic(evidence.wanted.transforms, message.session):
        if each.at > message.at and found:
            break
        for transform in each.transforms:
            found[transform.child] = (transform.parent, transform)
    held = {each.child: (each.parent, each) for each, _ in evidence.recording.static}
    return {**held, **found}


def in_root(evidence: Evidence, message: Message) -> Affine | None:
    """Return where TF has the frame of a message, or None where it does not have it."""
    frames = _frames_at(evidence, message)
    frame, place = message.frame, HERE
    for _ in range(len(frames)):
        if frame not in frames:
            break
        frame, each = frames[frame]
        place = Affine(rotation(each.rotation), each.translation).then(place)
    return place if frame == evidence.wanted.root else None


def agree(one: Affine, other: Affine) -> bool:
    """Whether two places are the same, as far as a sensor may be off."""
    if length(minus(one.origin, other.origin)) > PLACE[0]:
        return False
    w = one.inverse().then(other).rigid().quaternion()[0]
    return 2 * math.acos(min(1.0, abs(w))) <= PLACE[1]
