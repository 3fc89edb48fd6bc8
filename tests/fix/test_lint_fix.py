"""`lab3 fix --lint`: what the linter finds is repaired where one repair alone can be meant."""

from __future__ import annotations

import errno
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from breaking import Step
from in_process import invoke as lab3
from linting import broken_robot
from places import REPOSITORY

from lab3_usd.errors import NoRoomError, UsageError
from lab3_usd.fix.repairing import FixOptions, fix_linted
from lab3_usd.isaac.releases import BASE
from lab3_usd.pipeline.stage import lint_stage

CLOCK, LIDAR, HELPER = "/World/Clock/clock", "/World/Lidar/helper", "/World/Camera/helper"
ODOMETRY, DRIVE = "/World/Odometry/odometry", "/World/Drive/drive"
PADDED = ["left_wheel_joint", " right_wheel_joint"]
BARE = "/World/Rover/chassis/bare"
SLIPS: dict[str, list[Step]] = {
    "K01": [{"disconnect": f"{CLOCK}.inputs:execIn"}],
    "K01 behind the node that computes": [{"disconnect": f"{ODOMETRY}.inputs:execIn"}],
    "K20": [{"add source": [f"{CLOCK}.inputs:timeStamp", "/World/Clock/gone.outputs:time"]}],
    "K21": [{"connect": ["/World/Drive/names.inputs:input0", "/World/Drive/left.outputs:value"]}],
    "K21 at the other end": [
        {"misspell": [f"{CLOCK}.inputs:timeStamp", "inputs:timestamp"]},
    ],
    "K30": [{"set": [f"{CLOCK}.node:type", "isaacsim.ros2.nodes.ROS2PublishClock"]}],
    "K31": [{"set": [f"{CLOCK}.node:type", "omni.isaac.ros2_bridge.ROS2PublishClock"]}],
    "K35": [{"declare": [f"{HELPER}.inputs:type", "token", "RGB"]}],
    "K35 of another node": [{"declare": [f"{HELPER}.inputs:type", "token", "camera_info"]}],
    "K38 with white space": [{"set": [f"{LIDAR}.inputs:frameId", "laser "]}],
    "K61": [{"set": ["/World/Drive/right.inputs:value", "right_wheel_joint "]}],
    "K61 in the list": [
        {"disconnect": "/World/Drive/move.inputs:jointNames"},
        {"declare": ["/World/Drive/move.inputs:jointNames", "token[]", PADDED]},
    ],
    "K63": [
        {"disconnect": "/World/Drive/drive.inputs:dt"},
        {"declare": ["/World/Drive/drive.inputs:maxAngularAcceleration", "double", 1.0]},
    ],
    "K38": [{"set": [f"{LIDAR}.inputs:frameId", "/laser"]}],
    "K71": [
        {"define": [BARE, "OmniLidar"]},
        {"targets": ["/World/Lidar/product.inputs:cameraPrim", BARE]},
    ],
}
LEFT: dict[str, list[Step]] = {
    "a signal of one of two events": [
        {"node": ["/World/Clock/again", "omni.graph.action.OnPlaybackTick"]},
        {"disconnect": f"{CLOCK}.inputs:execIn"},
    ],
    "a topic with a space in it": [{"set": [f"{HELPER}.inputs:topicName", "rgb image"]}],
    "a dead wire without another": [
        {"connect": [f"{CLOCK}.inputs:timeStamp", "/World/Clock/gone.outputs:time"]}
    ],
    "a port that no other is like": [
        {"connect": [f"{CLOCK}.inputs:timeStamp", "/World/Clock/time.outputs:whatever"]}
    ],
    "a port that a node of an unknown type is connected to": [
        {"node": ["/World/Clock/text", "acme.nodes.Noise"]},
        {"declare": ["/World/Clock/text.inputs:value", "token"]},
        {"connect": ["/World/Clock/text.inputs:value", "/World/Clock/time.outputs:simTime"]},
    ],
    "a frame without a name": [{"set": [f"{LIDAR}.inputs:frameId", ""]}],
    "a value that is like none": [{"declare": [f"{HELPER}.inputs:type", "token", "heat"]}],
}


