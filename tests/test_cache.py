"""The loaded lab is remembered beside its files, and never believed when they have changed."""

from __future__ import annotations

import os
import pickle
import shutil
import sys
from pathlib import Path

import pytest

from lab3_usd.data import data_folder
from lab3_usd.spec.assemble import assemble
from lab3_usd.spec.cache import remembered
from lab3_usd.spec.spec import Lab


@pytest.fixture(autouse=True)
def _bytecode(monkeypatch: pytest.MonkeyPatch) -> None:
    """Remember as an ordinary start of Python does."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the lab's files without anything remembered."""
    copy = tmp_path / "graphs"
    shutil.copytree(data_folder("graphs"), copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def memory_of(folder: Path) -> Path:
    """Return the one file that was remembered."""
    (found,) = (folder / "__pycache__").iterdir()
    return found


def refuse(folder: Path) -> Lab:
    """Stand in for loading where the memory must do."""
    raise AssertionError(folder)


def test_a_second_start_reads_no_yaml(folder: Path) -> None:
    first = remembered(folder, assemble)
    again = remembered(folder, refuse)
    assert again.graphs == first.graphs
    assert again.checkpoints == first.checkpoints
    assert again.catalog == first.catalog


def test_a_changed_file_is_read_anew(folder: Path) -> None:
    remembered(folder, assemble)
    changed = folder / "ROS_Clock.yaml"
    changed.write_text(changed.read_text().replace("at: [50, 250]", "at: [51, 250]"))
    lab = remembered(folder, assemble)
    assert lab.graphs["ROS_Clock"].nodes["ros2_context"].at == (51.0, 250.0)


def test_a_touched_file_is_read_anew(folder: Path) -> None:
    remembered(folder, assemble)
    os.utime(folder / "scene.yaml", ns=(1, 1))
    with pytest.raises(AssertionError):
        remembered(folder, refuse)


@pytest.mark.parametrize(
    "damage", [b"", b"not a pickle", pickle.dumps("key"), b"\x80\x05cos\nno\n."]
)
def test_a_damaged_memory_is_made_anew(folder: Path, damage: bytes) -> None:
    remembered(folder, assemble)
    memory_of(folder).write_bytes(damage)
    assert remembered(folder, assemble).checkpoints
    assert memory_of(folder).stat().st_size > len(damage)


def test_a_memory_of_something_else_is_not_believed(folder: Path) -> None:
    remembered(folder, assemble)
    memory = memory_of(folder)
    with memory.open("rb") as file:
        key = pickle.load(file)  # noqa: S301 - written two lines above
    memory.write_bytes(pickle.dumps(key) + pickle.dumps("no lab"))
    assert isinstance(remembered(folder, assemble), Lab)


def test_nothing_is_remembered_where_python_remembers_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    remembered(folder, assemble)
    assert not (folder / "__pycache__").exists()


def test_a_folder_that_cannot_be_written_is_loaded_all_the_same(folder: Path) -> None:
    (folder / "__pycache__").write_text("a file where the folder would be")
    assert remembered(folder, assemble).checkpoints
