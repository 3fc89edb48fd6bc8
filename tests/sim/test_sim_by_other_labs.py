"""`lab3 sim` at the checkpoints of labs that say less, or something else, than the bundled one."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
import quick_yaml
from breaking import the_lab
from dry_runs import BRIEFLY
from foreign_robots import rover
from in_process import invoke
from msgspec.structs import replace

from lab3_usd.sim.judge.topics import expected_at
from lab3_usd.spec.load.loader import load_lab


@pytest.fixture
def lab(repository: Path, tmp_path: Path) -> Path:
    """A copy of the second lab."""
    folder = tmp_path / "lab"
    shutil.copytree(repository / "docs" / "examples" / "labs" / "jetbot", folder)
    return folder


def verdicts(lab: Path, *words: str) -> dict[str, str]:
    """Build the last stage of a lab and play it."""
    (stage,) = invoke("--lab", lab, "build", "--only", "7", "--out", lab / "out").stdout.split()
    played = json.loads(invoke("--lab", lab, "sim", stage, "--format", "json", *words).stdout)
    return {check["name"]: check["verdict"] for check in played["checks"]}


def test_frames_of_odometry_come_from_its_graph(lab: Path) -> None:
    ros = quick_yaml.load((lab / "ros.yaml").read_text())
    for topic in ros["topics"].values():
        topic.pop("fields", None)
    (lab / "ros.yaml").write_text(quick_yaml.dump(ros))
    loaded = load_lab(lab)
    wanted = expected_at(loaded, loaded.checkpoints["7"])
    assert (wanted.root, wanted.base) == ("odom", "chassis")
    assert set(verdicts(lab, "--drive", BRIEFLY).values()) == {"ok"}


def test_without_odometry_the_tree_and_the_robot_name_the_frames() -> None:
    lab = the_lab()
    graphs = {name: graph for name, graph in lab.graphs.items() if name != "ROS_OdomTF"}
    topics = {name: topic for name, topic in lab.topics.items() if name != "/odom"}
    changed = replace(lab, graphs=graphs, ros=replace(lab.ros, topics=topics))
    wanted = expected_at(changed, lab.checkpoints["05"])
    assert (wanted.root, wanted.base) == ("odom", "base_footprint")


def test_a_clock_that_is_to_begin_anew_may_do_so(lab: Path) -> None:
    for path in lab.glob("*.yaml"):
        path.write_text(path.read_text().replace("resetOnStop: false", "resetOnStop: true"))
    assert verdicts(lab)["clock"] == "ok"


def test_a_clock_that_is_to_go_on_may_not_begin_anew(lab: Path) -> None:
    (stage,) = invoke("--lab", lab, "build", "--only", "7", "--out", lab / "out").stdout.split()
    text = Path(stage).read_text()
    Path(stage).write_text(text.replace("inputs:resetOnStop = 0", "inputs:resetOnStop = 1"))
    played = json.loads(invoke("--lab", lab, "sim", stage, "--format", "json").stdout)
    assert {check["name"]: check["verdict"] for check in played["checks"]}["clock"] == "bad"


@pytest.mark.parametrize(
    "limits",
    [
        "maxAngularSpeed: 0.5, maxLinearSpeed: 0.1",
        "maxAngularSpeed: 5.0, maxLinearSpeed: 1.5",
        "maxAngularSpeed: 2.0, maxLinearSpeed: 0.5, maxWheelSpeed: 4.0",
    ],
)
def test_the_drive_stays_below_the_limits_of_the_robot_and_shows_them(
    limits: str, lab: Path
) -> None:
    drive = lab / "Drive.yaml"
    written = "maxAngularSpeed: 2.0, maxLinearSpeed: 0.5"
    drive.write_text(drive.read_text().replace(written, limits))
    assert set(verdicts(lab, "--drive", BRIEFLY).values()) == {"ok"}


def test_limits_of_a_lab_in_centimetres_are_turned_into_metres(tmp_path: Path) -> None:
    stage = rover()
    stage.SetDefaultPrim(stage.GetPrimAtPath("/World"))
    stage.GetRootLayer().Export(str(tmp_path / "Rover_1.usda"))
    invoke("lab", "new", tmp_path / "lab", "--from", tmp_path / "Rover_1.usda")
    described = load_lab(tmp_path / "lab")
    checkpoint = described.checkpoints[described.last]
    wanted = expected_at(described, checkpoint)
    assert (wanted.limits, wanted.wheel_radius) == ((1.5, 0.0), 0.1)


def test_a_robot_turns_about_the_point_between_its_wheels(lab: Path) -> None:
    starter, ahead = lab / "starter.yaml", r"[0.1, \1, 0.03]"
    text = starter.read_text().replace(
        "[-0.02, 0.0, 0.0]", "[0.08, 0.0, 0.0]"
    )  # its weight as well
    starter.write_text(re.sub(r"\[0\.0, (-?0\.05625), 0\.03\]", ahead, text))
    found = verdicts(lab, "--drive", BRIEFLY)
    assert found["follows"] == "bad"  # by a lab that has the wheels below its base
    stage = next((lab / "out").iterdir())
    described = invoke("lab", "new", lab / "new", "--from", stage)
    assert "sim ok" in described.output, described.output
    assert load_lab(lab / "new").scene.robot.wheels.centre == (0.1, 0.0)
    played = json.loads(
        invoke("sim", shutil.copy(stage, lab / "robot.usda"), "--format", "json").stdout
    )
    assert {check["verdict"] for check in played["checks"] if check["name"] == "follows"} == {"ok"}


def test_the_topic_of_an_optional_checkpoint_is_asked_for_there_alone(repository: Path) -> None:
    lab = load_lab(repository / "docs" / "examples" / "labs" / "warehouse")
    asked = {number: expected_at(lab, point).types for number, point in lab.checkpoints.items()}
    assert [number for number, types in asked.items() if "/r2/joint_states" in types] == ["7"]
