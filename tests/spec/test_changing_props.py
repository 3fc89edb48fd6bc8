"""Things of a scene that change, are connected, stand somewhere, are hidden or have a type."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from shutil import copy, copytree

import pytest
from in_process import invoke
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from lab3_usd.errors import SpecError
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.props import PlaceSpec, PropSpec

HALL = """#usda 1.0
(
    defaultPrim = "Hall"
    metersPerUnit = 0.01
    kilogramsPerUnit = 1
    upAxis = "Y"
)
def Xform "Hall"
{
    def PhysicsScene "Physics"
    {
        vector3f physics:gravityDirection = (0, -1, 0)
        float physics:gravityMagnitude = 981
    }
    def Xform "Goods"
    {
        double3 xformOp:translate = (100, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "Room"
    {
        def SphereLight "Lamp"
        {
            float inputs:intensity = 500
        }
    }
}
"""
PROPS = """
props:
  lamp:
    path: /Hall/Room/Lamp
    type: SphereLight
    handout: B1
    set: {"inputs:intensity": 1500}
    until: {"2": {set: {"inputs:intensity": 500}}}
  crate:
    path: /Hall/Goods/Crate
    type: Cube
    handout: B2
    place: {x: 3, z: -1, within: 0.05}
    targets: {"material:binding": [/Hall/Looks/Steel]}
    set: {size: 40, visibility: inherited, "semantics:labels:class": [crate]}
    apis: ["SemanticsLabelsAPI:class"]
    variants: {finish: red}
    from: "2"
    until: {"2": {place: {x: 2, z: -1, within: 0.05}}}
  post:
    path: /Hall/Room/Post
    type: Cube
    handout: B4
    set:
      "xformOp:translate": [0, 100, 0]
      "xformOp:rotateXYZ": [0, 90, 0]
      "xformOp:scale": [1, 2, 1]
    from: "2"
  gravity:
    path: /Hall/Physics
    type: PhysicsScene
    handout: B5
    set: {"physics:gravityDirection": [0, -1, 0]}
  steel:
    path: /Hall/Looks/Steel
    type: Material
    handout: B3
    targets: {"outputs:surface": [/Hall/Looks/Steel/Surface.outputs:surface]}
    from: "2"
  surface:
    path: /Hall/Looks/Steel/Surface
    type: Shader
    handout: B3
    set: {"info:id": UsdPreviewSurface, "inputs:roughness": 0.3}
    targets: {"inputs:diffuseColor": [/Hall/Looks/Steel/Texture.outputs:rgb]}
    from: "2"
  texture:
    path: /Hall/Looks/Steel/Texture
    type: Shader
    handout: B3
    set: {"info:id": UsdUVTexture, "inputs:file": steel.png}
    from: "2"
"""
Change = Callable[[Usd.Stage], object]
LAMP, CRATE, POST = "/Hall/Room/Lamp", "/Hall/Goods/Crate", "/Hall/Room/Post"
STEEL, SURFACE = "/Hall/Looks/Steel", "/Hall/Looks/Steel/Surface"
GRAVITY = "/Hall/Physics.physics:gravityDirection"
LABELS = "semantics:labels:class"


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lab of three milestones, and the stages that it builds of the first one."""
    folder = tmp_path_factory.mktemp("course")
    names = [folder / f"hall_{number}.usda" for number in (1, 2, 3)]
    for path in names:
        path.write_text(HALL)
    (folder / "steel.png").touch()
    told = invoke("lab", "new", folder / "lab", *names)
    assert told.exit_code == 0, told.output
    scene = folder / "lab" / "scene.yaml"
    scene.write_text(scene.read_text().partition("\nprops:")[0] + PROPS)
    made = invoke("--lab", folder / "lab", "build", "--out", folder / "built")
    assert made.exit_code == 0, made.output
    (folder / "built" / "steel.png").touch()
    return folder


def built(course: Path, number: int) -> Usd.Stage:
    return Usd.Stage.Open(str(course / "built" / f"hall_{number}.usda"))


def told(course: Path, number: int, change: Change) -> list[tuple[str, str, str]]:
    """What is found of a built stage with a change: severity, prim and message of each."""
    path = course / "built" / f"changed_{number}.usda"
    copy(course / "built" / f"hall_{number}.usda", path)
    stage = Usd.Stage.Open(str(path))
    change(stage)
    stage.Save()
    findings = check_stage(path, str(number), load_lab(course / "lab")).findings
    return [(each.severity, each.prim, each.message) for each in findings]


def origin(stage: Usd.Stage) -> Gf.Vec3d:
    place = UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath(CRATE))
    return place.ExtractTranslation()


def test_what_changes_at_a_milestone_is_built(course: Path) -> None:
    first, second, third = (built(course, number) for number in (1, 2, 3))
    lamps = [s.GetAttributeAtPath(f"{LAMP}.inputs:intensity") for s in (first, second, third)]
    assert [lamp.Get() for lamp in lamps] == [500, 500, 1500]
    assert [origin(second), origin(third)] == [(200, 0, -100), (300, 0, -100)]


def test_materials_are_built_with_their_network(course: Path) -> None:
    stage = built(course, 2)
    binding = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(CRATE))
    shader, *_ = binding.ComputeBoundMaterial()[0].ComputeSurfaceSource()
    assert str(shader.GetPath()) == SURFACE
    colour = shader.GetInput("diffuseColor")
    assert (colour.GetTypeName(), colour.HasConnectedSource()) == ("color3f", True)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_built_stages_pass(course: Path, number: int) -> None:
    assert told(course, number, lambda _: None) == []


