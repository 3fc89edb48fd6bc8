"""How much a check and a lint do for each further prim of a scene.

Calls of Python functions are counted, which are the same on every machine: nothing is timed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import FrameType

import pytest
from pxr import Sdf, Usd

from lab3_usd.check.checker import judge
from lab3_usd.pipeline.stage import judge_open_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write.builder import build_checkpoint

LAB = load_lab()
CHECKPOINT = LAB.checkpoints["05"]
STEP = 8  # prims of each kind
# What furniture may be: a type, and the schemas that are applied.
KINDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "shape": ("Cube", ()),
    "mesh": ("Mesh", ()),
    "obstacle": ("Cube", ("PhysicsCollisionAPI",)),
    "body": ("Xform", ("PhysicsRigidBodyAPI",)),
    "plane": ("Plane", ()),
    "light": ("SphereLight", ()),
    "camera": ("Camera", ()),
    "lidar": ("OmniLidar", ()),
    "joint": ("PhysicsFixedJoint", ()),
    "script": ("Scope", ("OmniScriptingAPI",)),
}
# Kinds that stand together in a scene: what one of them takes more is not made up for by others.
GROUPS = {
    "unasked": ("shape", "mesh"),
    "physics": ("obstacle", "body", "plane", "joint"),
    "others": ("light", "camera", "lidar", "script"),
}
COMMANDS: dict[str, Callable[[Usd.Stage], object]] = {
    "check": lambda stage: judge(LAB, CHECKPOINT, read_model(stage, LAB.platform, "stage")),
    "lint": judge_open_stage,
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_checkpoint(None, "05", tmp_path_factory.mktemp("large") / "stage.usda")


def furnished(built: Path, kinds: Sequence[str], count: int) -> Usd.Stage:
    """Return a correct stage with so many more prims of each kind, in a group for each step."""
    layer = Sdf.Layer.OpenAsAnonymous(str(built))
    with Sdf.ChangeBlock():
        for kind in kinds:
            type_name, schemas = KINDS[kind]
            for number in range(count):
                path = f"/Furniture/Room_{number // STEP}/{kind}_{number}_there"
                prim = Sdf.CreatePrimInLayer(layer, path)
                prim.specifier, prim.typeName = Sdf.SpecifierDef, type_name
                prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(list(schemas)))
                for group in (prim.nameParent, prim.nameParent.nameParent):
                    group.specifier = Sdf.SpecifierDef
    return Usd.Stage.Open(layer)


def calls_of(command: Callable[[Usd.Stage], object], stage: Usd.Stage) -> int:
    """Count the Python functions that a command calls, and each step of a generator."""
    calls = 0

    def note(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event == "call"

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        command(stage)
    finally:
        sys.setprofile(before)
    return calls


@pytest.fixture(scope="module")
def steps(built: Path) -> Callable[[str, str], tuple[float, float]]:
    """Return how many calls a command makes for each prim of the second and the third step."""
    for command in [*COMMANDS.values()] * 2:  # which imports the rules, and fills caches
        command(furnished(built, ("shape",), STEP))

    @cache
    def measured(command: str, group: str) -> tuple[float, float]:
        kinds, run = GROUPS[group], COMMANDS[command]
        prims = STEP * len(kinds)
        first, second, third = (
            calls_of(run, furnished(built, kinds, count * STEP)) for count in (1, 2, 3)
        )
        return (second - first) / prims, (third - second) / prims

    return measured


@pytest.mark.parametrize("command", COMMANDS)
def test_a_prim_that_no_rule_asks_about_is_only_noted(
    command: str, steps: Callable[[str, str], tuple[float, float]]
) -> None:
    assert max(steps(command, "unasked")) < 5  # it is put into the index, and its name looked at


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("group", GROUPS)
def test_each_further_prim_costs_what_the_one_before_did(
    command: str, group: str, steps: Callable[[str, str], tuple[float, float]]
) -> None:
    second, third = steps(command, group)
    assert third <= 1.02 * second + 1  # a few calls are of no prim


def test_every_kind_stands_in_a_scene() -> None:
    assert sorted(kind for group in GROUPS.values() for kind in group) == sorted(KINDS)
