"""The walk through two stages: what is paired, gone and new, and how two prims differ raw."""

from __future__ import annotations

import pytest
from pxr import Sdf, Usd

from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.compare import pairs
from lab3_usd.stage.compare.pairs import (
    GonePrim,
    NewPrim,
    PairedPrim,
    PrimRecord,
    Scope,
    compare_prims,
    raw_differences,
    read_record,
    read_records,
)
from lab3_usd.stage.compare.scenes import scene_changes

EVERYTHING = Scope()


def stage_of(*paths: str) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    for path in paths:
        stage.DefinePrim(path, "Xform")
    return stage


def compared(before: Usd.Stage, after: Usd.Stage, scope: Scope = EVERYTHING) -> list[str]:
    signs = {GonePrim: "-", NewPrim: "+", PairedPrim: "="}
    return [
        f"{signs[type(prim)]}{prim.was.path if isinstance(prim, GonePrim) else prim.now.GetPath()}"
        for prim in compare_prims(read_records(before), after.GetPseudoRoot(), scope)
    ]


def raw(before: Usd.Stage, after: Usd.Stage) -> list[tuple[str, str, object, object, bool]]:
    was = read_records(before).children[0]
    return [
        (difference.kind, difference.name, difference.was, difference.now, difference.is_new)
        for difference in raw_differences(was, after.GetPrimAtPath(was.path))
    ]


def test_what_is_gone_or_new_stands_for_all_below_it() -> None:
    before, after = stage_of("/A/Old/Below", "/A/Same"), stage_of("/A/Same", "/A/New/Below")
    assert compared(before, after) == ["=/A", "-/A/Old", "+/A/New", "=/A/Same"]


def test_a_deactivated_prim_is_gone() -> None:
    before, after = stage_of("/A"), stage_of("/A")
    after.GetPrimAtPath("/A").SetActive(active=False)
    assert compared(before, after) == ["-/A"]


def test_a_prim_of_a_type_left_aside_is_in_neither_stage() -> None:
    before, after = stage_of("/A", "/B/C"), stage_of("/A", "/B/C")
    after.GetPrimAtPath("/B").SetTypeName("OmniGraph")
    scope = Scope(types=frozenset(["OmniGraph"]))
    assert compared(before, after, scope) == ["-/B", "=/A"]


def test_only_root_prims_are_left_aside_by_their_path() -> None:
    before = after = stage_of("/Kit_View", "/A/Kit_View")
    assert compared(before, after, Scope(roots=("/Kit_*",))) == ["=/A", "=/A/Kit_View"]


def test_what_a_missing_asset_may_hold_is_not_gone() -> None:
    before, after = stage_of("/A/Hidden/Over", "/A/Hidden/Absent", "/A/Gone"), stage_of("/A")
    after.OverridePrim("/A/Hidden/Over")
    scope = Scope(hidden=("/A/Hidden",))
    assert compared(before, after, scope) == ["=/A", "-/A/Gone", "=/A/Hidden", "=/A/Hidden/Over"]


def test_equal_prims_have_no_raw_differences() -> None:
    assert raw(stage_of("/A"), stage_of("/A")) == []


def test_types_schemas_values_and_targets_differ() -> None:
    before, after = stage_of("/A"), stage_of("/A")
    was, now = before.GetPrimAtPath("/A"), after.GetPrimAtPath("/A")
    now.SetTypeName("Cube")
    was.AddAppliedSchema("OldAPI")
    now.AddAppliedSchema("NewAPI")
    for prim, value in ((was, 1.0), (now, 2.0)):
        prim.CreateAttribute("number", Sdf.ValueTypeNames.Double).Set(value)
    was.CreateRelationship("link").SetTargets(["/B"])
    now.CreateRelationship("link").SetTargets(["/C"])
    assert raw(before, after) == [
        ("type", "", "Xform", "Cube", False),
        ("schema", "OldAPI", "OldAPI", None, False),
        ("schema", "NewAPI", None, "NewAPI", False),
        ("value", "number", 1.0, 2.0, False),
        ("targets", "link", [Sdf.Path("/B")], [Sdf.Path("/C")], False),
    ]


def test_a_property_that_only_the_second_stage_writes_is_new() -> None:
    before, after = stage_of("/A"), stage_of("/A")
    for stage in (before, after):
        stage.GetPrimAtPath("/A").SetTypeName("Cube")
    cube = after.GetPrimAtPath("/A")
    cube.GetAttribute("size").Set(2.0)
    cube.CreateAttribute("number", Sdf.ValueTypeNames.Double).Set(1.0)
    assert raw(before, after) == [
        ("value", "number", None, 1.0, True),
        ("value", "size", 2.0, 2.0, True),
    ]


def rooms(*sizes: float) -> Usd.Stage:
    """Instances of two rooms, each with a box; the sizes of the boxes."""
    stage = Usd.Stage.CreateInMemory()
    for number, size in enumerate(sizes):
        box = stage.DefinePrim(f"/Rooms/Room{number}/Box", "Cube")
        box.CreateAttribute("size", Sdf.ValueTypeNames.Double).Set(size)
        for place in range(3):
            prim = stage.DefinePrim(f"/House/Room{number}_{place}", "Xform")
            prim.GetReferences().AddInternalReference(f"/Rooms/Room{number}")
            prim.SetInstanceable(True)  # noqa: FBT003 - it takes no keyword
    stage.GetPrimAtPath("/Rooms").SetSpecifier(Sdf.SpecifierClass)
    return stage


def test_instances_of_equal_prototypes_are_compared_once(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []

    def counted(prim: Usd.Prim) -> PrimRecord:
        read.append(str(prim.GetPath()))
        return read_record(prim)

    monkeypatch.setattr(pairs, "read_record", counted)
    changes = scene_changes(rooms(1.0, 1.0), rooms(1.0, 2.0), load_lab(), str)
    assert [(change.path, change.property, change.now) for change in changes] == [
        (f"/House/Room1_{place}/Box", "size", "2") for place in range(3)
    ]
    assert [path for path in read if "Room0" in path and "Box" in path] == ["/House/Room0_0/Box"]
