"""`lab3 fix`: what is repaired, what is written, and what is left as it was."""

from __future__ import annotations

import difflib
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from breaking import Step, broken, correct_stage
from click.testing import Result
from in_process import invoke
from linting import add_acting_rule, add_counting_rule
from made_once import judged_once
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, UsdUtils

from lab3_usd.check.match.rule_inputs import StageSubject
from lab3_usd.commands.shared import options
from lab3_usd.errors import Lab3Error
from lab3_usd.files import keep_original
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.pipeline.starter_comparison import against_starter, open_starter
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.starter import build_starter

ROBOT, JOINTS = "/turtlebot3_burger", "/turtlebot3_burger/joints"
CLOCK, DRIVE = "/World/ROS_Clock", f"{ROBOT}/ROS_Drive"
RADIUS = f"{DRIVE}/differential_controller.inputs:wheelRadius"
WRONG_RADIUS: Step = {"set": [RADIUS, 0.033]}
NO_TICK: Step = {"disconnect": f"{CLOCK}/ros2_publish_clock.inputs:execIn"}
NO_CONTEXT: Step = {"remove": [f"{CLOCK}/ros2_context"]}


@pytest.fixture(scope="module", autouse=True)
def _judged_once() -> Iterator[None]:
    with judged_once():
        yield


def written(stage: Usd.Stage, folder: Path, checkpoint: str = "02", ending: str = ".usda") -> Path:
    path = folder / f"{load_lab().checkpoints[checkpoint].file}{ending}"
    stage.GetRootLayer().Export(str(path))
    return path


_SAVED: dict[str, bytes] = {}
_VERDICTS: dict[tuple[str, bytes], str] = {}


def saved(folder: Path, *steps: Step, checkpoint: str = "02", ending: str = ".usda") -> Path:
    """Write the right stage after these steps; most tests need the same few."""
    key = repr((steps, checkpoint, ending))
    path = folder / f"{load_lab().checkpoints[checkpoint].file}{ending}"
    if key not in _SAVED:
        written(broken(checkpoint, [*steps]), folder, checkpoint, ending)
        _SAVED[key] = path.read_bytes()
    else:
        path.write_bytes(_SAVED[key])
    return path


def verdict(path: Path) -> str:
    """The verdict on a stage of one file; equal files, as most repaired ones are, have the same."""
    key = path.name, path.read_bytes()
    if key not in _VERDICTS:
        _VERDICTS[key] = check_stage(path).verdict
    return _VERDICTS[key]


def fix(path: Path, *arguments: str) -> Result:
    return invoke("fix", path, *arguments)


def assert_repaired(path: Path, *arguments: str) -> None:
    assert fix(path, "--in-place", *arguments).exit_code == 0
    assert verdict(path) == "pass"


def changed_lines(old: str, new: str) -> tuple[list[str], list[str]]:
    lines = [*difflib.ndiff(old.splitlines(), new.splitlines())]
    gone = [line[2:].strip() for line in lines if line.startswith("- ")]
    return gone, [line[2:].strip() for line in lines if line.startswith("+ ")]


