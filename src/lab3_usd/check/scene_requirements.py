"""Every requirement of the scene itself.

Its place, the rules that speak of it, and whether a stage meets it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache

from msgspec import Struct

from lab3_usd.check.robot.poses import ORDER
from lab3_usd.check.robot.sensors import CAMERA, LIDAR, OTHER, kind_of
from lab3_usd.model.finding import Finding
from lab3_usd.model.physics import BODY_ENABLED, DAMPING, EXCLUDED, LIMITS, MAX_FORCE, STIFFNESS
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import PoseSpec, RobotSpec, SensorSpec

POSE = {
    "translate": ("position", "xformOp:translate"),
    "rotate": ("rotation", "xformOp:orient"),
    "scale": ("scale", "xformOp:scale"),
}
_ROTATE = "xformOp:rotate"
# What tells as well that a part of a pose is wrong: a prim that does not follow its parent.
_ALSO = {"translate": (ORDER, BODY_ENABLED), "rotate": (_ROTATE,)}
# A prim that one of these rules finds missing meets nothing that is asked of it or below it.
_MISSING = ("S01", "S07", "L01", "L03", "C01", "C03", "D01", "D03")


class SceneItem(Struct, frozen=True):
    """One thing asked of the scene.

    `prim` and `property` are the site at which `rules` report it; `also` are other properties that
    may be named instead. Where the thing stands elsewhere, a finding relates to `prim`; `anywhere`
    says that any finding of the rules counts.
    """

    id: str
    group: str
    title: str
    prim: str
    property: str | None
    handout: str
    rules: tuple[str, ...]
    also: tuple[str, ...] = ()
    anywhere: bool = False


def is_met(item: SceneItem, findings: Iterable[Finding]) -> bool:
    """Whether no error says that the item, or the prim that carries it, is missing or wrong."""
    return not any(_concerns(item, found) for found in findings if found.severity == "error")


def _concerns(item: SceneItem, found: Finding) -> bool:
    prims = (found.prim, *(each.partition(".")[0] for each in found.related))
    if found.rule in item.rules and (item.anywhere or item.prim in prims):
        is_site = item.anywhere or found.property == item.property
        return is_site or _is_other_name(item, found.property)
    # What stands elsewhere relates to the place where it is expected, and is not gone.
    is_elsewhere = found.expected in found.related
    is_gone = found.rule in _MISSING and found.property is None and not is_elsewhere
    return is_gone and is_at_or_below(item.prim, found.prim)


def _is_other_name(item: SceneItem, name: str | None) -> bool:
    return name is not None and name.startswith(item.also) if item.also else False


def pose_items(
    group: str, path: str, pose: PoseSpec, rules: Mapping[str, tuple[str, ...]]
) -> Iterator[SceneItem]:
    """Yield position, rotation and scale of a prim; `rules` says which rules judge each."""
    for kind, (word, where) in POSE.items():
        title = f"{path.rpartition('/')[2]}: {word} {getattr(pose, kind)}"
        also = (where, *_ALSO.get(kind, ()))
        yield SceneItem(
            f"{group}/{word}", group, title, path, where, pose.handout, rules[kind], also
        )


SCENE = "Scene"


@lru_cache(maxsize=16)
def scene_items(lab: Lab, checkpoint: Checkpoint) -> tuple[SceneItem, ...]:
    """Return what the checkpoint asks of the scene, in the order of the scene file."""
    items = [*_stage_items(lab), *_robot_items(lab, checkpoint), *_wheel_items(lab)]
    items += _world_items(lab)
    if checkpoint.id == lab.first:
        items.append(_nothing_more(lab))
    for sensor in checkpoint.sensors:
        items += _sensor_items(lab, sensor)
    return tuple(items)


def _stage_items(lab: Lab) -> Iterator[SceneItem]:
    spec = lab.scene.stage
    titles = {
        "upAxis": f"up axis {spec.up_axis}",
        "metersPerUnit": f"{spec.meters_per_unit:g} m per unit",
        "kilogramsPerUnit": f"{spec.kilograms_per_unit:g} kg per unit",
    }
    for name, title in titles.items():
        yield SceneItem(f"Scene/stage/{name}", SCENE, title, "/", name, spec.handout, ("S02",))
    parent = lab.scene.world.graph_parent
    yield _prim_item(parent.path, parent.handout)


def _prim_item(path: str, handout: str) -> SceneItem:
    name = path.rpartition("/")[2]
    return SceneItem(f"Scene/prim/{name}", SCENE, f"{path} exists", path, None, handout, ("S01",))


def _robot_items(lab: Lab, checkpoint: Checkpoint) -> Iterator[SceneItem]:
    robot = lab.scene.robot
    path = robot.path
    yield _prim_item(path, robot.handout)
    yield from pose_items(SCENE, path, robot.pose, dict.fromkeys(POSE, ("S03",)))
    for name, link in robot.links.items():
        yield from _link_items(name, robot)
        if link.offset is not None and checkpoint.id == lab.first:
            yield SceneItem(
                f"Scene/offset/{name}",
                SCENE,
                f"{name} sits at {list(link.offset)} on the robot",
                f"{path}/{name}",
                POSE["translate"][1],
                link.handout,
                ("S17",),
            )
    target = robot.articulation
    if target.target:
        title, where = "one articulation root", target.target
        yield SceneItem("Scene/articulation", SCENE, title, where, None, target.handout, ("S11",))
    if lab.scene.world.ground is not None:
        section = lab.handout.behind("S19", robot.handout)
        title, body = "robot rests on the ground", ("physics:body",)
        yield SceneItem("Scene/rest", SCENE, title, path, None, section, ("S19", "S21"), body)


def _link_items(name: str, robot: RobotSpec) -> Iterator[SceneItem]:
    path, link = f"{robot.path}/{name}", robot.links[name]
    yield _prim_item(path, robot.handout)
    yield SceneItem(
        f"Scene/body/{name}",
        SCENE,
        f"{name} is a rigid body",
        path,
        "physics:rigidBodyEnabled",
        robot.handout,
        ("S05", "S24"),
        ("physics:kinematicEnabled", "xformOp:scale"),
    )
    if link.mass is not None:
        title = f"{name} weighs {link.mass:g} kg"
        yield SceneItem(
            f"Scene/mass/{name}", SCENE, title, path, "physics:mass", link.handout, ("S04",)
        )
    if link.collision:
        title = f"{name} has collision geometry"
        where = "physics:collisionEnabled"
        yield SceneItem(
            f"Scene/collision/{name}", SCENE, title, path, where, link.handout, ("S06",)
        )
    if name not in robot.wheels.joints.values() and name != robot.base_frame:
        yield SceneItem(
            f"Scene/joined/{name}",
            SCENE,
            f"joints tie {name} to the robot",
            path,
            None,
            link.handout,
            ("S12", "S07", "S17"),
            ("physics:localPos",),
        )


def _wheel_items(lab: Lab) -> Iterator[SceneItem]:
    robot = lab.scene.robot
    for name in robot.wheels.joints:
        path, handout = robot.joint_path(name), robot.wheels.handout
        parts: tuple[tuple[str, str, str | None, str, tuple[str, ...]], ...] = (
            (
                "joint",
                f"{name} turns a wheel",
                None,
                "S07 S23",
                ("physics:jointEnabled", EXCLUDED, *LIMITS),
            ),
            ("bodies", f"{name} connects its wheel", "physics:body1", "S08", ("physics:body0",)),
            ("axis", f"{name} turns forward", "physics:axis", "S09", ("physics:localRot",)),
            ("stiffness", f"{name} has stiffness 0", STIFFNESS, "S10", ()),
            ("damping", f"{name} has damping and force", DAMPING, "S10", (MAX_FORCE,)),
            (
                "place",
                f"{name} sits at its place",
                "physics:localPos0",
                "S20",
                ("physics:localPos1",),
            ),
        )
        for part, title, where, ids, also in parts:
            rules = tuple(ids.split())
            yield SceneItem(f"Scene/{part}/{name}", SCENE, title, path, where, handout, rules, also)


_GROUND = ("physics:collisionEnabled", "axis", "xformOp")


def _world_items(lab: Lab) -> Iterator[SceneItem]:
    world = lab.scene.world
    parts = (
        ("ground", world.ground, "a ground with collision", "S13", _GROUND),
        ("light", world.light, "a light", "S14", ()),
        (
            "physics_scene",
            world.physics_scene,
            "a physics scene",
            "S15",
            ("physics:gravity", "physxRigidBody"),
        ),
    )
    for part, spec, title, rule, also in parts:
        if spec is not None:
            yield SceneItem(
                f"Scene/{part}", SCENE, title, spec.usual, None, spec.handout, (rule,), also
            )


def _nothing_more(lab: Lab) -> SceneItem:
    spec, rules = lab.scene.forbidden.starter, ("S18", "L08", "C09", "D07")
    title = "nothing of the later parts"
    return SceneItem("Scene/empty", SCENE, title, "/", None, spec.handout, rules, anywhere=True)


class _RuleIds(Struct, frozen=True):
    """Which rules judge the parts of a sensor."""

    prim: tuple[str, ...]
    place: tuple[str, ...]
    turn: tuple[str, ...]
    values: tuple[str, ...]


_RULES = {
    LIDAR: _RuleIds(("L01", "L02", "L03"), ("L04",), ("L04",), ("L05",)),
    CAMERA: _RuleIds(("C01", "C02", "C03"), ("C04",), ("C05",), ("C06", "C07")),
    OTHER: _RuleIds(("D01", "D02", "D03"), ("D04",), ("D04",), ("D05",)),
}


def _sensor_items(lab: Lab, sensor: str) -> Iterator[SceneItem]:
    """Yield what is asked of a sensor of any kind, and what its kind adds."""
    spec, group = lab.sensors[sensor], _group(lab, sensor)
    path, kind = spec.path, kind_of(spec)
    rules = _RULES[kind]
    title, handout = f"{path} exists", spec.handout
    yield SceneItem(f"{group}/prim", group, title, path, None, handout, rules.prim)
    by_kind = {"translate": rules.place, "rotate": rules.turn, "scale": rules.place}
    yield from pose_items(group, path, spec.pose, by_kind)
    for name, asked in spec.required.items():
        value = list(asked.value) if isinstance(asked.value, tuple) else asked.value
        title, short = f"{group}: {name} {value}", name.rpartition(":")[2]
        yield SceneItem(f"{group}/{short}", group, title, path, name, asked.handout, rules.values)
    if kind == LIDAR:
        yield from _lidar_items(lab, spec, group)
    for api in spec.required_apis if kind == OTHER else ():
        title = f"{group} has {api}"
        yield SceneItem(f"{group}/{api}", group, title, path, None, handout, ("D06",))


def _group(lab: Lab, sensor: str) -> str:
    """Return the name of a sensor's prim; the sensor's own where several prims have that name."""
    names = [spec.name for spec in lab.sensors.values()]
    name = lab.sensors[sensor].name
    return name if names.count(name) == 1 else sensor


def _lidar_items(lab: Lab, spec: SensorSpec, group: str) -> Iterator[SceneItem]:
    """Yield what is asked of lidars alone."""
    scan, forbidden, path = spec.scan, lab.scene.forbidden.lidar, spec.path
    if scan or spec.required_api:
        title = f"{group} has the lidar's schema and gives a scan"
        lows = [low for low, _ in scan.rising] if scan else []
        also = (*scan.above_zero, scan.emitters, *lows) if scan else ()
        rules = ("L06", "L09")
        yield SceneItem(f"{group}/schema", group, title, path, None, spec.handout, rules, also)
    title, handout = "no second lidar", forbidden.handout or spec.handout
    yield SceneItem(f"{group}/only", group, title, path, None, handout, ("L07",), anywhere=True)