def saved(folder: Path, steps: list[dict[str, Any]]) -> Path:
    path = folder / "rover.usda"
    stage = broken_robot("rover", steps)
    stage.GetRootLayer().Export(str(path))
    return path


# What is made in the same places as another, or would hide it, is in another stage.
APART = (
    "K01 behind the node that computes",
    "K21 at the other end",
    "K35 of another node",
    "K61",
    "K38",
)
ALONE = ("K30",)
AT_ONCE = ([slip for slip in SLIPS if slip not in APART + ALONE], APART, ALONE)


@pytest.mark.parametrize("slips", AT_ONCE, ids=["most", "apart", "alone"])
def test_slips_are_repaired(tmp_path: Path, slips: Sequence[str]) -> None:
    path = saved(tmp_path, [dict(each) for slip in slips for each in SLIPS[slip]])
    fixed = fix_linted(path, BASE, FixOptions())
    found = Counter(finding.rule for finding in fixed.before)
    assert Counter(slip[:3] for slip in slips) <= found
    path.write_bytes(fixed.files[path])
    assert [
        finding.rule for finding in lint_stage(path).findings if finding.severity != "note"
    ] == []


@pytest.mark.parametrize("fault", LEFT)
def test_what_may_mean_several_things_is_left(tmp_path: Path, fault: str) -> None:
    path = saved(tmp_path, [dict(each) for each in LEFT[fault]])
    old = path.read_bytes()
    lab3("fix", "--lint", path, "--in-place")
    assert [finding.fix for finding in lint_stage(path).findings if finding.severity != "note"] == [
        None
    ]
    assert path.read_bytes() == old


def test_the_report_names_the_command(tmp_path: Path) -> None:
    path = saved(tmp_path, [dict(slip) for slip in SLIPS["K31"]])
    last = lab3("lint", path).stdout.splitlines()[-1]
    assert last == f"[*] 1 finding can be repaired: lab3 fix --lint {path}"


def test_sarif_holds_the_lines(tmp_path: Path) -> None:
    path = saved(tmp_path, [dict(slip) for slip in SLIPS["K31"]])
    assert '"fixes"' in lab3("lint", path, "--format", "sarif").stdout


def test_a_release_without_the_linter_is_wrong_use(tmp_path: Path) -> None:
    stage = saved(tmp_path, []).rename(tmp_path / "Lab3_02.usda")
    with pytest.raises(UsageError, match="--isaac goes with --lint"):
        lab3("fix", "--isaac", "5.1", stage)


def test_the_linter_lists_its_repairs_and_writes_them_when_asked_for(tmp_path: Path) -> None:
    path = saved(tmp_path, [dict(slip) for slip in SLIPS["K01"]])
    old = path.read_bytes()
    listed = lab3("lint", "--fix", path)
    assert (path.read_bytes(), "1 would be repaired, 0 left" in listed.stdout) == (old, True)
    assert "+" in lab3("lint", "--fix", "--diff", path).stdout
    assert path.read_bytes() == old
    assert lab3("lint", "--fix", "--in-place", path).exit_code == 0
    assert lab3("lint", path).exit_code == 0


def test_what_is_found_elsewhere_after_a_repair_is_not_repaired(tmp_path: Path) -> None:
    path = tmp_path / "carter.usda"
    shutil.copy(REPOSITORY / "docs" / "examples" / "carter.usda", path)
    lines = lab3("lint", "--fix", path).stdout.splitlines()
    assert [line.split()[2] for line in lines if line.startswith("would repair ")] == ["K01"]
    assert "1 would be repaired" in lines[-2]


def test_a_type_gets_its_right_name_whatever_else_is_wrong_with_its_node(tmp_path: Path) -> None:
    misspelt = {
        "set": [f"{DRIVE}.node:type", "isaacsim.robot.wheeled_robots.DifferentialControler"]
    }
    faults = [{"set": [f"{DRIVE}.inputs:{name}", 0.0]} for name in ("wheelRadius", "wheelDistance")]
    fixed = fix_linted(saved(tmp_path, [misspelt, *faults]), BASE, FixOptions())
    assert [finding.rule for finding in fixed.before] == ["K30"]
    assert [finding.rule for finding in fixed.left] == ["K10", "K10"]


