"""What `--from` says of stages that come from another release, and what it repairs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from breaking import Step
from in_process import invoke as lab3
from linting import broken_robot, found_by, linted, sites_of
from pxr import Sdf, Usd

from lab3_usd.errors import UsageError
from lab3_usd.facts.saved_releases import saved_by
from lab3_usd.fix.repairing import Fixed, FixOptions, fix_linted
from lab3_usd.model.finding import ordered
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.stage_reader import read_model

TIME, CLOCK, GRAPH = "/World/Clock/time", "/World/Clock/clock", "/World/Clock"
LIDAR, HELPER, MOVE = "/World/Rover/chassis/laser", "/World/Lidar/helper", "/World/Drive/move"
DRIVE, CAMERA = "/World/Drive/drive", "/World/Camera/helper"
RESET = f"{TIME}.inputs:resetOnStop"
OPEN: Step = {"remove property": [RESET]}


def said(steps: list[Any], before: str, after: str) -> list[str]:
    """Return the sites of what differs between two releases, of warnings and errors alone."""
    stage = broken_robot("rover", [dict(step) for step in steps])
    return sites_of(found_by("K39", stage, after, before), "warning", "error")


def moved(
    steps: list[Any], folder: Path, before: str, after: str, *, unsafe: bool = False
) -> tuple[Fixed, Usd.Stage]:
    """Repair a stage of one release for another, and open what comes of it."""
    path = folder / "rover.usda"
    broken_robot("rover", [dict(step) for step in steps]).GetRootLayer().Export(str(path))
    fixed = fix_linted(path, after, FixOptions(unsafe=unsafe), before)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(fixed.files.get(path, path.read_bytes()).decode())
    return fixed, Usd.Stage.Open(layer)


def value(stage: Usd.Stage, path: str) -> Any:
    return stage.GetAttributeAtPath(path).Get()


def sources(stage: Usd.Stage, path: str) -> list[str]:
    return [str(source) for source in stage.GetAttributeAtPath(path).GetConnections()]


@pytest.mark.parametrize(("before", "after"), [("5.1", "6.2"), ("2023.1", "6.0"), ("6.2", "5.0")])
def test_a_default_that_differs_is_said_both_ways(before: str, after: str) -> None:
    assert f"K39 {TIME} inputs:resetOnStop" in said([OPEN], before, after)


@pytest.mark.parametrize("written", [True, False])
def test_a_value_that_is_written_stays_as_it_is(*, written: bool) -> None:
    steps: list[Step] = [OPEN, {"declare": [RESET, "bool", written]}]
    assert f"K39 {TIME} inputs:resetOnStop" not in said(steps, "5.1", "6.2")


def test_a_node_that_nothing_uses_is_left_alone() -> None:
    steps: list[Step] = [
        {"node": ["/World/Clock/idle", "isaacsim.core.nodes.IsaacReadSimulationTime"]}
    ]
    assert not any("idle" in site for site in said(steps, "5.1", "6.2"))


def test_between_releases_with_the_same_defaults_nothing_is_said() -> None:
    assert said([OPEN], "5.0", "5.1") == said([OPEN], "6.0", "6.0") == []


def test_without_from_a_default_says_nothing() -> None:
    assert said([OPEN], "", "6.2") == []


@pytest.mark.parametrize(("before", "after", "kept"), [("5.1", "6.2", False), ("6.2", "5.1", True)])
def test_the_old_default_is_written(before: str, after: str, tmp_path: Path, *, kept: bool) -> None:
    fixed, stage = moved([OPEN], tmp_path, before, after)
    assert value(stage, RESET) is kept
    assert not any(finding.rule == "K39" and finding.fix for finding in fixed.left)


def test_what_most_stages_meet_comes_first() -> None:
    steps: list[Step] = [OPEN, {"node": ["/Aside", "omni.isaac.ros2_bridge.ROS2Context"]}]
    stage = broken_robot("rover", [dict(step) for step in steps])
    findings = ordered(linted(stage, "6.2", "5.1").findings)
    warnings = [each for each in findings if each.severity == "warning"]
    assert len(warnings) > 1
    assert (warnings[0].prim, warnings[0].property) == (TIME, "inputs:resetOnStop")


def test_places_of_one_graph_are_one_finding() -> None:
    copy = "/World/Clock/again"
    steps: list[Step] = [
        OPEN,
        {"node": [copy, "isaacsim.core.nodes.IsaacReadSimulationTime"]},
        {"add source": [f"{CLOCK}.inputs:timeStamp", f"{copy}.outputs:simulationTime"]},
    ]
    stage = broken_robot("rover", [dict(step) for step in steps])
    found = [each for each in found_by("K39", stage, "6.2", "5.1").findings if GRAPH in each.prim]
    assert [{each.prim, *each.related} for each in found] == [{TIME, copy}]


def test_values_of_a_port_that_is_gone_are_said_to_be_lost() -> None:
    profile = f"{CLOCK}.inputs:qosProfile"
    found = said([{"declare": [profile, "string", "{}"]}], "6.0", "2022.2")
    assert f"K39 {CLOCK} inputs:qosProfile" in found


def test_a_lidar_of_before_says_now_that_messages_are_whole_turns(tmp_path: Path) -> None:
    whole = f"{LIDAR}.omni:sensor:Core:accumulateOutputs"
    _, stage = moved([], tmp_path, "5.1", "6.2")
    assert value(stage, whole) is True


def test_a_lidar_is_read_as_often_as_it_turned(tmp_path: Path) -> None:
    rate = f"{LIDAR}.omni:sensor:tickRate"
    _, stage = moved([{"set": [rate, 40.0]}], tmp_path, "5.1", "6.2")
    assert value(stage, rate) == 20.0
    _, stage = moved([{"set": [rate, 40.0]}], tmp_path, "6.0", "6.2")
    assert value(stage, rate) == 40.0


@pytest.mark.parametrize(("release", "is_said"), [("5.1", False), ("6.0", True)])
def test_the_tick_rate_counts_from_6_0_on(release: str, *, is_said: bool) -> None:
    stage = broken_robot("rover", [{"set": [f"{LIDAR}.omni:sensor:tickRate", 40.0]}])
    assert (found_by("K73", stage, release).findings != ()) is is_said


def test_an_attribute_of_5_1_gets_its_name_of_today(tmp_path: Path) -> None:
    old, new = (f"{LIDAR}.omni:sensor:Core:{each}BaseHz" for each in ("reportRate", "x"))
    new = f"{LIDAR}.omni:sensor:Core:patternFiringRateHz"
    steps: list[Step] = [{"remove property": [new]}, {"declare": [old, "uint", 36000]}]
    _, stage = moved(steps, tmp_path, "5.1", "6.0")
    assert value(stage, new) == 36000


def test_wires_of_speeds_into_other_commands_are_taken_out(tmp_path: Path) -> None:
    efforts = f"{MOVE}.inputs:effortCommand"
    steps: list[Step] = [
        {"declare": [efforts, "double[]"]},
        {"connect": [efforts, f"{DRIVE}.outputs:effortCommand"]},
    ]
    fixed, stage = moved(steps, tmp_path, "2023.1", "6.2")
    assert sources(stage, efforts) == []
    assert sources(stage, f"{MOVE}.inputs:velocityCommand") != []
    assert not any(finding.rule == "K21" for finding in fixed.left)


def test_a_path_that_was_off_is_cleared(tmp_path: Path) -> None:
    path = f"{MOVE}.inputs:robotPath"
    steps: list[Step] = [
        {"declare": [f"{MOVE}.inputs:usePath", "bool", False]},
        {"declare": [path, "string", "/World/Elsewhere"]},
    ]
    _, stage = moved(steps, tmp_path, "2023.1", "6.2")
    assert not value(stage, path)


def test_both_ends_of_a_port_get_its_new_name(tmp_path: Path) -> None:
    reader, cloud = "/World/Clock/reader", "/World/Clock/cloud"
    steps: list[Step] = [
        {"node": [reader, "isaacsim.sensors.physx.IsaacReadLidarPointCloud"]},
        {"node": [cloud, "isaacsim.ros2.bridge.ROS2PublishPointCloud"]},
        {"connect": [f"{reader}.inputs:execIn", "/World/Clock/tick.outputs:tick"]},
        {"connect": [f"{cloud}.inputs:execIn", f"{reader}.outputs:execOut"]},
        {"declare": [f"{cloud}.inputs:pointCloudData", "point3f[]"]},
        {"connect": [f"{cloud}.inputs:pointCloudData", f"{reader}.outputs:pointCloudData"]},
    ]
    _, stage = moved(steps, tmp_path, "2022.2", "6.2")
    assert sources(stage, f"{cloud}.inputs:data") == [f"{reader}.outputs:data"]


def test_a_transform_tree_goes_back_into_its_publisher(tmp_path: Path) -> None:
    frames, tree = "/World/Odometry/frames", "/World/Odometry/tree"
    before = broken_robot("rover", [])
    asked = before.GetPrimAtPath(frames).GetRelationship("inputs:targetPrims").GetTargets()
    signal = sources(before, f"{frames}.inputs:execIn")
    _, stage = moved([], tmp_path, "6.0", "5.1", unsafe=True)
    publisher = stage.GetPrimAtPath(tree)
    assert publisher.GetRelationship("inputs:targetPrims").GetTargets() == asked
    assert sources(stage, f"{tree}.inputs:execIn") == signal
    assert not stage.GetPrimAtPath(frames)


def test_a_token_of_a_later_release_is_replaced_on_demand(tmp_path: Path) -> None:
    steps: list[Step] = [{"declare": [f"{CAMERA}.inputs:type", "token", "rgb_h264"]}]
    for unsafe, kept in ((False, "rgb_h264"), (True, "rgb")):
        _, stage = moved(steps, tmp_path, "6.0", "5.1", unsafe=unsafe)
        assert value(stage, f"{CAMERA}.inputs:type") == kept


@pytest.mark.parametrize(
    ("release", "is_right"), [("2022.2", True), ("2023.1", True), ("4.2", False)]
)
def test_ports_of_2023_1_are_right_there(release: str, *, is_right: bool) -> None:
    kind = "isaacsim.ros2.bridge.ROS2PublishCameraInfo"
    ports = load_platform().in_release(release).types[kind].ports
    assert ("inputs:focalLength" in ports) is is_right
    assert ("inputs:k" in ports) is not is_right


def test_a_release_before_4_5_knows_no_names_of_today(tmp_path: Path) -> None:
    fixed, stage = moved([], tmp_path, "6.0", "4.2")
    assert "K31" in {finding.rule for finding in fixed.before}
    assert value(stage, f"{CLOCK}.node:type") == "omni.isaac.ros2_bridge.ROS2PublishClock"


def test_names_of_before_4_5_are_right_there() -> None:
    old: Step = {"set": [f"{CLOCK}.node:type", "omni.isaac.ros2_bridge.ROS2PublishClock"]}
    found = linted(broken_robot("rover", [dict(old)]), "4.2").findings
    assert not any(CLOCK in (each.prim, *each.related) for each in found if each.rule == "K31")


@pytest.mark.parametrize(
    ("kind", "now"),
    [
        ("omni.isaac.ros_bridge.ROS1PublishClock", "isaacsim.ros2.bridge.ROS2PublishClock"),
        (
            "omni.isaac.wheeled_robots.AckermannController",
            "isaacsim.robot.wheeled_robots.AckermannController",
        ),
        ("omni.isaac.core_nodes.IsaacReadTimes", "isaacsim.core.nodes.IsaacReadSimulationTime"),
    ],
)
def test_a_type_that_is_gone_names_what_does_its_work(kind: str, now: str) -> None:
    stage = broken_robot("rover", [{"set": [f"{CLOCK}.node:type", kind]}])
    (found,) = found_by("K30", stage, "6.2").findings
    assert (found.severity, found.expected, found.fix) == ("error", now, None)


@pytest.mark.parametrize(
    ("kind", "meant"),
    [
        ("omni.isaac.isaac_sensor.IsaacReadIMU", "isaacsim.sensors.physics.IsaacReadIMU"),
        ("omni.isaac.sensor.IsaacReadLightBeam", "isaacsim.sensors.physx.IsaacReadLightBeam"),
        ("omni.replicator.isaac.Pose", "isaacsim.replicator.writers.Pose"),
    ],
)
def test_a_name_that_nvidias_list_has_wrong_is_repaired(kind: str, meant: str) -> None:
    stage = broken_robot("rover", [{"node": ["/World/Clock/old", kind]}])
    (found,) = found_by("K30", stage, "6.2").findings
    assert found.expected == meant


@pytest.mark.parametrize(
    ("steps", "release"),
    [
        ([{"declare": [f"{MOVE}.inputs:usePath", "bool", True]}], "2023.1"),
        ([{"set": [f"{CAMERA}.node:typeVersion", 2]}], "5.1"),
        ([{"set": [f"{CLOCK}.node:type", "omni.isaac.ros2_bridge.ROS2PublishClock"]}], "4.2"),
    ],
)
def test_the_release_that_saved_a_stage_is_found(steps: list[Step], release: str) -> None:
    stage = broken_robot("rover", [dict(step) for step in steps])
    model = read_model(stage, lint_platform("6.2"), "stage.usda")
    saved = saved_by(model)
    own = [sign for sign in saved.signs if release in sign.releases] if saved else []
    assert own


def test_a_stage_whose_renaming_ends_is_repaired_in_the_file(tmp_path: Path) -> None:
    behind = "/World/Clock/behind"
    steps: list[Step] = [
        {"define": ["/World/Clock/empty", "OmniGraphNode"]},
        {"node": [behind, "omni.isaac.ros2_bridge.ROS2Context"]},
    ]
    fixed, stage = moved(steps, tmp_path, "4.2", "6.2")
    assert not {"K31", "K48"} & {finding.rule for finding in fixed.left}
    assert value(stage, f"{behind}.node:type") == "isaacsim.ros2.bridge.ROS2Context"


def test_the_renaming_goes_on_behind_a_node_of_an_asset() -> None:
    steps: list[Step] = [
        {"node": ["/World/Clock/steer", "omni.isaac.wheeled_robots.AckermannController"]},
        {"instance": ["/World/Clock"]},
        {"node": ["/World/Behind", "omni.isaac.ros2_bridge.ROS2Context"]},
    ]
    stage = broken_robot("rover", [dict(step) for step in steps])
    stage.GetPrimAtPath("/World/Clock").SetInstanceable(False)  # noqa: FBT003 - pxr takes it so
    assert found_by("K48", stage, "6.0").findings == ()


def test_auto_takes_the_release_that_the_stage_tells(tmp_path: Path) -> None:
    nodes = [("/World/Camera/helper", 2), ("/World/Camera/product", 2), ("/World/Lidar/product", 2)]
    steps: list[Step] = [{"set": [f"{path}.node:typeVersion", number]} for path, number in nodes]
    path = tmp_path / "rover.usda"
    broken_robot("rover", [OPEN, *steps]).GetRootLayer().Export(str(path))
    told = lab3("lint", path, "--from", "auto", "--isaac", "6.2", "--verbose").stdout
    assert "taken as saved by 5.1" in " ".join(told.split())
    assert "K39" in told
    assert "K39" in lab3("fix", "--lint", path, "--from", "auto", "--isaac", "6.2").stdout


def test_auto_of_a_stage_of_this_release_says_nothing() -> None:
    assert said([OPEN], "auto", "6.0") == []


@pytest.mark.parametrize("options", [("--from", "9.9"), ("--isaac", "9.9")])
def test_an_unknown_release_is_wrong_use(options: tuple[str, str], tmp_path: Path) -> None:
    path = tmp_path / "rover.usda"
    broken_robot("rover", []).GetRootLayer().Export(str(path))
    with pytest.raises(UsageError):
        lab3("lint", path, *options)


def test_from_goes_with_the_linter(tmp_path: Path) -> None:
    path = tmp_path / "rover.usda"
    broken_robot("rover", []).GetRootLayer().Export(str(path))
    with pytest.raises(UsageError):
        lab3("fix", path, "--checkpoint", "01", "--from", "5.1")


@pytest.mark.parametrize("command", [("topics",), ("tf",), ("sim", "--drive", "0,0,0.2")])
def test_other_commands_take_a_release(command: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "rover.usda"
    broken_robot("rover", []).GetRootLayer().Export(str(path))
    name, *options = command
    now, before = (lab3(name, path, *options, "--isaac", each).stdout for each in ("6.0", "5.1"))
    assert now != before  # 5.1 has no Isaac Compute Transform Tree


def test_stages_are_compared_by_the_defaults_of_a_release(tmp_path: Path) -> None:
    files = []
    for name, steps in (("one", [OPEN]), ("two", [OPEN, {"declare": [RESET, "bool", False]}])):
        files.append(tmp_path / f"{name}.usda")
        broken_robot("rover", [dict(step) for step in steps]).GetRootLayer().Export(str(files[-1]))
    assert lab3("diff", *files, "--isaac", "5.1").exit_code == 0
    assert lab3("diff", *files, "--isaac", "6.0").exit_code == 1
