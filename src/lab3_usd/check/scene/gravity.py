"""What pulls the robot onto the ground."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.scene.pose_errors import vector_text
from lab3_usd.model.finding import Problem
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import BODY_API, SCENE, number, vector
from lab3_usd.model.prims import Prim
from lab3_usd.model.transform_math import angle_between

TILT = 5.0  # degrees from which on a robot slides or rolls
_DOWN = (0.0, 0.0, -1.0)
_MAGNITUDE, _DIRECTION = "physics:gravityMagnitude", "physics:gravityDirection"
_OWNER, _DISABLED = "physics:simulationOwner", "physxRigidBody:disableGravity"
_LEAST, _MOST = 1.0, 30.0  # metres per second squared: less than the moon's, more than Jupiter's


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
    """Judge a scene: a negative magnitude is the earth's, a direction of zeros is down."""
    strength = number(scene.attributes.get(_MAGNITUDE))
    along = vector(scene.attributes.get(_DIRECTION))
    if strength is not None and not (strength < 0 or _is_felt(strength, meters_per_unit)):
        message = f"gravity is {strength:g}, expected about 9.81 m/s²"
        yield Problem(scene.path, message, _MAGNITUDE, "9.81", f"{strength:g}")
    elif any(along) and not angle_between(along, _DOWN) <= TILT:
        is_, down = vector_text(along), vector_text(_DOWN)
        message = f"gravity pulls along {is_}, expected {down}"
        yield Problem(scene.path, message, _DIRECTION, down, is_)


def _is_felt(strength: float, meters_per_unit: float) -> bool:
    """Whether a robot is held and not crushed; a stage whose units are wrong may mean metres."""
    return any(_LEAST <= strength * unit <= _MOST for unit in (1.0, meters_per_unit))
