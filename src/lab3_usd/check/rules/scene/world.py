"""Rules about the world around the robot: ground, light, physics scene, observation camera."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from lab3_usd.check.match.subject import StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.scene.gravity import gravity_faults
from lab3_usd.check.scene.ground import (
    AXIS,
    UP,
    boxes,
    facing,
    falling_ground,
    has_ground,
    lights,
    steep_planes,
)
from lab3_usd.check.scene.pose_errors import pose_property, vector_text
from lab3_usd.model.absent_prims import absence_reason, has_unresolved_outside
from lab3_usd.model.finding import Problem
from lab3_usd.model.paths import is_at_or_below
from lab3_usd.model.physics import (
    BODY_API,
    BODY_ENABLED,
    COLLISION_API,
    COLLISION_ENABLED,
    PLANE,
    SCENE,
)
from lab3_usd.model.prims import Prim
from lab3_usd.spec.scene import WorldPart


@rule("S13", "ground", scope="stage")
def ground(subject: StageSubject) -> Iterator[Problem]:
    """No fixed ground with a collision lies below the robot.

    Why: at Play the robot falls for ever. A ground that is a rigid body falls with it.

    Fix: activate the ground plane, tick Collision Enabled on it, turn it so that it faces up, or
    remove its Rigid Body. Restore a deleted ground from the supplied file, or create one with
    Create > Physics > Ground Plane.

    Example: the collision plane below `/Environment` deactivated.
    """
    asked = _asked(subject, subject.lab.scene.world.ground)
    if asked is None or has_ground(subject) or _is_elsewhere(subject):
        return
    falling = falling_ground(subject)
    if falling is not None:
        yield _falls(asked, *falling)
        return
    steep = next(steep_planes(subject.stage, subject.lab.scene.robot.path), None)
    if steep is not None:
        yield _faces_elsewhere(asked, steep)
        return
    off = _silent_ground(subject)
    if off is not None:
        has_api = COLLISION_API in off.apis
        what = "is switched off" if has_api else "was removed"
        message = f"the ground does not carry the robot: the collision of {off.name} {what}"
        expected, related = "True" if has_api else COLLISION_API, (asked.usual,)
        yield Problem(
            off.path, message, COLLISION_ENABLED, expected, None, asked.handout, related=related
        )
        return
    planes = subject.stage.of_type(PLANE)
    yield _missing(subject, asked, "a ground with collision", planes)


def _falls(asked: WorldPart, ground: Prim, body: Prim) -> Problem:
    falls = f"falls with {body.name}, which is" if body != ground else "falls as"
    return Problem(
        body.path,
        f"the ground does not carry the robot: {ground.name} {falls} a rigid body",
        BODY_ENABLED,
        "no rigid body",
        BODY_API,
        asked.handout,
        related=tuple(sorted({asked.usual, ground.path} - {body.path})),
        hint=f"remove Rigid Body from {body.name} in the Property panel",
    )


def _faces_elsewhere(asked: WorldPart, plane: Prim) -> Problem:
    faces, up = vector_text(facing(plane) or UP), vector_text(UP)
    is_turned = plane.attributes.get(AXIS, "Z") == "Z"
    return Problem(
        plane.path,
        f"the ground does not carry the robot: {plane.name} faces {faces}, expected {up}",
        pose_property(plane, "rotate") if is_turned else AXIS,
        up,
        faces,
        asked.handout,
        related=(asked.usual,),
        hint=f"turn {plane.name}, or the prim that holds it, so that its front faces up",
    )


def _silent_ground(subject: StageSubject) -> Prim | None:
    """Return what would be ground if it collided."""
    robot = subject.lab.scene.robot.path
    for prim in subject.stage.of_type(PLANE):
        if prim.present and not is_at_or_below(prim.path, robot):
            return prim
    return next((subject.stage.prims[box.path] for box in boxes(subject)), None)


@rule("S14", "light", scope="stage")
def light(subject: StageSubject) -> Iterator[Problem]:
    """The scene has no light.

    Why: the camera may publish black images.

    Fix: activate the light of the supplied file, or choose Create > Light > Dome Light.

    Example: the only DistantLight deactivated.
    """
    found = list(lights(subject.stage))
    asked = _asked(subject, subject.lab.scene.world.light)
    if asked is None or any(prim.present for prim in found):
        return
    if not _is_elsewhere(subject) and not _is_told_by_ground(subject, asked):
        yield _missing(subject, asked, "a light", found)


@rule("S15", "physics-scene", scope="stage")
def physics_scene(subject: StageSubject) -> Iterator[Problem]:
    """The stage has no physics scene, or one whose gravity does not pull down.

    Why: Isaac Sim then uses its own gravity and time step, and the handout asks for the prim.
    Without weight the wheels do not grip the ground.

    Fix: activate or restore `physicsScene`, or choose Create > Physics > Physics Scene. Restore its
    gravity: Magnitude 9.81, and Direction (0, 0, -1). Clear Disable Gravity on the links.

    Example: `/physicsScene` deleted, or `physics:gravityMagnitude` 0 on it.
    """
    found = list(subject.stage.of_type(SCENE))
    asked = _asked(subject, subject.lab.scene.world.physics_scene)
    if asked is None:
        return
    for wrong in gravity_faults(subject):
        usual = (asked.usual,) if wrong.prim != asked.usual else ()
        yield replace(wrong, handout=asked.handout, related=(*usual, *wrong.related))
    if not any(prim.present for prim in found) and not _is_elsewhere(subject):
        yield _missing(subject, asked, "a physics scene", found)


@rule("S16", "observation-camera", scope="stage", severity="warning")
def observation_camera(subject: StageSubject) -> Iterator[Problem]:
    """The observation camera beside the robot is missing.

    Why: the supplied file has one. Without it the screenshots show another view, and it
    may have been turned into the robot's camera.

    Fix: restore it from the supplied file, or choose Create > Camera and place it beside the robot.

    Example: the world's camera dragged onto `{base}` and renamed.
    """
    robot, world = subject.lab.scene.robot.path, subject.lab.scene.world
    asked = world.observation_camera
    is_gone = subject.stage.prim(world.graph_parent.path) is None  # which is S01's
    if asked is None or is_gone or _is_elsewhere(subject):
        return
    typed = subject.stage.of_type(asked.type)
    cameras = [prim for prim in typed if not is_at_or_below(prim.path, robot)]
    if not any(prim.present for prim in cameras):
        yield _missing(subject, asked, "an observation camera", cameras)


def _is_elsewhere(subject: StageSubject) -> bool:
    """Whether an asset of the environment is missing, which could hold it."""
    return has_unresolved_outside(subject.stage, subject.lab.scene.robot.path)


def _asked(subject: StageSubject, part: WorldPart | None) -> WorldPart | None:
    """Return a part of the world that the lab has, None for one below a prim that S01 misses."""
    above = subject.lab.scene.world.graph_parent.path
    is_gone = subject.stage.prim(above) is None
    return None if part is None or (is_gone and is_at_or_below(part.usual, above)) else part


def _is_told_by_ground(subject: StageSubject, light: WorldPart) -> bool:
    """Whether ground and light are gone because one prim that holds both is switched off."""
    ground = _asked(subject, subject.lab.scene.world.ground)
    if ground is None or ground.usual != light.usual:
        return False
    usual = subject.stage.prims.get(ground.usual)
    return usual is not None and not usual.present and not has_ground(subject)


def _missing(subject: StageSubject, asked: WorldPart, title: str, parts: Iterable[Prim]) -> Problem:
    """Say that a part is missing: at the prim that is switched off, else where it usually is."""
    usual = asked.usual
    off = [prim.path for prim in parts if not prim.present]
    top = subject.stage.prims.get(usual)
    if top is not None and not top.present:
        off = [usual]
    site = min(off, default=usual)
    why = f": {site} {absence_reason(subject.stage, site)}" if off else ""
    related = (usual,) if site != usual else ()
    message = f"the scene has no {title.split(' ', 1)[1]}{why}"
    return Problem(site, message, None, title, None, asked.handout, related)
