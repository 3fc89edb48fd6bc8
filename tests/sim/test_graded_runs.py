"""What stages have in common is played, and cut, once."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from breaking import broken, the_lab

from lab3_usd.grade import dry_runs
from lab3_usd.grade.dry_runs import shown_by, with_dry_runs
from lab3_usd.grade.scoring import facts_of
from lab3_usd.judge.stage import check_stage
from lab3_usd.sim import geometry
from lab3_usd.sim.judge.topics import expected_of_each

RADIUS = [{"set": ["ROS_Drive/differential_controller.inputs:wheelRadius", 0.25]}]
FILES = {
    "04": "Lab3_04_camera.usda",
    "05": "Lab3_05_odometry_tf.usda",
    "06": "Lab3_06_qos_verified.usda",
    "07": "Lab3_07_localization.usda",
    "08": "Lab3_08_nav2_complete.usda",
}


def test_the_stages_after_the_last_graph_are_played_once_where_they_are_equal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken("04", RADIUS).GetRootLayer().Export(str(tmp_path / FILES["04"]))
    broken("05", RADIUS).GetRootLayer().Export(str(tmp_path / FILES["05"]))
    for number in ("06", "07", "08"):
        shutil.copy(tmp_path / FILES["05"], tmp_path / FILES[number])
    results = [check_stage(tmp_path / name) for name in FILES.values()]
    digests = {result.path: str(Path(result.path).stat().st_size) for result in results}
    played = []
    record = dry_runs.record
    monkeypatch.setattr(dry_runs, "record", lambda *given: played.append(1) or record(*given))
    facts = with_dry_runs(facts_of(results, {}), the_lab(), digests)
    assert len(played) == 2
    shown = [stage.shown for stage in facts.stages]
    assert "follows" in shown[1]
    assert shown[1] == shown[2] == shown[3] == shown[4]
    assert with_dry_runs(facts_of(results, {}), the_lab(), {}).stages == facts.stages


def test_the_room_is_cut_once_for_all_that_is_played_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut: list[float] = []
    sections = geometry.sections
    monkeypatch.setattr(geometry, "sections", lambda *on: cut.append(on[1]) or sections(*on))
    geometry._placed.cache_clear()
    lab, counts = the_lab(), []
    for number in ("04", "05"):
        broken(number, RADIUS).GetRootLayer().Export(str(tmp_path / FILES[number]))
        shown_by(tmp_path / FILES[number], lab, expected_of_each(lab, lab.checkpoints[number]))
        counts.append(len(cut))
    assert counts[0] > 30
    assert counts[1] - counts[0] < 10  # of the robot
