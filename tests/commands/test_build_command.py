"""`lab3 build` as a person meets it: what it writes, what it says, how it ends."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

import pytest
from other_labs import LAB, files_below, in_force
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics
from starters import (
    BASE_SCAN,
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

from lab3_usd import cli

FILES = [checkpoint.file for checkpoint in LAB.checkpoints.values()]
DRIVE = LAB.graphs["ROS_Drive"].path
LIDAR = LAB.scene.sensors["lidar"].path


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> Iterator[None]:
    with in_force():
        yield


@dataclass(frozen=True)
class Outcome:
    status: int
    out: list[str]
    err: list[str]


Run = Callable[..., Outcome]


@pytest.fixture
def build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Run:
    """Run `lab3 build ... --out OUT` and return all that reached the terminal, C++ included."""

    def run(*arguments: str | Path, into: str = "out") -> Outcome:
        command = ["lab3", "build", *map(str, arguments), "--out", str(tmp_path / into)]
        monkeypatch.setattr("sys.argv", command)
        capfd.readouterr()
        status = 0
        try:
            cli.main()
        except SystemExit as stopped:
            status = int(stopped.code or 0)
        captured = capfd.readouterr()
        return Outcome(status, captured.out.splitlines(), captured.err.splitlines())

    return run


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_without_a_starter_every_file_comes_and_is_listed(build: Run, out: Path) -> None:
    outcome = build()
    assert outcome == Outcome(0, [str(out / f"{name}.usda") for name in FILES], [])
    assert names(out) == [f"{name}.usda" for name in FILES]


def test_the_bundled_starter_is_the_one_that_the_command_writes(
    build: Run, out: Path, tmp_path: Path
) -> None:
    build()
    bundled = files_below(out)
    assert build(text_starter(tmp_path / "starter.usda"), "--force").err == []
    assert files_below(out) == bundled


@pytest.mark.parametrize("number", ["03", "3"])
def test_through_stops_after_a_checkpoint(number: str, build: Run, out: Path) -> None:
    assert build("--through", number).status == 0
    assert names(out) == [f"{name}.usda" for name in FILES[:4]]


@pytest.mark.parametrize("number", ["05", "5"])
def test_only_builds_one_checkpoint(number: str, build: Run, out: Path) -> None:
    assert build("--only", number).status == 0
    assert names(out) == [f"{FILES[5]}.usda"]


def test_binary_files_end_in_usd(build: Run, out: Path) -> None:
    assert build("--format", "usdc").status == 0
    assert names(out) == [f"{name}.usd" for name in FILES]
    assert all(path.read_bytes().startswith(b"PXR-USDC") for path in out.iterdir())


def test_a_lidar_asset_is_handed_on(build: Run, out: Path) -> None:
    build("--only", "03", "--lidar-asset", "https://host.invalid/lidar.usda")
    layer = Sdf.Layer.FindOrOpen(str(out / f"{FILES[3]}.usda"))
    (reference,) = layer.GetPrimAtPath(LIDAR).referenceList.prependedItems
    assert reference.assetPath == "https://host.invalid/lidar.usda"


def test_missing_folders_are_made(build: Run, tmp_path: Path) -> None:
    assert build("--only", "00", into="a/b/c").status == 0
    assert names(tmp_path / "a" / "b" / "c") == [f"{FILES[0]}.usda"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("--through", "03", "--only", "05"),
        ("--only", "09"),
        ("--through", "9"),
        ("--only", "five"),
        ("--only", "-1"),
        ("--only", ""),
        ("--format", "usd"),
        ("--lidar-asset", ""),
        ("--unknown",),
        ("one.usda", "two.usda"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(
    arguments: tuple[str, ...], build: Run, out: Path
) -> None:
    outcome = build(*arguments)
    assert outcome.status == 2
    assert outcome.out == []
    assert len(outcome.err) == 1
    assert not out.exists()


def test_existing_files_are_kept_unless_forced(build: Run, out: Path) -> None:
    build("--only", "03")
    (out / f"{FILES[3]}.usda").write_text("mine\n")
    outcome = build()
    assert outcome.status == 2
    assert len(outcome.err) == 1
    assert "--force" in outcome.err[0]
    assert names(out) == [f"{FILES[3]}.usda"]
    assert (out / f"{FILES[3]}.usda").read_text() == "mine\n"
    assert build("--force").status == 0
    assert len(names(out)) == len(FILES)


# ---- starters that cannot be opened


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def with_nul(data: bytes) -> bytes:
    return data[:500] + b"\0" + data[500:]


def not_utf8(data: bytes) -> bytes:
    return data[:5000] + b"\xff\xfe" + data[5000:]


DAMAGE: dict[str, tuple[str, Callable[[bytes], bytes]]] = {
    "cut short": ("scene.usda", cut),
    "cut in its first line": ("scene.usda", lambda data: data[:7]),
    "with a NUL byte": ("scene.usda", with_nul),
    "not UTF-8": ("scene.usda", not_utf8),
    "UTF-16": ("scene.usda", lambda data: data.decode().encode("utf-16")),
    "with a byte order mark": ("scene.usda", lambda data: b"\xef\xbb\xbf" + data),
    "without its first line": ("scene.usda", lambda data: data.split(b"\n", 1)[1]),
    "with a brace too few": ("scene.usda", lambda data: data.rstrip().rstrip(b"}")),
    "empty": ("scene.usda", lambda _: b""),
    "only spaces": ("scene.usda", lambda _: b"  \n\n"),
    "text with a wrong ending": ("scene.txt", lambda data: data),
    "text ending in .uda": ("scene.uda", lambda data: data),
    "without an ending": ("scene", lambda data: data),
    "text named as a crate": ("scene.usdc", lambda data: data),
    "text named as a package": ("scene.usdz", lambda data: data),
    "noise": ("scene.usd", lambda _: bytes(range(256)) * 40),
    "nothing under a binary name": ("scene.usd", lambda _: b""),
}
CRATE_DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "cut short": cut,
    "cut in its header": lambda data: data[:20],
    "without its end": lambda data: data[:-40],
    "with a hole": lambda data: data[:200] + bytes(3000) + data[3200:],
    "with a wrong table of contents": lambda data: data[:16] + b"\xff" * 8 + data[24:],
}


def refused_in_one_line(outcome: Outcome, file: Path) -> None:
    assert outcome.status == 2
    assert outcome.out == []
    assert len(outcome.err) == 1
    assert outcome.err[0].startswith(f"lab3: {file}: ")
    assert "pxr" not in outcome.err[0]


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_starter_is_one_line_and_status_2(
    case: str, build: Run, tmp_path: Path, out: Path
) -> None:
    name, damage = DAMAGE[case]
    data = text_starter(tmp_path / "whole.usda").read_bytes()
    (tmp_path / name).write_bytes(damage(data))
    refused_in_one_line(build(tmp_path / name), tmp_path / name)
    assert not out.exists()


@pytest.mark.parametrize("case", CRATE_DAMAGE)
def test_a_damaged_binary_starter_is_one_line_and_status_2(
    case: str, build: Run, tmp_path: Path, out: Path
) -> None:
    data = binary_starter(tmp_path / "whole.usd").read_bytes()
    (tmp_path / "scene.usd").write_bytes(CRATE_DAMAGE[case](data))
    refused_in_one_line(build(tmp_path / "scene.usd"), tmp_path / "scene.usd")
    assert not out.exists()


NO_FILE: dict[str, Callable[[Path], Any]] = {
    "missing": lambda _: None,
    "a folder": Path.mkdir,
    "a link to nowhere": lambda path: path.symlink_to("none.usda"),
}


@pytest.mark.parametrize("put", NO_FILE.values(), ids=NO_FILE)
def test_a_starter_that_is_no_file_is_one_line_and_status_2(
    put: Callable[[Path], Any], build: Run, tmp_path: Path, out: Path
) -> None:
    put(tmp_path / "scene.usda")
    refused_in_one_line(build(tmp_path / "scene.usda"), tmp_path / "scene.usda")
    assert not out.exists()


def test_a_starter_nobody_may_read_is_one_line_and_status_2(
    build: Run, tmp_path: Path, out: Path
) -> None:
    starter = text_starter(tmp_path / "scene.usda")
    starter.chmod(0)
    if os.access(starter, os.R_OK):
        pytest.skip("this user may read every file")
    refused_in_one_line(build(starter), starter)
    assert not out.exists()


def test_a_starter_that_fails_to_be_read_is_one_line_and_status_2(
    build: Run, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    starter = text_starter(tmp_path / "scene.usda")
    really_open = Path.open

    def refuse(self: Path, *arguments: str, **options: str) -> IO[bytes]:
        if self == starter:
            raise PermissionError(13, "Permission denied")
        return cast("IO[bytes]", really_open(self, *arguments, **options))

    monkeypatch.setattr(Path, "open", refuse)
    outcome = build(starter)
    refused_in_one_line(outcome, starter)
    assert "Permission denied" in outcome.err[0]
    assert not out.exists()


def test_a_damaged_part_of_a_starter_is_no_traceback(build: Run, tmp_path: Path, out: Path) -> None:
    starter = layered_starter(tmp_path / "given")
    robot = tmp_path / "given" / "robots" / "burger.usda"
    robot.write_bytes(not_utf8(robot.read_bytes()))
    outcome = build(starter)
    assert outcome.status in {1, 2}
    assert outcome.out == []
    assert outcome.err[0].startswith(f"lab3: {starter}: ")
    assert not out.exists()


# ---- starters that cannot carry the lab


def unfit(stage: Usd.Stage) -> None:
    stage.RemovePrim("/World")
    stage.RemovePrim(BASE_SCAN)
    stage.DefinePrim(DRIVE, "OmniGraph")


def test_an_unfit_starter_is_a_list_of_reasons_and_status_1(
    build: Run, tmp_path: Path, out: Path
) -> None:
    starter = changed(tmp_path / "scene.usda", unfit)
    before = files_below(tmp_path)
    outcome = build(starter)
    assert outcome.status == 1
    assert outcome.out == []
    assert outcome.err[0].startswith(f"lab3: {starter}: ")
    assert [line.split()[0] for line in outcome.err[1:]] == ["/World", BASE_SCAN, DRIVE]
    assert files_below(tmp_path) == before
    assert not out.exists()


def test_a_real_import_is_refused_with_reasons(
    build: Run, shared: Path, tmp_path: Path, out: Path
) -> None:
    folder = shared / "corpus" / "turtlebot3_import"
    outcome = build(folder / "turtlebot3_burger" / "turtlebot3_burger.usda")
    assert outcome.status == 1
    assert len(outcome.err) > 6
    assert all(line.startswith("  /") for line in outcome.err[1:])
    assert not out.exists()
    assert list(tmp_path.iterdir()) == []


def lying(stage: Usd.Stage) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)


def in_centimetres(stage: Usd.Stage) -> None:
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)


def in_grams(stage: Usd.Stage) -> None:
    UsdPhysics.SetStageKilogramsPerUnit(stage, 0.001)


@pytest.mark.parametrize(
    ("change", "what"),
    [(lying, "upAxis Y"), (in_centimetres, "metersPerUnit 0.01"), (in_grams, "kilogramsPerUnit")],
)
def test_a_starter_in_other_units_is_refused(
    change: Change, what: str, build: Run, tmp_path: Path, out: Path
) -> None:
    outcome = build(changed(tmp_path / "scene.usda", change))
    assert outcome.status == 1
    assert len(outcome.err) == 2
    assert what in outcome.err[1]
    assert not out.exists()


def test_units_that_nobody_wrote_but_kilograms_are_refused(build: Run, tmp_path: Path) -> None:
    def silent(stage: Usd.Stage) -> None:
        for key in ("upAxis", "metersPerUnit", "kilogramsPerUnit"):
            stage.GetRootLayer().pseudoRoot.ClearInfo(key)

    outcome = build(changed(tmp_path / "scene.usda", silent))
    assert [line.split()[2] for line in outcome.err[1:]] == ["upAxis", "metersPerUnit"]


def test_a_refusal_says_where_prims_of_the_wanted_names_are(build: Run, tmp_path: Path) -> None:
    def dragged(stage: Usd.Stage) -> None:
        editor = Usd.NamespaceEditor(stage)
        assert editor.MovePrimAtPath(ROBOT, f"/World{ROBOT}")
        assert editor.ApplyEdits()

    outcome = build(changed(tmp_path / "scene.usda", dragged))
    (line,) = [each for each in outcome.err if each.startswith(f"  {ROBOT} is missing")]
    assert f"/World{ROBOT} has that name" in line


# ---- starters that are merely unlike the handout's


def heavier(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(f"{ROBOT}/base_link").GetAttribute("physics:mass").Set(2.0)


def moved(stage: Usd.Stage) -> None:
    translate = stage.GetPrimAtPath(ROBOT).GetAttribute("xformOp:translate")
    translate.Set(Gf.Vec3d(0.5, 0.25, 0.0))


def unlit(stage: Usd.Stage) -> None:
    lights = [prim.GetPath() for prim in stage.Traverse() if prim.HasAPI(UsdLux.LightAPI)]
    for path in lights:
        stage.RemovePrim(path)


def without_physics(stage: Usd.Stage) -> None:
    scenes = [p.GetPath() for p in stage.Traverse() if p.GetTypeName() == "PhysicsScene"]
    for path in scenes:
        stage.RemovePrim(path)


UNLIKE: dict[str, tuple[Change, str, str]] = {
    "another mass": (heavier, f"{ROBOT}/base_link", "mass"),
    "a moved root": (moved, ROBOT, "0.5, 0.25, 0"),
    "no light": (unlit, "/", "light"),
    "no physics scene": (without_physics, "/", "physics scene"),
}


@pytest.mark.parametrize("case", UNLIKE)
def test_what_is_merely_unlike_the_handout_is_built_with_a_warning(
    case: str, build: Run, tmp_path: Path, out: Path
) -> None:
    change, prim, what = UNLIKE[case]
    outcome = build(changed(tmp_path / "scene.usda", change))
    assert outcome.status == 0
    assert outcome.out == [str(out / f"{name}.usda") for name in FILES]
    assert len(outcome.err) == 1
    assert outcome.err[0].startswith(f"warning: {prim}")
    assert what in outcome.err[0]


def test_every_difference_is_warned_about(build: Run, tmp_path: Path) -> None:
    def differ(stage: Usd.Stage) -> None:
        heavier(stage)
        moved(stage)
        unlit(stage)

    outcome = build(changed(tmp_path / "scene.usda", differ), "--only", "00")
    assert outcome.status == 0
    assert len(outcome.err) == 3


@pytest.mark.parametrize("change", [reordered, another_environment, extra_prims, offline_room])
def test_what_the_handout_leaves_open_is_not_warned_about(
    change: Change, build: Run, tmp_path: Path
) -> None:
    outcome = build(changed(tmp_path / "scene.usda", change), "--only", "00")
    assert (outcome.status, outcome.err) == (0, [])


@pytest.mark.parametrize("make", [layered_starter, lambda folder: binary_starter(folder / "s.usd")])
def test_how_a_starter_is_saved_is_not_warned_about(
    make: Callable[[Path], Path], build: Run, tmp_path: Path
) -> None:
    (tmp_path / "given").mkdir()
    outcome = build(make(tmp_path / "given"), "--only", "00")
    assert (outcome.status, outcome.err) == (0, [])


def test_warnings_leave_the_starter_alone(build: Run, tmp_path: Path) -> None:
    starter = changed(tmp_path / "scene.usda", heavier)
    before = starter.read_bytes()
    build(starter)
    assert starter.read_bytes() == before
