"""Where the sensors of the lab really stand in a stage."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.check.absence import hides_place, is_at_or_below, is_hidden, why_absent, with_it
from lab3_usd.check.derived import once_per_stage
from lab3_usd.check.finding import Problem
from lab3_usd.check.model import Matrix, Prim, StageModel
from lab3_usd.check.physics import BODY_API, BODY_ENABLED, bodies, is_switched_off, joints
from lab3_usd.check.poses import IDENTITY, relative
from lab3_usd.check.posing import ORDER, RESET
from lab3_usd.check.subject import StageSubject
from lab3_usd.spec.spec import Lab


class Place(Struct, frozen=True):
    """The prim that is a required sensor, at its path or elsewhere; None where there is none.

    `stranger` is the prim of another type that stands at the path instead.
    """

    path: str
    prim: Prim | None = None
    stranger: Prim | None = None

    @property
    def is_misplaced(self) -> bool:
        """Whether the sensor has another name or parent."""
        return self.prim is not None and self.prim.path != self.path

    @property
    def related(self) -> tuple[str, ...]:
        """The path at which the handout wants the sensor that stands elsewhere."""
        return (self.path,) if self.is_misplaced else ()


def find_sensor(lab: Lab, stage: StageModel, name: str) -> Place:
    """Find the sensor `name` of the scene file: at its path, else the prim that is meant.

    Meant is a prim of the right type that hangs below the robot, or has the name and is used by a
    graph; for a sensor that is recognised anywhere, every prim of the type. Of several such, the
    one that a graph uses is the lab's, even beside an unused one at the path.
    """
    spec = lab.scene[name]
    path: str = spec["path"]
    at = stage.prim(path)
    is_there = at is not None and at.type == spec["type"]
    if is_there and spec.get("recognised") != "anywhere":
        return Place(path, at)
    if at is not None and not at.type and is_hidden(stage, path):
        return Place(path)  # the missing asset may say what it is
    found = [*candidates(lab, stage, name)]
    if len(found) > 1:
        found.sort(key=lambda prim: (not is_used(stage, prim), _strangeness(prim, path, lab)))
    return Place(path, found[0] if found else None, None if is_there else at)


def is_used(stage: StageModel, prim: Prim) -> bool:
    """Whether a node names the prim as its target, or a graph that holds nodes lies below it."""
    below = f"{prim.path}/"
    for graph in stage.graphs:
        if graph.active and graph.nodes and graph.path.startswith(below):
            return True
    states = (state for node in stage.nodes() for state in node.ports.values())
    return any(prim.path in state.targets for state in states)


def sensor_place(subject: StageSubject, name: str) -> Place | None:
    """Return where the sensor is, None where the checkpoint asks for none."""
    if name not in subject.checkpoint.sensors:
        return None
    return find_sensor(subject.lab, subject.stage, name)


def sensor_homes(lab: Lab, stage: StageModel) -> dict[str, str]:
    """Map the path of each sensor that stands elsewhere to the path where it really is."""
    places = [find_sensor(lab, stage, name) for name in ("lidar", "camera")]
    return {
        place.path: place.prim.path
        for place in places
        if place.prim is not None and place.is_misplaced
    }


def candidates(lab: Lab, stage: StageModel, name: str) -> Iterator[Prim]:
    """Yield the prims of the scene that could be meant as the sensor."""
    spec = lab.scene[name]
    robot: str = lab.scene["robot"]["path"]
    wanted = spec["path"].rpartition("/")[2]
    for prim in stage.of_type(spec["type"]):
        if prim.present:
            is_known = spec.get("recognised") == "anywhere" or is_at_or_below(prim.path, robot)
            if is_known or (prim.name == wanted and is_used(stage, prim)):
                yield prim


def _strangeness(prim: Prim, path: str, lab: Lab) -> tuple[bool, bool, bool, str]:
    parent, _, name = path.rpartition("/")
    is_off_robot = not is_at_or_below(prim.path, lab.scene["robot"]["path"])
    return prim.name != name, prim.parent != parent, is_off_robot, prim.path


def frames_of(stage: StageModel, place: Place) -> list[Matrix]:
    """Return the transforms a sensor may be judged by.

    One that hangs below another parent may stand right as seen from there or from the parent
    that it should have: Isaac Sim keeps the world transform when a prim is dragged. There is none
    where a missing asset may say how the sensor stands.
    """
    prim = place.prim
    if prim is None or hides_place(stage, prim):
        return []
    frames = [prim.local or IDENTITY]
    parent = place.path.rpartition("/")[0]
    base = stage.prim(parent)
    if prim.parent != parent and base is not None and base.world and prim.world:
        seen = relative(prim.world, base.world)
        frames += [seen] if seen is not None else []
    return frames


def stays_behind(prim: Prim) -> bool:
    """Whether the prim leaves out the transforms of its parents, and so does not move with them."""
    order = prim.attributes.get(ORDER)
    return isinstance(order, tuple) and RESET in order


def stays_behind_problem(place: Place, prim: Prim, handout: str) -> Problem:
    """Return that the sensor stays where it is while its link moves.

    What its place is relative to the link nobody can say then.
    """
    message = (
        f"{prim.name} has {RESET} in {ORDER}: it ignores its link and does not move with the robot"
    )
    hint = f"take {RESET} out of {ORDER}, then set the place relative to the link"
    return Problem(prim.path, message, ORDER, None, RESET, handout, place.related, hint=hint)


def own_body_problem(
    place: Place, prim: Prim, stage: StageModel, handout: str
) -> Iterator[Problem]:
    """Yield that the sensor is a body of its own, which falls instead of moving with its link."""
    is_off = is_switched_off(prim, BODY_ENABLED)
    is_tied = any(prim.path in bodies(joint) for joint in joints(stage))
    if BODY_API in prim.apis and not is_off and not is_tied:
        message = f"{prim.name} is a rigid body of its own: it does not move with its link"
        hint = "select the sensor and remove Rigid Body in the Property panel under Physics"
        yield Problem(
            prim.path, message, BODY_ENABLED, None, BODY_API, handout, place.related, hint=hint
        )


def is_named(name: str, names: Mapping[str, Any] | list[str]) -> bool:
    """Whether a prim has one of these names, or one with the number Isaac Sim adds to a copy."""
    return name in names or (name[-1:].isdigit() and re.sub(r"_\d+$", "", name) in names)


def lidars(subject: StageSubject, right: str = "") -> Iterator[Prim]:
    """Yield everything that is a lidar by type or by a name of the vendor's, topmost only.

    Left out is the lidar that is right, with what it hangs below.
    """
    names = subject.lab.scene["forbidden"]["lidar"]["names"]
    typed = {prim.path for prim in candidates(subject.lab, subject.stage, "lidar")}
    told = ""
    named = subject.stage.named(lambda each: is_named(each, names))
    found = typed | {prim.path for prim in named if prim.present}
    for path in sorted(found):
        is_right = bool(right) and is_at_or_below(right, path)
        if not is_right and not (told and is_at_or_below(path, told)):
            told = path
            yield subject.stage.prims[path]


@once_per_stage
def second_lidars(subject: StageSubject) -> tuple[Prim, ...]:
    """Return the lidars beside the one that the checkpoint asks for, where there is that one.

    One that stands where the camera should is told as what it is not.
    """
    place = sensor_place(subject, "lidar")
    if place is None or place.prim is None:
        return ()
    camera = sensor_place(subject, "camera")
    told = None if camera is None or camera.prim is not None else camera.stranger
    return tuple(prim for prim in lidars(subject, place.prim.path) if prim is not told)


def missing_problem(subject: StageSubject, place: Place, handout: str) -> Iterator[Problem]:
    """Yield that the sensor is not in the scene; its missing link is told by another rule."""
    stage, parent = subject.stage, place.path.rpartition("/")[0]
    if place.prim is not None or place.stranger is not None or is_hidden(stage, place.path):
        return
    if stage.prim(parent) is not None:
        why = why_absent(stage, place.path)
        message = f"{place.path} {why}{with_it(subject.lost, place.path)}"
        yield Problem(place.path, message, None, place.path, why, handout)


def misplaced_problem(place: Place, handout: str) -> Iterator[Problem]:
    """Yield that the sensor has another name or parent."""
    if place.prim is None or not place.is_misplaced:
        return
    parent, _, name = place.path.rpartition("/")
    what = []
    if place.prim.name != name:
        what.append(f"is named {place.prim.name}")
    if place.prim.parent != parent:
        what.append(f"hangs below {place.prim.parent or 'the root'}")
    message = f"{name} {' and '.join(what)}, expected at {place.path}"
    yield Problem(
        place.prim.path, message, None, place.path, place.prim.path, handout, place.related
    )


def stranger_problem(place: Place, spec: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield that a prim of another type stands at the sensor's path, and no sensor elsewhere."""
    if place.prim is None and place.stranger is not None:
        actual = place.stranger.type or "a prim without a type"
        message = f"{place.path} is {actual}, expected {spec['type']}"
        yield Problem(place.path, message, None, spec["type"], actual, spec["handout"])
