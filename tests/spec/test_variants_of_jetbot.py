"""The second lab with transforms in a namespace, or with a milestone that may be left out."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import pytest
import yaml
from in_process import invoke
from msgspec.structs import replace
from places import REPOSITORY
from pxr import Sdf, Usd

from lab3_usd.check.manual import rules_in
from lab3_usd.check.rules.targets import _difference
from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.contradictions.references import lab_faults
from lab3_usd.spec.graph import Target
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.scene import NO_ROBOT

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
IMU = "/World/Jetbot/chassis/Imu"
LINKS = "/World/Jetbot/Odometry/links"


def edited(folder: Path, *edits: tuple[str, str, str]) -> Path:
    """Copy the lab, replace texts in its files, and build its stages."""
    shutil.copytree(JETBOT, folder)
    for name, old, new in edits:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))
    made = invoke("--lab", folder, "build", "--out", folder / "built")
    assert made.exit_code == 0, made.output
    return folder


def findings(folder: Path, name: str, change: Callable[[Usd.Stage], object]) -> list[Finding]:
    """What is found in a built stage after a change."""
    (path,) = (folder / "built").glob(f"*{name}.usda")
    stage = Usd.Stage.Open(str(path))
    change(stage)
    stage.Save()
    found = check_stage(path, lab=load_lab(folder)).findings
    return [finding for finding in found if finding.severity != "note"]


def nothing(_stage: Usd.Stage) -> None:
    """Leave a stage as it is."""


@pytest.fixture
def namespaced(tmp_path: Path) -> Path:
    """The lab with its transforms on /mm/tf."""
    topic = ("Odometry.yaml", "topicName: /tf", "topicName: /mm/tf")
    return edited(tmp_path / "lab", topic, ("ros.yaml", "/tf", "/mm/tf"))


def test_transforms_in_a_namespace_are_published(namespaced: Path) -> None:
    assert findings(namespaced, "odometry", nothing) == []


def test_a_frame_that_nobody_sends_in_a_namespace_is_found(namespaced: Path) -> None:
    def without_imu(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(LINKS).GetRelationship("inputs:targetPrims").RemoveTarget(IMU)

    (found,) = findings(namespaced, "odometry", without_imu)
    assert (found.rule, "Imu" in found.message) == ("T01", True)


def test_a_topic_with_its_namespace_in_the_name_is_said_to_be_the_same(tmp_path: Path) -> None:
    folder = edited(
        tmp_path / "lab",
        ("Odometry.yaml", "topicName: /jetbot/odom", "nodeNamespace: jetbot, topicName: /odom"),
    )
    (path,) = (folder / "built").glob("*odometry.usda")
    stage = Usd.Stage.Open(str(path))
    node = stage.GetPrimAtPath("/World/Jetbot/Odometry/publish_odometry")
    node.GetAttribute("inputs:topicName").Set("/jetbot/odom")
    node.GetAttribute("inputs:nodeNamespace").Clear()
    stage.Save()
    told = {each.rule: each.message for each in check_stage(path, lab=load_lab(folder)).findings}
    topic = "'/jetbot/odom', which gives /jetbot/odom as '/odom' in the namespace 'jetbot' does"
    assert told["P08"] == f"inputs:topicName is {topic}"


@pytest.fixture
def optional(tmp_path: Path) -> Path:
    """The lab whose milestone with the IMU may be left out, where its target list is judged."""
    may = ("checkpoints.yaml", "    title: Imu\n", "    title: Imu\n    optional: true\n")
    return edited(tmp_path / "lab", may, ("Odometry.yaml", "    frames_from: [targetPrims]\n", ""))


def test_the_sensor_of_a_milestone_that_was_left_out_is_not_asked_for(optional: Path) -> None:
    assert findings(optional, "odometry", nothing) == []


def test_the_sensor_of_an_optional_milestone_may_be_a_target(optional: Path) -> None:
    def with_imu(stage: Usd.Stage) -> None:
        stage.DefinePrim(IMU, "IsaacImuSensor")
        stage.GetPrimAtPath(LINKS).GetRelationship("inputs:targetPrims").AddTarget(IMU)

    assert findings(optional, "odometry", with_imu) == []


FRAME = "/World/Jetbot/ImuFrame"


@pytest.fixture(scope="module")
def extra_frame(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lab whose tree is asked for before an optional milestone that adds the frame Imu."""
    folder = tmp_path_factory.mktemp("optional") / "lab"
    shutil.copytree(JETBOT, folder)
    graph = yaml.safe_load((folder / "Odometry.yaml").read_text())
    nodes, wires = graph["nodes"], graph["wires"]
    own = {role: deepcopy(nodes[role]) for role in ("tick", "context", "time", "links")}
    own["publish_links"] = deepcopy(nodes["publish_links"])
    (*_, imu) = own["links"]["targets"]["targetPrims"]
    own["links"]["targets"]["targetPrims"] = [imu]
    nodes["links"]["targets"]["targetPrims"].remove(imu)
    ends = [
        wire for wire in wires if {end.partition(".")[0] for end in wire.split(" -> ")} <= {*own}
    ]
    parts = {
        "ImuFrame": {
            "graph": "ImuFrame",
            "path": FRAME,
            "handout": "E1",
            "nodes": own,
            "wires": ends,
        }
    }
    for name, data in {"Odometry": graph, **parts}.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    points = yaml.safe_load((folder / "checkpoints.yaml").read_text())
    entries = points["checkpoints"]
    entries["4"]["adds"] |= {"graphs": ["Scan", "Odometry"], "frames": True}
    entries["5"] |= {
        "optional": True,
        "adds": {"sensors": ["imu"], "graphs": ["Measure", "ImuFrame"]},
    }
    entries["6"]["adds"] = {}
    (folder / "checkpoints.yaml").write_text(yaml.safe_dump(points, sort_keys=False))
    made = invoke("--lab", folder, "build", "--out", folder / "built")
    assert made.exit_code == 0, made.output
    return folder


