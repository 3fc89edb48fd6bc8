"""Stages that strangers saved from Isaac Sim: none is the lab's, each gets a clear answer."""

from __future__ import annotations

from functools import cache
from itertools import cycle
from pathlib import Path

import pytest
from places import SHARED

from lab3_usd.check.registry import all_rules
from lab3_usd.model.finding import StageResult
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.stage.read.opening import open_stage

CORPUS = SHARED / "corpus"
ENDINGS = {".usd", ".usda", ".usdc"}
FILES = sorted(path for path in CORPUS.rglob("*") if path.suffix in ENDINGS)
ROBOTS = CORPUS / "turtlebot3_import" / "turtlebot3_burger"

pytestmark = pytest.mark.skipif(
    not FILES, reason="the corpus of real stages is not beside this checkout"
)


def name_of(path: Path) -> str:
    return path.name.rpartition("__")[2]


@cache
def checked(path: Path) -> StageResult:
    return check_stage(path, "05")


def one(name: str) -> StageResult:
    (path,) = [path for path in FILES if path.name.endswith(name)]
    return checked(path)


def said(result: StageResult, rule: str) -> list[tuple[str, str | None]]:
    return [(finding.prim, finding.property) for finding in result.findings if finding.rule == rule]


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_every_file_gets_a_clear_answer(path: Path) -> None:
    result = checked(path)
    assert result.verdict == "fail"
    assert result.crashes == ()
    assert result.findings
    assert result.score.earned < result.score.possible
    for finding in result.findings:
        assert finding.prim.startswith("/")
        assert finding.message
        assert "\n" not in finding.message
        assert finding.hint


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_findings_are_of_known_rules_and_said_once(path: Path) -> None:
    findings = checked(path).findings
    assert {finding.rule for finding in findings} <= set(all_rules())
    said_once = [
        (finding.rule, finding.prim, finding.property, finding.message) for finding in findings
    ]
    assert len(set(said_once)) == len(said_once)


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_a_node_has_one_story(path: Path) -> None:
    findings = [finding for finding in checked(path).findings if finding.severity != "note"]
    deleted = {
        finding.prim for finding in findings if finding.rule in {"N02", "N03", "N07", "N08", "N09"}
    }
    others = [
        finding.prim
        for finding in findings
        if finding.rule[0] in "NPRWT" and finding.prim in deleted
    ]
    assert len(others) == len(set(others))


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_a_finding_in_a_text_file_has_its_line_where_its_prim_is_written(path: Path) -> None:
    stage = open_stage(path)
    for finding in checked(path).findings:
        prim = stage.GetPrimAtPath(finding.prim)
        if prim and prim.GetPrimStack() and finding.prim != "/":
            layers = {Path(spec.layer.realPath).name for spec in prim.GetPrimStack()}
            assert finding.line is not None or Path(finding.layer or "").name in layers


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_a_missing_asset_is_a_note_and_a_missing_sublayer_an_error(path: Path) -> None:
    result = checked(path)
    assert {finding.severity for finding in result.findings if finding.rule == "F02"} <= {"note"}
    stage = open_stage(path)
    layers = list(stage.GetRootLayer().subLayerPaths)
    missing = [layer for layer in layers if not (path.parent / layer).exists()]
    assert said(result, "F03") == [("/", None)] * len(missing)


def test_every_checkpoint_may_be_asked_of_any_file() -> None:
    for path, checkpoint in zip(FILES, cycle(["00", "02", "08"]), strict=False):
        result = check_stage(path, checkpoint)
        assert result.crashes == ()
        assert result.checkpoint == checkpoint


def test_no_file_of_the_corpus_is_changed() -> None:
    path = FILES[0]
    before = path.read_bytes()
    check_stage(path, "05")
    assert path.read_bytes() == before


# What is said of some of them is true: each of these was looked up in the file.


def test_a_camera_graph_made_by_the_menu_is_known_and_its_values_are_read() -> None:
    result = one("ros2_apriltag.usd")
    graph = "/Graph/ROS_Camera"
    assert said(result, "G02") == [(graph, None)]
    assert said(result, "R02") == [(f"{graph}/RenderProduct", "inputs:cameraPrim")]
    assert said(result, "P02") == [(f"{graph}/Context", "inputs:useDomainIDEnvVar")]
    assert said(result, "P01") == [
        (f"{graph}/CameraInfoPublish", "inputs:frameId"),
        (f"{graph}/CameraInfoPublish", "inputs:topicName"),
        (f"{graph}/RGBPublish", "inputs:frameId"),
        (f"{graph}/RGBPublish", "inputs:topicName"),
        (f"{graph}/RenderProduct", "inputs:height"),
        (f"{graph}/RenderProduct", "inputs:width"),
    ]
    older = [f"{graph}/RGBPublish", f"{graph}/RenderProduct"]
    assert said(result, "N04") == [(prim, "node:typeVersion") for prim in older]
    assert said(result, "W01") == said(result, "W02") == said(result, "W03") == []


def test_a_velocity_graph_without_a_differential_controller() -> None:
    result = one("cezarioa-isaac-projects__ros_stage.usda")
    graph = "/Graphs/Velocity_Controller_01"
    assert said(result, "G02") == [(graph, None)]
    assert len(said(result, "N01")) == 3
    assert said(result, "N03") == [(f"{graph}/make_array", "node:type")]
    assert said(result, "P01") == [(f"{graph}/make_array_01", "inputs:arraySize")]


def test_a_controller_that_runs_only_when_a_message_comes() -> None:
    result = one("43142adfe0.usd")
    graph = "/World/Wheel_Drives"
    assert said(result, "W10") == [(f"{graph}/differential_controller", "inputs:execIn")]
    assert said(result, "N06") == [(graph, None)]
    assert [prim for prim, _ in said(result, "N09")] == [
        "/to_string",
        "/to_string_01",
        "/to_string_02",
        "/to_string_03",
    ]


def test_one_graph_for_everything_is_one_finding_and_judged_part_by_part() -> None:
    result = one("c734468427.usd")
    graph = "/World/ActionGraph_01"
    (several,) = [finding for finding in result.findings if finding.rule == "G05"]
    assert several.prim == graph
    assert "ROS_Clock, ROS_Drive and ROS_OdomTF" in several.message
    assert said(result, "G01") == said(result, "G02") == said(result, "N02") == []
    assert said(result, "N01") == [(graph, None)] * 2
    competing = f"{graph}/ros2_publish_raw_transform_tree_01"
    assert said(result, "T08") == [(competing, "inputs:parentFrameId")]


def test_a_missing_robot_names_the_graphs_that_are_missing_with_it() -> None:
    messages = {
        finding.prim: finding.message
        for finding in one("ros2_bridge.usd").findings
        if finding.rule == "S01"
    }
    assert messages["/turtlebot3_burger"].endswith("ROS_Drive, ROS_Lidar2D, ROS_Camera, ROS_OdomTF")
    assert messages["/World"].endswith("missing with it: ROS_Clock")


def test_a_robot_as_the_importer_writes_it_has_its_links_elsewhere() -> None:
    path = ROBOTS / "turtlebot3_burger.usda"
    found = [finding for finding in check_stage(path, "00").findings if finding.rule == "S01"]
    links = {each.prim: each.message for each in found}
    assert "/turtlebot3_burger/base_link" in links
    assert "Geometry/base_footprint" in links["/turtlebot3_burger/base_footprint"]


def test_graphs_of_the_replicator_are_nobodys_mistake() -> None:
    result = one("hospital_task.usda")
    assert [finding for finding in result.findings if finding.prim.startswith("/Replicator")] == []
