"""The frames of an arm whose target is its articulation root: each of its links is required."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from foreign_robots import arm
from msgspec.structs import replace
from pxr import Sdf, Usd

from lab3_usd.check.registry import frame_places
from lab3_usd.model.finding import StageResult
from lab3_usd.new_lab.lab import describe_lab, write_folder
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.contradictions.references import lab_faults
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

COMPUTE = "/ActionGraph/frames"
TARGETS, PARENT = "inputs:targetPrims", "inputs:parentPrim"
LINKS = ("base", "shoulder", "elbow", "tool")
Aim = Callable[[Usd.Prim], object]


def aim(port: str, *paths: str) -> Aim:
    return lambda node: node.GetRelationship(port).SetTargets([Sdf.Path(path) for path in paths])


def arm_of_its_root() -> Usd.Stage:
    stage = arm()
    node = stage.GetPrimAtPath(COMPUTE)
    aim(TARGETS, "/arm")(node)
    node.GetRelationship(PARENT).ClearTargets(removeSpec=True)
    return stage


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lab that the arm, as it works, describes."""
    place = tmp_path_factory.mktemp("arm")
    stage = arm_of_its_root()
    stage.GetRootLayer().Export(str(place / "arm.usda"))
    files = describe_lab([place / "arm.usda"], load_lab()).files
    write_folder(place / "lab", files)
    return place / "lab"


@pytest.fixture(scope="module")
def lab(folder: Path) -> Lab:
    return load_lab(folder)


def judged(lab: Lab, folder: Path, *changes: Aim) -> StageResult:
    stage = arm_of_its_root()
    for change in changes:
        change(stage.GetPrimAtPath(COMPUTE))
    path = folder / "arm.usda"
    stage.GetRootLayer().Export(str(path))
    return check_stage(str(path), "arm", lab)


def found(result: StageResult, severity: str) -> list[tuple[str, str | None]]:
    return [(each.rule, each.property) for each in result.findings if each.severity == severity]


def unmet(result: StageResult) -> list[str]:
    return [requirement.id for requirement in result.requirements if not requirement.met]


def test_the_base_of_an_arm_is_the_link_that_carries_the_others(lab: Lab) -> None:
    assert (lab.scene.robot.path, lab.scene.robot.base_frame) == ("/arm", "base")
    assert list(lab.frames.edges) == [("world", link) for link in LINKS]


def test_an_arm_that_gives_all_frames_passes(lab: Lab, tmp_path: Path) -> None:
    result = judged(lab, tmp_path)
    assert (result.verdict, unmet(result), result.findings) == ("pass", [], ())


def test_every_link_as_a_target_gives_the_same_frames(lab: Lab, tmp_path: Path) -> None:
    result = judged(lab, tmp_path, aim(TARGETS, *(f"/arm/{link}" for link in LINKS)))
    assert (result.verdict, unmet(result)) == ("pass", [])


@pytest.mark.parametrize("kept", [(), ("tool",), ("base", "elbow")])
def test_links_that_are_no_targets_are_missing_frames(
    kept: tuple[str, ...], lab: Lab, tmp_path: Path
) -> None:
    result = judged(lab, tmp_path, aim(TARGETS, *(f"/arm/{link}" for link in kept)))
    assert found(result, "error") == [("T01", TARGETS)]
    (finding,) = result.findings
    assert finding.covers == frame_places(*(link for link in LINKS if link not in kept))
    assert finding.expected == "/arm"
    assert unmet(result) == [f"TF/frame/{link}" for link in LINKS if link not in kept]


def test_the_base_as_its_own_parent_is_an_error(lab: Lab, tmp_path: Path) -> None:
    result = judged(lab, tmp_path, aim(PARENT, "/arm/base"))
    assert result.verdict == "fail"
    assert found(result, "error") == [("T09", PARENT)]
    assert unmet(result) == [f"TF/frame/{link}" for link in LINKS]
    assert found(result, "note") == [("T20", None)]


def test_frames_that_nothing_explains_are_an_error(lab: Lab, tmp_path: Path) -> None:
    asked = replace(lab.frames, edges=(*lab.frames.edges, ("tool", "flange")))
    result = judged(replace(lab, frames=asked), tmp_path)
    assert unmet(result) == ["TF/frame/flange"]
    assert found(result, "error") == [("T20", None)]
    assert "other faults" not in result.findings[0].message


def test_the_described_lab_contradicts_itself_nowhere(lab: Lab) -> None:
    assert not list(lab_faults(lab))
