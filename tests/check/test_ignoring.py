"""Findings that are ignored on purpose: notes in stages, and baselines."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from breaking import Step, broken, correct_stage, place
from foreign_robots import rover
from in_process import invoke as lab3
from pxr import Sdf, Usd
from report_examples import assert_valid

from lab3_usd.errors import UsageError
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.workers.submission_grading import grade_submission
from lab3_usd.grade.workers.worker_main import load_setup
from lab3_usd.grade.workers.worker_messages import PoolSettings, Task
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.stage.write.starter import build_starter

DRIVE, CLOCK = "ROS_Drive/differential_controller", "ROS_Clock/ros2_publish_clock"
STEPS: list[Step] = [
    {"set": [f"{DRIVE}.inputs:wheelRadius", 0.033]},
    {"disconnect": f"{CLOCK}.inputs:execIn"},
]
NAME = "Lab3_02_ros_drive"
UNUSED = "F06"
Told = list[tuple[str, str, str]]


def told(*arguments: Path | str, command: str = "check") -> Told:
    """Rule, severity and site of every finding."""
    document: dict[str, Any] = json.loads(lab3(command, "--format", "json", *arguments).stdout)
    assert_valid(document)
    return sorted(
        (each["rule"], each["severity"], each["prim"])
        for result in document["results"]
        for each in result["findings"]
    )


P01 = ("P01", "error", place(DRIVE))
W01 = ("W01", "error", place(CLOCK))
BOTH = [P01, W01]


def saved(stage: Usd.Stage, folder: Path, ending: str = "usda") -> Path:
    path = folder / f"{NAME}.{ending}"
    stage.GetRootLayer().Export(str(path))
    return path


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A text stage with the faults P01 and W01."""
    path = saved(broken("02", STEPS), tmp_path_factory.mktemp("first"))
    assert told(path) == BOTH
    return path


@pytest.fixture
def wrong(first: Path, tmp_path: Path) -> Path:
    """A copy of it, to be changed."""
    return Path(shutil.copy(first, tmp_path))


def put_comment(path: Path, comment: str, *, above: bool = False) -> int:
    """Write a comment at the line of the wheel radius, and return its number."""
    lines = path.read_text().splitlines()
    number = next(n for n, line in enumerate(lines) if "inputs:wheelRadius = " in line)
    if above:
        lines.insert(number, f"        {comment}\n")
    else:
        lines[number] += f"  {comment}"
    path.write_text("\n".join(lines) + "\n")
    return number + 1


# ---- comments


@pytest.mark.parametrize(
    "comment",
    [
        "# lab3: ignore[P01] our robot has larger wheels",
        "# lab3: ignore[wrong-value] our robot has larger wheels",
        "#lab3:ignore[p01]",
        "# lab3: ignore[P]",
    ],
)
def test_a_comment_ignores_a_rule_at_its_line(wrong: Path, comment: str) -> None:
    put_comment(wrong, comment)
    assert told(wrong) == [W01]


def test_a_comment_on_a_line_of_its_own_ignores_a_rule_at_the_next(wrong: Path) -> None:
    put_comment(wrong, "# lab3: ignore[P01]", above=True)
    assert told(wrong) == [W01]


@pytest.mark.parametrize("letter", ["\f", "\u2028", "\u0085"])
def test_what_ends_no_line_moves_no_note(wrong: Path, letter: str) -> None:
    put_comment(wrong, "# lab3: ignore[P01]")
    wrong.write_text(wrong.read_text().replace("\n", f"  # a{letter}b\n", 1))
    assert told(wrong) == [W01]


@pytest.mark.parametrize(
    "words",
    ['string about = "# lab3: ignore[P01]"', "asset about = @a # lab3: ignore[P01].usd@"],
)
def test_what_looks_like_a_comment_in_a_value_is_none(wrong: Path, words: str) -> None:
    text = wrong.read_text()
    at = next(line for line in text.splitlines() if "inputs:wheelRadius = " in line)
    wrong.write_text(text.replace(at, f'custom {words} # "\n{at}'))
    assert told(wrong) == BOTH


