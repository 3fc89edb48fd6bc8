"""The second lab, `docs/examples/labs/jetbot`: built, checked, graded and drawn as data alone.

That its stages hold what its files say is seen where it is described after them, in
`test_lab_new.py`: byte for byte.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path
from types import ModuleType

import pytest
from benchmark import load_benchmark
from click.testing import Result
from in_process import invoke
from places import REPOSITORY
from pxr import Usd
from workers_here import workers_here

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import Lab3Error
from lab3_usd.spec.load.loader import load_lab

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
FILES = tuple(load_lab(JETBOT).files.values())
PARTS = {"1": (8, 0), "4": (38, 3), "5": (52, 2), "6": (68, 1)}  # of the faults of checkpoints


@pytest.fixture(scope="module")
def lab() -> Path:
    return JETBOT


@pytest.fixture(scope="module")
def built(lab: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("jetbot") / "stages"
    assert run(lab, "build", "--out", out).exit_code == 0
    return out


def run(lab: Path, *arguments: object) -> Result:
    return invoke("--lab", lab, *arguments)


def test_the_lab_is_data_alone(lab: Path) -> None:
    assert {path.suffix for path in lab.iterdir() if path.is_file()} == {".yaml"}


def test_every_built_stage_passes(lab: Path, built: Path) -> None:
    result = run(lab, "check", "--format", "json", built)
    found = json.loads(result.stdout)
    assert result.exit_code == 0
    assert [each["verdict"] for each in found["results"]] == ["pass"] * 7
    assert [each["checkpoint"] for each in found["results"]] == list("1234567")
    rules = {f["rule"] for each in found["results"] for f in each["findings"]}
    assert rules == {"P09"}  # a note of the lidar helper's own default


def test_it_is_judged_without_what_it_does_not_have(lab: Path, built: Path) -> None:
    found = json.loads(run(lab, "check", "--submission", "--format", "json", built).stdout)
    assert {each["rule"] for each in found["submissions"][0]["findings"]} == {"E01"}
    assert found["submissions"][0]["checklist"] == []


def test_every_graph_and_the_tree_are_drawn(lab: Path, built: Path, tmp_path: Path) -> None:
    assert run(lab, "draw", built / f"{FILES[-1]}.usda", "--out", tmp_path).exit_code == 0
    names = load_lab(lab).graphs
    drawn = {each.stem.rpartition("-")[2] for each in tmp_path.iterdir()}
    assert drawn == {*names, "TF"}


def test_the_dry_run_follows_commands_and_scans(lab: Path, built: Path) -> None:
    result = run(lab, "sim", built / f"{FILES[-1]}.usda", "--format", "json")
    checks = {load["name"]: load["verdict"] for load in json.loads(result.stdout)["checks"]}
    assert checks["follows"] == checks["scan"] == checks["tree"] == "ok"
    assert "bad" not in checks.values()


@pytest.mark.parametrize(
    ("arguments", "lacks"),
    [(("map", "{stage}", "-o", "{out}"), "map"), (("nav2", "-o", "{out}"), "navigation")],
)
def test_what_the_lab_lacks_is_said_in_one_line(
    lab: Path, built: Path, tmp_path: Path, arguments: tuple[str, ...], lacks: str
) -> None:
    given = {"stage": built / f"{FILES[-1]}.usda", "out": tmp_path / "out"}
    with pytest.raises(Lab3Error, match=f"Week 5 has no .*{lacks}"):
        run(lab, *(argument.format(**given) for argument in arguments))


def test_the_script_of_the_lab_saves_its_own_topics_and_no_goal(lab: Path, tmp_path: Path) -> None:
    assert run(lab, "collect", "-o", tmp_path / "collect.sh").exit_code == 0
    script = (tmp_path / "collect.sh").read_text()
    assert "ros2 topic hz /jetbot/imu" in script
    assert "watch_goal" not in script
    assert "ROS_DOMAIN_ID=5" in script


def test_a_class_is_graded_out_of_a_flat_canvas_archive(
    lab: Path, built: Path, tmp_path: Path
) -> None:
    archive, book = tmp_path / "submissions.zip", tmp_path / "book"
    with zipfile.ZipFile(archive, "w") as packed:
        for name in FILES:
            packed.write(built / f"{name}.usda", f"annlee_11_101_{name}.usda")
            if "imu" not in name:
                packed.write(built / f"{name}.usda", f"bobray_22_202_{name}.usda")
    starter = built / f"{FILES[0]}.usda"
    with workers_here():
        assert run(lab, "grade", archive, "--starter", starter, "-o", book).exit_code == 0
    rows = (book / "grades.csv").read_text().splitlines()
    assert rows[0].endswith("scene,part B,part C,part D,part E,part F,part G,remarks")
    assert ",70.00,70.00,100.00," in rows[1]
    assert ",60.00,70.00,85.71," in rows[2]


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    return load_benchmark("sweep")


@pytest.mark.parametrize("checkpoint", PARTS)
def test_single_faults_are_found_at_their_place(
    benchmark: ModuleType, lab: Path, monkeypatch: pytest.MonkeyPatch, checkpoint: str
) -> None:
    monkeypatch.setenv(LAB_VARIABLE, str(lab))
    outcomes = list(benchmark.sweep(checkpoint, *PARTS[checkpoint]))
    assert len(outcomes) >= 5
    assert [outcome.fault.name for outcome in outcomes if not outcome.at_place] == []
    assert sum(len(outcome.errors) for outcome in outcomes) / len(outcomes) <= 1.05


def test_a_fault_of_the_scene_cites_its_section(lab: Path, built: Path, tmp_path: Path) -> None:
    path = tmp_path / f"{FILES[0]}.usda"
    shutil.copyfile(built / path.name, path)
    stage = Usd.Stage.Open(str(path))
    joint = stage.GetPrimAtPath("/World/Jetbot/chassis/left_wheel_joint")
    joint.GetAttribute("physics:axis").Set("X")
    stage.GetRootLayer().Save()
    (found,) = json.loads(run(lab, "check", "--format", "json", path).stdout)["results"]
    assert [(f["rule"], f["handout"]) for f in found["findings"]] == [("S09", "A1")]
