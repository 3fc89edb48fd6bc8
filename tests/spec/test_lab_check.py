"""`lab3 lab check`: each contradiction in the description of a lab, with both places."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from in_process import invoke
from other_labs import MINI, built, copied
from places import REPOSITORY

from lab3_usd.data import data_folder
from lab3_usd.errors import Lab3Error, SpecError
from lab3_usd.spec.load.loader import load_lab

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
Case = tuple[str, Callable[[Any], object], str]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the small lab."""
    return copied(tmp_path / "lab")


def edited(folder: Path, file: str, edit: Callable[[Any], object]) -> None:
    said = quick_yaml.load((folder / file).read_text())
    edit(said)
    (folder / file).write_text(quick_yaml.dump(said))


def checked(folder: Path | None) -> tuple[int, list[str]]:
    """Run the command, and return its exit code and the findings without their places."""
    result = invoke("lab", "check", *([] if folder is None else [folder]))
    return result.exit_code, [
        line.rpartition(", at ")[0] or line for line in result.output.splitlines()[:-1]
    ]


def test_the_bundled_lab_does_not_contradict_itself() -> None:
    assert [line for line in checked(None)[1] if line.startswith("error")] == []


@pytest.mark.parametrize("lab", [MINI, JETBOT], ids=["mini", "jetbot"])
def test_a_complete_lab_gives_no_finding(lab: Path) -> None:
    assert checked(lab) == (0, [])


def line(text: str) -> Callable[[Any], Any]:
    """Return what finds a line of the checklists."""
    return lambda said: next(
        each for lines in said["checklist"].values() for each in lines if each["text"] == text
    )


