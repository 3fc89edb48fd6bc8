"""Rules about the world around the robot, and the robot at rest on its ground."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import RobotSubject
from lab3_usd.check.registry import Demand, Demands, rule
from lab3_usd.check.repairs import moved_back, restorable
from lab3_usd.check.robot.ground import (
    AXIS,
    UP,
    boxes,
    facing,
    falling_ground,
    gravity_faults,
    has_ground,
    height,
    highest_ground,
    lights,
    one_sided,
    steep_planes,
    up_of,
)
from lab3_usd.check.robot.location import same_named_prims
from lab3_usd.check.robot.poses import (
    OPERATIONS,
    ORDER,
    is_scaled,
    pose_errors,
    pose_property,
    root_tolerance,
)
from lab3_usd.check.robot.sensors import darkened, shares_of
from lab3_usd.model.changes import ApplySchema, Edit, RemoveSchema, Restore
from lab3_usd.model.finding import Problem, Severity, display
from lab3_usd.model.physics import (
    BODY_API,
    BODY_ENABLED,
    COLLISION_API,
    COLLISION_ENABLED,
    PLANE,
    SCENE,
    collides,
)
from lab3_usd.model.prims import Prim, is_at_or_below, upwards
from lab3_usd.model.stage import UnresolvedAsset, absence_reason
from lab3_usd.model.transforms import (
    IDENTITY,
    Pose,
    angle_between,
    decompose,
    distance,
    rotation_difference,
    scaled,
    transform_point,
    vector_text,
)
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import RobotSpec, WorldPart, WorldSpec

_GROUND, _LIGHT, _SCENE = "Scene/ground", "Scene/light", "Scene/physics_scene"


def _part_demand(name: str, title: str, part: Callable[[WorldSpec], WorldPart | None]) -> Demands:
    """Return the demand that the world has a part, where the lab has one."""

    def demands(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
        del checkpoint
        asked = part(lab.scene.world)
        if asked is not None:
            yield Demand(name, title, asked.usual, asked.handout, part="world")

    return demands


_HAS_GROUND = _part_demand(_GROUND, "a ground with collision", lambda world: world.ground)
_HAS_LIGHT = _part_demand(_LIGHT, "a light", lambda world: world.light)
_HAS_SCENE = _part_demand(_SCENE, "a physics scene", lambda world: world.physics_scene)


@rule("S13", "ground", scope="world", demands=_HAS_GROUND)
def ground(subject: RobotSubject) -> Iterator[Problem]:
    """There is no fixed ground with a collision.

    Why: at Play the robot falls for ever. A ground that is a rigid body falls with it. A mesh
    collides on one side, by the order of its points and `orientation`.

    Fix: activate the ground plane, tick Collision Enabled on it, turn it so that it faces up, or
    remove its Rigid Body. Restore a deleted ground from the supplied file, or create one with
    Create > Physics > Ground Plane.

    Example: the collision plane of the ground deactivated.
    """
    part = _asked(subject, subject.lab.scene.world.ground)
    if part is None:
        return
    asset = _missing_environment(subject)
    wrong = one_sided(subject, part.usual) if has_ground(subject) else _useless(subject, part)
    for problem in wrong:
        yield replace(problem, handout=part.handout, unmet=(_GROUND,), rests_on=asset)


def _useless(subject: RobotSubject, part: WorldPart) -> Iterator[Problem]:
    """Yield why nothing fixed carries the robot."""
    falling, silent = falling_ground(subject), _silent_ground(subject)
    steep = next(steep_planes(subject), None)
    what = "the ground does not carry the robot"
    if falling is not None:
        plane, body = falling
        falls = f"falls with {body.name}, which is" if body != plane else "falls as"
        yield Problem(
            body.path,
            f"{what}: {plane.name} {falls} a rigid body",
            BODY_ENABLED,
            "no rigid body",
            BODY_API,
            related=tuple(sorted({part.usual, plane.path} - {body.path})),
            hint=f"remove Rigid Body from {body.name} in the Property panel",
            fix=(RemoveSchema(body.path, BODY_API),),
        )
    elif steep is not None:
        faces, up = vector_text(facing(steep) or up_of(subject)), vector_text(up_of(subject))
        is_turned = steep.attributes.get(AXIS, "Z") == "Z"
        name = pose_property(steep, "rotate") if is_turned else AXIS
        message = f"{what}: {steep.name} faces {faces}, expected {up}"
        hint = f"turn {steep.name}, or the prim that holds it, so that its front faces up"
        problem = Problem(steep.path, message, name, up, faces, hint=hint)
        yield restorable(problem, part.handout, related=(part.usual,))
    elif silent is not None:
        has_api = COLLISION_API in silent.apis
        state = "is disabled" if has_api else "was removed"
        message = f"{what}: the collision of {silent.name} {state}"
        site, schema = (silent.path, COLLISION_ENABLED), (silent.path, COLLISION_API)
        yield Problem(
            silent.path,
            message,
            COLLISION_ENABLED,
            "True" if has_api else COLLISION_API,
            related=(part.usual,),
            fix=(Restore(*site) if has_api else ApplySchema(*schema),),
            assumes=(site, schema),
            covers=(schema,),
        )
    else:
        planes = subject.stage.of_type(PLANE)
        lost = _missing(subject, part, "a ground with collision", planes)
        schema = (lost.prim, COLLISION_API)
        yield replace(lost, assumes=(schema,), covers=(schema,))


def _silent_ground(subject: RobotSubject) -> Prim | None:
    """Return what would be ground if it collided."""
    robot = subject.robot.path
    for prim in subject.stage.of_type(PLANE):
        if prim.present and not is_at_or_below(prim.path, robot):
            return prim
    return next((subject.stage.prims[box.path] for box in boxes(subject)), None)


@rule("S14", "light", scope="world", demands=_HAS_LIGHT)
def light(subject: RobotSubject) -> Iterator[Problem]:
    """There is no light, or all lights are dark.

    Why: {camera?}images may be black{else}the stage is black in the viewport, and so is every
    image{/}.

    Fix: activate the light of the supplied file, or choose Create > Light > Dome Light. Make it
    visible, and give it an intensity above 0, a color and no low exposure.

    Example: the only DistantLight deactivated, or its intensity 0.
    """
    prims = list(lights(subject.stage))
    part = _asked(subject, subject.lab.scene.world.light)
    present = [prim for prim in prims if prim.present]
    dark = [change for prim in present if (change := darkened(prim, subject.stage)) is not None]
    if part is None or len(dark) < len(present):
        return
    if dark:
        site, name = dark[0]
        more = [(prim.path, other) for prim, other in dict.fromkeys(dark) if prim != site]
        value = display(site.attributes.get(name))
        yield Problem(
            site.path,
            f"the lights are dark: {name} of {site.name} is {value}",
            name,
            "a light",
            value,
            part.handout,
            related=tuple(map(".".join, more)),
            fix=(Restore(site.path, name), *(Restore(*other) for other in more)),
            unmet=(_LIGHT,),
            assumes=((site.path, name),),
            covers=tuple(shares_of(dark)),
            rests_on=_missing_environment(subject),
        )
    elif not _is_lost_with_ground(subject, part):
        yield _missing(subject, part, "a light", prims, _LIGHT)


@rule("S15", "physics-scene", scope="world", demands=_HAS_SCENE)
def physics_scene(subject: RobotSubject) -> Iterator[Problem]:
    """No physics scene pulls the robot down.

    Why: Isaac Sim then uses its own gravity and time step, and the handout asks for the prim.
    Without weight nothing stays on the ground.

    Fix: activate or restore the prim, or choose Create > Physics > Physics Scene. Restore its
    gravity: Magnitude {gravity}, and Direction {down}. Clear Disable Gravity on the links.

    Example: the physics scene deleted, or `physics:gravityMagnitude` 0 on it.
    """
    scenes = list(subject.stage.of_type(SCENE))
    part = _asked(subject, subject.lab.scene.world.physics_scene)
    if part is None:
        return
    for wrong in gravity_faults(subject):
        usual = (part.usual,) if wrong.prim != part.usual else ()
        sites = (f"{wrong.prim}.{wrong.property}", *wrong.related)
        yield replace(
            wrong,
            handout=part.handout,
            related=(*usual, *wrong.related),
            fix=tuple(Restore(*site.split(".")) for site in sites),
            unmet=(_SCENE,),
            assumes=(*wrong.assumes, (wrong.prim, wrong.property)),
        )
    if not any(prim.present for prim in scenes):
        yield _missing(subject, part, "a physics scene", scenes, _SCENE)


@rule("S16", "observation-camera", scope="world", severity="warning", needs="observation camera")
def observation_camera(subject: RobotSubject) -> Iterator[Problem]:
    """The observation camera is missing.

    Why: the supplied file has one. Without it the screenshots show another view, and it
    may have been turned into the robot's camera.

    Fix: restore it from the supplied file, or choose Create > Camera and place it beside the robot.

    Example: the world's camera dragged onto `{base}` and renamed.
    """
    scene = subject.lab.scene
    part = scene.world.observation_camera
    if part is None or _is_parent_gone(subject):  # which is S01's
        return
    typed = subject.stage.of_type(part.type)
    cameras = [prim for prim in typed if scene.robot_of(prim.path) is None]
    if not any(prim.present for prim in cameras):
        yield _missing(subject, part, "an observation camera", cameras)


def _missing_environment(subject: RobotSubject) -> UnresolvedAsset | None:
    """Return a missing asset that could hold parts of the world."""
    return subject.stage.unknown_outside(subject.robot.path)


def _asked(subject: RobotSubject, part: WorldPart | None) -> WorldPart | None:
    """Return a part of the world that the lab has, None for one below a prim that S01 misses."""
    parent = subject.lab.scene.world.graph_parent
    is_gone = _is_parent_gone(subject)
    is_below = parent is not None and part is not None and is_at_or_below(part.usual, parent.path)
    return None if is_gone and is_below else part


def _is_parent_gone(subject: RobotSubject) -> bool:
    """Whether the stage lacks the prim of the world that contains graphs."""
    parent = subject.lab.scene.world.graph_parent
    return parent is not None and subject.stage.prim(parent.path) is None


def _is_lost_with_ground(subject: RobotSubject, light: WorldPart) -> bool:
    """Whether ground and light are gone because one prim that holds both is switched off."""
    ground = _asked(subject, subject.lab.scene.world.ground)
    if ground is None or ground.usual != light.usual:
        return False
    usual = subject.stage.prims.get(ground.usual)
    return usual is not None and not usual.present and not has_ground(subject)


def _missing(
    subject: RobotSubject, part: WorldPart, title: str, parts: Iterable[Prim], *unmet: str
) -> Problem:
    """Say that a part is missing: at the prim that is switched off, else where it usually is.

    One that was dragged below the robot moves with it, and is no part of the world.
    """
    usual, robot = part.usual, subject.robot.path
    off = [prim.path for prim in parts if not prim.present]
    top = subject.stage.prims.get(usual)
    if top is not None and not top.present:
        off = [usual]
    site = min(off, default=usual)
    reason = f": {site} {absence_reason(subject.stage, site)}" if off else ""
    related = (usual,) if site != usual else ()
    problem = Problem(
        site,
        f"the scene has no {title.split(' ', 1)[1]}{reason}",
        expected=title,
        handout=part.handout,
        related=related,
        fix=tuple(map(Restore, (site, *related))),
        unmet=unmet,
        rests_on=_missing_environment(subject),
    )
    dragged = () if top else same_named_prims(subject.stage, robot, usual.rpartition("/")[2])
    return moved_back(problem, usual, dragged) if len(dragged) == 1 else problem


# What shapes a link, and so how low it reaches: the beginnings of properties.
SHAPE = ("radius", "height", "size", "axis", "points", "xformOp:*")


def at_rest(robot: RobotSpec) -> str:
    """Return the id of the requirement that a robot rests on the ground."""
    return f"{robot.group}/rest"


def rests(lab: Lab, checkpoint: Checkpoint) -> Iterator[Demand]:
    """Yield that each robot rests on the ground."""
    del checkpoint
    for robot in lab.scene.robots if lab.scene.world.ground is not None else ():
        handout = lab.handout.behind("S19", robot.handout)
        title = f"{robot.title} rests on the ground"
        yield Demand(at_rest(robot), title, robot.path, handout, part="assembly")


@rule("S19", "not-at-rest", scope="robot", demands=rests)
def not_at_rest(subject: RobotSubject) -> Iterator[Problem]:
    """Part of the robot is below the ground{wheels?}, or a wheel above it{/}.

    Why: at Play the robot drops, tips, or is thrown up by the overlap. A sensor below the ground
    sees nothing. The collision shapes are judged as saved, if the robot root is at its pose. In
    later checkpoints, which may be saved after a run, it is a warning.

    Fix: set the transform of the link or ground named here to the value in the supplied file.

    Example: the ground plane moved to Z = -0.1.
    """
    if subject.lab.scene.world.ground is None or not _root_stands_right(subject):
        return
    highest = highest_ground(subject)
    if highest is None:
        return
    level, ground = highest
    lows = {body: low - level for body, low in _lows(subject).items()}
    spec = subject.robot
    wheels = [*map(spec.path_of, spec.wheels.joints.values())]
    limit = _limit(subject)
    off = {body: low for body, low in lows.items() if low < -limit}
    off |= {body: lows[body] for body in wheels if body in lows and lows[body] > limit}
    standing = [body for body in wheels if body in lows]
    if standing and all(body in off for body in standing):
        # All wheels at once: it is the robot or the ground that is wrong, and one thing to say.
        off = {spec.path: off[standing[0]]}
    later = subject.lab.is_after(subject.checkpoint.id, spec.pose_is_error_until)
    severity: Severity | None = "warning" if later else None
    section = subject.lab.handout.behind("S19", spec.handout)
    for body, low in off.items():
        side = "above" if low > 0 else "below"
        part = body.rpartition("/")[2]
        basis = ground if body == spec.path else spec.path
        yield Problem(
            body,
            f"{part} is {abs(low):.3g} m {side} the ground",
            expected="on the ground",
            actual=f"{low:.3g} m",
            handout=section,
            related=(basis,),
            severity=severity,
            fix=_put_back(subject, body, basis),
            unmet=(at_rest(spec),),
            covers=tuple((path, OPERATIONS["translate"][0]) for path in upwards(basis)),
            assumes=tuple((f"{body}/", name) for name in SHAPE),
        )


def _put_back(subject: RobotSubject, body: str, basis: str) -> tuple[Edit, ...]:
    """Return the repair of a body or its ground; a ground may be displaced by a prim above it."""
    if body != subject.robot.path:
        return (Restore(body), Restore(basis))
    prims = ((path, subject.stage.prim(path)) for path in upwards(basis))
    placed = [path for path, prim in prims if prim is not None and ORDER in prim.attributes]
    if placed[:1] == [basis]:
        return (Restore(body), Restore(basis))
    return tuple(Restore(path, ORDER) for path in placed)


def _root_stands_right(subject: RobotSubject) -> bool:
    spec = subject.robot
    root = subject.stage.prim(spec.path)
    if root is None or root.local is None:
        return False
    if spec.pose is None:
        return True
    tolerance = root_tolerance(subject.lab.scene, subject.stage)
    return not any(pose_errors(root, root.local or IDENTITY, spec.pose, tolerance))


def _limit(subject: RobotSubject) -> float:
    """Allow the wheels as much as the robot's own height is allowed."""
    spec = subject.robot
    root = subject.stage.prim(spec.path)
    at = height(root.world[12:15], subject) if root is not None and root.world else 0.0
    expected = 0.0 if spec.pose is None else height(spec.pose.translate, subject)
    given = abs(at * subject.stage.meters_per_unit - expected)
    tolerance = subject.lab.scene.tolerance
    return tolerance.rest + min(given, tolerance.root_position)


