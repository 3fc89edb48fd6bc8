"""Loads `starter.yaml`: the prims of the starter scene, and what the handout fixes about them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.data import own_team, program
from lab3_usd.errors import SpecError
from lab3_usd.spec.lab import SCENE, STARTER
from lab3_usd.spec.load.lab import parse_scene
from lab3_usd.spec.positions import located
from lab3_usd.spec.scene import Number3, RobotSpec, StageUnits
from lab3_usd.spec.submission import FIRST_TEAM, of_team
from lab3_usd.yaml_file import as_record, read_yaml

_Data = dict[str, Any]
NAMESPACE = "isaac:namespace"


class PoseSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The pose in the parent: metres, degrees about X then Y then Z, factors."""

    translate: Number3 = (0.0, 0.0, 0.0)
    rotate: Number3 = (0.0, 0.0, 0.0)
    scale: Number3 = (1.0, 1.0, 1.0)


class AttributeSpec(Struct, frozen=True):
    """A value of a prim; `type` is None where USD's own schemas know the attribute."""

    name: str
    value: Any
    type: str | None = None


class PrimSpec(Struct, frozen=True):
    """One prim to write; an `over` is a library that other prims refer to.

    `site` is where its values stand in the lab, by file and keys.
    """

    path: str
    type: str = ""
    doc: str = ""
    apis: tuple[str, ...] = ()
    reference: str = ""
    over: bool = False
    pose: PoseSpec | None = None
    attributes: tuple[AttributeSpec, ...] = ()
    targets: tuple[tuple[str, tuple[str, ...]], ...] = ()
    site: str = ""


class PrimEntry(Struct, forbid_unknown_fields=True):
    """A prim; `like` names a kind whose keys it copies.

    `set` has values as USD has them: lengths in units of the stage.
    """

    like: str = ""
    type: str = ""
    doc: str = ""
    apis: tuple[str, ...] = ()
    reference: str = ""
    over: bool = False
    pose: PoseSpec | None = None
    attributes: _Data = field(name="set", default_factory=dict)
    targets: dict[str, tuple[str, ...]] = {}
    children: dict[str, _Data] = {}


class _Attribute(Struct, forbid_unknown_fields=True):
    type: str
    value: Any = None


class StarterFile(Struct, forbid_unknown_fields=True):
    """The prims of the starter scene."""

    default_prim: str
    prims: dict[str, _Data]
    doc: str = ""
    kinds: dict[str, _Data] = {}


class StarterSpec(Struct, frozen=True):
    """The whole starter; `prims` holds parents before children, in the order of the file."""

    doc: str
    default_prim: str
    units: StageUnits
    prims: tuple[PrimSpec, ...]


def load_starter_spec(folder: Path) -> StarterSpec:
    """Read the starter from `starter.yaml` and `scene.yaml` in `folder`.

    Masses, the robot's pose and the place of the lidar's link are the handout's and
    stand in `scene.yaml` alone.

    Raises:
        SpecError: a file cannot be read, or says something that no prim can be made of; the line
            ends with its place in the file.
    """
    if not (folder / STARTER).is_file():
        hint = f"pass your own starter scene to {program()} build"
        raise SpecError(f"{folder} has no {STARTER}: {hint}")
    try:
        return _starter_of(folder)
    except SpecError as error:
        raise located(error, folder) from error


def _starter_of(folder: Path) -> StarterSpec:
    team = own_team() or FIRST_TEAM
    starter = as_record(of_team(read_yaml(folder / STARTER), team), StarterFile, STARTER)
    scene = parse_scene(of_team(read_yaml(folder / SCENE), team))
    kinds: dict[str, _Data] = {}
    for name, kind in starter.kinds.items():
        kinds[name] = _like(kind, kinds, f"{STARTER}: kind {name}")
    prims = {prim.path: prim for prim in _prims(starter.prims, "", kinds)}
    facts = [fact for robot in scene.robots for fact in _handout_facts(robot)]
    made = tuple(sensor.path for sensor in scene.sensors.values())
    facts += [
        PrimSpec(path, attributes=(AttributeSpec(NAMESPACE, name, "string"),))
        for path, name in scene.namespaces.items()
        if path not in made
    ]
    for fact in facts:
        if fact.path not in prims:
            raise SpecError(f"{STARTER}: {fact.path} is missing, {SCENE} asks for it")
        prim = prims[fact.path]
        pose = prim.pose if fact.pose is None else fact.pose
        attributes = prim.attributes + fact.attributes
        prims[fact.path] = replace(prim, pose=pose, attributes=attributes)
    return StarterSpec(
        doc=starter.doc,
        default_prim=starter.default_prim,
        units=scene.stage,
        prims=tuple(prims.values()),
    )


def _like(item: _Data, kinds: Mapping[str, _Data], where: str) -> _Data:
    """Complete a prim with the kind it is like; kinds can only be like kinds above them."""
    content = as_record(item, PrimEntry, where)
    if not content.like:
        return item
    if content.like not in kinds:
        raise SpecError(f"{where}: is like '{content.like}', which is not a kind above it")
    kind = kinds[content.like]
    whole = {**kind, **item, "set": kind.get("set", {}) | content.attributes}
    del whole["like"]
    return whole


def _prims(
    children: Mapping[str, _Data], parent: str, kinds: Mapping[str, _Data]
) -> Iterator[PrimSpec]:
    for name, item in children.items():
        path = f"{parent}/{name}"
        where = f"{STARTER}: {path}"
        prim = as_record(_like(item, kinds, where), PrimEntry, where)
        if not prim.type and not prim.over:
            raise SpecError(f"{where}: 'type' is missing")
        yield PrimSpec(
            path=path,
            site=where,
            type="" if prim.over else prim.type,
            doc=prim.doc,
            apis=prim.apis,
            reference=prim.reference,
            over=prim.over,
            pose=prim.pose,
            attributes=tuple(_attributes(prim.attributes, f"{where}: set")),
            targets=tuple(prim.targets.items()),
        )
        yield from _prims(prim.children, path, kinds)


def _attributes(values: _Data, where: str) -> Iterator[AttributeSpec]:
    for name, value in values.items():
        if isinstance(value, dict):
            content = as_record(value, _Attribute, f"{where}: {name}")
            yield AttributeSpec(name, content.value, content.type)
        else:
            yield AttributeSpec(name, value)


def _handout_facts(robot: RobotSpec) -> Iterator[PrimSpec]:
    """Yield the prims of the robot with no more than the handout says of them."""
    pose = robot.pose
    place = None if pose is None else PoseSpec(pose.translate, pose.rotate, pose.scale)
    yield PrimSpec(robot.path, pose=place)
    for name, link in robot.links.items():
        path, is_nested = robot.path_of(name), "/" in name
        place = None if link.offset is None or is_nested else PoseSpec(link.offset)
        mass = () if link.mass is None else (AttributeSpec("physics:mass", link.mass),)
        yield PrimSpec(path, pose=place, attributes=mass)
