"""A checkpoint that takes something away: a graph, a sensor, a supplied prim."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import yaml
from in_process import invoke
from places import REPOSITORY
from pxr import Usd

from lab3_usd.errors import SpecError
from lab3_usd.new_lab.checkpoints import Step, rubric_text
from lab3_usd.spec.contradictions.references import lab_faults
from lab3_usd.spec.load.loader import load_lab

JETBOT = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
CRATE = "/World/Room/Crate"
LAST = '  "7": {name: topics, title: Topics, part: G, adds: {topics: true}'


def lab_that_removes(folder: Path, names: str) -> Path:
    """The second lab with a crate, whose last checkpoint removes these."""
    shutil.copytree(JETBOT, folder)
    points = (folder / "checkpoints.yaml").read_text()
    (folder / "checkpoints.yaml").write_text(points.replace(LAST, f"{LAST}, removes: {names}"))
    starter = (folder / "starter.yaml").read_text()
    crate = (
        "          Crate: {type: Cube, apis: [PhysicsCollisionAPI], pose: {translate: [2, 2, 1]}}\n"
    )
    floor = "          Floor:"
    (folder / "starter.yaml").write_text(starter.replace(floor, f"{crate}{floor}"))
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    lab = lab_that_removes(tmp_path_factory.mktemp("removes") / "lab", f"[Scan, {CRATE}]")
    assert invoke("--lab", lab, "build", "--out", lab / "built").exit_code == 0
    assert invoke("--lab", lab, "starter", "-o", lab / "scene.usda").exit_code == 0
    return lab


def found(lab: Path, stage: Path) -> list[tuple[str, str]]:
    """What is found in a stage beside the starter: rules and prims."""
    told = invoke(
        "--lab", lab, "check", "--starter", lab / "scene.usda", stage, "--format", "json"
    ).output
    findings = json.loads(told)["results"][0]["findings"]
    return [(each["rule"], each["prim"]) for each in findings if each["severity"] != "note"]


def stage_of(lab: Path, number: int) -> Path:
    (path,) = (lab / "built").glob(f"*_{number}_*.usda")
    return path


def test_what_is_removed_is_there_before_and_gone_after(folder: Path) -> None:
    before, after = (Usd.Stage.Open(str(stage_of(folder, number))) for number in (6, 7))
    scan = load_lab(folder).graphs["Scan"].path
    assert [bool(before.GetPrimAtPath(path)) for path in (scan, CRATE)] == [True, True]
    assert [bool(after.GetPrimAtPath(path)) for path in (scan, CRATE)] == [False, False]


@pytest.mark.parametrize("number", [6, 7])
def test_the_built_stages_pass_beside_the_starter(folder: Path, number: int) -> None:
    assert found(folder, stage_of(folder, number)) == []


def test_the_topic_of_a_graph_that_is_gone_is_not_asked_for(folder: Path) -> None:
    told = invoke("--lab", folder, "sim", stage_of(folder, 7))
    assert told.exit_code == 0, told.output
    assert "/jetbot/scan" not in told.output


def test_what_was_not_removed_is_said_at_its_place(folder: Path, tmp_path: Path) -> None:
    late = tmp_path / stage_of(folder, 7).name
    shutil.copyfile(stage_of(folder, 6), late)
    scan = load_lab(folder).graphs["Scan"].path
    assert found(folder, late) == [("S35", scan), ("S35", CRATE)]


@pytest.mark.parametrize(
    ("names", "handout", "section"),
    [
        (f"{{B4: [Scan], Task 6.1: [{CRATE}]}}", "", "Task 6.1"),
        (f"[{CRATE}]", "handout: {rules: {S35: Task 6.2}}\n", "Task 6.2"),
        (f"[{CRATE}]", "", "A1"),
    ],
)
def test_the_section_is_the_one_that_the_lecturer_names(
    tmp_path: Path, names: str, handout: str, section: str
) -> None:
    lab = lab_that_removes(tmp_path / "lab", names)
    points = lab / "checkpoints.yaml"
    points.write_text(handout + points.read_text())
    assert invoke("--lab", lab, "build", "--out", lab / "built", "--only", "6").exit_code == 0
    late = stage_of(lab, 6).with_name("Week5_7_topics.usda")
    stage_of(lab, 6).rename(late)
    told = json.loads(invoke("--lab", lab, "check", late, "--format", "json").output)
    sections = {each["prim"]: each["handout"] for each in told["results"][0]["findings"]}
    assert sections[CRATE] == section


def test_what_is_removed_too_early_is_missing(folder: Path, tmp_path: Path) -> None:
    early = tmp_path / stage_of(folder, 6).name
    stage = Usd.Stage.Open(str(stage_of(folder, 6)))
    stage.RemovePrim(CRATE)
    stage.GetRootLayer().Export(str(early))
    assert found(folder, early) == [("U01", CRATE)]


def test_a_name_that_nothing_has_is_refused(tmp_path: Path) -> None:
    lab = lab_that_removes(tmp_path / "lab", "[Sacn]")
    with pytest.raises(
        SpecError, match="'Sacn' is not a path, and no graph or sensor that is there"
    ):
        load_lab(lab)


@pytest.mark.parametrize("groups", ["TF", "Scene"])
def test_a_removal_that_no_item_counts_is_a_warning(tmp_path: Path, groups: str) -> None:
    lab = lab_that_removes(tmp_path / "lab", f"[{CRATE}]")
    rubric = lab / "rubric.yaml"
    rubric.write_text(rubric.read_text().replace('["*"], points', f"[{groups}], points"))
    said = invoke("lab", "check", lab).output
    assert (f"no item counts that {CRATE} is removed" in said) == (groups == "TF")


@pytest.mark.parametrize(
    ("path", "is_there"), [(CRATE, True), ("/World/Room/Crat", False), ("/World/Jetbot", True)]
)
def test_a_removal_of_what_no_scene_has_is_a_warning(
    tmp_path: Path, path: str, *, is_there: bool
) -> None:
    lab = load_lab(lab_that_removes(tmp_path / "lab", f"[{path}]"))
    told = [fault.message for fault in lab_faults(lab) if "removes" in fault.key]
    assert told == ([] if is_there else [f"'{path}' is not a prim, '{CRATE}' is"])


def test_a_removal_of_what_a_thing_that_is_made_does_not_have_is_a_warning(tmp_path: Path) -> None:
    lab = lab_that_removes(tmp_path / "lab", "[/World/Box/Lid]")
    with (lab / "scene.yaml").open("a") as scene:
        scene.write('\nprops: {box: {path: /World/Box, type: Cube, handout: A1, from: "2"}}\n')
    (told,) = (fault.message for fault in lab_faults(load_lab(lab)) if "removes" in fault.key)
    assert told.startswith("'/World/Box/Lid' is not a prim")


def test_a_new_rubric_counts_what_a_checkpoint_removes_or_furnishes() -> None:
    steps = [
        Step("1", "start", "Start", "A"),
        Step("2", "clock", "Clock", "B", graphs=("Clock",), removes=(CRATE,)),
        Step("3", "drive", "Drive", "C", graphs=("Drive",)),
        Step("4", "scan", "Scan", "D", graphs=("Scan",)),
    ]
    items = yaml.safe_load(rubric_text("Title", steps, {"4"}, load_lab(JETBOT)))["items"]
    assert [item["groups"] for item in items.values()][1:] == [
        ["Clock", "Scene"],
        ["Drive"],
        ["Scan", "Scene"],
    ]