_JOINT = {"handout": "5.4", "type": "PhysicsRevoluteJoint", "links": ["base_link", "base_scan"]}
ERRORS: dict[str, Case] = {
    "joint of a wheel as another joint": (
        "scene.yaml",
        lambda said: said["robot"].setdefault("joints", {}).update(wheel_left_joint=_JOINT),
        "scene.yaml: robot: joints: wheel_left_joint: 'wheel_left_joint' is the joint of a wheel",
    ),
    "limits the wrong way round": (
        "scene.yaml",
        lambda said: (
            said["robot"].setdefault("joints", {}).update(turn=_JOINT | {"limits": [1.0, -1.0]})
        ),
        "scene.yaml: robot: joints: turn: limits: the lower limit, 1, is not below the upper one",
    ),
    "drive below nothing": (
        "scene.yaml",
        lambda said: (
            said["robot"].setdefault("joints", {}).update(push=_JOINT | {"stiffness": -1.0})
        ),
        "scene.yaml: robot: joints: push: stiffness is -1, which is negative",
    ),
    "mass below nothing": (
        "scene.yaml",
        lambda said: said["robot"]["links"]["base_link"].update(mass=-0.8),
        "scene.yaml: robot: links: base_link: mass: -0.8 kg is negative",
    ),
    "wheel that is no link": (
        "scene.yaml",
        lambda said: said["robot"]["wheels"]["joints"].update(wheel_left_joint="wheel_left"),
        (
            "scene.yaml: robot: wheels: joints: wheel_left_joint: 'wheel_left' is not a link, "
            "'wheel_left_link' is (scene.yaml: robot: links)"
        ),
    ),
    "kind of a sensor": (
        "scene.yaml",
        lambda said: said["sensors"]["lidar"].update(type="IsaacImuSensor"),
        "scene.yaml: sensors: lidar: kind: a lidar is a prim of type OmniLidar, not IsaacImuSensor",
    ),
    "target of a node": (
        "ROS_Drive.yaml",
        lambda said: said["nodes"]["articulation_controller"]["targets"]["C10"].update(
            targetPrim=["/turtlebot3_burger/base_footprnt"]
        ),
        (
            "ROS_Drive.yaml: articulation_controller: targetPrim: "
            "'/turtlebot3_burger/base_footprnt' is not a prim, "
            "'/turtlebot3_burger/base_footprint' is (starter.yaml)"
        ),
    ),
    "files that must differ": (
        "submission.yaml",
        lambda said: said["stages"]["differ"].append("09"),
        "submission.yaml: stages: differ: there is no checkpoint '09' (checkpoints.yaml has 00, ",
    ),
    "stages of a checklist": (
        "submission.yaml",
        lambda said: line("Starter USD opened successfully")(said).update(stages="A"),
        (
            "submission.yaml: checklist: Isaac Sim: 'Starter USD opened "
            "successfully': stages: there "
            "is no checkpoint 'A' (checkpoints.yaml has"
        ),
    ),
    "deliverable of a checklist": (
        "submission.yaml",
        lambda said: line("Video link submitted")(said).update(deliverables=["film"]),
        (
            "submission.yaml: checklist: Submission: 'Video link submitted': "
            "deliverables: there is no "
            "deliverable 'film' (deliverables: report, video"
        ),
    ),
    "saved output of a checklist": (
        "submission.yaml",
        lambda said: line("/map publishes")(said).update(shown=["topic_hz /map"]),
        (
            "submission.yaml: checklist: ROS2: '/map publishes': shown: no command of "
            "ros.yaml saves "
            "'topic_hz /map' (ros.yaml: commands with kind topic_hz: /clock, /scan"
        ),
    ),
    "topic in the words of a checklist": (
        "submission.yaml",
        lambda said: line("/map publishes")(said).update(text="/mapp publishes"),
        (
            "submission.yaml: checklist: ROS2: '/mapp publishes': '/mapp' is not a topic, '/map' "
            "is (ros.yaml: topics: /map)"
        ),
    ),
    "requirement of a checklist": (
        "submission.yaml",
        lambda said: line("Lidar sensor exists")(said).update(requirements=["Lidar/prim"]),
        (
            "submission.yaml: checklist: Isaac Sim: 'Lidar sensor exists': "
            "requirements: 'Lidar/prim' "
            "fits no requirement of checkpoint 05 (groups: ROS_Clock,"
        ),
    ),
    "rule of a checklist": (
        "submission.yaml",
        lambda said: line("Robot reaches a goal")(said).update(rules=["E99"]),
        (
            "submission.yaml: checklist: Localization: 'Robot reaches a goal': rules: "
            "there is no rule "
            "E99 (see lab3 rules)"
        ),
    ),
    "checkpoint of a topic": (
        "ros.yaml",
        lambda said: said["topics"]["/tf"].update({"from": "5"}),
        "ros.yaml: topics: /tf: from: there is no checkpoint '5' (checkpoints.yaml has",
    ),
    "checkpoint of a lifecycle node": (
        "ros.yaml",
        lambda said: said["lifecycle"]["nodes"]["/amcl"].update({"from": "7"}),
        "ros.yaml: lifecycle: nodes: /amcl: from: there is no checkpoint '7' (checkpoints.yaml has",
    ),
    "checkpoint of a node": (
        "ros.yaml",
        lambda said: said["nodes"]["/lifecycle_manager_localization"].update({"from": "8"}),
        "ros.yaml: nodes: /lifecycle_manager_localization: from: there is no checkpoint '8'",
    ),
    "checkpoint of the goal": (
        "ros.yaml",
        lambda said: said["goal"].update({"from": "8"}),
        "ros.yaml: goal: from: there is no checkpoint '8' (checkpoints.yaml has",
    ),
    "checkpoint of a command": (
        "ros.yaml",
        lambda said: said["commands"][0].update({"from": "1"}),
        "ros.yaml: commands: entry 1: from: there is no checkpoint '1' (checkpoints.yaml has",
    ),
    "checkpoint of localization": (
        "checkpoints.yaml",
        lambda said: said["frames"]["localization"].update({"from": "7"}),
        (
            "checkpoints.yaml: frames: localization: from: there is no checkpoint '7' "
            "(checkpoints.yaml has"
        ),
    ),
    "checkpoint of the robot's pose": (
        "scene.yaml",
        lambda said: said["robot"].update(pose_is_error_until="5"),
        "scene.yaml: robot: pose_is_error_until: there is no checkpoint '5' (checkpoints.yaml has",
    ),
    "checkpoint of an item": (
        "rubric.yaml",
        lambda said: said["items"]["nav2"].update(checkpoint="7"),
        "rubric.yaml: items: nav2: checkpoint: there is no checkpoint '7' (checkpoints.yaml has",
    ),
    "topic in the words of an item": (
        "rubric.yaml",
        lambda said: said["items"]["clock"].update(title="/clocks is publishing"),
        "rubric.yaml: items: clock: title: '/clocks' is not a topic, '/clock' is (ros.yaml: ",
    ),
    "group of an item": (
        "rubric.yaml",
        lambda said: said["items"]["scan"].update(groups=["ROS_Lidar"]),
        "rubric.yaml: scan: 'ROS_Lidar' in 'groups' is nothing that checkpoint 03 asks for",
    ),
    "frame that nobody publishes": (
        "checkpoints.yaml",
        lambda said: said["frames"]["edges"].append("base_footprint -> imu"),
        (
            "checkpoints.yaml: frames: edges: base_footprint -> imu: no node of a "
            "graph publishes the "
            "frame 'imu' (frames are published by ROS_OdomTF.yaml: "
            "ros2_publish_raw_transform_tree: "
            "childFrameId, ROS_OdomTF.yaml: isaac_compute_transform_tree: targetPrims)"
        ),
    ),
    "frame below another one": (
        "checkpoints.yaml",
        lambda said: said["frames"]["edges"].__setitem__(0, "odometry -> base_footprint"),
        (
            "checkpoints.yaml: frames: edges: odometry -> base_footprint: the graphs publish "
            "'base_footprint' below 'odom' (ROS_OdomTF.yaml: ros2_publish_raw_transform_tree: "
        ),
    ),
    "two parents": (
        "checkpoints.yaml",
        lambda said: said["frames"]["edges"].append("odom -> base_scan"),
        (
            "checkpoints.yaml: frames: edges: odom -> base_scan: 'base_scan' has two parents, "
            "'base_footprint' and 'odom' (checkpoints.yaml: frames: edges: "
            "base_footprint -> base_scan"
        ),
    ),
    "required and forbidden": (
        "checkpoints.yaml",
        lambda said: said["frames"]["forbidden"].update(parent="odom", child="base_footprint"),
        (
            "checkpoints.yaml: frames: edges: odom -> base_footprint: is required and forbidden "
            "(checkpoints.yaml: frames: forbidden)"
        ),
    ),
    "frame of a chain": (
        "checkpoints.yaml",
        lambda said: said["frames"]["localization"]["chain"].append("base_scn"),
        (
            "checkpoints.yaml: frames: localization: chain: 'base_scn' is not a frame of the tree, "
            "'base_scan' is (checkpoints.yaml: frames: edges)"
        ),
    ),
    "frame id of a graph": (
        "ROS_Lidar2D.yaml",
        lambda said: said["nodes"]["ros2_rtx_lidar_helper"]["set"]["D8"].update(frameId="base_2"),
        "ROS_Lidar2D.yaml: ros2_rtx_lidar_helper: frameId: 'base_2' is not a frame of the tree",
    ),
    "frame that a graph publishes too much": (
        "checkpoints.yaml",
        lambda said: said["frames"]["edges"].remove("base_footprint -> caster_back_link"),
        (
            "ROS_OdomTF.yaml: isaac_compute_transform_tree: targetPrims: 'caster_back_link' is not "
            "a frame of the tree (checkpoints.yaml: frames: edges)"
        ),
    ),
    "frame of a message": (
        "ros.yaml",
        lambda said: said["topics"]["/scan"]["fields"].update({"header.frame_id": "scan"}),
        (
            "ros.yaml: topics: /scan: fields: header.frame_id: 'scan' is not a frame of the tree, "
            "'base_scan' is (checkpoints.yaml: frames: edges)"
        ),
    ),
    "frame of Nav2": (
        "ros.yaml",
        lambda said: said["navigation"]["frames"][2].update(frame="odm"),
        (
            "ros.yaml: navigation: frames: local_costmap.global_frame: 'odm' is not "
            "a frame of the tree, "
            "'odom' is (checkpoints.yaml: frames: edges)"
        ),
    ),
    "frame of a command": (
        "ros.yaml",
        lambda said: next(c for c in said["commands"] if c["kind"] == "tf2_echo").update(to="foot"),
        "ros.yaml: command 10 (tf2_echo): to: 'foot' is not a frame of the tree (checkpoints",
    ),
    "frame of the robot": (
        "scene.yaml",
        lambda said: said["robot"].update(base_frame="base_foot"),
        "scene.yaml: robot: base_frame: 'base_foot' is not a frame of the tree, 'base_footprint'",
    ),
    "topic that nobody publishes": (
        "ROS_Lidar2D.yaml",
        lambda said: said["nodes"]["ros2_rtx_lidar_helper"]["set"]["D8"].update(topicName="/scn"),
        (
            "ros.yaml: topics: /scan: no node of a graph publishes '/scan' (ROS_Lidar2D.yaml: "
            "ros2_rtx_lidar_helper: topicName is '/scn')"
        ),
    ),
    "scan of Nav2": (
        "ros.yaml",
        lambda said: said["navigation"].update(scan_topic="/scan_front"),
        (
            "ros.yaml: navigation: scan_topic: no node of a graph publishes '/scan_front' "
            "(ROS_Lidar2D.yaml: ros2_rtx_lidar_helper: topicName is '/scan')"
        ),
    ),
    "velocity of Nav2": (
        "ros.yaml",
        lambda said: said["navigation"].update(velocity_topic="/cmd_vel_nav"),
        (
            "ros.yaml: navigation: velocity_topic: no node of a graph subscribes to '/cmd_vel_nav' "
            "(ROS_Drive.yaml: ros2_subscribe_twist: topicName is '/cmd_vel')"
        ),
    ),
    "map of Nav2": (
        "ros.yaml",
        lambda said: said["navigation"].update(map_topic="/maps"),
        "ros.yaml: navigation: map_topic: '/maps' is not a topic (ros.yaml: topics)",
    ),
    "message of another type": (
        "ros.yaml",
        lambda said: said["topics"]["/scan"].update(type="sensor_msgs/msg/PointCloud2"),
        (
            "ros.yaml: topics: /scan: 'type' is sensor_msgs/msg/PointCloud2, but the "
            "graph's messages "
            "are sensor_msgs/msg/LaserScan (ROS_Lidar2D.yaml: ros2_rtx_lidar_helper: topicName)"
        ),
    ),
    "topic before its graph": (
        "ros.yaml",
        lambda said: said["topics"]["/scan"].update({"from": "02"}),
        (
            "ros.yaml: topics: /scan: 'from' is 02, but the graph comes with checkpoint 03 "
            "(ROS_Lidar2D.yaml: ros2_rtx_lidar_helper: topicName)"
        ),
    ),
    "topic of a command": (
        "ros.yaml",
        lambda said: said["commands"][2].update(of="/clocks"),
        "ros.yaml: command 3 (topic_type): of: '/clocks' is not a topic (ros.yaml: topics)",
    ),
    "node of a command": (
        "ros.yaml",
        lambda said: next(c for c in said["commands"] if c["kind"] == "lifecycle").update(of="/x"),
        "ros.yaml: command 8 (lifecycle): of: '/x' is not a lifecycle node (ros.yaml: ",
    ),
    "section that the handout does not have": (
        "ROS_Clock.yaml",
        lambda said: said["wires"].update(B9=said["wires"].pop("B4")),
        (
            "ROS_Clock.yaml: wire 'ros2_context.context -> "
            "ros2_publish_clock.context': the handout "
            "has no section B9 (checkpoints.yaml: handout: sections)"
        ),
    ),
}
ONLY_BY_COMMAND = ("requirement of a checklist", "rule of a checklist", "group of an item")
WARNINGS: dict[str, Case] = {
    "a kind without the rules of its type": (
        "scene.yaml",
        lambda said: said["sensors"]["lidar"].update(kind="imu"),
        (
            "warning scene.yaml: sensors: lidar: kind: 'imu' omits the rules about prims of "
            "type OmniLidar, 'lidar' has them (scene.yaml: sensors: lidar: type)"
        ),
    ),
    "no points for a checkpoint": (
        "rubric.yaml",
        lambda said: said["items"].pop("nav2"),
        (
            "warning checkpoints.yaml: checkpoints: '05': no item of the rubric gives "
            "points for it "
            "(rubric.yaml: items)"
        ),
    ),
    "no points for a graph": (
        "rubric.yaml",
        lambda said: said["items"]["clock"].update(groups=["Scene"]),
        "warning rubric.yaml: items: no item gives points for ROS_Clock (ROS_Clock.yaml)",
    ),
    "an attribute of a scan": (
        "scene.yaml",
        lambda said: said["sensors"]["lidar"]["scan"].update(
            ranges=["omni:sensor:Core:nearRangeM", "omni:sensor:Core:farRange"]
        ),
        (
            "warning scene.yaml: sensors: lidar: omni:sensor:Core:farRange: "
            "'omni:sensor:Core:farRange' is not an attribute of a sensor, "
            "'omni:sensor:Core:farRangeM' is"
        ),
    ),
    "a section that no item names": (
        "checkpoints.yaml",
        lambda said: said["handout"]["sections"].update(H=8),
        (
            "warning checkpoints.yaml: handout: sections: H: no item names section H8 (name it in "
            "checkpoints.yaml: handout: by_hand if nothing shows it)"
        ),
    ),
    "a section that no item counts": (
        "rubric.yaml",
        lambda said: [said["items"][name].update(groups=["ROS_*"]) for name in ("scan", "nav2")],
        (
            "warning rubric.yaml: items: no item counts section D3 of the handout "
            "(checkpoint 03 asks "
            "for Lidar2D/prim)"
        ),
    ),
}


