"""A third lab, described after its solutions alone: a fixed arm of seven joints.

Each solution passes, and each single mistake is found once, in the words of the course.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from in_process import invoke
from other_labs import (
    COMMANDS,
    FILES,
    JOINTS,
    LIMITS,
    LINKS,
    ROBOT,
    STATES,
    describe,
    write_stages,
)
from pxr import Sdf, Usd
from recordings import on, rewritten
from workers_here import workers_here

from lab3_usd.errors import UsageError
from lab3_usd.features.bag.sim_recording import record_run
from lab3_usd.grade.dry_runs import faults_in_dry_run
from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.sim.bag.judge import judge_recording
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.judge.topics import expected_of_each
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

Mistake = Callable[[Usd.Stage], object]
FOREIGN = ("lidar", "camera", "AMCL", "/scan", "wheel", "drives", "turtlebot", "Nav2")


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], Path]:
    """The solutions, and the lab that is described after them."""
    folder = tmp_path_factory.mktemp("arm")
    stages = write_stages(folder)
    return stages, describe(stages, folder / "lab")


@pytest.fixture(scope="module")
def lab(described: tuple[list[Path], Path]) -> Lab:
    return load_lab(described[1])


def test_every_solution_passes(described: tuple[list[Path], Path], lab: Lab) -> None:
    assert {check_stage(stage, lab=lab).verdict for stage in described[0]} == {"pass"}


def test_the_checkpoints_are_those_of_the_stages(lab: Lab) -> None:
    assert tuple(lab.files.values()) == FILES
    assert [checkpoint.new for checkpoint in lab.checkpoints.values()] == [
        (),
        ("Clock",),
        ("States",),
        ("Commands",),
        ("Frames",),
    ]


def test_only_what_an_arm_has_is_written(described: tuple[list[Path], Path]) -> None:
    text = "".join(path.read_text() for path in described[1].glob("*.yaml"))
    assert [word for word in FOREIGN if word.lower() in text.lower()] == []


def test_each_joint_is_described_with_its_limits_and_its_drive(
    lab: Lab, subtests: pytest.Subtests
) -> None:
    joints = lab.scene.robot.joints
    assert list(joints) == list(JOINTS)
    for number, (name, found) in enumerate(joints.items(), start=1):
        with subtests.test(joint=name):
            assert found.links == (f"link{number - 1}", f"link{number}"), name
            assert (found.type, found.axis, found.limits) == ("PhysicsRevoluteJoint", "Z", LIMITS)
            assert found.drive == {"stiffness": 3200.0, "damping": 1000.0}


def test_every_link_below_the_articulation_root_is_a_frame(lab: Lab) -> None:
    assert [child for _, child in lab.frames.edges] == list(LINKS)


def opened(path: Path) -> Usd.Stage:
    """A stage of its own, whose changes nobody else sees."""
    return Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(path)))


def relies_on_defaults(stage: Usd.Stage) -> None:
    for prim in stage.Traverse():
        for name in ("useDomainIDEnvVar", "domain_id", "resetOnStop"):
            prim.GetAttribute(f"inputs:{name}").Clear()


def is_held_by_its_root_joint(stage: Usd.Stage) -> None:
    held = f"{ROBOT}/root_joint"
    stage.GetPrimAtPath(ROBOT).RemoveAppliedSchema("PhysicsArticulationRootAPI")
    stage.GetPrimAtPath(held).AddAppliedSchema("PhysicsArticulationRootAPI")
    aims("States/read", "prim", held)(stage)
    aims("Commands/motors", "targetPrim", held)(stage)
    aims("Frames/frames", "targetPrims", *(f"{ROBOT}/{link}" for link in LINKS))(stage)


@pytest.mark.parametrize("change", [relies_on_defaults, is_held_by_its_root_joint])
def test_an_arm_made_otherwise_passes_and_plays_as_well(
    change: Mistake, described: tuple[list[Path], Path], tmp_path: Path
) -> None:
    stage = opened(described[0][-1])
    change(stage)
    path = tmp_path / FILES[-1]
    stage.Export(f"{path}.usda")
    result = invoke("lab", "new", tmp_path / "lab", "--from", f"{path}.usda")
    assert re.search(r"checkpoint 5, pass, (\d+) of \1 met; sim ok", result.output), result.output
    assert load_lab(tmp_path / "lab").scene.robot.base_frame == LINKS[0]


def node(stage: Usd.Stage, path: str) -> Usd.Prim:
    prim: Usd.Prim = stage.GetPrimAtPath(f"/World/{path}")
    return prim


def sets(path: str, port: str, value: object) -> Mistake:
    return lambda stage: node(stage, path).GetAttribute(f"inputs:{port}").Set(value)


def aims(path: str, port: str, *targets: str) -> Mistake:
    paths = [Sdf.Path(target) for target in targets]
    return lambda stage: node(stage, path).GetRelationship(f"inputs:{port}").SetTargets(paths)


def cuts(path: str, port: str) -> Mistake:
    return lambda stage: node(stage, path).GetAttribute(f"inputs:{port}").ClearConnections()


DRIVE = "drive:angular:physics:"


def joint(name: str, attribute: str, value: object) -> Mistake:
    return lambda stage: node(stage, f"Panda/{name}").GetAttribute(attribute).Set(value)


# The rule that finds a mistake, and the words of the course in what it says.
MISTAKES: dict[str, tuple[Mistake, str, tuple[str, ...]]] = {
    "another topic": (
        sets("States/publish", "topicName", "/panda/joints"),
        "P01",
        ("/panda/joints", STATES),
    ),
    "another topic than the default that the course sets": (
        sets("Clock/clock", "topicName", "time"),
        "P01",
        ("time", "clock"),
    ),
    "another domain": (sets("Commands/context", "domain_id", 3), "P01", ("domain_id", "3", "0")),
    "stamps that are wired to nothing": (
        cuts("States/publish", "timeStamp"),
        "W01",
        ("timeStamp", "time"),
    ),
    "commands that reach no motor": (
        cuts("Commands/motors", "positionCommand"),
        "W01",
        ("positionCommand", "listen"),
    ),
    "joints of another prim": (aims("States/read", "prim", f"{ROBOT}/link3"), "R02", (ROBOT,)),
    "a frame that is left out": (
        aims("Frames/frames", "targetPrims", *(f"{ROBOT}/{link}" for link in LINKS[:-1])),
        "T01",
        (LINKS[-1],),
    ),
    "a link of another mass": (
        lambda stage: node(stage, "Panda/link2").GetAttribute("physics:mass").Set(13.0),
        "S04",
        ("link2", "1.3"),
    ),
    "an arm that nothing holds": (
        lambda stage: stage.RemovePrim(f"{ROBOT}/root_joint"),
        "S12",
        ("link0", "world", "falls over"),
    ),
    "an arm whose root joint is off": (
        lambda stage: (
            node(stage, "Panda/root_joint")
            .CreateAttribute("physics:jointEnabled", Sdf.ValueTypeNames.Bool)
            .Set(value=False)
        ),
        "S12",
        ("link0", "root_joint", "Joint Enabled"),
    ),
    "a joint with a weaker drive": (
        joint("joint3", f"{DRIVE}stiffness", 320.0),
        "S26",
        ("joint3", "stiffness", "320", "3200"),
    ),
    "a joint with a stiffer damper": (
        joint("joint4", f"{DRIVE}damping", 2000.0),
        "S26",
        ("joint4", "damping", "2000", "1000"),
    ),
    "a joint without a drive": (
        lambda stage: node(stage, "Panda/joint2").RemoveAppliedSchema("PhysicsDriveAPI:angular"),
        "S26",
        ("joint2", "no drive"),
    ),
    "a joint with another limit": (
        joint("joint5", "physics:upperLimit", 90.0),
        "S26",
        ("joint5", "upper limit", "90", "160"),
    ),
    "a joint that turns about another axis": (
        joint("joint6", "physics:axis", "Y"),
        "S26",
        ("joint6", "about Y", "expected Z"),
    ),
    "a joint that ties another link": (
        lambda stage: (
            node(stage, "Panda/joint7")
            .GetRelationship("physics:body0")
            .SetTargets([f"{ROBOT}/link2"])
        ),
        "S26",
        ("joint7", "link2", "link6"),
    ),
    "a joint that is gone": (
        lambda stage: stage.RemovePrim(f"{ROBOT}/joint3"),
        "S26",
        ("joint3", "missing"),
    ),
    "a joint that is off": (
        lambda stage: (
            node(stage, "Panda/joint1")
            .CreateAttribute("physics:jointEnabled", Sdf.ValueTypeNames.Bool)
            .Set(value=False)
        ),
        "S26",
        ("joint1", "disabled"),
    ),
    "a node that is missing": (
        lambda stage: stage.RemovePrim("/World/Commands/listen"),
        "N01",
        ("ROS2 Subscribe Joint State",),
    ),
}


# What would hide others is in another stage.
APART = ("an arm whose root joint is off", "a joint that is gone", "a node that is missing")
AT_ONCE = ([name for name in MISTAKES if name not in APART], APART)


@pytest.mark.parametrize("names", AT_ONCE, ids=["most", "apart"])
def test_each_mistake_is_found_once_in_the_words_of_the_course(
    names: Sequence[str],
    described: tuple[list[Path], Path],
    lab: Lab,
    tmp_path: Path,
    subtests: pytest.Subtests,
) -> None:
    solution = described[0][-1]
    wrong = tmp_path / solution.name
    shutil.copyfile(solution, wrong)
    stage = Usd.Stage.Open(str(wrong))
    for name in names:
        MISTAKES[name][0](stage)
    stage.GetRootLayer().Save()
    result = check_stage(wrong, lab=lab)
    errors = [finding for finding in result.findings if finding.severity == "error"]
    said = [(finding.rule, text_of(finding)) for finding in errors]
    assert len(said) == len(names), said
    for name in names:
        with subtests.test(name=name):
            _, rule, words = MISTAKES[name]
            told = [
                text
                for found, text in said
                if found == rule and all(word in text for word in words)
            ]
            assert len(told) == 1, (name, said)
    everything = " ".join(text for _, text in said).lower()
    assert [word for word in FOREIGN if word.lower() in everything] == []
    assert result.score.earned < result.score.possible


def text_of(finding: Finding) -> str:
    parts = (finding.prim, finding.property, finding.message, finding.expected, finding.hint)
    return " ".join(str(part) for part in parts if part)


def test_a_fallen_arm_loses_the_points_of_the_scene(
    described: tuple[list[Path], Path], tmp_path: Path
) -> None:
    stages, folder = described
    student = tmp_path / "class" / "ann"
    student.mkdir(parents=True)
    for path in stages:
        stage = opened(path)
        stage.RemovePrim(f"{ROBOT}/root_joint")
        stage.GetRootLayer().Export(str(student / path.name))
    book = tmp_path / "book"
    graded = ("grade", tmp_path / "class", "--starter", stages[0], "-o", book)
    with workers_here():
        assert invoke("--lab", folder, *graded).exit_code == 0
    with (book / "grades.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["scene"] == "0.00"


def test_stages_without_velocity_commands_are_played_by_hand(
    described: tuple[list[Path], Path], tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="by hand, and record them with: ros2 bag record --all"):
        invoke("--lab", described[1], "play", "-o", tmp_path / "play.py")


def test_commands_are_heard_on_the_topic_of_the_course(lab: Lab) -> None:
    assert lab.ros.topics[COMMANDS].subscribed
    assert lab.ros.topics[STATES].type == "sensor_msgs/msg/JointState"


# What a dry run at the last checkpoint shows of the joints, and the words that say why.
SHOWN: dict[str, tuple[Mistake | None, str, tuple[str, ...]]] = {
    "nothing wrong": (None, "ok", ()),
    "defaults": (relies_on_defaults, "ok", ()),
    "an arm held by its root joint": (is_held_by_its_root_joint, "ok", ()),
    "commands on another topic": (
        sets("Commands/listen", "topicName", "other"),
        "bad",
        ("move no joint", "listens to /other"),
    ),
    "commands in another domain": (
        sets("Commands/context", "domain_id", 3),
        "bad",
        ("move no joint", "listens in domain 3"),
    ),
    "a controller of no arm": (
        aims("Commands/motors", "targetPrim", "/World/Clock"),
        "bad",
        ("no articulation",),
    ),
    "commands that reach no motor": (
        lambda stage: [
            cuts("Commands/motors", f"{kind}Command")(stage)
            for kind in ("position", "velocity", "effort")
        ],
        "bad",
        ("nothing is connected to its command inputs",),
    ),
    "no node that listens": (
        lambda stage: stage.RemovePrim("/World/Commands/listen"),
        "bad",
        ("move no joint",),
    ),
}


@pytest.mark.parametrize("name", SHOWN)
def test_a_dry_run_at_a_checkpoint_commands_the_joints(
    name: str, described: tuple[list[Path], Path], lab: Lab, tmp_path: Path
) -> None:
    mistake, verdict, words = SHOWN[name]
    stage = opened(described[0][-1])
    if mistake is not None:
        mistake(stage)
    path = tmp_path / f"{FILES[-1]}.usda"
    stage.Export(str(path))
    behaviour = dry_run(path, lab, "5", "0,0,0.5").behaviour  # no wheels to drive
    joints = next(check for check in behaviour.checks if check.name == "joints")
    assert (joints.verdict, behaviour.verdict) == (verdict, verdict), behaviour.checks
    assert [word for word in words if word not in joints.text] == []


@pytest.mark.parametrize("name", ["nothing wrong", "commands on another topic"])
def test_grading_sees_whether_the_joints_follow(
    name: str, described: tuple[list[Path], Path], lab: Lab, tmp_path: Path
) -> None:
    mistake, verdict, _ = SHOWN[name]
    stage = opened(described[0][-1])
    if mistake is not None:
        mistake(stage)
    stage.Export(str(tmp_path / "stage.usda"))
    each = expected_of_each(lab, lab.checkpoints["5"])
    shown = faults_in_dry_run(tmp_path / "stage.usda", lab, each)
    assert ("joints" in shown) == (verdict == "bad")


def test_a_bag_of_a_checkpoint_says_that_joints_are_commanded_in_another_play(
    described: tuple[list[Path], Path], lab: Lab, tmp_path: Path
) -> None:
    run = dry_run(described[0][-1], lab, "5", "0,0,0.5")
    topic = run.behaviour.robots[0].topic
    *_, last = record_run(run, lab, tmp_path / "bag")
    assert last == f"  commands on {topic} come in another play: not recorded"


def test_a_recording_at_a_checkpoint_shows_whether_joints_follow(
    described: tuple[list[Path], Path], lab: Lab, tmp_path: Path
) -> None:
    def stuck(said: Any) -> None:
        said.position = 0.0 * said.position

    run = dry_run(described[0][-1], lab, "")
    [*record_run(run, lab, tmp_path / "bag")]
    changed = rewritten(tmp_path / "bag", tmp_path / "stuck", on(STATES, stuck))
    verdicts = [
        {check.name: check.verdict for check in found.behaviour.checks}["joints"]
        for found in (
            judge_recording(p, lab, "5", whole=False) for p in (tmp_path / "bag", changed)
        )
    ]
    assert verdicts == ["ok", "bad"]


def test_a_joint_that_is_deleted_from_a_folder_of_joints_is_found_once(
    described: tuple[list[Path], Path], tmp_path: Path
) -> None:
    stages, folder = described
    starter, stage = tmp_path / "starter.usda", tmp_path / stages[0].name
    layer = Sdf.Layer.FindOrOpen(str(stages[0]))
    for path, names in ((starter, JOINTS), (stage, JOINTS[1:])):
        copy = Sdf.Layer.CreateAnonymous(".usda")
        copy.TransferContent(layer)
        home = Sdf.CreatePrimInLayer(copy, f"{ROBOT}/joints")
        home.specifier, home.typeName = Sdf.SpecifierDef, "Scope"
        for name in names:
            Sdf.CopySpec(layer, f"{ROBOT}/{name}", copy, f"{ROBOT}/joints/{name}")
        for name in JOINTS:
            del copy.GetPrimAtPath(ROBOT).nameChildren[name]
        copy.Export(str(path))
    told = invoke("--lab", folder, "check", "--starter", starter, stage, "--format", "json").output
    found = [each["rule"] for each in json.loads(told)["results"][0]["findings"]]
    assert found == ["S26"]
