"""Checkpoints that ask the same of a stage are judged once, and each has its own result."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from breaking import correct_stage
from grade_files import LAB, stage, starter
from linting import add_counting_rule
from msgspec.structs import replace
from other_labs import cut_wire
from two_judges import all_faults

from lab3_usd.check.checker import judge
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.lab import Lab
from lab3_usd.stage.read.opening import kept_open
from lab3_usd.stage.read.stage_reader import read_model, read_stage
from lab3_usd.stage.sandboxed_open import FileBounds, opening_within

# Handout, parts G to I: 06 verifies QoS, 07 adds localization, 08 only navigates.
SAME = {"08": "07"}
FAULTS = all_faults()
SOME = FAULTS[::101] + [fault for fault in FAULTS if fault.kind == "scene"][::23]


def lab_with(number: str, **changes: object) -> Lab:
    changed = {**LAB.checkpoints, number: replace(LAB.checkpoints[number], **changes)}
    return replace(LAB, checkpoints=changed)


@pytest.mark.parametrize("number", LAB.checkpoints)
def test_only_the_last_checkpoint_asks_of_a_stage_what_another_asks(number: str) -> None:
    assert LAB.same_demands(number).id == SAME.get(number, number)


@pytest.mark.parametrize(
    "changes",
    [
        {"graphs": LAB.checkpoints["05"].graphs[:-1]},
        {"sensors": ("lidar",)},
        {"frames": False},
        {"topics": False},
        {"localization": False},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_a_checkpoint_that_asks_less_asks_something_else(changes: dict[str, object]) -> None:
    assert lab_with("08", **changes).same_demands("08").id != "07"


def test_what_comes_beside_a_stage_makes_no_difference() -> None:
    assert lab_with("08", title="Race", part="Z", file="Race").same_demands("08").id == "07"


def test_a_robot_that_may_have_driven_makes_a_difference() -> None:
    robot = replace(LAB.scene.robot, pose_is_error_until="07")
    lab = replace(LAB, scene=replace(LAB.scene, robots=(robot,)))
    assert lab.same_demands("08").id == "08"


def test_a_topic_that_comes_later_makes_a_difference() -> None:
    topics = {**LAB.topics, "/later": replace(LAB.topics["/scan"], since="08")}
    lab = replace(LAB, ros=replace(LAB.ros, topics=topics))
    assert lab.same_demands("08").id == "08"


def test_the_first_checkpoint_is_like_no_other() -> None:
    lab = lab_with("01", graphs=())
    assert lab.same_demands("01").id == "01"


def test_rules_ask_a_checkpoint_for_nothing_else() -> None:
    lab = lab_with("08", file="Race", title="Race", part="Z", new=(), new_sensors=(), key="race")
    assert lab.same_demands("08").id == "07"
    for fault in SOME:
        broken = correct_stage("07")
        fault.break_it(broken)
        model = read_model(broken, LAB.platform, "stage.usda")
        found = judge(LAB, LAB.checkpoints["07"], model)
        assert judge(lab, lab.checkpoints["08"], model) == found, fault.name


@pytest.mark.parametrize("source", ["starter", "02", "05", "08"])
def test_the_same_demands_find_the_same(tmp_path: Path, source: str) -> None:
    path = starter() if source == "starter" else stage(source)
    copy = cut_wire(Path(shutil.copy(path, tmp_path))) if source != "starter" else path
    found = [
        judge(LAB, LAB.checkpoints[each], read_stage(copy, LAB.platform)) for each in ("07", "08")
    ]
    assert found[0] == found[1]
    assert found[0].findings


def test_stages_that_are_the_same_have_results_of_their_own(tmp_path: Path) -> None:
    numbers = ("05", "06", "07", "08")
    faulty = cut_wire(Path(shutil.copy(stage("05"), tmp_path / "05.usda")))
    for number in numbers[1:]:
        shutil.copy(faulty, tmp_path / f"{number}.usda")
    digests = {f"{number}.usda": "same" for number in numbers}
    bounds = FileBounds(root=tmp_path.resolve(), check=lambda _path: None, digests=digests)
    with opening_within(bounds):
        together = [check_stage(tmp_path / f"{each}.usda", each) for each in numbers]
    alone = [check_stage(tmp_path / f"{each}.usda", each) for each in numbers]
    assert len({id(each) for each in bounds.stages.values()}) == 1
    assert together == alone
    assert [each.checkpoint for each in together] == [*numbers]


def test_one_stage_is_judged_for_each_that_asks_something_else() -> None:
    numbers = ("03", "05", "08", "00")
    with kept_open():
        together = [check_stage(stage("08"), number) for number in numbers]
    alone = [check_stage(stage("08"), number) for number in numbers]
    assert together == alone
    assert [each.verdict for each in alone] == ["pass", "pass", "pass", "fail"]


def test_what_a_stage_says_is_worked_out_once_for_all_checkpoints(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with kept_open():
        check_stage(stage("08"), "06")
        monkeypatch.setattr("lab3_usd.facts.endpoints._endpoint", None)
        result = check_stage(stage("08"), "07")
    assert (result.verdict, result.crashes) == ("pass", ())


@pytest.mark.usefixtures("own_rules")
def test_what_is_asked_again_is_not_judged_again() -> None:
    asked: list[StageModel] = []
    add_counting_rule("S99", asked)
    with kept_open():
        for number in ("06", "07", "08", "07"):
            check_stage(stage("08"), number)
    assert len(asked) == 2  # 08 asks what 07 does
