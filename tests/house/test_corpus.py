"""The corpus of robots and faults is whole, and the same whoever writes it."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from places import REPOSITORY
from pxr import Usd

sys.path.insert(0, str(REPOSITORY / "benchmarks"))

import corpus

IN_AN_INSTANCE = "a graph is part of an instance"


def test_each_stage_has_a_file_and_a_label_of_its_own() -> None:
    entries = corpus.entries()
    assert len({entry.file for entry in entries}) == len(entries) >= 500
    faulty = [entry for entry in entries if entry.group == corpus.FAULTY]
    assert [entry.name for entry in faulty if not (entry.prims and entry.source)] == []
    right = {entry.file for entry in entries if entry.group == corpus.RIGHT}
    assert {corpus.Entry(corpus.RIGHT, each.robot, each.robot, []).file for each in faulty} <= right


def test_a_stage_stands_for_itself_and_is_the_same_again(tmp_path: Path) -> None:
    (entry,) = (e for e in corpus.entries() if e.name == IN_AN_INSTANCE and e.is_of_users)
    label = corpus.write(entry, tmp_path / "one")
    assert corpus.write(entry, tmp_path / "two") == label
    files = sorted(path.name for path in (tmp_path / "one/faulty").iterdir())
    assert len(files) == 2  # the instance has an asset
    for name in files:
        one, two = (tmp_path / side / "faulty" / name for side in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()
    stage = Usd.Stage.Open(str(tmp_path / "one" / label["file"]))
    assert stage.GetPrimAtPath("/World/Pack").IsInstance()
    assert label["prims"] == ["/World/Pack/Clock"]


def test_a_label_says_since_when_there_is_a_fault(tmp_path: Path) -> None:
    named = {entry.name: entry for entry in corpus.entries() if entry.is_of_users}
    label = corpus.write(named["a stereo pair of two sizes"], tmp_path)
    assert (label["since"], label["of"]) == ("6.0", "right/stereo-cameras.usda")
    assert label["source"] == "OgnROS2CameraInfoHelper.py:350-354"
    truck = next(e for e in corpus.entries() if e.is_of_users and e.robot == "truck")
    assert corpus.write(truck, tmp_path)["since"] == "2023.1"  # all of its node types are that old


def test_all_labels_are_one_file(tmp_path: Path) -> None:
    few = corpus.entries()[::60]
    corpus.write_corpus(tmp_path, few)
    labels = json.loads((tmp_path / corpus.LABELS).read_text(encoding="utf-8"))
    assert [label["file"] for label in labels["stages"]] == [entry.file for entry in few]
    assert "seeded by the authors" in labels["seeds"]
