"""Physics that a dry run does not play is named, and how the robot moves is not judged with it."""

from __future__ import annotations

from typing import Any

import pytest
from breaking import correct_stage
from dry_runs import SHORT, driven
from models import LINKS
from pxr import Gf, Usd
from scene_stages import (
    FLOOR,
    JOINTS,
    ROBOT,
    Change,
    author,
    define,
    several,
    void,
    with_api,
)

from lab3_usd.sim.judge.checks import CHECKS, judge
from lab3_usd.sim.judge.expectations import Trial

BASE, WHEEL = f"{ROBOT}/base_link", f"{ROBOT}/wheel_left_link"
LEFT, SCENE = f"{JOINTS}/wheel_left_joint", "/physicsScene"
ONE, OTHER = "/World/Robots", "/World/Rooms"
INCLUDES, FILTERED = "collection:colliders:includes", "physics:filteredGroups"


def relate(path: str, name: str, *targets: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath(path)
        prim.CreateRelationship(name, custom=False).SetTargets([*targets])

    return change


def groups(*filtered: str, room: str = "/Environment") -> Change:
    kind = "PhysicsCollisionGroup"
    return several(
        *(define(path, kind) for path in (ONE, OTHER)),
        relate(ONE, INCLUDES, ROBOT),
        relate(OTHER, INCLUDES, room),
        relate(ONE, FILTERED, *filtered),
    )


def value(path: str, name: str, kind: str, value: Any) -> tuple[Change, str, str]:
    return author(path, name, kind, value), path, name


TYRE = f"{WHEEL}/collisions/tyre"
BODY, JOINT = "physxRigidBody:", "physxJoint:"
FORCE, SURFACE = "physxForce:force", "physxSurfaceVelocity:surfaceVelocity"
MIMIC = "physxMimicJoint:rotZ:referenceJoint"
PAIRS, OWNER = "physics:filteredPairs", "physics:simulationOwner"
CENTRE = "physics:centerOfMass"

UNPLAYED: dict[str, tuple[Change, str, str]] = {
    "pairs": (relate(FLOOR, PAIRS, *(f"{ROBOT}/{link}" for link in LINKS)), FLOOR, PAIRS),
    "pairs of the robot": (relate(WHEEL, PAIRS, "/Environment"), WHEEL, PAIRS),
    "groups": (groups(OTHER), ONE, FILTERED),
    "other groups only": (
        several(groups(), author(ONE, "physics:invertFilteredGroups", "Bool", value=True)),
        ONE,
        "physics:invertFilteredGroups",
    ),
    "another scene": (
        several(define("/World/Moon", "PhysicsScene"), relate(WHEEL, OWNER, "/World/Moon")),
        WHEEL,
        OWNER,
    ),
    "no updates": value(SCENE, "physxScene:updateType", "Token", "Disabled"),
    "locked": value(BASE, f"{BODY}lockedPosAxis", "Int", 7),
    "no speed": value(BASE, f"{BODY}maxLinearVelocity", "Float", 0.0),
    "no turning": value(WHEEL, f"{BODY}maxAngularVelocity", "Float", 0.0),
    "damped": value(BASE, f"{BODY}linearDamping", "Float", 1e6),
    "pushed": value(BASE, FORCE, "Vector3f", Gf.Vec3f(50, 0, 0)),
    "thrown": value(BASE, "physics:velocity", "Vector3f", Gf.Vec3f(0, 0, 50)),
    "a conveyor": value(FLOOR, SURFACE, "Vector3f", Gf.Vec3f(1, 0, 0)),
    "slow wheels": value(LEFT, f"{JOINT}maxJointVelocity", "Float", 90.0),
    "friction": value(LEFT, f"{JOINT}jointFriction", "Float", 1e6),
    "a mimic": (relate(LEFT, MIMIC, f"{JOINTS}/wheel_right_joint"), LEFT, MIMIC),
    "an oval tyre": (
        several(
            author(TYRE, "xformOp:scale", "Float3", Gf.Vec3f(1.02, 1, 1)),
            author(TYRE, "xformOpOrder", "TokenArray", ["xformOp:scale"]),
        ),
        TYRE,
        "its scale",
    ),
}


def played(change: Change) -> tuple[Trial, dict[str, str]]:
    stage = correct_stage("05")
    change(stage)
    trial = driven(stage, SHORT)
    return trial, {check.name: check.verdict for check in judge(trial, CHECKS)}


@pytest.mark.parametrize(("change", "path", "name"), UNPLAYED.values(), ids=UNPLAYED)
def test_what_is_not_played_of_physics_is_named(change: Change, path: str, name: str) -> None:
    trial, verdicts = played(change)
    assert trial.recording.not_simulated[path].startswith(name)
    assert {verdicts[each] for each in ("rest", "follows")} == {"not judged"}
    assert {verdicts[each] for each in ("topics", "clock", "scan")} == {"ok"}


def off(path: str, name: str, switch: str) -> Change:
    return several(
        author(path, name, "Vector3f", Gf.Vec3f(50, 0, 0)),
        author(path, switch, "Bool", value=False),
    )


HARMLESS: dict[str, Change] = {
    "pairs of the robot's links": relate(WHEEL, PAIRS, BASE),
    "pairs with a wall": relate(ROBOT, PAIRS, "/Environment/Walls/East"),
    "groups of their own": groups(OTHER, room="/Environment/Walls"),
    "groups that collide": groups(),
    "the only scene": relate(WHEEL, OWNER, SCENE),
    "no force": off(BASE, FORCE, "physxForce:forceEnabled"),
    "a conveyor that stands": off(FLOOR, SURFACE, "physxSurfaceVelocity:surfaceVelocityEnabled"),
    "the schemas' own": several(
        with_api(BASE, "PhysxRigidBodyAPI"),
        author(SCENE, "physxScene:updateType", "Token", "Synchronous"),
        author(BASE, f"{BODY}lockedPosAxis", "Int", 0),
        author(BASE, f"{BODY}lockedRotAxis", "Int", 0),
        author(BASE, f"{BODY}solveContact", "Bool", value=True),
        author(BASE, f"{BODY}disableGravity", "Bool", value=False),
        author(BASE, f"{BODY}linearDamping", "Float", 0.0),
        author(BASE, f"{BODY}angularDamping", "Float", 0.05),
        author(BASE, f"{BODY}maxLinearVelocity", "Float", float("inf")),
        author(BASE, f"{BODY}maxAngularVelocity", "Float", 5729.58),
        author(LEFT, f"{JOINT}maxJointVelocity", "Float", 1e6),
        author(LEFT, f"{JOINT}jointFriction", "Float", 0.0),
        author(LEFT, f"{JOINT}armature", "Float", 0.0),
        author(LEFT, "physics:breakForce", "Float", float("inf")),
        author(BASE, CENTRE, "Point3f", Gf.Vec3f(float("-inf"))),
    ),
    "a locked crate": several(
        define("/World/Crate", "Cube"),
        with_api("/World/Crate", "PhysicsRigidBodyAPI"),
        author("/World/Crate", f"{BODY}lockedPosAxis", "Int", 7),
    ),
    "a mass below 0, which counts as not set": author(BASE, "physics:mass", "Float", -100.0),
    "nothing": void,
}


@pytest.mark.parametrize("change", HARMLESS.values(), ids=HARMLESS)
def test_values_that_change_nothing_are_played(change: Change) -> None:
    trial, verdicts = played(change)
    assert trial.recording.not_simulated == {}
    assert {verdicts[each] for each in ("rest", "follows")} == {"ok"}
