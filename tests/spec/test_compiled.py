"""The loaded lab is kept beside its files, and never believed when they have changed."""

from __future__ import annotations

import io
import pickle
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from lab3_usd.data import PACKAGE, data_folder
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load import compiled
from lab3_usd.spec.load.compiled import FILE, compile_lab, compiled_or_loaded
from lab3_usd.spec.load.loader import assemble


@pytest.fixture(autouse=True)
def _bytecode(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile as an ordinary start of Python does."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the lab's files without anything compiled."""
    copy = tmp_path / "graphs"
    shutil.copytree(data_folder("graphs"), copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def compiled_in(folder: Path) -> Path:
    return folder / "__pycache__" / FILE


def refuse(folder: Path) -> Lab:
    """Stand in for loading where the compiled lab must do."""
    raise AssertionError(folder)


def test_a_second_start_reads_no_yaml(folder: Path) -> None:
    first = compiled_or_loaded(folder, assemble)
    again = compiled_or_loaded(folder, refuse)
    # Node types that were read twice are never equal as objects.
    assert repr(again.graphs) == repr(first.graphs)
    assert again.checkpoints == first.checkpoints
    assert repr({**again.platform.types}) == repr({**first.platform.types})
    assert again.platform.needs == first.platform.needs
    assert again.folder == folder


def test_a_compiled_lab_has_the_node_types_of_its_platform(folder: Path) -> None:
    compiled_or_loaded(folder, assemble)
    lab = compiled_or_loaded(folder, refuse)
    types = {spec.type for graph in lab.graphs.values() for spec in graph.nodes.values()}
    assert all(kind is lab.platform.types[kind.type] for kind in types)


def test_a_compiled_lab_beside_the_files_is_read_where_nothing_can_be_written(
    folder: Path,
) -> None:
    (folder / FILE).write_bytes(compile_lab(folder, assemble(folder)))
    (folder / "__pycache__").write_text("a file where the folder would be")
    assert compiled_or_loaded(folder, refuse).folder == folder


def test_a_compiled_lab_holds_wherever_its_folder_goes(folder: Path, tmp_path: Path) -> None:
    compiled_or_loaded(folder, assemble)
    moved = folder.rename(tmp_path / "moved")
    assert compiled_or_loaded(moved, refuse).folder == moved


class Modules(pickle.Unpickler):
    """Notes the modules whose classes a pickle names."""

    def __init__(self, data: bytes) -> None:
        super().__init__(io.BytesIO(data))
        self.named: set[str] = set()

    def find_class(self, module: str, name: str) -> Any:
        self.named.add(module)
        return super().find_class(module, name)


def test_a_compiled_lab_names_no_module_of_python_which_another_release_may_lack(
    folder: Path,
) -> None:
    modules = Modules(compile_lab(folder, assemble(folder))[4:])
    modules.load()
    assert {name.partition(".")[0] for name in modules.named} <= {"lab3_usd", "builtins"}


def test_a_changed_file_is_read_anew(folder: Path) -> None:
    compiled_or_loaded(folder, assemble)
    changed = folder / "ROS_Clock.yaml"
    changed.write_text(changed.read_text().replace("at: [50, 250]", "at: [51, 250]"))
    lab = compiled_or_loaded(folder, assemble)
    assert lab.graphs["ROS_Clock"].nodes["ros2_context"].at == (51.0, 250.0)


@pytest.mark.parametrize(
    "module", ["spec/lab.py", "spec/load/graph_file.py", "isaac/load/platform.py", "yaml_file.py"]
)
def test_what_other_code_compiled_is_not_believed(
    folder: Path, tmp_path: Path, module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for part in ("spec", "isaac"):
        shutil.copytree(PACKAGE / part, tmp_path / part)
    shutil.copy(PACKAGE / "yaml_file.py", tmp_path)
    monkeypatch.setattr(compiled, "PACKAGE", tmp_path)
    compiled_or_loaded(folder, assemble)
    with (tmp_path / module).open("a") as code:
        code.write("# changed")
    compiled._code_checksum.cache_clear()  # it is another process that finds other code
    with pytest.raises(AssertionError):
        compiled_or_loaded(folder, refuse)


@pytest.mark.parametrize("damage", [b"", b"not a pickle", b"\x80\x05cos\nno\n."])
def test_a_damaged_file_is_made_anew(folder: Path, damage: bytes) -> None:
    compiled_or_loaded(folder, assemble)
    whole = compiled_in(folder).read_bytes()
    compiled_in(folder).write_bytes(whole[:4] + damage)
    assert compiled_or_loaded(folder, assemble).checkpoints
    assert compiled_in(folder).stat().st_size > len(damage) + 4


def test_a_file_of_something_else_is_not_believed(folder: Path) -> None:
    compiled_or_loaded(folder, assemble)
    checksum = compiled_in(folder).read_bytes()[:4]
    compiled_in(folder).write_bytes(checksum + pickle.dumps("no lab"))
    assert isinstance(compiled_or_loaded(folder, assemble), Lab)


def test_whoever_reads_the_files_may_read_it(folder: Path) -> None:
    compiled_or_loaded(folder, assemble)
    (folder / "new").touch()
    assert compiled_in(folder).stat().st_mode == (folder / "new").stat().st_mode


def test_nothing_is_written_where_python_writes_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    compiled_or_loaded(folder, assemble)
    assert not (folder / "__pycache__").exists()


def test_a_folder_that_cannot_be_written_is_loaded_all_the_same(folder: Path) -> None:
    (folder / "__pycache__").write_text("a file where the folder would be")
    assert compiled_or_loaded(folder, assemble).checkpoints
