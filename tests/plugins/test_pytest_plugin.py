"""`pytest --lab3`: the requirements of a checkpoint as tests."""

from __future__ import annotations

import os
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from foreign_robots import rover
from in_process import invoke
from layerings import behind_a_missing_robot
from places import REPOSITORY
from pxr import Sdf, Usd

from lab3_usd import build_checkpoint, check_stage
from lab3_usd.check.registry import all_rules
from lab3_usd.data import LAB_VARIABLE
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import BuildOptions, build_files

pytest_plugins = ["pytester"]
# Where the package is installed, pytest loads the plugin by itself, and refuses to do so twice.
INSTALLED = "lab3" in {point.name for point in entry_points(group="pytest11")}
PLUGIN = () if INSTALLED else ("-p", "lab3_usd.pytest_plugin")
# In each of these runs, others import all of Hypothesis and of trio anew, and search for garbage.
WITHOUT = ["hypothesispytest", "anyio", "xdist", "xdist.looponfail", "pytest_cov", "timeout"]
OTHERS = ("--assert=plain", *(f"-pno:{name}" for name in [*WITHOUT, "unraisableexception"]))


@pytest.fixture
def clock(tmp_path: Path) -> Path:
    """A correct checkpoint 01."""
    return build_checkpoint(None, "01", tmp_path / "work" / "Lab3_01_ros_clock.usda")


def run(pytester: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    """Run pytest with the plugin, whether or not it is installed as one."""
    return pytester.runpytest_inprocess(*PLUGIN, *OTHERS, *arguments)


def test_every_requirement_is_a_test(pytester: pytest.Pytester, clock: Path) -> None:
    asked = check_stage(clock).requirements
    run(pytester, "--lab3", str(clock)).assert_outcomes(passed=len(asked) + 1)


def test_an_unmet_requirement_fails_and_says_why(pytester: pytest.Pytester, clock: Path) -> None:
    stage = Usd.Stage.Open(str(clock))
    stage.GetAttributeAtPath("/World/ROS_Clock/ros2_publish_clock.inputs:topicName").Set("/other")
    stage.Save()
    result = run(pytester, "--lab3", str(clock))
    result.assert_outcomes(passed=len(check_stage(clock).requirements) - 1, failed=2)
    result.stdout.fnmatch_lines(["*P01*inputs:topicName is '/other', expected '/clock'*"])


def test_a_robot_that_is_missing_is_no_pass(pytester: pytest.Pytester, tmp_path: Path) -> None:
    path = tmp_path / "Lab3_02_ros_drive.usda"
    stage = behind_a_missing_robot("02")
    stage.GetRootLayer().Export(str(path))
    result = run(pytester, "--lab3", str(path))
    result.assert_outcomes(passed=len(check_stage(path).requirements), failed=1)
    result.stdout.fnmatch_lines(["*not judged: *./turtlebot3_burger.usd*"])


def test_a_folder_gives_the_tests_of_all_its_stages(pytester: pytest.Pytester, clock: Path) -> None:
    build_checkpoint(None, "00", clock.parent / "Lab3_00_student_start.usda")
    (clock.parent / "notes.usda").write_text("#usda 1.0\n")
    result = run(pytester, "--lab3", str(clock.parent), "--collect-only", "-q")
    files = {line.partition("::")[0].rpartition("/")[2] for line in result.outlines if "::" in line}
    assert files == {"Lab3_00_student_start.usda", "Lab3_01_ros_clock.usda"}


def test_a_course_keeps_its_own_tests_beside_it(pytester: pytest.Pytester, clock: Path) -> None:
    pytester.makepyfile(test_own="def test_own():\n    pass\n")
    asked = check_stage(clock).requirements
    result = run(pytester, str(pytester.path), "--lab3", str(clock))
    result.assert_outcomes(passed=len(asked) + 2)


def test_stages_are_left_alone_without_the_option(pytester: pytest.Pytester) -> None:
    build_checkpoint(None, "01", pytester.path / "Lab3_01_ros_clock.usda")
    pytester.makepyfile(test_own="def test_own():\n    pass\n")
    run(pytester).assert_outcomes(passed=1)


def test_an_unreadable_stage_fails(pytester: pytest.Pytester, tmp_path: Path) -> None:
    broken = tmp_path / "Lab3_01_broken.usda"
    broken.write_bytes(b"#usda 1.0\n\0")
    result = run(pytester, "--lab3", str(broken))
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*NUL byte*"])


def test_a_path_that_does_not_exist_is_wrong_usage(pytester: pytest.Pytester) -> None:
    result = run(pytester, "--lab3", "nowhere")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*nowhere: there is no such file or folder*"])


def test_any_stage_is_one_test_of_the_linter(pytester: pytest.Pytester, tmp_path: Path) -> None:
    stage = rover()
    stage.GetRootLayer().Export(str(tmp_path / "right.usda"))
    stage.GetAttributeAtPath("/World/Clock/clock.inputs:execIn").ClearConnections()
    stage.GetRootLayer().Export(str(tmp_path / "carter.usda"))
    result = run(pytester, "--lab3-lint", str(tmp_path))
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["*K01 /World/Clock/clock*"])


