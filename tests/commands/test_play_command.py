"""`lab3 record`: its script calls stand-ins for Isaac Sim's modules as those of 6.0.1 want it.

The names and signatures of the stand-ins are those of the public source, v6.0.1:
isaacsim.simulation_app/simulation_app.py, isaacsim.core.experimental.utils/python/impl/app.py and
stage.py, standalone_examples/api/isaacsim.ros2.bridge/carter_stereo.py.
"""

from __future__ import annotations

import os
import runpy
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from in_process import invoke
from places import REPOSITORY

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import UsageError
from lab3_usd.sim.execution.drive import RATE, command_frames, fixed_drive
from lab3_usd.spec.load.loader import load_lab

LONGEST, WIDEST = 64, 100  # lines, characters
START = subprocess.Popen
LABS = REPOSITORY / "docs" / "examples" / "labs"
TOPICS = ("/r1/cmd_vel", "/r2/cmd_vel")


class IsaacSim:
    """Stand-ins for what the script imports; `calls` is what it called, in order.

    A recorder listens after three updates, or ends (`recorder_ends`); a stage opens or does not.
    """

    def __init__(self, *, opens: bool = True, recorder_ends: bool = False) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.sent: list[dict[str, list[tuple[int, tuple[float, float, float]]]]] = []  # by Play
        self.recorders: list[SimpleNamespace] = []
        self.playing = False
        self.frame = 0
        self.opens, self.recorder_ends = opens, recorder_ends

    def call(self, name: str) -> Callable[..., None]:
        return lambda *words, **named: self.calls.append((name, *words, *named.items()))

    # isaacsim, isaacsim.core.experimental.utils
    def update(self) -> None:
        self.frame += self.playing
        for recorder in self.recorders:
            recorder.updates += 1

    def update_app(
        self, *, steps: int = 1, callback: Callable[[int, int], bool | None] | None = None
    ) -> None:
        for step in range(steps):
            self.update()
            if callback is not None and callback(step + 1, steps) is False:
                break

    def play(self, *, commit: bool | None = True) -> None:
        assert commit
        self.calls.append(("play", os.environ["ROS_DOMAIN_ID"]))
        self.playing, self.frame = True, 0
        self.sent.append({})

    def stop(self, *, commit: bool | None = True) -> None:
        assert commit
        self.calls.append(("stop", self.frame))
        self.playing = False

    def open_stage(self, usd_path: str) -> tuple[bool, object]:
        self.calls.append(("open", usd_path))
        return self.opens, None

    # rclpy, subprocess
    def publisher(self, kind: object, topic: str, depth: int) -> SimpleNamespace:
        def publish(message: SimpleNamespace) -> None:
            told = (message.linear.x, message.linear.y, message.angular.z)
            self.sent[-1].setdefault(topic, []).append((self.frame, told))

        self.calls.append(("publisher", kind, topic, depth))
        return SimpleNamespace(publish=publish, get_subscription_count=self.listening)

    def listening(self) -> int:
        return sum(recorder.updates > 3 and recorder.ended is None for recorder in self.recorders)

    def popen(self, words: list[str]) -> SimpleNamespace:
        recorder = SimpleNamespace(words=words, updates=0, ended=1 if self.recorder_ends else None)

        def end(number: int) -> None:
            recorder.ended = number

        recorder.poll = lambda: recorder.ended
        recorder.wait = lambda: recorder.ended
        recorder.send_signal = end
        self.recorders.append(recorder)
        return recorder

    def modules(self) -> Iterator[tuple[str, dict[str, Any]]]:
        vector = lambda: SimpleNamespace(x=0.0, y=0.0, z=0.0)  # noqa: E731 - a stand-in
        node = SimpleNamespace(create_publisher=self.publisher)
        timeline = SimpleNamespace(set_end_time=self.call("end"))
        utils = "isaacsim.core.experimental.utils"
        yield (
            "isaacsim",
            {
                "SimulationApp": lambda config: (
                    self.calls.append(("app", config))
                    or SimpleNamespace(update=self.update, close=self.call("close"))
                )
            },
        )
        yield "isaacsim.core", {}
        yield "isaacsim.core.experimental", {}
        yield utils, {}
        yield (
            f"{utils}.app",
            {
                "enable_extension": self.call("enable"),
                "update_app": self.update_app,
                "play": self.play,
                "stop": self.stop,
            },
        )
        yield f"{utils}.stage", {"open_stage": self.open_stage, "is_stage_loading": lambda: False}
        yield "omni", {}
        yield "omni.timeline", {"get_timeline_interface": lambda: timeline}
        yield "rclpy", {"init": self.call("init"), "create_node": lambda _: node}
        yield "geometry_msgs", {}
        twist = lambda: SimpleNamespace(linear=vector(), angular=vector())  # noqa: E731
        yield "geometry_msgs.msg", {"Twist": twist}


