"""A stage is read as it is asked: the same answers, little read, and nothing kept open."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path

import pytest
from in_process import invoke
from linting import add_failing_rule
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics

from lab3_usd.check.checker import judge
from lab3_usd.isaac.releases import BASE
from lab3_usd.model import stage as derived
from lab3_usd.model.prims import Prims
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read import colliders, opening, prims, stage_reader
from lab3_usd.stage.read.assets import EVERYTHING
from lab3_usd.stage.read.properties import AuthoredProperties
from lab3_usd.stage.read.stage_reader import read_model, read_stage
from lab3_usd.stage.write.builder import build_checkpoint
from lab3_usd.stage.write.starter import build_starter

LAB = load_lab()
FORM = LAB.platform.graph
LEFT_OUT = ["", "/", "//", "World", "/World/", "/World/../World", "/World.x", "/a b", "/World{v=a}"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_checkpoint(None, "05", tmp_path_factory.mktemp("built") / "Lab3_05_x.usda")


def odd(path: Path) -> Usd.Stage:
    """The stage with instances, prims that are off, and what the application makes for itself."""
    stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(path)))
    stage.DefinePrim("/Thing/part", "Cube").ApplyAPI(UsdPhysics.RigidBodyAPI)
    for name in ("/World/one", "/World/two"):
        prim = stage.DefinePrim(name, "Xform")
        prim.GetReferences().AddInternalReference("/Thing")
        prim.SetInstanceable(True)  # noqa: FBT003 - USD's signature
    stage.DefinePrim("/Render/Camera_1", "Camera")
    stage.DefinePrim("/Renderer/Camera_1", "Camera")
    stage.OverridePrim("/World/only_over")
    stage.DefinePrim("/World/off/below", "Cube")
    stage.GetPrimAtPath("/World/off").SetActive(False)  # noqa: FBT003 - USD's signature
    stage.DefinePrim("/World/stray", FORM.node_type)
    stage.DefinePrim("/World/stray/below", "Cube")
    return stage


def test_a_stage_that_is_kept_open_is_read_by_each_release(built: Path) -> None:
    with opening.kept_open():
        earlier, base = (read_stage(built, lint_platform(name)) for name in ("5.1", BASE))
        assert (earlier.platform.release, base.platform.release) == ("5.1", BASE)
        assert read_stage(built, lint_platform(BASE)) is base


def eager(stage: Usd.Stage, model: StageModel) -> Prims:
    """Every prim that counts, found by looking at each."""
    paths = [
        str(prim.GetPath())
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), EVERYTHING)
        if not prim.IsPseudoRoot() and prim.GetTypeName() != FORM.node_type
    ]
    return Prims({path: model.prims[path] for path in paths if not FORM.ignores(path)})


QUESTIONS: dict[str, Callable[[Prims], object]] = {
    "all": lambda asked: [*asked.values()],
    "a type": lambda asked: [*asked.of_type("Xform")],
    "joints": lambda asked: [*asked.of_type(lambda name: name.endswith("Joint"))],
    "bodies": lambda asked: [*asked.with_api("PhysicsRigidBodyAPI")],
    "two schemas": lambda asked: [*asked.with_api(lambda name: name.startswith("Physics"))],
    "a name": lambda asked: [*asked.named("Camera_1")],
    "names": lambda asked: [*asked.named(lambda name: "wheel" in name)],
    "below": lambda asked: [*asked.below("/turtlebot3_burger")],
    "below a node": lambda asked: [*asked.below("/World/stray")],
    "below an instance": lambda asked: [*asked.below("/World/two")],
    "below everything": lambda asked: [*asked.below("/")],
    "below nothing": lambda asked: [*asked.below("/nowhere")],
    "count": len,
}


@pytest.mark.parametrize("question", QUESTIONS.values(), ids=QUESTIONS)
def test_every_question_gets_the_answer_of_looking_at_each_prim(
    built: Path, question: Callable[[Prims], object]
) -> None:
    stage = odd(built)
    model = read_model(stage, LAB.platform, "x")
    assert isinstance(model.prims, Prims)
    expected = question(eager(stage, model))
    assert question(model.prims) == expected


def test_prims_are_there_by_their_own_paths_only(built: Path, subtests: pytest.Subtests) -> None:
    stage = odd(built)
    model = read_model(stage, LAB.platform, "x")
    (prototype,) = stage.GetPrototypes()
    assert f"{prototype.GetPath()}/part" not in model.prims
    for path in (*LEFT_OUT, "/Render/Camera_1", "/World/stray", "/World/off/below"):
        with subtests.test(path=path):
            assert path not in model.prims
    prototypes = [prim for prim in model.prims if "Prototype" in prim]
    assert prototypes == []
    for path in ("/World/two/part", "/Renderer/Camera_1", "/World/off", "/World/only_over"):
        with subtests.test(path=path):
            assert model.prims[path].path == path
            assert model.prims[path] is model.prims[path]
    assert not model.prims["/World/off"].present
    assert not model.prims["/World/only_over"].present


def test_of_a_large_scene_little_is_read(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(built)))
    for number in range(500):
        cube = UsdGeom.Cube.Define(stage, f"/Furniture/box_{number}")
        UsdPhysics.MassAPI.Apply(cube.GetPrim()).CreateMassAttr(1.0)
    read: list[str] = []
    properties = prims.AuthoredProperties

    def noted(prim: Usd.Prim) -> AuthoredProperties:
        read.append(str(prim.GetPath()))
        return properties(prim)

    monkeypatch.setattr(prims, "AuthoredProperties", noted)
    judge(LAB, LAB.checkpoints["05"], read_model(stage, LAB.platform, "x"))
    assert len(read) == len(set(read))
    assert not any(path.startswith("/Furniture") for path in read)


def test_a_file_that_changes_is_read_again(built: Path, tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05_x.usda"
    path.write_text(built.read_text())
    first = check_stage(path)
    assert Sdf.Layer.Find(str(path)) is None
    path.write_text(built.read_text().replace("OnPlaybackTick", "OnTick"))
    second = check_stage(path)
    assert (first.verdict, second.verdict) == ("pass", "fail")
    assert Sdf.Layer.Find(str(path)) is None


def test_a_model_holds_its_file_open_and_nothing_else_does(built: Path) -> None:
    model = read_stage(built, LAB.platform)
    [*model.prims.values()][-1].attributes  # noqa: B018 - which reads them
    [*model.colliders.below("/")]
    judge(LAB, LAB.checkpoints["05"], model)
    assert Sdf.Layer.Find(str(built)) is not None
    del model
    assert Sdf.Layer.Find(str(built)) is None


def test_what_is_derived_stays_with_the_model(built: Path) -> None:
    calls: list[StageModel] = []

    @derived.once_per_stage
    def count(stage: StageModel) -> int:
        calls.append(stage)
        return len(calls)

    one, other = (read_model(odd(built), LAB.platform, "x") for _ in range(2))
    assert [count(one), count(one), count(other), count(one)] == [1, 1, 2, 1]


def test_damage_that_shows_while_a_rule_reads_is_told_of_the_file(
    built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(prim: Usd.Prim) -> AuthoredProperties:
        raise Tf.ErrorException(f"{prim.GetPath()} has a property without a name")

    assert check_stage(built).verdict == "pass"
    monkeypatch.setattr(prims, "AuthoredProperties", damaged)
    result = check_stage(built)
    assert result.verdict == "unreadable"
    assert result.crashes == ()
    assert [finding.rule for finding in result.findings] == ["F01"]


@pytest.mark.usefixtures("own_rules")
def test_a_rule_that_fails_of_itself_is_still_a_crash(built: Path) -> None:
    add_failing_rule("S99", "stage", ValueError)
    result = check_stage(built)
    assert result.verdict == "fail"
    assert [crash.rule for crash in result.crashes] == ["S99"]


def rocks(depth: int, times: int = 1) -> Usd.Stage:
    """Collision groups in each other, with a turned mesh and a box at every depth."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    path = ""
    for level in range(depth):
        path += f"/group_{level}"
        group = UsdGeom.Xform.Define(stage, path)
        group.AddTranslateOp().Set(Gf.Vec3d(1, 0, 0))
        UsdPhysics.CollisionAPI.Apply(group.GetPrim())
        mesh = UsdGeom.Mesh.Define(stage, f"{path}/rock")
        mesh.AddRotateZOp().Set(45.0)
        mesh.GetPointsAttr().Set([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 2)] * times)
    return stage


