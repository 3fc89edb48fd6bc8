"""A lab whose values change between checkpoints, with an optional stage in the middle.

It is the lab of two robots, with r1 slow up to the sensors and the bonus before them.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import yaml
from in_process import invoke
from places import REPOSITORY
from pxr import Usd

from lab3_usd.errors import SpecError
from lab3_usd.new_lab.lab import Description, describe_lab, write_folder
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.judge.topics import expected_of_each
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

WAREHOUSE = REPOSITORY / "docs" / "examples" / "labs" / "warehouse"
SPEED = "/World/r1/DriveR1/controller.inputs:maxLinearSpeed"
JOINTS = "/World/r2/Joints"
SLOW, FAST = 0.8, 1.2
# The names of the stages in their order, the bonus in the middle.
FILES = tuple(f"team01_w{name}.usda" for name in ("1", "2", "3", "7", "4", "5", "6"))
BONUS = FILES[3]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("changing") / "lab"
    shutil.copytree(WAREHOUSE, copy)
    drive, points = copy / "DriveR1.yaml", copy / "checkpoints.yaml"
    graph, described = yaml.safe_load(drive.read_text()), yaml.safe_load(points.read_text())
    graph["nodes"]["controller"]["until"] = {"drive": {"set": {"maxLinearSpeed": SLOW}}}
    drive.write_text(yaml.safe_dump(graph, sort_keys=False))
    entries = described["checkpoints"]
    order = ("start", "clock", "drive", "bonus", "sensors", "odometry", "nav")
    described["checkpoints"] = {name: entries[name] for name in order}
    points.write_text(yaml.safe_dump(described, sort_keys=False))
    return copy


@pytest.fixture(scope="module")
def lab(folder: Path) -> Lab:
    return load_lab(folder)


@pytest.fixture(scope="module")
def built(folder: Path) -> Path:
    out = folder.parent / "stages"
    assert invoke("--lab", folder, "build", "--out", out).exit_code == 0
    return out


def test_the_lab_does_not_contradict_itself(folder: Path) -> None:
    """And each stage that it builds passes, which would be a warning."""
    assert invoke("lab", "check", folder).output == "Warehouse fleet: 0 errors, 0 warnings\n"


def test_each_stage_has_the_value_of_its_checkpoint(built: Path) -> None:
    stages = [Usd.Stage.Open(str(built / name)) for name in FILES]
    speeds = [stage.GetPropertyAtPath(SPEED) for stage in stages]
    found = [speed.Get() if speed else None for speed in speeds]
    assert found == pytest.approx([None, None, SLOW, FAST, FAST, FAST, FAST])


def test_nothing_grows_on_an_optional_stage(built: Path) -> None:
    stages = {name: Usd.Stage.Open(str(built / name)) for name in FILES}
    assert [name for name, stage in stages.items() if stage.GetPrimAtPath(JOINTS)] == [BONUS]


def test_a_stage_after_an_optional_one_has_what_the_last_required_one_had(lab: Lab) -> None:
    points = list(lab.checkpoints.values())
    (bonus,) = [number for number, point in enumerate(points) if point.optional]
    before, own, after = points[bonus - 1 : bonus + 2]
    assert after.graphs == (*before.graphs, *after.new)
    assert not {*own.new} & {*after.graphs}


def test_another_value_than_that_of_the_checkpoint_is_an_error(
    lab: Lab, built: Path, tmp_path: Path, subtests: pytest.Subtests
) -> None:
    for number, name, wrong in (("3", FILES[2], FAST), ("5", FILES[5], SLOW)):
        with subtests.test(number=number):
            stage = Usd.Stage.Open(str(built / name))
            stage.GetPropertyAtPath(SPEED).Set(wrong)
            stage.Export(str(tmp_path / name))
            found = check_stage(tmp_path / name, number, lab).findings
            assert [(f.rule, f.prim) for f in found if f.severity == "error"] == [
                ("P01", SPEED.partition(".")[0])
            ]


def test_a_dry_run_expects_the_speed_of_the_checkpoint(lab: Lab) -> None:
    limits = [
        expected_of_each(lab, lab.checkpoints[number])["r1"].limits[0] for number in ("3", "5")
    ]
    assert limits == [SLOW, FAST]


def test_the_graph_of_a_bonus_may_stay_in_later_stages(
    lab: Lab, built: Path, tmp_path: Path
) -> None:
    later = Usd.Stage.Open(str(built / FILES[4]))
    bonus = Usd.Stage.Open(str(built / BONUS))
    later.GetRootLayer().subLayerPaths.append(bonus.GetRootLayer().identifier)
    later.Export(str(tmp_path / FILES[4]))
    result = check_stage(tmp_path / FILES[4], lab=lab)
    assert [f.rule for f in result.findings if f.severity != "note"] == []
    assert "/r2/joint_states" not in lab.topics_until("4")


def test_a_checkpoint_that_is_not_there_is_said(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "lab"
    shutil.copytree(folder, copy)
    file = copy / "DriveR1.yaml"
    file.write_text(file.read_text().replace("drive:", "driven:"))
    said = "DriveR1.yaml: controller: until: there is no checkpoint 'driven'"
    with pytest.raises(SpecError, match=said):
        load_lab(copy)


@pytest.fixture(scope="module")
def varied(built: Path) -> Path:
    """The stages with changes on the way that no file of a lab can hold."""
    folder = built.parent / "varied"
    shutil.copytree(built, folder)
    turning = "/World/r1/Measure/publisher.inputs:orientation"
    for number, name in enumerate(FILES):
        stage = Usd.Stage.Open(str(folder / name))
        if number == 2:
            stage.GetPropertyAtPath("/World/r2/body.physics:mass").Set(7.0)
        if number > 4:  # saved after a run
            stage.GetPropertyAtPath("/World/r1.xformOp:translate").Set((0.5, 0.5, 0.0))
        if number == 4:
            stage.GetPropertyAtPath(turning).ClearConnections()
        stage.GetRootLayer().Save()
    return folder


@pytest.fixture(scope="module")
def described(varied: Path) -> tuple[Path, Description]:
    folder = varied.parent / "described"
    description = describe_lab([varied / name for name in FILES], load_lab())
    write_folder(folder, description.files)
    return folder, description


def test_the_stages_pass_by_the_lab_that_is_described_after_them(
    varied: Path, described: tuple[Path, Description]
) -> None:
    """And one before a change plays by it, as `lab new` shows of each."""
    lab = load_lab(described[0])
    results = [check_stage(varied / name, lab=lab) for name in FILES]
    assert [result.verdict for result in results] == ["pass"] * len(FILES)
    beyond = "1.3,0,0.8 0,2.2,0.8 0,0,0.4"  # all limits
    assert dry_run(varied / FILES[2], lab, "3", beyond).behaviour.verdict == "ok"


def test_the_described_lab_has_what_changes_and_what_is_optional(
    described: tuple[Path, Description],
) -> None:
    lab = load_lab(described[0])
    until = lab.graphs["DriveR1"].nodes["controller"].until
    assert {
        key: [(setting.port, setting.value) for setting in values.settings]
        for key, values in until.items()
    } == {"3": [("inputs:maxLinearSpeed", pytest.approx(SLOW))]}
    assert [name for name, point in lab.checkpoints.items() if point.optional] == ["7"]
    assert {point.file for point in lab.checkpoints.values()} >= {"team{team}_w1"}
    (r1, _) = lab.scene.robots
    assert r1.pose is not None
    assert (r1.pose.translate, r1.pose_is_error_until) == ((1.0, -1.5, 0.0), "4")


def test_what_no_lab_can_hold_is_said(described: tuple[Path, Description]) -> None:
    differs = "differs between checkpoints, so not required"
    wire = "wire imu.orientation -> publisher.orientation"
    assert described[1].left_out == (
        f"/World/r1/Measure: {wire}: is missing in checkpoint 4, so not required",
        f"scene.yaml: robots: r2: links: body: mass: {differs}",
    )


def test_a_stage_of_a_later_release_is_described_for_it(folder: Path, tmp_path: Path) -> None:
    later = tmp_path / "lab"
    shutil.copytree(folder, later)
    points = later / "checkpoints.yaml"
    points.write_text(f'isaac: "6.1"\n{points.read_text()}')
    stages, new = tmp_path / "stages", tmp_path / "new"
    invoke("--lab", later, "build", "--out", stages, "--only", "4")
    write_folder(new, describe_lab([*stages.iterdir()], load_lab()).files)
    assert load_lab(new).platform.release == "6.1"
