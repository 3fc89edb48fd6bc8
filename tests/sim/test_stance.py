"""By what a robot stands on the ground, and what that means for its drive."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from dry_runs import BRIEFLY, by_name, played
from foreign_robots import add_api, body, revolute, wheel
from pxr import Gf, Usd, UsdGeom, UsdPhysics
from robot_kinds import mobile

from lab3_usd.model.dry_run import Affine, Check, about
from lab3_usd.model.solids import Solid, solid
from lab3_usd.model.statics import Stand, standing
from lab3_usd.physics.overlaps import depth_of

ROBOT = "/World/Robot"
BASE = f"{ROBOT}/base"
TYRES = [
    solid(
        name, "Cylinder", {"radius": 0.1, "height": 0.05, "axis": "Y"}, Affine(origin=(0.0, y, 0.0))
    )
    for name, y in (("left", 0.25), ("right", -0.25))
]


def ball(name: str, x: float, z: float) -> Solid | None:
    return solid(name, "Sphere", {"radius": 0.03}, Affine(origin=(x, 0.0, z)))


def stand(*others: Solid | None, ahead: float = -0.03, above: float = 0.02) -> Stand:
    """Return how two wheels of 0.1 m stand with other shapes, by their common centre of mass."""
    return standing([shape for shape in (*TYRES, *others) if shape], (ahead, 0.0, above))


def test_a_castor_as_low_as_the_wheels_carries_what_is_behind_the_axle() -> None:
    found = stand(ball("castor", -0.2, -0.07))
    assert (found.lean, found.falls) == (pytest.approx(0.0), False)
    assert found.loads == pytest.approx({"left": 0.425, "right": 0.425, "castor": 0.15})


def test_a_lower_castor_pitches_the_robot_and_all_three_carry_it() -> None:
    found = stand(ball("castor", -0.2, -0.09))
    assert math.degrees(found.lean) == pytest.approx(5.6, abs=0.2)
    assert set(found.touching) == {"left", "right", "castor"}


def test_a_disc_whose_axis_is_scaled_to_nothing_is_no_solid() -> None:
    flat = Affine(((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    assert solid("wheel", "Cylinder", {"axis": "Y"}, flat) is None
    assert solid("wheel", "Cylinder", {"axis": "X"}, flat) is not None


def test_two_lower_castors_carry_it_alone() -> None:
    found = stand(ball("behind", -0.2, -0.073), ball("ahead", 0.2, -0.073))
    assert found.loads == pytest.approx({"behind": 0.575, "ahead": 0.425})


def test_a_centre_of_mass_that_nothing_is_below_falls() -> None:
    assert stand(ball("castor", -0.2, -0.07), ahead=0.1).falls


@pytest.mark.parametrize(("mass", "verdict"), [(None, "not judged"), (1.0, "bad")])
def test_what_would_tell_by_what_weight_a_robot_tips_over_is_named(
    tmp_path: Path, mass: float | None, verdict: str
) -> None:
    stage = with_shape("Cube", (0.6, 0, 0.9), 0.2)
    mast = UsdPhysics.MassAPI.Apply(body(stage, f"{ROBOT}/mast", (0, 0, 0.3)))
    joint = UsdPhysics.FixedJoint.Define(stage, f"{ROBOT}/mast_joint")
    joint.CreateBody0Rel().SetTargets([BASE])
    joint.CreateBody1Rel().SetTargets([f"{ROBOT}/mast"])
    if mass is not None:
        mast.CreateMassAttr(mass)
    found = follows(stage, tmp_path)
    named = "no collider and no physics:mass tells its weight" in found.message
    assert (found.verdict, named) == (verdict, mass is None)


def test_two_balls_of_two_sizes_lean_to_the_smaller() -> None:
    balls = [
        solid("ball", "Sphere", {"radius": radius}, Affine(origin=(0.0, y, 0.0)))
        for y, radius in ((0.25, 0.1), (-0.25, 0.08))
    ]
    found = standing([shape for shape in balls if shape], (0.0, 0.0, 0.0))
    assert (found.falls, found.lean) == (False, pytest.approx(math.asin(0.02 / 0.5), rel=0.01))


def test_a_chassis_hangs_on_its_axle() -> None:
    found = stand(ahead=0.01, above=-0.05)
    assert not found.falls
    assert math.degrees(found.lean) == pytest.approx(math.degrees(math.atan(0.01 / 0.05)), abs=2.0)


def with_shape(shape: str, at: tuple[float, float, float], size: float) -> Usd.Stage:
    """Return the robot on two wheels of 0.1 m with a shape more on its base."""
    stage = mobile()
    more = getattr(UsdGeom, shape).Define(stage, f"{BASE}/more")
    more.AddTranslateOp().Set(Gf.Vec3d(*at))
    (more.CreateSizeAttr if shape == "Cube" else more.CreateRadiusAttr)(size)
    UsdPhysics.CollisionAPI.Apply(more.GetPrim())
    return stage


def follows(stage: Usd.Stage, folder: Path, drive: str | None = BRIEFLY) -> Check:
    return by_name(played(stage, folder, drive=drive))["follows"]


def test_a_hull_below_the_wheels_carries_the_robot(tmp_path: Path) -> None:
    check = follows(with_shape("Cube", (0, 0, -0.0503), 0.1), tmp_path)
    assert (check.verdict, check.prim) == ("bad", f"{BASE}/more")
    assert check.cause == (
        "more, 0.3 mm below the wheels, carries 100 % of the weight and does not roll"
    )


def test_a_hull_above_the_ground_does_no_harm(tmp_path: Path) -> None:
    assert follows(with_shape("Cube", (0, 0, -0.0497), 0.1), tmp_path).verdict == "ok"


def castor(stage: Usd.Stage, *, swivels: bool) -> Usd.Stage:
    """Add a free wheel behind, below a fork that swivels or not, and weight before it."""
    base = stage.GetPrimAtPath(BASE)
    UsdPhysics.MassAPI.Apply(base).CreateMassAttr(10.0)
    UsdPhysics.MassAPI(base).CreateCenterOfMassAttr(Gf.Vec3f(-0.05, 0, 0))
    body(stage, f"{ROBOT}/fork", (-0.2, 0, 0.1))
    kind = UsdPhysics.RevoluteJoint if swivels else UsdPhysics.FixedJoint
    fork = kind.Define(stage, f"{ROBOT}/fork_joint")
    fork.CreateBody0Rel().SetTargets([BASE])
    fork.CreateBody1Rel().SetTargets([f"{ROBOT}/fork"])
    fork.CreateLocalPos0Attr(Gf.Vec3f(-0.2, 0, 0))
    if swivels:
        fork.CreateAxisAttr("Z")
    wheel(stage, f"{ROBOT}/roll", (-0.23, 0, 0.03), 0.03)
    joint = revolute(
        stage, f"{ROBOT}/roll_joint", f"{ROBOT}/fork", f"{ROBOT}/roll", (-0.03, 0, -0.07), "Y"
    )
    joint.RemoveAPI(UsdPhysics.DriveAPI, "angular")
    return stage


@pytest.mark.parametrize("fork", ["swivels", "is fixed"])
def test_a_free_wheel_behind_lets_the_robot_go_as_commanded(tmp_path: Path, fork: str) -> None:
    stage = castor(mobile(), swivels=fork == "swivels")
    assert follows(stage, tmp_path, "0.15,0,1 0,0.8,1").verdict == "ok"


def test_a_box_is_no_wheel_that_is_modelled(tmp_path: Path) -> None:
    stage = mobile()
    for side in ("left", "right"):
        tyre = next(
            prim
            for prim in Usd.PrimRange(stage.GetPrimAtPath(f"{ROBOT}/{side}_wheel"))
            if prim.HasAPI(UsdPhysics.CollisionAPI)
        )
        tyre.SetTypeName("Cube")
        UsdGeom.Cube(tyre).CreateSizeAttr(0.2)
    check = follows(stage, tmp_path)
    assert check.verdict == "not judged"
    assert "is a box, which does not roll as a wheel" in check.message


def floor(stage: Usd.Stage, *, indices: list[int], orientation: str = "rightHanded") -> Usd.Stage:
    mesh = UsdGeom.Mesh.Define(stage, "/World/Floor")
    mesh.CreatePointsAttr([(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr(indices)
    mesh.CreateOrientationAttr(orientation)
    mesh.CreateDoubleSidedAttr(True)  # noqa: FBT003 - what counts in pictures alone
    add_api(mesh.GetPrim(), "PhysicsCollisionAPI", "PhysicsMeshCollisionAPI")
    return stage


UP, DOWN = [0, 1, 2, 3], [3, 2, 1, 0]


@pytest.mark.parametrize(
    ("indices", "orientation", "verdict"),
    [
        (UP, "rightHanded", "ok"),
        (DOWN, "rightHanded", "bad"),
        (UP, "leftHanded", "bad"),
        (DOWN, "leftHanded", "ok"),
    ],
)
def test_triangles_of_a_floor_have_one_side(
    tmp_path: Path, indices: list[int], orientation: str, verdict: str
) -> None:
    stage = floor(mobile(), indices=indices, orientation=orientation)
    assert follows(stage, tmp_path).verdict == verdict


def test_a_floor_of_a_scene_that_is_not_there_carries_nothing(tmp_path: Path) -> None:
    stage = floor(mobile(), indices=UP)
    ground = stage.GetPrimAtPath("/World/Floor")
    ground.CreateRelationship("physics:simulationOwner").SetTargets(["/World/Gone"])
    UsdPhysics.Scene.Define(stage, "/World/Physics")
    check = follows(stage, tmp_path)
    assert (check.verdict, check.prim) == ("bad", "/World/Floor")


def gravity(stage: Usd.Stage) -> UsdPhysics.Scene:
    found = next((prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene)), None)
    return UsdPhysics.Scene(found) if found else UsdPhysics.Scene.Define(stage, "/World/Physics")


@pytest.mark.parametrize(
    ("strength", "verdict"), [(float("-inf"), "ok"), (9.81, "ok"), (-9.81, "bad")]
)
def test_gravity_pulls_down_by_its_sign(tmp_path: Path, strength: float, verdict: str) -> None:
    stage = mobile()
    gravity(stage).CreateGravityMagnitudeAttr(strength)
    assert follows(stage, tmp_path).verdict == verdict


def test_slanted_gravity_with_which_a_robot_drives_is_not_judged(tmp_path: Path) -> None:
    stage = floor(mobile(), indices=UP)
    gravity(stage).CreateGravityDirectionAttr(Gf.Vec3f(0.105, 0, -1))
    assert follows(stage, tmp_path).verdict == "not judged"


def test_a_heavy_body_ahead_is_no_fault_of_the_robot(tmp_path: Path) -> None:
    stage = mobile()
    body(stage, "/World/Crate", (0.6, 0, 0.2))
    crate = UsdGeom.Cube.Define(stage, "/World/Crate/shape")
    crate.CreateSizeAttr(0.4)
    UsdPhysics.CollisionAPI.Apply(crate.GetPrim())
    UsdPhysics.MassAPI.Apply(stage.GetPrimAtPath("/World/Crate")).CreateMassAttr(100.0)
    check = follows(floor(stage, indices=UP), tmp_path, "0.3,0,2")
    assert check.verdict == "not judged"
    assert "Crate of 100 kg stops it" in check.message


def test_ground_that_ends_is_no_fault_of_the_robot(tmp_path: Path) -> None:
    stage = floor(mobile(), indices=UP)
    points = [(-1, -5, 0), (0.1, -5, 0), (0.1, 5, 0), (-1, 5, 0)]
    UsdGeom.Mesh(stage.GetPrimAtPath("/World/Floor")).GetPointsAttr().Set(points)
    check = follows(stage, tmp_path, "0.2,0,2")
    assert check.verdict == "not judged"
    assert "the end of the ground stops it" in check.message


@pytest.mark.parametrize(("inertia", "verdict"), [(0.01, "ok"), (100.0, "not judged")])
def test_an_inertia_that_no_wheel_has_is_not_judged(
    tmp_path: Path, inertia: float, verdict: str
) -> None:
    stage = mobile()
    mass = UsdPhysics.MassAPI.Apply(stage.GetPrimAtPath(f"{ROBOT}/left_wheel"))
    mass.CreateMassAttr(1.0)
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(inertia))
    assert follows(stage, tmp_path).verdict == verdict


@pytest.mark.parametrize(("ahead", "verdict"), [(0.19, "not judged"), (1.2, "ok")])
def test_what_a_wall_throws_out_is_not_judged(tmp_path: Path, ahead: float, verdict: str) -> None:
    stage = floor(mobile(), indices=UP)
    wall = UsdGeom.Cube.Define(stage, "/World/Wall")
    wall.CreateSizeAttr(0.2)
    wall.AddTranslateOp().Set(Gf.Vec3d(ahead, 0.2, 0.101))
    UsdPhysics.CollisionAPI.Apply(wall.GetPrim())
    assert follows(stage, tmp_path, "0.05,0,1").verdict == verdict


def test_how_deep_a_ball_is_in_a_box_is_how_far_it_must_move() -> None:
    box = solid("box", "Cube", {"size": 2.0}, Affine())
    apart = [1.4, 1.5, 1.6]
    balls = [solid("b", "Sphere", {"radius": 0.5}, Affine(origin=(x, 0.0, 0.0))) for x in apart]
    depths = [depth_of(ball, box) for ball in balls if ball is not None and box is not None]
    assert depths == pytest.approx([0.1, 0.0, 0.0])


def test_a_ball_beside_the_edge_of_a_box_is_not_inside() -> None:
    box = solid("box", "Cube", {"size": 2.0}, Affine())
    near = solid("ball", "Sphere", {"radius": 0.5}, Affine(origin=(1.38, 1.38, 0.0)))
    assert box is not None
    assert near is not None
    assert depth_of(near, box) == pytest.approx(0.0)


def test_a_cylinder_is_round_for_what_stands_beside_it() -> None:
    drum = solid("drum", "Cylinder", {"radius": 1.0, "height": 1.0}, Affine())
    turned = Affine(about((0.0, 0.0, 1.0), math.radians(45.0)), (1.38, 1.38, 0.0))
    post = solid("post", "Cube", {"size": 2.0}, turned)
    assert drum is not None
    assert post is not None
    assert depth_of(drum, post) == pytest.approx(2.0 - 1.38 * math.sqrt(2), abs=1e-3)