def test_a_wrong_value_changes_one_line_and_the_old_file_is_kept(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    old = path.read_text()
    assert_repaired(path)
    assert (tmp_path / f"{path.name}.orig").read_text() == old
    assert changed_lines(old, path.read_text()) == (
        ["custom double inputs:wheelRadius = 0.033"],
        ["custom double inputs:wheelRadius = 0.025"],
    )


def test_comments_and_layout_stay(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    text = path.read_text()
    odd = text.replace(
        "custom double inputs:wheelRadius = 0.033",
        "custom   double inputs:wheelRadius=0.033 # as measured\n# by me",
    )
    path.write_text(odd)
    fix(path, "--in-place")
    assert path.read_text() == odd.replace("=0.033", "=0.025")


def test_who_may_read_the_file_stays_the_same(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    path.chmod(0o600)
    fix(path, "--in-place")
    modes = [each.stat().st_mode & 0o777 for each in (path, path.with_name(f"{path.name}.orig"))]
    assert modes == [0o600, 0o600]


def test_an_older_original_is_kept(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    old = path.read_bytes()
    original = tmp_path / f"{path.name}.orig"
    original.write_text("mine")
    fix(path, "--in-place")
    assert original.read_text() == "mine"
    assert (tmp_path / f"{path.name}.orig.2").read_bytes() == old


def test_originals_that_are_kept_at_once_have_names_of_their_own(tmp_path: Path) -> None:
    path = saved(tmp_path)
    contents = [str(number).encode() for number in range(40)]
    with ThreadPoolExecutor(8) as pool:
        kept = [*pool.map(lambda content: keep_original(path, content), contents)]
    assert [original.read_bytes() for original in kept] == contents


@pytest.mark.usefixtures("own_rules")
@pytest.mark.parametrize("when", ["first", "last"])
def test_a_save_while_the_stage_is_judged_is_not_overwritten(tmp_path: Path, when: str) -> None:
    """When its faults are looked for, and when the result is judged again before it is written."""
    path = saved(tmp_path, WRONG_RADIUS)
    before, theirs = path.read_text(), path.read_text() + "# saved meanwhile\n"
    asked: list[StageModel] = []
    add_counting_rule("S98", asked)
    assert fix(path, "--in-place", "--no-orig").exit_code == 0
    moment = 1 if when == "first" else len(asked)
    asked.clear()
    path.write_text(before)

    def save(_: StageSubject) -> None:
        if len(asked) == moment:
            path.write_text(theirs)

    add_acting_rule("S99", save)
    with pytest.raises(Lab3Error, match="was changed meanwhile"):
        fix(path, "--in-place")
    assert (path.read_text(), [*tmp_path.iterdir()]) == (theirs, [path])


def test_a_link_stays_a_link_to_the_repaired_stage(tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    path = saved(folder, WRONG_RADIUS)
    link = tmp_path / path.name
    link.symlink_to(path)
    assert fix(link, "--in-place").exit_code == 0
    assert link.is_symlink()
    assert verdict(path) == "pass"


IN_PLACE = ("--in-place", "--no-orig")


@pytest.mark.usefixtures("own_rules")
def test_a_result_below_a_linked_folder_is_judged_again(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "linked").symlink_to(tmp_path / "real")
    asked: list[StageModel] = []
    add_counting_rule("S99", asked)
    times = []
    for folder, words in (("real", ()), ("real", IN_PLACE), ("linked", IN_PLACE)):
        fix(saved(tmp_path / folder, WRONG_RADIUS), *words)
        times.append(len(asked))
        asked.clear()
    plan, whole, linked = times
    assert plan < whole == linked


def read_only(path: Path) -> None:
    path.chmod(0o444)


def with_a_second_name(path: Path) -> None:
    path.with_name("second.usda").hardlink_to(path)


@pytest.mark.parametrize("making", [read_only, with_a_second_name])
def test_a_file_that_is_shared_or_protected_is_replaced_with_force_only(
    making: Callable[[Path], None], tmp_path: Path
) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    making(path)
    old, mode = path.read_bytes(), path.stat().st_mode
    with pytest.raises(Lab3Error, match="use --force to replace it"):
        fix(path, "--in-place")
    assert path.read_bytes() == old
    fix(path, "--in-place", "--force")
    assert (verdict(path), path.stat().st_mode) == ("pass", mode)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs to be root")
def test_the_owner_stays_the_same(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    os.chown(path, 12345, 12345)
    with pytest.raises(Lab3Error, match="belongs to another user"):
        fix(path, "--in-place")
    fix(path, "--in-place", "--force")
    assert (path.stat().st_uid, path.stat().st_gid) == (12345, 12345)


@pytest.mark.parametrize("type_name", ["", "Scope"])
def test_a_graph_that_lost_its_type_gets_it_back_and_keeps_its_nodes(
    type_name: str, tmp_path: Path
) -> None:
    path = saved(tmp_path)
    text = path.read_text()
    typed, untyped = 'def OmniGraph "ROS_Clock"', f'def {type_name} "ROS_Clock"'.replace("  ", " ")
    assert typed in text
    path.write_text(text.replace(typed, untyped))
    fix(path, "--in-place", "--unsafe")
    assert path.read_text() == text


@pytest.mark.parametrize(
    "name", ["Lab3_03_lidar.usda.orig", "._Lab3_03_lidar.usda", "Lab3_03_lidar.usda~"]
)
def test_what_programs_leave_beside_a_stage_makes_no_submission(name: str, tmp_path: Path) -> None:
    path = saved(tmp_path)
    (tmp_path / name).write_bytes(b"\0")
    result = invoke("check", tmp_path)
    assert (result.exit_code, "missing" in result.stdout) == (0, False), path


def test_the_stages_of_a_folder_are_repaired(tmp_path: Path) -> None:
    first, second = tmp_path / "work", tmp_path / "other"
    first.mkdir()
    second.mkdir()
    paths = [saved(folder, WRONG_RADIUS) for folder in (first, second)]
    assert fix(tmp_path, "--in-place").exit_code == 0
    assert [verdict(path) for path in paths] == ["pass", "pass"]


def test_a_stage_that_cannot_be_read_does_not_hold_up_the_others(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    (tmp_path / "Lab3_01_ros_clock.usda").write_text("#usda 1.0\n{")
    assert fix(tmp_path, "--in-place").exit_code == 2
    assert verdict(path) == "pass"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_with_the_name_of_a_stage_does_not_hold_up_the_others(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    os.mkfifo(tmp_path / "Lab3_01_ros_clock.usda")
    result = fix(tmp_path, "--in-place")
    pipe = tmp_path / "Lab3_01_ros_clock.usda"
    assert result.stderr.startswith(f"lab3: {pipe}: is not a file; name a stage")
    assert verdict(path) == "pass"


def test_a_preview_says_what_would_be_repaired_and_what_to_type(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    result = fix(path)
    assert result.exit_code == 1
    assert f"would repair P01 {RADIUS}" in result.stdout
    assert result.stdout.splitlines()[-1].endswith(f"{path.name} --in-place")


def test_what_to_type_repairs_what_was_listed_and_no_more(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS, NO_TICK)
    options = ("--unsafe", "--checkpoint", "02", "--ignore", "W01")
    typed = fix(path, *options).stdout.splitlines()[-1]
    assert typed.endswith(f"{path.name} --checkpoint 02 --unsafe --ignore W01 --in-place")


ODD_ENDS = {
    "no line end at the end": lambda text: text.rstrip("\n"),
    "a form feed in a comment": lambda text: f"{text}# a\fb\n",
    "line ends of other alphabets": lambda text: f"{text}# a\u2028b\u0085c\n",
    "line ends of Windows": lambda text: text.replace("\n", "\r\n"),
}


PROGRAMS = [each for each in (["git", "apply"], ["patch", "-p1"]) if shutil.which(each[0])]
needs_programs = pytest.mark.skipif(not PROGRAMS, reason="neither git nor patch is installed")


@needs_programs
@pytest.mark.parametrize("odd", ODD_ENDS)
def test_a_diff_is_applied_by_the_usual_programs(
    odd: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = saved(tmp_path, WRONG_RADIUS)
    wrong = ODD_ENDS[odd](path.read_text())
    right = wrong.replace("wheelRadius = 0.033", "wheelRadius = 0.025")
    path.write_bytes(wrong.encode())
    patch = fix(path, "--diff").stdout_bytes
    for program in PROGRAMS:
        path.write_bytes(wrong.encode())
        exact = ["--binary"] if program[0] == "patch" else []
        done = subprocess.run([*program, *exact], input=patch, capture_output=True, check=False)
        assert (done.returncode, path.read_bytes()) == (0, right.encode()), done.stderr


def test_a_diff_of_a_binary_stage_is_shown_where_no_file_can_be_beside_it(tmp_path: Path) -> None:
    stage = broken("02", [WRONG_RADIUS])
    layer = stage.GetRootLayer()
    Sdf.Layer.CreateNew(str(tmp_path / "lamp.usda")).Save()
    stage.DefinePrim("/lamp").GetReferences().AddReference("./lamp.usda")
    path = (
        tmp_path / f"{load_lab().checkpoints['02'].file}_{'x' * 220}.usdc"
    )  # no longer name can be
    layer.Export(str(path))
    result = invoke("fix", "--diff", path)
    assert f"{RADIUS}: 0.033 -> 0.025" in result.output
    assert "lamp" not in result.output
    assert not [*tmp_path.glob(".*")]


@needs_programs
@pytest.mark.skipif(os.name == "nt", reason="has no such names")
@pytest.mark.parametrize("name", ["two words", "été", "a\ttab", 'a "quote" \\ é'])
def test_a_diff_names_files_as_the_usual_programs_read_them(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / name
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    path = saved(folder, WRONG_RADIUS)
    wrong, patch = path.read_bytes(), fix(path, "--diff").stdout_bytes
    for program in PROGRAMS:
        path.write_bytes(wrong)
        done = subprocess.run(program, input=patch, capture_output=True, check=False)
        assert (done.returncode, b"Radius = 0.025" in path.read_bytes()) == (0, True), done.stderr


def test_nothing_is_written_unless_asked(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    old = path.read_bytes()
    fix(path)
    fix(path, "--diff")
    assert (path.read_bytes(), [*tmp_path.iterdir()]) == (old, [path])


def test_output_goes_to_another_file(tmp_path: Path) -> None:
    path, output = saved(tmp_path, WRONG_RADIUS), tmp_path / "Lab3_02_repaired.usda"
    old = path.read_bytes()
    fix(path, "-o", str(output))
    assert (path.read_bytes(), verdict(output)) == (old, "pass")


def test_a_missing_node_is_left_without_unsafe(tmp_path: Path) -> None:
    path = saved(tmp_path, NO_CONTEXT)
    old = path.read_bytes()
    result = fix(path, "--in-place")
    assert (result.exit_code, path.read_bytes()) == (1, old)
    assert "needs --unsafe error N01" in result.stdout


def test_a_missing_node_is_added_and_connected_with_unsafe(tmp_path: Path) -> None:
    path = saved(tmp_path, NO_CONTEXT)
    assert_repaired(path, "--unsafe")


def test_a_second_repair_changes_nothing(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS, NO_CONTEXT)
    fix(path, "--in-place", "--unsafe")
    once = path.read_bytes()
    fix(path, "--in-place", "--unsafe", "--force")
    assert path.read_bytes() == once


def test_only_selected_rules_are_repaired(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    old = path.read_bytes()
    assert fix(path, "--in-place", "--select", "W").exit_code == 0
    assert path.read_bytes() == old


def test_what_a_comment_ignores_is_not_repaired(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS, NO_TICK)
    lines = path.read_text().splitlines(keepends=True)
    number = next(n for n, line in enumerate(lines) if "inputs:wheelRadius = " in line)
    lines.insert(number, "# lab3: ignore[P01] our wheels are larger\n")
    path.write_text("".join(lines))
    assert fix(path, "--in-place").exit_code == 0
    assert "inputs:wheelRadius = 0.033" in path.read_text()
    assert check_stage(path).findings[0].rule == "P01"


def test_what_custom_data_ignores_is_not_repaired(tmp_path: Path) -> None:
    stage = broken("02", [WRONG_RADIUS])
    stage.GetPrimAtPath(DRIVE).SetCustomDataByKey("lab3:ignore", "P")
    path = written(stage, tmp_path)
    old = path.read_bytes()
    assert (fix(path, "--in-place").exit_code, path.read_bytes()) == (0, old)


def test_what_the_configuration_leaves_out_is_not_repaired(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS)
    old = path.read_bytes()
    for configuration in (
        'ignore = ["P01"]',
        'select = ["W"]',
        '[per-file-ignores]\n"*_ros_drive*" = ["P"]',
        '[severity]\nP01 = "note"',
    ):
        (tmp_path / "lab3.toml").write_text(configuration)
        assert (fix(path, "--in-place").exit_code, path.read_bytes()) == (0, old), configuration
    fix(path, "--in-place", "--isolated")
    assert verdict(path) == "pass"


def test_the_configuration_names_the_checkpoint(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS).rename(tmp_path / "mine.usda")
    (tmp_path / "lab3.toml").write_text('[checkpoints]\n"mine*" = "02"\n')
    assert fix(path, "--in-place").exit_code == 0
    assert fix(path, "--isolated", "--checkpoint", "2").exit_code == 0


def test_a_repair_that_would_make_it_worse_is_left_out_and_told(tmp_path: Path) -> None:
    nodes = {"remove": f"{DRIVE}/make_array"}, {"remove": f"{DRIVE}/scale_linear_velocity"}
    path = saved(tmp_path, NO_TICK, *nodes, {"deactivate": DRIVE})
    result = fix(path, "--in-place")
    assert result.exit_code == 1
    assert "repaired W01 /World/ROS_Clock" in result.stdout
    left = [line for line in result.stdout.splitlines() if line.startswith("left")]
    assert [each.partition(":")[0] for each in left] == [
        f"left out (its repair would make the stage worse) error G01 {DRIVE}"
    ]
    assert "active = false" in path.read_text()


def test_a_renamed_wheel_joint_gets_its_name_back_with_unsafe(tmp_path: Path) -> None:
    joint = f"{JOINTS}/wheel_left_joint"
    path = saved(tmp_path, {"move": [joint, f"{joint}_1"]})
    stage = Sdf.Layer.OpenAsAnonymous(str(path))
    properties = {*stage.GetPrimAtPath(f"{joint}_1").properties.keys()}
    assert fix(path, "--in-place", "--unsafe").exit_code == 0
    repaired = Sdf.Layer.OpenAsAnonymous(str(path))
    assert not repaired.GetPrimAtPath(f"{joint}_1")
    assert {*repaired.GetPrimAtPath(joint).properties.keys()} == properties


def test_a_name_that_the_drive_shares_with_a_renamed_joint_is_repaired_with_it_alone(
    tmp_path: Path,
) -> None:
    joint = f"{JOINTS}/wheel_left_joint"
    value = f"{DRIVE}/constant_left_joint.inputs:value"
    path = saved(tmp_path, {"move": [joint, f"{JOINTS}/left"]}, {"set": [value, "left"]})
    before = path.read_bytes()
    assert fix(path, "--in-place").exit_code == 1
    assert path.read_bytes() == before  # the robot drives, and would no more
    assert_repaired(path, "--unsafe")


def test_a_frame_that_fits_a_misplaced_sensor_is_repaired_with_its_place_alone(
    tmp_path: Path,
) -> None:
    there = f"{ROBOT}/base_footprint/Lidar2D"
    frame = f"{there}/ROS_Lidar2D/ros2_rtx_lidar_helper.inputs:frameId"
    moved = {"move": [f"{ROBOT}/base_scan/Lidar2D", there]}
    path = saved(tmp_path, moved, {"set": [frame, "base_footprint"]}, checkpoint="03")
    before = path.read_bytes()
    assert fix(path, "--in-place").exit_code == 1
    assert path.read_bytes() == before
    assert_repaired(path, "--unsafe")


def test_a_renamed_link_that_graphs_follow_is_one_mistake_with_one_repair(tmp_path: Path) -> None:
    link = f"{ROBOT}/base_footprint"
    path = saved(tmp_path, {"move": [link, f"{ROBOT}/base"]}, checkpoint="05")
    listed = fix(path, "--unsafe").stdout
    assert [line.split()[2] for line in listed.splitlines() if line.startswith("would")] == ["S01"]
    assert_repaired(path, "--unsafe")
    assert "nameOverride" not in path.read_text()


def test_a_graph_whose_place_is_taken_is_offered_no_repair(tmp_path: Path) -> None:
    path = saved(tmp_path, {"copy": [DRIVE, f"{DRIVE}_01"]}, {"deactivate": DRIVE})
    left, way = fix(path, "--in-place", "--unsafe").stdout.splitlines()[:2]
    assert left.startswith(f"left error G02 {DRIVE}_01: ")
    assert way.startswith(f"    repair it by hand: delete the prim at {DRIVE} first")


def test_a_renamed_graph_whose_wires_lead_to_its_right_path_is_one_mistake(tmp_path: Path) -> None:
    path = saved(tmp_path)
    path.write_text(path.read_text().replace('OmniGraph "ROS_Drive"', 'OmniGraph "Mine"'))
    listed = fix(path, "--unsafe").stdout.splitlines()
    assert listed[0].startswith(f"would repair G02 {ROBOT}/Mine: ")
    assert listed[0].endswith("; 13 wires lead to its nodes there")
    assert listed[1].endswith(": 1 would be repaired, 0 left")
    assert_repaired(path, "--unsafe")


def test_what_belongs_to_a_later_checkpoint_is_removed_with_unsafe(tmp_path: Path) -> None:
    path = written(correct_stage("04"), tmp_path, "00")
    assert fix(path, "--in-place").exit_code == 1
    assert fix(path, "--in-place", "--unsafe").exit_code == 0
    assert path.read_text().strip() == correct_stage("00").GetRootLayer().ExportToString().strip()


def test_a_prim_that_is_restored_brings_nothing_of_later_checkpoints(tmp_path: Path) -> None:
    path = saved(tmp_path, {"deactivate": f"{ROBOT}/base_scan"}, checkpoint="00")
    assert fix(path, "--in-place", "--unsafe").exit_code == 0
    assert "Lidar2D" not in path.read_text()


BALL = f"{ROBOT}/caster_back_link/collisions/ball"
TREE = "ROS_OdomTF/ros2_publish_raw_transform_tree"
FAULTS: dict[str, Step] = {
    "time samples hold another value": {"sample": [RADIUS, 0, 0.033]},
    "a spline holds another value": {"spline": [RADIUS, (0, 0.033)]},
    "time samples move the camera": {
        "sample": [
            f"{ROBOT}/base_footprint/Camera_1.xformOp:translate",
            0,
            [0.1, 0.1, 0.2],
        ]
    },
    "a second node publishes a transform": {"copy": [TREE, f"{TREE}_01"]},
    "a link counts its mass for nothing": {"schema off": [f"{ROBOT}/base_scan", "PhysicsMassAPI"]},
    "a joint is deactivated": {"deactivate": f"{JOINTS}/base_joint"},
    "a shape of a link was moved": {"set": [f"{BALL}.xformOp:translate", (0.0, 0.05, -0.05)]},
    "a frame has another name": {"set": [f"{ROBOT}/base_scan.isaac:nameOverride", "laser"]},
    "a joint is switched off": {
        "declare": [f"{JOINTS}/base_joint.physics:jointEnabled", "bool", False]
    },
    "a rate of the lidar has another type": {
        "declare": [f"{ROBOT}/base_scan/Lidar2D.omni:sensor:Core:scanRateBaseHz", "float", 10.0]
    },
    "a link stands below another": {
        "move": [f"{ROBOT}/wheel_left_link", f"{ROBOT}/base_link/wheel_left_link"]
    },
    "a link with graphs stands below another": {
        "move": [f"{ROBOT}/base_scan", f"{ROBOT}/base_link/base_scan"]
    },
    "a link hangs on a hinge": {"type of prim": [f"{JOINTS}/scan_joint", "PhysicsRevoluteJoint"]},
    "a link has another name": {"move": [f"{ROBOT}/wheel_left_link", f"{ROBOT}/wheel_left"]},
    "the robot stands below another prim": {"move": [ROBOT, f"/World{ROBOT}"]},
}


AT_ONCE = [  # in one stage, of the checkpoint that has what they are made in
    (
        "02",
        "time samples hold another value",
        "a link counts its mass for nothing",
        "a joint is deactivated",
        "a shape of a link was moved",
    ),
    (
        "02",
        "a spline holds another value",
        "a joint is switched off",
        "a link stands below another",
    ),
    ("02", "a link has another name", "a link hangs on a hinge"),
    ("02", "the robot stands below another prim"),
    (
        "05",
        "time samples move the camera",
        "a second node publishes a transform",
        "a frame has another name",
        "a rate of the lidar has another type",
    ),
    ("05", "a link with graphs stands below another"),
]


@pytest.mark.parametrize(("checkpoint", "faults"), [(at, faults) for at, *faults in AT_ONCE])
def test_what_somebody_else_would_do_is_repaired(
    tmp_path: Path, checkpoint: str, faults: list[str]
) -> None:
    path = saved(tmp_path, *(FAULTS[fault] for fault in faults), checkpoint=checkpoint)
    result = fix(path, "--in-place", "--unsafe")
    assert result.exit_code == 0, result.stdout
    assert result.stdout.count("\nrepaired ") >= len(faults), result.stdout
    assert verdict(path) == "pass"


def test_each_fault_that_somebody_else_would_make_is_made() -> None:
    assert sorted(fault for _, *faults in AT_ONCE for fault in faults) == sorted(FAULTS)


LEFT, RIGHT = f"{JOINTS}/wheel_left_joint", f"{JOINTS}/wheel_right_joint"
SAFELY: dict[str, list[Step]] = {
    "places of wheels are exchanged": [
        {"swap": [f"{LEFT}.physics:localPos0", f"{RIGHT}.physics:localPos0"]}
    ],
    "names of wheels are exchanged": [
        {"move": [LEFT, f"{JOINTS}/other"]},
        {"move": [RIGHT, LEFT]},
        {"move": [f"{JOINTS}/other", RIGHT]},
    ],
    "links have no weight": [
        {"declare": [f"{ROBOT}/{link}.physxRigidBody:disableGravity", "bool", True]}
        for link in load_lab().scene.robot.links
    ],
}


@pytest.mark.parametrize("fault", SAFELY)
def test_what_can_mean_one_thing_alone_is_repaired_without_unsafe(
    tmp_path: Path, fault: str
) -> None:
    assert_repaired(saved(tmp_path, *SAFELY[fault]))


@pytest.mark.parametrize("prim", ["base_footprint/Camera_1", "caster_back_link"])
def test_what_is_only_deactivated_is_activated_without_unsafe(tmp_path: Path, prim: str) -> None:
    assert_repaired(saved(tmp_path, {"deactivate": f"{ROBOT}/{prim}"}, checkpoint="04"))


def test_a_link_that_two_prims_could_be_is_not_added_again(tmp_path: Path) -> None:
    link = f"{ROBOT}/wheel_left_link"
    copies: list[Step] = [
        {"copy": [link, f"{ROBOT}/{each}/wheel_left_link"]} for each in ("base_link", "base_scan")
    ]
    path = saved(tmp_path, *copies, {"remove": link})
    old = path.read_bytes()
    assert fix(path, "--in-place", "--unsafe").exit_code == 1
    assert path.read_bytes() == old


LIDAR = f"{ROBOT}/base_scan/Lidar2D"
PRODUCT = f"{LIDAR}/ROS_Lidar2D/isaac_create_render_product"


def as_attribute(stage: Usd.Stage, path: str, value: str) -> None:
    prim = stage.GetPrimAtPath(Sdf.Path(path).GetPrimPath())
    prim.RemoveProperty(Sdf.Path(path).name)
    prim.CreateAttribute(Sdf.Path(path).name, Sdf.ValueTypeNames.String).Set(value)


def as_relationship(stage: Usd.Stage, path: str, target: str) -> None:
    prim = stage.GetPrimAtPath(Sdf.Path(path).GetPrimPath())
    prim.RemoveProperty(Sdf.Path(path).name)
    prim.CreateRelationship(Sdf.Path(path).name).SetTargets([target])


OF_ANOTHER_KIND: dict[str, tuple[Callable[[Usd.Stage, str, str], None], str]] = {
    "a relationship of a node": (as_attribute, f"{PRODUCT}.inputs:cameraPrim"),
    "a relationship of the scene": (as_attribute, f"{LEFT}.physics:body1"),
    "an input": (as_relationship, f"{CLOCK}/ros2_context.inputs:domain_id"),
    "an input with a wire": (as_relationship, f"{CLOCK}/ros2_publish_clock.inputs:execIn"),
    "a value of the scene": (as_relationship, f"{LEFT}.physics:localPos0"),
}


@pytest.mark.parametrize("cases", [[*OF_ANOTHER_KIND][:-1], [*OF_ANOTHER_KIND][-1:]], ids=", ".join)
def test_attributes_for_relationships_are_repaired_and_the_reverse(
    tmp_path: Path, cases: list[str]
) -> None:
    stage = correct_stage("03")
    sites = {OF_ANOTHER_KIND[case][1] for case in cases}
    for case in cases:
        write, site = OF_ANOTHER_KIND[case]
        write(stage, site, LIDAR)
    path = written(stage, tmp_path, "03")
    found = [finding for finding in check_stage(path).findings if finding.fix]
    assert {f"{finding.prim}.{finding.property}" for finding in found} == sites
    assert_repaired(path)


def test_a_stage_with_an_attribute_for_a_relationship_is_compared_and_played(
    tmp_path: Path, starter: Path
) -> None:
    stage = correct_stage("05")
    as_attribute(stage, f"{LEFT}.physics:body1", f"{ROBOT}/wheel_left_link")
    path = written(stage, tmp_path, "05")
    result = against_starter(check_stage(path), open_starter(starter, load_lab()), load_lab())
    assert [finding.rule for finding in result.findings if finding.severity == "error"] == ["S08"]
    assert dry_run(path, load_lab(), "05", "0.15,0,0.6 0,0.8,0.4").behaviour.verdict == "bad"


def test_a_node_that_works_in_another_graph_is_not_added_again(tmp_path: Path) -> None:
    graph, other = f"{ROBOT}/ROS_OdomTF", f"{ROBOT}/ROS_RawTF"
    gone = ("ros2_publish_odometry", "isaac_compute_transform_tree", "ros2_publish_transform_tree")
    steps: list[Step] = [{"copy": [graph, other]}, {"remove": f"{graph}/{TREE.rpartition('/')[2]}"}]
    steps += [{"remove": f"{other}/{each}"} for each in gone]
    path = saved(tmp_path, *steps, checkpoint="05")
    old = path.read_bytes()
    result = fix(path, "--in-place", "--unsafe")
    assert (result.exit_code, path.read_bytes()) == (1, old)
    assert "left error N01" in result.stdout


WALL, CRATE = "/Environment/Walls/North", "/Environment/Furniture/CrateA"
TYRE = f"{ROBOT}/wheel_left_link/collisions/tyre"
SHAPE = f"{ROBOT}/colliders/wheel/tyre"  # of both
CHANGES: dict[str, Step] = {
    "a wall is deactivated": {"deactivate": WALL},
    "a wall is gone": {"remove": WALL},
    "a wall has another type": {"type of prim": [WALL, "Sphere"]},
    "a crate was moved": {"set": [f"{CRATE}.xformOp:translate", (1.0, 1.0, 0.2)]},
    "a crate collides no more": {"schema off": [CRATE, "PhysicsCollisionAPI"]},
    "a tyre is larger": {"set": [f"{TYRE}.radius", 0.05]},
    "both tyres are larger": {"set": [f"{SHAPE}.radius", 0.05]},
    "both tyres have lost their size": {"remove property": f"{SHAPE}.radius"},
    "both tyres have lost their material": {"remove property": f"{SHAPE}.material:binding:physics"},
    "a joint is switched off": {
        "declare": [f"{JOINTS}/scan_joint.physics:jointEnabled", "bool", False]
    },
}


@pytest.fixture(scope="module")
def starter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("starter") / "starter.usda"
    build_starter(path)
    return path


TOGETHER = [  # what one stage can have at once
    ("a wall is deactivated", "a crate was moved", "a tyre is larger", "a joint is switched off"),
    ("a wall is gone", "a crate collides no more", "both tyres are larger"),
    ("a wall has another type", "both tyres have lost their size"),
    ("both tyres have lost their material",),
]


@pytest.mark.parametrize("changes", TOGETHER, ids=", ".join)
def test_with_the_starter_what_was_changed_of_it_is_restored(
    tmp_path: Path, starter: Path, changes: tuple[str, ...]
) -> None:
    path = saved(tmp_path, *(CHANGES[change] for change in changes), checkpoint="00")
    result = fix(path, "--in-place", "--unsafe", "--starter", str(starter))
    assert (result.exit_code, "\nrepaired " in f"\n{result.stdout}") == (0, True), result.stdout
    compared = open_starter(starter, load_lab())
    assert against_starter(check_stage(path), compared, load_lab()).verdict == "pass"


def test_with_the_starter_a_ground_that_was_lowered_is_raised(
    tmp_path: Path, starter: Path
) -> None:
    stage = correct_stage("02")
    ground = UsdGeom.Xformable(stage.GetPrimAtPath("/Environment/GroundPlane"))
    ground.AddTranslateOp().Set((0.0, 0.0, -0.1))
    path = written(stage, tmp_path)
    assert_repaired(path, "--starter", str(starter))


def test_a_room_that_was_lowered_with_its_ground_is_raised(tmp_path: Path) -> None:
    stage = correct_stage("02")
    stage.GetAttributeAtPath("/Environment.xformOp:translate").Set((-0.2, -0.2, -0.2))
    path = written(stage, tmp_path)
    assert [finding.rule for finding in check_stage(path).findings] == ["S19"]
    assert_repaired(path)


def test_what_stands_elsewhere_than_in_the_starter_is_offered_no_repair(
    tmp_path: Path, starter: Path
) -> None:
    path = saved(tmp_path, {"move": [LEFT, f"{ROBOT}/base_link/wheel_left_joint"]})
    compared = open_starter(starter, load_lab())
    (found,) = against_starter(check_stage(path), compared, load_lab()).findings
    assert (found.rule, found.fix) == ("U05", None)


def test_what_is_wrong_where_others_refer_to_is_taken_away_there(
    tmp_path: Path, starter: Path
) -> None:
    stage = correct_stage("02")
    UsdPhysics.CollisionAPI(stage.GetPrimAtPath(SHAPE)).CreateCollisionEnabledAttr(False)  # noqa: FBT003
    path = written(stage, tmp_path)
    assert fix(path, "--in-place", "--starter", str(starter)).exit_code == 0
    assert "collisionEnabled" not in path.read_text()


def test_what_is_wrong_in_another_file_is_overridden_by_the_right_value(tmp_path: Path) -> None:
    (tmp_path / "files").mkdir()
    other = Sdf.Layer.CreateNew(str(tmp_path / "files/other.usda"))
    shape = Sdf.CreatePrimInLayer(other, "/tyre")
    Sdf.AttributeSpec(shape, "physics:collisionEnabled", Sdf.ValueTypeNames.Bool).default = False
    other.Save()
    stage = correct_stage("02")
    stage.GetPrimAtPath(SHAPE).GetReferences().AddReference("files/other.usda", "/tyre")
    path = written(stage, tmp_path)
    assert verdict(path) == "fail"
    assert fix(path, "--in-place").exit_code == 0
    assert path.read_text().count("bool physics:collisionEnabled = 1") == 2


def test_a_binary_stage_is_repaired(tmp_path: Path) -> None:
    path = saved(tmp_path, WRONG_RADIUS, ending=".usd")
    assert path.read_bytes().startswith(b"PXR-USDC")
    assert_repaired(path)
    assert path.read_bytes().startswith(b"PXR-USDC")


def layered(folder: Path) -> tuple[Path, Path]:
    """A stage whose root says nothing, above a sublayer with a wrong value."""
    below = saved(folder, WRONG_RADIUS).rename(folder / "below.usda")
    root = folder / "Lab3_02_ros_drive.usda"
    layer = Sdf.Layer.CreateNew(str(root))
    layer.subLayerPaths.append("below.usda")
    source = Sdf.Layer.FindOrOpen(str(below))
    for name in ("upAxis", "metersPerUnit", "kilogramsPerUnit"):
        layer.pseudoRoot.SetInfo(name, source.pseudoRoot.GetInfo(name))
    layer.Save()
    return root, below


def test_the_layer_that_holds_the_opinion_is_repaired(tmp_path: Path) -> None:
    root, below = layered(tmp_path)
    old = root.read_bytes()
    result = fix(root, "--in-place")
    assert (result.exit_code, root.read_bytes()) == (0, old)
    assert f"written: {below}" in result.stdout.replace("../", "/") or "below.usda" in result.stdout
    assert "inputs:wheelRadius = 0.025" in below.read_text()


def test_a_layer_of_another_folder_is_not_edited_through_a_link(tmp_path: Path) -> None:
    shared, own = tmp_path / "shared", tmp_path / "own"
    for folder in (shared, own):
        folder.mkdir()
    root, below = layered(own)
    below.rename(shared / "below.usda")
    below.symlink_to(shared / "below.usda")
    old = below.read_bytes()
    assert fix(root, "--in-place").exit_code == 0
    assert (below.read_bytes(), check_stage(root).verdict) == (old, "pass")


@pytest.mark.parametrize("is_linked", [False, True])
def test_the_layers_beside_a_linked_stage_are_repaired(
    is_linked: bool,  # noqa: FBT001 - a parameter of the test
    tmp_path: Path,
) -> None:
    """Beside the link stands the layer itself, or a link to one beside the stage."""
    store, own = tmp_path / "store", tmp_path / "own"
    for folder in (store, own):
        folder.mkdir()
    root, below = layered(store)
    if is_linked:
        (own / below.name).symlink_to(below)
    else:
        below = below.rename(own / below.name)
    (own / root.name).symlink_to(root)
    assert fix(own / root.name, "--in-place").exit_code == 0
    assert "inputs:wheelRadius = 0.025" in below.read_text()


def test_with_an_output_the_root_layer_alone_is_written(tmp_path: Path) -> None:
    root, below = layered(tmp_path)
    old = below.read_bytes()
    output = tmp_path / "Lab3_02_repaired.usda"
    assert fix(root, "-o", str(output)).exit_code == 0
    assert (below.read_bytes(), check_stage(output).verdict) == (old, "pass")


def test_an_output_where_the_stage_does_not_hold_together_is_refused(tmp_path: Path) -> None:
    root, _ = layered(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    output = tmp_path / "elsewhere" / "Lab3_02_repaired.usda"
    with pytest.raises(Lab3Error, match="worse than before"):
        fix(root, "-o", str(output))
    assert not output.exists()


def test_a_renamed_graph_is_renamed_back_with_its_paths(tmp_path: Path) -> None:
    stage = correct_stage("02")
    editor = Usd.NamespaceEditor(stage)
    editor.MovePrimAtPath(CLOCK, "/World/Clock")
    editor.ApplyEdits()
    path = written(stage, tmp_path)
    path.write_text(path.read_text() + "\n# about </World/Clock>\n")
    old = path.read_text()
    assert fix(path, "--in-place", "--unsafe").exit_code == 0
    gone, added = changed_lines(old, path.read_text())
    assert [
        each.replace("/World/Clock", CLOCK).replace('"Clock"', '"ROS_Clock"') for each in gone
    ] == added
    assert "# about </World/Clock>" in path.read_text()


def test_a_package_is_refused(tmp_path: Path) -> None:
    path, package = saved(tmp_path), tmp_path / "Lab3_02_ros_drive.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(path), str(package))
    with pytest.raises(Lab3Error, match="is a package"):
        fix(package, "--in-place")


def test_a_moved_graph_with_a_wrong_value_is_repaired_at_once(tmp_path: Path) -> None:
    stage = broken("02", [WRONG_RADIUS])
    editor = Usd.NamespaceEditor(stage)
    editor.MovePrimAtPath(DRIVE, "/World/Drive")
    editor.ApplyEdits()
    path = written(stage, tmp_path)
    assert fix(path, "--in-place", "--unsafe").exit_code == 0
    assert "/World/Drive" not in path.read_text()


@pytest.mark.parametrize("ways", [("--diff", "--in-place"), ("--in-place", "-o", "x.usda")])
def test_two_ways_to_answer_exclude_each_other(tmp_path: Path, ways: tuple[str, ...]) -> None:
    with pytest.raises(Lab3Error, match="exclude each other"):
        fix(saved(tmp_path), *ways)


def test_a_stage_without_faults_is_left_alone(tmp_path: Path) -> None:
    path = saved(tmp_path)
    old = path.read_bytes()
    diff = fix(path, "--diff")
    assert (diff.exit_code, diff.stdout) == (0, "")
    assert fix(path, "--in-place", "--unsafe").exit_code == 0
    assert (path.read_bytes(), [*tmp_path.iterdir()]) == (old, [path])


def test_a_terminal_has_long_lines_folded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(options, "terminal_width", lambda: 80)
    assert fix(saved(tmp_path, WRONG_RADIUS)).stdout.splitlines()[:3] == [
        "would repair P01",
        f"    {RADIUS}:",
        "    inputs:wheelRadius is 0.033, expected 0.025",
    ]
