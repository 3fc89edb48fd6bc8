"""Points of real stages: what does not work is not paid, no error is free, no repair costs."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest
from failing_students import (
    Mistake,
    drops,
    grade_with,
    hand_in,
    judged,
    mistakes,
    opened_starter,
    played,
    rubric,
)
from grade_files import LAB, built, stage
from msgspec.structs import replace
from pxr import Gf, Sdf, Usd
from scene_stages import (
    ROBOT,
    Change,
    author,
    clear,
    deactivate,
    put,
    remove,
    retype,
    turn,
)
from submissions import checked

from lab3_usd.grade import dry_runs
from lab3_usd.grade.dry_runs import with_dry_runs
from lab3_usd.grade.scoring import (
    Grade,
    StageFacts,
    SubmissionFacts,
    _kept,
    _own_losses,
    facts_of,
    grade_facts,
)

MADE = {mistake.name: mistake for mistake in mistakes()}
EVERY_GRAPH = {"clock", "drive", "scan", "camera", "odometry"}
GROSS = {
    "all graphs on demand": EVERY_GRAPH | {"tree"},
    "no tick wired": EVERY_GRAPH | {"tree"},
    "a namespace at every node": EVERY_GRAPH,
    "scene no wheel_left_link": {"starter", "drive"},
    "fault locked-joint": {"starter", "drive"},
    "fault no-lidar-schema": {"scan"},
}
GROSS_IN_ALL = {"all five topics wrong": EVERY_GRAPH, "a second controller": {"starter", "drive"}}


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> None:
    """Points are those of the bundled lab."""


def graded_submission(folder: Path) -> Grade:
    """Grade a folder as `lab3 grade` does, with the maps' faults left out."""
    result = checked(folder, starter=opened_starter())
    found = [each for each in result.submission.findings if not each.rule.startswith("M")]
    facts = facts_of(result.results, rubric().required, found)
    return grade_facts(rubric(), with_dry_runs(facts, LAB, {}))


def lost_items(graded: Grade) -> set[str]:
    return {item.id for item in graded.items if not item.earned}


def items_lost_in(stage: StageFacts) -> set[str]:
    """Return the items of which this stage, of whatever checkpoint, leaves nothing."""
    losses = {item: [*_own_losses(rubric(), item, stage)] for item in rubric().items}
    return {item.id for item, found in losses.items() if not _kept(item, found)}


@pytest.fixture(scope="module")
def graded_in_all(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Grade]:
    """The grades of stages until the graphs are complete, with one mistake in each stage."""
    later = [f"{entry.file}.usda" for number, entry in LAB.checkpoints.items() if number > "05"]
    folder = tmp_path_factory.mktemp("gross")
    right = shutil.copytree(built(), folder / "right", ignore=shutil.ignore_patterns(*later))
    for name in GROSS_IN_ALL:
        hand_in(MADE[name], right, folder / name)
    return {name: graded_submission(folder / name) for name in GROSS_IN_ALL}


@pytest.mark.parametrize("name", GROSS)
def test_what_does_not_work_is_not_paid(name: str) -> None:
    assert items_lost_in(played("05", MADE[name])) == GROSS[name]


@pytest.mark.parametrize("name", GROSS_IN_ALL)
def test_what_works_in_no_stage_is_not_paid(name: str, graded_in_all: Mapping[str, Grade]) -> None:
    assert lost_items(graded_in_all[name]) == GROSS_IN_ALL[name] | {"qos", "amcl", "nav2"}


@pytest.mark.parametrize(
    ("checkpoint", "name"),
    [
        ("05", "case W04"),
        ("03", "case W08"),
        ("01", "ROS_Clock twice"),
        ("05", "a script in ROS_OdomTF"),
        ("01", "scene no light"),
        ("04", "scene focal length"),
        ("08", "case P04 a profile by a wire"),
    ],
)
def test_no_mistake_that_fails_a_stage_earns_all(checkpoint: str, name: str) -> None:
    graded = grade_with(checkpoint, MADE[name])
    assert graded.possible == rubric().points
    assert graded.earned < graded.possible
    assert graded.percent is not None
    assert graded.percent < 100
    assert any(line.rule and line.place for line in graded.lost)


def test_every_deduction_names_its_rule_and_place(graded_in_all: Mapping[str, Grade]) -> None:
    topics_wrong = graded_in_all["all five topics wrong"]
    lines = [line for line in topics_wrong.lost if line.points and "is missing" not in line.title]
    assert {line.rule for line in lines} == {"P01"}
    assert all("all five topics wrong/work/" in line.place for line in lines)


def copied(folder: Path, copies: Mapping[str, str]) -> Grade:
    """Grade a submission whose checkpoints have the stages of others."""
    (folder / "work").mkdir(parents=True)
    for number, other in copies.items():
        shutil.copyfile(stage(other), folder / "work" / stage(number).name)
    return graded_submission(folder)


def test_copies_upward_earn_nothing(tmp_path: Path) -> None:
    numbers = [*LAB.checkpoints][:7]
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


