"""What stages have in common is played, and cut, once."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from breaking import Step, broken, the_lab
from msgspec.structs import replace

from lab3_usd.grade import dry_runs
from lab3_usd.grade.dry_runs import faults_in_dry_run, with_dry_runs
from lab3_usd.grade.scoring import facts_of
from lab3_usd.model.finding import Severity
from lab3_usd.physics import surfaces
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.sim.judge.topics import expected_of_each

RADIUS = [{"set": ["ROS_Drive/differential_controller.inputs:wheelRadius", 0.25]}]
FILES = {
    "04": "Lab3_04_camera.usda",
    "05": "Lab3_05_odometry_tf.usda",
    "06": "Lab3_06_qos_verified.usda",
    "07": "Lab3_07_localization.usda",
    "08": "Lab3_08_nav2_complete.usda",
}


# What somebody adds to checkpoint 05, beside what the lab adds there: all of it acts on the rest.
ACTING: dict[str, list[Step]] = {
    "a second controller": [{"copy": ["ROS_Drive", "/World/Again"]}],
    "a node that stops the simulation": [
        {"node": ["ROS_OdomTF/stop", "omni.graph.action.StopTimeline"]},
        {"connect": ["ROS_OdomTF/stop.inputs:execIn", "ROS_OdomTF/on_playback_tick.outputs:tick"]},
    ],
    "another value": [{"set": ["ROS_Drive/differential_controller.inputs:wheelDistance", 0.5]}],
    "a tick for a node of before": [
        {"connect": ["ROS_Clock/ros2_publish_clock.inputs:execIn",
                     "ROS_OdomTF/on_playback_tick.outputs:tick"]},
    ],
}  # fmt: skip
LOOKING_ON: dict[str, list[Step]] = {
    "a radius": RADIUS,
    "no tick": [{"remove": "ROS_Clock/on_playback_tick"}],
    "a topic": [{"set": ["ROS_Lidar2D/ros2_rtx_lidar_helper.inputs:topicName", "/laser"]}],
    "a frame": [{"set": ["ROS_Camera/ros2_camera_helper.inputs:frameId", "lens"]}],
}


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Count the plays from now on."""
    plays: list[int] = []
    play = dry_runs.played
    monkeypatch.setattr(dry_runs, "played", lambda *given: plays.append(1) or play(*given))
    return plays


def shown_in(folder: Path, steps: dict[str, list[Step]]) -> tuple[list[object], list[object]]:
    """Return what stages before the last show, played together with it and alone."""
    lab, later, together, alone = the_lab(), {}, [], []
    for number, own in reversed(steps.items()):
        path = folder / FILES[number]
        broken(number, own).GetRootLayer().Export(str(path))
        wanted = expected_of_each(lab, lab.checkpoints[number])
        together.append(faults_in_dry_run(path, lab, wanted, later))
        if len(together) > 1:  # the last one is played first, and alone
            alone.append(faults_in_dry_run(path, lab, wanted))
    return together[1:], alone


@pytest.mark.parametrize("steps", LOOKING_ON.values(), ids=list(LOOKING_ON))
def test_a_stage_that_a_later_one_holds_shows_in_its_play_what_it_shows_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: list[Step]
) -> None:
    plays = counted(monkeypatch)
    together, alone = shown_in(tmp_path, {"04": steps, "05": steps})
    assert len(plays) == 1 + 1
    assert together == alone
    assert any(together)


@pytest.mark.parametrize("steps", ACTING.values(), ids=list(ACTING))
def test_what_acts_on_the_rest_has_the_earlier_stage_played(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: list[Step]
) -> None:
    plays = counted(monkeypatch)
    together, alone = shown_in(tmp_path, {"04": RADIUS, "05": [*RADIUS, *steps]})
    assert len(plays) == 2 + 1
    assert together == alone


def test_the_stages_after_the_last_graph_are_played_once_where_they_are_equal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken("04", RADIUS).GetRootLayer().Export(str(tmp_path / FILES["04"]))
    broken("05", RADIUS).GetRootLayer().Export(str(tmp_path / FILES["05"]))
    for number in ("06", "07", "08"):
        shutil.copy(tmp_path / FILES["05"], tmp_path / FILES[number])
    results = [check_stage(tmp_path / name) for name in FILES.values()]
    digests = {result.path: str(Path(result.path).stat().st_size) for result in results}
    plays = counted(monkeypatch)
    facts = with_dry_runs(facts_of(results, {}), the_lab(), digests)
    assert len(plays) == 1  # which shows what 04 does, too
    shown = [stage.shown for stage in facts.stages]
    assert "follows" in shown[1]
    assert shown[1] == shown[2] == shown[3] == shown[4]
    assert with_dry_runs(facts_of(results, {}), the_lab(), {}).stages == facts.stages


@pytest.mark.parametrize("severity", ["warning", "note"])
def test_a_stage_without_errors_is_played_where_a_warning_is_about_it(
    tmp_path: Path, severity: Severity
) -> None:
    path = tmp_path / FILES["04"]
    broken("04", RADIUS).GetRootLayer().Export(str(path))
    result = check_stage(path)
    findings = tuple(replace(each, severity=severity) for each in result.findings)
    facts = facts_of([replace(result, findings=findings)], {})
    (stage,) = with_dry_runs(facts, the_lab(), {}).stages
    assert not stage.faults
    assert ("follows" in stage.shown) is (severity == "warning")


def test_the_room_is_made_once_for_all_that_is_played_in_it(tmp_path: Path) -> None:
    surfaces._placed.cache_clear()
    lab, counts = the_lab(), []
    for number in ("04", "05"):
        broken(number, RADIUS).GetRootLayer().Export(str(tmp_path / FILES[number]))
        faults_in_dry_run(
            tmp_path / FILES[number], lab, expected_of_each(lab, lab.checkpoints[number])
        )
        counts.append(surfaces._placed.cache_info().misses)
    assert counts[0] > 30
    assert counts[1] - counts[0] < 10  # of the robot
