"""Commands say the same of one stage, except for what tests/disagreements.yaml explains.

`make agree` asks about all stages; here a part of them.
"""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
import quick_yaml
from agreement import (
    CONTRADICTORY,
    Subject,
    all_subjects,
    contradictions_of,
    once_contradictory,
    unexplained,
)
from breaking import correct_stage
from dry_runs import BRIEFLY
from foreign_robots import rover
from in_process import invoke
from places import REPOSITORY

from lab3_usd.data import LAB_VARIABLE

SHARE = 560  # one of so many stages, whatever others there are
ONCE = 9  # one of so many that once contradicted themselves
MADE_UP = "acme.clock.PublishClock"  # a name of a node type that only a lab knows


@pytest.mark.parametrize("subject", once_contradictory()[::ONCE], ids=lambda each: each.name)
def test_commands_agree_where_they_once_did_not(subject: Subject) -> None:
    left = unexplained(contradictions_of(subject, BRIEFLY))
    today = CONTRADICTORY["stages"][subject.name].get("today", [])
    assert [f"{each.question}: {each.answers}" for each in left] == today


@pytest.mark.parametrize("name", [*CONTRADICTORY["cases"]][::ONCE])
def test_commands_agree_on_a_case_where_they_once_did_not(name: str) -> None:
    subject = next(each for each in all_subjects() if each.name == name)
    assert not unexplained(contradictions_of(subject, BRIEFLY))


def test_commands_agree_on_some_of_all_stages() -> None:
    sample = [each for each in all_subjects() if crc32(each.name.encode()) % SHARE == 0]
    assert len(sample) >= 3
    found = [each for subject in sample for each in contradictions_of(subject, BRIEFLY)]
    left = unexplained(found)
    assert Counter(each.question for each in left) == CONTRADICTORY["sample"], "\n".join(
        map(str, left)
    )


def said(command: str, path: Path, *arguments: str) -> Any:
    """Return what a command prints."""
    done = invoke(command, path, "--format", "json", *arguments)
    assert done.exit_code in (0, 1), done.output
    return quick_yaml.load(done.stdout)


def test_a_rename_of_a_lab_reaches_every_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = shutil.copytree(REPOSITORY / "graphs", tmp_path / "lab")
    types = lab / "node_types.yaml"
    text = types.read_text(encoding="utf-8")
    now = "isaacsim.ros2.bridge.ROS2PublishClock"
    types.write_text(f"{text}\nrenamed:\n  {MADE_UP}: {now}\n", encoding="utf-8")
    stage = correct_stage("01")
    clock = next(prim for prim in stage.Traverse() if prim.GetName() == "ros2_publish_clock")
    clock.GetAttribute("node:type").Set(MADE_UP)
    path = tmp_path / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    monkeypatch.setenv(LAB_VARIABLE, str(lab))
    assert said("check", path, "--checkpoint", "01")["results"][0]["verdict"] == "pass"
    assert [end["topic"] for end in said("topics", path)["topics"]] == ["/clock"]
    assert [topic["name"] for topic in said("sim", path)["topics"]] == ["/clock"]
    assert {each["rule"] for each in said("lint", path)["results"][0]["findings"]} == {"K31"}


def test_a_broken_lab_is_none_of_the_linters_business(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "checkpoints.yaml").write_text("no: lab\n")
    path = tmp_path / "stage.usda"
    rover().GetRootLayer().Export(str(path))
    monkeypatch.setenv(LAB_VARIABLE, str(tmp_path))
    assert said("lint", path)["results"][0]["verdict"] == "pass"
