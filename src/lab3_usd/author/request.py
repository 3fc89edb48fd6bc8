"""What is asked to be added: a kind of graph and options, from a command, a file or Python."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import fields

from lab3_usd.errors import SpecError, UsageError
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.yaml_file import as_record, line_of, read_foreign_yaml

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
            accepted = ", ".join(sorted(map(option_name, taken)))
            raise UsageError(
                f"{option_name(name)} does not apply to {recipe.kind}, which has {accepted}"
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
        near = did_you_mean(likely_name(kind, list(recipes)))
        listed = ", ".join(sorted(recipes))
        raise UsageError(f"'{kind}' is not a kind of graph{near}; known are {listed}")
    return recipe


def options_of(
    values: Mapping[str, Any], kind: str, known: Collection[str] = Options.__struct_fields__
) -> Options:
    """Return options out of plain values, by the names of fields or of the command line.

    Raises:
        UsageError: one is not known, or has another type.
    """
    named = {name.replace("_", "-"): value for name, value in values.items() if value is not None}
    names = [name.replace("_", "-") for name in known]
    for name in named:
        if name not in names:
            near, listed = did_you_mean(likely_name(name, names)), ", ".join(names)
            raise UsageError(f"'{name}' is not an option of {kind}{near}; known are {listed}")
    try:
        return as_record(named, Options, kind)
    except SpecError as error:
        raise UsageError(str(error)) from error


def requests_of_file(path: Path, recipes: Mapping[str, Recipe]) -> list[Request]:
    """Return the requests that a file lists.

    `add: [clock, {drive: {topic: /cmd_vel}}]`

    Raises:
        SpecError: the file is no YAML of this form.
        UsageError: a kind or an option is unknown, or a value has another type; the text names the
            file and the line.
    """
    content = as_record(read_foreign_yaml(path), _File, path.name)
    return [_request(path, number, entry, recipes) for number, entry in enumerate(content.add)]


def _request(
    path: Path,
    number: int,
    entry: str | Mapping[str, Mapping[str, Any] | None],
    recipes: Mapping[str, Recipe],
) -> Request:
    kinds = {entry: None} if isinstance(entry, str) else entry
    options: dict[str, Any] = {}
    with _at(path, "add", number):
        if len(kinds) != 1:
            raise UsageError(f"names {len(kinds)} kinds; write one entry for each")
        kind, values = next(iter(kinds.items()))
        recipe = recipe_of(kind, recipes)
    for key, value in (values or {}).items():
        with _at(path, "add", number, kind, key):
            options |= options_of({key: value}, kind, sorted(taken_options(recipe))).given()
    request = Request(kind, Options(**options))
    with _at(path, "add", number):
        checked(request, recipes)
    return request


@contextmanager
def _at(path: Path, *keys: str | int) -> Iterator[None]:
    """Name the file and the line of what is refused."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{path.name}: line {line_of(path, keys)}: {error}") from error
