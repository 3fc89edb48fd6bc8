"""A stage beside its starter where an asset is missing: what its own layers say is compared."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from breaking import copied, correct_stage
from pxr import Gf, Sdf, Usd
from scene_stages import (
    aim,
    clear,
    deactivate,
    put,
    refer,
    remove,
    retype,
    several,
    switch,
    without_api,
)
from starters import layered_starter

from lab3_usd.model.changes import Change
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.compare.stages import compare_starter
from lab3_usd.stage.read.opening import open_stage, quiet
from lab3_usd.stage.write.builder import build_checkpoint
from lab3_usd.stage.write.starter import starter_layer

LAB = load_lab()
ROBOT = LAB.scene.robot.path
BASE = f"{ROBOT}/base_link"
FOOT = f"{ROBOT}/base_footprint"
WHEEL = f"{ROBOT}/wheel_left_link"
JOINT = f"{ROBOT}/joints/wheel_left_joint"
WALL = "/Environment/Walls/East"
SCENE = "/physicsScene"
TRANSLATE, SCALE = "xformOp:translate", "xformOp:scale"
Edit = Callable[[Usd.Stage], None]


@pytest.fixture(scope="module")
def starter() -> Usd.Stage:
    return copied(starter_layer(LAB.folder))


def compared(starter: Usd.Stage, *edits: Edit, checkpoint: str = "08") -> tuple[Change, ...]:
    stage = correct_stage("08")
    with quiet():
        for edit in edits:
            edit(stage)
        return compare_starter(starter, stage, LAB, checkpoint).changes


def told(changes: tuple[Change, ...]) -> list[tuple[str, str]]:
    """Each prim that changed, with why it is gone or what its gravest difference is about."""
    return [
        (change.prim, change.absent or change.differences[0].property or change.differences[0].kind)
        for change in changes
    ]


CHANGES: dict[str, tuple[Edit, tuple[str, str]]] = {
    "mass": (put(BASE, "physics:mass", 1000.0), (BASE, "physics:mass")),
    "mass of the base": (put(FOOT, "physics:mass", 1000.0), (FOOT, "physics:mass")),
    "gravity": (put(SCENE, "physics:gravityMagnitude", 0.0), (SCENE, "physics:gravityMagnitude")),
    "wall deactivated": (deactivate(WALL), (WALL, "deactivated")),
    "walls deactivated": (
        deactivate("/Environment/Walls"),
        ("/Environment/Walls", "deactivated"),
    ),
    "wall moved": (put(WALL, TRANSLATE, Gf.Vec3d(9, 0, 0)), (WALL, TRANSLATE)),
    "wall soft": (
        without_api(WALL, "PhysicsCollisionAPI"),
        (WALL, "schema"),
    ),
    "wall passable": (
        switch(WALL, "physics:collisionEnabled"),
        (WALL, "physics:collisionEnabled"),
    ),
    "joint deactivated": (deactivate(JOINT), (JOINT, "deactivated")),
    "joint fixed": (retype(JOINT, "PhysicsFixedJoint"), (JOINT, "type")),
    "joint aimed": (
        aim(JOINT, "physics:body1", f"{ROBOT}/wheel_right_link"),
        (JOINT, "physics:body1"),
    ),
    "schema listed away": (
        lambda stage: (
            stage.GetRootLayer()
            .GetPrimAtPath(WHEEL)
            .SetInfo("apiSchemas", Sdf.TokenListOp.CreateExplicit(["IsaacLinkAPI"]))
        ),
        (WHEEL, "schema"),
    ),
    "link scaled": (put(WHEEL, SCALE, Gf.Vec3d(1, 1, 2)), (WHEEL, SCALE)),
    "value blocked": (
        lambda stage: stage.GetPrimAtPath(BASE).GetAttribute("physics:diagonalInertia").Block(),
        (BASE, "physics:diagonalInertia"),
    ),
}
TOPS = [ROBOT, "/Environment", BASE, SCENE]


# Each with an asset that is missing at its prim or above, and one elsewhere.
ABOVE = [
    (name, top) for name, (_, site) in CHANGES.items() for top in TOPS if site[0].startswith(top)
]
ELSEWHERE = [
    next((name, top) for top in TOPS[number % 4 :] + TOPS if (name, top) not in ABOVE)
    for number, name in enumerate(CHANGES)
]


@pytest.mark.parametrize(("change", "top"), [*ABOVE, *ELSEWHERE])
def test_a_missing_asset_hides_nothing_that_the_stage_says_itself(
    starter: Usd.Stage, change: str, top: str
) -> None:
    edit, site = CHANGES[change]
    assert told(compared(starter, refer(top, "bogus.usd"), edit)) == [site]


def test_a_changed_scale_is_shown_as_one(starter: Usd.Stage) -> None:
    (change,) = compared(starter, CHANGES["link scaled"][0])
    (difference,) = change.differences
    assert (difference.was, difference.now) == ("scale (1, 1, 1)", "scale (1, 1, 2)")


def test_one_missing_asset_does_not_switch_the_comparison_off(starter: Usd.Stage) -> None:
    names = ("mass", "gravity", "walls deactivated")
    edits = [refer(ROBOT, "bogus.usd"), *(CHANGES[name][0] for name in names)]
    found = compared(starter, *edits)
    assert sorted(told(found)) == sorted(CHANGES[name][1] for name in names)


@pytest.mark.parametrize("top", TOPS)
def test_a_missing_asset_alone_is_no_change(starter: Usd.Stage, top: str) -> None:
    assert compared(starter, refer(top, "bogus.usd")) == ()


UNSAID: dict[str, tuple[str, Edit]] = {
    "a prim": ("/Environment", remove(WALL)),
    "a subtree": (ROBOT, remove(f"{ROBOT}/joints")),
    "a value": (ROBOT, clear(BASE, "physics:diagonalInertia")),
    "a target": (ROBOT, clear(JOINT, "physics:body1")),
    "a place": ("/Environment", several(clear(WALL, TRANSLATE), clear(WALL, "xformOpOrder"))),
    "a type": (ROBOT, retype(JOINT, "")),
    "what a run changes": (
        ROBOT,
        several(put(BASE, TRANSLATE, Gf.Vec3d(3, 3, 0)), put(ROBOT, TRANSLATE, Gf.Vec3d(0, 0, 0))),
    ),
    "a schema that no layer lists": (
        ROBOT,
        lambda stage: (
            stage.GetRootLayer()
            .GetPrimAtPath(WHEEL)
            .SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["PhysicsRigidBodyAPI"]))
        ),
    ),
}


@pytest.mark.parametrize(("top", "edit"), UNSAID.values(), ids=UNSAID)
def test_what_no_layer_says_may_be_in_the_missing_asset(
    starter: Usd.Stage, top: str, edit: Edit
) -> None:
    assert compared(starter, refer(top, "bogus.usd"), edit) == ()


def overs(folder: Path, *edits: Edit) -> tuple[Path, Path]:
    """A starter in several files, and a stage whose robot and room did not come along."""
    starter = layered_starter(folder / "given")
    stage = build_checkpoint(starter, "05", folder / "work" / "Lab3_05.usda")
    opened = Usd.Stage.Open(str(stage))
    for edit in edits:
        edit(opened)
    opened.Save()
    elsewhere = folder / "handed" / "in" / "work"
    elsewhere.mkdir(parents=True)
    return starter, stage.rename(elsewhere / stage.name)


@pytest.mark.parametrize(
    ("edit", "site"),
    [
        (put(BASE, "physics:mass", 1000.0), (BASE, "physics:mass")),
        (put(WALL, TRANSLATE, Gf.Vec3d(9, 0, 0)), (WALL, TRANSLATE)),
        (put(WHEEL, SCALE, Gf.Vec3d(1, 1, 2)), (WHEEL, SCALE)),
        (deactivate(WALL), (WALL, "deactivated")),
        (deactivate(JOINT), (JOINT, "deactivated")),
    ],
)
def test_an_over_of_a_prim_in_a_missing_asset_is_compared(
    edit: Edit, site: tuple[str, str], tmp_path: Path
) -> None:
    before, after = overs(tmp_path, edit)
    stage = open_stage(after)
    assert told(compare_starter(open_stage(before), stage, LAB, "05").changes)[-1:] == [site]


def test_overs_of_a_run_in_a_missing_asset_are_no_change(tmp_path: Path) -> None:
    before, after = overs(tmp_path, put(BASE, TRANSLATE, Gf.Vec3d(1, 1, 0)))
    found = compare_starter(open_stage(before), open_stage(after), LAB, "05").changes
    assert [each for each in told(found) if each[0].startswith(ROBOT)] == []