def test_one_comment_may_name_several_rules(wrong: Path) -> None:
    put_comment(wrong, "# lab3: ignore[P01, P02]")
    assert told(wrong) == [(UNUSED, "warning", "/"), W01]


def test_a_note_for_another_command_is_none_that_is_unused(wrong: Path, tmp_path: Path) -> None:
    put_comment(wrong, "# lab3: ignore[P01, K64, U04, K]")
    assert told(wrong) == [W01]
    starter = tmp_path / "starter.usda"
    build_starter(starter)
    assert (UNUSED, "warning", "/") in told("--starter", starter, wrong)


def test_a_note_for_check_is_none_that_lint_finds_unused(tmp_path: Path) -> None:
    path = saved(broken("02", STEPS[:1]), tmp_path)
    put_comment(path, "# lab3: ignore[P01, P, K01]")
    assert told(path, command="lint") == [(UNUSED, "warning", "/")]


@pytest.mark.parametrize(
    ("comment", "why"),
    [
        ("# lab3: ignore[P02]", "there is no such finding here"),
        ("# lab3: ignore[S01]", "there is no such finding here"),
        ("# lab3: ignore[P99]", "there is no such rule"),
        ("# lab3: ignore", "it names no rule"),
        ("# lab3: ignore[]", "it names no rule"),
        ("# as measured, lab3: ignore[P01]", "a suppression begins its comment"),
        ("# lab3 ignore[P01]", "a suppression begins its comment"),
    ],
)
def test_a_comment_that_ignores_nothing_is_a_warning_at_its_line(
    wrong: Path, comment: str, why: str
) -> None:
    line = put_comment(wrong, comment)
    assert [each for each in told(wrong) if each[0] != UNUSED] == BOTH
    printed = lab3("check", "--format", "concise", "--select", UNUSED, wrong).stdout
    assert re.match(rf".*usda:{line}:\d+: F06 ignore\[.*\] ignores nothing: {why}", printed)


def test_a_comment_that_speaks_of_the_lab_is_no_note(wrong: Path) -> None:
    put_comment(wrong, "# in lab3 we ignore this")
    assert told(wrong) == BOTH


def test_a_comment_in_a_sublayer_is_heeded(tmp_path: Path) -> None:
    part = tmp_path / "part.usda"
    correct_stage("02").GetRootLayer().Export(str(part))
    stage = Usd.Stage.Open(str(part))
    stage.GetAttributeAtPath(place(f"{DRIVE}.inputs:wheelRadius")).Set(0.033)
    stage.Save()
    put_comment(part, "# lab3: ignore[P01]")
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths.append("./part.usda")
    metadata = stage.GetRootLayer().pseudoRoot
    for key in ("upAxis", "metersPerUnit"):
        root.pseudoRoot.SetInfo(key, metadata.GetInfo(key))
    path = tmp_path / f"{NAME}.usda"
    root.Export(str(path))
    assert "P01" not in {each[0] for each in told(path)}
    assert UNUSED not in {each[0] for each in told(path)}


# ---- custom data


def with_data(where: str, rules: str, *, grouped: bool = False) -> Usd.Stage:
    """Return the stage with a note in the custom data of a prim or property."""
    stage = broken("02", STEPS)
    path = Sdf.Path(place(where))
    spec = stage.GetRootLayer().GetObjectAtPath(path)
    data = {"lab3": {"ignore": rules}} if grouped else {"lab3:ignore": rules}
    spec.SetInfo("customData", data)
    return stage


PORT = f"{DRIVE}.inputs:wheelRadius"


@pytest.mark.parametrize("where", [PORT, DRIVE, "ROS_Drive", "/turtlebot3_burger"])
def test_custom_data_ignores_a_rule_at_a_property_or_below_a_prim(
    tmp_path: Path, where: str
) -> None:
    assert told(saved(with_data(where, "P01"), tmp_path)) == [W01]


