"""A lab of three checkpoints after the bundled one, with ids and names of its own."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import quick_yaml

from lab3_usd.data import data_folder


def write_other_lab(tmp_path: Path) -> Path:
    """A lab of three checkpoints, with ids and names of its own."""
    there = tmp_path / "lab"
    shutil.copytree(data_folder("graphs"), there, ignore=shutil.ignore_patterns("__pycache__"))
    path = there / "checkpoints.yaml"
    said = quick_yaml.load(path.read_text())
    said["files"], said["title"] = "Week5_{id}_{name}", "Week 5"
    ids = {"A": "00", "B": "01", "B2": "02"}
    said["checkpoints"] = {new: said["checkpoints"][old] for new, old in ids.items()}
    said["frames"]["localization"]["from"] = "B2"
    path.write_text(quick_yaml.dump(said))
    rubric = "title: Week 5\nitems: {drive: {title: Drive, checkpoint: B2, points: 10}}\n"
    (there / "rubric.yaml").write_text(rubric)
    path = there / "submission.yaml"
    said = quick_yaml.load(path.read_text())
    said["checklist"], said["stages"]["differ"] = {}, ["A", "B", "B2"]
    path.write_text(quick_yaml.dump(said))
    path = there / "ros.yaml"
    said = quick_yaml.load(path.read_text())
    for part in (said["topics"], said["lifecycle"]["nodes"], said["nodes"]):
        keep_from(part, ids)
    commands = dict(enumerate(said["commands"]))
    keep_from(commands, ids)
    said["commands"], said["goal"]["from"] = list(commands.values()), "B2"
    path.write_text(quick_yaml.dump(said))
    scene = there / "scene.yaml"
    scene.write_text(scene.read_text().replace('until: "05"', 'until: "B"'))
    return there


def keep_from(entries: dict[Any, Any], ids: dict[str, str]) -> None:
    """Leave out the entries of checkpoints that the lab does not have."""
    new = {old: new for new, old in ids.items()}
    for key, entry in list(entries.items()):
        if entry.get("from") in new:
            entry["from"] = new[entry["from"]]
        else:
            del entries[key]