def written(folder: Path, *options: str) -> Path:
    script = folder / "play.py"
    done = invoke("record", "-o", script, *options)
    assert (done.exit_code, done.stdout.strip()) == (0, str(script))
    return script


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[IsaacSim], None]:
    """Run the script with stand-ins, as fast as they are."""

    def runs(isaac: IsaacSim) -> None:
        for name, attributes in isaac.modules():
            module = ModuleType(name)
            module.__dict__.update(attributes)
            monkeypatch.setitem(sys.modules, name, module)
            parent, _, last = name.rpartition(".")
            if parent:
                monkeypatch.setattr(sys.modules[parent], last, module, raising=False)
        monkeypatch.setattr(subprocess, "Popen", isaac.popen)
        monkeypatch.setattr(time, "sleep", lambda _: None)
        monkeypatch.setenv("ROS_DOMAIN_ID", "")
        monkeypatch.setattr(sys, "argv", ["play.py", "stages", "my bags"])
        runpy.run_path(str(written(tmp_path)))

    return runs


def called(isaac: IsaacSim, name: str) -> list[Any]:
    return [words[0] if len(words) == 1 else words for each, *words in isaac.calls if each == name]


def test_it_plays_each_stage_of_the_lab_without_a_window(
    run: Callable[[IsaacSim], None],
) -> None:
    isaac = IsaacSim()
    run(isaac)
    files = [checkpoint.file for checkpoint in load_lab().checkpoints.values()]
    assert called(isaac, "open") == [str(Path("stages", f"{name}.usda")) for name in files]
    assert called(isaac, "app") == [{"headless": True}]
    assert called(isaac, "enable") == ["isaacsim.ros2.bridge"]
    assert called(isaac, "end") == [1e6] * len(files)
    assert isaac.calls[-1] == ("close",)


def test_it_drives_each_as_a_dry_run_does(run: Callable[[IsaacSim], None]) -> None:
    isaac = IsaacSim()
    run(isaac)
    lab, drive = load_lab(), fixed_drive()
    wanted = [
        {"/cmd_vel": [(frame, leg.command) for frame, leg in command_frames(each)]}
        for each in drive
    ]
    assert isaac.sent == wanted * len(lab.checkpoints)
    frames = [sum(round(leg.seconds * RATE) for leg in each.legs) for each in drive]
    assert called(isaac, "stop") == frames * len(lab.checkpoints)
    assert called(isaac, "play") == [each.environment or "0" for each in drive] * len(
        lab.checkpoints
    )
    assert [words[1:] for words in called(isaac, "publisher")] == [["/cmd_vel", 10]]
    assert called(isaac, "init") == [("domain_id", lab.ros.system.domain)]


