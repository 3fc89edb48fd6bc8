"""`lab3 add` fills recipes with what a stage says, asks the rest, and proves the result."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest
from foreign_robots import BARE, ROVER, add_lidar, add_link, add_rover, new_stage, rover, rover_at
from in_process import invoke, lab3
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from lab3_usd.author.adding import Added, AddOptions, add_graphs
from lab3_usd.author.request import Options, Request
from lab3_usd.errors import AmbiguousError, GraphError, UsageError
from lab3_usd.isaac.filling import filled
from lab3_usd.isaac.releases import BASE
from lab3_usd.pipeline.stage import JudgeSettings, lint_stage
from lab3_usd.spec.load.loader import load_platform


def add(
    path: Path, recipe: str, *, force: bool = False, replaces: bool = False, **options: object
) -> Added:
    settings = AddOptions(BASE, force=force, replaces=replaces)
    return add_graphs(path, [Request(recipe, Options(**options))], settings)  # type: ignore[arg-type]


def written(path: Path, recipe: str, **options: object) -> Usd.Stage:
    added = add(path, recipe, **options)
    assert added.data is not None
    return held(path, added.data)


def held(path: Path, data: bytes) -> Usd.Stage:
    """Write a file and open it, whatever usd-core still has of it."""
    path.write_bytes(data)
    stage = Usd.Stage.Open(str(path))
    stage.Reload()
    return stage


def bot(tmp_path: Path, **settings: object) -> Path:
    path = tmp_path / "bot.usda"
    stage = new_stage(path)
    add_rover(stage, **settings)  # type: ignore[arg-type]
    stage.Save()
    return path


def value(stage: Usd.Stage, path: str) -> object:
    got = stage.GetAttributeAtPath(path).Get()
    return list(got) if hasattr(got, "__iter__") and not isinstance(got, str) else got


def refusal(path: Path, recipe: str, **options: object) -> str:
    with pytest.raises(UsageError) as error:
        add(path, recipe, **options)
    return str(error.value)


DRIVE = "/World/Graphs/Drive"


def test_the_drive_has_the_sizes_that_were_measured(tmp_path: Path) -> None:
    stage = written(bot(tmp_path, radius=0.07, distance=0.44), "drive")
    assert value(stage, f"{DRIVE}/differential_controller.inputs:wheelRadius") == 0.07
    assert value(stage, f"{DRIVE}/differential_controller.inputs:wheelDistance") == 0.44


def test_a_joint_is_left_by_its_place(tmp_path: Path) -> None:
    stage = written(bot(tmp_path, names=("right", "left")), "drive")
    names = value(stage, f"{DRIVE}/articulation_controller.inputs:jointNames")
    assert names == ["right_joint", "left_joint"]


def test_each_pair_of_four_wheels_has_a_controller(tmp_path: Path) -> None:
    stage = written(bot(tmp_path, rows=(0.2, -0.2)), "drive")
    names = [
        value(stage, f"{DRIVE}/{controller}.inputs:jointNames")
        for controller in ("articulation_controller", "articulation_controller_01")
    ]
    assert names == [["left_joint", "right_joint"], ["left_joint1", "right_joint1"]]


@pytest.mark.parametrize("made", BARE)
def test_three_commands_make_a_robot_drive_and_the_linter_silent(made: str, tmp_path: Path) -> None:
    path = BARE[made](tmp_path)
    for kind in ("clock", "drive", "odometry"):
        assert invoke("add", kind, path, "--in-place").exit_code == 0
    assert [f.rule for f in lint_stage(path).findings if f.severity != "note"] == []
    answer = invoke("sim", path)
    assert answer.exit_code == 0, answer.output
    assert " 0 bad" in answer.output


def test_nothing_is_written_unless_asked_for(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    answer = invoke("add", "clock", path)
    assert "would add" in answer.output
    assert path.read_bytes() == ROVER.read_bytes()
    assert [file.name for file in tmp_path.iterdir()] == ["rover.usda"]


def test_the_same_again_adds_nothing(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    written(path, "drive")
    again = add(path, "drive")
    assert (again.data, again.additions[0].graph) == (None, DRIVE)


def test_other_values_are_named_and_replaced_only_when_asked(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    written(path, "drive")
    assert "wheelRadius is 0.1, asked 0.2" in refusal(path, "drive", radius=0.2)
    replaced = add(path, "drive", replaces=True, radius=0.2)
    assert replaced.data is not None
    stage = held(path, replaced.data)
    assert value(stage, f"{DRIVE}/differential_controller.inputs:wheelRadius") == 0.2


def test_a_second_publisher_of_a_topic_is_refused_with_the_first(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    written(path, "odometry")
    text = refusal(path, "publisher", topic="/odom", kind="bool")
    assert "/World/Graphs/Odometry/ros2_publish_odometry" in text


def test_a_second_controller_of_a_wheel_is_refused_with_the_first(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    written(path, "drive")
    assert f"{DRIVE}/articulation_controller" in refusal(path, "differential")


def test_frames_that_are_sent_already_are_left_out_of_odometry(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    written(path, "tf")
    stage = written(path, "odometry")
    assert not stage.GetPrimAtPath("/World/Graphs/Odometry/publish_link_frames")
    assert "sent already" in refusal(rover_with_tf(tmp_path), "odometry", robot_tf=True)


def rover_with_tf(folder: Path) -> Path:
    path = rover_at(folder, "with_tf.usda")
    written(path, "tf")
    return path


def test_several_robots_are_asked_about(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "two.usda")
    add_rover(stage, "/World/alpha")
    add_rover(stage, "/World/beta")
    stage.Save()
    with pytest.raises(AmbiguousError) as error:
        add(tmp_path / "two.usda", "drive")
    assert error.value.candidates == ("/World/alpha (2 wheels)", "/World/beta (2 wheels)")
    assert add(tmp_path / "two.usda", "drive", robot="/World/beta").additions[0].graph == DRIVE


def test_a_robot_that_is_chosen_by_its_wheels_is_said_to_be(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "two.usda")
    add_rover(stage, "/World/alpha")
    base = add_link(stage, "/World/crane/base", Gf.Vec3d(2, 0, 0))
    UsdPhysics.ArticulationRootAPI.Apply(base)
    stage.Save()
    assert source_of_robot(tmp_path / "two.usda") == "the only one with wheels (root: base)"
    assert source_of_robot(bot(tmp_path)) == "the only one (root: base)"


def source_of_robot(path: Path) -> str:
    holes = add(path, "drive").additions[0].holes
    return next(hole.source for hole in holes if hole.name == "robot")


def test_wheels_of_unequal_size_are_asked_about(tmp_path: Path) -> None:
    path = bot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Cylinder.Get(stage, "/World/Bot/right_wheel/collider").GetRadiusAttr().Set(0.06)
    stage.Save()
    text = refusal(path, "drive")
    assert "0.05 m" in text
    assert "0.06 m" in text
    assert "--radius" in text
    assert add(path, "drive", radius=0.05, force=True).data is not None


def test_a_wheel_that_a_spring_holds_is_refused(tmp_path: Path) -> None:
    text = refusal(bot(tmp_path, gains=(1000.0, 100.0)), "drive")
    assert "stiffness" in text


def test_speeds_of_a_joint_that_a_spring_holds_are_written_only_by_force(tmp_path: Path) -> None:
    path = bot(tmp_path, gains=(1000.0, 100.0))
    before = path.read_bytes()
    refused = lab3("add", "velocity", path, "--in-place")
    assert refused.returncode == 2
    assert "stiffness 1000, and cannot follow a velocity" in refused.stderr
    assert path.read_bytes() == before
    forced = lab3("add", "velocity", path, "--in-place", "--force")
    assert forced.returncode == 0
    assert "new error K62" in forced.stdout


def test_speeds_are_said_in_radians_a_second(tmp_path: Path) -> None:
    added = add(bot(tmp_path), "velocity")
    (speeds,) = [hole for hole in added.additions[0].holes if hole.label == "velocity"]
    assert speeds.source == "targets of the drives, in radians a second"


def test_a_joint_that_is_misspelt_is_refused_with_the_right_name(tmp_path: Path) -> None:
    text = refusal(bot(tmp_path), "drive", joints=("left_joint", "rigth_joint"))
    assert "rigth_joint" in text
    assert "right_joint" in text


def test_joints_are_taken_in_the_order_in_which_they_are_named(tmp_path: Path) -> None:
    stage = written(bot(tmp_path), "drive", joints=("right_joint", "left_joint"))
    names = value(stage, f"{DRIVE}/articulation_controller.inputs:jointNames")
    assert names == ["right_joint", "left_joint"]


@pytest.mark.parametrize("joints", [(), ("left_joint",)])
def test_joints_that_are_no_pairs_are_refused(tmp_path: Path, joints: tuple[str, ...]) -> None:
    assert "LEFT,RIGHT" in refusal(bot(tmp_path), "drive", joints=joints)


@pytest.mark.parametrize("path", ["World/Drive", "/World/1x", "/World//Drive", "/"])
def test_a_place_that_no_prim_can_have_is_refused(tmp_path: Path, path: str) -> None:
    assert "is not the absolute path" in refusal(bot(tmp_path), "clock", graph=path)


@pytest.mark.parametrize("topic", ["", "/9lives", "/cmd vel", "/a//b"])
def test_a_topic_that_is_none_is_refused(tmp_path: Path, topic: str) -> None:
    assert "topic" in refusal(bot(tmp_path), "drive", topic=topic)


def test_a_path_that_is_taken_is_refused(tmp_path: Path) -> None:
    assert "/World/Bot" in refusal(bot(tmp_path), "clock", graph="/World/Bot")


def test_a_graph_of_another_kind_is_never_replaced(tmp_path: Path) -> None:
    path = bot(tmp_path)
    written(path, "clock", graph="/World/Ros")
    with pytest.raises(UsageError, match="/World/Ros is taken"):
        add(path, "drive", replaces=True, graph="/World/Ros")


def test_no_graph_goes_below_an_instance(tmp_path: Path) -> None:
    asset, path = tmp_path / "asset.usda", tmp_path / "scene.usda"
    part = Usd.Stage.CreateNew(str(asset))
    UsdGeom.SetStageMetersPerUnit(part, 1.0)
    part.SetDefaultPrim(UsdGeom.Xform.Define(part, "/Bot").GetPrim())
    add_rover(part, "/Bot")
    part.Save()
    stage = new_stage(path)
    prim = UsdGeom.Xform.Define(stage, "/World/Bot1").GetPrim()
    prim.GetReferences().AddReference("./asset.usda")
    prim.SetInstanceable(instanceable=True)
    stage.Save()
    del stage, part, prim
    assert "instance" in refusal(path, "drive", graph="/World/Bot1/Drive")
    assert (
        value(written(path, "drive"), f"{DRIVE}/differential_controller.inputs:wheelRadius") == 0.05
    )


def test_a_robot_in_a_missing_file_is_not_guessed(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "scene.usda")
    prim = UsdGeom.Xform.Define(stage, "/World/Bot1").GetPrim()
    prim.GetReferences().AddReference("./gone.usda")
    stage.Save()
    assert "gone.usda" in refusal(tmp_path / "scene.usda", "drive")
    named = refusal(tmp_path / "scene.usda", "camera", prim="/World/Bot1/Camera")
    lost = "./gone.usda cannot be found, which could hold"
    assert named == f"{lost} /World/Bot1/Camera (/World/Bot1)"


def test_the_namespace_of_the_robot_is_written_into_its_nodes(tmp_path: Path) -> None:
    path = bot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/World/Bot")
    prim.CreateAttribute("isaac:namespace", Sdf.ValueTypeNames.String).Set("bot1")
    stage.Save()
    del stage, prim
    extended = written(path, "drive")
    twist = "ros2_subscribe_twist.inputs:nodeNamespace"
    assert value(extended, f"{DRIVE}/{twist}") == "bot1"
    within = written(path, "drive", graph="/World/Bot/Drive", replaces=True)
    assert within.GetAttributeAtPath(f"/World/Bot/Drive/{twist}").Get() is None


def test_frames_of_a_sensor_go_to_the_tree_of_its_robot(tmp_path: Path) -> None:
    path = bot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath("/World/Bot").CreateAttribute(
        "isaac:namespace", Sdf.ValueTypeNames.String
    ).Set("bot1")
    UsdGeom.Camera.Define(stage, "/World/Bot/base/Eye")
    stage.Save()
    del stage
    frames = {"targets": ("/World/Bot/base/Eye",), "parent": "/World/Bot/base"}
    for kind, options in (("clock", {}), ("odometry", {}), ("tf", frames)):
        result = add(path, kind, **options)
        assert (result.data is not None, result.new) == (True, ())
        path.write_bytes(result.data or b"")
    assert add(path, "tf", **frames).data is None
    assert invoke("topics", path).output.count("/bot1/tf ") == 3


def test_the_domain_of_the_clock_is_taken(tmp_path: Path) -> None:
    path = bot(tmp_path)
    written(path, "clock", domain=7)
    extended = written(path, "drive")
    assert value(extended, f"{DRIVE}/ros2_context.inputs:domain_id") == 7
    assert value(extended, f"{DRIVE}/ros2_context.inputs:useDomainIDEnvVar") is False


def test_a_graph_that_is_extended_keeps_its_tick_and_context(tmp_path: Path) -> None:
    path = bot(tmp_path)
    written(path, "clock", graph="/World/Ros")
    stage = written(path, "odometry", into="/World/Ros")
    ticks = [
        str(prim.GetPath())
        for prim in stage.Traverse()
        if prim.GetName().startswith(("on_playback_tick", "ros2_context"))
    ]
    assert ticks == ["/World/Ros/on_playback_tick", "/World/Ros/ros2_context"]


def test_an_imu_outside_a_body_is_written_only_by_force(tmp_path: Path) -> None:
    path = tmp_path / "imu.usda"
    stage = new_stage(path)
    stage.DefinePrim("/World/Imu", "IsaacImuSensor")
    stage.Save()
    assert "is not below a rigid body" in refusal(path, "imu")
    assert written(path, "imu", force=True).GetPrimAtPath("/World/Graphs/IMU")


def test_a_lidar_that_cannot_be_read_is_written_only_by_force(tmp_path: Path) -> None:
    path = bot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    add_lidar(stage, "/World/Bot/base/laser", with_api=False)
    stage.Save()
    told = refusal(path, "lidar")
    assert "lacks OmniSensorGenericLidarCoreAPI; apply it (apiSchemas of the prim)" in told
    assert "--force" in told
    assert written(path, "lidar", force=True).GetPrimAtPath("/World/Graphs/Lidar")


def test_each_picture_with_labels_has_a_topic_for_them(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    wanted = ("semantic_segmentation", "bbox_3d")
    stage = written(path, "camera", publish=wanted)
    labels = [
        value(
            stage, f"/World/Graphs/Camera/ros2_camera_helper_{name}.inputs:semanticLabelsTopicName"
        )
        for name in wanted
    ]
    assert labels == ["/semantic_segmentation_labels", "/bbox_3d_labels"]


def test_the_frame_of_a_sensor_comes_along_when_asked_for(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    alone = add(path, "lidar")
    assert any("--with-tf" in note for note in alone.additions[0].notes)
    both = add(path, "lidar", with_tf=True)
    assert [addition.request.kind for addition in both.additions] == ["lidar", "tf"]
    assert not both.additions[0].notes


def test_an_option_of_another_kind_is_refused(tmp_path: Path) -> None:
    assert "--radius does not apply to clock" in refusal(bot(tmp_path), "clock", radius=0.1)


def test_a_kind_that_is_none_is_refused_with_those_there_are(tmp_path: Path) -> None:
    assert "odometry" in refusal(bot(tmp_path), "odomtry")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("add rover.usda drive", "the kind comes first: lab3 add drive rover.usda"),
        ("remove rover.usda drive", "the kind comes first: lab3 remove drive rover.usda"),
        ("add drive rover.usda --robot alpha", "no such prim; robots: /World/Rover"),
        ("add drive rover.usda --robot Rovr", "no such prim; did you mean /World/Rover?"),
    ],
)
def test_words_in_the_wrong_place_are_put_right(
    command: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(rover_at(tmp_path).parent)
    with pytest.raises(UsageError, match=re.escape(words)):
        invoke(*command.split())


@pytest.mark.parametrize(
    ("node", "target", "words"),
    [
        ("none", "/eye", "--node /World/Odometry/none: there is no such node"),
        ("tick", "/eye", "--node /World/Odometry/tick: makes no frames of prims"),
        ("tree", "/nose", "--targets /World/Rover/chassis/nose: there is no such prim"),
        ("tree", "", "chassis would be its own parent"),
    ],
)
def test_a_node_that_cannot_send_a_frame_is_refused(
    node: str, target: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "foreign.usda"
    rover().GetRootLayer().Export(str(path))
    targets = (f"/World/Rover/chassis{target}",)
    assert words in refusal(path, "tf", node=f"/World/Odometry/{node}", targets=targets)


def test_a_layer_holds_the_graphs_alone_and_grows(tmp_path: Path) -> None:
    path, layer = rover_at(tmp_path), tmp_path / "ros.usda"
    for kind in ("clock", "drive"):
        assert invoke("add", kind, path, "--layer", layer).exit_code == 0
    assert path.read_bytes() == ROVER.read_bytes()
    stage = Usd.Stage.Open(str(layer))
    assert stage.GetPrimAtPath(DRIVE)
    assert list(stage.GetRootLayer().subLayerPaths) == ["./rover.usda"]
    assert not stage.GetRootLayer().GetPrimAtPath("/World/Rover")


def test_a_layer_never_goes_over_another_file(tmp_path: Path) -> None:
    path, other = rover_at(tmp_path), rover_at(tmp_path, "other.usda")
    assert lab3("add", "clock", path, "--layer", other).returncode == 2
    assert other.read_bytes() == ROVER.read_bytes()


def test_a_read_only_file_is_not_replaced(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    path.chmod(0o444)
    assert lab3("add", "clock", path, "--in-place").returncode == 2
    assert path.read_bytes() == ROVER.read_bytes()


def test_a_file_of_requests_brings_a_stage_there_and_changes_nothing_twice(tmp_path: Path) -> None:
    path, requests = rover_at(tmp_path), tmp_path / "ros.yaml"
    requests.write_text("add:\n  - clock\n  - drive: {topic: /go}\n  - odometry\n")
    assert invoke("add", "--file", requests, path, "--diff").exit_code == 1
    assert invoke("add", "--file", requests, path, "--in-place").exit_code == 0
    assert invoke("add", "--file", requests, path, "--diff").exit_code == 0
    requests.write_text("add:\n  - drive: {topic: /there}\n")
    assert invoke("add", "--file", requests, path, "--diff").exit_code == 1


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("drive: {raduis: 0.1}", "'raduis' is not an option of drive; did you mean radius?"),
        ("drive:\n      topc: /go", "'topc' is not an option of drive; did you mean topic?"),
        ("clock: {radius: 0.1}", "'radius' is not an option of clock; known are domain"),
        ("clok", "'clok' is not a kind of graph; did you mean clock?"),
        ("{drive: {}, clock: {}}", "names 2 kinds"),
        ("drive: {radius: wide}", "drive: 'radius' is 'wide', expected a number"),
    ],
)
def test_what_is_wrong_in_a_file_is_named_with_its_line(
    entry: str, words: str, tmp_path: Path
) -> None:
    requests = tmp_path / "ros.yaml"
    requests.write_text(f"add:\n  - odometry\n  - {entry}\n")
    answer = lab3("add", "--file", requests, rover_at(tmp_path))
    assert answer.returncode == 2
    line = 4 if "topc" in entry else 3
    assert answer.stderr.startswith(f"lab3: ros.yaml: line {line}: {words}")


def test_json_names_what_was_inferred_and_from_what(tmp_path: Path) -> None:
    answer = json.loads(invoke("add", "drive", rover_at(tmp_path), "--format", "json").output)
    facts = {fact["name"]: fact for fact in answer["additions"][0]["facts"]}
    assert facts["radius"]["value"] == "0.100 m"
    assert facts["radius"]["option"] == "--radius"
    assert answer["findings"] == []


@pytest.mark.parametrize(
    ("recipe", "words"),
    [("camera", "2022.2 has no"), ("lidar", "OmniLidar prims came with Isaac Sim 5.0")],
)
def test_a_release_without_a_node_type_or_sensor_refuses_its_recipe(
    recipe: str, words: str, tmp_path: Path
) -> None:
    answer = lab3("add", recipe, rover_at(tmp_path), "--isaac", "2022.2")
    assert answer.returncode == 2
    assert words in answer.stderr


def test_a_release_before_the_renaming_gets_its_own_names_of_types(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    added = add_graphs(path, [Request("drive"), Request("odometry")], AddOptions("2023.1"))
    assert added.new == ()
    assert added.data is not None
    stage = held(path, added.data)
    controller = stage.GetPrimAtPath("/World/Graphs/Drive/articulation_controller")
    name = "omni.isaac.core_nodes.IsaacArticulationController"
    assert controller.GetAttribute("node:type").Get() == name
    assert controller.GetAttribute("inputs:usePath").Get() is False
    assert b"isaacsim." not in added.data


def test_a_release_whose_controller_is_another_refuses_the_recipe() -> None:
    platform = load_platform().in_release("4.2")
    with pytest.raises(GraphError, match="AckermannController is another node there than"):
        filled(platform.recipes["ackermann"], "/Graph", {}, platform)


def test_a_graph_with_other_outputs_is_renewed_as_a_whole(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    written(path, "camera", publish=("rgb", "depth"))
    assert "--replace" in refusal(path, "camera", publish=("rgb", "bbox_3d"))
    renewed = add(path, "camera", replaces=True, publish=("rgb", "bbox_3d"))
    assert renewed.data is not None
    stage = held(path, renewed.data)
    names = {prim.GetName() for prim in stage.GetPrimAtPath("/World/Graphs/Camera").GetChildren()}
    assert "ros2_camera_helper_bbox_3d" in names
    assert "ros2_camera_helper_depth" not in names


def test_odometry_is_never_replaced_by_the_frames_that_it_holds(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    written(path, "odometry")
    sensor = ("/World/Rover/chassis/laser",)
    added = add(path, "tf", replaces=True, targets=sensor, parent="/World/Rover/chassis")
    assert added.additions[0].graph == "/World/Graphs/TF"


def test_renewing_the_graph_of_one_robot_leaves_that_of_another(tmp_path: Path) -> None:
    path = tmp_path / "two.usda"
    stage = new_stage(path)
    for name in ("alpha", "beta"):
        add_rover(stage, f"/World/{name}")
    stage.Save()
    del stage
    written(path, "drive", robot="/World/alpha")
    added = add(path, "drive", replaces=True, robot="/World/beta")
    assert added.data is not None
    extended = held(path, added.data)
    controllers = [
        str(prim.GetRelationship("inputs:targetPrim").GetTargets()[0])
        for prim in extended.Traverse()
        if prim.GetName() == "articulation_controller"
    ]
    assert controllers == ["/World/alpha/base", "/World/beta/base"]


def test_the_help_is_one_page_of_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    paragraphs, _, _ = invoke("add", "--help").output.partition("  Kinds:")
    lines = paragraphs.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line for line in lines if line.startswith("   ") or "  " in line.strip()] == []


def test_before_6_0_the_publisher_of_frames_looks_at_the_prims_itself(tmp_path: Path) -> None:
    rover = rover_at(tmp_path)
    for kind in ("clock", "odometry"):
        assert invoke("add", kind, rover, "--isaac", "5.1", "--in-place").exit_code == 0
    stage = Usd.Stage.Open(str(rover))
    nodes = [prim for prim in stage.Traverse() if prim.GetTypeName() == "OmniGraphNode"]
    types = [node.GetAttribute("node:type").Get() for node in nodes]
    assert "isaacsim.core.nodes.IsaacComputeTransformTree" not in types
    found = lint_stage(rover, JudgeSettings(release="5.1")).findings
    assert [finding for finding in found if finding.severity != "note"] == []
    assert "nothing to add" in invoke("add", "odometry", rover, "--isaac", "5.1").output


def test_the_variant_in_which_a_robot_lives_is_said(tmp_path: Path) -> None:
    rover = rover_at(tmp_path)
    stage = new_stage(tmp_path / "chosen.usda")
    robot = stage.DefinePrim("/World/Chosen", "Xform")
    variants = robot.GetVariantSets().AddVariantSet("robot")
    variants.AddVariant("rover")
    variants.SetVariantSelection("rover")
    with variants.GetVariantEditContext():
        robot.GetReferences().AddReference(str(rover), "/World/Rover")
    stage.Save()
    told = invoke("add", "drive", tmp_path / "chosen.usda").output
    assert "  variant   robot=rover of /World/Chosen" in told
    assert "with another one selected" not in invoke("add", "drive", rover).output


def tipping(folder: Path) -> Path:
    """Write a robot on two wheels, whose centre of mass nothing carries."""
    path = bot(folder)
    stage = Usd.Stage.Open(str(path))
    UsdPhysics.MassAPI.Apply(stage.GetPrimAtPath("/World/Bot/base")).CreateCenterOfMassAttr(
        Gf.Vec3f(0.2, 0, 0)
    )
    stage.Save()
    return path


def test_what_does_not_drive_is_played_first_and_written_only_by_force(tmp_path: Path) -> None:
    path = tipping(tmp_path)
    before = path.read_bytes()
    refused = lab3("add", "drive", path, "--in-place", "--check-drive")
    assert refused.returncode == 1
    assert "bad follows" in refused.stdout
    assert "nothing is written: what the robot does not do" in refused.stdout
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["bot.usda"]
    forced = lab3("add", "drive", path, "--in-place", "--check-drive", "--force")
    assert forced.returncode == 0
    assert path.read_bytes() != before


def test_a_layer_over_what_does_not_drive_is_not_written(tmp_path: Path) -> None:
    layer = tmp_path / "ros.usda"
    words = ("add", "drive", tipping(tmp_path), "--layer", layer, "--check-drive")
    assert lab3(*words).returncode == 1
    assert not layer.exists()


def test_json_says_how_the_result_was_played(tmp_path: Path) -> None:
    words = ("add", "drive", tipping(tmp_path), "--check-drive", "--format", "json")
    played = json.loads(lab3(*words).stdout)["played"]
    assert ("follows", "bad") in {(check["name"], check["verdict"]) for check in played}


def test_what_drives_is_written_after_it_was_played(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    answer = lab3("add", "drive", path, "--in-place", "--check-drive")
    assert answer.returncode == 0
    assert answer.stdout.index(" ok\n") < answer.stdout.index("written:")


def test_one_check_is_counted_as_one(tmp_path: Path) -> None:
    path = bot(tmp_path)
    told = lab3("add", "differential", path, "--check-drive", "--in-place").stdout
    assert "play      1 check, 1 ok" in told
    assert "\n1 check: 1 ok, 0 bad" in lab3("sim", path).stdout


def test_a_gripper_asks_for_all_that_it_lacks_at_once(tmp_path: Path) -> None:
    path = bot(tmp_path)
    joints = ("left_joint", "right_joint")  # without limits
    text = refusal(path, "gripper", joints=joints)
    assert [name for name in ("--open", "--close", "--speed") if name in text] == [
        "--open",
        "--close",
        "--speed",
    ]
    text = refusal(path, "gripper", joints=joints, open=0.04, speed=0.001)
    assert "--close" in text
    assert "--open" not in text
    assert add(path, "gripper", joints=joints, open=0.04, close=0.0, speed=0.001).data is not None


@pytest.mark.parametrize(
    ("right_limit", "places"), [(90.0, [math.pi / 2, -math.pi / 6]), (80.0, None)]
)
def test_a_gripper_moves_between_the_limits_that_its_fingers_share(
    tmp_path: Path, right_limit: float, places: list[float] | None
) -> None:
    path = bot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    for prim in stage.Traverse():
        joint = UsdPhysics.RevoluteJoint(prim)
        if joint:
            joint.CreateLowerLimitAttr(-30.0)
            joint.CreateUpperLimitAttr(right_limit if "right" in prim.GetName() else 90.0)
    stage.Save()
    fingers = {"joints": ("left_joint", "right_joint"), "speed": 0.001}
    if places is None:
        assert "the fingers have no common limits" in refusal(path, "gripper", **fingers)
        return
    stage = written(path, "gripper", **fingers)
    ports = [
        attribute.Get()[0]
        for name in ("openPosition", "closePosition")
        for prim in stage.Traverse()
        if (attribute := prim.GetAttribute(f"inputs:{name}")).IsValid() and attribute.Get()
    ]
    assert ports == pytest.approx(places)
