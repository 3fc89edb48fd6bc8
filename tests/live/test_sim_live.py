"""A dry run that others hear and drive: other processes, and another vendor's DDS."""

from __future__ import annotations

import itertools
import json
import math
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from breaking import broken, correct_stage, the_lab
from dry_runs import EXPECTED, driven
from foreign_robots import BARE, arm, car_and_arm, rover, with_three_graphs
from in_process import invoke
from msgspec.structs import replace
from places import REPOSITORY
from pxr import Sdf, Usd

from lab3_usd.errors import UsageError
from lab3_usd.features.live.sim_live import closing_lines
from lab3_usd.isaac.topics import JOINT_STATES, STEERING
from lab3_usd.model.dry_run import Scene
from lab3_usd.model.qos import Qos as Offered
from lab3_usd.sim.execution.recording import JointStates, Message, Steering, Transform
from lab3_usd.sim.execution.world import STATIC
from lab3_usd.sim.robots import expected_of, robots_of
from lab3_usd.sim.ros_messages import serialized
from lab3_usd.sim.timeline import Player, player_of
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

pytest.importorskip("cyclonedds", reason="the extra lab3-usd[live] is not installed")
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from lab3_usd.features.live import dds as link_module
from lab3_usd.features.live.dds import DdsLink, play_live, wire_type

TRIED = itertools.count()
PEERS = Path(__file__).parent / "live_peer"
PATIENCE = 300.0  # seconds, of a machine that stands still now and then
TF = "tf2_msgs/msg/TFMessage"
TWIST = "geometry_msgs/msg/Twist"
WIRE_NAMES = {
    "rosgraph_msgs/msg/Clock": "rosgraph_msgs::msg::dds_::Clock_",
    "nav_msgs/msg/Odometry": "nav_msgs::msg::dds_::Odometry_",
    "sensor_msgs/msg/LaserScan": "sensor_msgs::msg::dds_::LaserScan_",
    "sensor_msgs/msg/CameraInfo": "sensor_msgs::msg::dds_::CameraInfo_",
    TF: "tf2_msgs::msg::dds_::TFMessage_",
}


@pytest.fixture
def domain() -> Iterator[int]:
    """A domain that no other test on this machine is in: a port of TCP is its lock."""
    for _ in range(100):
        number = 10 + next(TRIED) % 90
        with socket.socket() as lock:
            try:
                lock.bind(("127.0.0.1", 7400 + 250 * number))
            except OSError:
                continue
            lock.listen()
            yield number
            return
    pytest.skip("no loopback interface, or no free domain")


@pytest.fixture
def link(domain: int) -> Iterator[DdsLink]:
    with closing(DdsLink(domain)) as link:
        yield link


@pytest.fixture(scope="module")
def scene() -> Scene:
    return read_scene(correct_stage("05"), load_platform())


@pytest.fixture
def player(scene: Scene) -> Player:
    return player_of(scene, the_lab().platform, EXPECTED)


@pytest.fixture(scope="module")
def fast_dds() -> Path:
    """A program of another vendor's DDS, compiled here and kept until it or the DDS changes."""
    source, headers = PEERS / "peer.cpp", Path("/usr/include/fastrtps")
    compiler = shutil.which("g++")
    if compiler is None or not headers.is_dir():
        pytest.skip("Fast DDS is not here (Debian: libfastrtps-dev g++)")
    made_of = [path.read_bytes() for path in (source, Path(__file__))]
    installed = str((headers / "Domain.h").stat().st_mtime_ns).encode()  # dated as its package
    digest = sha256(b"".join([*made_of, installed])).hexdigest()
    kept = REPOSITORY / ".pytest_cache" / f"fast_dds_{digest[:16]}"
    if kept.exists():
        return kept
    kept.parent.mkdir(exist_ok=True)
    with TemporaryDirectory(dir=kept.parent) as beside:
        made = Path(beside) / "peer"
        done = subprocess.run(
            (compiler, "-O0", "-o", made, source, "-lfastrtps", "-lfastcdr"),
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE,
        )
        assert done.returncode == 0, done.stderr
        made.replace(kept)
    return kept


def driven_by(program: list[str], player: Player, link: DdsLink) -> dict[str, Any]:
    """Play until a program that drives the robot ends, and return what it says it heard."""
    latest = time.monotonic() + PATIENCE
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as peer:
        try:
            play_live(player, link, lambda _: peer.poll() is not None or time.monotonic() > latest)
        finally:
            peer.kill()
        printed, complaint = peer.communicate()
    assert peer.returncode == 0, complaint
    heard: dict[str, Any] = json.loads(printed)
    return heard


