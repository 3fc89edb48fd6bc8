"""Things of a scene that a course asks for: number, schemas, materials, labels, values."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from in_process import invoke
from pxr import Sdf, Usd

from lab3_usd.errors import SpecError
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.props import PropSpec

HALL = """#usda 1.0
(
    defaultPrim = "Hall"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Hall"
{
    def Cube "Rack_1"
    {
    }
    def Cube "Rack_2"
    {
    }
    def Scope "Looks"
    {
        def Material "Steel"
        {
        }
    }
}
"""
PROPS = """
props:
  racks:
    path: /Hall/Rack_*
    type: Cube
    count: 2
    handout: B1
    apis: [PhysicsCollisionAPI, MaterialBindingAPI, "SemanticsLabelsAPI:class"]
    targets: {"material:binding": [/Hall/Looks/Steel]}
    set: {"semantics:labels:class": {type: "token[]", value: [rack, shelf]}}
    from: furnished
  bench: {path: /Hall/Bench, handout: B1, asset: props/bench.usda, resolved: true, from: furnished}
  lamp:
    path: /Hall/Lamp
    type: SphereLight
    handout: B2
    set: {"inputs:intensity": 900.0, "inputs:exposure": 0.0, visibility: inherited}
    from: furnished
  junk: {path: "/Hall/Junk_*", count: 0, handout: B2, from: furnished}
  bench_legs: {path: "/Hall/Leg_*", type: Cube, count: 1, handout: B2, from: furnished}
  bench_feet: {path: "/Hall/Leg_*", type: Sphere, count: 1, handout: B2, from: furnished}
"""
Change = Callable[[Usd.Stage], object]


def furnished(stage: Usd.Stage) -> None:
    """Do what the second milestone asks for."""
    for number in (1, 2):
        rack = stage.GetPrimAtPath(f"/Hall/Rack_{number}")
        rack.AddAppliedSchema("PhysicsCollisionAPI")
        rack.AddAppliedSchema("MaterialBindingAPI")
        rack.AddAppliedSchema(LABEL_SCHEMA)
        rack.CreateRelationship("material:binding").SetTargets([Sdf.Path("/Hall/Looks/Steel")])
        rack.CreateAttribute("semantics:labels:class", Sdf.ValueTypeNames.TokenArray).Set(
            ["shelf", "rack"]
        )
    stage.DefinePrim("/Hall/Bench", "Xform").GetReferences().AddReference("./props/bench.usda")
    lamp = stage.DefinePrim("/Hall/Lamp", "SphereLight")
    lamp.CreateAttribute("inputs:intensity", Sdf.ValueTypeNames.Float).Set(900.0)
    for name, kind in (("Leg_1", "Cube"), ("Leg_2", "Sphere")):
        stage.DefinePrim(f"/Hall/{name}", kind)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A lab of two milestones whose second one furnishes the hall, and its solutions."""
    (tmp_path / "props").mkdir()
    for name in ("bench", "shelf"):
        text = '#usda 1.0\n(defaultPrim = "A")\ndef Xform "A" {}\n'
        (tmp_path / "props" / f"{name}.usda").write_text(text)
    for name in ("empty", "furnished"):
        (tmp_path / f"hall_{name}.usda").write_text(HALL)
    stage = Usd.Stage.Open(str(tmp_path / "hall_furnished.usda"))
    furnished(stage)
    stage.Save()
    stages = (tmp_path / "hall_empty.usda", tmp_path / "hall_furnished.usda")
    told = invoke("lab", "new", tmp_path / "lab", *stages)
    assert told.exit_code == 0, told.output
    scene = tmp_path / "lab" / "scene.yaml"
    units = scene.read_text().replace("up_axis: Z,", "up_axis: Z, default_prim: Hall,")
    scene.write_text(units.partition("\nprops:")[0] + PROPS)
    return tmp_path


def found(folder: Path, name: str, change: Change) -> list[tuple[str, str, str | None]]:
    path = folder / f"hall_{name}.usda"
    stage = Usd.Stage.Open(str(path))
    change(stage)
    stage.Save()
    findings = check_stage(path, lab=load_lab(folder / "lab")).findings
    return [(each.rule, each.prim, each.property) for each in findings]


@pytest.mark.parametrize("name", ["empty", "furnished"])
def test_the_solutions_pass(folder: Path, name: str) -> None:
    assert found(folder, name, lambda _: None) == []


def bound_above(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(RACK).RemoveProperty(BINDING)
    stage.GetPrimAtPath("/Hall").CreateRelationship(BINDING).SetTargets(["/Hall/Looks/Steel"])


def test_a_material_may_be_bound_above(folder: Path) -> None:
    assert found(folder, "furnished", bound_above) == []


def refers_to(asset: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        references = stage.GetPrimAtPath("/Hall/Bench").GetReferences()
        references.ClearReferences()
        references.AddReference(asset)

    return change


def test_an_asset_of_the_right_name_that_is_not_there_is_said_once(folder: Path) -> None:
    change = refers_to("./lost/props/bench.usda")
    assert found(folder, "furnished", change) == [("S36", "/Hall/Bench", None)]


def without(path: str) -> Change:
    return lambda stage: stage.RemovePrim(path)


def bound_to(path: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        binding = stage.GetPrimAtPath("/Hall/Rack_1").GetRelationship("material:binding")
        binding.SetTargets([Sdf.Path(path)])

    return change


RACK = "/Hall/Rack_1"
LABEL_SCHEMA = "SemanticsLabelsAPI:class"
LABELS, BINDING = "semantics:labels:class", "material:binding"


def without_label(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(RACK).RemoveAppliedSchema(LABEL_SCHEMA)
    stage.GetPrimAtPath(RACK).RemoveProperty(LABELS)


MISTAKES: dict[str, tuple[Change, tuple[str, str, str | None]]] = {
    "too few": (without("/Hall/Rack_2"), ("S36", "/Hall/Rack_*", None)),
    "too many": (
        lambda stage: stage.DefinePrim("/Hall/Rack_3", "Cube"),
        ("S36", "/Hall/Rack_*", None),
    ),
    "another type": (
        lambda s: s.GetPrimAtPath("/Hall/Lamp").SetTypeName("DiskLight"),
        ("S36", "/Hall/Lamp", None),
    ),
    "another asset": (refers_to("./props/shelf.usda"), ("S36", "/Hall/Bench", None)),
    "an asset of another folder": (refers_to("./bench.usda"), ("S36", "/Hall/Bench", None)),
    "no lamp": (without("/Hall/Lamp"), ("S36", "/Hall/Lamp", None)),
    "another material": (bound_to("/Hall/Looks/Wood"), ("S36", RACK, BINDING)),
    "no schema": (
        lambda stage: stage.GetPrimAtPath(RACK).RemoveAppliedSchema("PhysicsCollisionAPI"),
        ("S36", RACK, "PhysicsCollisionAPI"),
    ),
    "no label at all": (without_label, ("S36", RACK, LABEL_SCHEMA)),
    "another label": (
        lambda stage: stage.GetPrimAtPath(RACK).GetAttribute(LABELS).Set(["shelf"]),
        ("S36", RACK, LABELS),
    ),
    "a dark lamp": (
        lambda stage: stage.GetPrimAtPath("/Hall/Lamp").GetAttribute("inputs:intensity").Set(9.0),
        ("S36", "/Hall/Lamp", "inputs:intensity"),
    ),
    "what is not to be there": (
        lambda stage: stage.DefinePrim("/Hall/Junk_1", "Cube"),
        ("S36", "/Hall/Junk_*", None),
    ),
    "another default prim": (lambda stage: stage.ClearDefaultPrim(), ("S02", "/", "defaultPrim")),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_mistake_is_found_once(folder: Path, mistake: str) -> None:
    change, expected = MISTAKES[mistake]
    assert found(folder, "furnished", change) == [expected]


@pytest.mark.parametrize(
    ("mistake", "hint"),
    [
        ("too few", "add a prim of type Cube at /Hall/Rack_*"),
        ("too many", "delete 1 of the prims at /Hall/Rack_*"),
        ("another asset", "let /Hall/Bench refer to props/bench.usda"),
        ("another material", f"set {BINDING} of {RACK} to /Hall/Looks/Steel"),
        ("no schema", f"apply PhysicsCollisionAPI to {RACK}"),
        (
            "no label at all",
            f"apply {LABEL_SCHEMA} to {RACK}, and set {LABELS} of {RACK} to ['rack', 'shelf']",
        ),
    ],
)
def test_the_hint_says_what_to_set_on_which_prim(folder: Path, mistake: str, hint: str) -> None:
    found(folder, "furnished", MISTAKES[mistake][0])
    findings = check_stage(folder / "hall_furnished.usda", lab=load_lab(folder / "lab")).findings
    assert hint in [each.hint for each in findings]


def test_of_two_types_at_one_path_each_number_is_told(folder: Path) -> None:
    told = found(folder, "furnished", lambda s: s.GetPrimAtPath("/Hall/Leg_2").SetTypeName("Cube"))
    assert [each for each in told if each[0] == "S36"] == [("S36", "/Hall/Leg_*", None)] * 2


def test_what_a_milestone_adds_is_built(folder: Path) -> None:
    out = folder / "built"
    made = invoke("--lab", folder / "lab", "build", "--out", out, "--through", "furnished")
    assert made.exit_code == 0, made.output
    stage = Usd.Stage.Open(str(out / "hall_furnished.usda"))
    assert stage.GetPrimAtPath("/Hall/Lamp").GetAttribute("inputs:intensity").Get() == 900.0
    for number in (1, 2):
        rack = stage.GetPrimAtPath(f"/Hall/Rack_{number}")
        assert rack.GetAttribute(LABELS).Get() == ["rack", "shelf"]
    assert "@props/bench.usda@" in (out / "hall_furnished.usda").read_text()


def test_what_a_milestone_adds_is_no_change_of_the_starter(folder: Path) -> None:
    starter, stage = folder / "hall_empty.usda", folder / "hall_furnished.usda"
    told = invoke("--lab", folder / "lab", "check", "--starter", starter, stage, "--quiet")
    assert told.exit_code == 0, told.output


def test_a_reference_that_cannot_be_found_is_an_error_where_the_course_says_so(
    folder: Path,
) -> None:
    scene = folder / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().replace("    type: Cube\n", "    resolved: true\n"))

    def refers(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(RACK).GetReferences().AddReference("./gone.usd")

    told = [each for each in found(folder, "furnished", refers) if each[0] == "S36"]
    assert told == [("S36", RACK, None)]


@pytest.mark.parametrize("path", ["Hall/Bench", "/", "/Hall//Bench", "/Hall/"])
def test_a_path_that_no_prim_can_have_is_refused(folder: Path, path: str) -> None:
    scene = folder / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().replace("/Hall/Bench,", f"{path},"))
    with pytest.raises(SpecError, match="is not the absolute path of a prim"):
        load_lab(folder / "lab")


def test_several_things_have_a_path_with_a_star(folder: Path) -> None:
    scene = folder / "lab" / "scene.yaml"
    scene.write_text(
        scene.read_text().replace("path: /Hall/Bench,", "path: /Hall/Bench, count: 2,")
    )
    with pytest.raises(SpecError, match="2 things have one path"):
        load_lab(folder / "lab")


def test_a_milestone_that_is_not_there_is_named_where_a_thing_comes_from_it(folder: Path) -> None:
    scene = folder / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().replace("from: furnished", "from: furnshed", 1))
    with pytest.raises(SpecError, match="props: racks: from: there is no checkpoint 'furnshed'"):
        load_lab(folder / "lab")


# What `lab check` says of props: what is written instead, its words, and the text at its place.
DESCRIBED = {
    "a target": (
        ("[/Hall/Looks/Steel]}", "[/Hall/Looks/Stel]}"),
        "'/Hall/Looks/Stel' is not a prim, '/Hall/Looks/Steel' is",
        "/Hall/Looks/Stel",
    ),
    "a path that nothing makes": (
        ("junk: {", "foot: {path: /Hall/Bnch, handout: B2, from: furnished}\n  junk: {"),
        "'/Hall/Bnch' is not a prim, '/Hall/Bench' is; `build` makes what has a `type`",
        "/Hall/Bnch",
    ),
    "a path beside another that nothing makes": (
        (
            "junk: {",
            """foot: {path: /Hall/Bnch, handout: B2, from: furnished}
  feet: {path: /Hall/Bnchs, count: 0, handout: B2, from: furnished}
  junk: {""",
        ),
        "'/Hall/Bnch' is not a prim, '/Hall/Bench' is; `build` makes what has a `type`",
        "/Hall/Bnch",
    ),
    "an asset": (
        ("props/bench.usda", "props/banch.usda"),
        "there is no file 'props/banch.usda', 'props/bench.usda' is there",
        "props/banch.usda",
    ),
    "a schema": (
        ("[PhysicsCollisionAPI, Mat", "[PhysicsColisionAPI, Mat"),
        "racks: apis: 'PhysicsColisionAPI' is not known, 'PhysicsCollisionAPI' is",
        "PhysicsColisionAPI",
    ),
    "an attribute": (
        ('"inputs:intensity": 900.0', '"inputs:intensty": 900.0'),
        "'inputs:intensty' is not known to USD here, did you mean inputs:intensity?",
        '"inputs:intensty"',
    ),
}


@pytest.mark.parametrize("mistake", DESCRIBED)
def test_a_mistake_in_the_description_is_said_at_its_place(folder: Path, mistake: str) -> None:
    (written, instead), told, pointed = DESCRIBED[mistake]
    scene = folder / "lab" / "scene.yaml"
    (folder / "props").rename(folder / "lab" / "props")
    scene.write_text(scene.read_text().replace(written, instead, 1))
    (said,) = _said_of_props(folder)
    assert told in said
    file, number, column = said.rpartition(", at ")[2].rsplit(":", 2)
    text = Path(file).read_text().splitlines()[int(number) - 1][int(column) - 1 :]
    assert text.startswith(pointed), (said, text)


def _said_of_props(folder: Path, *options: str | Path) -> list[str]:
    try:
        lines = invoke("lab", "check", folder / "lab", *options).output.splitlines()
    except SpecError as error:
        return [str(error)]
    return [line for line in lines if "props: " in line and "bench_legs" not in line]


def test_nothing_is_said_of_things_that_agree(folder: Path) -> None:
    assert _said_of_props(folder, "--from", folder / "hall_furnished.usda") == []


def test_another_asset_than_that_of_a_stage_is_said(folder: Path) -> None:
    scene = folder / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().replace("props/bench.usda", "props/banch.usda"))
    (said,) = _said_of_props(folder, "--from", folder / "hall_furnished.usda")
    assert "/Hall/Bench does not refer to 'props/banch.usda', but to './props/bench.usda'" in said


def test_nothing_is_built_under_a_name_that_no_prim_can_have() -> None:
    assert PropSpec("/Hall/Rack_*/*", handout="", count=2).places(()) == ()


def test_nothing_is_built_where_there_are_more_things_than_asked_for() -> None:
    prop = PropSpec("/Hall/Bench_*", handout="", count=3)
    there = ("/Hall/Bench_a", "/Hall/Bench_b", "/Hall/Bench_c", "/Hall/Bench_d")
    assert prop.places(there) == there