def test_what_comes_to_light_after_a_repair_is_told_when_it_is_repaired(tmp_path: Path) -> None:
    misspelt = {
        "set": [f"{DRIVE}.node:type", "isaacsim.robot.wheeled_robots.DifferentialControler"]
    }
    fixed = fix_linted(
        saved(tmp_path, [misspelt, {"disconnect": f"{DRIVE}.inputs:execIn"}]), BASE, FixOptions()
    )
    assert [finding.rule for finding in fixed.before] == ["K30"]
    assert [finding.rule for finding in fixed.repaired] == ["K30", "K01"]


def test_what_is_likely_is_repaired_on_demand(tmp_path: Path) -> None:
    path = tmp_path / "carter.usda"
    shutil.copy(REPOSITORY / "docs" / "examples" / "carter.usda", path)
    text = lab3("lint", path).stdout
    assert "hint      drag a wire from left_joint.inputs:value, which alone fits" in text
    assert "hint      set the child frame of /World/Carter/odometry/publish_odom_transform" in text
    assert text.endswith("; 4 more with --unsafe\n")
    assert "5 repaired, 0 left" in lab3("fix", "--lint", "--unsafe", "--in-place", path).stdout
    assert lint_stage(path).verdict == "pass"


def test_the_changes_of_a_binary_stage_are_those_that_diff_prints(tmp_path: Path) -> None:
    path = tmp_path / "rover.usdc"
    broken_robot("rover", [{"disconnect": CLOCK_SIGNAL}]).GetRootLayer().Export(str(path))
    before = path.read_bytes()
    listed = lab3("fix", "--lint", "--diff", path)
    assert listed.exit_code == 1
    assert "  + /World/Clock/tick.outputs:tick -> /World/Clock/clock.inputs:execIn" in (
        listed.stdout.splitlines()
    )
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


CLOCK_SIGNAL = "/World/Clock/clock.inputs:execIn"
TIME = "/World/Clock/clock.inputs:timeStamp"
TREE = "/World/Odometry/tree.inputs:timeStamp"
NOT_LIKELY: dict[str, list[Step]] = {
    "two nodes read the time": [
        {"node": ["/World/Clock/again", "isaacsim.core.nodes.IsaacReadSimulationTime"]},
        {"disconnect": TIME},
    ],
    "two times are wired beside": [
        {"node": ["/World/Odometry/again", "isaacsim.core.nodes.IsaacReadSystemTime"]},
        {
            "connect": [
                "/World/Odometry/joints.inputs:timeStamp",
                "/World/Odometry/again.outputs:systemTime",
            ]
        },
        {"disconnect": TREE},
    ],
    "two constants are not read": [
        {"node": ["/World/Drive/third", "omni.graph.nodes.ConstantToken"]},
        {"disconnect": "/World/Drive/names.inputs:input0"},
    ],
}


@pytest.mark.parametrize("fault", NOT_LIKELY)
def test_of_two_candidates_none_is_offered(tmp_path: Path, fault: str) -> None:
    found = lint_stage(saved(tmp_path, NOT_LIKELY[fault])).findings
    unset = [finding for finding in found if finding.rule in {"K10", "K11"}]
    assert [finding.fix for finding in unset] == [None]


def test_a_node_is_triggered_by_the_one_that_computes_what_it_takes(tmp_path: Path) -> None:
    behind = "K01 behind the node that computes"
    path = saved(tmp_path, [dict(slip) for slip in SLIPS[behind]])
    assert "+            prepend uint inputs:execIn.connect = </World/Odometry/compute.out" in (
        lab3("lint", "--fix", "--diff", path).stdout
    )


def test_what_goes_with_repairs_needs_them(tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        lab3("lint", "--in-place", saved(tmp_path, []))


def test_a_full_disk_names_the_file_and_leaves_the_stage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = saved(tmp_path, [dict(slip) for slip in SLIPS["K31"]])
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    for words, name in ((("-o", tmp_path / "new.usda"), "new.usda"), (("--in-place",), path.name)):
        with pytest.raises(NoRoomError, match=f"{name} cannot be written"):
            lab3("fix", "--lint", *words, path)
    assert [(item.name, item.read_bytes()) for item in tmp_path.iterdir()] == [(path.name, before)]
