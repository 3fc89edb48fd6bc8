"""Chooses the robot and the sensor that a request is about; asks where several could be meant."""

from __future__ import annotations

from collections.abc import Sequence

from lab3_usd.author.request import Options
from lab3_usd.errors import AmbiguousError, UsageError
from lab3_usd.facts.articulations import articulations
from lab3_usd.facts.frame_targets import frame_of_prim
from lab3_usd.facts.joined_bodies import joined_bodies
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.facts.robots import Robot, RobotJoint, Sensor, robots, sensors
from lab3_usd.facts.sensor_faults import faults_of
from lab3_usd.isaac.recipes import Recipe, SensorKind
from lab3_usd.isaac.releases import order
from lab3_usd.model.prims import Prim, is_at_or_below
from lab3_usd.model.stage import StageModel, UnresolvedAsset

WHEELED = "wheels"


def present_prim(path: str, stage: StageModel, option: str, named: Sequence[str] = ()) -> Prim:
    """Return the prim at a path that an option names; where there is none, robots are `named`.

    Raises:
        UsageError: there is none, or a missing asset may hold it.
    """
    prim = stage.prim(path) if path.startswith("/") else None
    if prim is not None:
        return prim
    refuse_missing(stage.unknown(path), path)
    near = likely_name(path, [prim.path for prim in stage.prims.values() if prim.present])
    by_name = {robot_path.rpartition("/")[2]: robot_path for robot_path in named}
    near = near or by_name.get(likely_name(path.rpartition("/")[2], by_name) or "")
    advice = did_you_mean(near) or (f"; robots: {', '.join(named)}" if named else "")
    raise UsageError(f"{option} {path}: there is no such prim{advice}")


def refuse_missing(missing: UnresolvedAsset | None, what: str) -> None:
    """Refuse to go on where an asset that cannot be found could hold what is looked for.

    Raises:
        UsageError: there is one.
    """
    if missing is not None:
        raise UsageError(
            f"{missing.asset} cannot be found, which could hold {what} ({missing.prim})"
        )


def choose_robot(stage: StageModel, options: Options, need: str = "") -> Robot:
    """Return the robot that is named, or the only one that can be meant.

    Raises:
        AmbiguousError: there are several.
        UsageError: there is none, or the prim that is named has no articulation.
    """
    if options.robot is not None:
        return _named_robot(options.robot, stage)
    rooted = [robot for robot in robots(stage) if robot.root]
    fitting = [robot for robot in rooted if robot.wheels] if need == WHEELED else rooted
    fitting = fitting or rooted
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise AmbiguousError("robot", [robot_line(robot) for robot in fitting], "--robot")
    refuse_missing(next(iter(stage.unresolved), None), "a robot")
    loose = next(iter(robots(stage)), None)
    if loose is not None:
        raise UsageError(
            f"{loose.path} has no articulation root: apply Articulation Root to {loose.base}"
        )
    raise UsageError("there is no robot: no prim has an articulation root")


def _named_robot(path: str, stage: StageModel) -> Robot:
    present_prim(path, stage, "--robot", [robot.path for robot in robots(stage)])
    roots = list(articulations(path, stage))
    by_root = {robot.root: robot for robot in robots(stage) if robot.root}
    if path in by_root:
        return by_root[path]
    if len(roots) > 1:
        named = [robot_line(by_root[root], root) for root in roots]
        raise AmbiguousError("articulation root", named, "--robot")
    if roots:
        return by_root[roots[0]]
    above = [robot for robot in by_root.values() if path in robot.links or path == robot.path]
    if above:
        return above[0]
    refuse_missing(stage.unknown_below(path), f"the articulation of {path}")
    raise UsageError(
        f"--robot {path}: there is no articulation root at or below it; apply Articulation Root"
    )


def robot_line(robot: Robot, path: str = "") -> str:
    """Return a robot as a question lists it."""
    count = len(robot.wheels)
    wheels = f"{count} wheel{'s' * (count != 1)}"
    what = wheels if count else f"{len(robot.joints)} joints"
    return f"{path or robot.path} ({what})"


def choose_sensor(recipe: Recipe, stage: StageModel, options: Options) -> Sensor:
    """Return the sensor that is named, or the only one of the kind.

    Raises:
        AmbiguousError: there are several.
        UsageError: there is none, or the prim that is named is no such sensor.
    """
    wanted = recipe.sensor
    assert wanted is not None  # noqa: S101 - recipes that need a sensor say which
    release = stage.platform.release
    if wanted.since and order(release) < order(wanted.since):
        raise UsageError(
            f"{recipe.kind} for Isaac Sim {release}: {' and '.join(wanted.types)} prims came with "
            f"Isaac Sim {wanted.since}, and no graph for what was there before is known"
        )
    if options.prim is not None:
        prim = present_prim(options.prim, stage, "--prim")
        _check_type(prim, recipe, wanted)
        carrier = joined_bodies(stage).carrier(prim.path)
        return Sensor(prim, recipe.kind, frame_of_prim(prim.path, stage), carrier)
    candidates = [sensor for sensor in sensors(stage) if sensor.kind == recipe.kind]
    if options.robot is not None:
        robot = _named_robot(options.robot, stage)
        tops = (options.robot, *(sensor.prim.path for sensor in robot.sensors))
        candidates = [
            sensor
            for sensor in candidates
            if any(is_at_or_below(sensor.prim.path, top) for top in tops)
        ]
    if len(candidates) > 1:
        raise AmbiguousError(recipe.kind, [sensor.prim.path for sensor in candidates], "--prim")
    if not candidates:
        refuse_missing(next(iter(stage.unresolved), None), f"a {recipe.kind}")
        raise UsageError(f"there is no {recipe.kind}: no prim of type {' or '.join(wanted.types)}")
    _check_type(candidates[0].prim, recipe, wanted)
    return candidates[0]


def _check_type(prim: Prim, recipe: Recipe, wanted: SensorKind) -> None:
    if prim.type not in wanted.types:
        raise UsageError(
            f"{prim.path} is no {recipe.kind}: its type is '{prim.type}', expected "
            f"{' or '.join(wanted.types)}"
        )


def stopping_fault(prim: Prim, stage: StageModel, *, is_scan: bool) -> str:
    """Return what keeps a sensor from giving anything, '' for nothing."""
    faults = (fault for fault in faults_of(prim, stage) if fault.stops(is_scan=is_scan))
    return next((fault.message for fault in faults), "")


def choose_joints(robot: Robot, names: Sequence[str]) -> list[RobotJoint]:
    """Return the joints of these names.

    Raises:
        UsageError: there is none of a name.
    """
    by_name = {joint.name: joint for joint in robot.joints}
    for name in names:
        if name not in by_name:
            near = did_you_mean(likely_name(name, by_name)) or f": {', '.join(by_name)}"
            raise UsageError(f"--joints {name}: {robot.path} has no such joint{near}")
    return [by_name[name] for name in names]
