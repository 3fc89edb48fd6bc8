"""Every single fault of the scene of any lab, made of what its description says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pxr import Gf, Usd, UsdGeom
from sabotage import Fault
from scene_stages import (
    ORIENT,
    SCALE,
    TRANSLATE,
    Change,
    aim,
    clear,
    deactivate,
    detach,
    drive,
    move_prim,
    put,
    remove,
    retype,
    switch,
    turn,
    undefine,
    void,
    weld,
    without_api,
)

from lab3_usd.facts.sensor_values import sensor_values
from lab3_usd.model.stage import same_value
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import PoseSpec, SensorSpec

_GONE = {"removed": remove, "deactivated": deactivate, "only over": undefine}


def lab_scene_faults(lab: Lab, checkpoint: Checkpoint) -> Iterator[Fault]:
    """Yield the faults of robot, world and sensors that this checkpoint shows."""
    found = [*_units(lab), *_robot(lab), *_links(lab), *_wheels(lab), *_world(lab)]
    if checkpoint.id == lab.first:
        found += _early(lab)
    for name in checkpoint.sensors:
        found += _sensor(lab, lab.sensors[name])
    for name, change, site in found:
        yield Fault(name, "scene", change, (site,))


_Found = tuple[str, Change, str]


def _units(lab: Lab) -> Iterator[_Found]:
    up = "Z" if lab.scene.stage.up_axis == "Y" else "Y"
    yield f"{up} up", lambda stage: void(UsdGeom.SetStageUpAxis(stage, up)), "/"
    wrong = 0.1 * _metres(lab)
    yield "other units", lambda stage: void(UsdGeom.SetStageMetersPerUnit(stage, wrong)), "/"


def _metres(lab: Lab) -> float:
    """Return the length of one unit of the lab's stages."""
    return lab.scene.stage.meters_per_unit


def _place(lab: Lab, pose: PoseSpec, *away: float) -> Gf.Vec3d:
    """Return where a prim stands that is some metres away from its place, in stage units."""
    return (Gf.Vec3d(*pose.translate) + Gf.Vec3d(*away)) / _metres(lab)


def _robot(lab: Lab) -> Iterator[_Found]:
    robot = lab.scene.robot
    path, base = robot.path, robot.articulation.target
    for what, change in _GONE.items():
        yield f"robot {what}", change(path), path
    yield "robot moved", put(path, TRANSLATE, _place(lab, robot.pose, 0.3, 0, 0)), path
    yield "robot lifted", put(path, TRANSLATE, _place(lab, robot.pose, 0, 0, 0.2)), path
    yield "robot turned", put(path, ORIENT, turn(45)), path
    yield "robot scaled", put(path, SCALE, Gf.Vec3d(2, 2, 2)), path
    if base:
        yield "no articulation", without_api(base, robot.articulation.api), base
    if robot.wheels.joints:
        yield "held by the world", weld(f"{path}/hold", body1=base), f"{path}/hold"


def _links(lab: Lab) -> Iterator[_Found]:
    robot = lab.scene.robot
    for name, link in robot.links.items():
        path = f"{robot.path}/{name}"
        for what, change in _GONE.items():
            yield f"{name} {what}", change(path), path
        yield f"{name} no body", without_api(path, "PhysicsRigidBodyAPI"), path
        yield f"{name} body off", switch(path, "physics:rigidBodyEnabled"), path
        if link.mass is not None:
            yield f"{name} heavy", put(path, "physics:mass", 5.5), path
            yield f"{name} without mass", clear(path, "physics:mass"), path


def _wheels(lab: Lab) -> Iterator[_Found]:
    robot = lab.scene.robot
    wheels = robot.wheels
    for name, link in wheels.joints.items():
        path = robot.joint_path(name)
        others = [joint for joint in wheels.joints.values() if joint != link]
        for what, change in _joint_changes(path, f"{robot.path}/{others[0]}").items():
            yield f"{name} {what}", change, path
        yield f"{name} renamed", move_prim(path, f"{path}_1"), f"{path}_1"


def _joint_changes(path: str, other: str) -> Mapping[str, Change]:
    return {
        "removed": remove(path),
        "deactivated": deactivate(path),
        "fixed": retype(path, "PhysicsFixedJoint"),
        "disabled": switch(path, "physics:jointEnabled"),
        "wrong wheel": aim(path, "physics:body1", other),
        "in the world": aim(path, "physics:body0"),
        "axis": put(path, "physics:axis", "X"),
        "stiff": put(path, drive("stiffness"), 10.0),
        "undamped": put(path, drive("damping"), 0.0),
        "undriven": without_api(path, "PhysicsDriveAPI:angular"),
        "wide": _shift(path),
    }


def _shift(path: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        place = stage.GetPrimAtPath(path).GetAttribute("physics:localPos0")
        x, y, z = place.Get()
        place.Set(Gf.Vec3f(x, y * 1.5, z))

    return change


def _world(lab: Lab) -> Iterator[_Found]:
    world = lab.scene.world
    yield "no graph parent", remove(world.graph_parent.path), world.graph_parent.path
    for part, spec, types in (
        ("ground", world.ground, ("Plane",)),
        ("light", world.light, ("DistantLight", "DomeLight")),
        ("physics_scene", world.physics_scene, ("PhysicsScene",)),
    ):
        if spec is not None:
            yield f"no {part}", _without(types), spec.usual


def _without(types: tuple[str, ...]) -> Change:
    def change(stage: Usd.Stage) -> None:
        for prim in [each for each in stage.Traverse() if each.GetTypeName() in types]:
            stage.RemovePrim(prim.GetPath())

    return change


def _early(lab: Lab) -> Iterator[_Found]:
    for name, spec in lab.sensors.items():
        path, kind = spec.path, spec.type
        yield f"{name} in the starter", _defined(path, kind), path
    for graph in lab.graphs.values():
        if not any(graph.path.startswith(sensor.path) for sensor in lab.sensors.values()):
            yield f"{graph.name} in the starter", _defined(graph.path, "OmniGraph"), graph.path


def _defined(path: str, kind: str) -> Change:
    return lambda stage: void(stage.DefinePrim(path, kind))


def _sensor(lab: Lab, spec: SensorSpec) -> Iterator[_Found]:
    path, name = spec.path, spec.name
    for what, change in _GONE.items():
        yield f"{name} {what}", change(path), path
    yield f"{name} renamed", move_prim(path, f"{path}_1"), f"{path}_1"
    yield f"{name} an Xform", retype(path, "Xform"), path
    yield f"{name} moved", put(path, TRANSLATE, _place(lab, spec.pose, 0, 0, 0.05)), path
    yield f"{name} turned", put(path, ORIENT, turn(5)), path
    yield f"{name} scaled", put(path, SCALE, Gf.Vec3d(1, 1, 2)), path
    yield f"{name} left behind", detach(path), path
    for api in (*spec.required_apis, *filter(None, [spec.required_api])):
        yield f"{name} without {api}", without_api(path, api), path
    by_schema = sensor_values(lab.platform, spec.apis, {})
    for attribute, entry in spec.required.items():
        yield f"{name} {attribute} wrong", put(path, attribute, entry.value * 3), path
        if not same_value(by_schema.get(attribute), entry.value):
            yield f"{name} {attribute} unset", clear(path, attribute), path
