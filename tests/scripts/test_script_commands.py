"""What the commands say of scripts: in each format, over a scene, in folders, where none fit."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from foreign_robots import rover
from in_process import lab3
from report_examples import assert_valid
from scripted import as_script

from lab3_usd.pipeline.stage import JudgeSettings, lint_stage
from lab3_usd.report.formats.registry import all_formats

RIGHT = (Path(__file__).parent.parent / "script_cases" / "clock_right.txt").read_text("utf-8")
WRONG = RIGHT.replace("Clock.inputs:timeStamp", "Clock.inputs:timestamp")
LINE = next(n for n, line in enumerate(WRONG.splitlines(), 1) if "timestamp" in line)


def script(folder: Path, text: str, name: str = "robot.py") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def rules(path: Path, **settings: object) -> list[str]:
    found = lint_stage(path, JudgeSettings(heeds_ignores=True, **settings)).findings  # type: ignore[arg-type]
    return sorted(f"{f.rule} {f.line}" for f in found if f.severity != "note")


def test_the_text_says_how_much_was_read(tmp_path: Path) -> None:
    printed = lab3("lint", script(tmp_path, RIGHT.replace("TOPIC = ", "TOPIC = input() #")))
    assert "1 graph, 3 nodes, 2 wires read; not known before it runs: 1 value" in printed.stdout
    assert printed.returncode == 0


def test_what_is_not_known_is_listed_when_asked(tmp_path: Path) -> None:
    text = RIGHT.replace('TOPIC = "clock"', "import config\nTOPIC = config.topic")
    path = script(tmp_path, text)
    assert "config.topic" in lab3("lint", path, "-v").stdout
    nodes = json.loads(lab3("lint", path, "--format", "json").stdout)["results"][0]["nodes"]
    assert [each["why"] for each in nodes["not_known"]] == ["config.topic"]


def test_a_finding_shows_its_own_tuple(tmp_path: Path) -> None:
    printed = lab3("lint", script(tmp_path, WRONG))
    assert f"robot.py:{LINE}:17" in printed.stdout
    assert f"> {LINE} |" in printed.stdout
    assert printed.returncode == 1


def test_the_json_report_counts_what_was_read(tmp_path: Path) -> None:
    report = assert_valid(lab3("lint", script(tmp_path, WRONG), "--format", "json").stdout)
    nodes = report["results"][0]["nodes"]
    assert (nodes["total"], nodes["graphs"], nodes["wires"], nodes["values"]) == (3, 1, 2, 1)


@pytest.mark.parametrize("name", sorted(set(all_formats()) - {"html", "gradescope"}))
def test_each_format_reports_scripts(name: str, tmp_path: Path) -> None:
    printed = lab3("lint", script(tmp_path, WRONG), "--format", name)
    assert printed.returncode == 1
    assert "timestamp" in printed.stdout


def test_sarif_has_the_place_in_the_script(tmp_path: Path) -> None:
    report = json.loads(lab3("lint", script(tmp_path, WRONG), "--format", "sarif").stdout)
    (result,) = report["runs"][0]["results"]
    place = result["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"].endswith("robot.py")
    assert place["region"]["startLine"] == LINE


@pytest.mark.parametrize("note", ["# lab3: ignore[K21]", "# lab3: ignore K21", "# lab3: ignore[K]"])
def test_a_comment_ignores_a_finding_of_its_line(note: str, tmp_path: Path) -> None:
    lines = WRONG.splitlines()
    lines[LINE - 1] += f"  {note}"
    assert rules(script(tmp_path, "\n".join(lines))) == []


def test_a_comment_that_ignores_nothing_is_reported(tmp_path: Path) -> None:
    lines = RIGHT.splitlines()
    lines[LINE - 1] += "  # lab3: ignore[K21]"
    assert rules(script(tmp_path, "\n".join(lines))) == [f"F06 {LINE}"]


def test_a_baseline_hides_what_it_knows(tmp_path: Path) -> None:
    path, baseline = script(tmp_path, WRONG), tmp_path / "known.json"
    lab3("lint", path, "--write-baseline", baseline)
    assert lab3("lint", path, "--baseline", baseline).returncode == 0


def test_rules_are_selected(tmp_path: Path) -> None:
    assert lab3("lint", script(tmp_path, WRONG), "--select", "B").returncode == 0


def test_a_script_without_a_graph_is_no_fault(tmp_path: Path) -> None:
    printed = lab3("lint", script(tmp_path, "print('hello')\n"))
    assert printed.returncode == 0
    assert "it builds no graph" in printed.stdout


def test_scripts_without_graphs_are_passed_over_in_a_folder(tmp_path: Path) -> None:
    script(tmp_path, "print('hello')\n", "other.py")
    script(tmp_path, RIGHT)
    printed = lab3("lint", tmp_path)
    assert "other.py" not in printed.stdout
    assert "1 file: 1 passed" in printed.stdout


def test_a_folder_of_scripts_without_graphs_is_no_fault(tmp_path: Path) -> None:
    script(tmp_path, "print('hello')\n")
    assert lab3("lint", tmp_path).returncode == 0


@pytest.mark.parametrize("text", ["print('hello')\n", WRONG])
def test_nothing_of_a_script_is_run(text: str, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    lab3("lint", script(tmp_path, f"open({str(trace)!r}, 'w')\n{text}"))
    assert not trace.exists()


def test_a_syntax_error_is_an_error_at_its_line(tmp_path: Path) -> None:
    report = json.loads(
        lab3("lint", script(tmp_path, f"{RIGHT}\nx = (\n"), "--format", "json").stdout
    )
    (finding,) = report["results"][0]["findings"]
    assert (finding["rule"], finding["line"]) == ("F01", len(RIGHT.splitlines()) + 2)


def notebook(*cells: str) -> str:
    return json.dumps(
        {
            "cells": [
                {"cell_type": "markdown", "source": ["# Clock"]},
                *(
                    {"cell_type": "code", "source": cell.splitlines(keepends=True)}
                    for cell in cells
                ),
            ]
        },
        indent=1,
    )


def test_a_notebook_is_read_cell_by_cell(tmp_path: Path) -> None:
    text = notebook("%matplotlib inline\n!pip list\nimport this", WRONG, "await asyncio.sleep(1)")
    path = script(tmp_path, text, "robot.ipynb")
    (finding,) = lint_stage(path).findings
    assert finding.message.endswith(f"(cell 3, line {LINE})")
    assert "Clock.inputs:timestamp" in text.splitlines()[(finding.line or 0) - 1]


@pytest.mark.parametrize("command", ["check", "sim"])
def test_commands_about_stages_say_that_they_take_no_scripts(command: str, tmp_path: Path) -> None:
    printed = lab3(command, script(tmp_path, RIGHT))
    assert "lint judges the graphs that scripts build" in printed.stdout + printed.stderr
    assert printed.returncode != 0


def test_topics_are_those_that_the_script_names(tmp_path: Path) -> None:
    asked = script(tmp_path, RIGHT.replace('TOPIC = "clock"', "TOPIC = args.topic"))
    assert "{args.topic}" in lab3("topics", asked).stdout
    assert "/clock" in lab3("topics", script(tmp_path, RIGHT)).stdout


def test_the_graphs_of_a_script_are_drawn(tmp_path: Path) -> None:
    printed = lab3("draw", script(tmp_path, RIGHT), "--lint", "-o", tmp_path / "pictures")
    assert printed.returncode == 0
    assert [path.name for path in (tmp_path / "pictures").iterdir()] == ["robot-Clock.svg"]


def test_the_transforms_of_a_script_over_its_scene_are_those_of_the_stage(tmp_path: Path) -> None:
    file = tmp_path / "rover.usda"
    rover().GetRootLayer().Export(str(file))
    path, scene = as_script(file, tmp_path)
    assert (
        lab3("tf", path, "--stage", scene).stdout.splitlines()[1:]
        == (lab3("tf", file).stdout.splitlines()[1:])
    )


def test_without_its_scene_what_rests_on_prims_is_held_back(tmp_path: Path) -> None:
    file = tmp_path / "rover.usda"
    rover().GetRootLayer().Export(str(file))
    path, _ = as_script(file, tmp_path)
    result = lint_stage(path)
    assert result.findings == ()
    assert result.verdict == "pass"
    assert result.not_judged


def test_a_misspelt_port_is_repaired_in_its_string(tmp_path: Path) -> None:
    path = script(tmp_path, WRONG)
    printed = lab3("fix", "--lint", path, "--diff")
    changed = [line for line in printed.stdout.splitlines() if line[:1] in "+-"][2:]
    assert [line[0] for line in changed] == ["-", "+"]
    assert changed[1][1:] == changed[0][1:].replace("timestamp", "timeStamp")
    lab3("fix", "--lint", path, "--in-place")
    assert path.read_text("utf-8") == RIGHT


def test_ports_to_choose_from_are_named_where_none_is_like_the_one_written(tmp_path: Path) -> None:
    printed = lab3("lint", script(tmp_path, RIGHT.replace("inputs:topicName", "inputs:way")))
    assert "write one of inputs:" in printed.stdout
    near = lab3("lint", script(tmp_path, RIGHT.replace("inputs:topicName", "inputs:topicNames")))
    assert "write one of" not in near.stdout


def test_a_name_is_repaired_whatever_else_comes_to_light(tmp_path: Path) -> None:
    wrong = RIGHT.replace('("Tick.outputs:tick", "Clock.inputs:execIn"),', "").replace(
        '"clock"', '"a b"'
    )
    path = script(tmp_path, wrong.replace("ROS2PublishClock", "ROS2PublishClok"))
    printed = lab3("fix", "--lint", path, "--in-place")
    assert path.read_text("utf-8") == wrong
    assert "1 repaired, 2 left" in printed.stdout


def test_types_from_before_are_renamed(tmp_path: Path) -> None:
    old = RIGHT.replace("isaacsim.ros2.bridge", "omni.isaac.ros2_bridge")
    path = script(tmp_path, old)
    lab3("fix", "--lint", path, "--in-place")
    assert path.read_text("utf-8") == RIGHT


def test_what_names_no_checkpoint_is_repaired_as_lint_judges_it(tmp_path: Path) -> None:
    path = script(tmp_path, WRONG)
    printed, by_lint = lab3("fix", path, "--diff"), lab3("fix", "--lint", path, "--diff")
    assert (printed.returncode, printed.stdout) == (1, by_lint.stdout)
    assert printed.stderr == f"lab3: {path}: names no checkpoint: repaired as with --lint\n"
