"""Labs that lack a part: they build, check and draw, and nothing is said of the part."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from in_process import invoke
from places import REPOSITORY
from pxr import Usd

from lab3_usd.stage.read.opening import kept_open

Edit = Callable[[dict[str, dict[str, Any]]], None]
FILES = ("checkpoints", "scene", "ros", "submission", "starter")


def without_graph(files: dict[str, dict[str, Any]], checkpoint: str, *topics: str) -> None:
    """Leave out a checkpoint, its topics and the commands about them."""
    del files["checkpoints"]["checkpoints"][checkpoint]
    files["submission"]["stages"]["differ"].remove(checkpoint)
    for topic in topics:
        del files["ros"]["topics"][topic]
    files["ros"]["commands"] = [c for c in files["ros"]["commands"] if c.get("of") not in topics]


def no_lidar(files: dict[str, dict[str, Any]]) -> None:
    without_graph(files, "4", "/jetbot/scan")
    del files["scene"]["sensors"]["lidar"]


def no_imu(files: dict[str, dict[str, Any]]) -> None:
    without_graph(files, "5", "/jetbot/imu")
    del files["scene"]["sensors"]["imu"]
    files["checkpoints"]["frames"]["edges"].remove("chassis -> Imu")


def no_sensors(files: dict[str, dict[str, Any]]) -> None:
    no_lidar(files)
    no_imu(files)
    del files["scene"]["sensors"]


def no_wheels(files: dict[str, dict[str, Any]]) -> None:
    without_graph(files, "3", "/jetbot/cmd_vel")
    del files["scene"]["robot"]["wheels"]


def bolted_down(files: dict[str, dict[str, Any]]) -> None:
    no_wheels(files)
    chassis = jetbot(files)["chassis"]
    bolt = {"type": "PhysicsFixedJoint", "targets": {"physics:body1": ["/World/Jetbot/chassis"]}}
    chassis["children"]["bolt"] = bolt


def no_articulation(files: dict[str, dict[str, Any]]) -> None:
    del files["scene"]["robot"]["articulation"]
    chassis = jetbot(files)["chassis"]
    chassis["apis"] = [name for name in chassis["apis"] if "Articulation" not in name]


def no_limit_of_the_pose(files: dict[str, dict[str, Any]]) -> None:
    del files["scene"]["robot"]["pose_is_error_until"]


def jetbot(files: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return the prims of the robot in the starter."""
    found: dict[str, Any] = files["starter"]["prims"]["World"]["children"]["Jetbot"]["children"]
    return found


def no_frames(files: dict[str, dict[str, Any]]) -> None:
    without_graph(files, "6", "/jetbot/odom", "/tf")
    files["checkpoints"]["frames"] = {"handout": ""}
    files["scene"]["robot"]["pose_is_error_until"] = "5"


def no_world(files: dict[str, dict[str, Any]]) -> None:
    world = files["scene"]["world"]
    files["scene"]["world"] = {"graph_parent": world["graph_parent"]}
    prims = files["starter"]["prims"]["World"]["children"]
    del prims["PhysicsScene"], prims["Room"]


def metres(files: dict[str, dict[str, Any]]) -> None:
    """Have stages in centimetres, of a robot that stands on nothing: shapes are not converted."""
    no_wheels(files)
    no_world(files)
    files["scene"]["stage"]["meters_per_unit"] = 0.01
    joints = jetbot(files)["chassis"]["children"]
    joints["mast_joint"]["set"]["physics:localPos0"] = [4.0, 0.0, 12.0]


LACKS: dict[str, Edit] = {
    "lidar": no_lidar,
    "IMU": no_imu,
    "sensors": no_sensors,
    "wheels": no_wheels,
    "wheels, bolted down": bolted_down,
    "articulation": no_articulation,
    "limit of the pose": no_limit_of_the_pose,
    "frames": no_frames,
    "world": no_world,
    "metres": metres,
}


# What does not work without the part, in Isaac Sim as in a dry run: no controller moves what is no
# articulation. A ground is supplied where a lab has none; a lidar alone is not judged.
DOES_NOT_WORK = {"articulation": {"follows"}}


def edited(folder: Path, *edits: Edit) -> Path:
    """Write the second lab after these edits, and without a rubric."""
    shutil.copytree(REPOSITORY / "docs" / "examples" / "labs" / "jetbot", folder)
    files = {name: quick_yaml.load((folder / f"{name}.yaml").read_text()) for name in FILES}
    for edit in edits:
        edit(files)
    for name, data in files.items():
        (folder / f"{name}.yaml").write_text(quick_yaml.dump(data))
    (folder / "rubric.yaml").unlink()
    return folder