# What would hide others, or be hidden, is looked at in a lab of its own.
APART = (
    "topic in the words of a checklist",
    "required and forbidden",
    "scan of Nav2",
    "message of another type",
    "topic before its graph",
)
AT_ONCE = (
    [case for case in ERRORS if case not in {*APART, *ONLY_BY_COMMAND}],
    APART,
    ONLY_BY_COMMAND,
)


@pytest.mark.parametrize("cases", AT_ONCE, ids=["most", "apart", "by the command alone"])
def test_contradictions_are_named_with_both_places(cases: Sequence[str], folder: Path) -> None:
    for file, edit, _ in map(ERRORS.__getitem__, cases):
        edited(folder, file, edit)
    status, found = checked(folder)
    assert status == 1
    assert [
        case
        for case in cases
        if not any(each.startswith(f"error {ERRORS[case][2]}") for each in found)
    ] == [], found


@pytest.mark.parametrize("case", [case for case in ERRORS if case not in ONLY_BY_COMMAND])
def test_a_lab_with_a_contradiction_is_refused(case: str, folder: Path) -> None:
    file, edit, _ = ERRORS[case]
    edited(folder, file, edit)
    with pytest.raises(SpecError):
        load_lab(folder)


@pytest.mark.parametrize("cases", [[*WARNINGS][:3], [*WARNINGS][3:]], ids=", ".join)
def test_what_is_left_out_is_a_warning(cases: list[str], folder: Path) -> None:
    for file, edit, _ in map(WARNINGS.__getitem__, cases):
        edited(folder, file, edit)
    status, found = checked(folder)
    assert status == 1
    assert {WARNINGS[case][2] for case in cases} <= {*found}
    assert [each for each in found if each.startswith("error")] == []
    assert load_lab(folder).title == "Mini"