@pytest.mark.parametrize("times", [1, 100])
def test_a_group_has_the_box_of_all_in_it(times: int) -> None:
    model = read_model(rocks(3, times), LAB.platform, "x")
    boxes = {each.path: each for each in model.colliders.below("/")}
    assert list(boxes) == ["/group_0", "/group_0/group_1", "/group_0/group_1/group_2"]
    half = 0.5**0.5
    for level, box in enumerate(boxes.values(), start=1):
        assert box.low == pytest.approx((level - half, 0, 0), abs=1e-6)
        assert box.high == pytest.approx((3 + half, 2 * half, 2), abs=1e-6)


@pytest.mark.parametrize("top", ["/", "/group_0/group_1/group_2"])
def test_no_shape_is_measured_twice(top: str, monkeypatch: pytest.MonkeyPatch) -> None:
    measured: list[str] = []
    around = colliders._world_box

    def noted(prim: Usd.Prim, path: str, places: object) -> object:
        measured.append(path)
        return around(prim, path, places)  # type: ignore[arg-type]

    monkeypatch.setattr(colliders, "_world_box", noted)
    model = read_model(rocks(40), LAB.platform, "x")
    [*model.colliders.below(top)]
    [*model.colliders.below("/")]
    meshes = [path for path in measured if path.endswith("rock")]
    assert len(meshes) == len(set(meshes)) == 40


class AskedColliders(colliders.StageColliders):
    """Colliders that count how often they look at a shape."""

    asked = 0

    def _shape_of(self, prim: Usd.Prim) -> object:
        self.asked += 1
        return super()._shape_of(prim)


