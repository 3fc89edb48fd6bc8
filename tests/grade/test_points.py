"""Points of real stages: what does not work is not paid, no error is free, no repair costs."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest
from failing_class import Mistake, hand_in, mistakes
from fault_chains import drops, facts_in, grade_with, opened_starter, rubric, stage_with
from grade_files import LAB, built, stage
from msgspec.structs import replace
from pxr import Usd
from scene_changes import ROBOT, Change, author, deactivate, put, retype

from lab3_usd.grade import dry_runs
from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.scoring import (
    Grade,
    SubmissionFacts,
    _own_losses,
    facts_of,
    grade_facts,
)
from lab3_usd.judge.folder import FolderSettings, check_folder

MADE = {mistake.name: mistake for mistake in mistakes()}
GROSS = {
    "all graphs on demand": {"clock", "drive", "scan", "camera", "odometry", "tree"},
    "no tick wired": {"clock", "drive", "scan", "camera", "odometry", "tree"},
    "all five topics wrong": {"clock", "drive", "scan", "camera", "odometry"},
    "a namespace at every node": {"clock", "drive", "scan", "camera", "odometry"},
    "a second controller": {"starter", "drive"},
    "scene no wheel_left_link": {"starter", "drive"},
    "fault locked-joint": {"starter", "drive"},
    "fault no-lidar-schema": {"scan"},
}


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> None:
    """Points are those of the bundled lab."""


def graded_submission(folder: Path) -> Grade:
    """Grade a folder as `lab3 grade` does, with the maps' faults left out."""
    settings = FolderSettings(starter=opened_starter())
    judged = check_folder(folder, settings)
    found = [each for each in judged.submission.findings if not each.rule.startswith("M")]
    facts = facts_of(judged.results, rubric().required, found)
    return grade_facts(rubric(), with_dry_runs(facts, LAB, {}))


def handed_in(mistake: Mistake, folder: Path) -> Grade:
    hand_in(mistake, built(), folder / "student")
    return graded_submission(folder / "student")


def lost_items(graded: Grade) -> set[str]:
    return {item.id for item in graded.items if not item.earned}