def test_the_lab_of_the_configuration_is_the_one_that_judges(
    pytester: pytest.Pytester, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(LAB_VARIABLE, raising=False)
    folder = REPOSITORY / "docs" / "examples" / "labs" / "jetbot"
    lab = load_lab(folder)
    (path,) = build_files(
        lab, None, {tmp_path / "Week5_2_clock.usda": lab.checkpoints["2"]}, BuildOptions()
    )
    (tmp_path / "lab3.toml").write_text(f'lab = "{folder}"\n')
    asked = check_stage(path, lab=lab).requirements
    run(pytester, "--lab3", str(tmp_path)).assert_outcomes(passed=len(asked) + 1)
    assert LAB_VARIABLE not in os.environ


@pytest.fixture
def shouting(tmp_path: Path) -> Path:
    """A robot with a topic that the example of rules of one's own is about, and the rule."""
    stage = rover()
    node = stage.GetPrimAtPath("/World/Odometry/odometry")
    node.CreateAttribute("inputs:topicName", Sdf.ValueTypeNames.String).Set("Odom")
    stage.GetRootLayer().Export(str(tmp_path / "robot.usda"))
    example = REPOSITORY / "docs" / "examples" / "own_rules"
    text = (example / "acme_rules.py").read_text().replace("ACME01", "ACME07")
    (tmp_path / "acme_rules.py").write_text(text.replace('severity="warning"', 'severity="error"'))
    (tmp_path / "lab3.toml").write_text('rules = ["acme_rules.py"]\n')
    return tmp_path


def test_rules_of_ones_own_judge_if_their_configuration_is_named(
    pytester: pytest.Pytester, shouting: Path
) -> None:
    options = ("--lab3-config", str(shouting / "lab3.toml"), "--lab3-lint", str(shouting))
    result = run(pytester, *options)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*ACME07 /World/Odometry/odometry*inputs:topicName is 'Odom'*"])
    assert "ACME07" not in all_rules()


def test_rules_of_ones_own_judge_beside_their_tests(
    pytester: pytest.Pytester, shouting: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(shouting)
    (shouting / "test_acme.py").write_text("import acme_rules\n\ndef test_them(): ...\n")
    options = ("--lab3-config", str(shouting / "lab3.toml"), str(shouting / "test_acme.py"))
    run(pytester, *options, "--lab3-lint", str(shouting / "robot.usda")).assert_outcomes(
        passed=1, failed=1
    )


def test_a_file_of_rules_beside_the_stages_does_not_run(
    pytester: pytest.Pytester, shouting: Path
) -> None:
    (shouting / "acme_rules.py").write_text("raise SystemExit('it ran')\n")
    result = run(pytester, "--lab3-lint", str(shouting))
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*would run as a program*with --lab3-config */lab3.toml*"])


def test_an_installed_package_brings_rules_to_both_options(
    pytester: pytest.Pytester, shouting: Path, clock: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = shouting / "packages" / "acme-1.0.dist-info"
    info.mkdir(parents=True)
    text = (shouting / "acme_rules.py").read_text().replace("ACME07", "ACME08")
    (info.parent / "acme_in_pytest.py").write_text(text.replace("topic != topic.lower()", "True"))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lab3_usd.rules]\nacme8 = acme_in_pytest\n")
    monkeypatch.syspath_prepend(info.parent)
    (shouting / "lab3.toml").write_text('rules = ["acme8"]\n')
    result = run(pytester, "--lab3-lint", str(shouting / "robot.usda"), "--lab3", str(clock))
    result.assert_outcomes(passed=len(check_stage(clock).requirements), failed=2)
    result.stdout.fnmatch_lines(["*ACME08 /World/ROS_Clock/ros2_publish_clock*"])


def test_what_the_configuration_or_a_note_ignores_fails_no_test(
    pytester: pytest.Pytester, tmp_path: Path
) -> None:
    stage = rover()
    stage.GetAttributeAtPath("/World/Clock/clock.inputs:execIn").ClearConnections()
    stage.GetRootLayer().Export(str(tmp_path / "robot.usda"))
    run(pytester, "--lab3-lint", str(tmp_path)).assert_outcomes(failed=1)
    (tmp_path / "lab3.toml").write_text('ignore = ["K01", "K47"]\n')
    run(pytester, "--lab3-lint", str(tmp_path)).assert_outcomes(passed=1)
    (tmp_path / "lab3.toml").unlink()
    stage.GetPrimAtPath("/World/Clock/clock").SetCustomDataByKey("lab3:ignore", "K01")
    stage.GetRootLayer().Export(str(tmp_path / "robot.usda"))
    run(pytester, "--lab3-lint", str(tmp_path)).assert_outcomes(passed=1)


def test_a_baseline_accepts_findings_and_what_could_not_be_judged(
    pytester: pytest.Pytester, tmp_path: Path
) -> None:
    stages = tmp_path / "stages"
    stages.mkdir()
    stage = rover()
    stage.GetAttributeAtPath("/World/Clock/clock.inputs:execIn").ClearConnections()
    stage.GetRootLayer().Export(str(stages / "robot.usda"))
    behind_a_missing_robot("05").GetRootLayer().Export(str(stages / "Lab3_05_odometry_tf.usda"))
    known = tmp_path / "known.json"
    invoke("lint", "--write-baseline", known, stages)
    accepted = ("--lab3-baseline", str(known), "--lab3-lint", str(stages))
    run(pytester, *accepted).assert_outcomes(passed=2)
    stage.GetPrimAtPath("/World/Odometry/odometry").GetAttribute("inputs:execIn").ClearConnections()
    stage.GetRootLayer().Export(str(stages / "robot.usda"))
    result = run(pytester, *accepted)
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["*K01 /World/Odometry/odometry*"])
    assert "/World/Clock/clock" not in result.stdout.str()
