"""Recordings of any robot, of which no lab asks anything."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from foreign_robots import car_and_arm, rover
from in_process import invoke

pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")
from recordings import Sent, on, rewritten
from report_examples import dry_run_of

from lab3_usd.errors import UsageError
from lab3_usd.sim.bag.any_recording import judge_any_recording, robots_in
from lab3_usd.spec.load.loader import load_platform

ARM = 5  # the domain of the arm
DRIVE = "0.15,0,1.2 0,0.8,1.1 0,0,0.3"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of a rover, and of a car and an arm in two domains."""
    folder = tmp_path_factory.mktemp("recordings")
    for name, stage in (("rover", rover()), ("both", car_and_arm(ARM))):
        stage.GetRootLayer().Export(str(folder / f"{name}.usda"))
        invoke("sim", folder / f"{name}.usda", "--drive", DRIVE, "--bag", folder / name)
    return folder


def judged(path: Path, *arguments: str | Path) -> dict[str, Any]:
    return dry_run_of(invoke("bag", path, "--format", "json", *arguments).stdout)


def verdicts(path: Path) -> dict[str, str]:
    return {check["name"]: check["verdict"] for check in judged(path)["checks"]}


def faults(path: Path) -> dict[str, str]:
    checks = judged(path)["checks"]
    return {check["name"]: check["message"] for check in checks if check["verdict"] != "ok"}


def test_nothing_of_a_lab_is_asked_of_a_rover(folder: Path) -> None:
    found = verdicts(folder / "rover")
    assert set(found.values()) == {"ok"}
    assert {"clock", "tree", "rest", "follows", "odometry", "moving frames", "scan"} <= {*found}
    assert not {"topics", "QoS", "headers", "limits", "localization", "goal"} & {*found}


def test_with_its_stage_it_is_compared_with_the_dry_run(folder: Path) -> None:
    found = judged(folder / "rover", "--stage", folder / "rover.usda")
    assert (found["verdict"], found["differences"]) == ("ok", [])


def test_a_car_and_an_arm_are_held_against_their_commands(folder: Path) -> None:
    car = verdicts(folder / "both" / "domain_0")
    arm = verdicts(folder / "both" / f"domain_{ARM}")
    assert (car["follows"], arm["joints"]) == ("ok", "ok")
    assert {*car.values(), *arm.values()} == {"ok"}


def test_its_page_shows_motion_commands_and_wheels(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    judged(folder / "rover", "--page", page)
    shown = page.read_text(encoding="utf-8")
    assert "This is a recording of the running system." in shown
    assert 'class="path wheel1"' in shown
    assert '<li class="command">command</li>' in shown
    assert "dry run" not in shown.partition("<script>")[0].partition("<main>")[2].replace(
        "a dry run makes no images", ""
    )


def test_a_page_is_not_written_over_a_stage(folder: Path) -> None:
    with pytest.raises(UsageError, match="ending of a stage"):
        judged(folder / "rover", "--page", folder / "rover.usda")


def backward(said: Any) -> None:
    said.pose.pose.position.x *= -1
    said.twist.twist.linear.x *= -1


def to_the_other_side(said: Any) -> None:
    said.pose.pose.orientation.z *= -1
    said.pose.pose.position.y *= -1
    said.twist.twist.angular.z *= -1


def test_a_robot_that_goes_back_for_ahead_is_wrong(folder: Path, tmp_path: Path) -> None:
    run = rewritten(folder / "rover", tmp_path / "run", on("/odom", backward))
    assert "commanded to go 0.18 m, went -0.18" in faults(run)["follows"]
    legs = {leg.name: leg.fault for leg in judge_any_recording(run, load_platform()).behaviour.legs}
    assert legs == {"ahead": "commanded to go 0.18 m, went -0.18", "left": ""}


def test_a_car_that_turns_to_the_other_side_is_wrong(folder: Path, tmp_path: Path) -> None:
    change = on("/odom", to_the_other_side)
    found = faults(rewritten(folder / "both" / "domain_0", tmp_path / "run", change))
    assert "steered to turn to the left, turned -" in found["follows"]


def test_odometry_shares_its_topic_with_messages_of_another_type(
    folder: Path, tmp_path: Path
) -> None:
    def on_one_topic(sent: Sent) -> Iterator[Sent]:
        yield sent
        if sent.topic == "/tf":
            yield Sent(sent.time, "/odom", sent.type, sent.held, sent.qos)

    found = verdicts(rewritten(folder / "rover", tmp_path / "run", on_one_topic))
    assert (found["odometry"], found["follows"]) == ("ok", "ok")


def test_a_recording_of_nothing_is_not_judged(folder: Path, tmp_path: Path) -> None:
    found = judged(rewritten(folder / "rover", tmp_path / "run", lambda _: iter(())))
    assert (found["verdict"], found["missing"]) == ("not judged", "nothing was recorded")


def test_a_transform_that_ends_before_the_others_is_missing(folder: Path, tmp_path: Path) -> None:
    def until_the_middle(said: Any) -> None:
        if said.transforms[0].header.stamp.sec > 0:
            said.transforms = [e for e in said.transforms if e.child_frame_id != "eye"]

    found = faults(rewritten(folder / "rover", tmp_path / "run", on("/tf", until_the_middle)))
    assert found["frames"].startswith("chassis -> eye is missing for 2.")


def test_a_joint_that_does_not_get_there_is_named(folder: Path, tmp_path: Path) -> None:
    def stuck(said: Any) -> None:
        said.position = said.position.copy()
        said.position[said.name.index("elbow_joint")] = 0.0

    change = on("/joint_states", stuck)
    found = faults(rewritten(folder / "both" / f"domain_{ARM}", tmp_path / "run", change))
    assert found == {"joints": "elbow_joint is commanded to 0.200 and is at 0.000"}


def test_two_robots_are_told_apart_by_their_namespaces(folder: Path, tmp_path: Path) -> None:
    def twice(sent: Sent) -> Any:
        yield sent
        if sent.topic in {"/odom", "/cmd_vel"}:
            yield Sent(sent.time, f"/second{sent.topic}", sent.type, sent.held, sent.qos)

    found = judged(rewritten(folder / "rover", tmp_path / "run", twice))
    assert found["verdict"] == "ok"
    assert {check["of"] for check in found["checks"] if check["name"] == "follows"} == {
        "/odom",
        "/second/odom",
    }


def test_each_topic_belongs_to_the_nearest_robot() -> None:
    odometry, twist, tf = (
        "nav_msgs/msg/Odometry",
        "geometry_msgs/msg/Twist",
        "tf2_msgs/msg/TFMessage",
    )
    kinds = {
        ("/a/odom", odometry): (),
        ("/b/odom", odometry): (),
        ("/a/cmd_vel", twist): (),
        ("/b/base/cmd_vel", twist): (),
        ("/tf", tf): (),
        ("/b/tf", tf): (),
    }
    robots = robots_in(kinds, ())
    assert [(robot.odometry, robot.commands, robot.transforms) for robot in robots] == [
        ("/a/odom", "/a/cmd_vel", "/tf"),
        ("/b/odom", "/b/base/cmd_vel", "/b/tf"),
    ]
    assert {(robot.scan, robot.joint_states, robot.joint_commands) for robot in robots} == {
        ("",) * 3
    }


def test_no_map_is_laid_below_a_robot_of_no_lab(folder: Path) -> None:
    with pytest.raises(UsageError, match="--maps"):
        judged(folder / "rover", "--maps", folder)
