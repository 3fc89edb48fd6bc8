"""Each kind of fault that a recording shows is that of its check."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, get_args

import pytest
from breaking import the_lab
from fault_stages import BY_HAND, STAGES
from golden import assert_golden
from msgspec.structs import replace

pytest.importorskip("rosbags", reason="the extra lab3-usd[sim] is not installed")

from recordings import Sent, aimed, durable, faster, in_laser, keep, on, recorded, rewritten, tied

from lab3_usd.model.dry_run import Check
from lab3_usd.model.fault import FaultKind
from lab3_usd.sim.bag.judge import judge_recording

Verdicts = Callable[[FaultKind], tuple[Check, ...]]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("recording"))


def offered(topic: str, change: Callable[[Any], Any]) -> Callable[[Sent], Iterator[Sent]]:
    return lambda sent: iter([replace(sent, qos=change(sent.qos)) if sent.topic == topic else sent])


def askew(said: Any) -> None:
    said.pose.pose.position.y += 0.5 * said.pose.pose.position.x


def in_whole_seconds(said: Any) -> None:
    said.header.stamp.nanosec = 0


def at_zero(said: Any) -> None:
    said.clock.sec = said.clock.nanosec = 0


def own_parent(said: Any) -> None:
    for transform in said.transforms:
        if transform.child_frame_id == "base_scan":
            transform.header.frame_id = "base_scan"


def without_the_second(said: Any) -> None:
    if said.transforms[0].header.stamp.sec == 1:
        said.transforms = [e for e in said.transforms if e.child_frame_id != "base_scan"]


def late_clock(sent: Sent) -> Iterator[Sent]:
    if sent.topic == "/clock" and sent.time > 1_500_000_000:
        sent.said.clock.sec -= 2
    yield sent


def unreadable(sent: Sent) -> Iterator[Sent]:
    yield replace(sent, held=b"\0\1\0\0abc") if sent.topic == "/odom" else sent


def scanned_once(sent: Sent) -> Iterator[Sent]:
    if sent.topic != "/scan" or 3e8 <= sent.time < 4e8:
        yield sent


def in_map_and_world(sent: Sent) -> Iterator[Sent]:
    yield from tied(sent, "map")
    yield from [tie for tie in tied(sent, "world") if tie is not sent]


# How a recording shows a kind of fault, and in which check.
RECORDINGS: dict[FaultKind, tuple[Callable[[Sent], Iterator[Sent]], str]] = {
    "unreadable-message": (unreadable, "messages"),
    "wrong-durability": (offered("/scan", durable), "QoS"),
    "extra-publisher": (offered("/odom", lambda qos: qos * 2), "QoS"),
    "single-message": (scanned_once, "rates"),
    "stamp-not-advancing": (on("/scan", in_whole_seconds), "rates"),
    "wrong-header-frame": (on("/scan", in_laser), "headers"),
    "stopped-clock": (on("/clock", at_zero), "clock"),
    "clock-jumps-back": (late_clock, "clock"),
    "changing-parent": (in_map_and_world, "frames"),
    "transform-gap": (on("/tf", without_the_second), "frames"),
    "self-parent": (on("/tf", own_parent), "tree"),
    "sideways-drift": (on("/odom", askew), "follows"),
    "wrong-odometry-velocity": (on("/odom", faster), "odometry"),
    "no-localization": (keep, "localization"),
    "localization-ends": (lambda sent: tied(sent, "map", 0.3), "localization"),
    "no-goal-sent": (keep, "goal"),
    "goal-not-reached": (lambda sent: aimed(sent, 6), "goal"),
}


# What shows before the robot has driven anywhere.
AT_ONCE: frozenset[FaultKind] = frozenset(
    {
        "unreadable-message",
        "wrong-durability",
        "extra-publisher",
        "wrong-header-frame",
        "stopped-clock",
        "self-parent",
        "no-localization",
        "no-goal-sent",
    }
)
BRIEFLY = 1_200_000_000  # nanoseconds


@pytest.fixture(scope="module")
def checks_of(plain: Path, tmp_path_factory: pytest.TempPathFactory) -> Verdicts:
    """The verdicts of the recording that shows a kind of fault."""
    folder = tmp_path_factory.mktemp("faults")
    brief = rewritten(plain, folder / "brief", lambda sent: iter([sent] * (sent.time < BRIEFLY)))

    @cache
    def checks(kind: FaultKind) -> tuple[Check, ...]:
        whole = brief if kind in AT_ONCE else plain
        run = rewritten(whole, folder / kind, RECORDINGS[kind][0])
        return tuple(judge_recording(run, the_lab(), "08", whole=True).behaviour.checks)

    return checks


@pytest.mark.parametrize(("part", "kind"), [(0.3, "stamp-not-advancing"), (0.05, None)])
def test_stamps_may_stand_still_in_a_tenth_of_the_messages(
    plain: Path, tmp_path: Path, part: float, kind: str | None
) -> None:
    repeats = round(1 / part)
    count = iter(range(10**6))
    before: list[Any] = []

    def stand(sent: Sent) -> Iterator[Sent]:
        if sent.topic == "/scan":
            if before and next(count) % repeats == 0:
                sent.said.header.stamp = before[-1]
            before.append(sent.said.header.stamp)
        yield sent

    run = rewritten(plain, tmp_path / "run", stand)
    behaviour = judge_recording(run, the_lab(), "08", whole=True).behaviour
    assert {check.name: check.kind for check in behaviour.checks}["rates"] == kind


@pytest.mark.parametrize(("speed", "kind"), [(0.05, "stopped-clock"), (0.3, None)])
def test_a_clock_may_run_slowly(
    plain: Path, tmp_path: Path, speed: float, kind: str | None
) -> None:
    def slow(sent: Sent) -> Iterator[Sent]:
        if sent.topic == "/clock":
            now = sent.said.clock
            passed = round((now.sec * 10**9 + now.nanosec) * speed)
            now.sec, now.nanosec = divmod(passed, 10**9)
        yield sent

    run = rewritten(plain, tmp_path / "run", slow)
    behaviour = judge_recording(run, the_lab(), "08", whole=True).behaviour
    assert {check.name: check.kind for check in behaviour.checks}["clock"] == kind


@pytest.mark.parametrize("kind", RECORDINGS)
def test_a_recording_shows_its_kind_of_fault(checks_of: Verdicts, kind: FaultKind) -> None:
    assert {check.name: check.kind for check in checks_of(kind)}[RECORDINGS[kind][1]] == kind


def test_what_is_said_of_each_recording_is_as_it_was(checks_of: Verdicts) -> None:
    texts = {
        kind: "".join(
            f"{check.name}: {check.verdict} {check.kind or ''} {check.text}".rstrip() + "\n"
            for check in checks_of(kind)
            if check.verdict != "ok"
        )
        for kind in RECORDINGS
    }
    assert_golden("recorded-faults", texts)


def test_each_kind_is_shown_by_a_stage_or_a_recording() -> None:
    assert {*STAGES, *RECORDINGS, *BY_HAND} == {*get_args(FaultKind)}
