"""The ground of a stage, what carries the robot, and what pulls it down."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.facts.stances import machines
from lab3_usd.model.changes import Restore
from lab3_usd.model.finding import Problem
from lab3_usd.model.physics import (
    BODY_API,
    BODY_ENABLED,
    FIXED,
    GRAVITY,
    GRAVITY_DIRECTION,
    KINEMATIC,
    PLANE,
    SCENE,
    TILT,
    WEIGHTLESS,
    bodies,
    collides,
    down,
    is_body,
    is_felt,
    is_switched_off,
    joints,
    number,
    slant,
    vector,
)
from lab3_usd.model.prims import Collider, Prim, is_at_or_below, upwards
from lab3_usd.model.stage import StageModel, once_per_stage
from lab3_usd.model.transforms import (
    AXES,
    IDENTITY,
    Vector,
    angle_between,
    decompose,
    scaled,
    vector_text,
)
from lab3_usd.spec.scene import NO_ROBOT

_EARTH = 9.81  # metres per second squared
_OWNER = "physics:simulationOwner"


def gravity_faults(subject: RobotSubject) -> Iterator[Problem]:
    """Say what is wrong with the gravity of the scenes that the robot's bodies belong to."""
    robot, stage = subject.robot.path, subject.stage
    links = [
        body
        for body in stage.with_api(BODY_API)
        if body.present and is_at_or_below(body.path, robot)
    ]
    if links and all(link.attributes.get(WEIGHTLESS) is True for link in links):
        message = "gravity is disabled for all links of the robot"
        site, switches = links[0].path, tuple(f"{link.path}.{WEIGHTLESS}" for link in links[1:])
        yield Problem(site, message, WEIGHTLESS, "False", "True", related=switches)
    # A body that names no scene belongs to the first (UsdPhysics).
    scenes = [prim for prim in stage.of_type(SCENE) if prim.present]
    owners = {owner for link in links for owner in link.relationships.get(_OWNER, ("",))}
    for scene in [scene for scene in scenes if scene.path in owners] or scenes[:1]:
        owned = (link for link in links if scene.path in link.relationships.get(_OWNER, ()))
        owns = tuple((link.path, _OWNER) for link in owned)
        if not is_felt(scene.attributes, stage.meters_per_unit or 1.0):
            strength = f"{number(scene.attributes.get(GRAVITY)):g}"
            metres = subject.lab.scene.stage.meters_per_unit
            right, unit = f"{_EARTH / metres:g}", "m" if metres == 1.0 else f"of {metres:g} m"
            message = f"gravity is {strength}, expected about {right} {unit}/s²"
            said = (("/", "metersPerUnit"),)
            yield Problem(scene.path, message, GRAVITY, right, strength, assumes=said, covers=owns)
        elif slant(scene.attributes, subject.lab.scene.stage.up_axis) > TILT:
            actual = vector_text(vector(scene.attributes.get(GRAVITY_DIRECTION)))
            right = vector_text(down(subject.lab.scene.stage.up_axis))
            message = f"gravity pulls along {actual}, expected {right}"
            yield Problem(scene.path, message, GRAVITY_DIRECTION, right, actual, covers=owns)


# A shape as high as a wall is ground and wall in one; how high its ground is, no box says.
_STEP = 0.15  # metres
AXIS, UP = "axis", (0.0, 0.0, 1.0)
_AXES = ("X", "Y", "Z")
_LIGHT = re.compile(r"Light(_\d+)?$")
_LIGHT_API = re.compile(r"^(Mesh|Volume)?LightAPI$")


def up_of(subject: RobotSubject) -> Vector:
    """Return the direction that is up in the stages of a lab."""
    return AXES["XYZ".index(subject.lab.scene.stage.up_axis)]


def height(point: Sequence[float], subject: RobotSubject) -> float:
    """Return how high a point is in the stages of a lab."""
    return point["XYZ".index(subject.lab.scene.stage.up_axis)]


def planes(subject: RobotSubject) -> Iterator[Prim]:
    """Yield the endless fixed planes beside the robot that face up and that others bump into."""
    stage = subject.stage
    solid = _solid_planes(stage, subject.robot.path)
    fixed = (plane for plane in solid if moving_body(stage, plane.path) is None)
    return (prim for prim in fixed if not _is_steep(prim, subject))


def steep_planes(subject: RobotSubject) -> Iterator[Prim]:
    """Yield the planes that would carry the robot if they faced up."""
    solid = _solid_planes(subject.stage, subject.robot.path)
    return (plane for plane in solid if _is_steep(plane, subject))


def _is_steep(plane: Prim, subject: RobotSubject) -> bool:
    faces = facing(plane)
    return faces is not None and not angle_between(faces, up_of(subject)) <= TILT


def facing(plane: Prim) -> Vector | None:
    """Return where the front of a plane faces, None where nothing says how it is turned."""
    axis = plane.attributes.get(AXIS, "Z")
    if plane.world is None or axis not in _AXES:
        return None
    return decompose(plane.world).rotation[_AXES.index(axis)]


def _solid_planes(stage: StageModel, robot: str) -> Iterator[Prim]:
    for prim in stage.of_type(PLANE):
        is_outside = not is_at_or_below(prim.path, robot)
        if is_outside and (collides(prim) or _collides_above(stage, prim.path)):
            yield prim


def _collides_above(stage: StageModel, path: str) -> bool:
    """Whether an ancestor makes all shapes below it collide."""
    above = map(stage.prims.get, upwards(path.rpartition("/")[0]))
    return any(prim is not None and collides(prim) for prim in above)