@pytest.fixture(scope="module")
def until_5(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The right stages until the graphs are complete."""
    later = [f"{entry.file}.usda" for number, entry in LAB.checkpoints.items() if number > "05"]
    ignored = shutil.ignore_patterns(*later)
    return shutil.copytree(built(), tmp_path_factory.mktemp("right") / "until 5", ignore=ignored)


@pytest.mark.parametrize("name", GROSS)
def test_what_does_not_work_is_not_paid(name: str, until_5: Path, tmp_path: Path) -> None:
    hand_in(MADE[name], until_5, tmp_path / "student")
    lost = lost_items(graded_submission(tmp_path / "student"))
    assert lost == GROSS[name] | {"qos", "amcl", "nav2"}


@pytest.mark.parametrize(
    "name",
    [
        "case W04",
        "case W08",
        "ROS_Clock twice",
        "a script in ROS_OdomTF",
        "scene no light",
        "scene focal length",
        "case P04 a profile by a wire",
    ],
)
def test_no_mistake_that_fails_a_stage_earns_all(name: str, tmp_path: Path) -> None:
    graded = handed_in(MADE[name], tmp_path)
    assert graded.possible == rubric().points
    assert graded.earned < graded.possible
    assert graded.percent is not None
    assert graded.percent < 100
    assert any(line.rule and line.place for line in graded.lost)


def test_every_deduction_names_its_rule_and_place(tmp_path: Path) -> None:
    graded = handed_in(MADE["all five topics wrong"], tmp_path)
    assert {line.rule for line in graded.lost if line.points} == {"P01"}
    assert all(line.place.startswith(str(tmp_path)) for line in graded.lost if line.points)


def copied(folder: Path, copies: Mapping[str, str]) -> Grade:
    """Grade a submission whose checkpoints have the stages of others."""
    (folder / "work").mkdir(parents=True)
    for number, other in copies.items():
        shutil.copyfile(stage(other), folder / "work" / stage(number).name)
    return graded_submission(folder)


def test_copies_upward_earn_nothing(tmp_path: Path) -> None:
    numbers = [*LAB.checkpoints]
    until_3 = copied(tmp_path / "short", {number: number for number in numbers[:4]})
    upward = copied(tmp_path / "long", {number: min(number, "03") for number in numbers})
    assert until_3.earned == upward.earned == 45
    bare = copied(tmp_path / "bare", dict.fromkeys(numbers, "00"))
    assert bare.earned == 5


def test_a_missing_stage_is_explained_by_the_file_that_is_called_so(tmp_path: Path) -> None:
    copied(tmp_path / "student", {number: number for number in LAB.checkpoints})
    camera = tmp_path / "student" / "work" / stage("04").name
    camera.rename(camera.with_suffix(".uda"))
    lost = {line.item: line for line in graded_submission(tmp_path / "student").lost}
    assert lost["camera"].title == "checkpoint 04 is missing"
    assert lost["camera"].rule == "X04"
    assert Path(lost["camera"].place).name == camera.with_suffix(".uda").name


def test_an_empty_stage_earns_no_more_than_a_missing_one(tmp_path: Path) -> None:
    others = {number: number for number in LAB.checkpoints if number != "05"}
    missing = copied(tmp_path / "missing", others)
    (tmp_path / "empty" / "work").mkdir(parents=True)
    (tmp_path / "empty" / "work" / stage("05").name).write_text("#usda 1.0\n")
    for path in (tmp_path / "missing" / "work").iterdir():
        shutil.copy(path, tmp_path / "empty" / "work")
    empty = graded_submission(tmp_path / "empty")
    assert (missing.earned, missing.percent) == (75, 75)
    assert (empty.earned, empty.percent) == (70, 70)  # it lacks the robot of the starter


@pytest.mark.parametrize("number", range(9))
def test_one_mistake_more_never_earns_more(number: int) -> None:
    assert drops(number, [*LAB.checkpoints][number]) == []


@pytest.mark.parametrize(
    ("name", "hidden_by"),
    [
        ("scene base_scan body off", "scene no scan_joint"),  # ties the robot to the world, or not
        ("fault sideways-drift", "the other tyre as small"),  # drives straight with both
    ],
)
def test_what_hides_a_fault_in_the_dry_run_gives_nothing_back(name: str, hidden_by: str) -> None:
    tyre = put(f"{ROBOT}/wheel_right_link/collisions/tyre", "radius", 0.03)
    second = MADE.get(hidden_by, Mistake(hidden_by, (tyre,)))
    one = grade_with(stage_with("02", MADE[name]), "02")
    both = grade_with(stage_with("02", MADE[name], second), "02")
    assert lost_items(one) >= {"starter", "drive"}
    assert both.earned <= one.earned


CONTROLLER = f"{ROBOT}/ROS_Drive/differential_controller"


def drive_with(**values: object) -> float:
    """Return what the drive earns with these inputs of its controller."""
    layer = stage_with("02")
    opened = Usd.Stage.Open(layer)
    for name, value in values.items():
        put(CONTROLLER, f"inputs:{name}", value)(opened)
    graded = grade_with(layer, "02")
    return next(item.earned for item in graded.items if item.id == "drive")


def with_conversion(name: str) -> float:
    """Return what the drive earns where speeds are converted in this way."""
    layer = stage_with("02")
    scale = f"{ROBOT}/ROS_Drive/scale_linear_velocity"
    put(scale, "inputs:conversion", name)(Usd.Stage.Open(layer))
    graded = grade_with(layer, "02")
    return next(item.earned for item in graded.items if item.id == "drive")


def test_another_conversion_of_metres_into_metres_is_a_blemish() -> None:
    assert 10 < with_conversion("Convert to meters") < 15
    assert with_conversion("Convert to feet") == 0


@pytest.mark.parametrize(
    "values",
    [
        {"wheelRadius": 0.0250001},
        {"wheelRadius": 0.0256},
        {"wheelDistance": 0.1561},
        {"wheelRadius": 0.0256, "wheelDistance": 0.1561},
    ],
)
def test_a_size_that_the_robot_drives_as_well_with_is_a_blemish(values: dict[str, float]) -> None:
    assert 10 < drive_with(**values) < 15


@pytest.mark.parametrize("values", [{"wheelRadius": 0.026}, {"wheelDistance": 0.15}])
def test_a_size_that_the_robot_drives_otherwise_with_takes_the_drive(
    values: dict[str, float],
) -> None:
    assert drive_with(**values) == 0


def test_the_nearest_float_is_the_size_itself() -> None:
    assert drive_with(wheelRadius=0.02500000037) == 15


SCAN_JOINT = f"{ROBOT}/joints/scan_joint"


@pytest.mark.parametrize(
    "hides",
    [
        author(SCAN_JOINT, "physics:jointEnabled", "Bool", value=False),
        deactivate(SCAN_JOINT),
        retype(SCAN_JOINT, "PhysicsRevoluteJoint"),
    ],
)
def test_a_joint_that_no_longer_holds_the_lidar_elsewhere_gives_nothing_back(hides: Change) -> None:
    one = grade_with(stage_with("02", MADE["scene lidar link held elsewhere"]), "02")
    second = Mistake("no longer held", (hides,))
    both = grade_with(stage_with("02", MADE["scene lidar link held elsewhere"], second), "02")
    alone = grade_with(stage_with("02", second), "02")
    assert both.earned <= one.earned < alone.earned


def test_a_namespace_on_the_robot_takes_every_item_whose_topics_it_moves() -> None:
    facts = facts_in(stage_with("05", MADE["case P10"]), "05", play=False)
    losses = {item.id: [*_own_losses(rubric(), item, facts)] for item in rubric().items}
    taken = {name for name, found in losses.items() if any(loss.share == 1 for loss in found)}
    assert taken == {"drive", "scan", "camera", "odometry", "tree"}


def test_repairing_the_odometry_does_not_cost_the_tree(tmp_path: Path) -> None:
    graded = handed_in(MADE["fault wrong-odometry-frame"], tmp_path)
    assert graded.possible == 100
    assert graded.earned < 100


def test_stages_without_errors_are_not_played() -> None:
    facts = facts_of(check_folder(built(), FolderSettings()).results, rubric().required)
    assert with_dry_runs(facts, LAB, {}) == facts
    faulty = SubmissionFacts(
        tuple(replace(each, path="nowhere.usda", readable=False) for each in facts.stages)
    )
    assert with_dry_runs(faulty, LAB, {}) == faulty


def test_a_dry_run_that_fails_itself_is_told_and_costs_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    hand_in(MADE["scene focal length"], built(), tmp_path / "student")
    results = check_folder(tmp_path / "student", FolderSettings()).results
    facts = facts_of(results, rubric().required)

    def fail(*_arguments: object) -> None:
        raise ZeroDivisionError("of its own")

    monkeypatch.setattr(dry_runs, "record", fail)
    played = with_dry_runs(facts, LAB, {})
    assert played.stages == facts.stages
    assert set(played.crashes.values()) == {"ZeroDivisionError: of its own"}
