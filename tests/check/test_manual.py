"""The manuals of the rules speak of the lab in force, and cite only its handout."""

from __future__ import annotations

import re

import pytest
from in_process import invoke
from msgspec.structs import replace
from places import REPOSITORY

from lab3_usd.check.manual import PLAIN, in_words_of, rules_in, rules_of_lab
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import finding_of
from lab3_usd.model.finding import Problem
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

LAB = load_lab()
JETBOT_FOLDER = REPOSITORY / "docs/examples/labs/jetbot"
JETBOT = load_lab(JETBOT_FOLDER)
LINT = "K"  # the family that knows no lab


def names(lab: Lab) -> set[str]:
    """The names that a lab alone has: prims, joints, graphs, files, folders and sections."""
    robot = lab.scene.robot
    folders = lab.submission.folders
    return {
        robot.path.rpartition("/")[2],
        *robot.links,
        *robot.wheels.joints,
        *(sensor.name for sensor in lab.sensors.values()),
        *(graph.path.rpartition("/")[2] for graph in lab.graphs.values()),
        *lab.files.values(),
        *(f"`{name}`" for name in (folders.stages, folders.starter, *folders.shown)),
        lab.submission.stages.starter,
        *lab.handout.names,
        *", ".join(lab.handout.rules.values()).split(", "),
    }


OWN_WORDS = {  # which Isaac Sim and ROS have as well
    *names(JETBOT),
    *("base_link", "ROS_Clock", "ROS_Drive", "D1"),
}


def test_no_manual_names_anything_of_another_lab() -> None:
    others = "|".join(map(re.escape, names(LAB) - OWN_WORDS))
    named = re.compile(rf"(?<![\w/.])(?:{others})(?![\w.])")
    said = {
        rule.id: named.findall(rule.manual)
        for rule in rules_in(JETBOT).values()
        if rule.id[0] != LINT and named.search(rule.manual)
    }
    assert said == {}


def test_every_name_of_a_manual_is_known() -> None:
    open_names = [
        rule.id
        for rule in all_rules().values()
        if re.search(r"\{\w+\}", in_words_of(None, rule.manual))
    ]
    assert open_names == []


def test_every_name_is_used_in_a_manual() -> None:
    used = {name for rule in all_rules().values() for name in re.findall(r"\{(\w+)\}", rule.manual)}
    assert set(PLAIN) - used - {f"stem{n}" for n in range(5)} - {"stage1", "stage4"} == set()


def test_a_transform_published_twice_is_of_the_graph_that_publishes_the_tree() -> None:
    later = replace(LAB.graphs["ROS_Clock"], name="Later")
    extended = replace(LAB, graphs={**LAB.graphs, "Later": later})
    assert "`ROS_OdomTF` was copied" in rules_in(extended)["T04"].manual


def test_a_map_that_is_not_given_is_of_a_stage_that_localizes() -> None:
    later = replace(LAB.checkpoints["08"], id="99", file="later", new=("ROS_Clock",))
    extended = replace(LAB, checkpoints={**LAB.checkpoints, "99": later})
    assert LAB.checkpoints["08"].file in rules_in(extended)["M10"].manual


def test_a_hint_names_the_sensor_and_its_link() -> None:
    hints = {
        lab.title: finding_of(all_rules()["L01"], Problem("/a", "missing"), lab).hint
        for lab in (LAB, JETBOT)
    }
    assert "RTX Lidar > NVIDIA > Example Rotary 2D, rename the prim to `Lidar2D`" in str(
        hints["Lab 3"]
    )
    assert "RTX Lidar, rename the prim to `Scanner` and drag it onto `mast`" in str(hints["Week 5"])


def test_a_section_comes_from_the_lab_alone() -> None:
    rule, problem = all_rules()["S19"], Problem("/a", "floats")
    assert finding_of(rule, problem, LAB).handout == "A5"
    assert finding_of(rule, problem, JETBOT).handout is None
    assert finding_of(rule, problem, None).handout is None
    own = Problem("/a", "floats", handout="B1")
    assert finding_of(rule, own, LAB).handout == "B1"


def test_the_manual_names_the_section_behind_a_rule() -> None:
    said = invoke("rule", "S19").output
    assert said.endswith("\n\nHandout: A5\n")
    other = invoke("--lab", JETBOT_FOLDER, "rule", "S19").output
    assert "Handout" not in other


def test_manuals_of_a_lab_without_lidar_and_camera_name_neither() -> None:
    lab = JETBOT
    sensors = {name: spec for name, spec in lab.sensors.items() if spec.kind != "lidar"}
    lab = replace(lab, scene=replace(lab.scene, sensors=sensors))
    named = {
        rule.id
        for rule in rules_of_lab(lab).values()
        if re.search(r"(?i)\b(lidar|camera|amcl)\b", rule.manual) and rule.family != "E"
    }
    assert named == set()


def test_all_manuals_are_printed_together(subtests: pytest.Subtests) -> None:
    printed = invoke("rule", "--all").output
    for rule in all_rules().values():
        assert f"{rule.id} {rule.name} (" in printed
    for rule_id in ("K01", "S19", "W01"):
        with subtests.test(rule_id=rule_id):
            assert invoke("rule", rule_id).output.strip() in printed


def test_either_one_rule_is_explained_or_all(subtests: pytest.Subtests) -> None:
    for words in ((), ("W01", "--all")):
        with subtests.test(words=words):
            assert (
                "give the id of one rule, --search WORD, or --all" in invoke("rule", *words).output
            )


def test_a_rule_with_and_without_a_lab_is_printed_by_both_ids() -> None:
    with_lab, without = (invoke("rule", rule_id).stdout.splitlines() for rule_id in ("G06", "K07"))
    assert with_lab[:2] == [
        "G06 graph-in-instance (warning, graphs)",
        "K07 instanced-graph (warning, lint) without a lab",
    ]
    assert without[:2] == [
        "K07 instanced-graph (warning, lint)",
        "G06 graph-in-instance (warning, graphs) in a lab",
    ]
    assert with_lab[2:] == without[2:]
