"""What is said of the scene: each fault once, at its place, and nothing of one that is right."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from golden import assert_golden, findings_text
from models import LINKS
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from scene_sabotage import LIGHTS, floor_of_mesh, scene_sabotage, turned_floor
from scene_stages import (
    CAMERA,
    FLOOR,
    JOINTS,
    LIDAR,
    MATERIALS,
    ORIENT,
    ROBOT,
    SCALE,
    SLIDING,
    TRANSLATE,
    WHEELS,
    Change,
    Sabotage,
    aim,
    as_matrix,
    author,
    built,
    clear,
    deactivate,
    define,
    drive,
    findings_of,
    found_after,
    hide_place,
    move_prim,
    negated,
    put,
    refer,
    remove,
    retype,
    rotated,
    several,
    slab,
    slick,
    stage_rules,
    switch,
    told,
    told_after,
    turn,
    undefine,
    void,
    weld,
    with_api,
    without_api,
)

from lab3_usd.check.requirements import demands_of, unmet_by
from lab3_usd.model.finding import Finding, ordered
from lab3_usd.spec.load.loader import load_lab

FAULTS = scene_sabotage()
LINK_LEFT = f"{ROBOT}/wheel_left_link"
CHECKPOINTS = tuple(load_lab().checkpoints)
# Faults that no item of the handout asks for by itself.
ELSEWHERE = {
    "C11",
    "L12",
    "L13",  # the bundled lab has one lidar
    "S35",  # it takes nothing away
    "S36",  # it asks for no props
    "F02",
    "F03",
    "S16",
    "S22",
    "S26",  # the bundled lab describes no such joint
    "S27",
    "C08",
    "C10",
    "F04",
    "D08",
    "L10",
    "L11",
    "S30",
    "S32",
    "S33",
}


def errors(found: list[Finding]) -> list[Finding]:
    return [each for each in found if each.severity == "error"]


def broken(fault: Sabotage) -> list[Finding]:
    stage = built(fault.checkpoint)
    fault.apply(stage)
    return findings_of(stage, fault.checkpoint)


@pytest.fixture(scope="module")
def said() -> dict[str, list[Finding]]:
    return {fault.name: broken(fault) for fault in FAULTS}


@pytest.mark.parametrize("checkpoint", CHECKPOINTS)
def test_nothing_is_said_of_a_built_checkpoint(checkpoint: str) -> None:
    assert told(built(checkpoint), checkpoint) == []


def test_what_is_said_of_each_fault_is_as_it_was(said: dict[str, list[Finding]]) -> None:
    shown = {name: findings_text(ordered(found)) for name, found in said.items()}
    assert_golden("scene-faults", shown)


def test_each_fault_is_one_error_at_its_place(said: dict[str, list[Finding]]) -> None:
    found = {
        name: [(each.prim, each.property) for each in errors(findings)]
        for name, findings in said.items()
    }
    assert found == {fault.name: [fault.site] for fault in FAULTS}


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("base_link no body", "S05"),
        ("wheel of no scene", "S28"),
        ("no physics", "S15"),
        ("lidar link moved", "S17"),
        ("base joint excluded", "S11"),
        ("base 1 mm below the wheels", "S31"),
        ("base that tips over", "S31"),
        ("floor that looks down", "S13"),
    ],
)
def test_a_fault_is_said_by_its_rule(name: str, rule: str, said: dict[str, list[Finding]]) -> None:
    assert [error.rule for error in errors(said[name])] == [rule]


def costs_an_item(fault: Sabotage, found: list[Finding]) -> bool:
    lab = load_lab()
    demands = {demand.id for demand in demands_of(lab, lab.checkpoints[fault.checkpoint])}
    return bool(demands & unmet_by(found))


def test_each_fault_costs_an_item(said: dict[str, list[Finding]]) -> None:
    assert [fault.name for fault in FAULTS if not costs_an_item(fault, said[fault.name])] == []


@pytest.mark.parametrize("checkpoint", CHECKPOINTS)
def test_each_item_is_lost_by_some_fault(checkpoint: str, said: dict[str, list[Finding]]) -> None:
    lab = load_lab()
    demands = {demand.id for demand in demands_of(lab, lab.checkpoints[checkpoint])}
    assert demands - unmet_by(finding for found in said.values() for finding in found) == set()


def test_each_requirement_that_a_finding_fails_is_one_of_the_checkpoint(
    said: dict[str, list[Finding]], subtests: pytest.Subtests
) -> None:
    lab = load_lab()
    for fault in FAULTS:
        with subtests.test(fault=fault):
            demands = {demand.id for demand in demands_of(lab, lab.checkpoints[fault.checkpoint])}
            assert unmet_by(said[fault.name]) <= demands, fault.name


def test_items_have_ids_of_their_own() -> None:
    lab = load_lab()
    ids = [demand.id for demand in demands_of(lab, lab.checkpoints["05"])]
    assert len(ids) == len(set(ids))


def test_a_wrong_mass_costs_that_mass_only(said: dict[str, list[Finding]]) -> None:
    assert unmet_by(said["base_link heavy"]) == {"Scene/mass/base_link"}


def test_a_missing_link_costs_all_that_is_asked_of_it() -> None:
    lost = unmet_by(found_after("05", deactivate(f"{ROBOT}/base_scan")))
    assert {"Scene/prim/base_scan", "Scene/mass/base_scan", "Lidar2D/tickRate"} <= lost
    assert "Scene/mass/base_link" not in lost


def test_every_rule_speaks_of_some_fault(said: dict[str, list[Finding]]) -> None:
    spoken = {each.rule for found in said.values() for each in found}
    assert set(stage_rules()) - spoken - ELSEWHERE == set()


def wheel_shape_on_link(stage: Usd.Stage) -> None:
    """Collide with a shape right below each wheel instead of the referenced one."""
    for link in WHEELS.values():
        stage.RemovePrim(f"{ROBOT}/{link}/collisions")
        shape = UsdGeom.Cylinder.Define(stage, f"{ROBOT}/{link}/tyre")
        shape.CreateRadiusAttr(0.033)
        shape.CreateHeightAttr(0.018)
        shape.GetPrim().AddAppliedSchema("PhysicsCollisionAPI")


def instanced(stage: Usd.Stage) -> None:
    for link in LINKS:
        for part in ("visuals", "collisions"):
            prim = stage.GetPrimAtPath(f"{ROBOT}/{link}/{part}")
            if prim:
                prim.SetInstanceable(True)  # noqa: FBT003 - no keyword


def mesh_room(stage: Usd.Stage) -> None:
    """Stand on the floor of a room that is one mesh, walls and all."""
    stage.RemovePrim(FLOOR)
    mesh = UsdGeom.Mesh.Define(stage, "/World/Room")
    mesh.CreatePointsAttr([(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0), (-5, -5, 2)])
    mesh.CreateFaceVertexCountsAttr([4, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3, 0, 1, 4])
    mesh.GetPrim().AddAppliedSchema("PhysicsCollisionAPI")


def plane_below_collider(stage: Usd.Stage) -> None:
    """Let the parent of the plane carry the collision."""
    stage.GetPrimAtPath(FLOOR).RemoveAppliedSchema("PhysicsCollisionAPI")
    stage.GetPrimAtPath(FLOOR).GetParent().AddAppliedSchema("PhysicsCollisionAPI")


def other_light(stage: Usd.Stage) -> None:
    stage.RemovePrim("/Environment/Lights")
    stage.DefinePrim("/World/Lamp", "DomeLight_1")


def shining_mesh(stage: Usd.Stage) -> None:
    stage.RemovePrim("/Environment/Lights")
    stage.GetPrimAtPath("/Environment/GroundPlane/Floor").AddAppliedSchema("MeshLightAPI")


def reversed_joints(stage: Usd.Stage) -> None:
    """Let the wheel be the first body, and turn the frame so that plus is forward again."""
    for name, link in WHEELS.items():
        joint = stage.GetPrimAtPath(f"{JOINTS}/{name}")
        place = joint.GetAttribute("physics:localPos0").Get()
        joint.GetRelationship("physics:body0").SetTargets([f"{ROBOT}/{link}"])
        joint.GetRelationship("physics:body1").SetTargets([f"{ROBOT}/base_link"])
        joint.GetAttribute("physics:localPos0").Set(Gf.Vec3f(0))
        joint.GetAttribute("physics:localPos1").Set(place)
        half = 0.70710678
        joint.GetAttribute("physics:localRot1").Set(Gf.Quatf(half, half, 0, 0))
        joint.GetAttribute("physics:localRot0").Set(Gf.Quatf(0, 1, 0, 0))


NOISE = Gf.Vec3d(1.8000000238418579, 1e-9, -2e-8)
EQUALS: dict[str, Change] = {
    "robot as angles": rotated(ROBOT, (0, 1e-6, 0)),
    "robot as matrix": as_matrix(ROBOT),
    "robot a bit off": put(ROBOT, TRANSLATE, Gf.Vec3d(1.795, 0.004, 0.004)),
    "robot with noise": put(ROBOT, TRANSLATE, NOISE),
    "robot a bit turned": put(ROBOT, ORIENT, turn(0.3)),
    "other rotation sign": negated(ROBOT),
    "robot root articulated": several(
        without_api(f"{ROBOT}/base_footprint", "PhysicsArticulationRootAPI"),
        with_api(ROBOT, "PhysicsArticulationRootAPI"),
    ),
    "wheel shape on the link": wheel_shape_on_link,
    "instances": instanced,
    "slab": slab,
    "room of one mesh": mesh_room,
    "plane below a collider": plane_below_collider,
    "other light": other_light,
    "mesh light": shining_mesh,
    "physics scene elsewhere": move_prim("/physicsScene", "/World/Physics"),
    "environment elsewhere": move_prim("/Environment", "/World/Surroundings"),
    "camera of the world elsewhere": move_prim("/World/ObservationCamera", "/Environment/Cam"),
    "joints below their links": several(
        *(move_prim(f"{JOINTS}/{name}", f"{ROBOT}/{link}/{name}") for name, link in WHEELS.items())
    ),
    "wheel as first body": reversed_joints,
    "stiffness unset": clear(f"{JOINTS}/wheel_left_joint", drive("stiffness")),
    "mass nearly": put(f"{ROBOT}/base_link", "physics:mass", 0.826),
    "collision switched on": switch(FLOOR, "physics:collisionEnabled", on=True),
    "wheel turned by a run": put(f"{ROBOT}/wheel_left_link", ORIENT, turn(77, (0, 1, 0))),
    "lidar link moved by a run": put(
        f"{ROBOT}/base_scan", TRANSLATE, Gf.Vec3d(-0.032, 0.002, 0.1835)
    ),
}


@pytest.mark.parametrize("change", EQUALS.values(), ids=EQUALS)
def test_what_means_the_same_is_no_fault(change: Change) -> None:
    assert told_after("02", change) == []


def test_a_binary_stage_is_judged_alike(tmp_path: Path) -> None:
    path = tmp_path / "stage.usd"
    built("05").GetRootLayer().Export(str(path), args={"format": "usdc"})
    assert told(Usd.Stage.Open(str(path)), "05") == []


def test_a_robot_that_drove_is_a_warning_in_later_checkpoints() -> None:
    found = found_after("06", put(ROBOT, TRANSLATE, Gf.Vec3d(0.4, 1.2, 0)))
    assert [(each.rule, each.severity) for each in found] == [("S03", "warning")]


def test_a_robot_that_was_moved_is_not_said_to_float_as_well() -> None:
    found = told_after("00", put(ROBOT, TRANSLATE, Gf.Vec3d(1.8, 0, 0.5)))
    assert found == [("S03", ROBOT, TRANSLATE)]


def test_a_robot_within_the_tolerance_may_float_as_much() -> None:
    assert told_after("00", put(ROBOT, TRANSLATE, Gf.Vec3d(1.8, 0, 0.009))) == []


def test_the_pose_is_named_by_the_operation_that_was_written() -> None:
    found = told_after("00", rotated(ROBOT, (0, 0, 45), "ZYX"))
    assert found == [("S03", ROBOT, "xformOp:rotateZYX")]


def test_a_stage_in_centimetres_has_one_fault() -> None:
    stage = built("05")
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    for path, place in ((ROBOT, (180, 0, 0)), (CAMERA, (10, 0, 20))):
        put(path, TRANSLATE, Gf.Vec3d(*place))(stage)
    assert told(stage, "05") == [("S02", "/", "metersPerUnit")]


def test_both_wheels_backward_are_an_error_for_each() -> None:
    stage = built("02")
    for name in WHEELS:
        backward = Gf.Quatf(0.70710678, 0.70710678, 0, 0)
        put(f"{JOINTS}/{name}", "physics:localRot0", backward)(stage)
    found = findings_of(stage, "02")
    assert [(each.rule, each.severity) for each in found] == [("S09", "error")] * 2


def test_an_axis_left_out_is_the_same_as_x() -> None:
    stage = built("02")
    left, right = (f"{JOINTS}/{name}" for name in WHEELS)
    stage.GetPrimAtPath(left).RemoveProperty("physics:axis")
    put(right, "physics:axis", "X")(stage)
    found = findings_of(stage, "02")
    assert {(each.rule, each.property) for each in found} == {("S09", "physics:localRot0")}


def test_both_axles_along_the_robot_are_errors() -> None:
    stage = built("02")
    for name in WHEELS:
        put(f"{JOINTS}/{name}", "physics:axis", "X")(stage)
    found = findings_of(stage, "02")
    assert [(each.rule, each.severity) for each in found] == [("S09", "error")] * 2


def test_a_joint_found_by_its_wheel_relates_to_its_place() -> None:
    (found,) = found_after("02", move_prim(f"{JOINTS}/wheel_left_joint", f"{JOINTS}/left"))
    assert (found.prim, found.related) == (f"{JOINTS}/left", (f"{JOINTS}/wheel_left_joint",))


def test_a_joint_of_a_missing_wheel_is_not_told_again() -> None:
    found = told_after("02", remove(f"{ROBOT}/wheel_left_link"))
    assert found == [("S01", f"{ROBOT}/wheel_left_link", None)]


def test_a_joint_may_hold_a_part_of_its_wheel() -> None:
    stage = built("02")
    tyre = f"{ROBOT}/wheel_left_link/collisions/tyre"
    aim(f"{JOINTS}/wheel_left_joint", "physics:body1", tyre)(stage)
    assert told(stage, "02") == []


def test_a_wheel_that_is_smaller_than_the_other_is_named() -> None:
    tyre = f"{ROBOT}/wheel_left_link/collisions/tyre"
    assert told_after("02", put(tyre, "radius", 0.0329)) == []
    assert told_after("02", put(tyre, "radius", 0.03)) == [
        ("S06", f"{ROBOT}/wheel_left_link", None)
    ]


def test_wheels_beside_the_centre_of_the_robot_are_named() -> None:
    left, right = (f"{JOINTS}/{name}" for name in WHEELS)
    place = "physics:localPos0"
    stage = built("02")
    put(left, place, Gf.Vec3f(0.0, 0.13, 0.023))(stage)
    put(right, place, Gf.Vec3f(0.0, -0.03, 0.023))(stage)
    assert told(stage, "02") == [("S20", left, place)]


def test_two_articulation_roots_on_base_and_root_are_one_too_many() -> None:
    assert told_after("02", with_api(ROBOT, "PhysicsArticulationRootAPI")) == [("S11", ROBOT, None)]


def test_a_link_that_is_turned_about_z_is_a_warning(subtests: pytest.Subtests) -> None:
    """D1 of the handout: rotation 0; the frame turns with the link, so that the scan fits."""
    turned = Gf.Quatf(0.0, 0.0, 0.0, 1.0)
    joint = put(f"{JOINTS}/scan_joint", "physics:localRot0", turned)
    for checkpoint in ("00", "05"):
        with subtests.test(checkpoint=checkpoint):
            found = found_after(checkpoint, joint)
            told_of = [(each.severity, each.rule, each.prim) for each in found]
            assert told_of == [("warning", "S17", f"{JOINTS}/scan_joint")]
    link = rotated(f"{ROBOT}/base_scan", (0, 0, 90))
    found = found_after("00", link)
    assert [(each.severity, each.rule) for each in found] == [("warning", "S17")]
    assert told_after("02", link) == []  # which may have been saved after a run


def test_a_dim_or_coloured_light_shines(subtests: pytest.Subtests) -> None:
    for light in LIGHTS:
        with subtests.test(light=light):
            dim = author(light, "inputs:exposure", "Float", -3.0)
            red = author(light, "inputs:color", "Color3f", Gf.Vec3f(1, 0, 0))
            glossy = author(light, "inputs:diffuse", "Float", 0.0)
            assert told_after("04", dim, red, glossy) == []


def test_a_missing_observation_camera_is_a_warning() -> None:
    (found,) = found_after("00", remove("/World/ObservationCamera"))
    assert (found.rule, found.severity, found.prim) == ("S16", "warning", "/World")


def test_a_ground_beside_the_robot_carries_nothing() -> None:
    found = told_after("00", slab, put("/World/Slab", TRANSLATE, Gf.Vec3d(-15, 0, -0.05)))
    assert found == [("S13", "/Environment", None)]


def test_a_link_below_the_ground_is_named() -> None:
    stage = built("01")
    put(f"{ROBOT}/caster_back_link", TRANSLATE, Gf.Vec3d(-0.081, 0, -0.05))(stage)
    assert told(stage, "01") == [("S19", f"{ROBOT}/caster_back_link", None)]


def test_a_lidar_link_without_shape_must_be_above_the_ground() -> None:
    stage = built("03")
    deactivate(f"{ROBOT}/base_scan/collisions")(stage)
    put(f"{ROBOT}/base_scan", TRANSLATE, Gf.Vec3d(-0.032, 0, -0.182))(stage)
    assert told(stage, "03") == [("S19", f"{ROBOT}/base_scan", None)]


def test_a_graph_at_its_later_path_is_left_to_the_rule_about_graphs() -> None:
    assert told_after("00", define("/World/ROS_Clock", "OmniGraph")) == []


def test_a_node_left_over_in_the_starter_is_told_with_its_graph() -> None:
    stage = built("00")
    define("/Graph/ROS_Odometry", "OmniGraph")(stage)
    define("/Graph/ROS_Odometry/TFWorld2Odom", "OmniGraphNode")(stage)
    put_type = Sdf.ValueTypeNames.Token
    node = stage.GetPrimAtPath("/Graph/ROS_Odometry/TFWorld2Odom")
    node.CreateAttribute("node:type", put_type).Set("any")
    assert told(stage, "00") == [("S18", "/Graph/ROS_Odometry", None)]


def test_a_deactivated_leftover_is_not_in_the_starter() -> None:
    stage = built("00")
    define("/World/ActionGraph", "OmniGraph")(stage)
    deactivate("/World/ActionGraph")(stage)
    assert told(stage, "00") == []


@pytest.mark.parametrize("path", [LIDAR, CAMERA])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_faults(path: str, value: float) -> None:
    found = told_after("05", put(path, TRANSLATE, Gf.Vec3d(value, 0, 0)))
    assert (path, TRANSLATE) in [each[1:] for each in found]


@pytest.mark.parametrize("change", [remove, deactivate])
def test_a_robot_without_any_joint_is_one_fault(change: Callable[[str], Change]) -> None:
    assert told_after("02", change(JOINTS)) == [("S07", JOINTS, None)]


LEFT_JOINT, SCENE = f"{JOINTS}/wheel_left_joint", "/physicsScene"
WITHOUT_EFFECT = {
    "limits far away": put(LEFT_JOINT, "physics:upperLimit", 36_000.0),
    "limits of an importer": put(LEFT_JOINT, "physics:lowerLimit", -3.4e38),
    "no limits": put(LEFT_JOINT, "physics:upperLimit", math.inf),
    "a caster that rolls": retype(f"{JOINTS}/caster_back_joint", "PhysicsSphericalJoint"),
    "endless force": put(LEFT_JOINT, drive("maxForce"), math.inf),
    "gravity of the earth": put(SCENE, "physics:gravityMagnitude", -math.inf),
    "gravity of the moon": put(SCENE, "physics:gravityMagnitude", 1.62),
    "gravity down by default": put(SCENE, "physics:gravityDirection", Gf.Vec3f(0, 0, 0)),
    "gravity nearly down": put(SCENE, "physics:gravityDirection", Gf.Vec3f(0.01, 0, -2)),
    "a ground that leans a little": turned_floor(1),
    "one link without weight": lambda stage: void(
        stage.GetPrimAtPath(LINK_LEFT)
        .CreateAttribute("physxRigidBody:disableGravity", Sdf.ValueTypeNames.Bool)
        .Set(True)  # noqa: FBT003
    ),
    "a second scene without gravity": several(
        define("/other", "PhysicsScene"), put("/other", "physics:gravityMagnitude", 0.0)
    ),
}


@pytest.mark.parametrize("change", WITHOUT_EFFECT.values(), ids=WITHOUT_EFFECT.keys())
def test_what_has_no_effect_is_no_fault(change: Change) -> None:
    assert errors(found_after("02", change)) == []


@pytest.mark.parametrize("value", [True, False])
def test_a_wheel_joint_outside_of_the_articulation_is_unknown_to_its_controller(
    value: bool,  # noqa: FBT001 - as USD says it
) -> None:
    stage, path = built("02"), f"{JOINTS}/wheel_left_joint"
    name = "physics:excludeFromArticulation"
    put(path, name, value)(stage)
    assert told(stage, "02") == ([("S07", path, name)] if value else [])
    lost = "Scene/joint/wheel_left_joint" in unmet_by(findings_of(stage, "02"))
    assert lost == value


def test_a_robot_without_any_joint_meets_nothing_that_joints_do() -> None:
    stage = built("02")
    for joint in stage.GetPrimAtPath(JOINTS).GetChildren():
        deactivate(str(joint.GetPath()))(stage)
    found = findings_of(stage, "02")
    lost = unmet_by(found)
    assert [each.rule for each in found] == ["S07"]
    assert {"Scene/damping/wheel_left_joint", "Scene/joined/base_scan"} <= lost
    assert "Scene/mass/base_link" not in lost


def test_a_wheel_may_hang_on_a_body_that_the_handout_does_not_name() -> None:
    stage = built("02")
    define(f"{ROBOT}/axle", "Xform")(stage)
    define(f"{ROBOT}/axle/bar", "Xform")(stage)
    with_api(f"{ROBOT}/axle", "PhysicsRigidBodyAPI")(stage)
    for name in WHEELS:
        aim(f"{JOINTS}/{name}", "physics:body0", f"{ROBOT}/axle/bar")(stage)
    assert told(stage, "02") == []


def test_a_wheel_may_not_hang_on_the_robot_root() -> None:
    found = told_after("02", aim(f"{JOINTS}/wheel_left_joint", "physics:body0", ROBOT))
    assert found == [("S08", f"{JOINTS}/wheel_left_joint", "physics:body0")]


@pytest.mark.parametrize(
    ("end", "path", "other"),
    [
        ("physics:body1", f"{ROBOT}/caster_back_link", None),
        ("physics:body1", f"{ROBOT}/nothing", None),
        ("physics:body0", f"{ROBOT}/wheel_left_link", None),
        ("physics:body0", f"{ROBOT}/caster_back_link", f"{ROBOT}/base_link"),
    ],
)
def test_the_end_of_a_wheel_joint_that_is_wrong_is_blamed(
    end: str, path: str, other: str | None
) -> None:
    joint = f"{JOINTS}/wheel_left_joint"
    steps = [aim(joint, end, path)]
    if other is not None:
        steps.append(aim(joint, "physics:body1", other))
    wrong = "physics:body1" if other else end
    assert told_after("02", *steps) == [("S08", joint, wrong)]


def test_an_axis_that_no_joint_has_is_left_to_usd() -> None:
    assert told_after("02", put(f"{JOINTS}/wheel_left_joint", "physics:axis", "diagonal")) == []


def test_links_below_another_prim_are_named_with_the_place_they_are_at() -> None:
    stage = built("00")
    define(f"{ROBOT}/Geometry", "Xform")(stage)
    move_prim(f"{ROBOT}/base_scan", f"{ROBOT}/Geometry/base_scan")(stage)
    (found,) = findings_of(stage, "00")
    assert (found.rule, found.prim) == ("S01", f"{ROBOT}/base_scan")
    assert found.related == (f"{ROBOT}/Geometry/base_scan",)


def test_what_is_below_a_deactivated_prim_says_so() -> None:
    stage = built("02")
    define(f"{ROBOT}/extra", "Scope")(stage)
    move_prim(f"{JOINTS}/wheel_left_joint", f"{ROBOT}/extra/wheel_left_joint")(stage)
    deactivate(JOINTS)(stage)
    messages = [finding.message for finding in findings_of(stage, "02") if finding.rule == "S07"]
    assert messages == [f"wheel_right_joint is missing: {JOINTS} is deactivated"]


def test_what_a_joint_does_not_say_may_be_in_a_missing_asset() -> None:
    stage = built("02")
    joint = f"{JOINTS}/wheel_left_joint"
    refer(ROBOT, "robot.usd")(stage)
    clear(joint, drive("damping"))(stage)
    clear(f"{JOINTS}/wheel_right_joint", "physics:localRot0")(stage)
    aim(joint, "physics:body0")(stage)
    assert told(stage, "02") == [("F02", ROBOT, None)]


def test_a_missing_drive_may_be_in_a_missing_asset() -> None:
    stage = built("02")
    refer(ROBOT, "robot.usd")(stage)
    without_api(f"{JOINTS}/wheel_left_joint", "PhysicsDriveAPI:angular")(stage)
    assert told(stage, "02") == [("F02", ROBOT, None)]


def test_a_joint_that_sits_far_out_is_named_with_the_body_it_hangs_on() -> None:
    stage = built("02")
    put(f"{JOINTS}/wheel_right_joint", "physics:localPos0", Gf.Vec3f(0, -0.2, 0.023))(stage)
    (found,) = findings_of(stage, "02")
    assert (found.prim, found.actual) == (f"{JOINTS}/wheel_right_joint", "0.28 m")


def test_a_mass_without_its_schema_counts_for_nothing() -> None:
    found = told_after("02", without_api(f"{ROBOT}/base_link", "PhysicsMassAPI"))
    assert found == [("S04", f"{ROBOT}/base_link", "physics:mass")]


def test_what_physx_does_not_take_as_it_is_written_is_a_warning() -> None:
    joint, end = f"{JOINTS}/wheel_left_joint", "physics:body1"
    density = author(LINK_LEFT, "physics:density", "Float", -1.0)
    found = found_after("02", density, aim(joint, end, LINK_LEFT, BASE))
    assert {(each.rule, each.severity, each.prim, each.property) for each in found} == {
        ("S27", "warning", LINK_LEFT, "physics:density"),
        ("S27", "warning", joint, end),
    }


def test_a_mass_may_be_in_a_missing_asset() -> None:
    stage = built("02")
    refer(f"{ROBOT}/base_link", "link.usd")(stage)
    clear(f"{ROBOT}/base_link", "physics:mass")(stage)
    assert told(stage, "02") == [("F02", f"{ROBOT}/base_link", None)]


def test_a_wheel_without_an_angular_drive_is_named_at_its_damping() -> None:
    stage = built("02")
    joint = f"{JOINTS}/wheel_left_joint"
    without_api(joint, "PhysicsDriveAPI:angular")(stage)
    with_api(joint, "PhysicsDriveAPI:linear")(stage)
    assert told(stage, "02") == [("S10", joint, drive("damping"))]


@pytest.mark.parametrize("value", [float("nan"), -1.0])
def test_a_damping_that_is_not_above_zero_is_a_fault(value: float) -> None:
    stage = built("02")
    joint = f"{JOINTS}/wheel_left_joint"
    put(joint, drive("damping"), value)(stage)
    assert told(stage, "02") == [("S10", joint, drive("damping"))]


HOLD = f"{JOINTS}/root_joint"
BASE = f"{ROBOT}/base_footprint"


@pytest.mark.parametrize(
    ("change", "end"),
    [
        (weld(HOLD, body1=BASE), "physics:body0"),
        (weld(HOLD, body0=BASE), "physics:body1"),
        (weld(HOLD, body0=ROBOT, body1=BASE), "physics:body0"),
        (weld(HOLD, body0=FLOOR, body1=f"{ROBOT}/base_link"), "physics:body0"),
        (weld(HOLD, "PhysicsPrismaticJoint", body1=f"{BASE}/shape"), "physics:body0"),
    ],
)
def test_a_joint_that_holds_the_robot_is_one_error(change: Change, end: str) -> None:
    assert told_after("02", change) == [("S21", HOLD, end)]


def test_a_link_held_by_the_world_is_not_said_to_be_loose_as_well() -> None:
    found = told_after("02", aim(f"{JOINTS}/scan_joint", "physics:body0"))
    assert found == [("S21", f"{JOINTS}/scan_joint", "physics:body0")]


@pytest.mark.parametrize(
    "change",
    [
        several(weld(HOLD, body1=BASE), switch(HOLD, "physics:jointEnabled")),
        several(weld(HOLD, body1=BASE), deactivate(HOLD)),
        weld(HOLD, body0=f"{ROBOT}/base_link", body1=BASE),
        weld(HOLD),
        weld("/World/door", body1="/World/leaf"),
        several(with_api(ROBOT, "PhysicsRigidBodyAPI"), weld(HOLD, body0=ROBOT, body1=BASE)),
    ],
)
def test_a_joint_that_holds_no_part_of_the_robot_is_no_fault(change: Change) -> None:
    assert [each for each in told_after("02", change) if each[0] == "S21"] == []


@pytest.mark.parametrize("path", [ROBOT, f"{ROBOT}/base_scan", f"{ROBOT}/wheel_left_link", BASE])
def test_a_place_may_be_in_a_missing_asset(path: str) -> None:
    assert told_after("00", hide_place(path)) == [("F02", path, None)]


def test_a_robot_without_any_place_stands_at_the_origin() -> None:
    stage = built("00")
    UsdGeom.Xformable(stage.GetPrimAtPath(ROBOT)).ClearXformOpOrder()
    stage.GetPrimAtPath(ROBOT).RemoveProperty("xformOpOrder")
    assert told(stage, "00") == [("S03", ROBOT, TRANSLATE)]


def test_a_joint_on_a_link_whose_place_may_be_in_a_missing_asset_is_not_measured() -> None:
    stage = built("05")
    joint, scan = f"{JOINTS}/wheel_left_joint", f"{ROBOT}/base_scan"
    aim(joint, "physics:body0", scan)(stage)
    put(joint, "physics:localPos0", Gf.Vec3f(0.032, 0.08, -0.149))(stage)
    assert told(stage, "05") == []
    hide_place(scan)(stage)
    assert told(stage, "05") == [("F02", scan, None)]


SAID_ON_A_MISSING_ASSET: dict[str, tuple[Change, tuple[str, str | None]]] = {
    "axis": (
        put(f"{JOINTS}/wheel_left_joint", "physics:axis", "X"),
        (f"{JOINTS}/wheel_left_joint", "physics:axis"),
    ),
    "distance": (
        put(f"{JOINTS}/wheel_right_joint", "physics:localPos0", Gf.Vec3f(0, -0.2, 0.023)),
        (f"{JOINTS}/wheel_right_joint", "physics:localPos0"),
    ),
    "stiffness without its schema": (
        several(
            without_api(f"{JOINTS}/wheel_left_joint", "PhysicsDriveAPI:angular"),
            put(f"{JOINTS}/wheel_left_joint", drive("stiffness"), 100.0),
        ),
        (f"{JOINTS}/wheel_left_joint", drive("stiffness")),
    ),
    "tyre switched off": (
        switch(f"{LINK_LEFT}/collisions/tyre", "physics:collisionEnabled"),
        (f"{LINK_LEFT}/collisions/tyre", "physics:collisionEnabled"),
    ),
    "joint deactivated": (deactivate(f"{JOINTS}/scan_joint"), (f"{ROBOT}/base_scan", None)),
    "joint disabled": (
        switch(f"{JOINTS}/scan_joint", "physics:jointEnabled"),
        (f"{ROBOT}/base_scan", None),
    ),
    "wheel joint deactivated": (
        deactivate(f"{JOINTS}/wheel_left_joint"),
        (f"{JOINTS}/wheel_left_joint", None),
    ),
}


@pytest.mark.parametrize(
    ("change", "site"), SAID_ON_A_MISSING_ASSET.values(), ids=SAID_ON_A_MISSING_ASSET
)
def test_what_a_stage_says_itself_is_judged_beside_a_missing_asset(
    change: Change, site: tuple[str, str | None]
) -> None:
    found = told_after("02", refer(ROBOT, "bogus.usd"), change)
    assert [each[1:] for each in found if each[0] != "F02"] == [site]


@pytest.mark.parametrize(
    "change",
    [
        remove(f"{JOINTS}/scan_joint"),
        remove(f"{JOINTS}/wheel_left_joint"),
        clear(f"{JOINTS}/wheel_left_joint", "physics:axis"),
        clear(f"{JOINTS}/wheel_left_joint", "physics:localPos0"),
        clear(f"{JOINTS}/base_joint", "physics:localRot0"),
        remove(f"{LINK_LEFT}/collisions"),
    ],
)
def test_what_a_stage_does_not_say_may_be_in_the_missing_asset(change: Change) -> None:
    assert [each[0] for each in told_after("02", refer(ROBOT, "bogus.usd"), change)] == ["F02"]


LOCK = f"{JOINTS}/lock"


@pytest.mark.parametrize(
    "change",
    [
        weld(LOCK, body0=f"{LINK_LEFT}/collisions/tyre", body1=BASE),
        weld(LOCK, body0=LINK_LEFT),
        weld(LOCK, "PhysicsJoint", body0="/World/Box", body1=LINK_LEFT),
        weld(f"{LINK_LEFT}/lock", "PhysicsSphericalJoint", body0=LINK_LEFT, body1=BASE),
        several(refer(ROBOT, "robot.usd"), weld(LOCK, body0=LINK_LEFT, body1=BASE)),
        several(
            refer(ROBOT, "robot.usd"),
            remove(f"{JOINTS}/wheel_left_joint"),
            weld(LOCK, body0=LINK_LEFT, body1=BASE),
        ),
    ],
)
def test_whatever_ties_a_wheel_a_second_time_is_one_error(change: Change) -> None:
    assert [each[0] for each in told_after("02", change) if each[0] != "F02"] == ["S23"]


@pytest.mark.parametrize(
    "change",
    [
        several(weld(LOCK, body0=LINK_LEFT, body1=BASE), switch(LOCK, "physics:jointEnabled")),
        several(weld(LOCK, body0=LINK_LEFT, body1=BASE), deactivate(LOCK)),
        several(weld(LOCK, body0=LINK_LEFT, body1=BASE), undefine(LOCK)),
        weld(LOCK, body0=LINK_LEFT, body1=f"{LINK_LEFT}/collisions/tyre"),
        weld(LOCK, body0=BASE, body1=f"{ROBOT}/base_link"),
    ],
)
def test_what_does_not_tie_a_wheel_is_no_second_joint(change: Change) -> None:
    assert told_after("02", change) == []


@pytest.mark.parametrize("kind", ["PhysicsRevoluteJoint", "PhysicsFixedJoint"])
def test_a_joint_in_the_place_of_a_wheels_own_is_one_error(kind: str) -> None:
    stage = built("02")
    deactivate(f"{JOINTS}/wheel_left_joint")(stage)
    weld(LOCK, kind, body0=f"{ROBOT}/base_link", body1=LINK_LEFT)(stage)
    assert [each[0] for each in told(stage, "02")] == ["S07"]


def test_a_joint_that_ties_both_wheels_costs_an_item_of_each_wheel_that_it_names() -> None:
    found = found_after("02", weld(LOCK, body0=LINK_LEFT, body1=f"{ROBOT}/wheel_right_link"))
    assert unmet_by(found) == {"Scene/joint/wheel_left_joint"}


@pytest.mark.parametrize("checkpoint", ["00", "02", "08"])
def test_a_scale_is_a_fault_at_every_checkpoint_however_it_is_written(checkpoint: str) -> None:
    found = told_after(checkpoint, put(LINK_LEFT, SCALE, Gf.Vec3d(1, 1, 1.1)), as_matrix(LINK_LEFT))
    assert found == [("S24", LINK_LEFT, SCALE)]


def test_a_scale_with_noise_is_none() -> None:
    assert told_after("02", put(LINK_LEFT, SCALE, Gf.Vec3d(1.0000001, 0.9999998, 1.0005))) == []


def test_a_scale_is_told_on_a_robot_whose_asset_is_missing() -> None:
    found = told_after("02", refer(ROBOT, "robot.usd"), put(LINK_LEFT, SCALE, Gf.Vec3d(1, 1, 1.1)))
    assert found == [("F02", ROBOT, None), ("S24", LINK_LEFT, SCALE)]


def test_a_wheel_of_another_size_is_told_once_although_it_reaches_into_the_ground() -> None:
    assert told_after("02", put(LINK_LEFT, SCALE, Gf.Vec3d(2, 2, 2))) == [("S24", LINK_LEFT, SCALE)]


@pytest.mark.parametrize("joint", ["scan_joint", "base_joint"])
def test_a_joint_that_is_switched_off_is_named_where_a_link_is_loose(joint: str) -> None:
    stage = built("02")
    prim = stage.GetPrimAtPath(f"{ROBOT}/joints/{joint}")
    UsdPhysics.Joint(prim).CreateJointEnabledAttr(defaultValue=False)
    (found,) = [finding for finding in findings_of(stage, "02") if finding.rule == "S12"]
    assert found.related == (str(prim.GetPath()),)
    assert "disabled" in found.message
    assert "Joint Enabled" in (found.hint or "")


# ---- what holds the links, and what the root is


def test_a_joint_with_limits_on_all_axes_may_hold_the_base() -> None:
    stage = built("02")
    joint = stage.GetPrimAtPath(f"{JOINTS}/base_joint")
    joint.SetTypeName("PhysicsJoint")
    for axis in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"):
        joint.AddAppliedSchema(f"PhysicsLimitAPI:{axis}")
    assert told(stage, "02") == []


def test_a_wheel_may_stand_at_any_angle_about_its_axle() -> None:
    stage = built("02")
    for name in WHEELS:
        attribute = stage.GetPrimAtPath(f"{JOINTS}/{name}").GetAttribute("physics:localRot1")
        attribute.Set(attribute.Get() * Gf.Quatf(0.70710678, 0, 0, 0.70710678))
    assert told(stage, "02") == []


def test_a_wheel_is_judged_by_its_joint_not_by_where_its_link_is_saved() -> None:
    found = told_after("02", put(f"{ROBOT}/wheel_left_link", ORIENT, turn(90, (1, 0, 0))))
    assert [rule for rule, _, _ in found if rule == "S09"] == []


ROOT_BODIES = {
    "tied to a link": weld(f"{JOINTS}/root", body0=ROBOT, body1=f"{ROBOT}/base_footprint"),
    "switched off": switch(ROBOT, "physics:rigidBodyEnabled"),
    "kinematic": switch(ROBOT, "physics:kinematicEnabled", on=True),
}


@pytest.mark.parametrize("change", ROOT_BODIES.values(), ids=ROOT_BODIES)
def test_a_root_that_does_not_fall_alone_may_be_a_body(change: Change) -> None:
    found = told_after("02", with_api(ROBOT, "PhysicsRigidBodyAPI"), change)
    assert [rule for rule, _, _ in found if rule == "S05"] == []


def test_one_light_that_shines_is_enough() -> None:
    stage = built("04")
    for light in LIGHTS:
        author(light, "inputs:intensity", "Float", 0.0)(stage)
    define("/World/Lamp", "SphereLight")(stage)
    assert told(stage, "04") == []


def test_lights_below_a_prim_that_is_invisible_are_dark() -> None:
    found = told_after("04", author("/Environment/Lights", "visibility", "Token", "invisible"))
    assert found == [("S14", "/Environment/Lights", "visibility")]


@pytest.mark.parametrize(
    "change",
    [
        slick(MATERIALS[1]),  # the mean of 0 and that of the ground
        slick(MATERIALS[0]),
        several(
            slick(*MATERIALS),
            author(MATERIALS[0], "physxMaterial:frictionCombineMode", "Token", "max"),
            put(MATERIALS[0], SLIDING, 0.5),
        ),
    ],
)
def test_some_friction_is_enough(change: Change) -> None:
    assert told_after("02", change) == []


def test_a_mode_that_takes_the_smaller_friction_leaves_none() -> None:
    stage = built("02")
    mode = author(MATERIALS[1], "physxMaterial:frictionCombineMode", "Token", "min")
    several(slick(MATERIALS[1]), mode)(stage)
    assert told(stage, "02") == [("S25", MATERIALS[1], SLIDING)]


DRIVES = tuple(f"{JOINTS}/{name}" for name in WHEELS)


@pytest.mark.parametrize(
    ("name", "value", "told_of"),
    [
        ("maxForce", 1e-3, "maxForce"),  # 0.06 m/s2
        ("maxForce", 0.1, ""),  # 6 m/s2
        ("type", "acceleration", "type"),
        ("damping", 1e-6, "damping"),
        ("damping", 1e-3, ""),
    ],
)
def test_a_drive_that_does_not_move_the_robot_is_an_error(
    name: str, value: object, told_of: str
) -> None:
    expected = [("S10", path, drive(told_of)) for path in DRIVES] if told_of else []
    assert told_after("02", *(put(path, drive(name), value) for path in DRIVES)) == expected


def test_an_acceleration_drive_that_is_strong_enough_is_none() -> None:
    """1745 for a degree, as the importer of URDF writes it: 1e5 for a radian."""
    stage = built("02")
    changes = [
        (put(path, drive("type"), "acceleration"), put(path, drive("damping"), 1745.3))
        for path in DRIVES
    ]
    several(*(change for pair in changes for change in pair))(stage)
    assert told(stage, "02") == []


def wheels_of_a_missing_asset(stage: Usd.Stage) -> None:
    """The shape that both wheels refer to is brought by an asset that is not there."""
    shape = stage.GetRootLayer().GetPrimAtPath(f"{ROBOT}/colliders/wheel")
    for name in list(shape.nameChildren.keys()):
        del shape.nameChildren[name]
    shape.payloadList.Prepend(Sdf.Payload("./gone.usda"))


def test_what_a_prim_lacks_those_that_refer_to_it_may_lack() -> None:
    assert [each.rule for each in found_after("02", wheels_of_a_missing_asset)] == ["F02"]


def test_a_floor_of_a_mesh_that_looks_up_is_ground() -> None:
    assert told_after("02", floor_of_mesh("rightHanded")) == []


def walled(ahead: float) -> Change:
    """Put a wall of 20 cm before the robot, whose wheels reach 3.3 cm ahead of its base."""

    def change(stage: Usd.Stage) -> None:
        wall = UsdGeom.Cube.Define(stage, "/World/wall")
        wall.CreateSizeAttr(0.2)
        at = stage.GetPrimAtPath(ROBOT).GetAttribute(TRANSLATE).Get()
        wall.AddTranslateOp().Set(Gf.Vec3d(at[0] + ahead + 0.1, at[1], 0.101))
        UsdPhysics.CollisionAPI.Apply(wall.GetPrim())

    return change


def test_a_robot_inside_a_wall_is_told_once() -> None:
    body = f"{ROBOT}/base_link/collisions/body"
    assert told_after("02", walled(0.01)) == [("S32", body, None)]


def test_a_wall_beside_a_robot_is_not_told() -> None:
    assert told_after("02", walled(0.2)) == []


def test_an_inertia_that_no_wheel_has_is_told() -> None:
    wheel, name = f"{ROBOT}/wheel_left_link", "physics:diagonalInertia"
    placeholder = author(wheel, name, "Float3", Gf.Vec3f(1, 1, 1))
    assert told_after("02", placeholder) == [("S33", wheel, name)]


def test_an_inertia_that_a_wheel_has_is_not_told() -> None:
    wheel, name = f"{ROBOT}/wheel_left_link", "physics:diagonalInertia"
    usual = author(wheel, name, "Float3", Gf.Vec3f(2e-5, 2e-5, 2e-5))
    assert told_after("02", usual) == []