@pytest.mark.parametrize("ending", ["usda", "usdc"])
@pytest.mark.parametrize("where", [PORT, DRIVE])
def test_custom_data_may_be_a_group(tmp_path: Path, where: str, ending: str) -> None:
    stage = with_data(where, "P01", grouped=True)
    assert told(saved(stage, tmp_path, ending)) == [W01]


@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_custom_data_elsewhere_is_unused(tmp_path: Path, ending: str) -> None:
    path = saved(with_data("ROS_Clock", "P01"), tmp_path, ending)
    assert told(path) == [(UNUSED, "warning", place("ROS_Clock")), *BOTH]


def test_what_is_ignored_decides_the_exit_code(wrong: Path) -> None:
    stage = Usd.Stage.Open(str(wrong))
    for name in (DRIVE, CLOCK):
        stage.GetPrimAtPath(place(name)).SetCustomDataByKey("lab3:ignore", "P01,W01")
    stage.Save()
    assert {each[0] for each in told(wrong)} == {UNUSED}
    assert lab3("check", wrong).exit_code == 0
    assert lab3("check", "--fail-on", "warning", wrong).exit_code == 1


def test_several_processes_ignore_the_same(tmp_path: Path) -> None:
    path = saved(with_data(DRIVE, "P01"), tmp_path)
    other = tmp_path / f"{NAME}_2.usda"
    other.write_text(path.read_text())
    assert told("--jobs", "2", path, other) == [W01, W01]


def test_a_submission_heeds_the_notes_in_its_stages(tmp_path: Path) -> None:
    (tmp_path / "work").mkdir()
    path = saved(with_data(DRIVE, "P01"), tmp_path / "work")
    assert path.exists()
    assert W01 in told(tmp_path)
    assert P01 not in told(tmp_path)


def test_lint_heeds_notes_too(wrong: Path) -> None:
    found = {each[0] for each in told(wrong, command="lint")}
    stage = Usd.Stage.Open(str(wrong))
    stage.GetPrimAtPath("/World").SetCustomDataByKey("lab3:ignore", ",".join(sorted(found)))
    stage.GetPrimAtPath("/turtlebot3_burger").SetCustomDataByKey("lab3:ignore", ",".join(found))
    stage.Save()
    assert {each[0] for each in told(wrong, command="lint")} <= {UNUSED}


def test_a_library_call_and_grading_heed_no_note(tmp_path: Path) -> None:
    work = tmp_path / "ana" / "work"
    work.mkdir(parents=True)
    path = saved(with_data(DRIVE, "P01"), work)
    put_comment(path, "# lab3: ignore[P01]")
    assert {finding.rule for finding in check_stage(path).findings} == {"P01", "W01"}
    setup = load_setup(PoolSettings(None, None, Limits(), with_report=True))
    task, scratch = Task("ana", "ana", (Source(tmp_path / "ana"),)), tmp_path / "scratch"
    scratch.mkdir()
    graded = grade_submission(setup, task, scratch, lambda _: None)["report"]["results"]
    assert {found["rule"] for result in graded for found in result["findings"]} == {"P01", "W01"}


# ---- baselines


@pytest.fixture
def baseline(wrong: Path) -> Path:
    """A baseline that knows both faults."""
    path = wrong.parent / "known.json"
    result = lab3("check", "--write-baseline", path, wrong)
    assert (result.exit_code, "2 findings written" in result.stderr) == (0, True)
    return path


def test_known_findings_do_not_fail(wrong: Path, baseline: Path) -> None:
    result = lab3("check", "--baseline", baseline, wrong)
    assert (result.exit_code, result.stderr) == (0, "")
    assert told("--baseline", baseline, wrong) == []


def test_they_are_known_where_lines_are_renumbered_and_values_change(
    wrong: Path, baseline: Path
) -> None:
    text = wrong.read_text().replace("wheelRadius = 0.033", "wheelRadius = 0.04")
    wrong.write_text(text.replace("\n", "\n# one\n# two\n", 1))
    assert told("--baseline", baseline, wrong) == []