@pytest.mark.parametrize("checkpoint", [*LAB.checkpoints][2::9])  # all: benchmarks/monotone.py
def test_one_mistake_more_never_earns_more(checkpoint: str) -> None:
    assert drops([*LAB.checkpoints].index(checkpoint), checkpoint) == []


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
    one = grade_with("02", MADE[name])
    both = grade_with("02", MADE[name], second)
    assert lost_items(one) >= {"starter", "drive"}
    assert both.earned <= one.earned


CONTROLLER = f"{ROBOT}/ROS_Drive/differential_controller"


def drive_with(**values: object) -> float:
    """Return what the drive earns with these inputs of its controller."""
    changes = (put(CONTROLLER, f"inputs:{name}", value) for name, value in values.items())
    return earned_by_drive(*changes)


def with_conversion(name: str) -> float:
    """Return what the drive earns where speeds are converted in this way."""
    return earned_by_drive(
        put(f"{ROBOT}/ROS_Drive/scale_linear_velocity", "inputs:conversion", name)
    )


def earned_by_drive(*changes: Change) -> float:
    graded = grade_with("02", Mistake("", changes))
    return next(item.earned for item in graded.items if item.id == "drive")


def test_a_fault_costs_no_item_that_does_not_rest_on_its_part() -> None:
    held = f"{ROBOT}/joints/scan_joint"
    tilted = Mistake("", (put(held, "physics:localRot0", Gf.Quatf(turn(20, (0, 1, 0)))),))
    earned = {
        item.id: item.earned / item.possible
        for checkpoint in ("01", "02", "03")
        for item in grade_with(checkpoint, tilted).items
        if item.id == {"01": "clock", "02": "drive", "03": "scan"}[checkpoint]
    }
    assert earned["clock"] == earned["drive"] == 1.0
    assert 0.9 < earned["scan"] < 1.0


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


def test_a_blemish_elsewhere_takes_no_drive_from_a_robot_that_its_limits_let_go_slowly() -> None:
    names = ("maxAcceleration", "maxDeceleration", "maxAngularAcceleration")
    ramps = [author(CONTROLLER, f"inputs:{name}", "Double", 0.5) for name in names]
    moved = put("/Environment/Furniture/CrateA", "xformOp:translate", Gf.Vec3d(2.0, 1.0, 0.25))
    assert earned_by_drive(*ramps, time_step, moved) == 15
    right = put(f"{ROBOT}/ROS_Drive/constant_right_joint", "inputs:value", "wheel_left_joint")
    assert earned_by_drive(*ramps, time_step, right) == 0


def time_step(stage: Usd.Stage) -> None:
    """Wire the time step of the controller."""
    step = stage.GetPrimAtPath(CONTROLLER).CreateAttribute("inputs:dt", Sdf.ValueTypeNames.Double)
    step.SetConnections([f"{ROBOT}/ROS_Drive/on_playback_tick.outputs:deltaSeconds"])


BOUND = "material:binding:physics"
TYRES = "/Environment/PhysicsMaterials/Tyre"


@pytest.mark.parametrize("lost", [remove(TYRES), clear(f"{ROBOT}/colliders/wheel/tyre", BOUND)])
def test_a_tyre_without_its_material_takes_no_drive(lost: Change) -> None:
    assert earned_by_drive(lost) == 15


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
    held, second = MADE["scene lidar link held elsewhere"], Mistake("no longer held", (hides,))
    one, both, alone = (grade_with("02", *made) for made in ([held], [held, second], [second]))
    assert both.earned <= one.earned < alone.earned


def test_a_namespace_on_the_robot_takes_every_item_whose_topics_it_moves() -> None:
    taken = items_lost_in(judged("05", MADE["case P10"]))
    assert taken == {"drive", "scan", "camera", "odometry", "tree"}


def test_repairing_the_odometry_does_not_cost_the_tree() -> None:
    graded = grade_with("05", MADE["fault wrong-odometry-frame"])
    assert graded.possible == 100
    assert graded.earned < 100


def fail(*_arguments: object) -> None:
    raise ZeroDivisionError("of its own")


def test_stages_without_errors_and_unreadable_ones_are_not_played(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dry_runs, "faults_in_dry_run", fail)
    faulty = judged("04", MADE["scene focal length"])
    facts = SubmissionFacts((judged("03"), replace(faulty, readable=False)))
    assert with_dry_runs(facts, LAB, {}) == facts


def test_a_dry_run_that_fails_itself_is_a_crash_over_each_stage_that_is_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dry_runs, "scene_of", fail)
    faulty = judged("04", MADE["scene focal length"])
    facts = SubmissionFacts((faulty, replace(faulty, path="again.usda")))
    tried = with_dry_runs(facts, LAB, dict.fromkeys((faulty.path, "again.usda"), "same"))
    assert tried.stages == facts.stages
    assert tried.crashes == dict.fromkeys(
        (faulty.path, "again.usda"), "ZeroDivisionError: of its own"
    )
    assert grade_facts(rubric(), tried).earned == 0