def test_each_shape_is_looked_at_once_however_many_colliders_stand_above() -> None:
    model = read_model(rocks(40), LAB.platform, "x")
    asked = AskedColliders(model.prims, model.colliders._reader)
    assert len(asked.below("/")) == 40
    assert asked.asked == 2 * 40  # the groups, and a rock in each


@pytest.mark.parametrize(("extent", "is_read"), [("[(0, 0, 0), (2, 1, 1)]", 0), ("[]", 1)])
def test_points_of_a_mesh_are_read_where_no_extent_says_its_bounds(
    extent: str, is_read: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(
        f"""#usda 1.0
        (metersPerUnit = 1)
        def Mesh "rock" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {{
            float3[] extent = {extent}
            point3f[] points = [(0, 0, 0), (1, 1, 1), (0, 1, 0)]
            double3 xformOp:translate = (7, 0, 0)
            float xformOp:rotateZ = 90
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
        }}"""
    )
    measured: list[str] = []
    around = colliders._world_box

    def noted(prim: Usd.Prim, path: str, places: object) -> object:
        measured.append(path)
        return around(prim, path, places)  # type: ignore[arg-type]

    monkeypatch.setattr(colliders, "_world_box", noted)
    found = read_model(Usd.Stage.Open(layer), LAB.platform, "x").colliders
    [bounds] = found.bounds()
    assert len(measured) == is_read
    assert bounds.low == pytest.approx((6, 0, 0))
    assert bounds.high == pytest.approx((7, 1 if is_read else 2, 1))
    exact = found.measured("/rock")
    assert exact is not None
    assert exact.low == pytest.approx((6, 0, 0))
    assert exact.high == pytest.approx((7, 1, 1))


def test_points_of_no_shape_have_no_box() -> None:
    stage = rocks(1)
    for name, kind, values in (
        ("empty", Sdf.ValueTypeNames.Point3fArray, []),
        ("doubles", Sdf.ValueTypeNames.DoubleArray, [1.0, 2.0]),
    ):
        prim = stage.DefinePrim(f"/{name}", "Cloud")
        prim.CreateAttribute("points", kind).Set(values)
        prim.ApplyAPI(UsdPhysics.CollisionAPI)
    boxes = read_model(stage, LAB.platform, "x").colliders.below("/")
    assert [box.path for box in boxes] == ["/group_0"]


def test_shapes_are_below_a_prim_or_beside_it() -> None:
    stage = rocks(2)
    found = read_model(stage, LAB.platform, "x").colliders
    assert [each.path for each in found.beside("/group_0/group_1")] == ["/group_0"]
    assert list(found.beside("/group_0")) == []
    assert [each.path for each in found.below("/")] == ["/group_0", "/group_0/group_1"]


def test_prims_may_be_nested_as_deep_as_they_like() -> None:
    stage = Usd.Stage.CreateInMemory()
    path = "/a" * 1500
    stage.DefinePrim(path, "Cube").ApplyAPI(UsdPhysics.CollisionAPI)
    UsdPhysics.CollisionAPI.Apply(stage.GetPrimAtPath("/a"))
    model = read_model(stage, LAB.platform, "x")
    assert [each.path for each in model.colliders.below("/")] == ["/a", path]
    assert model.prims[path.rpartition("/")[0]].world is not None


@pytest.mark.parametrize("more", [(), ("--starter", "STARTER"), ("--format", "html")])
def test_a_command_reads_each_stage_once(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...]
) -> None:
    starter = tmp_path / "starter.usda"
    build_starter(starter)
    opened: list[str] = []
    read: list[str] = []
    open_first, read_first = opening.opener.get(), stage_reader._read_model

    def noted_open(path: Path) -> Usd.Stage:
        opened.append(path.name)
        return open_first(path)

    def noted_read(stage: Usd.Stage, lab: Lab, path: str) -> StageModel:
        read.append(Path(path).name)
        return read_first(stage, lab, path)

    monkeypatch.setattr(stage_reader, "_read_model", noted_read)
    token = opening.opener.set(noted_open)
    arguments = [str(starter) if each == "STARTER" else each for each in more]
    assert invoke("check", built, built, *arguments).exit_code == 0
    opening.opener.reset(token)
    names = [built.name, starter.name] if "--starter" in more else [built.name]
    assert (sorted(opened), sorted(read)) == (sorted(names), sorted(names))
    assert opening.reading_cache.get() is None
    gc.collect()  # a page's templates refer to each other in rings
    assert Sdf.Layer.Find(str(built)) is None
    assert Sdf.Layer.Find(str(starter)) is None


def test_only_the_last_stages_stay_open(built: Path, tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.usda" for name in "abc"]
    for path in paths:
        path.write_text(built.read_text())
    with opening.kept_open():
        models = [read_stage(path, LAB.platform) for path in paths]
        assert read_stage(paths[1], LAB.platform) is not models[1]  # forgotten with the first
        assert read_stage(paths[2], LAB.platform) is read_stage(paths[2], LAB.platform)
        del models
        assert Sdf.Layer.Find(str(paths[0])) is None
        assert Sdf.Layer.Find(str(paths[2])) is not None
    assert Sdf.Layer.Find(str(paths[2])) is None
