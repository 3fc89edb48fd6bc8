"""What is asked to be added: a kind of graph and options, from a command, a file or Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct
from msgspec.structs import fields

from lab3_usd.errors import UsageError
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.yaml_file import as_record, read_foreign_yaml

# Options that every kind takes, those of kinds with a robot, of sensors, and of ROS.
_EVERY = ("graph", "into")
_ROBOT, _SENSOR, _ROS = ("robot",), ("robot", "prim", "with_tf"), ("namespace", "domain")
_OF_NEED = {"robot": _ROBOT, "frames": _ROBOT, "sensor": _SENSOR, "ros": _ROS}


class Options(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab", omit_defaults=True):
    """The options of a request; None where they are not given.

    `topic` is a name, or names by output. `radius` and `distance` are in metres, `positions` in
    radians, metres, or the same a second. `kind` is the message of a publisher.
    """

    robot: str | None = None
    prim: str | None = None
    graph: str | None = None
    into: str | None = None
    topic: str | dict[str, str] | None = None
    command_topic: str | None = None
    namespace: str | None = None
    frame: str | None = None
    domain: int | None = None
    joints: tuple[str, ...] | None = None
    indices: tuple[int, ...] | None = None
    targets: tuple[str, ...] | None = None
    parent: str | None = None
    node: str | None = None
    radius: float | None = None
    distance: float | None = None
    width: int | None = None
    height: int | None = None
    publish: tuple[str, ...] | None = None
    states: bool | None = None
    commands: bool | None = None
    move: bool | None = None
    robot_tf: bool | None = None
    with_tf: bool | None = None
    keyboard: bool | None = None
    metadata: tuple[str, ...] | None = None
    kind: str | None = None
    gripper: str | None = None
    open: float | None = None
    close: float | None = None
    speed: float | None = None
    positions: tuple[float, ...] | None = None

    def given(self) -> dict[str, Any]:
        """Return the options that are given, by the names of the fields."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: value for name, value in values if value is not None}


class Request(Struct, frozen=True):
    """A graph that is asked for: its kind, which names a recipe, and options."""

    kind: str
    options: Options = Options()


class _File(Struct, forbid_unknown_fields=True):
    add: tuple[str | dict[str, dict[str, Any] | None], ...]


def option_name(field: str) -> str:
    """Return an option as the command line has it."""
    return f"--{field.replace('_', '-')}"


def taken_options(recipe: Recipe) -> set[str]:
    """Return the options that a kind takes, by the names of the fields."""
    needed = {option for need in recipe.needs for option in _OF_NEED.get(need, ())}
    return {*_EVERY, *recipe.options, *needed}


def checked(request: Request, recipes: Mapping[str, Recipe]) -> Recipe:
    """Return the recipe of a request.

    Raises:
        UsageError: there is no such kind, or it does not take an option.
    """
    recipe = recipe_of(request.kind, recipes)
    taken = taken_options(recipe)
    for name in request.options.given():
        if name not in taken:
            known = ", ".join(sorted(map(option_name, taken)))
            raise UsageError(
                f"{option_name(name)} does not go with {recipe.kind}: it takes {known}"
            )
    if request.options.graph and request.options.into:
        raise UsageError("--graph makes a new graph, and --into extends one: give one of the two")
    return recipe


def recipe_of(kind: str, recipes: Mapping[str, Recipe]) -> Recipe:
    """Return the recipe of a kind.

    Raises:
        UsageError: there is none.
    """
    recipe = recipes.get(kind)
    if recipe is None:
        raise UsageError(f"'{kind}' is no kind of graph; known are {', '.join(sorted(recipes))}")
    return recipe


def options_of(values: Mapping[str, Any], where: str) -> Options:
    """Return options out of plain values, by the names of fields or of the command line.

    Raises:
        UsageError: one is unknown, or has another type.
    """
    named = {name.replace("_", "-"): value for name, value in values.items() if value is not None}
    try:
        return msgspec.convert(named, Options)
    except msgspec.ValidationError as error:
        raise UsageError(f"{where}: {error}") from error


def requests_of_file(path: Path) -> list[Request]:
    """Return the requests that a file lists.

    `add: [clock, {drive: {topic: /cmd_vel}}]`

    Raises:
        SpecError: the file is no YAML of this form.
        UsageError: an option is unknown or has another type.
    """
    content = as_record(read_foreign_yaml(path), _File, path.name)
    return [_request(entry, f"{path.name}: add: {n}") for n, entry in enumerate(content.add, 1)]


def _request(entry: str | Mapping[str, Mapping[str, Any] | None], where: str) -> Request:
    if isinstance(entry, str):
        return Request(entry)
    if len(entry) != 1:
        raise UsageError(f"{where}: names {len(entry)} kinds; write one entry for each")
    kind, values = next(iter(entry.items()))
    return Request(kind, options_of(_tuples(values or {}), f"{where}: {kind}"))


def _tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _listed(value) for name, value in values.items()}


def _listed(value: Any) -> Any:
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    return tuple(value) if is_list else value