@pytest.mark.parametrize("name", ["lidar", "imu", "odometry"])
def test_the_tree_is_that_of_the_milestones_that_are_asked_for(
    extra_frame: Path, name: str
) -> None:
    assert findings(extra_frame, name, nothing) == []


def test_who_did_an_optional_milestone_is_not_faulted_for_it_later(extra_frame: Path) -> None:
    (done,) = (extra_frame / "built").glob("*imu.usda")
    (later,) = (extra_frame / "built").glob("*topics.usda")
    shutil.copyfile(done, later)
    assert findings(extra_frame, "topics", nothing) == []


def test_the_tree_grows_with_the_graphs_that_send_it(extra_frame: Path, tmp_path: Path) -> None:
    points = shutil.copytree(extra_frame, tmp_path / "lab") / "checkpoints.yaml"
    points.write_text(points.read_text().replace("optional: true", "optional: false"))
    lab = load_lab(tmp_path / "lab")
    assert [fault for fault in lab_faults(lab) if fault.severity == "error"] == []
    asked = {key: {child for _, child in lab.at(key).frames.edges} for key in ("4", "5", "6")}
    assert asked["5"] - asked["4"] == asked["6"] - asked["4"] == {"Imu"}


def test_a_graph_named_as_the_tree_gets_another_name_in_a_new_lab(
    extra_frame: Path, tmp_path: Path
) -> None:
    (stage,) = (extra_frame / "built").glob("*imu.usda")
    layer = Sdf.Layer.OpenAsAnonymous(str(stage))
    edit = Sdf.BatchNamespaceEdit()
    edit.Add(FRAME, FRAME.replace("ImuFrame", "TF"))
    assert layer.Apply(edit)
    layer.Export(str(tmp_path / "lab_1.usda"))
    told = invoke("lab", "new", tmp_path / "lab", tmp_path / "lab_1.usda").output
    assert f"{tmp_path}/lab/Jetbot_TF.yaml" in told


def test_a_graph_that_was_left_without_its_sensor_is_told(extra_frame: Path) -> None:
    (done,) = (extra_frame / "built").glob("*imu.usda")
    (later,) = (extra_frame / "built").glob("*topics.usda")
    shutil.copyfile(done, later)
    (found,) = findings(extra_frame, "topics", lambda stage: stage.RemovePrim(IMU))
    assert (found.rule, found.prim) == ("G09", f"{FRAME}/links")


@pytest.mark.parametrize(("limit", "rules"), [(90.0, ["S26"]), (float("inf"), [])])
def test_a_driven_wheel_is_held_by_limits_that_the_lab_does_not_speak_of(
    extra_frame: Path, limit: float, rules: list[str]
) -> None:
    lab = load_lab(extra_frame)
    (robot,) = lab.scene.robots
    bare = replace(lab, scene=replace(lab.scene, robots=(replace(robot, wheels=NO_ROBOT.wheels),)))
    (path,) = (extra_frame / "built").glob("*drive.usda")
    stage = Usd.Stage.Open(str(path))
    joint = next(prim for prim in stage.Traverse() if prim.GetName() == "left_wheel_joint")
    joint.CreateAttribute("physics:upperLimit", Sdf.ValueTypeNames.Float).Set(limit)
    stage.Save()
    found = check_stage(path, lab=bare).findings
    assert [each.rule for each in found if each.severity == "error"] == rules


def test_the_frame_of_an_optional_milestone_is_judged_there(extra_frame: Path) -> None:
    def without_imu(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(f"{FRAME}/links").GetRelationship("inputs:targetPrims").SetTargets([])

    assert [found.rule for found in findings(extra_frame, "imu", without_imu)] == ["T01"]


def test_a_long_list_of_targets_is_told_by_what_differs() -> None:
    asked = tuple(f"/World/Post_{number}" for number in range(20))
    named = (*asked[:-1], "/World/Rack")
    said = _difference(named, Target("inputs:targetPrims", asked, "A1"))
    assert said == "lacks /World/Post_19; names, and should not, /World/Rack"


def test_the_robot_is_no_sensor_of_its_own_type(tmp_path: Path) -> None:
    plain = ("scene.yaml", "type: IsaacImuSensor", "type: Xform")
    folder = edited(tmp_path / "lab", plain)
    assert findings(folder, "drive", nothing) == []


def test_what_stands_on_no_robot_has_no_link(tmp_path: Path) -> None:
    folder = edited(
        tmp_path / "lab",
        ("scene.yaml", "path: /World/Jetbot/chassis/Imu", "path: /World/Room/Imu"),
        ("Measure.yaml", "/World/Jetbot/chassis/Imu", "/World/Room/Imu"),
        ("Odometry.yaml", "        - /World/Jetbot/chassis/Imu\n", ""),
        ("checkpoints.yaml", ", chassis -> Imu", ""),
        ("ros.yaml", "header.frame_id: Imu", "header.frame_id: chassis"),
        ("Measure.yaml", "frameId: Imu, ", "frameId: chassis, "),
    )

    def moved(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath("/World/Room/Imu").GetAttribute("xformOp:translate").Set((9, 0, 0))

    (found,) = findings(folder, "imu", moved)
    assert found.message.endswith("relative to its parent")


def test_a_course_without_topics_has_an_example_without_them() -> None:
    lab = load_lab(JETBOT)
    bare = replace(lab, ros=replace(lab.ros, topics={}))
    assert "topicName" in rules_in(lab)["P01"].manual
    assert "topicName" not in rules_in(bare)["P01"].manual