def test_a_graph_that_no_checkpoint_adds_is_a_warning(folder: Path) -> None:
    shutil.copy(folder / "ROS_Clock.yaml", folder / "ROS_Old.yaml")
    expected = "ROS_Old.yaml: graph: no checkpoint adds this graph (checkpoints.yaml: checkpoints)"
    assert checked(folder) == (1, [f"warning {expected}"])


def test_a_lab_without_a_rubric_is_told(folder: Path) -> None:
    (folder / "rubric.yaml").unlink()
    expected = "warning rubric.yaml: items: is missing, so that lab3 grade needs --rubric"
    assert checked(folder) == (1, [expected])


def test_the_first_of_several_contradictions_refuses_the_lab(folder: Path) -> None:
    edited(folder, "submission.yaml", lambda said: said["stages"]["differ"].extend(["A", "B"]))
    with pytest.raises(SpecError, match=r"differ: there is no .*; and 1 more, see lab3 lab check$"):
        load_lab(folder)


def test_a_frame_of_a_switched_off_output_is_none(tmp_path: Path) -> None:
    """The second frame of a stereo pair counts only where its image is wired."""
    folder = shutil.copytree(data_folder("graphs"), tmp_path / "lab")
    edited(
        folder,
        "ROS_Camera.yaml",
        lambda said: said["wires"]["E9"].append(
            "isaac_create_render_product.renderProductPath -> "
            "ros2_camera_info_helper.renderProductPathRight"
        ),
    )
    _, found = checked(folder)
    assert found[0].startswith("error ROS_Camera.yaml: ros2_camera_info_helper: frameIdRight: ")


