"""Every point that is lost is explained: by a finding, or by name inside one."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from breaking import correct_stage, judged, the_lab
from failing_students import unexplained
from places import SHARED

from lab3_usd.check.checker import judge
from lab3_usd.model.stage import StageModel
from lab3_usd.stage.read.stage_reader import read_model, read_stage

CORPUS = SHARED / "corpus"
FILES = sorted(path for path in CORPUS.rglob("*") if path.suffix in {".usd", ".usda", ".usdc"})


@cache
def model_of(path: Path) -> StageModel:
    return read_stage(path, the_lab().platform)


def left_open(path: Path, checkpoint: str) -> list[str]:
    lab, model = the_lab(), model_of(path)
    found = judge(lab, lab.checkpoints[checkpoint], model)
    return unexplained(lab, model, found.requirements, found.findings)


@pytest.mark.skipif(not FILES, reason="the corpus of real stages is not beside this checkout")
@pytest.mark.parametrize("checkpoint", ["02", "05", "08"])
def test_what_a_real_stage_loses_is_explained(checkpoint: str) -> None:
    for path in FILES:
        assert left_open(path, checkpoint) == [], path.name


def test_a_loss_that_nothing_names_is_noticed() -> None:
    lab = the_lab()
    stage = correct_stage("05")
    graph = lab.graphs["ROS_OdomTF"]
    stage.RemovePrim(f"{graph.path}/isaac_compute_transform_tree")
    found = judged(stage, "05")
    model = read_model(stage, lab.platform, "stage.usda")
    arguments = (lab, model, found.requirements)
    assert unexplained(*arguments, found.findings) == []
    told = [finding for finding in found.findings if finding.rule != "T20"]
    assert {each.partition("/")[0] for each in unexplained(*arguments, told)} == {"TF"}
    assert len(unexplained(*arguments, ())) == sum(
        not requirement.met for requirement in found.requirements
    )


def test_a_frame_that_a_finding_names_is_not_listed_as_lost() -> None:
    graph = the_lab().graphs["ROS_OdomTF"]
    stage = correct_stage("05")
    tree = stage.GetPrimAtPath(f"{graph.path}/isaac_compute_transform_tree")
    targets = tree.GetRelationship("inputs:targetPrims")
    targets.SetTargets([path for path in targets.GetTargets() if path.name != "caster_back_link"])
    rules = {finding.rule for finding in judged(stage, "05").findings}
    assert "T01" in rules
    assert "T20" not in rules
