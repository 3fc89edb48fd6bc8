"""What pulls the robot onto the ground."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.scene.pose_errors import vector_text
from lab3_usd.model.finding import Problem
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import (
    BODY_API,
    DOWN,
    GRAVITY,
    GRAVITY_DIRECTION,
    SCENE,
    is_down,
    is_felt,
    number,
    vector,
)
from lab3_usd.model.prims import Prim

_OWNER, _DISABLED = "physics:simulationOwner", "physxRigidBody:disableGravity"


def gravity_faults(subject: StageSubject) -> Iterator[Problem]:
    """Say what is wrong with the gravity of the scenes that the robot's bodies belong to."""
    links = _links(subject)
    if links and all(link.attributes.get(_DISABLED) is True for link in links):
        message = "gravity is switched off for all links of the robot"
        site, switches = links[0].path, tuple(f"{link.path}.{_DISABLED}" for link in links[1:])
        yield Problem(site, message, _DISABLED, "False", "True", related=switches)
    for scene in _scenes(subject, links):
        yield from _faults_of(scene, subject.stage.meters_per_unit or 1.0)


def _links(subject: StageSubject) -> list[Prim]:
    robot = subject.lab.scene.robot.path
    bodies = subject.stage.with_api(BODY_API)
    return [each for each in bodies if each.present and is_at_or_below(each.path, robot)]


def _scenes(subject: StageSubject, links: list[Prim]) -> list[Prim]:
    """Return the scenes of the bodies; one that names none belongs to the first (UsdPhysics)."""
    known = [prim for prim in subject.stage.of_type(SCENE) if prim.present]
    owners = {owner for link in links for owner in link.relationships.get(_OWNER, ("",))}
    is_owned = {each.path for each in known} & owners
    return [each for each in known if each.path in is_owned] or known[:1]


def _faults_of(scene: Prim, meters_per_unit: float) -> Iterator[Problem]:
    if not is_felt(scene.attributes, meters_per_unit):
        strength = f"{number(scene.attributes.get(GRAVITY)):g}"
        message = f"gravity is {strength}, expected about 9.81 m/s²"
        yield Problem(scene.path, message, GRAVITY, "9.81", strength)
    elif not is_down(scene.attributes):
        is_, down = vector_text(vector(scene.attributes.get(GRAVITY_DIRECTION))), vector_text(DOWN)
        message = f"gravity pulls along {is_}, expected {down}"
        yield Problem(scene.path, message, GRAVITY_DIRECTION, down, is_)
