"""Building on starters of every kind: what is kept, what is added, what is never written."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import forking
import pytest
from other_labs import LAB, LAST, files_below, in_force
from pxr import Sdf, Tf, Usd, UsdUtils
from scene_stages import deactivate, define, remove, several
from starters import (
    BASE_SCAN,
    COMMENT,
    ENVIRONMENT,
    OFFLINE,
    ROBOT,
    Change,
    another_environment,
    binary_starter,
    changed,
    extra_prims,
    layered_starter,
    offline_room,
    reordered,
    text_starter,
)

from lab3_usd.errors import NoRoomError, StageError, UsageError
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.write.builder import (
    BuildOptions,
    StarterError,
    build_checkpoint,
    build_files,
    export_layer,
    plan_files,
)

ALL = list(LAB.checkpoints)
FILES = [checkpoint.file for checkpoint in LAB.checkpoints.values()]
GRAPHS = [graph.path for graph in LAB.graphs.values()]
LIDAR = LAB.sensors["lidar"].path
FOOTPRINT = LAB.scene.robot.articulation.target
ADDED = [*GRAPHS, LIDAR]
LINKS = ("base_link", "base_scan", "caster_back_link", "wheel_left_link", "wheel_right_link")


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> Iterator[None]:
    with in_force():
        yield


def build(
    starter: Path | None, out: Path, numbers: list[str] | None = None, **options: Any
) -> list[Path]:
    chosen = BuildOptions(**options)
    return build_files(LAB, starter, plan_files(LAB, out, numbers or ALL, chosen.form), chosen)


def opened(file: Path) -> Usd.Stage:
    with quiet():
        return Usd.Stage.Open(str(file))


def packed(folder: Path) -> Path:
    layered = layered_starter(folder / "loose")
    file = folder / "scene.usdz"
    UsdUtils.CreateNewUsdzPackage(str(layered), str(file))
    return file


def searched(folder: Path) -> Path:
    """Refer to the robot without `./`, as a search path is written."""
    layered = layered_starter(folder, "robots/burger.usda")
    shutil.move(folder / "robots", folder / "scene" / "robots")
    return layered


def absolute(folder: Path) -> Path:
    return layered_starter(folder, str(folder / "robots" / "burger.usda"))


def text_as_usd(folder: Path) -> Path:
    return text_starter(folder / "scene.usda").rename(folder / "scene.usd")


def of(change: Change) -> Callable[[Path], Path]:
    return lambda folder: changed(folder / "scene.usda", change)


VARIANTS: dict[str, Callable[[Path], Path]] = {
    "text": lambda folder: text_starter(folder / "scene.usda"),
    "text under a binary name": text_as_usd,
    "binary": lambda folder: binary_starter(folder / "scene.usd"),
    "crate": lambda folder: binary_starter(folder / "scene.usdc"),
    "package": packed,
    "layered": layered_starter,
    "layered with an absolute path": absolute,
    "layered with a search path": searched,
    "other order": of(reordered),
    "other environment": of(another_environment),
    "more prims": of(extra_prims),
    "a room out of reach": of(offline_room),
}


@dataclass(frozen=True)
class Built:
    """A variant of the starter, its files before and after, and what was built on it."""

    starter: Path
    home: Path
    before: dict[str, str]
    after: dict[str, str]
    first: Path
    last: Path


@pytest.fixture(scope="module", params=VARIANTS)
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Built:
    home = tmp_path_factory.mktemp("lab")
    starter = VARIANTS[request.param](home / "given")
    before = files_below(home / "given")
    first, last = build(starter, home / "work" / "out", ["00", LAST])
    return Built(starter, home, before, files_below(home / "given"), first, last)


def properties(prim: Usd.Prim) -> dict[str, Any]:
    """What the composed prim says, with asset paths as what they lead to."""
    values: dict[str, Any] = {
        relationship.GetName(): [str(path) for path in relationship.GetTargets()]
        for relationship in prim.GetRelationships()
    }
    for attribute in prim.GetAttributes():
        value = attribute.Get()
        values[attribute.GetName()] = (
            value.resolvedPath if isinstance(value, Sdf.AssetPath) else value
        )
    return values


def composed(stage: Usd.Stage) -> Iterator[tuple[str, Usd.Prim]]:
    predicate = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), predicate):
        yield str(prim.GetPath()), prim


def is_added(path: str) -> bool:
    return any(path == root or path.startswith((f"{root}/", f"{root}.")) for root in ADDED)


def specs(layer: Sdf.Layer) -> dict[str, Sdf.Spec]:
    paths: list[Sdf.Path] = []
    layer.Traverse("/", paths.append)
    found = {str(path): layer.GetObjectAtPath(path) for path in paths}
    return {path: spec for path, spec in found.items() if spec is not None}


class TestEveryStarter:
    def test_carries_every_graph_and_sensor(self, built: Built) -> None:
        stage = opened(built.last)
        for path in ADDED:
            prim = stage.GetPrimAtPath(path)
            assert prim.IsActive()
            assert prim.IsDefined()
        nodes = sum(prim.GetTypeName() == "OmniGraphNode" for prim in stage.TraverseAll())
        assert nodes == sum(len(graph.nodes) for graph in LAB.graphs.values())

    def test_what_the_graphs_point_at_is_found_from_the_new_folder(self, built: Built) -> None:
        stage = opened(built.last)
        for path in (FOOTPRINT, LIDAR, *(f"{ROBOT}/{link}" for link in LINKS)):
            assert stage.GetPrimAtPath(path).IsDefined()

    def test_nothing_more_is_out_of_reach_than_was(self, built: Built) -> None:
        def complaints(file: Path) -> int:
            return len(opened(file).GetCompositionErrors())

        assert complaints(built.last) == complaints(built.starter)

    def test_the_scene_is_composed_as_before(self, built: Built) -> None:
        stage, start = opened(built.last), opened(built.starter)
        after = {path: prim for path, prim in composed(stage) if not is_added(path)}
        before = dict(composed(start))
        assert list(after) == list(before)
        for path, prim in before.items():
            assert prim.GetTypeName() == after[path].GetTypeName()
            assert prim.IsActive() == after[path].IsActive()
            assert properties(prim) == properties(after[path])

    def test_the_stage_is_measured_as_before(self, built: Built) -> None:
        stages = opened(built.starter), opened(built.last)
        before, after = (stage.GetPseudoRoot().GetAllMetadata() for stage in stages)
        for each in (before, after):
            each.pop("subLayers", None)
        assert before == after

    def test_nothing_is_flattened(self, built: Built) -> None:
        starter = Sdf.Layer.FindOrOpen(str(built.starter))
        layer = Sdf.Layer.FindOrOpen(str(built.last))
        assert len(layer.subLayerPaths) == len(starter.subLayerPaths)
        before = specs(starter)
        grown = [path for path in specs(layer) if path not in before]
        overs = [path for path in grown if not is_added(path)]
        for path in overs:
            assert layer.GetPrimAtPath(path).specifier == Sdf.SpecifierOver
            assert layer.GetPrimAtPath(path).typeName == ""
            assert any(root.startswith(f"{path}/") for root in ADDED)

    def test_what_the_starters_layer_says_is_said_unchanged(self, built: Built) -> None:
        starter = Sdf.Layer.FindOrOpen(str(built.starter))
        layer = Sdf.Layer.FindOrOpen(str(built.first))
        assert list(specs(layer)) == list(specs(starter))
        paths_move = {"references", "payload", "subLayers", "subLayerOffsets"}
        after = specs(layer)
        for path, spec in specs(starter).items():
            for key in set(spec.ListInfoKeys()) - paths_move:
                assert after[path].GetInfo(key) == spec.GetInfo(key)

    def test_the_files_of_the_starter_are_not_touched(self, built: Built) -> None:
        assert built.before == built.after

    def test_the_new_folder_holds_the_checkpoints_only(self, built: Built) -> None:
        assert list(files_below(built.last.parent)) == [f"{FILES[0]}.usda", f"{FILES[-1]}.usda"]


@pytest.fixture
def layered(tmp_path: Path) -> Path:
    return layered_starter(tmp_path / "given")


def assets_of(file: Path) -> list[str]:
    layer = Sdf.Layer.OpenAsAnonymous(str(file))
    return sorted(path for path in layer.GetCompositionAssetDependencies() if path)


def test_relative_paths_start_from_the_new_folder(layered: Path, tmp_path: Path) -> None:
    (built,) = build(layered, tmp_path / "deep" / "er", ["00"])
    assert assets_of(built) == [
        "../../given/robots/burger.usda",
        "../../given/scene/layers/base.usda",
        "../../given/scene/layers/environment.usda",
    ]


def test_in_the_starters_folder_paths_stay_as_they_are(layered: Path) -> None:
    (built,) = build(layered, layered.parent, ["00"])
    assert assets_of(built) == assets_of(layered)


def test_addresses_and_absolute_paths_stay_as_they_are(tmp_path: Path) -> None:
    starter = absolute(tmp_path / "given")
    stage = opened(starter)
    offline_room(stage)
    stage.GetRootLayer().Save()
    (built,) = build(starter, tmp_path / "out", ["00"])
    kept = {OFFLINE, str(tmp_path / "given" / "robots" / "burger.usda")}
    assert kept <= set(assets_of(built))


def asset_values(layer: Sdf.Layer, path: str) -> dict[str, str]:
    return {
        attribute.name: attribute.default.path for attribute in layer.GetPrimAtPath(path).attributes
    }


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("./floor.png", "../given/floor.png"),
        ("../floor.png", "../floor.png"),
        ("./tiles.<UDIM>.png", "../given/tiles.<UDIM>.png"),
        ("./box.usdz[floor.png]", "../given/box.usdz[floor.png]"),
        ("./späte Kiste/floor.png", "../given/späte Kiste/floor.png"),
        ("OmniPBR.mdl", "OmniPBR.mdl"),
        ("/textures/floor.png", "/textures/floor.png"),
        ("https://host.invalid/floor.png", "https://host.invalid/floor.png"),
        ("omniverse://host/floor.png", "omniverse://host/floor.png"),
        ("C:/textures/floor.png", "C:/textures/floor.png"),
        ("", ""),
    ],
)
def test_textures_are_found_from_the_new_folder(given: str, expected: str, tmp_path: Path) -> None:
    def paint(stage: Usd.Stage) -> None:
        prim = stage.DefinePrim("/World/Paint")
        prim.CreateAttribute("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(given))

    starter = changed(tmp_path / "given" / "scene.usda", paint)
    (built,) = build(starter, tmp_path / "out", ["00"])
    layer = Sdf.Layer.FindOrOpen(str(built))
    assert asset_values(layer, "/World/Paint") == {"file": expected}


def test_references_in_variants_are_found_from_the_new_folder(tmp_path: Path) -> None:
    def vary(stage: Usd.Stage) -> None:
        variants = stage.DefinePrim("/World/Prop").GetVariantSets().AddVariantSet("shape")
        variants.AddVariant("round")
        variants.SetVariantSelection("round")
        with variants.GetVariantEditContext():
            stage.GetPrimAtPath("/World/Prop").GetReferences().AddReference("./ball.usda")
        variants.SetVariantSelection("")

    starter = changed(tmp_path / "given" / "scene.usda", vary)
    (built,) = build(starter, tmp_path / "out", ["00"])
    assert assets_of(built) == ["../given/ball.usda"]


def test_a_linked_folder_leads_to_the_starters_files(layered: Path, tmp_path: Path) -> None:
    (tmp_path / "far" / "away").mkdir(parents=True)
    (tmp_path / "near").symlink_to(tmp_path / "far" / "away")
    (built,) = build(layered, tmp_path / "near", ["05"])
    assert opened(built).GetCompositionErrors() == []


def test_a_starter_below_a_linked_folder_leads_to_its_files(
    tmp_path: Path, subtests: pytest.Subtests
) -> None:
    (tmp_path / "far" / "away").mkdir(parents=True)
    (tmp_path / "near").symlink_to(tmp_path / "far" / "away")
    starter = layered_starter(tmp_path / "near" / "given")
    for out in (tmp_path / "out", starter.parent / "out"):
        with subtests.test(out=out):
            (built,) = build(starter, out, ["05"])
            assert opened(built).GetCompositionErrors() == []


def test_relative_arguments_work(
    layered: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(layered.parent)
    (built,) = build(Path("root.usda"), Path("../../out"), ["05"])
    monkeypatch.chdir(tmp_path)
    assert opened(tmp_path / "out" / built.name).GetCompositionErrors() == []


def test_comments_in_layers_that_are_not_written_survive(
    layered: Path, subtests: pytest.Subtests
) -> None:
    build(layered, layered.parent)
    for part in ("layers/base.usda", "layers/environment.usda", "../robots/burger.usda"):
        with subtests.test(part=part):
            assert COMMENT in (layered.parent / part).read_text()


# ---- what is written, and what never is


def test_the_starters_folder_may_be_the_output_folder(tmp_path: Path) -> None:
    starter = text_starter(tmp_path / "scene.usda")
    before = starter.read_bytes()
    build(starter, tmp_path)
    assert list(files_below(tmp_path)) == [*(f"{name}.usda" for name in FILES), "scene.usda"]
    assert starter.read_bytes() == before


def test_a_built_start_gives_the_same_files_again(tmp_path: Path) -> None:
    first = build(None, tmp_path / "first")
    second = build(first[0], tmp_path / "second")
    assert files_below(tmp_path / "first") == files_below(tmp_path / "second")
    assert second != first


def put_at(name: str) -> Callable[[Path], tuple[Path, Path]]:
    """A text starter that is itself called as a checkpoint."""

    def make(folder: Path) -> tuple[Path, Path]:
        starter = text_starter(folder / f"{name}.usda")
        return starter, starter

    return make


def layer_at(name: str, kind: str) -> Callable[[Path], tuple[Path, Path]]:
    """A starter of which one part is called as a checkpoint and lies in the output folder."""

    def make(folder: Path) -> tuple[Path, Path]:
        part = Sdf.Layer.CreateNew(str(folder / f"{name}.usda"))
        part.defaultPrim = Sdf.CreatePrimInLayer(part, "/Part").name
        part.Save()
        starter = text_starter(folder / "scene.usda")
        stage = opened(starter)
        refer(stage, kind, f"./{name}.usda")
        stage.GetRootLayer().Save()
        return starter, folder / f"{name}.usda"

    return make


def refer(stage: Usd.Stage, kind: str, path: str) -> None:
    if kind == "sublayer":
        stage.GetRootLayer().subLayerPaths.append(path)
        return
    prim = stage.DefinePrim("/World/Part")
    if kind == "variant":
        variants = prim.GetVariantSets().AddVariantSet("parts")
        variants.AddVariant("some")
        variants.SetVariantSelection("some")
        with variants.GetVariantEditContext():
            prim.GetReferences().AddReference(path)
        variants.SetVariantSelection("")
        return
    prim.GetReferences().AddReference(path)
    prim.SetActive(kind != "deactivated")


INPUTS = {
    "the starter": put_at("Lab3_00_student_start"),
    "a later checkpoint's name": put_at("Lab3_05_navigation"),
    "a sublayer": layer_at("Lab3_03_lidar", "sublayer"),
    "a referenced file": layer_at("Lab3_03_lidar", "referenced"),
    "a file of a variant not selected": layer_at("Lab3_03_lidar", "variant"),
    "a file of a deactivated prim": layer_at("Lab3_03_lidar", "deactivated"),
}


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("case", INPUTS)
def test_a_file_of_the_starter_is_never_written(case: str, force: bool, tmp_path: Path) -> None:  # noqa: FBT001 - a parameter
    starter, asset = INPUTS[case](tmp_path)
    before = files_below(tmp_path)
    with pytest.raises(UsageError) as refused:
        build(starter, tmp_path, force=force)
    assert str(asset) in str(refused.value)
    assert files_below(tmp_path) == before


def test_a_file_of_the_starter_is_not_written_through_a_linked_folder(tmp_path: Path) -> None:
    starter = text_starter(tmp_path / "given" / "Lab3_04_odometry_tf.usda")
    (tmp_path / "link").symlink_to(tmp_path / "given")
    with pytest.raises(UsageError):
        build(starter, tmp_path / "link", force=True)
    assert list(files_below(tmp_path / "given")) == ["Lab3_04_odometry_tf.usda"]


def test_a_file_of_the_starter_is_not_written_through_a_link(tmp_path: Path) -> None:
    starter = text_starter(tmp_path / "given" / "scene.usda")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "Lab3_02_ros_drive.usda").symlink_to(starter)
    with pytest.raises(UsageError):
        build(starter, tmp_path / "out", force=True)
    assert (tmp_path / "out" / "Lab3_02_ros_drive.usda").is_symlink()
    assert len(list((tmp_path / "out").iterdir())) == 1


@pytest.fixture
def one_there(tmp_path: Path) -> Path:
    (tmp_path / "Lab3_05_navigation.usda").write_text("mine\n")
    return tmp_path


def test_an_existing_file_is_kept_and_none_is_written(one_there: Path) -> None:
    with pytest.raises(UsageError) as refused:
        build(None, one_there)
    assert "Lab3_05_navigation.usda" in str(refused.value)
    assert [path.name for path in one_there.iterdir()] == ["Lab3_05_navigation.usda"]
    assert (one_there / "Lab3_05_navigation.usda").read_text() == "mine\n"


def test_an_existing_file_that_is_not_asked_for_is_no_obstacle(one_there: Path) -> None:
    build(None, one_there, ["00", "01"])
    assert (one_there / "Lab3_05_navigation.usda").read_text() == "mine\n"


def test_force_replaces_existing_files(one_there: Path) -> None:
    build(None, one_there, force=True)
    assert (one_there / "Lab3_05_navigation.usda").read_text().startswith("#usda")


def test_a_link_to_nowhere_counts_as_a_file(tmp_path: Path) -> None:
    (tmp_path / "Lab3_01_ros_clock.usda").symlink_to(tmp_path / "nowhere")
    with pytest.raises(UsageError):
        build(None, tmp_path)
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("force", [False, True])
def test_a_folder_under_a_checkpoints_name_is_no_file(force: bool, tmp_path: Path) -> None:  # noqa: FBT001 - a parameter
    (tmp_path / "Lab3_03_lidar.usda").mkdir()
    with pytest.raises(UsageError):
        build(None, tmp_path, force=force)
    assert [path.name for path in tmp_path.iterdir()] == ["Lab3_03_lidar.usda"]


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine\n")
    for out in (tmp_path / "out", tmp_path / "out" / "below"):
        with pytest.raises(UsageError, match=r"out: is a file, and a folder is needed"):
            build(None, out)
    assert (tmp_path / "out").read_text() == "mine\n"


# A limit on the size of a file is the full disk that a test can have.
FULL_DISK = """
import resource, sys
sys.dont_write_bytecode = True  # half a module would stay
from lab3_usd.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
sys.dont_write_bytecode = True  # a file of bytecode that is cut off would stay
sys.argv = ["lab3", "build", "--force", "--out", *sys.argv[2:]]
main()
"""


@pytest.mark.parametrize(
    ("form", "ending", "enough"), [("usda", ".usda", 25_000), ("usdc", ".usd", 10_000)]
)
def test_a_disk_that_fills_half_way_leaves_what_was_there(
    form: str, ending: str, enough: int, tmp_path: Path
) -> None:
    (tmp_path / f"{FILES[0]}{ending}").write_text("mine\n")
    command = [sys.executable, "-c", FULL_DISK, str(enough), str(tmp_path), "--format", form]
    done = forking.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"{FILES[0]}{ending}" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [f"{FILES[0]}{ending}"]
    assert (tmp_path / f"{FILES[0]}{ending}").read_text() == "mine\n"


def test_a_file_that_cannot_be_put_in_place_takes_the_others_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = Path.replace

    def refuse(self: Path, target: Path) -> Path:
        if target.name.startswith("Lab3_05"):
            raise PermissionError(1, "Operation not permitted")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(StageError) as failed:
        build(None, tmp_path)
    assert "Lab3_05" in str(failed.value)
    assert list(tmp_path.iterdir()) == []


class Stubborn:
    """A layer that usd-core cannot write, and says so in one of its two ways."""

    def __init__(self, *, raising: bool) -> None:
        self.raising = raising

    def Export(self, *_: object) -> bool:  # noqa: N802 - usd-core's name
        if self.raising:
            raise Tf.ErrorException
        return False

    def ExportToString(self) -> str:  # noqa: N802 - usd-core's name
        return "#usda 1.0"


@pytest.mark.parametrize("raising", [False, True])
def test_a_layer_that_cannot_be_written_leaves_no_file(raising: bool, tmp_path: Path) -> None:  # noqa: FBT001 - a parameter
    with pytest.raises(StageError) as failed:
        export_layer(Stubborn(raising=raising), tmp_path / "a.usda", "usda")
    assert str(tmp_path / "a.usda") in str(failed.value)
    assert list(tmp_path.iterdir()) == []


def test_a_layer_that_finds_no_room_on_the_disk_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = shutil.disk_usage(tmp_path)._replace(free=0)
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage)
    with pytest.raises(NoRoomError):
        export_layer(Stubborn(raising=False), tmp_path / "a.usda", "usda")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_nobody_may_write_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> tuple[int, str]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    with pytest.raises(StageError) as failed:
        build(None, tmp_path)
    assert "Permission denied" in str(failed.value)
    assert list(tmp_path.iterdir()) == []


def test_built_files_can_be_read_by_everybody(tmp_path: Path) -> None:
    for file in build(None, tmp_path, ["00"]):
        assert file.stat().st_mode & 0o777 == 0o644


# ---- starters that cannot carry the lab


def reasons(starter: Path, out: Path) -> list[str]:
    """The prims and files that the reasons are about; nothing must have been written."""
    with pytest.raises(StarterError) as refused:
        build(starter, out)
    assert not out.exists()
    assert all("\n" not in reason for reason in refused.value.reasons)
    return [reason.split(" ")[0] for reason in refused.value.reasons]


def leave_over(path: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        prim = stage.OverridePrim(path)
        prim.CreateAttribute("omni:sensor:tickRate", Sdf.ValueTypeNames.Float).Set(20.0)

    return change


def leave_deactivated(path: str) -> Change:
    def change(stage: Usd.Stage) -> None:
        stage.OverridePrim(path).SetActive(False)  # noqa: FBT003 - no keyword

    return change


def robot_as_over(stage: Usd.Stage) -> None:
    stage.RemovePrim(ROBOT)
    stage.OverridePrim(ROBOT).GetReferences().AddReference(OFFLINE)
    for link in (*LINKS, "base_footprint"):
        stage.OverridePrim(f"{ROBOT}/{link}")


REFUSED: dict[str, tuple[Change, list[str]]] = {
    "no world": (remove("/World"), ["/World"]),
    "no robot": (remove(ROBOT), [ROBOT]),
    "no world and no robot": (several(remove("/World"), remove(ROBOT)), ["/World", ROBOT]),
    "two links missing": (
        several(remove(BASE_SCAN), remove(f"{ROBOT}/wheel_left_link")),
        [BASE_SCAN, f"{ROBOT}/wheel_left_link"],
    ),
    "a graph there": (define(GRAPHS[0], "OmniGraph"), [GRAPHS[0]]),
    "every graph there": (
        several(*(define(path, "OmniGraph") for path in GRAPHS)),
        [LIDAR, *GRAPHS],
    ),
    "a lidar there": (define(LIDAR, "OmniLidar"), [LIDAR]),
    "rest of a lidar": (leave_over(LIDAR), [LIDAR]),
    "deleted lidar": (leave_deactivated(LIDAR), [LIDAR]),
    "deleted graph": (leave_deactivated(GRAPHS[1]), [GRAPHS[1]]),
    "deactivated robot": (deactivate(ROBOT), [ROBOT]),
    "deactivated link": (deactivate(FOOTPRINT), [FOOTPRINT]),
    "robot out of reach": (robot_as_over, [ROBOT, OFFLINE]),
    "missing and too much": (
        several(remove("/World"), define(LIDAR, "OmniLidar")),
        ["/World", LIDAR],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_every_reason_against_a_starter_is_given(case: str, tmp_path: Path) -> None:
    change, expected = REFUSED[case]
    starter = changed(tmp_path / "given" / "scene.usda", change)
    assert reasons(starter, tmp_path / "out") == expected


def test_a_robot_that_is_an_instance_is_refused(tmp_path: Path) -> None:
    starter = layered_starter(tmp_path / "given")
    stage = opened(starter)
    stage.GetPrimAtPath(ROBOT).SetInstanceable(True)  # noqa: FBT003 - no keyword
    stage.GetRootLayer().Save()
    assert reasons(starter, tmp_path / "out") == [ROBOT]


def test_a_robot_whose_file_is_missing_is_refused_and_the_file_named(tmp_path: Path) -> None:
    starter = layered_starter(tmp_path / "given")
    (tmp_path / "given" / "robots" / "burger.usda").unlink()
    refused = reasons(starter, tmp_path / "out")
    assert BASE_SCAN in refused
    assert refused[-1].endswith("robots/burger.usda")


def test_a_scene_whose_sublayer_is_missing_is_refused_and_the_file_named(tmp_path: Path) -> None:
    starter = layered_starter(tmp_path / "given")
    (starter.parent / "layers" / "base.usda").unlink()
    refused = reasons(starter, tmp_path / "out")
    assert refused[0] == "/World"
    assert refused[-1].endswith("layers/base.usda")


def test_a_stage_with_all_the_labs_graphs_is_refused(tmp_path: Path) -> None:
    (last,) = build(None, tmp_path / "given", [LAST])
    assert reasons(last, tmp_path / "out") == [LIDAR, *GRAPHS]


def test_a_real_import_with_other_paths_is_refused(shared: Path, tmp_path: Path) -> None:
    robot = shared / "corpus" / "turtlebot3_import" / "turtlebot3_burger"
    refused = reasons(robot / "turtlebot3_burger.usda", tmp_path / "out")
    assert {"/World", *(f"{ROBOT}/{link}" for link in LINKS)} <= set(refused)
    assert ROBOT not in refused


def test_an_unfit_starter_is_unfit_for_the_first_checkpoint_too(tmp_path: Path) -> None:
    starter = changed(tmp_path / "scene.usda", remove(BASE_SCAN))
    with pytest.raises(StarterError):
        build_checkpoint(starter, "00", tmp_path / "out.usda")
    assert not (tmp_path / "out.usda").exists()


# ---- the same bytes, whatever happens


def test_building_again_gives_the_same_bytes(tmp_path: Path) -> None:
    for form in ("usda", "usdc"):
        build(None, tmp_path / "first", form=form)
        build(None, tmp_path / "second", form=form)
    assert len(files_below(tmp_path / "first")) == 2 * len(ALL)
    assert files_below(tmp_path / "first") == files_below(tmp_path / "second")


@pytest.mark.parametrize("number", ALL)
def test_text_to_binary_and_back_is_unchanged(number: str, tmp_path: Path) -> None:
    (text,) = build(None, tmp_path, [number])
    binary = tmp_path / "binary.usd"
    Sdf.Layer.OpenAsAnonymous(str(text)).Export(str(binary), "", {"format": "usdc"})
    back = tmp_path / "back.usda"
    Sdf.Layer.OpenAsAnonymous(str(binary)).Export(str(back))
    assert back.read_bytes() == text.read_bytes()


def test_the_binary_form_holds_the_same_as_text(tmp_path: Path) -> None:
    (text,) = build(None, tmp_path, [LAST])
    (binary,) = build(None, tmp_path, [LAST], form="usdc")
    assert binary.suffix == ".usd"
    assert binary.read_bytes().startswith(b"PXR-USDC")
    assert Sdf.Layer.FindOrOpen(str(binary)).ExportToString() == text.read_text()


def test_a_checkpoint_alone_is_the_one_built_with_the_others(tmp_path: Path) -> None:
    together = build(None, tmp_path / "together")
    for number, file in zip(ALL, together, strict=True):
        (alone,) = build(None, tmp_path / "alone", [number])
        assert alone.read_bytes() == file.read_bytes()


# ---- one checkpoint by the library


@pytest.mark.parametrize(
    ("name", "magic"), [("a.usda", b"#usda"), ("a.usd", b"PXR-USDC"), ("a.usdc", b"PXR-USDC")]
)
def test_the_ending_decides_the_form(name: str, magic: bytes, tmp_path: Path) -> None:
    target = tmp_path / name
    assert build_checkpoint(None, "01", target) == target
    assert target.read_bytes().startswith(magic)


@pytest.mark.parametrize("name", ["a.txt", "a", "a.usdz", "a.uda"])
def test_a_name_that_is_no_stages_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        build_checkpoint(None, "01", tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_checkpoint_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        build_checkpoint(None, "99", tmp_path / "a.usda")
    assert all(number in str(refused.value) for number in ("99", *ALL))


# ---- the vendor's lidar

ASSET = "https://host.invalid/Assets/Isaac/6.0/Isaac/Sensors/NVIDIA/Example_Rotary_2D.usda"


@pytest.fixture
def vendors(tmp_path: Path) -> Sdf.Layer:
    (built,) = build(None, tmp_path, [LAST], lidar_asset=ASSET)
    return Sdf.Layer.FindOrOpen(str(built))


def test_a_lidar_asset_is_referred_to(vendors: Sdf.Layer) -> None:
    lidar = vendors.GetPrimAtPath(LIDAR)
    assert lidar.typeName == "OmniLidar"
    assert [item.assetPath for item in lidar.referenceList.prependedItems] == [ASSET]


def test_over_a_lidar_asset_only_rates_and_pose_are_written(vendors: Sdf.Layer) -> None:
    lidar = vendors.GetPrimAtPath(LIDAR)
    assert "apiSchemas" not in lidar.ListInfoKeys()
    assert {
        attribute.name: attribute.default
        for attribute in lidar.attributes
        if "omni" in attribute.name
    } == {
        "omni:sensor:tickRate": 10.0,
        "omni:sensor:Core:scanRateBaseHz": 10,
    }
    assert {attribute.name for attribute in lidar.attributes if "omni" not in attribute.name} == {
        *("xformOp:translate", "xformOp:orient", "xformOp:scale", "xformOpOrder"),
    }


def test_a_lidar_asset_changes_the_lidar_and_nothing_else(
    vendors: Sdf.Layer, tmp_path: Path
) -> None:
    (built,) = build(None, tmp_path / "own", [LAST])
    ours, theirs = specs(Sdf.Layer.FindOrOpen(str(built))), specs(vendors)
    assert {path for path in ours if path not in theirs} == {
        path for path in ours if path.startswith(f"{LIDAR}.omni") and path not in theirs
    }
    assert set(theirs) <= set(ours)


def test_the_environment_keeps_its_name_free_for_the_instructor(tmp_path: Path) -> None:
    starter = changed(tmp_path / "scene.usda", remove(ENVIRONMENT))
    (built,) = build(starter, tmp_path / "out", ["05"])
    assert not opened(built).GetPrimAtPath(ENVIRONMENT)
