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
    errors: str
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
        assert {"id", "name", "entry", "language"} <= set(hook)
        assert {"files", "types_or"} & set(hook)
        assert hook["language"] == "python"
    assert "lab3 = " in (ROOT / "pyproject.toml").read_text()


# ---- the GitHub Action


def steps(action: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {step["name"]: step for step in action["runs"]["steps"]}


def run_step(
    action: Mapping[str, Any],
    name: str,
    folder: Path,
    temp: Path,
    environment: Mapping[str, str],
    **inputs: str,
) -> Ran:
    """Run a step as a runner does: bash, its environment, and files for what the step says."""
    step = steps(action)[name]
    values = {name: spec["default"] for name, spec in action["inputs"].items()} | inputs
    given = {
        name: EXPRESSION.sub(lambda found: values[found[1].partition(".")[2]], text)
        for name, text in step["env"].items()
    }
    files = {"GITHUB_OUTPUT": temp / "output", "GITHUB_STEP_SUMMARY": temp / "summary"}
    for file in files.values():
        file.write_bytes(b"")
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],  # noqa: S607
        cwd=folder,
        env={
            "GITHUB_ACTION_PATH": str(ROOT),
            **environment,
            **given,
            **{name: str(file) for name, file in files.items()},
            "RUNNER_TEMP": str(temp),
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )
    texts = [file.read_text() for file in files.values()]
    return Ran(done.returncode, done.stdout, done.stderr, *texts)


def run_check(action: Mapping[str, Any], folder: Path, temp: Path, **inputs: str) -> Ran:
    """Run the step that checks, with the Python of these tests in place of the installed one."""
    programs = temp / "lab3-usd" / "bin"
    programs.mkdir(parents=True)
    forking.shim(programs / "lab3", "lab3_usd")
    python = programs / "python"
    python.write_text(
        f'#!/bin/sh\n[ "$1 $2 $3" = "-I -m lab3_usd" ] || exit 99\n'
        f'shift 3; exec "{programs}/lab3" "$@"\n'
    )
    python.chmod(0o755)
    return run_step(action, CHECK, folder, temp, os.environ, **inputs)


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


# ---- the action on a fresh runner, from its clone to its annotations

INSTALL = "Install lab3"
# What a repository may hold so that a Python that starts in it runs it: what `venv` and `pip`
# import, what the package builds and runs with, and what Python reads by itself.
IMPORTED = (
    *("venv", "ensurepip", "pip", "sitecustomize", "usercustomize", "conftest", "setup"),
    *("hatch_build", "hatchling", "jinja2", "msgspec", "yaml", "markupsafe", "click", "networkx"),
    *("lab3_usd", "pxr", "multiprocessing", "concurrent", "subprocess", "typing", "encodings"),
)


@dataclass(frozen=True)
class Runner:
    """A runner's folder for temporary files, and the environment of its steps."""

    temp: Path
    environment: Mapping[str, str]


def leave_traps(folder: Path) -> None:
    """Put modules and programs into a folder, each of which writes a file `ran` when it runs."""
    ran = folder / "ran"
    trap = f"open({str(ran)!r}, 'a').write(__name__ + ' ')\n"
    for name in IMPORTED:
        (folder / f"{name}.py").write_text(trap)
        package = folder / name
        package.mkdir()
        for module in ("__init__", "__main__"):
            (package / f"{module}.py").write_text(trap)
    for name in ("python", "python3", "pip", "lab3"):
        program = folder / "bin" / name
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!/bin/sh\necho {name} >> {ran}\n")
        program.chmod(0o755)
    (folder / "pyvenv.cfg").write_text(f"home = {folder / 'bin'}\n")
    (folder / "pyproject.toml").write_text(
        '[build-system]\nrequires = []\nbuild-backend = "setup"\n'
    )
    (folder / "setup.cfg").write_text("[install]\nprefix = .\n")
    (folder / ".python-version").write_text("../../bin\n")
    (folder / "traps.pth").write_text("import venv\n")


@pytest.fixture(scope="module")
def hostile(repository_of_a_student: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wrong stage and a right one, among code that must never run."""
    folder = tmp_path_factory.mktemp("hostile") / "workspace"
    shutil.copytree(repository_of_a_student / "my work", folder / "work")
    shutil.copy(repository_of_a_student / "work" / "Lab3_00_student_start.usda", folder / "work")
    leave_traps(folder)
    return folder


@pytest.fixture(scope="module")
def runner(
    action: dict[str, Any], hostile: Path, tmp_path_factory: pytest.TempPathFactory
) -> Runner:
    """A runner that has installed the action out of a clone, with the repository as workspace."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout: what a clone holds is not known")
    root = tmp_path_factory.mktemp("runner")
    for name in ("home", "temp", "clone"):
        (root / name).mkdir()
    tracked = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],  # noqa: S607
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split("\0")  # fmt: skip
    for name in filter(None, tracked):
        if (ROOT / name).is_file():
            (root / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, root / "clone" / name)
    # Where packages come from is this machine's; that pip compiles none saves half the time.
    kept = {name: value for name, value in os.environ.items() if name.startswith("PIP_")}
    environment = {
        **kept,
        "PATH": os.environ["PATH"],
        "HOME": str(root / "home"),
        "GITHUB_ACTION_PATH": str(root / "clone"),
        "PIP_NO_COMPILE": "1",
    }
    reached = subprocess.run(
        [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "hatchling==1.33.0"],
        cwd=root / "home", env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if reached.returncode:
        pytest.skip("no index of packages is reached")
    python = f"{sys.base_prefix}/bin/python{sys.version_info[0]}.{sys.version_info[1]}"
    ran = run_step(action, INSTALL, hostile, root / "temp", environment, python=python)
    assert (ran.status, ran.errors) == (0, "")
    return Runner(root / "temp", environment)


@pytest.mark.timeout(400)
@pytest.mark.parametrize("untrusted", ["true", "false"])
def test_a_fresh_runner_annotates_a_repository_and_runs_none_of_its_code(
    action: dict[str, Any], runner: Runner, hostile: Path, tmp_path: Path, untrusted: str
) -> None:
    build_checkpoint(None, "00", tmp_path / "starter.usda")
    ran = run_step(
        action, CHECK, hostile, runner.temp, runner.environment,
        paths="work", untrusted=untrusted, starter=str(tmp_path / "starter.usda"),
    )  # fmt: skip
    found = re.findall(r"^::error file=(.+?),line=\d+.*title=(P\w+)", ran.printed, re.MULTILINE)
    assert (ran.status, ran.outputs, found) == (
        1, "status=1\n", [("work/Lab3_01_ros_clock.usda", "P01")],
    )  # fmt: skip
    assert "Lab3_01_ros_clock.usda" in ran.summary
    assert not (hostile / "ran").exists(), (hostile / "ran").read_text()


def test_every_step_of_the_action_is_run_here(action: dict[str, Any]) -> None:
    assert [*steps(action)] == [INSTALL, CHECK]


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