def until(ready: Callable[[], list[Any]]) -> list[Any]:
    """Ask until something comes."""
    latest = time.monotonic() + PATIENCE
    while time.monotonic() < latest:
        found = ready()
        if found:
            return found
        time.sleep(0.01)
    pytest.fail("nothing came")


def test_another_program_hears_and_drives_it(player: Player, link: DdsLink, domain: int) -> None:
    heard = driven_by([sys.executable, str(PEERS / "peer.py"), str(domain)], player, link)
    assert heard["times"] == sorted(heard["times"])
    assert (heard["frame"], heard["child"]) == ("odom", "base_footprint")
    assert ["odom", "base_footprint"] in heard["frames"]
    assert heard["x"] >= 0.1
    assert player.robot is not None
    x, y, _ = player.robot.posture().base.origin
    assert x - 1.8 >= heard["x"] - 1e-6
    assert y == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("made", BARE)
def test_it_drives_a_robot_to_which_three_commands_gave_its_graphs(
    made: str, tmp_path: Path, link: DdsLink, domain: int
) -> None:
    stage = Usd.Stage.Open(str(with_three_graphs(BARE[made](tmp_path))))
    scene, platform = read_scene(stage, load_platform()), load_platform()
    (robot,) = robots_of(scene, platform)
    player = player_of(scene, platform, replace(expected_of(robot), domain=0))
    heard = driven_by([sys.executable, str(PEERS / "peer.py"), str(domain)], player, link)
    assert heard["x"] >= 0.1


def test_so_does_a_program_of_another_vendor(
    player: Player, link: DdsLink, domain: int, fast_dds: Path
) -> None:
    heard = driven_by([str(fast_dds), str(domain)], player, link)
    assert heard["clocks"] > 0
    assert heard["rays"] == 360
    assert (heard["frame"], heard["child"]) == ("odom", "base_footprint")
    assert player.robot is not None
    assert player.robot.posture().base.origin[0] - 1.8 >= heard["x"] - 1e-6 >= 0.1 - 1e-6


def test_so_does_ros_2_itself(tmp_path: Path) -> None:
    ros = shutil.which("ros2")
    if ros is None:
        pytest.skip("ROS 2 is not here: source its setup.bash")
    python = Path(ros).read_text(encoding="utf-8").splitlines()[0].removeprefix("#!").split()[0]
    stage = tmp_path / "Lab3_05.usda"
    made: Usd.Stage = correct_stage("05")
    made.GetRootLayer().Export(str(stage))
    script = REPOSITORY / "benchmarks" / "hear_with_ros.py"
    lab3 = Path(sys.executable).with_name("lab3")
    done = subprocess.run(
        [python, str(script), "--lab3", str(lab3), str(stage)],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
    )
    if done.stdout.startswith("skipped"):
        pytest.skip(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "/odom moved by" in done.stdout


def test_without_a_command_it_stands(player: Player, link: DdsLink) -> None:
    played, _ = play_live(player, link, lambda frames: frames >= 30)
    assert (played, player.world.network.count) == (0.5, 0)
    assert {kind for _, kind, _ in link.sent} == set(WIRE_NAMES)
    assert player.robot is not None
    assert player.robot.posture().base.origin[:2] == pytest.approx((1.8, 0.0), abs=1e-6)
    assert player.world.network.sent == []


def test_types_and_bytes_on_the_wire_are_those_of_humble() -> None:
    known = {name: wire_type(name) for name in WIRE_NAMES}
    assert {
        name: kind.__idl_typename__.replace(".", "::") for name, kind in known.items()
    } == WIRE_NAMES
    seen = set()
    for message in driven(correct_stage("05")).recording.messages:
        data = None if message.type in seen else serialized(message)
        if data is not None:
            seen.add(message.type)
            made = known[message.type].deserialize(data)
            assert made.serialize(use_version_2=False) == data
    assert seen == set(WIRE_NAMES)


def test_static_transforms_are_there_for_those_who_come_late(link: DdsLink) -> None:
    still = Transform("base_link", "base_scan", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0))
    for node, topic, static in (
        ("/a", "/tf_static", True),
        ("/b", "/tf_static", True),
        ("/c", "/tf", False),
    ):
        profile = STATIC if static else Offered()
        message = Message(TF, 1.0, data=(still,), topic=topic, node=node, profile=profile)
        link.publish(message)
    late = Qos(
        Policy.Reliability.Reliable(0), Policy.Durability.TransientLocal, Policy.History.KeepAll
    )
    there = link._in(link.home)
    static_reader = DataReader(there, Topic(there, "rt/tf_static", wire_type(TF)), qos=late)
    found = until(lambda: [*static_reader.read(N=10)] if len(static_reader.read(N=10)) > 1 else [])
    assert [each.transforms[0].child_frame_id for each in found] == ["base_scan", "base_scan"]
    plain = Qos(Policy.Reliability.Reliable(0))
    assert DataReader(there, Topic(there, "rt/tf", wire_type(TF)), qos=plain).read() == []


