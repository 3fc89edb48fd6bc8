"""How much a check and a lint do for each further prim of a scene.

Calls of Python functions are counted, which are the same on every machine: nothing is timed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FrameType

import pytest
from pxr import Sdf, Usd

from lab3_usd.check.checker import judge
from lab3_usd.pipeline.lint import lint_open_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.reader import read_model
from lab3_usd.stage.write.builder import build_checkpoint

LAB = load_lab()
CHECKPOINT = LAB.checkpoints["05"]
STEP = 8  # prims
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
COMMANDS: dict[str, Callable[[Usd.Stage], object]] = {
    "check": lambda stage: judge(LAB, CHECKPOINT, read_model(stage, LAB.platform, "stage")),
    "lint": lint_open_stage,
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_checkpoint(None, "05", tmp_path_factory.mktemp("large") / "stage.usda")


def furnished(built: Path, kind: str, count: int) -> Usd.Stage:
    """Return a correct stage with so many more prims of a kind, in a group for each step."""
    layer = Sdf.Layer.OpenAsAnonymous(str(built))
    type_name, schemas = KINDS[kind]
    with Sdf.ChangeBlock():
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
        command(furnished(built, "shape", STEP))

    @cache
    def measured(command: str, kind: str) -> tuple[float, float]:
        first, second, third = (
            calls_of(COMMANDS[command], furnished(built, kind, count * STEP)) for count in (1, 2, 3)
        )
        return (second - first) / STEP, (third - second) / STEP

    return measured


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("kind", ["shape", "mesh"])
def test_a_prim_that_no_rule_asks_about_is_only_noted(
    command: str, kind: str, steps: Callable[[str, str], tuple[float, float]]
) -> None:
    assert max(steps(command, kind)) < 5  # it is put into the index, and its name looked at


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("kind", KINDS)
def test_each_further_prim_costs_what_the_one_before_did(
    command: str, kind: str, steps: Callable[[str, str], tuple[float, float]]
) -> None:
    second, third = steps(command, kind)
    assert third <= 1.05 * second + 1
