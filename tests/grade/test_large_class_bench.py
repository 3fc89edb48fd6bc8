"""The benchmark of a class of thousands measures what it says it does."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest
from benchmark import load_benchmark

pytestmark = pytest.mark.usefixtures("forked_workers")


@pytest.fixture(scope="module", autouse=True)
def _small_lab() -> None:
    """The script works with the bundled lab."""


@pytest.fixture
def bench() -> ModuleType:
    return load_benchmark("bench_large_class")


def test_the_figures_of_a_large_class_are_printed(
    bench: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "LARGE", 40)  # rows of its page are written
    monkeypatch.setattr(sys, "argv", ["bench_large_class.py", "--count", "3", "--stages", "00"])
    assert bench.main() == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in said[1:4]] == ["2", "3", "40"]
    assert [line.split()[-1] for line in said[1:3]] == ["1", "1"]  # equal reports
    assert said[4].startswith("the last line is extrapolated")


def test_files_count_as_the_blocks_that_they_take(bench: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    for name, size in (("empty", 0), ("small", 1), ("large", 4097)):
        (tmp_path / "folder" / name).write_bytes(bytes(size))
    assert bench.on_disk(tmp_path) == 4096 * 4


def test_what_each_further_student_takes_is_extrapolated(bench: ModuleType) -> None:
    small = bench.Figures(10, 5.0, 8.0, 100, 100, 50_000, 3)
    large = bench.Figures(110, 15.0, 28.0, 100, 90, 150_000, 3)
    found = bench.extrapolated(small, large)
    assert found == bench.Figures(10_000, 15.0 + 989.0, 28.0 + 1978.0, 100, 90, 10_040_000, 3)
