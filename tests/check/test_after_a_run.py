"""A stage that was saved after the robot drove is as right as before, wherever it had got to."""

from __future__ import annotations

import pytest
from models import LINKS
from pxr import Gf, Usd, UsdGeom
from scene_stages import (
    CAMERA,
    JOINTS,
    ORIENT,
    ROBOT,
    TRANSLATE,
    WHEELS,
    aim,
    built,
    define,
    findings_of,
    put,
    told,
    turn,
    weld,
    with_api,
)

from lab3_usd.check.checker import judge
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.model.finding import Finding
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.read.stage_reader import read_model

BASE = f"{ROBOT}/base_footprint"
LEFT = f"{JOINTS}/wheel_left_joint"
Pose = tuple[float, float, float]


def driven(stage: Usd.Stage, place: Pose, degrees: float, rolled: float = 0.0) -> Usd.Stage:
    """Let every body stand where a run left it: the root stays, as the simulator leaves it."""
    turned = Gf.Rotation(Gf.Vec3d(0, 0, 1), degrees)
    run = Gf.Matrix4d().SetTransform(turned, Gf.Vec3d(*place))
    for link in LINKS:
        prim = stage.GetPrimAtPath(f"{ROBOT}/{link}")
        matrix = UsdGeom.Xformable(prim).GetLocalTransformation()
        if link in WHEELS.values():
            matrix = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 0, 1), rolled)) * matrix
        matrix *= run
        prim.GetAttribute(TRANSLATE).Set(matrix.ExtractTranslation())
        prim.GetAttribute(ORIENT).Set(matrix.ExtractRotationQuat())
    return stage


def faults(stage: Usd.Stage, checkpoint: str) -> list[tuple[str, str]]:
    found = findings_of(stage, checkpoint)
    return [(each.rule, each.prim) for each in found if each.severity != "note"]


def notes(stage: Usd.Stage, checkpoint: str) -> list[Finding]:
    return [finding for finding in findings_of(stage, checkpoint) if finding.rule == "S22"]


def judged(stage: Usd.Stage, checkpoint: str) -> RuleResults:
    lab = load_lab()
    with quiet():
        return judge(
            lab, lab.checkpoints[checkpoint], read_model(stage, lab.platform, "stage.usda")
        )


@pytest.mark.parametrize("degrees", [-170.0, -90.0, -3.0, 5.5, 37.0, 90.0, 123.4, 180.0, 270.0])
def test_a_robot_saved_after_it_turned_is_right(degrees: float) -> None:
    stage = driven(built("05"), (-0.7, 0.4, 0), degrees, rolled=1234.5)
    assert faults(stage, "05") == []


def test_where_a_robot_starts_is_not_told_in_wrong_units() -> None:
    stage = driven(built("05"), (-0.7, 0.4, 0), 90)
    assert len(notes(stage, "05")) == 1
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    assert notes(stage, "05") == []


@pytest.mark.parametrize("checkpoint", ["01", "02", "05", "08"])
def test_a_run_costs_no_requirement(checkpoint: str) -> None:
    found = judged(driven(built(checkpoint), (-2, 1, 0.001), 200, rolled=77), checkpoint)
    assert [requirement.id for requirement in found.requirements if not requirement.met] == []
    assert [finding.rule for finding in found.findings if finding.severity != "note"] == []


@pytest.mark.parametrize("degrees", [0.0, 90.0, 180.0])
def test_an_axle_that_is_wrong_is_wrong_after_a_run_as_well(degrees: float) -> None:
    stage = driven(built("02"), (0.5, 0.5, 0), degrees)
    put(LEFT, "physics:localRot0", Gf.Quatf(0.70710678, 0.70710678, 0, 0))(stage)
    assert faults(stage, "02") == [("S09", LEFT)]


