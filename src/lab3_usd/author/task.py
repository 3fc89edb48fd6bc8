"""A request beside the stage, and what fills a hole of its recipe."""

from __future__ import annotations

from typing import Any

from msgspec import Struct

from lab3_usd.author.request import Options
from lab3_usd.errors import UsageError
from lab3_usd.facts.robots import Robot, Sensor
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.model.stage import StageModel


class Hole(Struct, frozen=True):
    """What fills a hole: its value, how people read it, what it rests on, the option for it.

    One without a `label` is not shown.
    """

    name: str
    value: Any
    label: str = ""
    shown: str = ""
    source: str = ""
    option: str = ""


class Task(Struct, frozen=True, eq=False):
    """A request beside the stage: the recipe, and the robot or sensor that it is about.

    `path` is where the graph will stand. With `force`, a robot or sensor that cannot do what is
    asked is taken all the same.
    """

    stage: StageModel
    recipe: Recipe
    options: Options
    path: str
    robot: Robot | None = None
    sensor: Sensor | None = None
    force: bool = False

    @property
    def subject(self) -> str:
        """The prim that the request is about, '' for none: of frames that below which they hang."""
        if self.sensor is not None:
            return self.sensor.prim.path
        if self.robot is not None:
            return self.robot.path
        return self.options.parent or next(iter(self.options.targets or ()), "")


def leaf(path: str) -> str:
    """Return the name of a prim."""
    return path.rpartition("/")[2]


def robot_of_task(task: Task) -> Robot:
    """Return the robot of a request.

    Raises:
        UsageError: it has none.
    """
    if task.robot is None:
        raise UsageError(f"{task.recipe.kind} needs a robot")
    return task.robot
