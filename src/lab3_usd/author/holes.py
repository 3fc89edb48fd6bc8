"""Fills the holes of recipes with facts of a stage, and says what each rests on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.author import frame_holes, joint_holes, ros_holes, sensor_holes, wheel_holes
from lab3_usd.author.choosing import WHEELED, choose_robot, choose_sensor
from lab3_usd.author.request import Options
from lab3_usd.author.task import Hole, Task, leaf
from lab3_usd.errors import GraphError, UsageError
from lab3_usd.facts.frame_targets import frame_of_prim
from lab3_usd.facts.robots import Robot, Sensor, robot_of, robots
from lab3_usd.isaac.filling import filled
from lab3_usd.isaac.graph import Graph
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.model.stage import StageModel


def subjects(
    stage: StageModel, recipe: Recipe, options: Options
) -> tuple[Robot | None, Sensor | None]:
    """Return the robot and the sensor that a request is about.

    Raises:
        AmbiguousError: several can be meant.
        UsageError: there is none.
    """
    if "sensor" in recipe.needs:
        sensor = choose_sensor(recipe, stage, options)
        return robot_of(sensor.prim.path, stage), sensor
    if "robot" in recipe.needs:
        is_rolling = bool({WHEELED, "steering", "rollers"} & {*recipe.needs})
        return choose_robot(stage, options, WHEELED if is_rolling else ""), None
    is_of_links = options.targets is None and options.node is None
    if "frames" in recipe.needs and (is_of_links or options.robot is not None):
        return choose_robot(stage, options), None
    return None, None


def _filled(task: Task) -> list[Hole]:
    """Return what fills the holes of a recipe."""
    holes = [Hole(name, value) for name, value in task.recipe.usual.items()]
    if task.robot is not None and "sensor" not in task.recipe.needs:
        robot, source = task.robot, f"root: {leaf(task.robot.root)}"
        if task.options.robot is None:
            is_single = len([other for other in robots(task.stage) if other.root]) == 1
            source = f"the only one{'' if is_single else ' with wheels'} ({source})"
        holes += [
            Hole("robot", robot.path, "robot", robot.path, source, "--robot"),
            Hole("root", robot.root),
            Hole("base", robot.base),
            Hole("base_frame", frame_of_prim(robot.base, task.stage)),
        ]
    for need in task.recipe.needs:
        holes += _FILLERS[need](task)
    return holes


class Plan(Struct, frozen=True):
    """A recipe with its holes filled: the graph, the roles that may be shared, and the facts.

    `values` are what fills the holes, by name.
    """

    graph: Graph
    shared: frozenset[str]
    holes: tuple[Hole, ...]
    values: dict[str, Any]


def planned(task: Task) -> Plan:
    """Return the graph that a request asks for.

    Raises:
        UsageError: a fact is missing, several answers fit, or the release lacks something.
    """
    platform, recipe = task.stage.platform, task.recipe
    holes = tuple(_filled(task))
    values = {hole.name: hole.value for hole in holes}
    try:
        graph, shared = filled(recipe, task.path, values, platform)
    except GraphError as error:
        what = f"{recipe.kind} for Isaac Sim {platform.release}"
        raise UsageError(f"{what}: {error}") from error
    return Plan(graph, shared, holes, values)


_FILLERS: Mapping[str, Callable[[Task], Iterator[Hole]]] = {
    "ros": ros_holes.ros,
    "time": ros_holes.time,
    "robot": lambda _task: iter(()),
    "wheels": wheel_holes.wheels,
    "steering": wheel_holes.steering,
    "rollers": wheel_holes.rollers,
    "chassis": frame_holes.chassis,
    "frames": frame_holes.frames,
    "joint_topics": joint_holes.joint_topics,
    "positions": joint_holes.positions,
    "velocities": joint_holes.velocities,
    "gripper": joint_holes.gripper,
    "sensor": sensor_holes.sensor,
    "outputs": sensor_holes.outputs,
    "size": sensor_holes.size,
    "metadata": sensor_holes.metadata,
    "message": sensor_holes.message,
}
