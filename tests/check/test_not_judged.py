"""What only a missing asset could tell is no finding: it is not judged, and counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from foreign_robots import TICK, rover, write_graph
from layerings import (
    LACKING,
    ROVER,
    behind_a_missing_robot,
    over_an_asset,
    rover_of_a_missing_asset,
)
from linting import linted
from models import LINKS
from pxr import Sdf, Usd
from scene_stages import (
    CAMERA,
    FLOOR,
    JOINTS,
    LIDAR,
    ROBOT,
    Change,
    aim,
    built,
    clear,
    hide_place,
    model_of,
    refer,
    remove,
    retype,
    several,
    told_after,
    weld,
    without_api,
)

from lab3_usd.check.checker import judge
from lab3_usd.check.registry import Rule
from lab3_usd.check.rule_runs import RuleResults, run_rule
from lab3_usd.model.finding import NotJudged, Problem, Report, Requirement, StageResult
from lab3_usd.model.stage import StageModel, UnresolvedAsset
from lab3_usd.pipeline.stage import check_stage, lint_stage
from lab3_usd.report.formats.registry import render
from lab3_usd.report.options import Options
from lab3_usd.spec.load.loader import load_lab

WALLS = "/Environment/More"
MISSING = UnresolvedAsset("/World/robot", "robot.usd", "reference")
OPEN = NotJudged("T01", "/World/robot/base_link", None, "robot.usd")


def judged(stage: Usd.Stage) -> RuleResults:
    lab = load_lab()
    judgement = judge(lab, lab.checkpoints["05"], model_of(stage))
    assert not judgement.crashes
    return judgement


def rules_in(entries: tuple[NotJudged, ...]) -> dict[str, int]:
    return dict(Counter(entry.rule for entry in entries))


def only_rule(*problems: Problem) -> Rule:
    def check(_subject: object) -> Iterator[Problem]:
        yield from problems

    return Rule("T01", "missing-frame", "error", "frames", check)


def test_a_problem_that_rests_on_a_missing_asset_is_left_open_once() -> None:
    problem = Problem(OPEN.prim, "nothing publishes it", rests_on=MISSING)
    results = run_rule(only_rule(problem, problem), None, None)
    assert (results.findings, results.not_judged) == ((), (OPEN,))


def test_a_problem_that_rests_on_nothing_is_a_finding() -> None:
    results = run_rule(only_rule(Problem(OPEN.prim, "nothing publishes it")), None, None)
    assert [finding.prim for finding in results.findings] == [OPEN.prim]
    assert results.not_judged == ()


@pytest.mark.parametrize(
    ("path", "asset"),
    [("/World/robot/base_link", MISSING), ("/World", None), ("/World/robot2", None)],
)
def test_unknown_is_what_the_missing_asset_could_hold(
    path: str, asset: UnresolvedAsset | None
) -> None:
    stage = StageModel(load_lab().platform, "Z", 1.0, 1.0, (), {}, unresolved=(MISSING,))
    assert stage.unknown(path) == asset


def test_something_below_a_prim_may_be_in_an_asset_further_down() -> None:
    stage = StageModel(load_lab().platform, "Z", 1.0, 1.0, (), {}, unresolved=(MISSING,))
    assert stage.unknown_below("/World") == MISSING
    assert stage.unknown_below("/World", beside=["/World/robot"]) is None
    assert stage.unknown_below("/Environment") is None


def test_frames_of_the_links_in_a_missing_robot_are_not_judged() -> None:
    judgement = judged(behind_a_missing_robot("05"))
    frames = [entry for entry in judgement.not_judged if entry.rule == "T01"]
    assert {entry.prim for entry in frames} == {
        f"{ROBOT}/{link}"
        for link in (
            "base_link",
            "base_scan",
            "wheel_left_link",
            "wheel_right_link",
            "caster_back_link",
        )
    }
    assert {entry.asset for entry in frames} == {"./turtlebot3_burger.usd"}
    assert "T01" not in {finding.rule for finding in judgement.findings}


def test_a_stage_whose_robot_is_missing_is_not_judged_and_no_pass(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05.usda"
    behind_a_missing_robot("05").GetRootLayer().Export(str(path))
    result = check_stage(str(path), "05")
    assert result.verdict == "not judged"
    assert [gap for gap in result.gaps if "./turtlebot3_burger.usd" in gap] == list(result.gaps)


def test_what_a_missing_robot_could_meet_is_not_met(tmp_path: Path) -> None:
    stage = tmp_path / "Lab3_05.usda"
    behind_a_missing_robot("05").GetRootLayer().Export(str(stage))
    result = check_stage(stage)
    unknown = {requirement.id for requirement in result.requirements if not requirement.judged}
    assert {"Scene/prim/base_link", "Scene/mass/base_link", "TF/frame/base_link"} <= unknown
    assert {requirement.group for requirement in result.requirements if not requirement.judged} == {
        "Scene",
        "TF",
    }
    assert result.score.not_judged == len(unknown)
    assert result.score.earned == result.score.possible - len(unknown)


@pytest.mark.parametrize("form", ["text", "markdown", "html"])
def test_no_report_counts_what_was_not_judged_as_met(form: str) -> None:
    asked = tuple(
        Requirement(f"Scene/mass/{number}", "Scene", "scene", "mass", met=True, judged=number >= 28)
        for number in range(215)
    )
    result = StageResult("stage.usda", "05", requirements=asked, gaps=("the robot is missing",))
    shown = render(form, Report((result,)), None, Options())
    assert "187 of 215" in shown
    assert "28 not judged" in shown
    assert "215 of 215" not in shown


def test_a_fault_beside_a_missing_robot_fails(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05.usda"
    stage = behind_a_missing_robot("05")
    stage.RemovePrim("/World/ROS_Clock")
    stage.GetRootLayer().Export(str(path))
    assert check_stage(str(path), "05").verdict == "fail"


def test_a_link_that_is_missing_is_no_pass(tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05.usda"
    stage = built("05")
    clear(BASE, "physics:mass")(stage)
    refer(BASE, "./elsewhere.usd")(stage)
    stage.GetRootLayer().Export(str(path))
    result = check_stage(str(path), "05")
    assert result.verdict == "not judged"
    assert "./elsewhere.usd" in result.gaps[0]


@pytest.mark.parametrize("place", ["/Environment", LIDAR])
def test_a_missing_asset_beside_or_in_the_robot_leaves_a_pass(place: str, tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05.usda"
    stage = built("05")
    refer(place, "./elsewhere.usd")(stage)
    stage.GetRootLayer().Export(str(path))
    assert check_stage(str(path), "05").verdict == "pass"


def test_nothing_is_left_open_where_every_asset_is_there() -> None:
    assert linted(rover()).not_judged == ()


def test_targets_and_articulation_in_a_missing_robot_are_not_judged() -> None:
    results = linted(rover_of_a_missing_asset())
    assert rules_in(results.not_judged) == {"K14": 6, "K60": 1}
    assert [finding.rule for finding in results.findings] == ["F02"]


def test_a_link_that_the_stage_itself_switches_off_is_judged_over_a_missing_robot() -> None:
    stage = rover_of_a_missing_asset()
    stage.OverridePrim(f"{ROVER}/chassis").SetActive(False)  # noqa: FBT003 - pxr takes it so
    results = linted(stage)
    targets = [finding.prim for finding in results.findings if finding.rule == "K14"]
    assert "/World/Odometry/compute" in targets
    left_open = {entry.prim for entry in results.not_judged if entry.rule == "K14"}
    assert "/World/Odometry/compute" not in left_open


def test_a_missing_sublayer_of_an_asset_leaves_open_the_nodes_of_the_asset(
    tmp_path: Path,
) -> None:
    stage = over_an_asset(tmp_path, LACKING)
    asset = Usd.Stage.Open(str(tmp_path / "walls.usda"))
    nodes = {"tick": TICK, "clock": ("ros.ROS2PublishClock", {})}
    write_graph(asset, "/Walls/Graph", nodes, ["tick.tick -> clock.execIn"])
    asset.Save()
    for graph in (f"{WALLS}/Mine", "/World/Own"):
        write_graph(stage, graph, nodes, ["tick.tick -> clock.execIn"])
    path = tmp_path / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    result = lint_stage(path)
    assert {(entry.rule, entry.prim) for entry in result.not_judged} == {
        ("K10", f"{WALLS}/Graph/clock")
    }
    assert {entry.asset for entry in result.not_judged} == {"./edits.usda"}
    unset = {finding.prim for finding in result.findings if finding.rule == "K10"}
    assert unset == {f"{WALLS}/Mine/clock", "/World/Own/clock"}


def test_a_missing_sublayer_of_an_asset_leaves_the_rest_of_the_lab_judged(tmp_path: Path) -> None:
    stage = over_an_asset(tmp_path, LACKING)
    assert judged(stage).not_judged == ()
    relationships = (prim.GetRelationship("inputs:targetPrims") for prim in stage.Traverse())
    (targets,) = [found for found in relationships if found and found.GetTargets()]
    targets.SetTargets([Sdf.Path(f"{ROBOT}/base_link")])
    judgement = judged(stage)
    assert "T01" in {finding.rule for finding in judgement.findings}
    assert judgement.not_judged == ()


@pytest.mark.parametrize(
    ("entries", "line"),
    [
        ((OPEN,), "1 thing was not judged: it may be in assets that were not found"),
        (
            (OPEN, NotJudged("K14", "/World/move", "inputs:targetPrim", "robot.usd")),
            "2 things were not judged: they may be in assets that were not found",
        ),
    ],
)
def test_the_verbose_text_counts_what_was_not_judged(
    entries: tuple[NotJudged, ...], line: str
) -> None:
    result = StageResult("stage.usda", "05", not_judged=entries)
    assert line in render("text", Report((result,)), {}, Options(verbosity="verbose")).splitlines()


@pytest.mark.parametrize(
    ("form", "verbosity"), [("text", "normal"), ("text", "quiet"), ("csv", "verbose")]
)
def test_other_reports_are_the_same_with_and_without_what_was_not_judged(
    form: str, verbosity: str
) -> None:
    texts = {
        render(
            form,
            Report((StageResult("a.usda", "05", not_judged=entries),)),
            {},
            Options(verbosity=verbosity),  # type: ignore[arg-type]
        )
        for entries in ((), (OPEN,))
    }
    assert len(texts) == 1


JOINT, BASE = f"{JOINTS}/wheel_left_joint", f"{ROBOT}/base_link"
FOOTPRINT = f"{ROBOT}/base_footprint"
TICK_RATE = "omni:sensor:tickRate"
SCAN_RATE = "omni:sensor:Core:scanRateBaseHz"


@pytest.mark.parametrize(
    ("change", "asset_at", "left_open"),
    [
        (clear(ROBOT, "xformOpOrder"), ROBOT, ("S03", ROBOT, "xformOp:translate")),
        (clear(BASE, "physics:mass"), BASE, ("S04", BASE, "physics:mass")),
        (
            without_api(BASE, "PhysicsRigidBodyAPI"),
            BASE,
            ("S05", BASE, "physics:rigidBodyEnabled"),
        ),
        (remove(JOINT), ROBOT, ("S07", JOINT, None)),
        (aim(JOINT, "physics:body1"), JOINT, ("S08", JOINT, "physics:body1")),
        (
            without_api(JOINT, "PhysicsDriveAPI:angular"),
            JOINT,
            ("S10", JOINT, "drive:angular:physics:damping"),
        ),
        (without_api(FOOTPRINT, "PhysicsArticulationRootAPI"), FOOTPRINT, ("S11", FOOTPRINT, None)),
        (
            remove(FLOOR),
            "/Environment/Walls",
            ("S13", "/Environment", None),
        ),
        (remove(LIDAR), f"{ROBOT}/base_scan", ("L01", LIDAR, None)),
        (
            several(clear(LIDAR, SCAN_RATE), without_api(LIDAR, "OmniSensorGenericLidarCoreAPI")),
            LIDAR,
            ("L05", LIDAR, SCAN_RATE),
        ),
        (
            without_api(LIDAR, "OmniSensorGenericLidarCoreAPI"),
            LIDAR,
            ("L06", LIDAR, None),
        ),
        (clear(CAMERA, "focalLength"), CAMERA, ("C06", CAMERA, "focalLength")),
        (clear(CAMERA, TICK_RATE), CAMERA, ("C07", CAMERA, TICK_RATE)),
    ],
)
def test_what_an_asset_could_bring_is_not_judged(
    change: Change, asset_at: str, left_open: tuple[str, str, str | None]
) -> None:
    stage = built("05")
    change(stage)
    rule = left_open[0]
    assert rule in {finding.rule for finding in judged(stage).findings}
    refer(asset_at, "elsewhere.usd")(stage)
    judgement = judged(stage)
    assert rule not in {finding.rule for finding in judgement.findings}
    entries = {(entry.rule, entry.prim, entry.property) for entry in judgement.not_judged}
    assert left_open in entries


def test_a_joint_that_may_be_tied_to_the_robot_is_not_judged() -> None:
    stage = built("05")
    joint = f"{ROBOT}/root_joint"
    weld(joint, body1=BASE)(stage)
    assert "S21" in {finding.rule for finding in judged(stage).findings}
    refer(joint, "elsewhere.usd")(stage)
    judgement = judged(stage)
    assert "S21" not in {finding.rule for finding in judgement.findings}
    assert ("S21", joint) in {(entry.rule, entry.prim) for entry in judgement.not_judged}


def test_the_links_of_a_missing_robot_are_not_judged_and_no_finding() -> None:
    judgement = judged(behind_a_missing_robot("05"))
    counts = rules_in(judgement.not_judged)
    assert {rule: counts[rule] for rule in ("S01", "S04", "S05", "S06")} == {
        "S01": len(LINKS),
        "S04": 5,
        "S05": len(LINKS),
        "S06": 2,
    }


def without_type(sensor: str) -> Change:
    return several(retype(sensor, ""), refer(sensor, "sensor.usd"))


@pytest.mark.parametrize(("checkpoint", "sensor"), [("03", LIDAR), ("04", CAMERA)])
@pytest.mark.parametrize("hidden", [hide_place, without_type])
def test_place_and_type_of_a_sensor_may_be_in_a_missing_asset(
    checkpoint: str, sensor: str, hidden: Callable[[str], Change]
) -> None:
    assert told_after(checkpoint, hidden(sensor)) == [("F02", sensor, None)]


@pytest.mark.parametrize(
    ("checkpoint", "sensor", "rule"), [("03", LIDAR, "L03"), ("04", CAMERA, "C03")]
)
def test_a_type_that_is_written_is_judged_beside_a_missing_asset(
    checkpoint: str, sensor: str, rule: str
) -> None:
    found = told_after(checkpoint, retype(sensor, "Xform"), refer(sensor, "sensor.usd"))
    assert (rule, sensor, None) in found