def shines(strength: float) -> Change:
    return lambda stage: stage.GetAttributeAtPath(f"{LAMP}.inputs:intensity").Set(strength)


def hides(path: str) -> Change:
    return lambda stage: UsdGeom.Imageable(stage.GetPrimAtPath(path)).MakeInvisible()


def moves(stage: Usd.Stage) -> None:
    goods = stage.GetPrimAtPath("/Hall/Goods").GetAttribute("xformOp:translate")
    goods.Set(Gf.Vec3d(110, 70, 0))


def writes_strings(stage: Usd.Stage) -> None:
    prim = stage.GetPrimAtPath(CRATE)
    prim.RemoveProperty(LABELS)
    spec = Sdf.CreatePrimInLayer(stage.GetRootLayer(), CRATE)
    Sdf.AttributeSpec(spec, LABELS, Sdf.ValueTypeNames.StringArray).default = ["crate"]


def bound_stronger(stage: Usd.Stage) -> None:
    wood = UsdShade.Material.Define(stage, "/Hall/Looks/Wood")
    goods = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/Hall/Goods"))
    goods.Bind(wood, UsdShade.Tokens.strongerThanDescendants)


def placed_by_a_matrix(stage: Usd.Stage, width: float = 1) -> None:
    post = UsdGeom.Xformable(stage.GetPrimAtPath(POST))
    for operation in post.GetOrderedXformOps():
        stage.GetPrimAtPath(POST).RemoveProperty(operation.GetName())
    turn = Gf.Matrix4d().SetRotate(Gf.Rotation((0, 1, 0), 90))
    size = Gf.Matrix4d().SetScale((width, 2, 1))
    post.MakeMatrixXform().Set(size * turn * Gf.Matrix4d().SetTranslate((0, 100, 0)))