def test_they_are_known_from_another_folder(
    wrong: Path, baseline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(wrong.parent)
    assert told("--baseline", baseline.name, wrong.name) == []


def test_a_new_finding_fails(wrong: Path, baseline: Path) -> None:
    stage = Usd.Stage.Open(str(wrong))
    stage.GetAttributeAtPath(place(f"{CLOCK}.inputs:timeStamp")).ClearConnections()
    stage.Save()
    assert told("--baseline", baseline, wrong) == [W01]
    assert lab3("check", "--baseline", baseline, wrong).exit_code == 1


def test_another_missing_node_of_the_same_graph_is_new(tmp_path: Path) -> None:
    def missing(*names: str) -> Path:
        return saved(broken("02", [{"remove": f"ROS_Drive/{name}"} for name in names]), tmp_path)

    known = tmp_path / "known.json"
    lab3("check", "--write-baseline", known, missing("make_array", "scale_linear_velocity"))
    path = missing("make_array", "differential_controller")
    assert [each[0] for each in told("--baseline", known, path)] == ["N01"]


def test_what_is_no_longer_found_is_said(wrong: Path, baseline: Path) -> None:
    saved(broken("02", STEPS[:1]), wrong.parent)
    result = lab3("check", "--baseline", baseline, wrong)
    assert result.exit_code == 0
    assert result.stderr.splitlines()[1:] == [f"  {wrong.name}: W01 {W01[2]}.inputs:execIn"]
    assert lab3("check", "--select", "P", "--baseline", baseline, wrong).stderr == ""


def test_a_baseline_of_other_files_says_nothing(
    wrong: Path, baseline: Path, tmp_path: Path
) -> None:
    other = tmp_path / f"{NAME}_2.usda"
    other.write_text(wrong.read_text())
    result = lab3("check", "--baseline", baseline, other)
    assert (result.exit_code, result.stderr) == (1, "")


def linted(stage: Usd.Stage, path: Path, *more: Path | str) -> int:
    """Save a stage, and lint it."""
    stage.GetRootLayer().Export(str(path))
    return lab3("lint", *more, path).exit_code


def test_what_could_not_be_judged_is_accepted_while_the_reason_is_the_same(tmp_path: Path) -> None:
    path, known = tmp_path / "robot.usda", tmp_path / "known.json"
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().subLayerPaths.append("./lost.usda")
    assert linted(stage, path) == 1
    assert linted(stage, path, "--write-baseline", known) == 0
    result = lab3("lint", "--quiet", "--baseline", known, path)
    assert result.exit_code == 0
    assert result.stderr == f"lab3: 1 stage not judged, for the reasons in {known}\n"
    assert "1 not judged" in result.stdout
    stage.GetRootLayer().subLayerPaths.append("./too.usda")
    assert linted(stage, path, "--baseline", known) == 1


def test_a_finding_of_the_whole_stage_stays_known_where_another_node_shows_it(
    tmp_path: Path,
) -> None:
    path, known = tmp_path / "robot.usda", tmp_path / "known.json"
    stage = rover()
    stage.RemovePrim("/World/Clock")
    assert linted(stage, path, "--fail-on", "warning", "--write-baseline", known) == 0
    [finding] = json.loads(known.read_text())["findings"]
    assert finding["rule"] == "K47"
    stage.RemovePrim(finding["site"])
    assert linted(stage, path, "--fail-on", "warning", "--baseline", known) == 0
    assert linted(stage, path, "--fail-on", "warning") == 1


@pytest.mark.parametrize("content", ["", "{}", "[]", '{"version": 2, "findings": []}'])
def test_what_is_no_baseline_is_wrong_use(wrong: Path, tmp_path: Path, content: str) -> None:
    path = tmp_path / "known.json"
    path.write_text(content)
    with pytest.raises(UsageError, match=f"^{re.escape(str(path))}"):
        lab3("check", "--baseline", path, wrong)
    with pytest.raises(UsageError, match="cannot be read"):
        lab3("check", "--baseline", tmp_path / "nowhere", wrong)
