"""What a course asks of the things of a scene, by checkpoint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.spec.scene import Number, Unit

_OUTPUT = "outputs:"


class PlaceSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Where the origin of a thing is in the world, whatever its parents: `{x: 1.2, y: 0}`.

    An axis that is left out is free; the others are met `within` so many metres.
    """

    x: Number | None = None
    y: Number | None = None
    z: Number | None = None
    within: Unit = 0.01

    def __post_init__(self) -> None:
        """Refuse a place that is everywhere."""
        if not self.axes:
            raise ValueError("names none of x, y and z")

    @property
    def axes(self) -> dict[int, float]:
        """The numbers that are asked for, by the number of the axis."""
        both = enumerate((self.x, self.y, self.z))
        return {axis: value for axis, value in both if value is not None}


class EarlierPropSpec(Struct, frozen=True, forbid_unknown_fields=True, rename={"values": "set"}):
    """What a thing has up to a checkpoint, where a later one changes it."""

    values: Mapping[str, Any] = {}
    targets: Mapping[str, tuple[str, ...]] = {}
    variants: Mapping[str, str] = {}
    place: PlaceSpec | None = None


class PropSpec(
    Struct, frozen=True, forbid_unknown_fields=True, rename={"since": "from", "values": "set"}
):
    """Things of a scene, by a path with `*`: `count` of them, at least one without it.

    They have `apis`, `targets` and values (`set`, as USD has them): `racks: {path: /Hall/Rack_*,
    count: 4, apis: ["SemanticsLabelsAPI:class"], targets: {"material:binding": [/Hall/Steel]}, set:
    {"semantics:labels:class": [rack]}}`. Values that no schema has need a type: `{type: "token[]",
    value: [rack]}`. A target that is a property is what an attribute is connected to:
    `"outputs:surface": [/Hall/Steel/Surface.outputs:surface]`. Things refer to the `asset`, named
    by the end of its path (`props/rack.usd`), which can be found if they are `resolved`, and have
    the `variants` of its sets: `{finish: red}`. A material may be bound above them, and
    `visibility: inherited` means that nothing above hides them. `build` makes those `from` a
    checkpoint on, or completes what is there; up to those in `until` they have other values:
    `until: {"3": {set: {"inputs:intensity": 500}}}`.
    """

    path: str
    handout: str
    type: str = ""
    count: int | None = None
    apis: tuple[str, ...] = ()
    targets: Mapping[str, tuple[str, ...]] = {}
    values: Mapping[str, Any] = {}
    variants: Mapping[str, str] = {}
    place: PlaceSpec | None = None
    asset: str = ""
    resolved: bool = False
    since: str = ""
    until: Mapping[str, EarlierPropSpec] = {}

    def __post_init__(self) -> None:
        """Refuse a path that no prim can have, and a number of things that one path cannot."""
        start, *names = self.path.split("/")
        if start or not names or not all(names):
            raise ValueError(f"path: {self.path!r} is not the absolute path of a prim")
        if (self.count or 0) > 1 and "*" not in self.path:
            raise ValueError(f"count: {self.count} things have one path, {self.path}, without a *")
        every = [self.targets, *(earlier.targets for earlier in self.until.values())]
        outputs = [o for targets in every for o in targets.items() if o[0].startswith(_OUTPUT)]
        for name, paths in outputs:
            for target in (path for path in paths if "." not in path):
                meant = f"{target.rstrip('/')}.{_OUTPUT}..."
                raise ValueError(
                    f"targets: {name}: {target} is a prim, and an output is connected to a "
                    f"property: {meant}"
                )
        for name, value in self.values.items():
            if isinstance(value, Mapping) and not {"value"} <= {*value} <= {"type", "value"}:
                raise ValueError(f"set: {name}: is written as {{type: float, value: 1.0}}")
        for name, value in self.plain_values.items():
            if name.startswith(_OUTPUT):
                wrong = f"set: {name}: an output is computed; what it is connected to, as"
                raise ValueError(f"{wrong} {value}, is one of `targets`")

    @property
    def connections(self) -> dict[str, tuple[str, ...]]:
        """The properties that attributes are connected to."""
        return {name: paths for name, paths in self.targets.items() if _are_properties(paths)}

    @property
    def relationships(self) -> dict[str, tuple[str, ...]]:
        """The prims that relationships name."""
        return {name: paths for name, paths in self.targets.items() if not _are_properties(paths)}

    @property
    def properties(self) -> frozenset[str]:
        """The names of the attributes and relationships that some checkpoint asks for."""
        held = [(self.values, self.targets), *((e.values, e.targets) for e in self.until.values())]
        return frozenset(name for both in held for names in both for name in names)

    def before(self, coming: Iterable[str]) -> PropSpec:
        """Return the things as they are at the first of these checkpoints, which are in order."""
        last = next((each for each in coming if each in self.until), None)
        if last is None:
            return self
        earlier = self.until[last]
        return replace(
            self,
            values={**self.values, **earlier.values},
            targets={**self.targets, **earlier.targets},
            variants={**self.variants, **earlier.variants},
            place=earlier.place or self.place,
        )

    def refers(self, assets: Iterable[str]) -> bool:
        """Whether one of these is the asset."""
        return any(is_named(self.asset, asset) for asset in assets)

    def stands_at(self, path: str) -> bool:
        """Whether a prim is one of them: `*` stands for letters of one name."""
        pattern, names = self.path.split("/"), path.split("/")
        return len(pattern) == len(names) and all(map(fnmatchcase, names, pattern))

    def places(self, there: Iterable[str]) -> tuple[str, ...]:
        """Return the paths of the things: those that are there, and numbered ones up to `count`."""
        standing = [path for path in there if self.stands_at(path)]
        numbers = range(1, 1 + (self.count or (0 if standing else 1)))
        made = (self.path.replace("*", str(number)) for number in numbers)
        can_be = [
            path for path in dict.fromkeys(made) if all(map(str.isidentifier, path.split("/")[1:]))
        ]
        free = [path for path in can_be if path not in standing]
        lacking = len(free) if self.count is None else max(0, self.count - len(standing))
        return (*standing, *free[:lacking])

    @property
    def plain_values(self) -> dict[str, Any]:
        """The values by name, without their types."""
        return {name: _plain(value) for name, value in self.values.items()}

    @property
    def types(self) -> dict[str, str]:
        """The types that are given beside values, by name."""
        given = self.values.items()
        return {
            name: str(value["type"])
            for name, value in given
            if isinstance(value, Mapping) and "type" in value
        }


def is_named(asked: str, file: str) -> bool:
    """Whether a file has the name that is asked for: the end of its path."""
    return f"/{file}".endswith(f"/{asked.removeprefix('./')}")


def _plain(value: Any) -> Any:
    """Return a value as it is read of a stage, without the type that stands beside it."""
    value = value["value"] if isinstance(value, Mapping) else value
    return tuple(map(_plain, value)) if isinstance(value, (list, tuple)) else value


def _are_properties(paths: Iterable[str]) -> bool:
    return any("." in path for path in paths)