MISTAKES: dict[str, tuple[int, Change, tuple[str, str, str]]] = {
    "too bright before": (
        2,
        shines(1500),
        ("error", LAMP, "inputs:intensity of Lamp is 1500, expected 500"),
    ),
    "too dark after": (
        3,
        shines(500),
        ("error", LAMP, "inputs:intensity of Lamp is 500, expected 1500"),
    ),
    "hidden with the room": (
        3,
        hides("/Hall/Goods"),
        ("error", CRATE, "Crate is hidden by /Hall/Goods, whose visibility is invisible"),
    ),
    "hidden": (
        3,
        hides(CRATE),
        ("error", CRATE, "visibility of Crate is 'invisible', expected 'inherited'"),
    ),
    "moved with the room": (
        3,
        moves,
        (
            "error",
            CRATE,
            "Crate stands at x 3.1, z -1 in the world, expected x 3, z -1 m, give or take 0.05",
        ),
    ),
    "not connected": (
        2,
        lambda s: s.GetPrimAtPath(STEEL).GetAttribute("outputs:surface").ClearConnections(),
        (
            "error",
            STEEL,
            f"outputs:surface of Steel is connected to nothing, expected {SURFACE}.outputs:surface",
        ),
    ),
    "labels of another type": (
        2,
        writes_strings,
        ("error", CRATE, f"{LABELS} of Crate is written as string[], and is read as token[]"),
    ),
    "another material from above": (
        2,
        bound_stronger,
        (
            "error",
            CRATE,
            "material:binding of Crate is /Hall/Looks/Wood, expected /Hall/Looks/Steel",
        ),
    ),
    "another variant": (
        2,
        lambda s: s.GetPrimAtPath(CRATE).GetVariantSets().SetSelection("finish", "white"),
        ("error", CRATE, "the finish of Crate is 'white', expected the variant 'red'"),
    ),
    "a binding without its schema": (
        2,
        lambda s: s.GetPrimAtPath(CRATE).RemoveAppliedSchema("MaterialBindingAPI"),
        (
            "warning",
            CRATE,
            "Crate binds a material without MaterialBindingAPI, which usdchecker refuses",
        ),
    ),
    "a place without an order": (
        2,
        lambda s: UsdGeom.Xformable(s.GetPrimAtPath(POST)).SetXformOpOrder(
            UsdGeom.Xformable(s.GetPrimAtPath(POST)).GetOrderedXformOps()[1:]
        ),
        (
            "error",
            POST,
            "xformOp:translate of Post has no effect: xformOpOrder does not name it",
        ),
    ),
    "a wrong size in a matrix": (
        2,
        lambda s: placed_by_a_matrix(s, 3),
        ("error", POST, "xformOp:scale of Post is not set, expected [1, 2, 1]"),
    ),
    "gravity aside": (
        2,
        lambda s: s.GetAttributeAtPath(GRAVITY).Set(Gf.Vec3f(1, -1, 0)),
        (
            "error",
            "/Hall/Physics",
            "physics:gravityDirection of Physics is [1, -1, 0], expected [0, -1, 0]",
        ),
    ),
    "metres in a stage of centimetres": (
        2,
        lambda s: s.GetAttributeAtPath(f"{CRATE}.size").Set(0.4),
        ("error", CRATE, "size of Crate is 0.4, expected 40 centimetres"),
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_mistake_is_told_once(course: Path, mistake: str) -> None:
    number, change, expected = MISTAKES[mistake]
    assert told(course, number, change) == [expected]


def test_a_place_may_be_written_as_a_matrix(course: Path) -> None:
    assert told(course, 2, placed_by_a_matrix) == []


TURNS = {  # of the post by a quarter turn about Y, in the words of other operations
    "rotateY": 90.0,
    "rotateZXY": [0.0, 90.0, 0.0],
    "orient": [0.7071067811865476, 0.0, 0.7071067811865476, 0.0],
}


@pytest.mark.parametrize("operation", TURNS)
@pytest.mark.parametrize("is_turned", [True, False])
def test_a_turn_may_be_asked_for_by_any_operation(
    course: Path, tmp_path: Path, operation: str, *, is_turned: bool
) -> None:
    copytree(course / "lab", tmp_path / "lab")
    scene = tmp_path / "lab" / "scene.yaml"
    asked = f'"xformOp:{operation}": {TURNS[operation]}'
    scene.write_text(scene.read_text().replace('"xformOp:rotateXYZ": [0, 90, 0]', asked))
    lab, stage = load_lab(tmp_path / "lab"), tmp_path / "hall_2.usda"

    def told() -> list[str | None]:
        found = check_stage(stage, "2", lab).findings
        return [each.property for each in found if each.prim == POST]

    assert invoke("--lab", lab.folder, "build", "--out", tmp_path, "--only", "2").exit_code == 0
    assert told() == []
    copy(course / "built" / "hall_2.usda", stage)
    if not is_turned:
        stage.write_text(stage.read_text().replace("(0, 90, 0)", "(0, 80, 0)"))
    assert told() == ([] if is_turned else [f"xformOp:{operation}"])


def test_the_direction_of_gravity_may_have_any_length(course: Path) -> None:
    assert told(course, 2, lambda s: s.GetAttributeAtPath(GRAVITY).Set(Gf.Vec3f(0, -3, 0))) == []


def test_a_material_is_connected_again(course: Path) -> None:
    assert told(course, 2, MISTAKES["not connected"][1])
    stage = course / "built" / "changed_2.usda"
    invoke("--lab", course / "lab", "fix", "--in-place", "--no-orig", stage, "--checkpoint", "2")
    assert check_stage(stage, "2", load_lab(course / "lab")).findings == ()


def test_what_a_milestone_changes_is_no_change_of_the_starter(course: Path) -> None:
    starter, stage = course / "built" / "hall_1.usda", course / "built" / "hall_3.usda"
    result = invoke("--lab", course / "lab", "check", "--starter", starter, stage, "--quiet")
    assert result.exit_code == 0, result.output


def test_a_new_lab_describes_what_its_stages_add_and_change(course: Path, tmp_path: Path) -> None:
    stages = sorted((course / "built").glob("hall_*.usda"))
    said = invoke("lab", "new", tmp_path / "lab", *stages).output
    assert (said.count("pass, "), "left out" in said) == (3, False)
    props = load_lab(tmp_path / "lab").scene.props
    assert props["lamp"].until["2"].values == {"inputs:intensity": 500}
    assert props["crate"].variants == {"finish": "red"}
    assert props["crate"].until["2"].place == PlaceSpec(2.0, 0.0, -1.0)
    assert props["steel"].connections == {"outputs:surface": (f"{SURFACE}.outputs:surface",)}
    assert props["surface"].values["inputs:roughness"] == 0.3


def furnished(folder: Path, turns: tuple[float, float]) -> str:
    """Write a hall and, after it, one with two lamps and a post; return the second's things."""
    names = [folder / f"hall_{number}.usda" for number in (1, 2)]
    for path in names:
        path.write_text(HALL)
    stage = Usd.Stage.Open(str(names[1]))
    for number, turn in enumerate(turns):
        lamp = UsdGeom.Xformable(stage.DefinePrim(f"/Hall/Lamp_{number}", "RectLight"))
        lamp.AddTranslateOp().Set((100 * number, 300, 0))
        lamp.AddRotateXOp().Set(turn)
    post = UsdGeom.Xformable(stage.DefinePrim(POST, "Cube"))
    post.AddOrientOp().Set(Gf.Quatf(0, 0, 1, 0))
    stage.Save()
    return invoke("lab", "new", folder / "lab", *names).output


def described(folder: Path, path: str) -> PropSpec:
    props = load_lab(folder / "lab").scene.props.values()
    return next(prop for prop in props if prop.path == path)


def test_turns_are_described_and_sections_are_of_the_milestone(tmp_path: Path) -> None:
    said = furnished(tmp_path, (-90, -90))
    assert "left out: scene.yaml: props: places of /Hall/Lamp_*\n" in said
    lamps, post = described(tmp_path, "/Hall/Lamp_*"), described(tmp_path, POST)
    assert list(lamps.values["xformOp:rotateXYZ"]) == [-90, 0, 0]
    assert [abs(each) for each in post.values["xformOp:rotateXYZ"]] == [180, 0, 180]
    assert (lamps.handout, post.handout) == ("B1", "B1")
    assert said.count("pass, ") == 2


def test_turns_that_differ_in_a_group_are_said_to_be_left_out(tmp_path: Path) -> None:
    said = furnished(tmp_path, (-90, 0))
    assert "left out: scene.yaml: props: places and turns of /Hall/Lamp_*\n" in said
    assert "xformOp:rotateXYZ" not in described(tmp_path, "/Hall/Lamp_*").values


REFUSED = {
    "a prim for an output": (
        f"{SURFACE}.outputs:surface",
        SURFACE,
        "an output is connected to a property",
    ),
    "a value for an output": (
        "inputs:roughness",
        "outputs:out",
        "what it is connected to, as 0.3, is one of `targets`",
    ),
    "a place without axes": (
        "{x: 3, z: -1, within: 0.05}",
        "{within: 1}",
        "names none of x, y and z",
    ),
    "a milestone that is not there": ('"2": {set', '"9": {set', "there is no checkpoint '9'"),
    "the last milestone": ('"2": {set', '"3": {set', "no later checkpoint changes it"),
    "a milestone before the thing": ('"2": {place', '"1": {place', "which is later"),
    "another type than the schema's": (
        f'"{LABELS}": [crate]',
        f'"{LABELS}": {{type: "string[]", value: [crate]}}',
        "has the type token[], not string[]; leave the type out",
    ),
}


@pytest.mark.parametrize("mistake", REFUSED)
def test_what_no_thing_can_be_is_refused(course: Path, tmp_path: Path, mistake: str) -> None:
    right, wrong, message = REFUSED[mistake]
    copytree(course / "lab", tmp_path / "lab")
    scene = tmp_path / "lab" / "scene.yaml"
    text = scene.read_text()
    assert right in text
    scene.write_text(text.replace(right, wrong))
    try:
        said = invoke("lab", "check", tmp_path / "lab").output
    except SpecError as error:
        said = str(error)
    assert message in said
    assert "scene.yaml" in said
