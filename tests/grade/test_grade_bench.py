"""The benchmark of grading measures what it says it does."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from benchmark import load_benchmark

pytestmark = pytest.mark.usefixtures("forked_workers")


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> None:
    """The script works with the bundled lab."""


@pytest.fixture
def bench() -> ModuleType:
    return load_benchmark("bench_grade")


def test_no_two_students_of_a_class_hand_in_the_same_bytes(
    bench: ModuleType, tmp_path: Path
) -> None:
    bench.make_class(tmp_path, 3, ("00", "05", "06"))
    files = sorted(tmp_path.rglob("*.usda"))
    assert len(files) == 9
    assert len({path.read_bytes() for path in files}) == 6  # 06 is 05 saved again


def test_students_arrange_their_nodes_differently_and_keep_them_so(
    bench: ModuleType, tmp_path: Path
) -> None:
    bench.make_class(tmp_path, 2, ("01", "05"))
    first, later, other = (
        bench.POSITION.search((tmp_path / student / "work" / name).read_text())[0]
        for student, name in (
            ("student0000", "Lab3_01_ros_clock.usda"),
            ("student0000", "Lab3_05_odometry_tf.usda"),
            ("student0001", "Lab3_01_ros_clock.usda"),
        )
    )
    assert first == later != other


def test_the_figures_are_printed(
    bench: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "SMALL", 1)
    monkeypatch.setattr(bench, "LAB", SimpleNamespace(checkpoints=("00", "01")))
    monkeypatch.setattr(sys, "argv", ["bench_grade.py", "--count", "2"])
    assert bench.main() == 0
    said = capsys.readouterr().out.splitlines()
    counts = [[int(number) for number in line.split()[:2]] for line in said[1:4]]
    assert counts == [[1, 2], [2, 4], [2, 2]]
    assert "for each stage beyond the first" in said[6]


def test_a_class_that_is_not_graded_clean_is_no_measure(
    bench: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [{"lost": [{"title": "ROS2 Context", "rule": "N01"}]}]
    monkeypatch.setattr(bench, "grade_class", lambda _settings: rows)
    with pytest.raises(RuntimeError, match="not graded as one"):
        bench.measure(1, ("00",))


def test_memory_of_this_process_is_known_where_the_platform_tells_it(bench: ModuleType) -> None:
    import os

    if not Path("/proc/self/statm").exists():
        pytest.skip("this platform does not tell the memory of a process by file")
    assert bench.resident(os.getpid()) > bench.MEGABYTE
    assert bench.resident(2**22 + 1) == 0


def test_files_of_two_gradebooks_that_differ_are_named(tmp_path: Path) -> None:
    pair = load_benchmark("bench_class")
    for book, text in (("ours", "1"), ("theirs", "2")):
        (tmp_path / book / "students").mkdir(parents=True)
        (tmp_path / book / "grades.csv").write_text("the same")
        (tmp_path / book / "students" / "result.json").write_text(text)
    (tmp_path / "theirs" / "more.json").write_text("")
    found = [*pair.differing(tmp_path / "ours", tmp_path / "theirs")]
    assert found == ["more.json", "students/result.json"]
