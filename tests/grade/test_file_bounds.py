"""The bounds of a submission: which files of it usd-core is let near, and which never."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from pxr import Sdf, Usd

from lab3_usd.errors import StageError
from lab3_usd.grade.intake.guard import check_layer
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.assets import blocked_path, find_unresolved, original_asset
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.read.server_assets import assets_at
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.sandboxed_open import FileBounds, files_of, memory_errors, opening_within

INNER = """#usda 1.0
(
    defaultPrim = "World"
)
def Xform "World"
{
    def "inner"
    {
    }
}
"""
GRAPH = "/World/ROS_Clock"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    folder = tmp_path / "submission"
    folder.mkdir()
    return folder


@pytest.fixture
def bounds(root: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FileBounds]:
    """Bounds around `root`, which is the working directory as it is when a worker judges."""
    monkeypatch.chdir(root)
    made = FileBounds(root.resolve(), partial(check_layer, limits=Limits()), graphs=(GRAPH,))
    with opening_within(made):
        yield made


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def arc(kind: str, asset: str, prim: str = "World") -> str:
    return f'#usda 1.0\ndef Xform "{prim}" (\n    prepend {kind} = @{asset}@</World>\n)\n{{\n}}\n'


def sublayer(*assets: str) -> str:
    return f"#usda 1.0\n(\n    subLayers = [{', '.join(f'@{asset}@' for asset in assets)}]\n)\n"


def reasons(bounds: FileBounds) -> dict[str, bool]:
    """What was blocked, and whether it is an error."""
    return {each.asset: each.is_error for each in bounds.found.values()}


def used(stage: Usd.Stage) -> set[str]:
    return {Path(layer.realPath).name for layer in stage.GetUsedLayers() if not layer.anonymous}


def test_a_stage_without_references_opens(root: Path, bounds: FileBounds) -> None:
    stage = open_stage(write(root / "a.usda", INNER))
    assert stage.GetPrimAtPath("/World/inner")
    assert reasons(bounds) == {}


@pytest.mark.parametrize("asset", ["b.usda", "./b.usda", "../submission/b.usda", "deep/../b.usda"])
@pytest.mark.parametrize("kind", ["references", "payload"])
def test_files_of_the_submission_are_read(
    root: Path, bounds: FileBounds, kind: str, asset: str
) -> None:
    (root / "deep").mkdir()
    write(root / "b.usda", INNER)
    stage = open_stage(write(root / "a.usda", arc(kind, asset)))
    assert stage.GetPrimAtPath("/World/inner")
    assert reasons(bounds) == {}


def test_folders_of_the_submission_beside_the_stage_are_read(
    root: Path, bounds: FileBounds
) -> None:
    write(root / "assets" / "b.usda", INNER)
    stage = open_stage(write(root / "work" / "a.usda", sublayer("../assets/b.usda")))
    assert used(stage) == {"a.usda", "b.usda"}
    assert reasons(bounds) == {}


REACHING = {
    "../outside.usda": True,
    "./../outside.usda": True,
    "../../../../../../../../etc/passwd": True,
    "{outside}": False,
    "/dev/null": False,
    "C:/outside.usda": False,
    "\\\\server\\share\\a.usda": False,
    "file://{outside}": False,
    "https://example.invalid/a.usd": False,
    "omniverse://localhost/a.usd": False,
    '`"${X}"`': True,
    "b.usda:SDF_FORMAT_ARGS:a=b": True,
    "look.mtlx": True,
    "gone.usda": False,
    "search/outside.usda": False,
}  # fmt: skip


@pytest.mark.parametrize("asset", REACHING)
@pytest.mark.parametrize("kind", ["references", "payload", "sublayer"])
def test_what_reaches_out_is_not_opened_and_still_known_by_its_name(
    root: Path, bounds: FileBounds, kind: str, asset: str
) -> None:
    outside = write(root.parent / "outside.usda", INNER)
    write(root / "b.usda", INNER)
    write(root / "look.mtlx", '<?xml version="1.0"?><materialx version="1.38"/>')
    named = asset.replace("{outside}", str(outside))
    text = sublayer(named) if kind == "sublayer" else arc(kind, named)
    stage = open_stage(write(root / "a.usda", text))
    assert used(stage) == {"a.usda"}
    assert reasons(bounds) == {named: REACHING[asset]}
    assert [(each.asset, each.kind) for each in find_unresolved(stage)] == [
        (named, kind.removesuffix("s"))
    ]


def test_the_same_file_in_two_kinds_of_arcs_is_barred_in_both(
    root: Path, bounds: FileBounds
) -> None:
    write(root.parent / "outside.usda", INNER)
    text = sublayer("../outside.usda") + arc("payload", "../outside.usda").partition("\n")[2]
    stage = open_stage(write(root / "a.usda", text))
    assert used(stage) == {"a.usda"}
    assert len(find_unresolved(stage)) == 2
    assert reasons(bounds) == {"../outside.usda": True}


def test_what_lies_behind_another_layer_is_barred(root: Path, bounds: FileBounds) -> None:
    write(root.parent / "outside.usda", INNER)
    write(root / "b.usda", sublayer("../outside.usda"))
    stage = open_stage(write(root / "a.usda", sublayer("b.usda")))
    assert used(stage) == {"a.usda", "b.usda"}
    assert reasons(bounds) == {"../outside.usda": True}


@pytest.mark.parametrize("selected", ["open", "shut"])
def test_variants_are_barred_selected_or_not(root: Path, bounds: FileBounds, selected: str) -> None:
    layer = Sdf.Layer.CreateNew(str(root / "a.usda"))
    stage = Usd.Stage.Open(layer)
    write(root.parent / "outside.usda", INNER)
    prim = stage.DefinePrim("/World")
    variants = prim.GetVariantSets().AddVariantSet("door")
    for name in ("open", "shut"):
        variants.AddVariant(name)
    variants.SetVariantSelection("open")
    with variants.GetVariantEditContext():
        prim.GetReferences().AddReference("../outside.usda")
    variants.SetVariantSelection(selected)
    layer.Save()
    del stage, layer, prim, variants
    assert used(open_stage(root / "a.usda")) == {"a.usda"}
    assert reasons(bounds) == {"../outside.usda": True}


@pytest.mark.parametrize("ending", [".usda", ".usd"])
def test_value_clips_are_dropped(root: Path, bounds: FileBounds, ending: str) -> None:
    write(root.parent / "outside.usda", INNER)
    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/World")
    prim.CreateAttribute("x", Sdf.ValueTypeNames.Double)
    Usd.ClipsAPI(prim).SetClipAssetPaths([Sdf.AssetPath("../outside.usda")])
    Usd.ClipsAPI(prim).SetClipPrimPath("/World")
    Usd.ClipsAPI(prim).SetClipActive([(0, 0)])
    stage.GetRootLayer().Export(str(root / f"a{ending}"))
    opened = open_stage(root / f"a{ending}").GetPrimAtPath("/World")
    assert not opened.HasAuthoredMetadata("clips")
    assert opened.GetAttribute("x").Get(1) is None
    assert bounds.layers


def test_a_pipe_is_never_waited_for(root: Path, bounds: FileBounds) -> None:
    os.mkfifo(root / "pipe.usda")
    stage = open_stage(write(root / "a.usda", sublayer("pipe.usda")))
    assert used(stage) == {"a.usda"}
    assert reasons(bounds) == {"pipe.usda": True}


def test_a_link_that_leads_out_is_barred(root: Path, bounds: FileBounds) -> None:
    (root / "link.usda").symlink_to(write(root.parent / "outside.usda", INNER))
    stage = open_stage(write(root / "a.usda", sublayer("link.usda")))
    assert used(stage) == {"a.usda"}
    assert reasons(bounds) == {"link.usda": True}


def test_a_stage_outside_is_not_opened(root: Path, bounds: FileBounds) -> None:
    outside = write(root.parent / "outside.usda", INNER)
    with pytest.raises(StageError, match="outside the submission"):
        open_stage(outside)
    assert bounds.layers == {}


def test_a_damaged_layer_is_barred_and_the_stage_opens(root: Path, bounds: FileBounds) -> None:
    write(root / "b.usda", "#usda 1.0\ndef {{{")
    assert used(open_stage(write(root / "a.usda", sublayer("b.usda")))) == {"a.usda"}
    assert reasons(bounds) == {"b.usda": True}


def test_a_graph_that_hangs_on_what_is_barred_is_grave(root: Path, bounds: FileBounds) -> None:
    text = (
        '#usda 1.0\ndef Xform "World"\n{\n    def "ROS_Clock" (\n'
        "        prepend references = @https://example.invalid/clock.usd@\n    )\n    {\n    }\n"
        '    def "lamp" (\n        prepend references = @https://example.invalid/lamp.usd@\n    )\n'
        "    {\n    }\n}\n"
    )
    open_stage(write(root / "a.usda", text))
    assert reasons(bounds) == {
        "https://example.invalid/clock.usd": True,
        "https://example.invalid/lamp.usd": False,
    }


def test_files_of_the_starter_are_read_by_any_path(root: Path, bounds: FileBounds) -> None:
    write(root.parent / "given" / "robot.usda", INNER)
    starter = write(root.parent / "given" / "starter.usda", sublayer("./robot.usda"))
    solution = write(root.parent / "given" / "solution.usda", INNER)
    bounds.allowed = files_of(starter)
    text = sublayer(str(starter), "../given/robot.usda", str(solution))
    stage = open_stage(write(root / "a.usda", text))
    assert used(stage) == {"a.usda", "robot.usda", "starter.usda"}
    assert reasons(bounds) == {str(solution): False}
    assert used(open_stage(starter)) == {"robot.usda", "starter.usda"}


def test_layers_that_refer_to_each_other_are_looked_at_once(root: Path, bounds: FileBounds) -> None:
    write(root / "b.usda", sublayer("a.usda"))
    stage = open_stage(write(root / "a.usda", sublayer("b.usda")))
    assert used(stage) == {"a.usda", "b.usda"}
    assert len(bounds.layers) == 2


def test_a_layer_with_hundreds_of_assets_is_refused(root: Path, bounds: FileBounds) -> None:
    text = sublayer(*(f"gone_{index}.usda" for index in range(501)))
    with pytest.raises(StageError, match="refers to 501 files"):
        open_stage(write(root / "a.usda", text))
    assert reasons(bounds) == {}


def test_a_stage_is_announced_before_it_is_opened_and_once(root: Path, bounds: FileBounds) -> None:
    told: list[str] = []
    bounds.announce = told.append
    write(root / "work" / "a.usda", "damaged")
    with pytest.raises(StageError):
        open_stage(root / "work" / "a.usda")
    write(root / "b.usda", INNER)
    assert open_stage(root / "b.usda") is open_stage(root / "b.usda")
    assert told == ["work/a.usda", "b.usda"]


def test_broken_and_closed_stages_are_not_opened(root: Path, bounds: FileBounds) -> None:
    bounds.broken = {"a.usda": "crashed usd-core"}
    with pytest.raises(StageError, match="crashed usd-core"):
        open_stage(write(root / "a.usda", INNER))
    open_stage(write(root / "b.usda", INNER))
    bounds.closed = {"b.usda"}
    with pytest.raises(StageError, match="has been judged"):
        open_stage(root / "b.usda")


def test_a_barred_reference_of_the_lidar_is_a_note_and_of_a_graph_an_error(
    root: Path, bounds: FileBounds
) -> None:
    text = (
        '#usda 1.0\ndef Xform "turtlebot3_burger"\n{\n    def Xform "base_scan"\n    {\n'
        '        def OmniLidar "Lidar2D" (\n'
        "            prepend references = @https://example.invalid/lidar.usda@\n        )\n"
        "        {\n        }\n    }\n}\n"
    )
    result = check_stage(write(root / "a.usda", text), "03")
    (note,) = [finding for finding in result.findings if finding.rule == "F02"]
    assert (note.severity, note.actual) == ("note", "https://example.invalid/lidar.usda")
    assert reasons(bounds) == {"https://example.invalid/lidar.usda": False}


def test_outside_a_fence_stages_open_as_ever(tmp_path: Path) -> None:
    write(tmp_path / "b" / "outside.usda", INNER)
    stage = open_stage(write(tmp_path / "a" / "a.usda", sublayer("../b/outside.usda")))
    assert used(stage) == {"a.usda", "outside.usda"}


@pytest.mark.parametrize(
    "asset", ["a.usda", "../a", "/a/b", "https://a.b/c?d=e#f", "%2F", "ä ö", "x" * 400, "a@b"]
)
def test_a_barred_path_leads_nowhere_and_back_to_its_name(asset: str) -> None:
    assert original_asset(blocked_path(asset)) == asset
    assert original_asset(asset) == asset
    assert not os.path.lexists(blocked_path(asset))
    assert os.path.normpath(blocked_path(asset)) == blocked_path(asset)


def test_only_text_without_an_asset_is_known_to_lead_nowhere(
    root: Path, bounds: FileBounds
) -> None:
    write(root.parent / "outside.usda", INNER)
    plain = open_stage(write(root / "plain.usda", INNER))
    write(root / "trusted.usda", INNER)
    bounds.allowed = frozenset({str((root / "trusted.usda").resolve())})
    open_stage(write(root / "asking.usda", sublayer("trusted.usda", "../outside.usda")))
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    layer.subLayerPaths = ["../outside.usda"]
    layer.Export(str(root / "binary.usd"))
    open_stage(root / "binary.usd")
    assert bounds.alone == {plain.GetRootLayer().identifier}
    assert {stage for stage, _ in bounds.found} == {"asking.usda", "binary.usd"}


def test_stages_that_are_the_same_to_the_byte_are_read_once(root: Path, bounds: FileBounds) -> None:
    write(root.parent / "outside.usda", INNER)
    for name in ("a.usda", "b.usda"):
        write(root / name, sublayer("../outside.usda"))
    bounds.digests = dict.fromkeys(("a.usda", "b.usda"), "same")
    assert open_stage(root / "a.usda") is open_stage(root / "b.usda")
    assert sorted(bounds.found) == [("a.usda", "../outside.usda"), ("b.usda", "../outside.usda")]


@pytest.mark.parametrize("name", ["deep/b.usda", "b.usd"])
def test_in_other_folders_and_by_other_endings_they_are_read_again(
    root: Path, bounds: FileBounds, name: str
) -> None:
    write(root / "a.usda", INNER)
    write(root / name, INNER)
    bounds.digests = dict.fromkeys(("a.usda", name), "same")
    assert open_stage(root / "a.usda") is not open_stage(root / name)
    assert len(bounds.layers) == 2


def test_a_stage_read_once_goes_by_both_of_its_names(root: Path, bounds: FileBounds) -> None:
    lab = load_lab()
    for name in ("a.usda", "b.usda"):
        write(root / name, '#usda 1.0\ndef OmniGraph "ROS_Clock"\n{\n}\n')
    bounds.digests = dict.fromkeys(("a.usda", "b.usda"), "same")
    models = [
        read_model(open_stage(root / name), lab.platform, name) for name in ("a.usda", "b.usda")
    ]
    assert models[0] is models[1]
    first, second = (check_stage(str(root / name), "01", lab) for name in ("a.usda", "b.usda"))
    assert {finding.layer for finding in first.findings if finding.layer} == {str(root / "a.usda")}
    assert {finding.layer for finding in second.findings if finding.layer} == {str(root / "b.usda")}
    assert len(bounds.stages) == 2


def test_prims_too_deep_in_a_crate_are_refused(root: Path, bounds: FileBounds) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    Sdf.CreatePrimInLayer(layer, "/" + "/".join(["a"] * (bounds.nesting + 1)))
    layer.Export(str(root / "a.usd"))
    with pytest.raises(StageError, match="levels deep"):
        open_stage(root / "a.usd")


def test_a_layer_that_usd_core_opens_without_a_word_is_refused(
    root: Path, bounds: FileBounds, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Silent:
        @staticmethod
        def FindOrOpen(identifier: str) -> None:  # noqa: N802 - usd-core's name
            del identifier

    monkeypatch.setattr("lab3_usd.stage.sandboxed_open.Sdf.Layer", Silent)
    with pytest.raises(StageError, match="opens no stage"):
        open_stage(write(root / "a.usda", INNER))
    assert bounds.layers == {}


@pytest.mark.parametrize(
    ("said", "expected"), [("std::bad_alloc", MemoryError), ("something else", RuntimeError)]
)
def test_running_out_of_memory_is_told_from_damage(said: str, expected: type[Exception]) -> None:
    with pytest.raises(expected), memory_errors():
        raise RuntimeError(said)


def test_a_reference_that_stays_whatever_is_done_is_no_stage(
    root: Path, bounds: FileBounds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lab3_usd.stage.sandboxed_open._ATTEMPTS", 0)
    with pytest.raises(StageError, match="cannot be taken out"):
        open_stage(write(root / "a.usda", sublayer("../outside.usda")))
    assert bounds.stages == {}


def test_a_layer_that_was_not_looked_at_is_no_part_of_a_stage(
    root: Path, bounds: FileBounds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lab3_usd.stage.sandboxed_open.close_openings", lambda *_arguments: None)
    write(root / "b.usda", INNER)
    with pytest.raises(StageError, match="was not looked at"):
        open_stage(write(root / "a.usda", sublayer("b.usda")))
    assert bounds.stages == {}


def test_stages_of_which_nobody_knows_the_bytes_are_read_each(
    root: Path, bounds: FileBounds
) -> None:
    stages = [open_stage(write(root / name, INNER)) for name in ("a.usda", "b.usda")]
    assert stages[0] is not stages[1]
    bounds.digests = {"c.usda": "", "d.usda": ""}
    stages += [open_stage(write(root / name, INNER)) for name in ("c.usda", "d.usda")]
    assert stages[2] is not stages[3]
    assert bounds.firsts == {}


def test_only_what_a_twin_was_barred_from_is_shared(root: Path, bounds: FileBounds) -> None:
    open_stage(write(root / "other.usda", sublayer("../elsewhere.usda")))
    bounds.digests = dict.fromkeys(("a.usda", "b.usda"), "same")
    for name in ("a.usda", "b.usda"):
        open_stage(write(root / name, INNER))
    assert sorted(bounds.found) == [("other.usda", "../elsewhere.usda")]


SERVER = "https://server.example/Assets"


@pytest.fixture
def supplied(root: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FileBounds]:
    """Bounds where the grader has the assets of a server, in a folder beside the submission."""
    monkeypatch.chdir(root)
    folder = root.parent / "assets"
    write(folder / "robot.usda", sublayer("parts/wheel.usda") + INNER.partition("\n)\n")[2])
    write(folder / "parts" / "wheel.usda", INNER)
    made = FileBounds(
        root.resolve(),
        partial(check_layer, limits=Limits()),
        supplied=(os.path.realpath(folder),),
        graphs=(GRAPH,),
    )
    with opening_within(made), assets_at({SERVER: folder}):
        yield made


def test_assets_that_the_grader_has_are_read_by_their_address(
    root: Path, supplied: FileBounds
) -> None:
    stage = open_stage(write(root / "a.usda", arc("references", f"{SERVER}/robot.usda")))
    assert used(stage) == {"a.usda", "robot.usda", "wheel.usda"}
    assert reasons(supplied) == {}


@pytest.mark.parametrize(
    ("asset", "is_error"),
    [
        (f"{SERVER}/gone.usda", False),
        (f"{SERVER}/../../../outside.usda", False),
        ("https://another.example/robot.usda", False),
        ("../assets/robot.usda", True),
        ("search/robot.usda", False),
    ],
)
def test_nothing_else_is_read_beside_them(
    root: Path, supplied: FileBounds, asset: str, *, is_error: bool
) -> None:
    write(root.parent / "outside.usda", INNER)
    stage = open_stage(write(root / "a.usda", arc("references", asset)))
    assert used(stage) == {"a.usda"}
    assert reasons(supplied) == {asset: is_error}


def test_a_file_of_the_submission_in_a_folder_named_as_a_server_is_not_an_asset(
    root: Path, supplied: FileBounds
) -> None:
    write(root / "https:" / "server.example" / "Assets" / "robot.usda", INNER)
    open_stage(write(root / "a.usda", arc("references", f"{SERVER}/robot.usda")))
    assert reasons(supplied) == {f"{SERVER}/robot.usda": False}


def test_a_search_path_is_not_followed_unless_the_grader_supplies_it(
    root: Path, bounds: FileBounds
) -> None:
    folder = root.parent / "assets"
    write(folder / "robot.usda", INNER)
    with assets_at({SERVER: folder}):
        stage = open_stage(write(root / "a.usda", arc("references", f"{SERVER}/robot.usda")))
    assert used(stage) == {"a.usda"}
    assert reasons(bounds) == {f"{SERVER}/robot.usda": False}
