"""The scan lies on the map, in a dry run and in a recording; what is wrong with either shows."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest
from breaking import correct_stage, the_lab
from dry_runs import EXPECTED, driven
from in_process import invoke
from pxr import Gf, Usd, UsdGeom
from scene_stages import LIDAR, ORIENT, put

from lab3_usd.data import data_folder
from lab3_usd.deliverables.maps import MapError, map_of_stage, read_map
from lab3_usd.model.dry_run import HERE, Affine, about
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.occupancy import MapFit, OccupancyMap
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.execution.drive import Leg, Session, drive_of
from lab3_usd.sim.execution.recording import Message, Pose, Recording, Scan, Transform
from lab3_usd.sim.judge.expectations import Trial, in_root
from lab3_usd.sim.judge.localization import fit, on_map
from lab3_usd.sim.judge.sensors import scan

YAML = "turtlebot3_map.yaml"
AHEAD = "0.15,0,0.3"  # how far it drives is of no importance


def maps(folder: Path, before: str = "", after: str = "") -> Path:
    """A copy of the lab's map, with one text of its YAML replaced."""
    made = Path(shutil.copytree(data_folder("maps"), folder / "maps"))
    text = (made / YAML).read_text(encoding="utf-8")
    assert before in text
    (made / YAML).write_text(text.replace(before, after, 1), encoding="utf-8")
    return made


@pytest.fixture(scope="module")
def run() -> Trial:
    return driven(correct_stage("05"), drive_of(AHEAD, EXPECTED.limits))


def laid(run: Trial, found: OccupancyMap) -> tuple[MapFit, list[FaultKind]]:
    run.map, run.located = found, ([(0.0, run.start)], [(0.0, HERE)])
    run.fit = fit(run)
    assert run.fit is not None
    return run.fit, [fault.kind for fault in on_map(run)]


def test_every_point_of_the_scan_lies_at_a_wall_of_the_lab_s_map(run: Trial) -> None:
    found, kinds = laid(run, read_map(data_folder("maps") / YAML))
    assert (found.near, kinds) == (1.0, [])
    assert found.through < 0.005  # rays that graze a corner, which a cell is larger than
    assert found.count == 360 * (
        len(run.recording.topic("/scan", 0)) - 1
    )  # TF comes after the first


def test_a_wrong_origin_shows_with_the_shift_that_would_mend_it(run: Trial, tmp_path: Path) -> None:
    found, kinds = laid(run, read_map(maps(tmp_path, "-6.2, -3.32", "-1.2, -0.32") / YAML))
    assert kinds == ["map-shifted"]
    assert found.shift == pytest.approx((-5.0, -3.0), abs=0.051)  # a cell
    assert found.shifted > 0.99


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        ("resolution: 0.05", "resolution: 0.06", "scan-off-map"),
        ("resolution: 0.05", "resolution: 0.5", "scan-off-map"),
        ("-3.32, 0]", "-3.32, 0.3]", "scan-off-map"),
        ("negate: 0", "negate: 1", "map-inverted"),
    ],
)
def test_a_wrong_value_of_the_map_shows(
    run: Trial, tmp_path: Path, before: str, after: str, kind: FaultKind
) -> None:
    found, kinds = laid(run, read_map(maps(tmp_path, before, after) / YAML))
    assert kinds == [kind]
    assert found.near - found.through < 0.5


def test_a_map_with_a_turned_origin_is_laid_as_it_is_turned() -> None:
    """A quarter turn to the left: columns go along +Y, rows along -X."""
    grid = OccupancyMap("", 0.5, (1.0, 2.0, math.pi / 2), 4, 4, frozenset({(2, 0)}))
    assert grid.cell(0.9, 3.1) == (2, 0)
    assert grid.point(2, 1) == pytest.approx((0.5, 3.0))