def test_what_is_not_reliable_is_not_heard_by_those_who_want_it_so(link: DdsLink) -> None:
    there = link._in(link.home)
    topic = Topic(there, "rt/tf", wire_type(TF))
    reliable = DataReader(there, topic, qos=Qos(Policy.Reliability.Reliable(0)))
    either = DataReader(there, topic, qos=Qos(Policy.Reliability.BestEffort))
    offered = Offered(reliability="best_effort")

    def sent_again() -> list[Any]:
        link.publish(Message(TF, 1.0, data=(), topic="/tf", node="/a", profile=offered))
        return [*either.take(N=10)]

    assert until(sent_again)
    assert reliable.take(N=10) == []


def test_what_is_no_number_is_no_command(link: DdsLink) -> None:
    assert link.listen(link.home, "/cmd_vel", TWIST)
    there, twist = link._in(link.home), wire_type(TWIST)
    vector = wire_type("geometry_msgs/msg/Vector3")
    writer = DataWriter(
        there,
        Topic(there, "rt/cmd_vel", twist),
        qos=Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepAll),
    )
    for ahead in (math.nan, math.inf, 1e300, 0.1):
        writer.write(twist(vector(ahead, 0.0, 0.0), vector(0.0, 0.0, 0.2)))
    numbers = ((0.1, 0.0, 0.0), (0.0, 0.0, 0.2))
    assert until(lambda: [*link.commands()]) == [(link.home, "/cmd_vel", numbers)]


def test_a_domain_that_has_no_ports_is_said() -> None:
    with pytest.raises(UsageError, match="DDS does not start in domain 233"):
        DdsLink(233)


def test_what_is_in_another_domain_is_sent_there(link: DdsLink) -> None:
    other = link.home + 90
    stage = broken("01", [{"set": ["ROS_Clock/ros2_context.inputs:domain_id", other]}])
    player = player_of(read_scene(stage, load_platform()), the_lab().platform, EXPECTED)
    play_live(player, link, lambda frames: frames >= 3)
    assert [*link.sent] == [("/clock", "rosgraph_msgs/msg/Clock", other)]


def test_a_domain_that_dds_does_not_have_is_said(link: DdsLink) -> None:
    stage = broken("01", [{"set": ["ROS_Clock/ros2_context.inputs:domain_id", 250]}])
    player = player_of(read_scene(stage, load_platform()), the_lab().platform, EXPECTED)
    times = play_live(player, link, lambda frames: frames >= 3)
    assert not link.sent
    failed = "failed: /World/ROS_Clock/ros2_publish_clock: ROS 2 has no domain 250"
    assert failed in [*closing_lines(player, link, *times)]


def test_ctrl_c_ends_it_with_its_sum(player: Player, link: DdsLink) -> None:
    def interrupted(frames: int) -> bool:
        if frames == 3:
            raise KeyboardInterrupt
        return False

    assert play_live(player, link, interrupted)[0] == pytest.approx(0.05)


@pytest.mark.parametrize(("took", "slow"), [(1.0, False), (2.0, True)])
def test_a_computer_that_does_not_keep_up_is_told(
    player: Player,
    link: DdsLink,
    took: float,
    slow: bool,  # noqa: FBT001
) -> None:
    *_, said = closing_lines(player, link, 1.0, took)
    assert ("at 0.50 times real time" in said) is slow


def test_what_is_left_out_and_lost_is_told(player: Player, link: DdsLink) -> None:
    link.sent[("/clock", "Clock", 0)] = 60
    link.lost, link.refused[7] = 2, "no ports"
    player.world.network.count = 3
    player.world.not_simulated["/World/x"] = "unknown"
    assert [line for line in closing_lines(player, link, 1.0, 1.0) if line] == [
        "/clock               Clock                       60 sent",
        "not sent or heard: what is in domain 7: DDS does not start there: no ports",
        "not simulated: /World/x: unknown",
        "2 messages were lost, because a subscriber does not keep up",
        "1.0 s played; 3 commands received",
    ]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "Lab3_05.usda"
    stage: Usd.Stage = correct_stage("05")
    stage.GetRootLayer().Export(str(path))
    return path


