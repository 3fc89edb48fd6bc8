"""A slip in `submission.yaml` is refused in one line that names the place."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import quick_yaml

from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.spec.lab import SUBMISSION
from lab3_usd.spec.load.lab import load_submission
from lab3_usd.spec.load.loader import load_lab


def drop(part: str, key: str) -> Callable[[dict[str, Any]], object]:
    return lambda data: data[part].pop(key)


def put(part: str, key: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda data: data[part].update({key: value})


SLIPS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "no folder of stages": (drop("folders", "stages"), "folders: 'stages' is missing"),
    "an unknown folder": (put("folders", "photos", "p"), "folders: 'photos' is not known"),
    "endings no list": (put("stages", "endings", ".usda"), "stages: 'endings' is '.usda'"),
    "a number of texts": (
        lambda data: data["deliverables"]["logs"].update(title=3),
        "logs: 'title' is 3",
    ),
    "a count as text": (
        lambda data: data["deliverables"]["images"].update(at_least="11"),
        "images: 'at_least' is '11'",
    ),
    "a line without text": (put("checklist", "ROS2", [{}]), "checklist: ROS2: 'text' is missing"),
    "an unknown decider": (
        put("checklist", "ROS2", [{"text": "x", "topics": []}]),
        "checklist: ROS2: 'topics' is not known",
    ),
    "a group no list": (
        put("starter", "together", ["physics:axis"]),
        "starter: 'together': entry 1",
    ),
    "an unknown part": (lambda data: data.update(extra={}), "'extra' is not known"),
}


@pytest.mark.parametrize(("slip", "line"), SLIPS.values(), ids=SLIPS)
def test_a_slip_is_refused_where_it_is(
    tmp_path: Path, slip: Callable[[dict[str, Any]], object], line: str
) -> None:
    folder = Path(shutil.copytree(data_folder("graphs"), tmp_path / "graphs"))
    data = quick_yaml.load((folder / SUBMISSION).read_text())
    slip(data)
    (folder / SUBMISSION).write_text(quick_yaml.dump(data))
    with pytest.raises(SpecError) as caught:
        load_submission(folder, {})
    assert str(caught.value).startswith(f"{SUBMISSION}: ")
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"submission\.yaml: cannot be read"):
        load_submission(tmp_path, {})


def test_stages_that_must_differ_are_checkpoints() -> None:
    assert set(load_lab().submission.stages.differ) <= set(load_lab().checkpoints)