def one_scan(ranges: tuple[float, ...], *walls: tuple[int, int]) -> MapFit:
    """Rays to +X and +Y from (1, 1), over cells of a metre."""
    scan = Scan(0.0, math.pi / 2, 0.1, 20.0, ranges)
    tied = Transform("odom", "base_scan", (1.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    messages = [
        Message("", 1.0, data=(tied,), topic="/tf", at=1.0),
        Message("", 1.0, "base_scan", scan, topic="/scan", at=1.0),
    ]
    recording = Recording(2.0, messages, [Pose(0, 1.0, "idle", 0.0, 0.0, 0.0)])
    trial = Trial(recording, (Session((Leg("idle", 2.0),)),), EXPECTED)
    trial.map = OccupancyMap("", 1.0, (0.0, 0.0, 0.0), 20, 20, frozenset(walls))
    trial.located = ([(0.0, HERE)],)
    found = fit(trial)
    assert found is not None
    return found


def test_points_are_counted_by_hand() -> None:
    """Ends at (9.5, 1) and (1, 9.5): cells (9, 1) and (1, 9); a point may be a cell off."""
    assert one_scan((8.5, 8.5), (9, 1), (1, 9)).near == 1.0
    assert one_scan((8.5, 8.5), (10, 2), (1, 9)).near == 1.0
    assert one_scan((8.5, 8.5), (11, 1), (1, 9)).near == 0.5
    assert one_scan((8.5, -1.0), (9, 1)).count == 1


def test_a_ray_has_no_wall_before_its_end() -> None:
    """The middle of the first ray is (5.25, 1)."""
    found = one_scan((8.5, 8.5), (9, 1), (1, 9), (5, 1))
    assert (found.near, found.through) == (1.0, 0.5)


def sent(at: float, x: float, *children: str) -> Message:
    frames = (Transform("odom", child, (x, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) for child in children)
    return Message("", at, data=tuple(frames), topic="/tf", at=at)


@pytest.mark.parametrize(
    ("at", "places"),
    [
        (0.5, {"first": 1.0}),  # before all that was sent the first counts
        (1.0, {"first": 1.0}),
        (1.9, {"first": 1.0}),
        (2.0, {"first": 2.0, "second": 2.0}),
        (3.5, {"first": 2.0, "second": 3.0}),
    ],
)
def test_a_frame_stands_where_its_last_transform_put_it(
    at: float, places: dict[str, float]
) -> None:
    messages = [
        sent(1.0, 1.0, "first"),
        sent(2.0, 2.0, "first", "second"),
        sent(3.0, 3.0, "second"),
    ]
    trial = Trial(Recording(4.0, messages), (), EXPECTED)
    found = {name: in_root(trial, name, Message("", at, at=at)) for name in ("first", "second")}
    assert {name: place.origin[0] for name, place in found.items() if place} == places


def saved(stage: Usd.Stage, folder: Path) -> Path:
    path = folder / "work" / "Lab3_07_localization.usda"
    path.parent.mkdir(parents=True)
    stage.GetRootLayer().Export(str(path))
    return path


def map_check(path: Path, maps: Path | None = None) -> tuple[str, str | None]:
    checks = dry_run(path, the_lab(), "07", AHEAD, maps=maps).behaviour.checks
    return next((check.verdict, check.kind) for check in checks if check.name == "map")


def test_a_turned_lidar_frame_shows_on_the_lab_s_map(tmp_path: Path) -> None:
    stage = correct_stage("07")
    put(LIDAR, ORIENT, Gf.Quatd(*Affine(about((0.0, 0.0, 1.0), 0.5)).quaternion()))(stage)
    assert map_check(saved(stage, tmp_path)) == ("bad", "scan-off-map")


def test_another_room_than_that_of_the_lab_s_map_is_not_judged(tmp_path: Path) -> None:
    stage = correct_stage("07")
    for part in ("Walls", "Furniture"):
        UsdGeom.Xformable(stage.GetPrimAtPath(f"/Environment/{part}")).AddScaleOp().Set(
            (1.2, 1.1, 1)
        )
    path = saved(stage, tmp_path)
    assert map_check(path) == ("not judged", "scan-off-map")
    assert map_check(path, data_folder("maps")) == ("bad", "scan-off-map")


def test_walls_that_only_the_map_has_show_where_the_map_is_given(tmp_path: Path) -> None:
    stage = correct_stage("07")
    stage.GetPrimAtPath("/Environment/Walls").SetActive(active=False)
    path = saved(stage, tmp_path)
    assert map_check(path) == ("not judged", "scan-off-map")
    assert map_check(path, data_folder("maps")) == ("bad", "scan-off-map")


def test_a_lidar_without_anything_around_it_is_not_judged() -> None:
    stage = correct_stage("05")
    stage.GetPrimAtPath("/Environment/Walls").SetActive(active=False)
    stage.GetPrimAtPath("/Environment/Furniture").SetActive(active=False)
    (fault,) = scan(driven(stage, drive_of(AHEAD, EXPECTED.limits)))
    assert (fault.kind, fault.sure) == ("no-ray-returns", False)


def test_the_map_beside_the_stage_is_that_of_its_submission(tmp_path: Path) -> None:
    path = saved(correct_stage("07"), tmp_path)
    ours = map_of_stage(path, None, the_lab())
    assert ours is not None
    assert not ours.given
    maps(tmp_path, "-6.2", "-6.4")
    theirs = map_of_stage(path, None, the_lab())
    assert theirs is not None
    assert (theirs.given, theirs.origin[0]) == (True, -6.4)
    assert map_check(path) == ("bad", "map-shifted")


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        ("image:", "picture:", "names no image"),
        ("resolution:", "size:", "no resolution, origin or threshold"),
        ("0.05", "0", "no resolution, or an invalid origin"),
        ("-6.2, -3.32", "-6.2", "no resolution, origin or threshold"),
    ],
)
def test_a_map_that_is_none_is_one_line(
    tmp_path: Path, before: str, after: str, fault: str
) -> None:
    with pytest.raises(MapError, match=fault):
        read_map(maps(tmp_path, before, after) / YAML)


def test_a_map_that_cannot_be_read_is_not_judged(tmp_path: Path) -> None:
    broken = maps(tmp_path, "turtlebot3_map.pgm", "nowhere.pgm")
    with pytest.raises(MapError, match=r"nowhere\.pgm"):
        read_map(broken / YAML)
    assert map_check(saved(correct_stage("07"), tmp_path), broken) == (
        "not judged",
        "scan-off-map",
    )


def test_before_localization_no_map_is_asked_for(tmp_path: Path) -> None:
    path = saved(correct_stage("05"), tmp_path)
    assert "map" not in {each.name for each in dry_run(path, the_lab(), "05").behaviour.checks}


def test_the_page_draws_the_scan_on_the_map(tmp_path: Path) -> None:
    path = saved(correct_stage("07"), tmp_path)
    maps(tmp_path, "-6.2", "-6.4")
    page = tmp_path / "run.html"
    assert invoke("sim", path, "--drive", AHEAD, "--page", page).exit_code == 1
    text = page.read_text(encoding="utf-8")
    assert 'class="map"' in text
    assert 'class="off" d="M' in text
    assert "with the map moved by" in text
