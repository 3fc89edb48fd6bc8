"""Repairs of stages that are spread over files: every way of layering comes out right."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from fixing import has_errors, repaired_in, second_faults
from layerings import LAYERINGS
from pxr import Sdf, Usd, UsdGeom
from sabotage import Fault
from scene_stages import Change, collider, move_prim, refer, several, void, without_api
from second_author import Style

from lab3_usd.fix.repairing import FixOptions, fix_stage
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.starter import build_starter

Layering = Callable[[Path, Path, str, Style], Path]
RIGHT, WRONG = b"inputs:wheelRadius = 0.025", b"inputs:wheelRadius = 0.033"
IN_TEXT = [layering for layering in LAYERINGS if "binary" not in layering.__name__]


@pytest.fixture(scope="module")
def supplied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The starter of the lab."""
    path = tmp_path_factory.mktemp("supplied") / "supplied.usda"
    build_starter(path)
    return path


def with_a_wrong_value(layering: Layering, folder: Path, supplied: Path) -> Path:
    starter = Path(shutil.copy(supplied, folder))
    path = layering(folder, starter, "02", Style())
    for file in folder.iterdir():
        file.write_bytes(file.read_bytes().replace(RIGHT, WRONG))
    return path


@pytest.mark.parametrize(
    ("layering", "root_only"),
    [*((way, False) for way in IN_TEXT), *((way, True) for way in IN_TEXT[1:4:2])],
)
def test_a_value_in_any_layer_is_repaired(
    layering: Layering,
    root_only: bool,  # noqa: FBT001 - a parameter of the test
    tmp_path: Path,
    supplied: Path,
) -> None:
    path = with_a_wrong_value(layering, tmp_path, supplied)
    fixed = fix_stage(path, "02", load_lab(), FixOptions(root_only=root_only))
    assert has_errors(fixed.before)
    for file, data in fixed.files.items():
        file.write_bytes(data)
    assert len(fixed.files) == 1
    assert check_stage(path, "02").verdict == "pass"


ROBOT = "/turtlebot3_burger"
LIDAR, CAMERA = f"{ROBOT}/base_scan/Lidar2D", f"{ROBOT}/base_footprint/Camera_1"
DRIVE = f"{ROBOT}/ROS_Drive"


def again(path: str, to: str) -> Change:
    """Put a copy of a graph somewhere else."""

    def change(stage: Usd.Stage) -> None:
        layer = stage.GetRootLayer()
        Sdf.CopySpec(layer, path, layer, to)

    return change


def strayed_wire(stage: Usd.Stage) -> None:
    """Connect an input that the lab leaves alone."""
    controller = stage.GetPrimAtPath(f"{DRIVE}/differential_controller")
    source = next(iter(controller.GetAttribute("inputs:execIn").GetConnections()))
    controller.GetAttribute("inputs:wheelRadius").SetConnections([source])


# Each mistake in one structure, each of which takes another way through the editors of layers, in
# the first stage that has what it is made in.
MISTAKES: dict[str, tuple[Change, str, str]] = {
    "graph moved": (move_prim(DRIVE, f"{ROBOT}/ActionGraph"), "references", "02"),
    "graph at another parent": (
        move_prim(f"{CAMERA}/ROS_Camera", f"{ROBOT}/base_footprint/Graph"),
        "payloads",
        "04",
    ),
    "lidar renamed": (
        move_prim(LIDAR, f"{ROBOT}/base_scan/Example_Rotary_2D"),
        "binary",
        "03",
    ),
    "lidar at the root": (move_prim(LIDAR, "/Lidar2D"), "variants", "03"),
    "camera elsewhere": (move_prim(CAMERA, "/World/Camera_1"), "elsewhere", "04"),
    "both sensors": (
        several(move_prim(LIDAR, "/World/Lidar2D"), move_prim(CAMERA, f"{ROBOT}/Camera_1")),
        "text",
        "05",
    ),
    "wheel without a shape": (
        without_api(collider("wheel_left_link"), "PhysicsCollisionAPI"),
        "sublayers",
        "02",
    ),
    "room below the robot": (
        move_prim("/Environment", f"{ROBOT}/Environment"),
        "references",
        "01",
    ),
    "other units": (
        lambda stage: void(UsdGeom.SetStageMetersPerUnit(stage, 0.01)),
        "elsewhere",
        "01",
    ),
    "clock twice": (again("/World/ROS_Clock", "/World/Clock"), "sublayers", "01"),
    "wire that is not asked for": (strayed_wire, "variants", "02"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_stands_in_any_file_is_moved_and_removed(mistake: str, tmp_path: Path) -> None:
    change, structure, checkpoint = MISTAKES[mistake]
    fault = Fault(mistake, "scene", change, ())
    repaired = repaired_in(structure, checkpoint, [fault], tmp_path, load_lab())
    assert repaired is not None
    assert [finding.rule for finding in repaired.after if finding.severity == "error"] == []


def test_what_refers_to_a_file_is_not_copied_without_it(tmp_path: Path) -> None:
    there = f"{ROBOT}/base_scan/Example_Rotary_2D"
    change = several(move_prim(LIDAR, there), refer(there, "https://assets.example/lidar.usd"))
    fault = Fault("lidar of an asset renamed", "scene", change, ())
    repaired = repaired_in("elsewhere", "03", [fault], tmp_path, load_lab())
    assert repaired is not None
    assert ("L02", there) in {(finding.rule, finding.prim) for finding in repaired.after}
    moved = repaired_in("text", "03", [fault], tmp_path, load_lab())
    assert moved is not None
    assert "L02" not in {finding.rule for finding in moved.after}


def test_a_missing_node_whose_name_is_taken_is_added_under_another(tmp_path: Path) -> None:
    faults = {fault.name: fault for fault in second_faults("02")}
    pair = [
        faults["ROS_Drive/constant_token deactivated"],
        faults["ROS_Drive/ros2_subscribe_twist retyped"],  # which plays the role of the token now
    ]
    repaired = repaired_in("text", "02", pair, tmp_path, load_lab())
    assert repaired is not None
    assert repaired.after == ()


def test_a_prim_is_renamed_where_an_input_is_connected_at_once(tmp_path: Path) -> None:
    faults = {fault.name: fault for fault in second_faults("02")}
    wire = "on_playback_tick.tick -> articulation_controller.execIn"
    pair = [
        faults["wheel_left_joint renamed"],
        faults[f"ROS_Drive: {wire} moved to inputs:robotPath"],
    ]
    repaired = repaired_in("text", "02", pair, tmp_path, load_lab())
    assert repaired is not None
    assert repaired.after == ()


def test_what_is_moved_is_restored_where_it_is_moved_to(tmp_path: Path) -> None:
    faults = {fault.name: fault for fault in second_faults("05")}
    pair = [
        faults["omni:sensor:Core:farRangeM 0.2, within which is nothing"],
        faults["lidar renamed"],
    ]
    repaired = repaired_in("variants", "05", pair, tmp_path, load_lab(), drive=True)
    assert repaired is not None
    assert (has_errors(repaired.after), repaired.wrong) == (False, ())


def test_a_bare_lidar_in_place_of_a_missing_one_gets_all_that_makes_a_flat_scan(
    tmp_path: Path,
) -> None:
    faults = {fault.name: fault for fault in second_faults("05")}
    pair = [faults["no lidar"], faults["second lidar"]]
    repaired = repaired_in("text", "05", pair, tmp_path, load_lab(), drive=True)
    assert repaired is not None
    assert [finding.rule for finding in repaired.after if finding.severity != "note"] == []
    assert repaired.wrong == ()
