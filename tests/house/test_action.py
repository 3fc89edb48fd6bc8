"""The pre-commit hook, the GitHub Action and its example, run as those programs run them."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import forking
import pytest
import quick_yaml
from foreign_robots import rover
from places import REPOSITORY
from pxr import Usd

from lab3_usd import build_checkpoint
from lab3_usd.spec.load.loader import load_lab

ROOT = REPOSITORY
EXPRESSION = re.compile(r"\$\{\{\s*(.+?)\s*\}\}")
CHECK = "Check the stages"


@dataclass(frozen=True)
class Ran:
    """What one step of the action left behind."""

    status: int
    printed: str
    outputs: str
    summary: str


def read(name: str) -> Any:
    return quick_yaml.load((ROOT / name).read_text())


@pytest.fixture(scope="module")
def hooks() -> dict[str, dict[str, Any]]:
    return {hook["id"]: hook for hook in read(".pre-commit-hooks.yaml")}


@pytest.fixture(scope="module")
def hook(hooks: dict[str, dict[str, Any]]) -> dict[str, Any]:
    return hooks["lab3-check"]


@pytest.fixture(scope="module")
def action() -> dict[str, Any]:
    return dict(read("action.yml"))


@pytest.fixture(scope="module")
def workflow() -> dict[str, Any]:
    return dict(read("docs/examples/workflow.yml"))


@pytest.fixture(scope="module")
def repository_of_a_student(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a right stage, a wrong one, and files that are no stages."""
    folder = tmp_path_factory.mktemp("student")
    build_checkpoint(None, "00", folder / "work" / "Lab3_00_student_start.usda")
    wrong = build_checkpoint(None, "01", folder / "my work" / "Lab3_01_ros_clock.usda")
    stage = Usd.Stage.Open(str(wrong))
    stage.GetAttributeAtPath("/World/ROS_Clock/ros2_publish_clock.inputs:topicName").Set("/other")
    stage.Save()
    (folder / "report.pdf").write_bytes(b"%PDF")
    (folder / "work" / "notes.usda").write_text("#usda 1.0\n")
    return folder


# ---- the pre-commit hook


