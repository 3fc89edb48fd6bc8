"""A dry run, a run of any stage and a recording as text, JSON and page, against golden files."""

from __future__ import annotations

import re

import other_labs
import pytest
from golden import assert_golden_text
from html_pages import in_lines
from msgspec.structs import replace

from lab3_usd.model.dry_run import (
    Behaviour,
    Check,
    Difference,
    Driven,
    Frame,
    Leg,
    Moment,
    Replay,
    Topic,
    Unknown,
)
from lab3_usd.model.finding import Finding
from lab3_usd.model.occupancy import MapFit, OccupancyMap
from lab3_usd.report.behaviour import page, text
from lab3_usd.report.options import tool_version

ODOM, SCAN, CLOCK = "/odom", "/scan", "/clock"
STUB = "/World/ROS_Clock/ros2_publish_clock"
FIT = MapFit(
    OccupancyMap("a.pgm", 0.5, (-1.0, -1.0, 0.0), 4, 4, frozenset({(0, 0), (1, 0), (3, 3)})),
    count=2,
    near=0.5,
    through=0.25,
    ends=((-0.7, -0.7, True), (0.6, 0.1, False)),
    shift=(0.1, -0.2),
    shifted=0.75,
)
PLAYED = Behaviour(
    stage="Lab3_01.usda",
    checkpoint="01",
    seconds=9.0,
    verdict="bad",
    topics=(
        Topic(CLOCK, "rosgraph_msgs/msg/Clock", 60.0, ""),
        Topic(ODOM, "nav_msgs/msg/Odometry", 59.96, "odom"),
        Topic("/tf_static", "tf2_msgs/msg/TFMessage", 0.0, ""),
    ),
    frames=(Frame("odom", "base_footprint", static=False), Frame("base_link", "scan", static=True)),
    checks=(
        Check("topics", "ok"),
        Check("clock", "bad", "/clock runs 0.0 s in 9.0 s", STUB, "wrong-clock-rate", "it is off"),
        Check("scan", "not judged", "nothing on /scan"),
        Check("camera", "not judged", "nobody knows what it shows", "/World/Camera"),
    ),
    path=((0.0, 1.8, 0.0, 0.0), (9.0, 2.1, 0.1, 0.5)),
    not_simulated=(Unknown("/World/gate", "its type is not known"),),
    legs=(
        Leg("ahead", 2.0, (0.3, 0.0), (0.29, 1.0)),
        Leg("arc", 2.0, (0.3, 45.0), (0.31, 44.0)),
        Leg("rest", 1.0, (0.0, 0.0), (0.01, 0.0)),
    ),
    remarks=("the floor is even",),
    missing="an asset of /World/chair was not found",
    fit=FIT,
)
ANY = replace(
    PLAYED,
    checkpoint="",
    verdict="ok",
    topics=(replace(PLAYED.topics[0], domain=0), replace(PLAYED.topics[1], domain=7)),
    checks=(Check("follows", "ok", of="/World/Rover"),),
    legs=(),
    robots=(Driven("/World/Rover", "/cmd_vel", 7),),
    fit=replace(FIT, shift=None),
    missing="",
)
RECORDED = replace(
    PLAYED,
    recording="run.mcap",
    topics=(
        Topic(ODOM, "nav_msgs/msg/Odometry", 60.0, "odom", 30.0, ("reliable", "reliable", "best")),
        Topic(SCAN, "sensor_msgs/msg/LaserScan", 5.0, "base_scan", 5.0, ()),
    ),
    legs=(),
    differences=(Difference(SCAN, "comes at 5 Hz, not 10"),),
)
FINDINGS = (Finding("W01", "missing-wire", "error", STUB, "not connected", hint="connect it"),)
BEHAVIOURS = {
    "played": PLAYED,
    "any-stage": ANY,
    "recorded": RECORDED,
    "like-the-dry-run": replace(RECORDED, differences=(), checks=()),
    "unreadable": Behaviour(
        "a.usda", "", 0.0, "unreadable", not_simulated=(Unknown("", "it is damaged"),)
    ),
}
REPLAY = Replay(
    walls=((0.0, 0.0, 3.0, 0.0),),
    radius=0.1,
    moments=(
        Moment(0.0, "ahead", (1.8, 0.0, 0.0)),
        Moment(4.5, "ahead", (2.5, 0.0, 0.0), (0.7, 0.0, 0.0), ((3.0, 0.1),)),
        Moment(9.0, "arc", (2.1, 0.1, 0.5), (0.3, 0.1, 0.5), ((3.0, 0.0), (3.0, 0.2))),
    ),
    computed={STUB: 640},
    fit=FIT,
)


@pytest.mark.parametrize("name", BEHAVIOURS)
def test_a_behaviour_is_told_as_it_was(name: str) -> None:
    behaviour = BEHAVIOURS[name]
    document = text.render_json(behaviour, FINDINGS).replace(tool_version(), "VERSION")
    wide = text.render(behaviour, 80, FINDINGS, color=False)
    shown = "\n".join((wide, text.render(behaviour, 48, color=True), document))
    assert_golden_text(f"behaviour/{name}.txt", shown)


def test_a_page_of_a_dry_run_is_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = other_labs.stage("01")
    monkeypatch.chdir(stage.parent)
    shown = page.render(replace(PLAYED, stage=stage.name), {"": REPLAY}, other_labs.LAB, FINDINGS)
    assert_golden_text("behaviour/page.html", in_lines(shown))


def test_a_report_shows_one_moment_of_a_dry_run() -> None:
    summary = page.dry_run_summary(PLAYED, {"": REPLAY})
    assert summary is not None
    assert [check.name for check in summary.wrong] == ["clock", "scan", "camera"]
    for drawing in (summary.plays[0].room, summary.plays[0].near):
        assert re.findall(r'data-moment="(\d+)"', drawing) == ["1"]  # the furthest
