"""Two publishers of one /tf_static are right (docs/decisions.md), whoever is asked.

The lab is that of two robots, with a lens on each that does not move on its robot.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from click.testing import Result
from in_process import invoke
from places import REPOSITORY
from pxr import Usd

from lab3_usd.new_lab.lab import describe_lab
from lab3_usd.pipeline.stage import check_stage, lint_stage
from lab3_usd.spec.load.loader import load_lab

WAREHOUSE = REPOSITORY / "docs" / "examples" / "labs" / "warehouse"
PLACES = {"R1": ("/World/r1/StaticR1", "r1/mast"), "R2": ("/World/StaticR2", "r2/tower")}
STATIC = "/tf_static"
GRAPH = """\
graph: Static{name}
path: {path}
handout: "5.1"
nodes:
  tick: {{type: omni.graph.action.OnPlaybackTick}}
  context:
    type: isaacsim.ros2.bridge.ROS2Context
    set: {{domain_id: 42, useDomainIDEnvVar: false}}
  publish:
    type: isaacsim.ros2.bridge.ROS2PublishRawTransformTree
    set:
      topicName: /tf_static
      parentFrameId: {link}
      childFrameId: {robot}/lens
      staticPublisher: true
wires:
  - tick.tick -> publish.execIn
  - context.context -> publish.context
"""
TOPIC = "  /tf_static: {type: tf2_msgs/msg/TFMessage, from: odometry, handout: '5.1', "
TOPIC += "durability: transient_local}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("static") / "lab"
    shutil.copytree(WAREHOUSE, copy)
    for name, (path, link) in PLACES.items():
        text = GRAPH.format(name=name, path=path, link=link, robot=name.lower())
        (copy / f"Static{name}.yaml").write_text(text)
    points, ros = copy / "checkpoints.yaml", copy / "ros.yaml"
    lenses = {link: f"{name.lower()}/lens" for name, (_, link) in PLACES.items()}
    edges = "".join(f"    - {link} -> {lens}\n" for link, lens in lenses.items())
    text = points.read_text().replace("  deeper_under:", f"{edges}  deeper_under:")
    points.write_text(
        text.replace("OdometryR2], frames", "OdometryR2, StaticR1, StaticR2], frames")
    )
    ros.write_text(ros.read_text().replace("topics:\n", f"topics:\n{TOPIC}", 1))
    return copy


@pytest.fixture(scope="module")
def stage(folder: Path) -> Path:
    built = invoke("--lab", folder, "build", "--out", folder.parent / "built", "--only", "5")
    return Path(built.output.strip())


def run(folder: Path, *words: object) -> Result:
    return invoke("--lab", folder, *words)


def test_the_lab_does_not_contradict_itself(folder: Path) -> None:
    assert invoke("lab", "check", folder).output == "Warehouse fleet: 0 errors, 0 warnings\n"


def test_check_and_lint_find_no_fault(folder: Path, stage: Path, subtests: pytest.Subtests) -> None:
    results = {"check": check_stage(stage, lab=load_lab(folder)), "lint": lint_stage(stage)}
    for command, result in results.items():
        with subtests.test(command=command):
            found = {f.rule for f in result.findings if f.severity != "note"}
            assert found - {*load_lab(folder).policy.accepts} == set()


def test_topics_have_both_publishers(folder: Path, stage: Path) -> None:
    shown = json.loads(run(folder, "topics", "--format", "json", stage).stdout)
    nodes = [end["node"] for end in shown["topics"] if end["topic"] == STATIC]
    assert sorted(nodes) == sorted(f"{path}/publish" for path, _ in PLACES.values())


def test_the_trees_have_both_frames(folder: Path, stage: Path) -> None:
    shown = json.loads(run(folder, "tf", "--format", "json", stage).stdout)
    static = [(e["parent"], e["child"]) for e in shown["transforms"] if e["static"]]
    assert static == [("r1/mast", "r1/lens"), ("r2/tower", "r2/lens")]
    assert shown["problems"] == []


def test_a_dry_run_and_its_recording_are_right(folder: Path, stage: Path, tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")
    bag = tmp_path / "bag"
    played = run(
        folder,
        "sim",
        stage,
        "--drive",
        "0.15,0,0.6 0,0.8,0.4 0,0,0.3",
        "--bag",
        bag,
        "--format",
        "json",
    )
    judged = run(folder, "bag", bag, "--checkpoint", "5", "--format", "json")
    for shown in (played, judged):
        checks = json.loads(shown.stdout)["checks"]
        assert [check for check in checks if check["verdict"] != "ok"] == []
        assert "topics" in {check["name"] for check in checks}


def test_one_frame_of_two_publishers_is_still_wrong(
    folder: Path, stage: Path, tmp_path: Path
) -> None:
    other = Usd.Stage.Open(str(stage))
    other.GetPropertyAtPath("/World/StaticR2/publish.inputs:childFrameId").Set("r1/lens")
    other.Export(str(tmp_path / stage.name))
    found = check_stage(tmp_path / stage.name, lab=load_lab(folder)).findings
    assert "r1/lens" in " ".join(f.message for f in found if f.severity == "error")


def test_a_new_lab_asks_for_no_rate_of_what_comes_once(stage: Path) -> None:
    files = describe_lab([stage], load_lab()).files
    lines = [line for line in files["ros.yaml"].splitlines() if STATIC in line]
    assert "durability: transient_local" in lines[0]
    assert not any("topic_hz" in line for line in lines)