def test_a_file_that_is_no_lab_is_said_at_once(folder: Path) -> None:
    (folder / "scene.yaml").write_text("[]")
    with pytest.raises(SpecError, match=r"^scene\.yaml: is not a mapping of names to values, at "):
        invoke("lab", "check", folder)


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(Lab3Error, match="there is no such folder"):
        invoke("lab", "check", tmp_path / "gone")


def test_the_lab_of_the_option_is_checked(folder: Path) -> None:
    edited(folder, "checkpoints.yaml", lambda said: said.update(title="Week 5"))
    result = invoke("--lab", folder, "lab", "check")
    assert result.output == "Week 5: 0 errors, 0 warnings\n"


def test_a_target_is_looked_up_in_the_stages_that_are_given(folder: Path) -> None:
    (folder / "starter.yaml").unlink()
    drive = folder / "ROS_Drive.yaml"
    drive.write_text(drive.read_text().replace("burger/base_footprint]", "burger/base_foot]"))
    stage = built() / "work" / "Lab3_02_ros_drive.usda"
    assert invoke("lab", "check", folder).exit_code == 0
    result = invoke("lab", "check", folder, "--from", stage)
    assert result.output.startswith(
        "error ROS_Drive.yaml: articulation_controller: targetPrim: "
        "'/turtlebot3_burger/base_foot' is not a prim, "
        f"'/turtlebot3_burger/base_footprint' is ({stage.name}), at {drive}:"
    )
    assert result.output.endswith("Mini: 1 error, 0 warnings\n")