def boxes(subject: RobotSubject) -> Iterator[Collider]:
    """Yield the fixed shapes that lie below the place where the starter has the robot, if any."""
    stage = subject.stage
    return (box for box in _boxes_below(subject) if moving_body(stage, box.path) is None)


def _boxes_below(subject: RobotSubject) -> Iterator[Collider]:
    robot = subject.robot
    if robot == NO_ROBOT:  # which may come to stand anywhere
        yield from subject.stage.colliders.beside(robot.path)
        return
    start = _start(subject)
    reach = height(start, subject) + subject.lab.scene.tolerance.root_position
    level = [number for number in range(3) if not up_of(subject)[number]]
    colliders = subject.stage.colliders

    def is_over(box: Collider) -> bool:
        is_around = all(box.low[axis] <= start[axis] <= box.high[axis] for axis in level)
        return is_around and height(box.low, subject) <= reach

    for bounds in colliders.bounds():
        if is_over(bounds) and not is_at_or_below(bounds.path, robot.path):
            box = colliders.measured(bounds.path)
            if box is not None and is_over(box):
                yield box


def _start(subject: RobotSubject) -> Vector:
    """Return where the robot starts in metres: at the pose that the lab gives, else where it is."""
    pose = subject.robot.pose
    if pose is not None:
        return pose.translate
    root = subject.stage.prim(subject.robot.path)
    matrix = IDENTITY if root is None or root.world is None else root.world
    return scaled((matrix[12], matrix[13], matrix[14]), subject.stage.meters_per_unit)


def moving_body(
    stage: StageModel, path: str, body_paths: frozenset[str] = frozenset()
) -> Prim | None:
    """Return the rigid body that what stands at a path moves with, None where it stays.

    Kinematic bodies stay, and so do those that a fixed joint ties to what stays. `body_paths` are
    the bodies visited so far: they end the search where joints tie bodies in a ring.
    """
    for body in upwards(path):
        prim = stage.prim(body)
        if prim is not None and is_body(prim) and not is_switched_off(prim, BODY_ENABLED):
            is_driven = prim.attributes.get(KINEMATIC) is True
            is_tied = body not in body_paths and _is_tied(stage, body, body_paths | {body})
            return None if is_driven or is_tied else prim
    return None


def _is_tied(stage: StageModel, body: str, body_paths: frozenset[str]) -> bool:
    """Whether a fixed joint ties a body to the world, or to what stays."""
    for joint in joints(stage):
        ends = bodies(joint)
        far_ends = [end for end in ends if not is_at_or_below(end, body)]
        if joint.type == FIXED and len(far_ends) == 1:
            exists = not far_ends[0] or stage.prim(far_ends[0]) is not None
            if exists and moving_body(stage, far_ends[0], body_paths) is None:
                return True
    return False


def falling_ground(subject: RobotSubject) -> tuple[Prim, Prim] | None:
    """Return what would carry the robot if it did not move, and the body that it moves with."""
    stage, robot = subject.stage, subject.robot.path
    paths = [prim.path for prim in _solid_planes(stage, robot)]
    paths += [box.path for box in _boxes_below(subject) if _is_on(stage, box)]
    carried = ((stage.prims[path], moving_body(stage, path)) for path in paths)
    return next(((prim, body) for prim, body in carried if body is not None), None)


def has_ground(subject: RobotSubject) -> bool:
    """Whether anything fixed can carry the robot."""
    grounds = itertools.chain(planes(subject), _live_boxes(subject))
    return any(True for _ in grounds)


def one_sided(subject: RobotSubject, usual: str) -> Iterator[Problem]:
    """Say what lies below the robot and carries nothing, as a mesh with its faces turned down."""
    built = machines(subject.stage)
    machine = built.member.get(subject.robot.base) if built is not None else None
    if machine is not None and machine.no_ground is not None:
        path, why = machine.no_ground
        name, prims = path.rpartition("/")[2], subject.stage.of_type(PLANE)
        yield Problem(
            path,
            f"the ground does not carry the robot: {name} {why}",
            expected="a face that looks up, in the robot's physics scene",
            related=(usual,),
            hint=f"restore {name} from the supplied file",
            fix=(Restore(path),),
            assumes=((path, _OWNER),),
            # What should carry the robot may be a plane that is deactivated.
            covers=tuple((plane.path, None) for plane in prims if not plane.present),
        )


def _live_boxes(subject: RobotSubject) -> Iterator[Collider]:
    return (box for box in boxes(subject) if _is_on(subject.stage, box))


def _is_on(stage: StageModel, box: Collider) -> bool:
    prim = stage.prim(box.path)
    return prim is not None and collides(prim)


@once_per_stage
def highest_ground(subject: RobotSubject) -> tuple[float, str] | None:
    """Return how high the ground is below the robot, in metres, and which prim it is.

    None where no box says how high it is.
    """
    heights = [
        (height(prim.world[12:15], subject) * subject.stage.meters_per_unit, prim.path)
        for prim in planes(subject)
        if prim.world
    ]
    step = height(_start(subject), subject) + _STEP
    tops = [(height(box.high, subject), box.path) for box in _live_boxes(subject)]
    if any(top > step for top, _ in tops) and not heights:
        return None
    return max([*heights, *(top for top in tops if top[0] <= step)], default=None)


def lights(stage: StageModel) -> Iterator[Prim]:
    """Yield the prims that shine, in the scene or not."""
    yield from stage.of_type(lambda name: _LIGHT.search(name) is not None)
    yield from stage.with_api(lambda name: _LIGHT_API.match(name) is not None)