def sim(path: Path, *words: str) -> Any:
    return invoke("sim", path, *words)


def test_the_command_says_what_it_sent(
    path: Path, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link_module, "DdsLink", lambda _: DdsLink(domain))
    done = sim(path, "--live", "--seconds", "0.5")
    assert done.exit_code == 0
    first, second, third, *_, last = done.stdout.splitlines()
    assert "not Isaac Sim" in first
    assert second == "live on 127.0.0.1; Ctrl-C ends"
    assert third == f"listens to /cmd_vel ({TWIST}) in domain {domain}"
    assert "/clock               rosgraph_msgs/msg/Clock     29 sent" in done.stdout
    assert last.startswith("0.5 s played")


def sender(link: DdsLink, domain: int, topic: str, kind: str, data: Any) -> Callable[[], None]:
    """What another program sends again and again."""
    there, made = link._in(domain), wire_type(kind)
    reliable = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(10))
    writer = DataWriter(there, Topic(there, f"rt{topic}", made), qos=reliable)
    return lambda: writer.write(made.deserialize(serialized(Message(kind, 0.0, data=data))))


def test_every_command_of_every_robot_is_heard(link: DdsLink) -> None:
    there = link.home + 90
    scene, platform = read_scene(car_and_arm(there), load_platform()), load_platform()
    robots = robots_of(scene, platform)
    player = player_of(scene, platform, replace(expected_of(robots[0]), domain=0))
    send_car = sender(link, link.home, "/drive", STEERING, Steering(0.5, 0.1))
    send_arm = sender(
        link, there, "/joint_command", JOINT_STATES, JointStates(("elbow_joint",), (0.4,))
    )
    machine = player.world.machines.articulation("/arm")
    assert machine is not None
    assert player.robot is not None
    driven, elbow = player.robot, machine.joints["elbow_joint"]
    opened: list[tuple[str, str, int]] = []

    def moved(_: int) -> bool:
        send_car()
        send_arm()
        is_late = time.monotonic() > latest
        return is_late or (driven.posture().base.origin[0] > 0.1 and elbow.position > 0.3)

    latest = time.monotonic() + PATIENCE
    play_live(player, link, moved, lambda *subscriber: opened.append(subscriber))
    assert sorted(opened) == [
        ("/drive", STEERING, link.home),
        ("/joint_command", JOINT_STATES, there),
    ]
    assert driven.posture().base.origin[0] > 0.1
    assert elbow.position == pytest.approx(0.4, abs=0.1)


@pytest.mark.parametrize(
    ("made", "commands"),
    [(rover, f"/cmd_vel ({TWIST})"), (arm, f"/joint_command ({JOINT_STATES})")],
)
def test_a_stage_of_no_checkpoint_is_driven_by_its_own_commands(
    made: Callable[[], Usd.Stage], commands: str, tmp_path: Path, domain: int
) -> None:
    stage = made()
    for prim in stage.Traverse():
        if prim.GetAttribute("node:type").Get() == "isaacsim.ros2.bridge.ROS2Context":
            prim.CreateAttribute("inputs:domain_id", Sdf.ValueTypeNames.UChar).Set(domain)
            prim.CreateAttribute("inputs:useDomainIDEnvVar", Sdf.ValueTypeNames.Bool).Set(0)
    stage.GetRootLayer().Export(str(tmp_path / "robot.usda"))
    done = sim(tmp_path / "robot.usda", "--live", "--seconds", "0.1")
    assert f"listens to {commands} in domain {domain}" in done.stdout


@pytest.mark.parametrize(
    "words",
    [
        ["--seconds", "1"],
        ["--live", "--seconds", "0"],
        ["--live", "--seconds", "nan"],
        ["--live", "--drive", "0.1,0,1"],
        ["--live", "--page", "x.html"],
        ["--live", "--bag", "x"],
        ["--live", "--format", "json"],
    ],
    ids=" ".join,
)
def test_what_does_not_go_together_is_wrong_use(path: Path, words: list[str]) -> None:
    with pytest.raises(UsageError):
        sim(path, *words)


def test_without_the_extra_a_line_says_what_to_install(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(UsageError, match=r"needs the extra live: .* install"):
        sim(path, "--live")
