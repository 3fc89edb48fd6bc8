"""The bundled starter scene as data: its prims, and what the handout fixes about them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import SpecError
from lab3_usd.spec.scene_spec import SCENE_FILE, check_scene
from lab3_usd.spec.values import typed
from lab3_usd.spec.yaml_file import expect, known_keys, need, read_yaml

STARTER_FILE = "starter.yaml"
_PRIM_KEYS = (
    "like",
    "type",
    "doc",
    "apis",
    "reference",
    "over",
    "pose",
    "set",
    "targets",
    "children",
)
_POSE_KEYS = ("translate", "rotate", "scale")

Number3 = tuple[float, float, float]


class PoseSpec(Struct, frozen=True):
    """Where a prim stands in its parent: metres, degrees about X then Y then Z, factors."""

    translate: Number3 = (0.0, 0.0, 0.0)
    rotate: Number3 = (0.0, 0.0, 0.0)
    scale: Number3 = (1.0, 1.0, 1.0)


class AttributeSpec(Struct, frozen=True):
    """A value of a prim; `type` is None where USD's own schemas know the attribute."""

    name: str
    value: Any
    type: str | None = None


class PrimSpec(Struct, frozen=True):
    """One prim of the starter; an `over` is a library that other prims refer to."""

    path: str
    type: str = ""
    doc: str = ""
    apis: tuple[str, ...] = ()
    reference: str = ""
    over: bool = False
    pose: PoseSpec | None = None
    attributes: tuple[AttributeSpec, ...] = ()
    targets: tuple[tuple[str, tuple[str, ...]], ...] = ()


class StarterSpec(Struct, frozen=True):
    """The whole starter; `prims` holds parents before children, in the order of the file."""

    doc: str
    default_prim: str
    up_axis: str
    meters_per_unit: float
    kilograms_per_unit: float
    prims: tuple[PrimSpec, ...]


def load_starter_spec(folder: Path) -> StarterSpec:
    """Read the bundled starter from `starter.yaml` and `scene.yaml` in `folder`.

    Masses, the robot's pose and the place of the lidar's link are the handout's (5.3, 5.4) and
    stand in `scene.yaml` alone.

    Raises:
        SpecError: a file cannot be read, or says something that no prim can be made of.
    """
    starter, scene = read_yaml(folder / STARTER_FILE), read_yaml(folder / SCENE_FILE)
    check_scene(scene)
    kinds: dict[str, dict[str, Any]] = {}
    for name, kind in need(starter, "kinds", dict, STARTER_FILE).items():
        kinds[name] = _like(kind, kinds, f"{STARTER_FILE}: kind {name}")
    children = need(starter, "prims", dict, STARTER_FILE)
    prims = {prim.path: prim for prim in _prims(children, "", kinds)}
    for fact in _handout_facts(scene["robot"]):
        if fact.path not in prims:
            message = f"{STARTER_FILE}: {fact.path} is missing, {SCENE_FILE} asks for it"
            raise SpecError(message)
        prims[fact.path] = _with_fact(prims[fact.path], fact)
    stage = scene["stage"]
    return StarterSpec(
        doc=need(starter, "doc", str, STARTER_FILE),
        default_prim=need(starter, "default_prim", str, STARTER_FILE),
        up_axis=need(stage, "up_axis", str, SCENE_FILE),
        meters_per_unit=need(stage, "meters_per_unit", float, SCENE_FILE),
        kilograms_per_unit=need(stage, "kilograms_per_unit", float, SCENE_FILE),
        prims=tuple(prims.values()),
    )


def _like(item: Any, kinds: Mapping[str, dict[str, Any]], where: str) -> dict[str, Any]:  # noqa: ANN401
    """Complete a prim with the kind it is like; kinds can only be like kinds above them."""
    known_keys(expect(item, dict, where), _PRIM_KEYS, where)
    if "like" not in item:
        return dict(item)
    name = need(item, "like", str, where)
    if name not in kinds:
        message = f"{where}: is like '{name}', which is no kind above it"
        raise SpecError(message)
    whole = {**kinds[name], **item}
    whole["set"] = {**kinds[name].get("set", {}), **item.get("set", {})}
    del whole["like"]
    return whole


def _prims(
    children: Mapping[str, Any], parent: str, kinds: Mapping[str, dict[str, Any]]
) -> Iterator[PrimSpec]:
    for name, value in children.items():
        path = f"{parent}/{name}"
        where = f"{STARTER_FILE}: {path}"
        item = _like(value, kinds, where)
        yield _prim(item, path, where)
        yield from _prims(expect(item.get("children", {}), dict, where), path, kinds)


def _prim(item: Mapping[str, Any], path: str, where: str) -> PrimSpec:
    over = expect(item.get("over", False), bool, f"{where}: over")
    targets = expect(item.get("targets", {}), dict, f"{where}: targets")
    return PrimSpec(
        path=path,
        type="" if over else need(item, "type", str, where),
        doc=expect(item.get("doc", ""), str, f"{where}: doc"),
        apis=_texts(item.get("apis", []), f"{where}: apis"),
        reference=expect(item.get("reference", ""), str, f"{where}: reference"),
        over=over,
        pose=_pose(item["pose"], f"{where}: pose") if "pose" in item else None,
        attributes=tuple(_attributes(item.get("set", {}), f"{where}: set")),
        targets=tuple(
            (name, _texts(paths, f"{where}: targets: {name}")) for name, paths in targets.items()
        ),
    )


def _texts(value: Any, where: str) -> tuple[str, ...]:  # noqa: ANN401
    return tuple(expect(item, str, where) for item in expect(value, list, where))


def _pose(value: Any, where: str) -> PoseSpec:  # noqa: ANN401
    pose = expect(value, dict, where)
    known_keys(pose, _POSE_KEYS, where)
    numbers: dict[str, Any] = {key: typed(pose[key], "double3", f"{where}: {key}") for key in pose}
    return PoseSpec(**numbers)


def _attributes(value: Any, where: str) -> Iterator[AttributeSpec]:  # noqa: ANN401
    for name, setting in expect(value, dict, where).items():
        if isinstance(setting, dict):
            at = f"{where}: {name}"
            known_keys(setting, ("type", "value"), at)
            yield AttributeSpec(name, setting.get("value"), need(setting, "type", str, at))
        else:
            yield AttributeSpec(name, setting)


def _handout_facts(robot: Mapping[str, Any]) -> Iterator[PrimSpec]:
    """Yield the prims of the robot with no more than the handout says of them."""
    root = robot["path"]
    yield PrimSpec(root, pose=_pose({key: robot["pose"][key] for key in _POSE_KEYS}, SCENE_FILE))
    for name, link in robot["links"].items():
        offset = {"translate": link["offset"]} if "offset" in link else None
        yield PrimSpec(
            f"{root}/{name}",
            pose=None if offset is None else _pose(offset, f"{SCENE_FILE}: {name}: offset"),
            attributes=(AttributeSpec("physics:mass", link["mass"]),) if "mass" in link else (),
        )


def _with_fact(prim: PrimSpec, fact: PrimSpec) -> PrimSpec:
    pose = prim.pose if fact.pose is None else fact.pose
    return replace(prim, pose=pose, attributes=prim.attributes + fact.attributes)
