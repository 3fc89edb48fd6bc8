"""`lab3 lint` as a person and a script meet it: paths, exit codes, formats, lines."""

from __future__ import annotations

import json
import os
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from breaking import correct_stage, the_lab
from foreign_robots import rover
from in_process import lab3
from pxr import Usd
from report_examples import assert_valid

from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.report.formats.registry import all_formats

STAMP = "/World/Clock/clock.inputs:timeStamp"


def lint(*arguments: str | Path) -> CompletedProcess[str]:
    return lab3("lint", *arguments)


def saved(stage: Usd.Stage, path: Path) -> Path:
    stage.GetRootLayer().Export(str(path))
    return path


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    stage = rover()
    stage.GetAttributeAtPath(STAMP).ClearConnections()
    return saved(stage, tmp_path / "robot.usda")


def test_a_robot_that_works_exits_0(tmp_path: Path) -> None:
    done = lint(saved(rover(), tmp_path / "robot.usda"))
    assert (done.returncode, done.stderr) == (0, "")
    assert "robot.usda: pass" in done.stdout


def test_a_fault_exits_1_and_names_its_line(broken: Path) -> None:
    done = lint(broken)
    assert done.returncode == 1
    assert "error K10 unset-input /World/Clock/clock.inputs:timeStamp" in done.stdout
    (finding,) = lint_stage(broken).findings
    assert finding.line is not None
    assert "inputs:timeStamp" in broken.read_text().splitlines()[finding.line - 1]
    assert finding.layer == str(broken)


def test_the_checkpoint_is_null_in_json(broken: Path) -> None:
    report = assert_valid(lint(broken, "--format", "json").stdout)
    assert [each["checkpoint"] for each in report["results"]] == [None]


@pytest.mark.parametrize("form", all_formats())
def test_every_format_can_tell_it(form: str, broken: Path) -> None:
    done = lint(broken, "--format", form)
    assert (done.returncode, done.stderr) == (1, "")
    assert "None" not in done.stdout


def test_rules_are_chosen_and_left_out(broken: Path) -> None:
    assert lint(broken, "--ignore", "K10").returncode == 0
    assert lint(broken, "--select", "K20").returncode == 0
    assert lint(broken, "--select", "K").returncode == 1


def test_a_folder_means_its_stages(broken: Path) -> None:
    saved(rover(), broken.with_name("whole.usda"))
    report = json.loads(lint(broken.parent, "--format", "json").stdout)
    assert [each["verdict"] for each in report["results"]] == ["fail", "pass"]


def test_a_folder_means_the_stages_below_it_as_well(broken: Path) -> None:
    for name in ("parts/wheels", ".thumbs"):
        (broken.parent / name).mkdir(parents=True)
        saved(rover(), broken.parent / name / "whole.usda")
    report = json.loads(lint(broken.parent, "--format", "json").stdout)
    below = broken.parent / "parts" / "wheels" / "whole.usda"
    assert [each["path"] for each in report["results"]] == [str(below), str(broken)]


def test_a_folder_that_may_not_be_opened_is_named_and_fails(
    broken: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = os.scandir
    closed = broken.parent / "closed"
    closed.mkdir()
    broken.unlink()
    saved(rover(), broken.with_name("whole.usda"))

    def scandir(path: str) -> object:
        if Path(path) == closed:
            raise PermissionError(13, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr(os, "scandir", scandir)
    done = lint(broken.parent)
    assert done.returncode == 1
    assert f"{closed}: unreadable, 1 error" in done.stdout
    assert "cannot be read (Permission denied)" in done.stdout
    assert "2 files: 1 passed, 1 failed" in done.stdout


def test_several_processes_find_the_same(broken: Path) -> None:
    saved(rover(), broken.with_name("whole.usda"))
    alone, several = lint(broken.parent), lint(broken.parent, "-j", "2")
    assert (several.returncode, several.stdout) == (alone.returncode, alone.stdout)
    assert alone.returncode == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no.usda"], "there is no such file or folder"),
        (["{stage}", "--isaac", "4.0"], "known are 2022.2, 2023.1, 4.2"),
        (["{stage}", "--format", "htm"], "there is no format 'htm'; did you mean 'html'?"),
        (["{stage}", "--select", "Y99"], "there is no rule or family"),
        (["{stage}", "--select", "K1"], "did you mean 'K01'?"),
        (["{stage}", "-o", "{stage}"], "name another file"),
        (["{folder}/empty"], "holds no stage"),
    ],
)
def test_wrong_usage_exits_2(arguments: list[str], message: str, broken: Path) -> None:
    (broken.parent / "empty").mkdir()
    told = [argument.format(stage=broken, folder=broken.parent) for argument in arguments]
    done = lint(*told)
    assert done.returncode == 2
    assert message in done.stderr


def test_a_file_that_is_no_stage_is_unreadable(tmp_path: Path) -> None:
    path = tmp_path / "robot.usda"
    path.write_text("not a stage")
    result = lint_stage(path)
    assert (result.verdict, result.checkpoint) == ("unreadable", None)
    assert lint(path).returncode == 1


def test_a_missing_sublayer_is_a_note_and_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "robot.usda"
    path.write_text("#usda 1.0\n(\n    subLayers = [@./gone.usda@]\n)\n")
    result = lint_stage(path)
    findings = [(finding.rule, finding.severity) for finding in result.findings]
    assert (result.verdict, findings) == ("not judged", [("F03", "note")])


def test_what_could_not_be_judged_exits_1_and_says_why(tmp_path: Path) -> None:
    stage = rover()
    stage.GetRootLayer().subLayerPaths.append("./gone.usda")
    path = saved(stage, tmp_path / "robot.usda")
    done = lint(path)
    assert done.returncode == 1
    assert "not judged: the sublayer ./gone.usda of the stage cannot be found" in done.stdout
    assert lint(path, "--exit-zero").returncode == 0
    report = assert_valid(lint(path, "--format", "json").stdout)
    assert [result["verdict"] for result in report["results"]] == ["not judged"]


@pytest.mark.parametrize("checkpoint", the_lab().checkpoints)
def test_the_stages_of_the_lab_are_without_fault(checkpoint: str, tmp_path: Path) -> None:
    result = lint_stage(saved(correct_stage(checkpoint), tmp_path / "stage.usda"))
    assert result.verdict == "pass"
    # The handout's wheel radius is not that of the model's wheels, and stays so.
    warnings = {finding.rule for finding in result.findings if finding.severity == "warning"}
    assert warnings <= {"K64"}


def test_notes_are_counted_in_a_line_and_listed_when_asked_for(tmp_path: Path) -> None:
    stage = rover()
    for name in ("first", "second"):
        stage.DefinePrim(f"/World/{name}").GetReferences().AddReference(f"./{name}.usda")
    path = saved(stage, tmp_path / "robot.usda")
    assert "\n2 assets not found; -v lists them\n" in lint(path).stdout
    assert "F02" not in lint(path).stdout
    assert lint(path, "-v").stdout.count("note F02") == 2