def test_each_robot_of_a_fleet_is_driven_by_its_own_commands_and_limits(
    run: Callable[[IsaacSim], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(LAB_VARIABLE, str(LABS / "warehouse"))
    isaac = IsaacSim()
    run(isaac)
    fastest = [
        {topic: max(ahead for _, (ahead, *_) in told) for topic, told in sent.items()}
        for sent in isaac.sent
    ]
    # Twice the handout's 1.2 and 0.4 m/s, at least 1 m/s; then 0.15 after another Play.
    limits, again = {"/r1/cmd_vel": 2.4, "/r2/cmd_vel": 1.0}, dict.fromkeys(TOPICS, 0.15)
    assert fastest == [limits, again, again] * 7


def test_it_records_a_bag_of_each_play_and_ends_it_as_ctrl_c_does(
    run: Callable[[IsaacSim], None],
) -> None:
    isaac = IsaacSim()
    run(isaac)
    names = [checkpoint.file for checkpoint in load_lab().checkpoints.values()]
    bags = [shlex.split(recorder.words[-1], comments=True)[-1] for recorder in isaac.recorders]
    endings = ("", "-again", "-domain")
    assert bags == [str(Path("my bags", f"{name}{end}")) for name in names for end in endings]
    assert {recorder.ended for recorder in isaac.recorders} == {signal.SIGINT}


def test_the_recorder_is_run_without_isaac_sims_own_python(
    run: Callable[[IsaacSim], None], tmp_path: Path
) -> None:
    isaac = IsaacSim()
    run(isaac)
    (tmp_path / "ros2").write_text('#!/bin/sh\necho "$PYTHONPATH|$ROS_DOMAIN_ID|$@"\n')
    (tmp_path / "ros2").chmod(0o755)
    (tmp_path / "setup.bash").write_text(f"PATH={shlex.quote(str(tmp_path))}:$PATH\n")
    setup = load_lab().ros.system.setup
    *bash, line = isaac.recorders[2].words
    assert setup in line
    environment = {"PYTHONPATH": "isaac", "ROS_DOMAIN_ID": "7", "PATH": os.environ["PATH"]}
    real = line.replace(setup, shlex.quote(str(tmp_path / "setup.bash")))
    with START([*bash, real], env=environment, stdout=subprocess.PIPE, text=True) as recorder:
        printed, _ = recorder.communicate()
    bag = Path("my bags", "Lab3_00_student_start-domain")
    assert printed == f"|0|bag record --all --output {bag}\n"


def test_a_recorder_that_ends_is_said_before_anything_plays(
    run: Callable[[IsaacSim], None],
) -> None:
    isaac = IsaacSim(recorder_ends=True)
    with pytest.raises(AssertionError, match="ros2 bag record does not record"):
        run(isaac)
    assert called(isaac, "play") == []


def test_a_stage_that_does_not_open_is_named(run: Callable[[IsaacSim], None]) -> None:
    isaac = IsaacSim(opens=False)
    with pytest.raises(AssertionError, match="Lab3_00_student_start"):
        run(isaac)
    assert isaac.recorders == []


def test_the_script_is_short_and_says_that_it_was_not_run(tmp_path: Path) -> None:
    lines = written(tmp_path).read_text(encoding="utf-8").splitlines()
    assert len(lines) <= LONGEST
    assert max(map(len, lines)) <= WIDEST
    assert "NOT RUN IN ISAAC SIM" in lines[1]


def test_a_script_that_exists_is_kept(tmp_path: Path) -> None:
    script = written(tmp_path)
    script.write_text("mine")
    with pytest.raises(UsageError):
        invoke("record", "-o", script)
    assert script.read_text() == "mine"
    written(tmp_path, "--force")
    assert script.read_text() != "mine"


def test_another_lab_has_its_own_stages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jetbot = LABS / "jetbot"
    monkeypatch.setenv(LAB_VARIABLE, str(jetbot))
    text = written(tmp_path).read_text(encoding="utf-8")
    assert "Plays Week 5 " in text
    files = [checkpoint.file for checkpoint in load_lab(jetbot).checkpoints.values()]
    stages = text.partition('STAGES = """')[2].partition('"""')[0]
    assert stages.replace("\\", "").split() == files
    assert "Lab3_" not in text
