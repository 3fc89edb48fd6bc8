"""Physics that was added to a starter: what changes how the robot moves, and what does not."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from breaking import copied, correct_stage
from pxr import Gf, Usd, UsdShade
from scene_stages import author, define, move_prim, several, switch, weld, with_api
from submissions import LAB, SPEC

from lab3_usd.check.registry import rules_of
from lab3_usd.model.changes import Change, StarterSubject
from lab3_usd.model.finding import Problem
from lab3_usd.stage.compare.stages import compare_starter
from lab3_usd.stage.write.starter import starter_layer

ROBOT = LAB.scene.robot.path
BASE, FOOT = f"{ROBOT}/base_link", f"{ROBOT}/base_footprint"
WHEEL = f"{ROBOT}/wheel_left_link"
JOINT = f"{ROBOT}/joints/wheel_left_joint"
WALL, SCENE = "/Environment/Walls/East", "/physicsScene"
BALL = "/Environment/PhysicsMaterials/Ball"
TYRE = "/Environment/PhysicsMaterials/Tyre"
GROUP = "/World/Group"
Edit = Callable[[Usd.Stage], object]


@pytest.fixture(scope="module")
def starter() -> Usd.Stage:
    return copied(starter_layer(LAB.folder))


def changes(starter: Usd.Stage, edit: Edit) -> tuple[Change, ...]:
    stage = correct_stage("08")
    edit(stage)
    return compare_starter(starter, stage, LAB, "08").changes


def relate(path: str, name: str, *targets: str) -> Edit:
    return lambda stage: stage.GetPrimAtPath(path).CreateRelationship(name).SetTargets(targets)


def bind(path: str, material: str, purpose: str, *, strongly: bool = False) -> Edit:
    strength = (
        UsdShade.Tokens.strongerThanDescendants if strongly else UsdShade.Tokens.fallbackStrength
    )

    def change(stage: Usd.Stage) -> None:
        api = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(path))
        api.Bind(UsdShade.Material(stage.GetPrimAtPath(material)), strength, purpose)

    return change


MOVES: dict[str, tuple[Edit, str]] = {
    "damping": (author(BASE, "physxRigidBody:linearDamping", "Float", 50.0), BASE),
    "locked axis": (author(FOOT, "physxRigidBody:lockedPosAxis", "Int", 3), FOOT),
    "friction of a joint": (author(JOINT, "physxJoint:jointFriction", "Float", 5.0), JOINT),
    "slower joint": (author(JOINT, "physxJoint:maxJointVelocity", "Float", 1.0), JOINT),
    "time step": (author(SCENE, "physxScene:timeStepsPerSecond", "UInt", 5), SCENE),
    "physics switched off": (author(SCENE, "physxScene:updateType", "Token", "Disabled"), SCENE),
    "soft tyres": (author(TYRE, "physxMaterial:compliantContactStiffness", "Float", 9.0), TYRE),
    "filtered pairs": (relate(WHEEL, "physics:filteredPairs", "/Environment/GroundPlane"), WHEEL),
    "mimic joint": (with_api(JOINT, "PhysxMimicJointAPI:rotX"), JOINT),
    "another owner": (
        several(
            define("/World/Moon", "PhysicsScene"),
            relate(BASE, "physics:simulationOwner", "/World/Moon"),
        ),
        BASE,
    ),
    "second scene": (define("/World/Moon", "PhysicsScene"), "/World/Moon"),
    "collision group": (
        several(
            define(GROUP, "PhysicsCollisionGroup"), relate(GROUP, "physics:filteredGroups", GROUP)
        ),
        GROUP,
    ),
    "slippery robot": (bind(ROBOT, BALL, "physics", strongly=True), ROBOT),
    "a shape on the robot": (
        several(define(f"{BASE}/skid", "Cube"), with_api(f"{BASE}/skid", "PhysicsCollisionAPI")),
        f"{BASE}/skid",
    ),
    "a body on the robot": (
        several(
            define(f"{ROBOT}/trailer", "Xform"), with_api(f"{ROBOT}/trailer", "PhysicsRigidBodyAPI")
        ),
        f"{ROBOT}/trailer",
    ),
    "another joint": (
        weld(f"{ROBOT}/joints/more", body0=BASE, body1=f"{ROBOT}/base_scan"),
        f"{ROBOT}/joints/more",
    ),
    "a joint among the application's own prims": (
        weld("/Render/Weld", body0=BASE, body1=f"{ROBOT}/base_scan"),
        "/Render/Weld",
    ),
    "a wall that falls": (with_api(WALL, "PhysicsRigidBodyAPI"), WALL),
    "walls that fall": (
        with_api("/Environment/Walls", "PhysicsRigidBodyAPI"),
        "/Environment/Walls",
    ),
    "a root that is held": (
        several(
            with_api(ROBOT, "PhysicsRigidBodyAPI"),
            switch(ROBOT, "physics:kinematicEnabled", on=True),
        ),
        ROBOT,
    ),
    "a wall that could be kinematic": (
        several(with_api(WALL, "PhysicsRigidBodyAPI"), switch(WALL, "physics:kinematicEnabled")),
        WALL,
    ),
}


@pytest.mark.parametrize(("edit", "prim"), MOVES.values(), ids=MOVES)
def test_physics_that_moves_the_robot_otherwise_is_a_warning(
    starter: Usd.Stage, edit: Edit, prim: str
) -> None:
    found = changes(starter, edit)
    assert prim in [each.prim for each in found]
    said = told(found)
    assert {(rule, problem.severity) for rule, problem in said} == {("U07", "warning")}


def told(found: tuple[Change, ...], *blamed: tuple[str, str | None]) -> list[tuple[str, Problem]]:
    subject = StarterSubject(SPEC.starter, found, frozenset(blamed))
    rules = rules_of("starter", "U")
    return [(rule.id, each) for rule in rules for each in list(rule.check(subject))]


STAYS: dict[str, Edit] = {
    "the default": author(BASE, "physxRigidBody:linearDamping", "Float", 0.0),
    "a schema without a value": with_api(BASE, "PhysxRigidBodyAPI"),
    "pairs without a target": several(
        with_api(WHEEL, "PhysicsFilteredPairsAPI"), relate(WHEEL, "physics:filteredPairs")
    ),
    "the only scene as owner": relate(BASE, "physics:simulationOwner", SCENE),
    "a group that filters nothing": define(GROUP, "PhysicsCollisionGroup"),
    "state of a joint": several(
        with_api(JOINT, "PhysicsJointStateAPI:angular"),
        author(JOINT, "state:angular:physics:velocity", "Float", 4.0),
    ),
    "a velocity": author(FOOT, "physics:velocity", "Vector3f", Gf.Vec3f(1, 0, 0)),
    "a target of a drive": author(JOINT, "drive:angular:physics:targetPosition", "Float", 9.0),
    "where physics is computed": author(SCENE, "physxScene:enableGPUDynamics", "Bool", False),  # noqa: FBT003
    "looks on the robot": several(
        define("/World/Paint", "Material"), bind(ROBOT, "/World/Paint", "", strongly=True)
    ),
    "a material that the wheels overrule": bind(WHEEL, BALL, ""),
    "a box in the room": several(
        define("/World/Box", "Cube"), with_api("/World/Box", "PhysicsCollisionAPI")
    ),
    "a shape that is only seen": define(f"{BASE}/antenna", "Cylinder"),
    "a wall that stays": several(
        with_api(WALL, "PhysicsRigidBodyAPI"), switch(WALL, "physics:kinematicEnabled", on=True)
    ),
    "a wall whose body is off": several(
        with_api(WALL, "PhysicsRigidBodyAPI"), switch(WALL, "physics:rigidBodyEnabled")
    ),
    "a switch of no body": switch(WALL, "physics:kinematicEnabled", on=True),
    "a joint that is off": several(
        weld(f"{ROBOT}/joints/more", body0=BASE, body1=FOOT),
        switch(f"{ROBOT}/joints/more", "physics:jointEnabled"),
    ),
    "a joint of other things": weld("/World/hinge", body0="/World/Box", body1="/World/Door"),
    "joints below their links": move_prim(JOINT, f"{WHEEL}/wheel_left_joint"),
    "a product of the renderer": define("/Render/Product", "RenderProduct"),
}


@pytest.mark.parametrize("edit", STAYS.values(), ids=STAYS)
def test_what_moves_nothing_is_no_change(starter: Usd.Stage, edit: Edit) -> None:
    assert [each for each in told(changes(starter, edit)) if each[0] == "U07"] == []


def test_a_joint_that_another_rule_has_told_is_not_told_again(starter: Usd.Stage) -> None:
    lock = f"{ROBOT}/joints/lock"
    found = changes(starter, weld(lock, body0=BASE, body1=WHEEL))
    assert [rule for rule, _ in told(found)] == ["U07"]
    assert told(found, (lock, None)) == []