def test_a_target_that_a_stage_has_beside_the_starter_is_no_error(folder: Path) -> None:
    stage = built() / "work" / "Lab3_05_navigation.usda"
    assert invoke("lab", "check", folder, "--from", stage).exit_code == 0


@pytest.mark.parametrize("path", ["/World/Belt", "/World/ROS_Clock/ros2_context"])
def test_a_target_that_only_the_lab_makes_is_an_error(folder: Path, path: str) -> None:
    """`build` refuses it as well: a thing, and a node of another graph, come with the graphs."""
    belt = {"path": "/World/Belt", "handout": "A1", "type": "Cube", "from": "02"}
    edited(folder, "scene.yaml", lambda said: said.update(props={"belt": belt}))
    edited(
        folder,
        "ROS_Drive.yaml",
        lambda said: said["nodes"]["articulation_controller"]["targets"]["C10"].update(
            targetPrim=[path]
        ),
    )
    key = "ROS_Drive.yaml: articulation_controller: targetPrim"
    assert checked(folder)[1][0].startswith(f"error {key}: '{path}' is not a prim")


def test_a_thing_may_name_what_a_graph_holds(folder: Path) -> None:
    belt = {"path": "/World/Belt", "handout": "A1", "type": "Cube", "from": "02"}
    targets = {"proxyPrim": ["/World/ROS_Clock/compound/inner"]}
    edited(
        folder, "scene.yaml", lambda said: said.update(props={"belt": belt | {"targets": targets}})
    )
    assert load_lab(folder).scene.props["belt"].targets["proxyPrim"] == (*targets["proxyPrim"],)


def test_a_folder_that_describes_no_lab_is_said_to_be_empty_or_without_checkpoints(
    tmp_path: Path,
) -> None:
    with pytest.raises(SpecError, match=r"gone: there is no such folder; name one"):
        load_lab(tmp_path / "gone")
    with pytest.raises(SpecError, match=f"^{tmp_path}: is empty; name a folder that describes"):
        invoke("lab", "check", tmp_path)
    (tmp_path / "scene.yaml").touch()
    with pytest.raises(SpecError, match=f"^{tmp_path}: holds no checkpoints.yaml; name a folder"):
        invoke("lab", "check", tmp_path)