def _lows(subject: RobotSubject) -> dict[str, float]:
    """Return how low each link reaches, in metres: its collision shapes, else its own origin."""
    spec, stage = subject.robot, subject.stage
    size = subject.lab.scene.tolerance.scale
    lows: dict[str, float] = {}
    for name, link in spec.links.items():
        path = spec.path_of(name)
        nested = [other for other in spec.link_paths if other.startswith(f"{path}/")]
        boxes = [
            (stage.prim(box.path), height(box.low, subject))
            for box in stage.colliders.below(path)
            if not any(is_at_or_below(box.path, link) for link in nested)
        ]
        shapes = [low for part, low in boxes if part is not None and collides(part)]
        prim = stage.prim(path)
        is_reported = prim is not None and (prim.placeless or is_scaled(prim, size))
        if is_reported or (prim is not None and stage.unknown_pose(prim)):
            continue  # S05 tells what has no place, S24 what is scaled
        if shapes:
            lows[path] = min(shapes)
        elif link.offset is not None and prim is not None and prim.world:
            lows[path] = height(prim.world[12:15], subject) * stage.meters_per_unit
    return lows


@rule("S22", "starts-elsewhere", scope="robot", severity="note")
def starts_elsewhere(subject: RobotSubject) -> Iterator[Problem]:
    """The robot's base is not at its root.

    Why: at Play the robot starts where its bodies are, as after a saved run. The root stays behind.
    {wheels?}Odometry begins at zero there{localization?}, and localization with that place{/}.{/}

    Fix: nothing is required. To start at the pose in the supplied file, open the stage that was
    saved before the run, or reset the transforms of the links.

    Example: `{robot}/{base}` at (-1.4, 1.2, 0) on its root, facing 90 degrees.
    """
    robot, stage = subject.robot, subject.stage
    root, base = stage.prim(robot.path), stage.prim(robot.base)
    if root is None or base is None or robot.base_frame not in robot.links:
        return
    wanted = subject.lab.scene.stage.meters_per_unit
    if root.world is None or base.world is None or stage.meters_per_unit != wanted:
        return
    offset = robot.links[robot.base_frame].offset or (0.0, 0.0, 0.0)
    on_root = scaled(offset, 1.0 / (stage.meters_per_unit or 1.0))
    start = decompose(base.world)
    expected = replace(decompose(root.world), translation=transform_point(on_root, root.world))
    limits = root_tolerance(subject.lab.scene, stage)
    away = distance(start.translation, expected.translation) * stage.meters_per_unit
    turn = rotation_difference(start.rotation, expected.rotation)
    if away <= limits.position and turn <= limits.angle:
        return
    at, root_at = (_start(pose, stage.meters_per_unit) for pose in (start, expected))
    message = f"the robot starts {at}; its root has it {root_at}"
    translate = pose_property(base, "translate")
    unknown = stage.unknown_pose(root, base)
    handout = robot.handout if robot.pose is None else robot.pose.handout
    yield Problem(base.path, message, translate, root_at, at, handout, rests_on=unknown)


def _start(pose: Pose, metres: float) -> str:
    """Say where a robot with this pose starts, and how it stands there."""
    ahead = pose.rotation[0]
    facing = round(math.degrees(math.atan2(ahead[1], ahead[0])), 1) + 0.0
    tilt = angle_between(pose.rotation[2], UP)
    tipped = f", tipped by {tilt:.3g} degrees" if tilt >= 1 else ""
    at = vector_text([round(part, 4) for part in scaled(pose.translation, metres)])
    return f"at {at} m, facing {facing:g} degrees{tipped}"
