"""`lab3 check` as a person and a script meet it: paths, exit statuses, what is written where."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import forking
import pytest
from breaking import the_lab
from in_process import lab3
from pxr import Usd
from report_examples import assert_valid

from lab3_usd import build_checkpoint
from lab3_usd.files import write_whole

CLOCK = "Lab3_01_ros_clock.usda"
TOPIC = "/World/ROS_Clock/ros2_publish_clock.inputs:topicName"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A correct checkpoint 01."""
    return build_checkpoint(None, "01", tmp_path_factory.mktemp("built") / CLOCK)


@pytest.fixture
def clock(built: Path, tmp_path: Path) -> Path:
    """A correct checkpoint 01 of this test's own."""
    return Path(shutil.copy(built, tmp_path / CLOCK))


@pytest.fixture
def wrong(clock: Path) -> Path:
    """The same with another topic."""
    stage = Usd.Stage.Open(str(clock))
    stage.GetAttributeAtPath(TOPIC).Set("/other")
    stage.Save()
    return clock


def check(*arguments: object) -> subprocess.CompletedProcess[str]:
    return lab3("check", *arguments)


def check_alone(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Check in a process of its own."""
    command = [sys.executable, "-m", "lab3_usd", "check", *map(str, arguments)]
    return forking.run(command, check=False, capture_output=True, text=True)


def report_of(*arguments: object) -> dict[str, object]:
    report = json.loads(check(*arguments, "--format", "json").stdout)
    assert_valid(report)
    return report


def test_a_fault_is_exit_status_1(wrong: Path) -> None:
    done = check_alone(wrong)
    assert done.returncode == 1
    assert "P01" in done.stdout


def test_exit_zero_says_all_the_same(wrong: Path) -> None:
    done = check(wrong, "--exit-zero")
    assert done.returncode == 0
    assert "P01" in done.stdout


def test_warnings_fail_only_where_they_are_asked_to(clock: Path) -> None:
    stage = Usd.Stage.Open(str(clock))
    stage.GetAttributeAtPath(
        "/World/ROS_Clock/isaac_read_simulation_time.inputs:referenceTimeNumerator"
    ).Set(3)
    stage.Save()
    assert check(clock).returncode == 0
    assert check(clock, "--fail-on", "warning").returncode == 1


def test_rules_are_chosen_by_id_name_and_family(wrong: Path) -> None:
    assert check(wrong, "--select", "W").returncode == 0
    assert check(wrong, "--ignore", "p01").returncode == 0
    assert check(wrong, "--select", "P01,W").returncode == 1
    assert check(wrong, "--select", "wrong-value").returncode == 1


def test_the_checkpoint_may_be_given_for_any_name(clock: Path, tmp_path: Path) -> None:
    other = Path(shutil.copy(clock, tmp_path / "mine.usda"))
    assert check(other).returncode == 2
    assert check(other, "--checkpoint", "1").returncode == 0


@pytest.mark.parametrize(
    "arguments",
    [("nowhere.usda",), (), ("--checkpoint", "77", "."), ("--format", "other", ".")],
    ids=["no such path", "no path", "no such checkpoint", "no such format"],
)
def test_wrong_usage_is_exit_status_2_in_one_line(arguments: tuple[str, ...]) -> None:
    done = check(*arguments)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("content", [b"", b"#usda 1.0\n\0", b"#usda 1.0\n\xff", b"PXR-USDC"])
@pytest.mark.parametrize("name", [CLOCK, "Lab3_01_ros_clock.uda"])
def test_what_cannot_be_read_is_a_result(tmp_path: Path, name: str, content: bytes) -> None:
    broken = tmp_path / name
    broken.write_bytes(content)
    report = report_of(broken)
    (result,) = report["results"]
    assert (result["verdict"], result["path"]) == ("unreadable", str(broken))
    assert [each["severity"] for each in result["findings"]] == ["error"]
    assert check(broken).returncode == 1


@pytest.mark.parametrize("choice", [("--select", "W"), ("--ignore", "F01")])
def test_no_choice_of_rules_passes_what_cannot_be_read(
    tmp_path: Path, choice: tuple[str, str]
) -> None:
    broken = tmp_path / CLOCK
    broken.write_bytes(b"no stage")
    assert check(broken, *choice).returncode == 1


def test_json_comes_with_every_exit_status(wrong: Path, clock: Path) -> None:
    assert report_of(wrong)["summary"]["errors"] == 1
    assert report_of("nowhere")["error"]["kind"] == "usage"
    assert report_of(clock, "--checkpoint", "xx")["error"]["kind"] == "usage"


def test_results_come_in_the_order_given(clock: Path, tmp_path: Path) -> None:
    start = build_checkpoint(None, "00", tmp_path / "Lab3_00_student_start.usda")
    report = report_of(clock, start, clock)
    assert [each["path"] for each in report["results"]] == [str(clock), str(start), str(clock)]


def test_a_folder_of_other_names_is_its_stages(clock: Path, tmp_path: Path) -> None:
    folder = tmp_path / "stages"
    folder.mkdir()
    for name in ("b.usda", "a.usda"):
        shutil.copy(clock, folder / name)
    report = report_of(folder, "--checkpoint", "01")
    assert [Path(each["path"]).name for each in report["results"]] == ["a.usda", "b.usda"]


def test_the_report_is_written_to_a_file(wrong: Path, tmp_path: Path) -> None:
    output = tmp_path / "report.json"
    done = check(wrong, "--format", "json", "--output", output)
    assert done.stderr == f"lab3: the report is in {output}\n"
    assert (done.returncode, done.stdout) == (1, "")
    assert_valid(json.loads(output.read_text()))


@pytest.mark.skipif(sys.platform == "win32", reason="has no such files")
def test_the_report_goes_into_a_pipe_which_stays_one(wrong: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "report"
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as reader:
        told = reader.submit(pipe.read_text)
        assert check(wrong, "--format", "json", "--output", pipe).returncode == 1
        assert_valid(json.loads(told.result(timeout=60)))
    assert pipe.is_fifo()


@pytest.mark.skipif(sys.platform == "win32", reason="has no such files")
def test_what_lies_among_devices_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    """Root could put a file in the place of /dev/stdout, for everybody."""
    output = tmp_path / "stdout"
    output.write_text("before")
    number = output.stat().st_ino
    with output.open("ab") as held:
        write_whole(Path(f"/dev/fd/{held.fileno()}"), b"written", force=True)
    assert (output.stat().st_ino, output.read_bytes()) == (number, b"written")


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="has no such folder")  # noqa: S108
def test_what_is_held_in_memory_is_a_file_as_any() -> None:
    with TemporaryDirectory(dir="/dev/shm") as folder:
        output = Path(folder) / "report"
        output.write_text("before")
        with output.open("rb"):  # or its number could be given to the next
            number = output.stat().st_ino
            write_whole(output, b"replaced", force=True)
            assert output.stat().st_ino != number


def test_the_report_never_replaces_what_is_checked(clock: Path, tmp_path: Path) -> None:
    before = clock.read_bytes()
    link = tmp_path / "report.txt"
    link.symlink_to(clock)
    for output in (clock, link, tmp_path / "new.usda"):
        assert check(clock, "--output", output).returncode == 2
    assert clock.read_bytes() == before
    assert not (tmp_path / "new.usda").exists()


def test_the_report_never_replaces_the_starter_or_a_file_of_a_folder(
    clock: Path, tmp_path: Path
) -> None:
    starter = build_checkpoint(None, "00", tmp_path / "starter" / "starter.usda")
    notes = clock.parent / "results.txt"
    notes.write_text("what the student saved")
    assert check(clock, "--starter", starter, "--output", starter).returncode == 2
    assert check(clock.parent, "--checkpoint", "01", "--output", notes).returncode == 2
    assert notes.read_text() == "what the student saved"


def test_two_runs_give_the_same_bytes(wrong: Path) -> None:
    asked = (wrong, "--format", "json")
    alone, here = check_alone(*asked), check(*asked)
    assert (alone.returncode, alone.stdout) == (here.returncode, here.stdout)
    assert here.returncode == 1


@pytest.fixture(scope="module")
def handed_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two correct stages."""
    folder = tmp_path_factory.mktemp("handed_in")
    for number, name in (("00", "Lab3_00_student_start"), ("01", "Lab3_01_ros_clock")):
        build_checkpoint(None, number, folder / f"{name}.usda")
    return folder


def test_what_is_missing_counts_in_no_folder_in_work(handed_in: Path) -> None:
    result = lab3("check", handed_in)
    assert (result.returncode, result.stdout.count("the stage of checkpoint")) == (0, 0)


@pytest.mark.parametrize(
    "options", [("--submission",), ("--require-evidence",), ("--format", "gradescope")]
)
def test_what_is_missing_counts_in_a_folder_that_is_handed_in(
    handed_in: Path, options: tuple[str, ...]
) -> None:
    result = lab3("check", handed_in, *options)
    missing = len(the_lab().checkpoints) - len([*handed_in.iterdir()])
    assert (result.returncode, result.stdout.count("the stage of checkpoint")) == (1, missing)


def test_what_is_ignored_is_left_out_of_a_submission(handed_in: Path) -> None:
    result = lab3("check", handed_in, "--submission", "--ignore", "X")
    assert "the stage of checkpoint" not in result.stdout


def test_a_gradescope_result_has_the_points_of_grading(handed_in: Path) -> None:
    results = json.loads(lab3("check", handed_in, "--format", "gradescope").stdout)
    assert sum(test.get("max_score", 0.0) for test in results["tests"]) == 100.0
    assert results["score"] == sum(test.get("score", 0.0) for test in results["tests"]) == 15.0


@pytest.mark.parametrize("kind", ["zip", "gztar"])
def test_of_an_archive_is_said_what_reads_it(tmp_path: Path, kind: str) -> None:
    (tmp_path / "work").mkdir()
    archive = shutil.make_archive(str(tmp_path / "jane"), kind, tmp_path / "work")
    said = check(archive).stderr
    assert f"{archive}: is an archive; lab3 check --untrusted --starter FILE judges it" in said


def test_what_only_has_the_name_of_an_archive_is_none(tmp_path: Path) -> None:
    (tmp_path / "jane.zip").write_text("mine")
    assert "the name gives no checkpoint" in check(tmp_path / "jane.zip").stderr