def test_wheels_too_far_apart_are_so_after_a_run_as_well() -> None:
    stage = driven(built("02"), (0.5, 0.5, 0), 90)
    put(LEFT, "physics:localPos0", Gf.Vec3f(0, 0.12, 0.023))(stage)
    assert faults(stage, "02") == [("S20", LEFT)]


def test_a_wheel_may_hang_on_a_link_whose_frame_is_turned() -> None:
    stage = built("02")
    caster = f"{ROBOT}/caster_back_link"  # its Z is the robot's Y
    aim(LEFT, "physics:body0", caster)(stage)
    put(LEFT, "physics:localPos0", Gf.Vec3f(0.081, -0.027, 0.08))(stage)
    put(LEFT, "physics:localRot0", Gf.Quatf(1, 0, 0, 0))(stage)
    assert told(driven(stage, (0, 0, 0), 0), "02") == []
    assert faults(driven(stage, (-1, 0, 0), 140), "02") == []


def test_bodies_count_where_joints_tie_them_not_where_they_are_saved() -> None:
    stage = built("02")
    put(f"{ROBOT}/base_link", ORIENT, turn(180))(stage)
    assert faults(stage, "02") == []


def test_a_base_that_is_mounted_backward_drives_backward() -> None:
    stage = built("02")
    put(f"{JOINTS}/base_joint", "physics:localRot0", Gf.Quatf(0, 0, 0, 1))(stage)
    found = {(finding.rule, finding.severity) for finding in findings_of(stage, "02")}
    assert found == {("S09", "error"), ("S17", "error")}  # the lidar goes with the base


def test_a_body_that_no_fixed_joint_ties_is_taken_as_it_stands() -> None:
    stage = built("02")
    bar = f"{ROBOT}/bar"
    define(bar, "Xform")(stage)
    with_api(bar, "PhysicsRigidBodyAPI")(stage)
    weld(f"{JOINTS}/slide", "PhysicsPrismaticJoint", body0=f"{ROBOT}/base_link", body1=bar)(stage)
    for name in WHEELS:
        aim(f"{JOINTS}/{name}", "physics:body0", bar)(stage)
    assert faults(stage, "02") == []
    UsdGeom.Xformable(stage.GetPrimAtPath(bar)).AddRotateZOp().Set(90)
    assert [rule for rule, _ in faults(stage, "02")] == ["S09", "S09"]


@pytest.mark.parametrize("checkpoint", ["00", "03", "08"])
def test_where_the_robot_will_start_is_a_note(checkpoint: str) -> None:
    (note,) = notes(driven(built(checkpoint), (-1.4, 1.2, 0), 90), checkpoint)
    assert (note.prim, note.property, note.severity) == (BASE, TRANSLATE, "note")
    assert note.actual == "at (0.4, 1.2, 0) m, facing 90 degrees"
    assert note.expected == "at (1.8, 0, 0) m, facing 0 degrees"


@pytest.mark.parametrize(
    ("place", "degrees"), [((0.005, 0.005, 0), 0.0), ((0, 0, 0.0004), 0.4), ((0, 0, 0), 360.0)]
)
def test_a_base_that_hardly_moved_is_not_worth_a_note(place: Pose, degrees: float) -> None:
    assert notes(driven(built("05"), place, degrees), "05") == []


def test_a_robot_that_turned_on_the_spot_is_worth_a_note() -> None:
    (note,) = notes(driven(built("05"), (0, 0, 0), 2), "05")
    assert "facing 2 degrees" in note.message


def test_a_robot_that_fell_over_is_said_to_lie() -> None:
    stage = built("05")
    for link in LINKS:
        put(f"{ROBOT}/{link}", ORIENT, turn(90, (1, 0, 0)))(stage)
    (note,) = notes(stage, "05")
    assert note.actual is not None
    assert "tipped by 90 degrees" in note.actual


def test_a_camera_goes_along_with_its_link() -> None:
    stage = driven(built("04"), (0.3, 0, 0), 45)
    assert stage.GetPrimAtPath(CAMERA)
    assert faults(stage, "04") == []