@pytest.fixture(params=LACKS)
def lab(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The second lab without one of its parts."""
    folder = edited(tmp_path / "lab", LACKS[request.param])
    if request.param in {"IMU", "sensors"}:
        _drop_target(folder)
    return folder


def _drop_target(folder: Path) -> None:
    path = folder / "Odometry.yaml"
    data = quick_yaml.load(path.read_text())
    data["nodes"]["links"]["targets"]["targetPrims"].remove("/World/Jetbot/chassis/Imu")
    path.write_text(quick_yaml.dump(data))


def run(lab: Path, *arguments: object) -> str:
    result = invoke("--lab", lab, *arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_its_stages_pass_and_nothing_is_said_of_what_it_lacks(
    request: pytest.FixtureRequest, lab: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    built = run(lab, "build", "--out", out).split()
    part = request.node.callspec.params["lab"]
    # The last stage stays open: it is read and judged once for all that is asked of it.
    with kept_open():
        names = built[::-2][::-1]
        found = json.loads(run(lab, "check", "--starter", built[0], "--format", "json", *names))
        assert {each["verdict"] for each in found["results"]} == {"pass"}
        assert {f["rule"] for each in found["results"] for f in each["findings"]} <= {"P09"}
        assert run(lab, "check", "--format", "html", built[-1]).startswith("<!DOCTYPE html>")
        assert run(lab, "draw", built[-1], "--out", tmp_path / "pictures")
        assert bad_in_a_dry_run(lab, built[-1]) == DOES_NOT_WORK.get(part, set())


def bad_in_a_dry_run(lab: Path, stage: str) -> set[str]:
    short = ("--drive", "0.15,0,1 0,0.8,0.5")
    played = json.loads(invoke("--lab", lab, "sim", stage, *short, "--format", "json").stdout)
    return {check["name"] for check in played["checks"] if check["verdict"] == "bad"}


def no_mast_joint(files: dict[str, dict[str, Any]]) -> None:
    del jetbot(files)["chassis"]["children"]["mast_joint"]


def no_first_checkpoint(files: dict[str, dict[str, Any]]) -> None:
    without_graph(files, "1")


def test_a_robot_without_wheels_still_needs_its_joints(tmp_path: Path) -> None:
    folder = edited(tmp_path / "lab", no_wheels, no_mast_joint)
    built = run(folder, "build", "--out", tmp_path / "out", "--only", "1").split()
    result = invoke("--lab", folder, "check", "--format", "json", *built)
    (stage,) = json.loads(result.stdout)["results"]
    assert [(f["rule"], f["prim"]) for f in stage["findings"]] == [("S12", "/World/Jetbot/mast")]


def test_stamps_that_restart_with_the_clock_are_no_note(tmp_path: Path) -> None:
    folder = edited(tmp_path / "lab")
    for path in folder.glob("*.yaml"):
        said = path.read_text().replace("resetOnStop: false", "resetOnStop: true")
        path.write_text(said)
    built = run(folder, "build", "--out", tmp_path / "out", "--only", "6").split()
    (stage,) = json.loads(run(folder, "check", "--format", "json", *built))["results"]
    assert stage["findings"] == []


def test_a_stage_in_centimetres_shows_what_its_panel_should_show(tmp_path: Path) -> None:
    folder = edited(tmp_path / "lab", metres)
    (path,) = run(folder, "build", "--out", tmp_path / "out", "--only", "5").split()
    stage = Usd.Stage.Open(path)
    place = stage.GetPrimAtPath("/World/Jetbot/chassis/Imu").GetAttribute("xformOp:translate")
    assert tuple(place.Get()) == (0.0, 0.0, 5.0)
    place.Set((0.0, 0.0, 0.05))  # what the file says, in metres
    stage.GetRootLayer().Save()
    result = invoke("--lab", folder, "check", "--format", "json", path)
    errors = [
        (load["rule"], load["actual"], load["expected"])
        for load in json.loads(result.stdout)["results"][0]["findings"]
        if load["severity"] == "error"
    ]
    assert errors == [("D04", "(0, 0, 0.05)", "(0, 0, 5)")]


def test_a_starter_is_not_told_of_what_the_first_checkpoint_adds(tmp_path: Path) -> None:
    starter = tmp_path / "starter.usda"
    run(edited(tmp_path / "whole"), "starter", "--out", starter)
    folder = edited(tmp_path / "lab", no_first_checkpoint)
    result = invoke("--lab", folder, "build", starter, "--out", tmp_path / "out", "--only", "2")
    assert (result.exit_code, result.stderr) == (0, "")
