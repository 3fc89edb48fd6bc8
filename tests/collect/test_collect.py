"""The script that collects evidence, run with commands that only pretend to be ROS 2's."""

from __future__ import annotations

import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from grade_files import read_evidence
from in_process import invoke
from msgspec.structs import replace
from ros_outputs import EDGES, fake_ros2, frames_gv, good_outputs

from lab3_usd.deliverables.evidence.saved_outputs import MANIFEST
from lab3_usd.errors import UsageError
from lab3_usd.features.collect.script import collect_script
from lab3_usd.model.folder import GoalRun
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab

LAB = load_lab()
ROS = LAB.ros
FILES = [command.file for command in ROS.commands]
ASKED = {"node_list.txt", "topic_hz_clock.txt", "view_frames.txt"}
SHORT = replace(LAB, ros=replace(ROS, commands=tuple(c for c in ROS.commands if c.file in ASKED)))


def run_script(
    folder: Path, *options: str, outputs: dict[str, str] | None = None, lab: Lab = SHORT
) -> subprocess.CompletedProcess[str]:
    """Run the script in `folder`, where `bin` may hold a `ros2`; `outputs` is what one prints."""
    script = folder / "collect.sh"
    script.write_text(collect_script(lab))
    if outputs is not None:
        fake_ros2(folder / "bin", outputs)
    # A computer that has ROS must not answer in the place of the fake.
    real = [each for each in os.get_exec_path() if not (Path(each) / "ros2").exists()]
    path = os.pathsep.join([str(folder / "bin"), *real])
    return subprocess.run(
        ["bash", str(script), *options],  # noqa: S607 - bash is where the user has it
        cwd=folder,
        env={"PATH": path, "HOME": str(folder), "ROS_DISTRO": "humble"},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def put(folder: Path, program: str, *lines: str) -> None:
    """Write a program that the script finds before any other of its name."""
    fake = folder / "bin" / program
    fake.parent.mkdir(exist_ok=True)
    fake.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    fake.chmod(0o755)


def manifest(folder: Path) -> dict[str, list[str]]:
    lines = (folder / "results" / MANIFEST).read_text().splitlines()
    return {line.split("\t")[0]: line.split("\t")[1:] for line in lines[1:]}


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("collected")
    assert run_script(folder, outputs=good_outputs(), lab=LAB).returncode == 0
    return folder


def test_every_command_has_its_file(collected: Path) -> None:
    assert [file for file in FILES if not (collected / "results" / file).is_file()] == []


def test_every_command_has_its_line_in_the_manifest(collected: Path) -> None:
    lines = manifest(collected)
    assert [c.line for c in ROS.commands if lines[c.file][3] != c.line] == []
    assert {line[0] for line in lines.values()} <= {"0", "1"}


def test_every_output_opens_with_its_command(collected: Path) -> None:
    for command in ROS.commands:
        text = (collected / "results" / command.file).read_text()
        assert text.splitlines()[0] == f"$ {command.line}"


def test_what_the_script_saves_is_understood(collected: Path) -> None:
    evidence = read_evidence(collected / "results", root=collected)
    asked = [c for c in ROS.commands if not c.extra]
    assert [c.file for c in asked if c.target not in getattr(evidence, c.kind.name)] == []


def test_without_ros_every_command_is_missing_and_nothing_is_shown(tmp_path: Path) -> None:
    assert run_script(tmp_path).returncode == 0
    lines = manifest(tmp_path)
    assert {lines[file][0] for file in ASKED} == {"127"}
    evidence = read_evidence(tmp_path / "results")
    assert [c.file for c in ROS.commands if getattr(evidence, c.kind.name)] == []


def test_a_failing_command_stops_no_other(tmp_path: Path) -> None:
    outputs = good_outputs()
    del outputs["ros2 node list"]
    assert run_script(tmp_path, outputs=outputs).returncode == 0
    lines = manifest(tmp_path)
    assert lines["node_list.txt"][0] == "1"
    assert lines["view_frames.txt"][0] == "0"


def test_a_command_that_hangs_is_ended(tmp_path: Path) -> None:
    hangs = 'case "$*" in "topic hz /clock") echo "average rate: 1.0"; sleep 60;; esac'
    put(tmp_path, "ros2", hangs)
    assert run_script(tmp_path, "--limit", "1").returncode == 0
    assert manifest(tmp_path)["topic_hz_clock.txt"][0] == "124"
    assert read_evidence(tmp_path / "results").topic_hz["/clock"][0].fact == pytest.approx(1.0)


@pytest.mark.parametrize(("options", "most"), [([], 60), (["--limit", "9"], 9)])
def test_every_command_has_its_limit(tmp_path: Path, options: list[str], most: int) -> None:
    put(tmp_path, "ros2", "exit 0")
    put(tmp_path, "timeout", "shift 2", "limit=$1", "shift", 'echo "$limit $*" >>"$HOME/limits"')
    assert run_script(tmp_path, *options).returncode == 0
    limits = (tmp_path / "limits").read_text().splitlines()
    wanted = [f"{min(c.kind.seconds, most)} {c.line}" for c in SHORT.ros.commands]
    assert [line for line in limits if " ros2 " in line][1:] == wanted


def test_the_graph_is_asked_after_the_daemon_was_started(tmp_path: Path) -> None:
    put(tmp_path, "ros2", 'echo "$*" >>"$HOME/asked"')
    assert run_script(tmp_path).returncode == 0
    assert (tmp_path / "asked").read_text().splitlines()[0] == "daemon start"


def test_a_daemon_that_was_just_started_gets_time(tmp_path: Path) -> None:
    put(tmp_path, "ros2", 'case "$*" in "daemon start") echo "The daemon has been started";; esac')
    put(tmp_path, "sleep", 'echo "$*" >>"$HOME/slept"')
    assert run_script(tmp_path).returncode == 0
    assert (tmp_path / "slept").read_text() == "5\n"


def test_another_shell_is_told_to_use_bash(tmp_path: Path) -> None:
    dash = shutil.which("dash")
    if not dash:
        pytest.skip("dash is not installed")
    script = tmp_path / "collect.sh"
    script.write_text(collect_script(LAB))
    done = subprocess.run([dash, script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "bash collect.sh" in done.stderr
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == [script]


def test_drawn_frames_get_a_fixed_name(tmp_path: Path) -> None:
    (tmp_path / "tree.gv").write_text(frames_gv(*EDGES))
    copy = f"cp {tmp_path}/tree.gv frames_2026-11-20_10.00.00.gv"
    put(tmp_path, "ros2", f'case "$*" in *view_frames) {copy};; esac')
    run_script(tmp_path)
    assert (tmp_path / "results" / "frames.gv").read_text() == frames_gv(*EDGES)
    assert list(tmp_path.glob("frames*")) == []


def goals(*states: tuple[int, int]) -> str:
    """Echo a GoalStatusArray of goals, each an id and a status."""
    return "status_list:\n" + "".join(
        f"- goal_info:\n    goal_id:\n      uuid:\n      - {number}\n      - 7\n"
        f"    stamp:\n      sec: 3\n  status: {status}\n"
        for number, status in states
    )


def watch(folder: Path, *looks: str, seconds: int = 20, pause: str = "0") -> list[GoalRun]:
    """Run the script with `--goal`; each look at the status shows the next text, then the last."""
    for number, text in enumerate(looks):
        (folder / f"look{number}").write_text(text)
    put(
        folder,
        "ros2",
        'case "$*" in *_action/status*) ;; *) exit;; esac',
        f"n=$(cat {folder}/count 2>/dev/null || echo 0); echo $((n + 1)) >{folder}/count",
        f"if [ $n -ge {len(looks)} ]; then n={len(looks) - 1}; fi; cat {folder}/look$n",
    )
    put(folder, "sleep", f"exec /bin/sleep {pause}")
    assert run_script(folder, "--goal", str(seconds)).returncode == 0
    found = read_evidence(folder / "results").goals.get("", ())
    return [shown.fact for shown in found if shown.file == "goal.txt"]


def test_a_recording_is_made_where_it_is_asked_for(tmp_path: Path) -> None:
    put(tmp_path, "ros2", 'echo "$*" >>"$HOME/asked"')
    old = tmp_path / "results" / "recording"
    old.mkdir(parents=True)
    assert run_script(tmp_path).returncode == 0
    assert "bag record" not in (tmp_path / "asked").read_text()
    assert run_script(tmp_path, "--bag", "7", "--limit", "9").returncode == 0
    recorded = [line for line in (tmp_path / "asked").read_text().splitlines() if "bag" in line]
    assert recorded == [
        f"bag record --all --include-hidden-topics --exclude /camera/image_raw --output {old}"
    ]
    assert (
        not old.exists()
    )  # ros2 bag record makes the folder itself, and refuses one that is there
    assert manifest(tmp_path)["recording.txt"][0] == "0"


def test_a_recording_ends_as_by_ctrl_c(tmp_path: Path) -> None:
    # `timeout` tells the process and then its group, so that it may be told twice.
    ends = "trap 'echo ended >\"$HOME/asked\"; exit 0' INT; sleep 30 & wait"
    put(tmp_path, "ros2", f'case "$*" in "bag record"*) {ends};; esac')
    assert run_script(tmp_path, "--bag", "1", "--limit", "2").returncode == 0
    assert (tmp_path / "asked").read_text() == "ended\n"
    assert manifest(tmp_path)["recording.txt"][0] == "124"


def test_what_describes_a_recording_is_no_output_of_a_command(tmp_path: Path) -> None:
    (tmp_path / "results" / "recording").mkdir(parents=True)
    text = (
        "rosbag2_bagfile_information:\n  version: 5\n  topics_with_message_count:\n"
        "    - topic_metadata:\n        name: /odom\n        type: nav_msgs/msg/Odometry\n"
    )
    (tmp_path / "results" / "recording" / "metadata.yaml").write_text(text)
    (tmp_path / "results" / "recording.txt").write_text(
        "$ ros2 bag record --all\n[INFO] [1.2] [rosbag2_recorder]: Subscribed to topic '/odom'\n"
    )
    evidence = read_evidence(tmp_path / "results", root=tmp_path)
    assert [c.file for c in ROS.commands if getattr(evidence, c.kind.name)] == []


OLD = (1, 4)


@pytest.mark.parametrize(
    ("looks", "status"),
    [
        (["status_list: []\n", goals((2, 2)), goals((2, 4))], 4),
        ([goals(OLD), goals(OLD, (2, 2)), goals(OLD, (2, 6))], 6),
        # The old one leaves the list while the new one is in it.
        ([goals(OLD), goals(OLD, (2, 1)), goals((2, 4))], 4),
        ([goals(OLD), goals(OLD, (2, 5))], 5),
    ],
)
def test_a_goal_is_watched_until_it_ends(tmp_path: Path, looks: list[str], status: int) -> None:
    (measured,) = watch(tmp_path, *looks)
    assert measured.status == status
    assert int((tmp_path / "count").read_text()) == len(looks)


def test_the_time_of_a_goal_is_measured(tmp_path: Path) -> None:
    (measured,) = watch(tmp_path, goals(), goals((2, 2)), goals((2, 4)))
    assert measured.seconds is not None


def test_an_old_goal_is_not_shown_as_a_new_one(tmp_path: Path) -> None:
    def told(name: str, old: str) -> bool:
        folder = tmp_path / name
        folder.mkdir()
        assert watch(folder, old, seconds=1, pause="1") == []
        return "no new goal" in (folder / "results" / "goal.txt").read_text()

    with ThreadPoolExecutor() as pool:  # each waits for a second
        assert [*pool.map(told, ["none", "old"], ["", goals((1, 2), (3, 6))])] == [True, True]


def test_a_spec_without_a_tree_to_draw_draws_none() -> None:
    commands = tuple(c for c in ROS.commands if c.kind.name != "view_frames")
    assert "record_frames" in collect_script(LAB)
    assert "record_frames" not in collect_script(replace(LAB, ros=replace(ROS, commands=commands)))


@pytest.mark.parametrize(
    "options", [["--goal"], ["--bag", "-1"], ["--limit", "soon"], ["somewhere"]]
)
def test_options_that_make_no_sense_are_refused(tmp_path: Path, options: list[str]) -> None:
    done = run_script(tmp_path, *options)
    assert done.returncode == 2
    assert "usage:" in done.stderr


def test_the_command_writes_a_script_that_can_be_run(tmp_path: Path) -> None:
    script = tmp_path / "collect.sh"
    done = invoke("collect", "-o", script)
    assert (done.exit_code, script.read_text()) == (0, collect_script(LAB))
    assert os.access(script, os.X_OK)


def test_the_command_replaces_nothing_unasked(tmp_path: Path) -> None:
    script = tmp_path / "collect.sh"
    script.write_text("mine")
    with pytest.raises(UsageError):
        invoke("collect", "-o", script)
    assert script.read_text() == "mine"


def test_a_lab_without_a_goal_says_so(tmp_path: Path, repository: Path) -> None:
    lab = load_lab(repository / "docs" / "examples" / "labs" / "jetbot")
    script = tmp_path / "collect.sh"
    for options in (["--goal", "5"], ["--goal"]):
        done = run_script(tmp_path, *options, lab=lab)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == "collect.sh: Week 5 has no navigation goal to wait for\n"
    assert "goal" not in script.read_text().replace("navigation goal", "").replace("--goal)", "")
    assert "results=output\n" in script.read_text()
    assert list(tmp_path.iterdir()) == [script]


def test_a_course_without_commands_records_without_driving() -> None:
    topics = {name: replace(topic, subscribed=False) for name, topic in ROS.topics.items()}
    still = replace(ROS, topics=topics, navigation=None)
    assert "drive the robot now" in collect_script(LAB)
    assert "drive the robot now" not in collect_script(replace(LAB, ros=still))
