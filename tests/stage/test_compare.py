"""What counts as a change of the starter, and what never does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest
from breaking import copied, correct_stage
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt
from scene_stages import aim, clear, put, retype, switch, without_api

from lab3_usd.isaac.values import same_numbers
from lab3_usd.model.changes import Change, Difference
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.compare.stages import compare_starter
from lab3_usd.stage.compare.value_terms import same_usd_value
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.write.starter import starter_layer

LAB = load_lab()
ROBOT = LAB.scene.robot.path
BASE = f"{ROBOT}/base_link"
JOINT = f"{ROBOT}/joints/wheel_left_joint"
WALL = "/Environment/Walls/East"
SCENE = "/physicsScene"
Edit = Callable[[Usd.Stage], object]


@pytest.fixture(scope="module")
def starter() -> Usd.Stage:
    return copied(starter_layer(LAB.folder))


@pytest.fixture
def stage() -> Usd.Stage:
    """The finished lab, to be changed."""
    return correct_stage("08")


def compared(starter: Usd.Stage, stage: Usd.Stage, checkpoint: str = "08") -> tuple[Change, ...]:
    return compare_starter(starter, stage, LAB, checkpoint).changes


def only(changes: tuple[Change, ...]) -> Change:
    (change,) = changes
    return change


def difference(changes: tuple[Change, ...]) -> Difference:
    (found,) = only(changes).differences
    return found


def move(old: str, new: str) -> Edit:
    def change(stage: Usd.Stage) -> None:
        layer = stage.GetRootLayer()
        batch = Sdf.BatchNamespaceEdit()
        batch.Add(old, new)
        assert layer.Apply(batch)
        assert stage.GetPrimAtPath(new)

    return change


# -- what the lab adds, what a run changes, and what may be written otherwise


def test_a_finished_lab_has_its_starter_unchanged(starter: Usd.Stage, stage: Usd.Stage) -> None:
    for checkpoint in LAB.checkpoints:
        assert compared(starter, stage, checkpoint) == ()


def in_numbers(stage: Usd.Stage) -> None:
    """Write the wall's rotation as three angles, and the base's as a matrix."""
    xform = UsdGeom.Xformable(stage.GetPrimAtPath("/Environment/Furniture/CrateA"))
    matrix = xform.GetLocalTransformation()
    xform.ClearXformOpOrder()
    xform.AddTransformOp().Set(matrix)


def articulate_root(stage: Usd.Stage) -> None:
    base, root = (stage.GetPrimAtPath(path) for path in (f"{ROBOT}/base_footprint", ROBOT))
    for api in ("PhysicsArticulationRootAPI", "PhysxArticulationAPI"):
        base.RemoveAppliedSchema(api)
    base.RemoveProperty("physxArticulation:enabledSelfCollisions")
    root.AddAppliedSchema("PhysicsArticulationRootAPI")


def run_physics(stage: Usd.Stage) -> None:
    """Leave what a stage saved after a run has."""
    body = UsdPhysics.RigidBodyAPI(stage.GetPrimAtPath(BASE))
    body.CreateVelocityAttr(Gf.Vec3f(0.1, 0, 0))
    body.CreateAngularVelocityAttr(Gf.Vec3f(0, 0, 1))
    stage.GetPrimAtPath(BASE).GetAttribute("xformOp:translate").Set(Gf.Vec3d(0.4, 0.1, 0.012))
    joint = stage.GetPrimAtPath(JOINT)
    joint.AddAppliedSchema("PhysicsJointStateAPI:angular")
    joint.CreateAttribute("state:angular:physics:position", Sdf.ValueTypeNames.Float).Set(17.0)
    stage.DefinePrim("/Render/Product", "RenderProduct")


def add_things(stage: Usd.Stage) -> None:
    prim = stage.GetPrimAtPath(BASE)
    prim.AddAppliedSchema("PhysxRigidBodyAPI")
    prim.CreateAttribute("physxRigidBody:linearDamping", Sdf.ValueTypeNames.Float).Set(0.0)
    prim.CreateAttribute("userProperties:note", Sdf.ValueTypeNames.String).Set("mine")
    stage.DefinePrim("/World/Cone", "Cone")


def block(stage: Usd.Stage) -> None:
    joint = stage.GetPrimAtPath(JOINT)
    joint.GetAttribute("drive:angular:physics:stiffness").Block()
    UsdPhysics.RevoluteJoint(joint).CreateLowerLimitAttr().Block()


def turn_as_far_as_floats_go(stage: Usd.Stage) -> None:
    joint = UsdPhysics.RevoluteJoint(stage.GetPrimAtPath(JOINT))
    joint.CreateLowerLimitAttr(-3.4028235e38)
    joint.CreateUpperLimitAttr(3.4028235e38)


SAME: dict[str, Edit] = {
    "a block of what a schema says as well": block,
    "limits as large as floats are": turn_as_far_as_floats_go,
    "noise of single precision": put(SCENE, "physics:gravityMagnitude", 9.81 * (1 + 5e-7)),
    "a mass that is near": put(BASE, "physics:mass", 0.825735 * 1.0009),
    "a wall by a hair": put(WALL, "xformOp:translate", Gf.Vec3d(2.42509, 0.75, 0.25)),
    "a rotation as a matrix": in_numbers,
    "the negative of a rotation": put(JOINT, "physics:localRot1", Gf.Quatf(-1, 0, 0, 0)),
    "the articulation on the root": articulate_root,
    "what a run leaves": run_physics,
    "properties, schemas and prims added": add_things,
    "environment below the world": move("/Environment", "/World/Environment"),
    "environment renamed": move("/Environment", "/Env"),
    "physics scene below the world": move(SCENE, "/World/physicsScene"),
    "physics scene renamed": move(SCENE, "/PhysicsScene_01"),
    "a light elsewhere": move("/Environment/Lights/Sun", "/World/Sun"),
    "colours": put(WALL, "primvars:displayColor", Vt.Vec3fArray([(1, 0, 0)])),
    "where the robot stands": put(ROBOT, "xformOp:translate", Gf.Vec3d(0, 0, 0)),
    "the viewport's focus": put("/World/ObservationCamera", "focusDistance", 12.0),
}


@pytest.mark.parametrize("edit", SAME.values(), ids=SAME)
def test_no_change_is(starter: Usd.Stage, stage: Usd.Stage, edit: Edit) -> None:
    edit(stage)
    assert compared(starter, stage) == ()


def test_shapes_that_links_refer_to_may_lie_anywhere(starter: Usd.Stage, stage: Usd.Stage) -> None:
    editor = Usd.NamespaceEditor(stage)
    editor.MovePrimAtPath(f"{ROBOT}/colliders", "/World/colliders")
    assert editor.ApplyEdits()
    assert stage.GetPrimAtPath(f"{BASE}/collisions/body")
    assert compared(starter, stage) == ()


# -- what is a change


def test_a_vanished_subtree_is_one_change(starter: Usd.Stage, stage: Usd.Stage) -> None:
    stage.RemovePrim("/Environment/Walls")
    change = only(compared(starter, stage))
    assert (change.prim, change.absent, change.count) == ("/Environment/Walls", "missing", 9)
    assert change.physics


@pytest.mark.parametrize(
    ("edit", "absent"),
    [
        (lambda prim: prim.SetActive(False), "deactivated"),  # noqa: FBT003 - pxr takes no keyword
        (lambda prim: prim.SetSpecifier(Sdf.SpecifierOver), "only an over without a def"),
    ],
)
def test_the_reason_why_a_prim_is_absent_is_told(
    starter: Usd.Stage, stage: Usd.Stage, edit: Callable[[Usd.Prim], object], absent: str
) -> None:
    edit(stage.GetPrimAtPath(WALL))
    assert only(compared(starter, stage)).absent == absent


def test_what_is_only_seen_is_no_physics(starter: Usd.Stage, stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{ROBOT}/visuals/base_link/plate_top")
    change = only(compared(starter, stage))
    assert (change.prim, change.physics) == (f"{BASE}/visuals/plate_top", False)


def test_a_camera_of_the_robot_does_not_stand_for_the_worlds(
    starter: Usd.Stage, stage: Usd.Stage
) -> None:
    stage.RemovePrim("/World/ObservationCamera")
    assert only(compared(starter, stage)).prim == "/World/ObservationCamera"


def test_a_change_in_what_was_moved_elsewhere_is_found(
    starter: Usd.Stage, stage: Usd.Stage
) -> None:
    move("/Environment", "/World/Environment")(stage)
    stage.RemovePrim("/World/Environment/Walls/East")
    put("/World/Environment/Walls/West", "xformOp:translate", Gf.Vec3d(0, 0, 0))(stage)
    found = compared(starter, stage)
    assert [each.prim for each in found] == [WALL, "/World/Environment/Walls/West"]


ROOM = "/Environment"
CRATE, PILLAR = f"{ROOM}/Furniture/CrateA", f"{ROOM}/Furniture/PillarA"
CORNER, FLOOR, SUN = f"{ROOM}/Walls/Corner", f"{ROOM}/GroundPlane/Floor", f"{ROOM}/Lights/Sun"
GROUND, CAMERA = f"{ROOM}/GroundPlane/CollisionPlane", "/World/ObservationCamera"
FOOT = f"{ROBOT}/base_footprint"


def move_corner(stage: Usd.Stage) -> None:
    points = stage.GetPrimAtPath(FLOOR).GetAttribute("points").Get()
    put(CORNER, "points", points)(stage)


COLLISION = "physics:collisionEnabled"
STIFF, DAMPING = "drive:angular:physics:stiffness", "drive:angular:physics:damping"
SOLVER, BINDING = "physxArticulation:solverPositionIterationCount", "material:binding:physics"
PLACE, TURN, SIZE = "xformOp:translate", "xformOp:orient", "xformOp:scale"
# What differs: its kind, the prim and the property.
DIFFERENCES: dict[str, tuple[Edit, tuple[str, str, str]]] = {
    "mass": (put(BASE, "physics:mass", 0.825735 * 1.002), ("physics", BASE, "physics:mass")),
    "stiffness": (put(JOINT, STIFF, 1.0), ("physics", JOINT, STIFF)),
    "limits of the solver": (put(FOOT, SOLVER, 1), ("physics", FOOT, SOLVER)),
    "size of a shape": (put(PILLAR, "radius", 0.5), ("physics", PILLAR, "radius")),
    "corner": (move_corner, ("physics", CORNER, "points")),
    "wall 2 mm": (put(WALL, PLACE, Gf.Vec3d(2.427, 0.75, 0.25)), ("place", WALL, PLACE)),
    "wall longer": (put(WALL, SIZE, Gf.Vec3d(0.15, 7.8, 0.5)), ("place", WALL, SIZE)),
    "crate turned": (put(CRATE, TURN, Gf.Quatd(1)), ("place", CRATE, TURN)),
    "friction's material": (
        aim(GROUND, BINDING, f"{ROOM}/PhysicsMaterials/Ball"),
        ("physics", GROUND, BINDING),
    ),
    "body of a joint": (
        aim(JOINT, "physics:body1", f"{ROBOT}/wheel_right_link"),
        ("physics", JOINT, "physics:body1"),
    ),
    "body of no joint": (clear(JOINT, "physics:body0"), ("physics", JOINT, "physics:body0")),
    "value taken back": (clear(JOINT, DAMPING), ("physics", JOINT, DAMPING)),
    "default overruled": (
        switch(WALL, "physics:collisionEnabled"),
        ("physics", WALL, "physics:collisionEnabled"),
    ),
    "type": (retype(JOINT, "PhysicsFixedJoint"), ("type", JOINT, "")),
    "collision": (
        without_api(WALL, "PhysicsCollisionAPI"),
        ("schema", WALL, ""),
    ),
}
ONLY_SEEN: dict[str, tuple[Edit, tuple[str, str, str]]] = {
    "floor that is only seen": (
        put(FLOOR, "points", Vt.Vec3fArray([(0, 0, 0)] * 4)),
        ("look", FLOOR, "points"),
    ),
    "light turned": (put(SUN, TURN, Gf.Quatd(1)), ("place", SUN, TURN)),
    "sun": (put(SUN, "inputs:angle", 5.0), ("look", SUN, "inputs:angle")),
    "lens": (put(CAMERA, "focalLength", 50.0), ("look", CAMERA, "focalLength")),
    "unseen": (
        lambda stage: UsdGeom.Imageable(stage.GetPrimAtPath(WALL)).MakeInvisible(),
        ("look", WALL, "visibility"),
    ),
    "robot's schema": (
        without_api(ROBOT, "IsaacRobotAPI"),
        ("schema", ROBOT, ""),
    ),
}


@pytest.mark.parametrize("name", [*DIFFERENCES, *ONLY_SEEN])
def test_a_change_is_found(starter: Usd.Stage, stage: Usd.Stage, name: str) -> None:
    edit, site = (DIFFERENCES | ONLY_SEEN)[name]
    edit(stage)
    change = only(compared(starter, stage))
    (found,) = change.differences
    assert (found.kind, change.prim, found.property) == site
    assert found.physics is (name in DIFFERENCES)


def test_how_the_rollers_of_a_wheel_stand_is_physics(stage: Usd.Stage) -> None:
    stages = [copied(starter_layer(LAB.folder)), stage]
    for each, angle in zip(stages, (-135.0, -45.0), strict=True):
        joint = each.GetPrimAtPath(JOINT)
        joint.CreateAttribute("isaacmecanumwheel:angle", Sdf.ValueTypeNames.Float).Set(angle)
    found = difference(compared(stages[0], stages[1]))
    assert (found.kind, found.property) == ("physics", "isaacmecanumwheel:angle")


def test_several_differences_of_one_prim_are_one_change(
    starter: Usd.Stage, stage: Usd.Stage
) -> None:
    put(BASE, "physics:mass", 1.0)(stage)
    put(BASE, "physics:diagonalInertia", Gf.Vec3f(1, 1, 1))(stage)
    names = [each.property for each in only(compared(starter, stage)).differences]
    assert names == ["physics:diagonalInertia", "physics:mass"]


def test_a_value_is_told_before_and_after(starter: Usd.Stage, stage: Usd.Stage) -> None:
    put(SCENE, "physics:gravityMagnitude", 1.62)(stage)
    found = difference(compared(starter, stage))
    assert (found.was, found.now) == ("9.81", "1.62")


def test_a_turn_is_told_in_degrees(starter: Usd.Stage, stage: Usd.Stage) -> None:
    put("/Environment/Furniture/CrateA", "xformOp:orient", Gf.Quatd(1))(stage)
    found = difference(compared(starter, stage))
    assert (found.was, found.now) == ("turned (0, 0, 30) degrees", "turned (0, 0, 0) degrees")


def test_bodies_stand_where_they_stood_in_the_first_checkpoint(
    starter: Usd.Stage, stage: Usd.Stage
) -> None:
    put(BASE, "xformOp:translate", Gf.Vec3d(0, 0, 0.02))(stage)
    assert [each.prim for each in compared(starter, stage, "00")] == [BASE]
    assert compared(starter, stage, "01") == ()


@pytest.mark.parametrize("checkpoint", ["00", "01", "08"])
@pytest.mark.parametrize("scale", [(1, 1, 1.3), (-1, 1, 1)])
def test_no_run_scales_a_body(
    starter: Usd.Stage, stage: Usd.Stage, checkpoint: str, scale: tuple[float, float, float]
) -> None:
    put(BASE, "xformOp:scale", Gf.Vec3d(*scale))(stage)
    found = difference(compared(starter, stage, checkpoint))
    assert (found.kind, found.property) == ("place", "xformOp:scale")


def test_a_body_that_was_scaled_in_the_starter_stays_so(
    starter: Usd.Stage, stage: Usd.Stage
) -> None:
    other = copied(starter.GetRootLayer())
    put(BASE, "xformOp:scale", Gf.Vec3d(1.2, 1.2, 1.2))(other)
    assert difference(compared(other, stage)).kind == "place"
    put(BASE, "xformOp:scale", Gf.Vec3d(1.2, 1.2, 1.2))(stage)
    put(BASE, "xformOp:translate", Gf.Vec3d(5, 5, 0))(stage)
    assert compared(other, stage) == ()


def test_a_shape_on_a_body_stays_in_its_place(starter: Usd.Stage, stage: Usd.Stage) -> None:
    put(f"{ROBOT}/colliders/base_link/body", "xformOp:translate", Gf.Vec3d(0, 0, 0.5))(stage)
    change = only(compared(starter, stage))
    assert (change.prim, change.body) == (f"{BASE}/collisions/body", BASE)


@pytest.mark.parametrize("offset", [(0, 0, 0.5), (0, 0, 0)], ids=["moved", "left where it was"])
def test_a_first_transform_counts_by_where_it_puts_a_prim(
    starter: Usd.Stage, stage: Usd.Stage, offset: tuple[float, float, float]
) -> None:
    walls = UsdGeom.Xformable(stage.GetPrimAtPath("/Environment/Walls"))
    assert not walls.GetOrderedXformOps()
    walls.AddTranslateOp().Set(Gf.Vec3d(offset))
    moved = [(each.prim, each.differences[0].kind) for each in compared(starter, stage)]
    assert moved == ([("/Environment/Walls", "place")] if any(offset) else [])


# -- files and assets


def layered(folder: Path, name: str) -> Path:
    """Write a stage whose wall comes from another file."""
    folder.mkdir(parents=True, exist_ok=True)
    wall = Usd.Stage.CreateNew(str(folder / "wall.usda"))
    cube = UsdGeom.Cube.Define(wall, "/Wall")
    UsdPhysics.CollisionAPI.Apply(cube.GetPrim())
    wall.SetDefaultPrim(cube.GetPrim())
    wall.Save()
    stage = Usd.Stage.CreateNew(str(folder / name))
    stage.DefinePrim("/World/Wall").GetReferences().AddReference("./wall.usda")
    stage.Save()
    return folder / name


def test_an_operation_whose_value_is_of_another_type_moves_nothing(
    starter: Usd.Stage, stage: Usd.Stage
) -> None:
    wall = stage.GetPrimAtPath(WALL)
    wall.RemoveProperty("xformOp:translate")
    wall.CreateAttribute("xformOp:translate", Sdf.ValueTypeNames.Int3).Set(Gf.Vec3i(1, 2, 3))
    assert difference(compared(starter, stage)).kind == "place"


def test_what_a_missing_asset_would_hold_is_not_compared(tmp_path: Path) -> None:
    before, after = layered(tmp_path / "a", "starter.usda"), layered(tmp_path / "b", "stage.usda")
    assert compared(open_stage(before), open_stage(after)) == ()
    (tmp_path / "b" / "wall.usda").unlink()
    assert compared(open_stage(before), open_stage(after)) == ()


def test_a_reference_that_was_deleted_is_a_change(tmp_path: Path) -> None:
    before, after = layered(tmp_path / "a", "starter.usda"), layered(tmp_path / "b", "stage.usda")
    stage = Usd.Stage.Open(str(after))
    stage.GetPrimAtPath("/World/Wall").GetReferences().ClearReferences()
    stage.Save()
    change = only(compared(open_stage(before), open_stage(after)))
    assert change.prim == "/World/Wall"


def test_what_the_starter_itself_lacks_is_not_asked_for(tmp_path: Path) -> None:
    before, after = layered(tmp_path / "a", "starter.usda"), layered(tmp_path / "b", "stage.usda")
    (tmp_path / "a" / "wall.usda").unlink()
    assert compared(open_stage(before), open_stage(after)) == ()


def textured(folder: Path, texture: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    stage = Usd.Stage.CreateNew(str(folder / "stage.usda"))
    light = stage.DefinePrim("/World/Dome", "DomeLight")
    name = "inputs:texture:file"
    light.CreateAttribute(name, Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(texture))
    stage.Save()
    return folder / "stage.usda"


def test_assets_are_compared_by_what_they_resolve_to(tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "sky.hdr").write_bytes(b"sky")
    before = textured(tmp_path / "assets", "./sky.hdr")
    assert (
        compared(open_stage(before), open_stage(textured(tmp_path / "work", "../assets/sky.hdr")))
        == ()
    )


def test_an_asset_that_is_another_file_is_a_change(tmp_path: Path) -> None:
    for folder, data in (("a", b"sky"), ("b", b"sea"), ("c", b"sky")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "sky.hdr").write_bytes(data)
    before = textured(tmp_path / "a", "./sky.hdr")
    changes = compared(open_stage(before), open_stage(textured(tmp_path / "b", "./sky.hdr")))
    assert difference(changes).property == "inputs:texture:file"
    same = compared(open_stage(before), open_stage(textured(tmp_path / "c", "./sky.hdr")))
    assert same == ()


def test_an_asset_that_is_not_here_cannot_be_judged(tmp_path: Path) -> None:
    before = textured(tmp_path / "a", "omniverse://server/sky.hdr")
    after = textured(tmp_path / "b", "https://server.org/sky.hdr")
    assert compared(open_stage(before), open_stage(after)) == ()


def instanced(folder: Path, size: float) -> Path:
    """Write a stage with an instance whose shape lies below the instance itself."""
    folder.mkdir()
    stage = Usd.Stage.CreateNew(str(folder / "stage.usda"))
    shape = UsdGeom.Cube.Define(stage, "/Library/Wall/Shape")
    shape.CreateSizeAttr(size)
    UsdPhysics.CollisionAPI.Apply(shape.GetPrim())
    stage.GetPrimAtPath("/Library").SetSpecifier(Sdf.SpecifierClass)
    copy = stage.DefinePrim("/World/Copy")
    copy.GetReferences().AddInternalReference("/Library/Wall")
    copy.SetInstanceable(True)  # noqa: FBT003 - pxr takes no keyword
    stage.Save()
    return folder / "stage.usda"


def test_instances_are_looked_into(tmp_path: Path) -> None:
    before = instanced(tmp_path / "a", 1.0)
    assert compared(open_stage(before), open_stage(instanced(tmp_path / "b", 1.0))) == ()
    changes = compared(open_stage(before), open_stage(instanced(tmp_path / "c", 3.0)))
    assert only(changes).prim == "/World/Copy/Shape"


# -- values


asset = Sdf.AssetPath


def assets(*names: str) -> Sdf.AssetPathArray:
    return Sdf.AssetPathArray([asset(name, f"/{name}") for name in names])


@pytest.mark.parametrize(
    ("was", "now", "same"),
    [
        (1.0, 1.0 + 9e-7, True),
        (1.0, 1.0 + 2e-6, False),
        (0.0, 1e-10, True),
        (0.0, 1e-6, False),
        (1, 1.0, True),
        (True, False, False),
        ("Z", "X", False),
        (1.0, None, False),
        (1.0, "1.0", False),
        (Gf.Vec3f(0, 0, 1), Gf.Vec3d(1e-7, 0, 1), True),
        (Gf.Vec3f(0, 0, 1), Gf.Vec3f(1e-5, 0, 1), False),
        (Gf.Vec3f(0, 0, 1), Gf.Vec2f(0, 0), False),
        (Gf.Quatf(1, 0, 0, 0), Gf.Quatd(-1, 0, 0, 0), True),
        (Gf.Quatf(1, 0, 0, 0), Gf.Quatf(0, 1, 0, 0), False),
        (Vt.IntArray([1, 2]), Vt.IntArray([1, 2]), True),
        (Vt.IntArray([1, 2]), Vt.IntArray([1, 3]), False),
        (Vt.TokenArray(["a"]), Vt.TokenArray(["b"]), False),
        (asset("x/a.png", "/x/a.png"), asset("y/a.png", "/y/a.png"), True),  # neither is there
        (asset("x/a.png", "/x/a.png"), asset("x/b.png", "/x/b.png"), False),
        (asset("x/a.png", "/x/a.png"), asset("y/b.png"), True),  # nobody knows
        (asset("x/a.png", "/x/a.png"), asset(""), False),
        (asset("x/a.png", "/x/a.png"), "/x/a.png", False),
        (assets("a.png", "b.png"), assets("a.png", "b.png"), True),
        (assets("a.png", "b.png"), assets("a.png", "c.png"), False),
        (assets("a.png", "b.png"), assets("a.png"), False),
        (float("inf"), float("inf"), True),
        (float("-inf"), 0.0, False),
    ],
)
def test_values_are_the_same_up_to_noise(was: object, now: object, *, same: bool) -> None:
    assert same_usd_value(was, now, LAB.scene.tolerance.margin("number")) == same


@pytest.mark.parametrize(
    ("kind", "was", "now", "same"),
    [
        ("number", 0.0, 5e-7, False),
        ("joint", 0.0, 5e-7, True),
        ("joint", 0.0, 5e-6, False),
        ("unit", 1.0, 1.001, False),
        ("mass", 1.0, 1.001, True),
        ("mass", 1.0, 1.002, False),
    ],
)
def test_each_kind_of_quantity_has_a_margin(
    kind: Literal["number", "joint", "unit", "mass"], was: float, now: float, *, same: bool
) -> None:
    assert same_numbers([was], [now], LAB.scene.tolerance.margin(kind)) == same
