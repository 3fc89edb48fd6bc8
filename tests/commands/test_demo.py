"""`lab3 demo`: the tour's files, anywhere."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
from in_process import invoke
from places import REPOSITORY

from lab3_usd.errors import UsageError
from lab3_usd.pipeline.stage import check_stage

COPY = "mine/Lab3_02_ros_drive.usda"
CORRECT = "tour/Lab3_02_ros_drive.usda"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `lab3 demo` writes."""
    folder = tmp_path_factory.mktemp("demo") / "new"
    assert invoke("demo", folder).exit_code == 0
    return folder


def test_the_tour_is_correct_up_to_the_checkpoint_of_the_copy(demo: Path) -> None:
    stages = sorted((demo / "tour").iterdir())
    assert [stage.name[:7] for stage in stages] == ["Lab3_00", "Lab3_01", "Lab3_02"]
    assert {check_stage(stage).verdict for stage in stages} == {"pass"}


def test_each_mistake_in_the_copy_is_one_error(demo: Path) -> None:
    findings = check_stage(demo / COPY).findings
    assert [finding.rule for finding in findings] == ["W01", "N01", "P01", "P07"]


def test_the_copy_has_the_mistakes_of_the_example(demo: Path, tmp_path: Path) -> None:
    example = runpy.run_path(str(REPOSITORY / "docs" / "examples" / "mistakes.py"))
    example["make_mistakes"](demo / CORRECT, tmp_path / "mine.usda")
    assert (demo / COPY).read_text() == (tmp_path / "mine.usda").read_text()


def test_the_robot_of_no_lab_is_that_of_the_documentation(demo: Path) -> None:
    robot = REPOSITORY / "docs" / "examples" / "carter.usda"
    assert (demo / "carter.usda").read_bytes() == robot.read_bytes()


@pytest.mark.parametrize("name", [COPY, CORRECT, "carter.usda"])
def test_nothing_is_replaced_unasked_and_then_nothing_is_written(tmp_path: Path, name: str) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("mine")
    with pytest.raises(UsageError, match="exists already"):
        invoke("demo", tmp_path)
    assert [path.name for path in tmp_path.rglob("*.*")] == [Path(name).name]
    assert invoke("demo", tmp_path, "--force").exit_code == 0


def test_another_lab_has_no_demo(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"has no demo\.json"):
        invoke("--lab", REPOSITORY / "tests" / "labs" / "mini", "demo", tmp_path)
