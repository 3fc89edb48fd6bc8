"""A checkpoint is renamed in `checkpoints.yaml` alone, and every command goes through."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
import quick_yaml
from in_process import invoke
from places import REPOSITORY, TESTS
from workers_here import workers_here

from lab3_usd.errors import SpecError
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.spec.load.loader import load_lab

LABS = {
    "mini": TESTS / "labs" / "mini",
    "jetbot": REPOSITORY / "docs" / "examples" / "labs" / "jetbot",
}
# The first checkpoint, one in the middle and the last, and what they are called from now on.
RENAMED = {
    "mini": {
        "00": {"id": "A", "name": "scene", "title": "Bare scene"},
        "03": {"id": "3b", "name": "laser", "title": "Laser"},
        "05": {"id": "end", "name": "driven", "title": "Driven"},
    },
}


def copied(lab: str, folder: Path) -> Path:
    return shutil.copytree(LABS[lab], folder, ignore=shutil.ignore_patterns("__pycache__"))


def renamed(folder: Path, key: str, names: dict[str, str]) -> Path:
    """Rename a checkpoint of a lab in one file."""
    path = folder / "checkpoints.yaml"
    data = quick_yaml.load(path.read_text())
    data["checkpoints"][key].update(names)
    path.write_text(quick_yaml.dump(data))
    return folder


@pytest.mark.parametrize("lab", RENAMED)
def test_one_file_renames_checkpoints_for_every_command(
    lab: str, tmp_path: Path, subtests: pytest.Subtests
) -> None:
    folder = copied(lab, tmp_path / "lab")
    for key, names in RENAMED[lab].items():
        renamed(folder, key, names)
    checked = invoke("lab", "check", folder)
    assert (checked.exit_code, checked.output.endswith("0 errors, 0 warnings\n")) == (0, True)
    ann = tmp_path / "class" / "ann"
    built = invoke("--lab", folder, "build", "--out", ann)
    assert built.exit_code == 0, built.output
    for names in RENAMED[lab].values():
        with subtests.test(checkpoint=names["id"]):
            stage = next(path for path in ann.iterdir() if names["name"] in path.stem)
            shown = invoke("--lab", folder, "check", "--quiet", stage).output
            assert f"{stage}: checkpoint {names['id']}, pass, " in shown
    starter = next(ann / f"{name}.usda" for name in load_lab(folder).files.values())
    with workers_here():
        graded = invoke(
            *("--lab", folder, "grade", tmp_path / "class"),
            *("--starter", starter, "-o", tmp_path / "book"),
        )
    assert graded.exit_code == 0, graded.output
    with (tmp_path / "book" / "grades.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["earned"] == row["possible"]


def test_checkpoints_may_change_their_ids(tmp_path: Path) -> None:
    folder = renamed(copied("mini", tmp_path / "lab"), "01", {"id": "02"})
    renamed(folder, "02", {"id": "01"})
    lab = load_lab(folder)
    assert [*lab.checkpoints] == ["00", "02", "01", "03", "04", "05"]
    assert lab.topics["/clock"].since == "02"
    assert lab.submission.stages.differ == ("00", "02", "01", "03", "04")


def test_two_checkpoints_of_one_id_are_refused(tmp_path: Path) -> None:
    folder = renamed(copied("mini", tmp_path / "lab"), "03", {"id": "02"})
    with pytest.raises(SpecError, match="checkpoint '03': '02' is of checkpoint '02' already"):
        load_lab(folder)


def test_an_item_without_a_title_is_called_as_its_checkpoint(tmp_path: Path) -> None:
    folder = renamed(copied("jetbot", tmp_path / "lab"), "3", {"title": "Motors"})
    items = load_rubric(None, load_lab(folder)).items
    assert {item.id: item.title for item in items}["part C"] == "Motors"
