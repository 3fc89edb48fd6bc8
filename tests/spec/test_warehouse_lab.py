"""The lab of two robots, `docs/examples/labs/warehouse`, beside what its handout says, typed here.

Paths, values and frames in this file are written without a look at the files of the lab.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import Result
from in_process import invoke
from places import REPOSITORY, TESTS
from pxr import Gf, Sdf, Usd
from workers_here import workers_here

from lab3_usd.check.manual import rules_in
from lab3_usd.errors import SpecError
from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.scoring import facts_of
from lab3_usd.model.finding import StageResult
from lab3_usd.new_lab.lab import describe_lab, write_folder
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.pipeline.starter_comparison import against_starter, open_starter
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.submission import named_checkpoint, team_of
from lab3_usd.stage.write.builder import BuildOptions, build_files

WAREHOUSE = REPOSITORY / "docs" / "examples" / "labs" / "warehouse"
R1, R2 = "/World/r1", "/World/r2"
STAGES = range(1, 8)
DOMAIN = 42
# Property, value: what the handout's tables ask of the last stage.
TABLE: dict[str, Any] = {
    f"{R1}/DriveR1/controller.inputs:maxLinearSpeed": 1.2,
    f"{R1}/DriveR1/controller.inputs:maxAngularSpeed": 1.5,
    f"{R1}/DriveR1/controller.inputs:wheelDistance": 0.36,
    f"{R1}/DriveR1/controller.inputs:wheelRadius": 0.08,
    f"{R1}/DriveR1/twist.inputs:topicName": "/r1/cmd_vel",
    f"{R2}/DriveR2/controller.inputs:maxLinearSpeed": 0.4,
    f"{R2}/DriveR2/controller.inputs:maxAngularSpeed": 2.0,
    f"{R2}/DriveR2/controller.inputs:wheelDistance": 0.24,
    f"{R2}/DriveR2/controller.inputs:wheelRadius": 0.05,
    f"{R2}/DriveR2/twist.inputs:topicName": "cmd_vel",
    f"{R2}.isaac:namespace": "r2",
    f"{R1}/mast/Cloud.omni:sensor:tickRate": 15.0,
    f"{R1}/mast/Cloud/PointCloud/helper.inputs:type": "point_cloud",
    f"{R1}/mast/Cloud/PointCloud/helper.inputs:frameId": "r1/mast",
    f"{R1}/base/Imu.sensorPeriod": 0.01,
    f"{R1}/Measure/publisher.inputs:frameId": "r1/imu",
    f"{R2}/body/tower/Scan.omni:sensor:tickRate": 15.0,
    f"{R2}/body/tower/Scan/LaserScan/helper.inputs:type": "laser_scan",
    f"{R2}/FrontImage/product.inputs:width": 640,
    f"{R2}/BackImage/product.inputs:width": 320,
    f"{R2}/body/Front.focalLength": 18.0,
    f"{R2}/body/Back.focalLength": 12.0,
    f"{R1}/OdometryR1/publish_base.inputs:parentFrameId": "r1/odom",
    f"{R1}/OdometryR1/publish_base.inputs:childFrameId": "r1/base",
    "/World/OdometryR2/publish_base.inputs:parentFrameId": "r2/odom",
    "/World/OdometryR2/publish_base.inputs:childFrameId": "r2/body",
    f"{R1}/base/Imu.isaac:nameOverride": "r1/imu",
    f"{R2}/body/Back.isaac:nameOverride": "r2/back",
}
TREE = {
    "r1/odom": ["r1/base"],
    "r1/base": ["r1/left_wheel", "r1/right_wheel", "r1/castor", "r1/mast", "r1/imu"],
    "r2/odom": ["r2/body"],
    "r2/body": ["r2/left_wheel", "r2/right_wheel", "r2/tower", "r2/front", "r2/back"],
}


def run(*arguments: object) -> Result:
    return invoke("--lab", WAREHOUSE, *arguments)


@pytest.fixture(scope="module")
def lab() -> Lab:
    return load_lab(WAREHOUSE)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("warehouse") / "stages"
    assert run("build", "--out", out).exit_code == 0
    return out


def file_of(number: int) -> str:
    return f"team01_w{number}.usda"


def put(path: str, value: Any) -> Callable[[Usd.Stage], None]:
    """Give a property, written `PRIM.NAME`, a value."""

    def change(stage: Usd.Stage) -> None:
        prim, _, name = path.partition(".")
        assert stage.GetPrimAtPath(prim).GetAttribute(name).Set(value)

    return change


def aim(path: str, target: str) -> Callable[[Usd.Stage], None]:
    return lambda stage: stage.GetRelationshipAtPath(path).SetTargets([target])


def switch_off(path: str) -> Callable[[Usd.Stage], None]:
    return lambda stage: stage.GetPrimAtPath(path).SetActive(active=False)


def changed(built: Path, folder: Path, number: int, *changes: Callable[[Any], None]) -> Path:
    path = folder / file_of(number)
    shutil.copyfile(built / path.name, path)
    stage = Usd.Stage.Open(str(path))
    for change in changes:
        change(stage)
    stage.GetRootLayer().Save()
    return path


def errors(result: StageResult) -> list[tuple[str, str, tuple[str, ...]]]:
    return [(f.rule, f.prim, f.costs) for f in result.findings if f.severity == "error"]


def test_no_file_of_the_lab_is_code() -> None:
    assert {path.suffix for path in WAREHOUSE.iterdir()} == {".yaml"}


def test_the_lab_does_not_contradict_itself() -> None:
    assert invoke("lab", "check", WAREHOUSE).output == "Warehouse fleet: 0 errors, 0 warnings\n"


def test_every_built_stage_passes(built: Path) -> None:
    result = run("check", "--format", "json", built)
    found = json.loads(result.stdout)["results"]
    assert [Path(each["path"]).name for each in found] == [*map(file_of, STAGES)]
    assert {each["verdict"] for each in found} == {"pass"}
    assert {f["rule"] for each in found for f in each["findings"]} == {"P09"}


def test_the_last_stage_holds_what_the_handout_says(built: Path) -> None:
    stage = Usd.Stage.Open(str(built / file_of(6)))
    found = {path: stage.GetPropertyAtPath(path).Get() for path in TABLE}
    assert found == {path: pytest.approx(value) for path, value in TABLE.items()}
    contexts = [prim for prim in stage.Traverse() if prim.GetName() == "context"]
    assert {prim.GetAttribute("inputs:domain_id").Get() for prim in contexts} == {DOMAIN}


def test_each_robot_has_a_tree_of_its_own(lab: Lab, built: Path) -> None:
    shown = json.loads(run("tf", "--format", "json", built / file_of(5)).stdout)
    edges = {(edge["parent"], edge["child"]) for edge in shown["transforms"]}
    assert edges == {(parent, child) for parent, below in TREE.items() for child in below}
    assert lab.frames.roots == ("r1/odom", "r2/odom")


def test_two_trees_of_two_robots_are_right_in_text_and_pictures(built: Path) -> None:
    shown = run("tf", built / file_of(5)).output
    assert "roots, where" not in shown
    drawn = run("tf", "--format", "dot", built / file_of(5)).output
    assert "not connected" not in drawn


def test_requirements_speak_of_each_robot_by_its_name(lab: Lab, built: Path) -> None:
    result = check_stage(built / file_of(1), lab=lab)
    groups = [requirement.group for requirement in result.requirements]
    assert list(dict.fromkeys(groups)) == ["Scene", "r1", "r2"]
    ids = {requirement.id for requirement in result.requirements}
    assert {"r1/mass/castor", "r2/mass/body/tower", "r1/rest", "r2/rest"} <= ids


MISTAKES: list[tuple[str, Callable[[Any], None], tuple[str, str, str]]] = [
    ("r1 weighs more", put(f"{R1}/base.physics:mass", 90.0), ("S04", f"{R1}/base", "r1")),
    ("r2 weighs more", put(f"{R2}/body.physics:mass", 90.0), ("S04", f"{R2}/body", "r2")),
    (
        "a wheel below another link weighs more",
        put(f"{R2}/body/left_wheel.physics:mass", 3.0),
        ("S04", f"{R2}/body/left_wheel", "r2"),
    ),
    (
        "a wheel of r2 turns about another axle",
        put(f"{R2}/joints/left_joint.physics:axis", "X"),
        ("S09", f"{R2}/joints/left_joint", "r2"),
    ),
    (
        "a wheel of r2 rolls free",
        put(f"{R2}/joints/left_joint.drive:angular:physics:damping", 0.0),
        ("S10", f"{R2}/joints/left_joint", "r2"),
    ),
    (
        "a wheel of r1 rolls free",
        put(f"{R1}/joints/right_joint.drive:angular:physics:damping", 0.0),
        ("S10", f"{R1}/joints/right_joint", "r1"),
    ),
    (
        "r2 stands elsewhere",
        put(f"{R2}.xformOp:translate", Gf.Vec3d(-2.0, 1.0, 0.0)),
        ("S03", R2, "r2"),
    ),
    (
        "the tower of r2 is lower",
        put(f"{R2}/joints/tower_joint.physics:localPos0", Gf.Vec3f(0.0, 0.0, 0.2)),
        ("S17", f"{R2}/joints/tower_joint", "r2"),
    ),
    (
        "the wheels of r2 are wider apart",
        put(f"{R2}/joints/left_joint.physics:localPos0", Gf.Vec3f(0.0, 0.16, 0.05)),
        ("S20", f"{R2}/joints/left_joint", "r2"),
    ),
    ("the topics of r2 move", put(f"{R2}.isaac:namespace", "r3"), ("P10", R2, "r2")),
    ("r2 is switched off", switch_off(R2), ("S01", R2, "r2")),
    (
        "a link below another one is switched off",
        switch_off(f"{R2}/body/tower"),
        ("S01", f"{R2}/body/tower", "r2"),
    ),
    (
        "the castor of r1 hangs on its mast",
        aim(f"{R1}/joints/castor_joint.physics:body0", f"{R1}/mast"),
        ("S26", f"{R1}/joints/castor_joint", "r1"),
    ),
    ("the castor of r1 is switched off", switch_off(f"{R1}/castor"), ("S01", f"{R1}/castor", "r1")),
]


@pytest.mark.parametrize(
    ("change", "expected"),
    [pytest.param(change, expected, id=name) for name, change, expected in MISTAKES],
)
def test_a_mistake_of_a_robot_is_one_error_that_costs_its_own_group(
    lab: Lab,
    built: Path,
    tmp_path: Path,
    change: Callable[[Any], None],
    expected: tuple[str, str, str],
) -> None:
    rule, prim, group = expected
    result = check_stage(changed(built, tmp_path, 1, change), lab=lab)
    assert errors(result) == [(rule, prim, (group,))]
    assert {item.group for item in result.requirements if not item.met} == {group}


def test_a_described_joint_of_another_type_is_given_its_own_again(
    built: Path, tmp_path: Path
) -> None:
    path = changed(
        built,
        tmp_path,
        1,
        lambda stage: stage.GetPrimAtPath(f"{R1}/joints/castor_joint").SetTypeName("PhysicsJoint"),
    )
    repaired = run("fix", path, "--unsafe", "--diff")
    assert repaired.exit_code == 1
    assert '+            def PhysicsSphericalJoint "castor_joint"' in repaired.output.splitlines()


def test_a_limit_that_no_section_names_has_that_of_its_controller(
    lab: Lab, built: Path, tmp_path: Path
) -> None:
    node = f"{R2}/DriveR2/controller"

    def limit(stage: Usd.Stage) -> None:
        name, kind = "inputs:maxAcceleration", Sdf.ValueTypeNames.Double
        stage.GetPrimAtPath(node).CreateAttribute(name, kind).Set(2.0)

    found = check_stage(changed(built, tmp_path, 3, limit), lab=lab).findings
    assert [(f.rule, f.prim, f.handout) for f in found] == [("P11", node, "3.2")]


SCAN = f"{R2}/body/tower/Scan"
RATES = ("omni:sensor:tickRate", "omni:sensor:Core:scanRateBaseHz")


@pytest.mark.parametrize(
    ("asked", "values", "told"),
    [
        ((), {RATES[0]: 5.0}, [("L10", RATES[0])]),
        (RATES[:1], {RATES[1]: 1}, [("L10", RATES[1])]),
        (RATES[:1], {RATES[0]: 5.0}, [("L05", RATES[0])]),
        ((), {RATES[0]: 20.0, RATES[1]: 20}, []),
    ],
)
def test_a_laser_that_is_read_at_another_rate_than_it_turns_is_told(
    built: Path, tmp_path: Path, asked: Collection[str], values: Mapping[str, Any], told: list[Any]
) -> None:
    lab = tmp_path / "lab"
    shutil.copytree(WAREHOUSE, lab)
    scene = yaml.safe_load((lab / "scene.yaml").read_text())
    for name in RATES:
        scene["sensors"]["scan"]["attributes"][name]["required"] = name in asked
    (lab / "scene.yaml").write_text(yaml.safe_dump(scene, sort_keys=False))
    path = changed(built, tmp_path, 4, *(put(f"{SCAN}.{n}", v) for n, v in values.items()))
    found = check_stage(path, lab=load_lab(lab)).findings
    assert [(f.rule, f.property) for f in found if f.prim == SCAN and f.rule != "L13"] == told


def test_lost_frames_are_told_at_the_graph_that_sends_them(
    lab: Lab, built: Path, tmp_path: Path
) -> None:
    gone = changed(built, tmp_path, 7, lambda stage: stage.GetPrimAtPath(R2).SetActive(False))  # noqa: FBT003 - pxr takes no keyword
    lost = [finding for finding in check_stage(gone, lab=lab).findings if finding.rule == "T20"]
    assert [finding.prim for finding in lost] == ["/World/OdometryR2"]
    assert "r2/odom -> r2/body" in lost[0].message


def test_a_robot_that_was_renamed_is_not_taken_for_the_other(
    lab: Lab, built: Path, tmp_path: Path
) -> None:
    path = tmp_path / file_of(5)
    shutil.copyfile(built / path.name, path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    edit = Sdf.BatchNamespaceEdit()
    edit.Add("/World/r2", "/World/picker")
    assert layer.Apply(edit)
    layer.Save()
    found = [f for f in check_stage(path, lab=lab).findings if f.rule == "S01"]
    assert [(f.prim, f.message.partition(";")[0]) for f in found] == [
        ("/World/picker", "r2 is at /World/picker, expected at /World/r2")
    ]


def test_a_frame_that_lost_its_override_is_named_as_the_lab_has_it(
    lab: Lab, built: Path, tmp_path: Path
) -> None:
    def rename(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(f"{R2}/body/Front").RemoveProperty("isaac:nameOverride")

    result = check_stage(changed(built, tmp_path, 5, rename), lab=lab)
    assert [(f.rule, f.prim, f.expected) for f in result.findings if f.severity == "error"] == [
        ("T01", f"{R2}/body/Front", "r2/front")
    ]


@pytest.mark.parametrize("robot", ["r1", "r2"])
def test_no_node_may_place_the_odometry_of_either_robot(
    lab: Lab, built: Path, tmp_path: Path, robot: str
) -> None:
    graph = {"r1": f"{R1}/OdometryR1", "r2": "/World/OdometryR2"}[robot] + "/publish_base"
    change = put(f"{graph}.inputs:childFrameId", f"{robot}/odom")
    other = put(f"{graph}.inputs:parentFrameId", "world")
    result = check_stage(changed(built, tmp_path, 5, change, other), lab=lab)
    assert ("T07", graph) in [(rule, prim) for rule, prim, _ in errors(result)]


# Two pieces of driving that stay below all limits, and a rest.
BRIEF = ("--drive", "0.15,0,0.6 0,0.8,1 0,0,0.3")


def played(path: Path, *words: object) -> dict[tuple[str, str], dict[str, Any]]:
    """The checks of a dry run, by robot ('' for the whole stage) and name."""
    shown = json.loads(run("sim", path, "--format", "json", *words).stdout)
    return {(check.get("of", ""), check["name"]): check for check in shown["checks"]}


def test_each_robot_is_driven_by_its_own_commands_and_drawn_on_the_page(
    built: Path, tmp_path: Path, subtests: pytest.Subtests
) -> None:
    page = tmp_path / "page.html"
    checks = played(built / file_of(5), *BRIEF, "--page", page)
    assert {check["verdict"] for check in checks.values()} == {"ok"}
    text = page.read_text(encoding="utf-8")
    for robot in ("r1", "r2"):
        with subtests.test(robot=robot):
            assert {name for of, name in checks if of == robot} >= {"follows", "odometry"}
            assert f"The test drive of {robot}" in text
            assert f"Motion and commands of {robot} over time" in text
    assert ("r2", "scan") in checks
    assert ("r1", "scan") not in checks
    assert ("", "tree") in checks


# The faults of one robot by the check that shows each.
PLAYED: dict[str, dict[str, tuple[str, Any]]] = {
    "r1": {"limits": (f"{R1}/DriveR1/controller.inputs:maxLinearSpeed", 0.6)},
    "r2": {
        "limits": (f"{R2}/DriveR2/controller.inputs:maxLinearSpeed", 0.2),
        "follows": (f"{R2}/DriveR2/controller.inputs:wheelDistance", 0.36),
        "odometry": ("/World/OdometryR2/publish_odometry.inputs:odomFrameId", "odom"),
        "scan": (f"{R2}/body/tower/Scan.omni:sensor:tickRate", 10.0),
    },
}


@pytest.mark.parametrize(
    ("robot", "drive"),
    [("r1", "1.3,0,0.8 0,2.2,0.8 0,0,0.4"), ("r2", "0.5,0,0.8 0,0.8,0.8 0,0,0.4")],
)
def test_faults_of_one_robot_are_shown_by_its_own_checks(
    built: Path, tmp_path: Path, robot: str, drive: str
) -> None:
    changes = [put(path, value) for path, value in PLAYED[robot].values()]
    checks = played(changed(built, tmp_path, 5, *changes), "--drive", drive)  # beyond the limits
    bad = {key for key, check in checks.items() if check["verdict"] == "bad"}
    assert bad >= {(robot, name) for name in PLAYED[robot]}
    assert {of for of, _ in bad} <= {robot, ""}
    assert not any("castor" in str(check) for check in checks.values())  # a ball joint has no drive


WIDE = put(f"{R2}/DriveR2/controller.inputs:wheelDistance", 0.6)  # r2 turns more than commanded


def test_a_recording_of_both_robots_is_judged_by_the_commands_of_each(
    built: Path, tmp_path: Path, subtests: pytest.Subtests
) -> None:
    """One turns too much; that both may be right is seen in `test_static_frames.py`."""
    pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")
    bag = tmp_path / "bag"
    run("sim", changed(built, tmp_path, 5, WIDE), *BRIEF, "--bag", bag)
    shown = json.loads(run("bag", bag, "--checkpoint", "5", "--format", "json").stdout)
    checks = {(check["of"], check["name"]): check["verdict"] for check in shown["checks"]}
    assert {key for key, verdict in checks.items() if verdict != "ok"} == {("r2", "follows")}
    for robot in ("r1", "r2"):
        with subtests.test(robot=robot):
            moved = {name for of, name in checks if of == robot}
            assert moved >= {"rest", "follows", "odometry", "moving frames", "way"}
    assert ("r2", "scan") in checks
    assert {"messages", "topics", "tree", "headers"} <= {name for of, name in checks if not of}


def test_what_a_dry_run_shows_of_one_robot_costs_its_own_item(
    lab: Lab, built: Path, tmp_path: Path
) -> None:
    result = check_stage(changed(built, tmp_path, 3, WIDE), lab=lab)
    (stage,) = with_dry_runs(facts_of([result], {}), lab, {}).stages
    assert "follows" in stage.shown
    assert "r2: follows" in stage.shown
    assert "r1: follows" not in stage.shown


def test_lab_new_describes_both_robots_their_sensors_and_frames(
    lab: Lab, built: Path, tmp_path: Path
) -> None:
    paths = [built / file_of(number) for number in STAGES]
    description = describe_lab(paths, load_lab())
    assert description.left_out == ()
    write_folder(tmp_path / "new", description.files)
    new = load_lab(tmp_path / "new")
    for found, robot in zip(new.scene.robots, lab.scene.robots, strict=True):
        assert (found.name, found.path, found.base) == (robot.name, robot.path, robot.base)
        assert {name: link.mass for name, link in found.links.items()} == {
            name: link.mass for name, link in robot.links.items()
        }
        assert found.wheels.distance == pytest.approx(robot.wheels.distance)
        assert found.wheels.joints == robot.wheels.joints
        assert {name: (joint.type, joint.links) for name, joint in found.joints.items()} == {
            name: (joint.type, joint.links) for name, joint in robot.joints.items()
        }
    paths_of = [{sensor.path for sensor in each.sensors.values()} for each in (new, lab)]
    assert paths_of[0] == paths_of[1]
    assert set(new.frames.edges) == set(lab.frames.edges)
    assert new.frames.names == lab.frames.names
    assert new.scene.namespaces == {R2: "r2"}
    nodes = [node for graph in new.graphs.values() for node in graph.nodes.values()]
    assert [(node.role, node.since) for node in nodes if node.since] == [("quality", "6")]
    made = {name for name, topic in lab.topics.items() if topic.source is None or topic.subscribed}
    assert new.topics.keys() == made


@pytest.mark.parametrize(
    ("name", "checkpoint"),
    [
        ("team07_w3.usda", "3"),
        ("teamBlue_w6.usd", "6"),
        ("team07_w31.usda", None),
        ("team_w3.usda", None),
        ("w3.usda", None),
    ],
)
def test_a_file_name_holds_what_the_team_is_called(
    lab: Lab, name: str, checkpoint: str | None
) -> None:
    assert named_checkpoint(name, lab.files) == checkpoint


@pytest.mark.parametrize(
    ("stem", "name", "team"),
    [
        ("team07_w3", "team{team}_w3", "07"),
        ("teamBlue_w3_final", "team{team}_w3", "Blue"),
        ("dock_3_team12_drive", "dock_3_team{team}_drive", "12"),
        ("dock_3_team12", "dock_3_team{team}_drive", "12"),
        ("w3", "team{team}_w3", ""),
        ("w3", "w3", ""),
    ],
)
def test_what_a_team_is_called_is_read_from_its_files(stem: str, name: str, team: str) -> None:
    assert team_of(stem, name) == team


def test_a_bonus_that_is_not_handed_in_is_not_missing(built: Path, tmp_path: Path) -> None:
    for number in (1, 2, 3, 5, 6):
        shutil.copyfile(built / file_of(number), tmp_path / f"team12_w{number}.usda")
    shown = json.loads(run("check", "--submission", "--format", "json", tmp_path).stdout)
    (submission,) = shown["submissions"]
    missing = [f["message"] for f in submission["findings"] if f["rule"] == "X01"]
    assert missing == ["the stage of checkpoint 4 is missing"]


@pytest.mark.parametrize("written", ["{squad}", "{team:s}", "{{team}"])
def test_a_placeholder_that_nobody_fills_in_is_refused(written: str, tmp_path: Path) -> None:
    copy = tmp_path / "lab"
    shutil.copytree(WAREHOUSE, copy)
    file = copy / "checkpoints.yaml"
    file.write_text(file.read_text().replace("{team}", written))
    with pytest.raises(SpecError, match=re.escape(f"files: '{written}' is not a placeholder")):
        load_lab(copy)


def test_a_class_is_graded_robot_by_robot(built: Path, tmp_path: Path) -> None:
    for team, student in (("07", "ann"), ("08", "bob")):
        folder = tmp_path / "class" / student
        folder.mkdir(parents=True)
        for number in STAGES if student == "ann" else range(1, 4):
            shutil.copyfile(built / file_of(number), folder / f"team{team}_w{number}.usda")
    path = tmp_path / "class" / "bob" / "team08_w1.usda"
    stage = Usd.Stage.Open(str(path))
    put(f"{R2}/body.physics:mass", 9.0)(stage)
    stage.GetRootLayer().Save()
    starter, book = tmp_path / "hall.usda", tmp_path / "book"
    assert run("starter", "-o", starter).exit_code == 0
    with workers_here():
        grading = run("grade", tmp_path / "class", "--starter", starter, "-o", book)
    assert grading.exit_code == 0
    ann, bob = csv.DictReader((book / "grades.csv").read_text().splitlines())
    assert (ann["earned"], ann["possible"], ann["bonus"]) == ("105.00", "100.00", "5.00")
    assert [row["team"] for row in (ann, bob)] == ["07", "08"]
    page = (book / "index.html").read_text(encoding="utf-8")
    assert [f"team {number}" in page for number in ("07", "08", "09")] == [True, True, False]
    assert (bob["hall"], bob["r1"], bob["bonus"]) == ("4.00", "3.00", "0.00")
    assert float(bob["r2"]) < 3.0
    assert "r2: " in bob["remarks"]


def test_the_graphs_and_both_trees_are_drawn(lab: Lab, built: Path, tmp_path: Path) -> None:
    assert run("draw", built / file_of(7), "--out", tmp_path).exit_code == 0
    drawn = {each.stem.rpartition("-")[2] for each in tmp_path.iterdir()}
    assert drawn == {*lab.graphs, "TF"}


def test_a_graph_grows_with_a_later_checkpoint(lab: Lab, built: Path, tmp_path: Path) -> None:
    quality = f"{R2}/body/tower/Scan/LaserScan/quality"
    stages = {number: Usd.Stage.Open(str(built / file_of(number))) for number in STAGES}
    assert [n for n, stage in stages.items() if stage.GetPrimAtPath(quality)] == [6, 7]
    result = check_stage(changed(built, tmp_path, 6, switch_off(quality)), lab=lab)
    assert errors(result) == [("N01", quality.rpartition("/")[0], ("LaserScan",))]
    early = tmp_path / file_of(5)
    shutil.copyfile(built / file_of(6), early)
    found = [(f.rule, f.prim, f.severity) for f in check_stage(early, lab=lab).findings]
    assert ("N02", quality, "warning") in found


MISTAKES_AT_ONCE = [*yaml.safe_load_all((TESTS / "labs" / "warehouse_mistakes.yaml").read_text())]


@pytest.mark.parametrize("mistakes", MISTAKES_AT_ONCE, ids=", ".join)
def test_lab_check_says_what_the_description_contradicts(
    built: Path, tmp_path: Path, mistakes: dict[str, list[str]]
) -> None:
    copy = tmp_path / "lab"
    shutil.copytree(WAREHOUSE, copy)
    (copy / "starter.yaml").unlink()  # a lab whose instructor holds the scene
    for file, old, new, _ in mistakes.values():
        text = (copy / file).read_text()
        assert old in text
        (copy / file).write_text(text.replace(old, new, 1))
    shown = invoke("lab", "check", copy, "--from", built / file_of(7))
    assert shown.exit_code == 1
    assert unsaid(mistakes, shown) == [], shown.output


def unsaid(mistakes: Mapping[str, Sequence[str]], shown: Result) -> list[str]:
    """Return the mistakes that no line is said of; what it begins with comes last."""
    lines = shown.output.splitlines()
    return [
        name
        for name, (*_, said) in mistakes.items()
        if not any(line.startswith(said) for line in lines)
    ]


# File, what is written, what is written instead, and what is only seen once the stage is built.
BUILT = {
    "wheels wider apart than the starter's": (
        "scene.yaml", "distance: 0.36", "distance: 0.46",
        "warning scene.yaml: /World/r1/joints/left_joint: localPos0: the wheel joints are 0.36",
    ),
    "a joint that the robot does not have": (
        "DriveR1.yaml", "value: left_joint", "value: left_join",
        "warning DriveR1.yaml: motors: jointNames: the robot has no joint 'left_join'",
    ),
    "a node that nothing triggers": (
        "DriveR1.yaml", "  - tick.tick -> twist.execIn\n", "",
        "warning DriveR1.yaml: twist: execIn: ROS2 Subscribe Twist never executes",
    ),
    "motors of the other robot": (
        "DriveR2.yaml", "targetPrim: [/World/r2/body]", "targetPrim: [/World/r1/base]",
        "warning DriveR2.yaml: motors: jointNames: commands right_joint, which /World/r1/DriveR1",
    ),
    "an attribute that no schema has": (
        "scene.yaml", '"omni:sensor:tickRate"', '"omni:sensor:tickrate"',
        "warning scene.yaml: /World/r1/mast/Cloud: omni:sensor:tickrate: omni:sensor:tickrate",
    ),
}  # fmt: skip


def test_lab_check_builds_and_judges_what_a_lab_with_a_starter_describes(tmp_path: Path) -> None:
    copy = tmp_path / "lab"
    shutil.copytree(WAREHOUSE, copy)
    for file, old, new, _ in BUILT.values():
        text = (copy / file).read_text()
        assert old in text
        (copy / file).write_text(text.replace(old, new, 1))
    shown = invoke("lab", "check", copy)
    assert shown.exit_code == 1
    assert unsaid(BUILT, shown) == [], shown.output


def test_what_a_lab_leaves_out_of_navigation_is_as_in_the_bundled_one(lab: Lab) -> None:
    own, usual = lab.ros.navigation, load_lab().ros.navigation
    assert own is not None
    assert usual is not None
    assert (own.scan_topic, own.robot_radius, own.handout) == ("/r1/scan", 0.3, "6.3")
    assert (own.planner, own.timed, own.parameters) == (
        usual.planner,
        usual.timed,
        usual.parameters,
    )


def lab_of(release: str, folder: Path) -> Path:
    shutil.copytree(WAREHOUSE, folder)
    file = folder / "checkpoints.yaml"
    file.write_text(f'isaac: "{release}"\n{file.read_text()}')
    return folder


def test_a_course_may_use_another_release(lab: Lab, built: Path, tmp_path: Path) -> None:
    later = load_lab(lab_of("6.1", tmp_path / "lab"))
    helper = f"{R2}/FrontImage/helper"
    (path,) = build_files(
        later, None, {tmp_path / file_of(4): later.checkpoints["4"]}, BuildOptions()
    )
    stages = [Usd.Stage.Open(str(stage)) for stage in (built / file_of(4), path)]
    assert [s.GetPropertyAtPath(f"{helper}.node:typeVersion").Get() for s in stages] == [3, 4]
    assert check_stage(path, lab=later).verdict == "pass"
    found = {(f.rule, f.prim) for f in check_stage(path, lab=lab).findings}
    assert ("N05", helper) in found
    assert "Isaac Sim 6.1 updates" in rules_in(later)["N04"].manual


def test_an_unknown_release_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        SpecError, match=r"isaac: '7.1' is not a release of Isaac Sim; known are 2022.2"
    ):
        load_lab(lab_of("7.1", tmp_path / "lab"))


@pytest.mark.parametrize("robot", ["r1", "r2"])
def test_what_was_changed_of_the_starter_costs_the_robot_that_it_is_of(
    lab: Lab, built: Path, tmp_path: Path, robot: str
) -> None:
    wheel = {"r1": f"{R1}/left_wheel", "r2": f"{R2}/body/left_wheel"}[robot]
    path = changed(built, tmp_path, 3, put(f"{wheel}/tyre.radius", 0.02))
    starter = open_starter(built / file_of(1), lab)
    found = against_starter(check_stage(path, lab=lab), starter, lab).findings
    assert {(f.rule[0], f.costs) for f in found if f.severity == "error"} >= {("U", (robot,))}
    assert {cost for f in found for cost in f.costs if f.severity == "error"} == {robot}


def test_each_part_of_a_robot_may_be_left_out(built: Path, tmp_path: Path) -> None:
    copy = tmp_path / "lab"
    shutil.copytree(WAREHOUSE, copy)
    scene = yaml.safe_load((copy / "scene.yaml").read_text())
    scene["robots"]["r2"] = {"path": R2, "handout": "1.3"}
    (copy / "scene.yaml").write_text(yaml.safe_dump(scene, sort_keys=False))
    lab = load_lab(copy)
    assert check_stage(built / file_of(5), lab=lab).verdict == "pass"
    checks = dry_run(built / file_of(5), lab, "5", BRIEF[1]).behaviour.checks
    assert {check.verdict for check in checks} == {"ok"}
    assert {check.of for check in checks} == {"", "r1", "r2"}


def test_what_the_lab_itself_asks_for_is_no_fault(tmp_path: Path) -> None:
    copy = tmp_path / "lab"
    shutil.copytree(WAREHOUSE, copy)
    graph, scene = copy / "Clock.yaml", copy / "scene.yaml"
    clock, described = yaml.safe_load(graph.read_text()), yaml.safe_load(scene.read_text())
    clock["nodes"]["service"] = {"type": "isaacsim.ros2.bridge.ROS2ServicePrim"}
    clock["wires"] += ["tick.tick -> service.execIn", "context.context -> service.context"]
    graph.write_text(yaml.safe_dump(clock, sort_keys=False))
    described["sensors"]["cloud"]["scan"] = described["sensors"]["scan"]["scan"]
    scene.write_text(yaml.safe_dump(described, sort_keys=False))
    lab = load_lab(copy)
    plan = {tmp_path / file_of(6): lab.checkpoints["6"]}
    (path,) = build_files(lab, None, plan, BuildOptions())
    result = check_stage(path, lab=lab)
    assert {f.rule for f in result.findings if f.severity != "note"} == set()
    assert result.verdict == "pass"
