"""Built stages to break or rewrite, and what the rules of scene and sensors say of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import quick_yaml
from breaking import copied, correct_stage
from models import ROBOT
from pxr import Gf, Sdf, Usd, UsdGeom

from lab3_usd.check.fold import fold
from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.check.registry import Rule, rules_of
from lab3_usd.check.requirements import with_unmet
from lab3_usd.check.rule_runs import finding_of, problems_of
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.read.stage_reader import read_model

JOINTS = f"{ROBOT}/joints"
LIDAR = f"{ROBOT}/base_scan/Lidar2D"
CAMERA = f"{ROBOT}/base_footprint/Camera_1"
WHEELS = {"wheel_left_joint": "wheel_left_link", "wheel_right_joint": "wheel_right_link"}
FLOOR = "/Environment/GroundPlane/CollisionPlane"
TRANSLATE, ORIENT, SCALE = "xformOp:translate", "xformOp:orient", "xformOp:scale"
TICK, TURNS = "omni:sensor:tickRate", "omni:sensor:Core:scanRateBaseHz"

Change = Callable[[Usd.Stage], None]


class Sabotage(NamedTuple):
    """A fault: its name, the checkpoint, how to make it, and where it must be found."""

    name: str
    checkpoint: str
    apply: Change
    site: tuple[str, str | None]


def remove(path: str) -> Change:
    return lambda stage: void(stage.RemovePrim(path))


def deactivate(path: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).SetActive(False))  # noqa: FBT003 - no keyword


def undefine(path: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).SetSpecifier(Sdf.SpecifierOver))


def retype(path: str, kind: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).SetTypeName(kind))


def put(path: str, name: str, value: Any) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).GetAttribute(name).Set(value))


def switch(path: str, name: str, *, on: bool = False) -> Change:
    def change(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(path).CreateAttribute(name, Sdf.ValueTypeNames.Bool).Set(on)

    return change


def author(path: str, name: str, kind: str, value: Any) -> Change:
    """Write an attribute that the prim may not have yet; `kind` is one of Sdf.ValueTypeNames."""

    def change(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath(path)
        prim.CreateAttribute(name, getattr(Sdf.ValueTypeNames, kind)).Set(value)

    return change


MATERIALS = ("/Environment/PhysicsMaterials/Ground", "/Environment/PhysicsMaterials/Tyre")
SLIDING = "physics:dynamicFriction"


def slick(*materials: str) -> Change:
    """Take all friction from materials."""
    names = ("physics:staticFriction", SLIDING)
    return several(*(put(path, name, 0.0) for path in materials for name in names))


def detach(path: str) -> Change:
    """Let a prim leave out the transforms of its parents."""
    return lambda stage: void(
        UsdGeom.Xformable(stage.GetPrimAtPath(path)).SetResetXformStack(True)  # noqa: FBT003 - no keyword
        if stage.GetPrimAtPath(path).IsA(UsdGeom.Xformable)
        else put(
            path,
            "xformOpOrder",
            ["!resetXformStack!", *stage.GetPrimAtPath(path).GetAttribute("xformOpOrder").Get()],
        )(stage)
    )


def clear(path: str, name: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).RemoveProperty(name))


def without_api(path: str, api: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).RemoveAppliedSchema(api))


def with_api(path: str, api: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).AddAppliedSchema(api))


def weld(path: str, kind: str = "PhysicsFixedJoint", **ends: str) -> Change:
    """Add a joint; a body that is not given is the world."""

    def change(stage: Usd.Stage) -> None:
        joint = stage.DefinePrim(path, kind)
        for name, target in ends.items():
            joint.CreateRelationship(f"physics:{name}", custom=False).SetTargets([target])

    return change


def aim(path: str, name: str, *targets: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).GetRelationship(name).SetTargets(targets))


def define(path: str, kind: str) -> Change:
    return lambda stage: void(stage.DefinePrim(path, kind))


def refer(path: str, asset: str) -> Change:
    return lambda stage: void(stage.GetPrimAtPath(path).GetReferences().AddReference(asset))


def hide_place(path: str) -> Change:
    """Leave the place of a prim to an asset that cannot be found."""

    def change(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath(path)
        for name in prim.GetAuthoredPropertyNames():
            if name.startswith("xformOp"):
                prim.RemoveProperty(name)
        prim.GetPayloads().AddPayload("https://assets.example/asset.usd")

    return change


def move_prim(old: str, new: str) -> Change:
    """Rename or reparent a prim with all that names it, as the Stage panel does."""

    def change(stage: Usd.Stage) -> None:
        editor = Usd.NamespaceEditor(stage)
        assert editor.MovePrimAtPath(old, new)
        assert editor.ApplyEdits()

    return change


def several(*changes: Change) -> Change:
    def change(stage: Usd.Stage) -> None:
        for change in changes:
            change(stage)

    return change


def rotated(path: str, degrees: tuple[float, float, float], order: str = "XYZ") -> Change:
    """Write the rotation of a prim as angles, in single precision."""

    def change(stage: Usd.Stage) -> None:
        xform = UsdGeom.Xformable(stage.GetPrimAtPath(path))
        place = stage.GetPrimAtPath(path).GetAttribute(TRANSLATE).Get()
        xform.ClearXformOpOrder()
        xform.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(place)
        xform.AddXformOp(getattr(UsdGeom.XformOp, f"TypeRotate{order}")).Set(Gf.Vec3f(*degrees))

    return change


def as_matrix(path: str) -> Change:
    """Write the pose of a prim as one matrix."""

    def change(stage: Usd.Stage) -> None:
        xform = UsdGeom.Xformable(stage.GetPrimAtPath(path))
        matrix = xform.GetLocalTransformation()
        xform.MakeMatrixXform().Set(matrix)

    return change


def negated(path: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        attribute = stage.GetPrimAtPath(path).GetAttribute(ORIENT)
        attribute.Set(-attribute.Get())

    return change


def void(_: object) -> None:
    """Drop what the USD API returns."""


def turn(degrees: float, axis: tuple[float, float, float] = (0, 0, 1)) -> Gf.Quatd:
    return Gf.Rotation(Gf.Vec3d(*axis), degrees).GetQuat()


def collider(wheel: str) -> str:
    return f"{ROBOT}/{wheel}/collisions/tyre"


def drive(part: str) -> str:
    return f"drive:angular:physics:{part}"


def slab(stage: Usd.Stage) -> None:
    """Stand on a flat box instead of the plane."""
    stage.RemovePrim(FLOOR)
    cube = UsdGeom.Cube.Define(stage, "/World/Slab")
    cube.CreateSizeAttr(1)
    cube.AddTranslateOp().Set(Gf.Vec3d(0, 0, -0.05))
    cube.AddScaleOp().Set(Gf.Vec3f(20, 20, 0.1))
    cube.GetPrim().AddAppliedSchema("PhysicsCollisionAPI")


CASES: Mapping[str, Mapping[str, Any]] = quick_yaml.load(
    (Path(__file__).resolve().parents[1] / "sensor_values.yaml").read_text(encoding="utf-8")
)
CORE, STATE = "omni:sensor:Core:", "emitterState:"
STATE_API = "OmniSensorGenericLidarCoreEmitterStateAPI"


def whole(name: str) -> str:
    """Return the whole name of an attribute of a case."""
    if name.startswith("omni:"):
        return name
    return f"{CORE}{STATE if ':' in name else ''}{name}"


def lidar_alone() -> Usd.Stage:
    """Return a stage that has the lidar of the last stage of the lab, and nothing else."""
    return copied(_lidar())


@cache
def _lidar() -> Sdf.Layer:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(layer, LIDAR)
    Sdf.CopySpec(built("05").GetRootLayer(), LIDAR, layer, LIDAR)
    layer.GetPrimAtPath(LIDAR).nameChildren.clear()
    for path in Sdf.Path(LIDAR).GetPrefixes():
        layer.GetPrimAtPath(path).specifier = Sdf.SpecifierDef
    return layer


def with_values(change: Mapping[str, Any], stage: Usd.Stage | None = None) -> Usd.Stage:
    """Return the last stage of the lab after a change of its lidar."""
    stage = stage or built("05")
    lidar = stage.GetPrimAtPath(LIDAR)
    for name, said in change.items():
        if name == "apply":
            apis = Sdf.TokenListOp()
            apis.prependedItems = [
                *lidar.GetPrimTypeInfo().GetAppliedAPISchemas(),
                f"{STATE_API}:{said}",
            ]
            lidar.SetMetadata("apiSchemas", apis)
        elif said is None:
            lidar.RemoveProperty(whole(name))
        else:
            kind, value = said
            lidar.RemoveProperty(whole(name))
            attribute = lidar.CreateAttribute(
                whole(name), Sdf.ValueTypeNames.Find(kind), custom=False
            )
            attribute.Set(float(value) if value == "nan" else value)
    return stage


built = correct_stage
FAMILIES = ("F", "S", "L", "C")
OF_ALL_SENSORS = "D08"


def model_of(stage: Usd.Stage) -> StageModel:
    with quiet():
        return read_model(stage, load_lab().platform, "stage.usda")


def stage_rules() -> dict[str, Rule]:
    """The rules about files, scene and sensors that judge a stage, by id."""
    of_robots = (*rules_of("robot", *FAMILIES), *rules_of("world", *FAMILIES))
    found = (*rules_of("model", "F"), *rules_of("stage", *FAMILIES, "D"), *of_robots)
    by_id = {rule.id: rule for rule in found if rule.id[0] in FAMILIES or rule.id == OF_ALL_SENSORS}
    return dict(sorted(by_id.items()))


def findings_of(stage: Usd.Stage, checkpoint: str) -> list[Finding]:
    """What the rules about files, scene and sensors say."""
    lab = load_lab()
    subject = StageSubject(lab, lab.checkpoints[checkpoint], model_of(stage), {})
    findings = (
        finding_of(rule, problem, lab)
        for rule in stage_rules().values()
        for problem in problems_of(rule, subject)
        if problem.rests_on is None
    )
    return [*with_unmet(fold(findings), subject, lab)]


def told(stage: Usd.Stage, checkpoint: str) -> list[tuple[str, str, str | None]]:
    """Rule, prim and property of everything that is said of the stage."""
    return [
        (finding.rule, finding.prim, finding.property) for finding in findings_of(stage, checkpoint)
    ]


def found_after(checkpoint: str, *changes: Change) -> list[Finding]:
    """What is said of a built checkpoint after these changes."""
    stage = built(checkpoint)
    for change in changes:
        change(stage)
    return findings_of(stage, checkpoint)


def told_after(checkpoint: str, *changes: Change) -> list[tuple[str, str, str | None]]:
    """Rule, prim and property of everything that is said of it."""
    return [(each.rule, each.prim, each.property) for each in found_after(checkpoint, *changes)]