def run_hook(hook: Mapping[str, Any], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the entry over the files that its pattern takes, as pre-commit does."""
    names = sorted(
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
    )
    taken = [name for name in names if re.search(hook["files"], name)]
    command, *arguments = shlex.split(hook["entry"])
    assert command == "lab3"
    return forking.run(
        [sys.executable, "-m", "lab3_usd", *arguments, *taken],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def test_the_hook_names_the_wrong_stage_and_no_other(
    hook: dict[str, Any], repository_of_a_student: Path
) -> None:
    done = run_hook(hook, repository_of_a_student)
    assert done.returncode == 1
    assert {line.partition(":")[0] for line in done.stdout.splitlines()} == {
        "my work/Lab3_01_ros_clock.usda"
    }


def test_the_hook_lets_right_stages_pass(hook: dict[str, Any], tmp_path: Path) -> None:
    build_checkpoint(None, "00", tmp_path / "Lab3_00_student_start.usda")
    done = run_hook(hook, tmp_path)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.parametrize("ending", ["usda", "usd", "usdc", "usdz", "uda"])
def test_the_hook_takes_every_checkpoint_file(hook: dict[str, Any], ending: str) -> None:
    files = [f"work/{checkpoint.file}.{ending}" for checkpoint in load_lab().checkpoints.values()]
    assert [name for name in files if not re.search(hook["files"], name)] == []


@pytest.mark.parametrize("name", ["work/notes.usda", "Lab3_report.pdf", "Lab3_05_odom.usda.bak"])
def test_the_hook_leaves_other_files_alone(hook: dict[str, Any], name: str) -> None:
    assert not re.search(hook["files"], name)


@pytest.fixture(scope="module")
def repository_of_a_robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a robot's stage, whose name no lab knows, and whose clock never runs."""
    folder = tmp_path_factory.mktemp("robot")
    stage = rover()
    stage.GetAttributeAtPath("/World/Clock/clock.inputs:execIn").ClearConnections()
    stage.GetRootLayer().Export(str(folder / "carter.usda"))
    return folder


def test_the_hook_of_the_linter_judges_stages_of_any_name(
    hooks: dict[str, dict[str, Any]], repository_of_a_robot: Path
) -> None:
    done = run_hook(hooks["lab3-lint"], repository_of_a_robot)
    assert (done.returncode, "carter.usda" in done.stdout, "K01" in done.stdout) == (1, True, True)


def test_pre_commit_can_install_the_hooks(hooks: dict[str, dict[str, Any]]) -> None:
    for hook in hooks.values():
        assert {"id", "name", "entry", "language", "files"} <= set(hook)
        assert hook["language"] == "python"
    assert "lab3 = " in (ROOT / "pyproject.toml").read_text()


# ---- the GitHub Action


def steps(action: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {step["name"]: step for step in action["runs"]["steps"]}


def run_check(action: Mapping[str, Any], folder: Path, temp: Path, **inputs: str) -> Ran:
    """Run the step that checks as a runner does: bash, environment, files for what it says."""
    program = temp / "lab3-usd" / "bin" / "lab3"
    program.parent.mkdir(parents=True)
    forking.shim(program, "lab3_usd")
    step = steps(action)[CHECK]
    values = {name: spec["default"] for name, spec in action["inputs"].items()} | inputs
    environment = {
        name: EXPRESSION.sub(lambda found: values[found[1].partition(".")[2]], text)
        for name, text in step["env"].items()
    }
    files = {"GITHUB_OUTPUT": temp / "output", "GITHUB_STEP_SUMMARY": temp / "summary"}
    for file in files.values():
        file.touch()
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],  # noqa: S607
        cwd=folder,
        env={
            **os.environ,
            **environment,
            **{name: str(file) for name, file in files.items()},
            "RUNNER_TEMP": str(temp),
            "GITHUB_ACTION_PATH": str(ROOT),
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    texts = [file.read_text() for file in files.values()]
    return Ran(done.returncode, done.stdout, *texts)


def test_the_action_passes_right_stages(
    action: dict[str, Any], repository_of_a_student: Path, tmp_path: Path
) -> None:
    ran = run_check(
        action, repository_of_a_student, tmp_path, paths="work/Lab3_00_student_start.usda"
    )
    assert (ran.status, ran.printed, ran.outputs) == (0, "", "status=0\n")
    assert "Lab3_00_student_start.usda" in ran.summary


def test_the_action_annotates_the_wrong_stage_and_fails(
    action: dict[str, Any], repository_of_a_student: Path, tmp_path: Path
) -> None:
    paths = "work/Lab3_00_student_start.usda\nmy work/Lab3_01_ros_clock.usda\n"
    ran = run_check(action, repository_of_a_student, tmp_path, paths=paths)
    assert (ran.status, ran.outputs) == (1, "status=1\n")
    assert re.findall(r"^::error file=(.+?),line=\d+.*title=(\w+)", ran.printed, re.MULTILINE) == [
        ("my work/Lab3_01_ros_clock.usda", "P01")
    ]


def test_the_action_passes_options_on_as_they_are(
    action: dict[str, Any], repository_of_a_student: Path, tmp_path: Path
) -> None:
    path = "my work/Lab3_01_ros_clock.usda"
    ran = run_check(action, repository_of_a_student, tmp_path, paths=path, arguments="--ignore=P01")
    assert (ran.status, ran.printed) == (0, "")


def test_the_action_writes_sarif_where_it_is_asked_to(
    action: dict[str, Any], repository_of_a_student: Path, tmp_path: Path
) -> None:
    target = tmp_path / "lab3.sarif"
    run_check(
        action,
        repository_of_a_student,
        tmp_path,
        paths="my work/Lab3_01_ros_clock.usda",
        sarif=str(target),
    )
    assert '"2.1.0"' in target.read_text()


@pytest.mark.parametrize(("untrusted", "found"), [("false", []), ("true", ["P01"])])
def test_the_action_heeds_the_configuration_of_those_it_trusts_only(
    action: dict[str, Any],
    repository_of_a_student: Path,
    tmp_path: Path,
    untrusted: str,
    found: list[str],
) -> None:
    folder = tmp_path / "student"
    shutil.copytree(repository_of_a_student / "my work", folder / "work")
    (folder / "lab3.toml").write_text('ignore = ["P", "X"]\n')
    build_checkpoint(None, "00", tmp_path / "starter.usda")
    ran = run_check(
        action,
        folder,
        tmp_path,
        paths=".",
        untrusted=untrusted,
        starter=str(tmp_path / "starter.usda"),
    )
    rules = re.findall(r"^::error file=work/.+title=(P\w+)", ran.printed, re.MULTILINE)
    assert (ran.status, rules) == (int(bool(found)), found)


def test_the_action_lints_any_stage(
    action: dict[str, Any], repository_of_a_robot: Path, tmp_path: Path
) -> None:
    ran = run_check(action, repository_of_a_robot, tmp_path, command="lint", paths="carter.usda")
    assert ran.status == 1
    assert "::error file=carter.usda" in ran.printed
    assert "K01" in ran.summary


def test_the_action_runs_no_other_command(
    action: dict[str, Any], repository_of_a_robot: Path, tmp_path: Path
) -> None:
    ran = run_check(action, repository_of_a_robot, tmp_path, command="fix", paths="carter.usda")
    assert (ran.status, ran.printed) == (2, "")


def test_wrong_use_fails_the_action_with_its_own_status(
    action: dict[str, Any], repository_of_a_student: Path, tmp_path: Path
) -> None:
    ran = run_check(action, repository_of_a_student, tmp_path, paths="nowhere")
    assert (ran.status, ran.outputs, ran.summary) == (2, "status=2\n", "")


def test_no_input_becomes_part_of_a_script(action: dict[str, Any]) -> None:
    scripts = [step["run"] for step in steps(action).values()]
    assert [EXPRESSION.search(script) for script in scripts] == [None] * len(scripts)


def test_every_input_is_used_and_explained(action: dict[str, Any]) -> None:
    texts = [text for step in steps(action).values() for text in step["env"].values()]
    used = {EXPRESSION.sub(r"\1", text) for text in texts}
    assert used == {f"inputs.{name}" for name in action["inputs"]}
    assert all(spec["description"] for spec in action["inputs"].values())


def test_the_action_installs_the_pinned_versions(action: dict[str, Any]) -> None:
    script = steps(action)["Install lab3"]["run"]
    named = re.findall(r"\$pins/([a-z]+\.txt)", script)
    assert set(named) == {"build.txt", "run.txt"}
    assert all((ROOT / "requirements" / name).is_file() for name in named)


# ---- the example workflow


def test_the_workflow_calls_the_action_with_inputs_it_has(
    action: dict[str, Any], workflow: dict[str, Any]
) -> None:
    called = [step for job in workflow["jobs"].values() for step in job["steps"]]
    ours = [step for step in called if "/lab3-usd@" in step["uses"]]
    assert len(ours) == 1
    assert set(ours[0]["with"]) <= set(action["inputs"])


def test_the_workflow_may_read_and_no_more(workflow: dict[str, Any]) -> None:
    assert workflow["permissions"] == {"contents": "read"}
