"""The page of a dry run: what it shows, that it is safe, and how it looks in a browser."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from breaking import broken, correct_stage, the_lab
from browser import CONTRASTS, DESKTOP, PHONE, Browser
from fault_stages import STAGES
from in_process import invoke
from machine import eventually

from lab3_usd.errors import UsageError
from lab3_usd.model.dry_run import Behaviour, Frame
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.report.behaviour.map_pictures import first_moment
from lab3_usd.report.behaviour.page import heard_edges, render, tree_lines
from lab3_usd.report.tf_tree import TreeReport
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.outcome import DryRun

BRIEF = "0.15,0,1"  # where it is of no importance how it drives
EVIL = "<script>window.attacked=1</script>"


def run_of(
    folder: Path, checkpoint: str, *steps: dict[str, object], drive: str | None = None
) -> DryRun:
    path = folder / f"Lab3_{checkpoint}.usda"
    broken(checkpoint, list(steps)).GetRootLayer().Export(str(path))
    return dry_run(path, the_lab(), checkpoint, drive)


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> DryRun:
    return run_of(tmp_path_factory.mktemp("right"), "05")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, right: DryRun) -> Path:
    path = tmp_path_factory.mktemp("page") / "sim.html"
    path.write_text(render(right.behaviour, right.replays, the_lab()), encoding="utf-8")
    return path


def test_the_command_writes_the_page(tmp_path: Path) -> None:
    stage = tmp_path / "Lab3_01.usda"
    correct_stage("01").GetRootLayer().Export(str(stage))
    invoke("sim", stage, "--page", tmp_path / "sim.html")
    text = (tmp_path / "sim.html").read_text(encoding="utf-8")
    assert "640 times" in text
    before = stage.read_bytes()
    with pytest.raises(UsageError, match="ending of a stage"):
        invoke("sim", stage, "--page", stage)
    assert stage.read_bytes() == before


def test_moments_have_the_robot_the_scan_and_odometry(right: DryRun) -> None:
    seen = right.replays[""]
    assert seen is not None
    first, last = seen.moments[0], seen.moments[-1]
    assert first.robot[:2] == pytest.approx((1.8, 0.0), abs=1e-3)
    assert last.odometry == pytest.approx(last.robot, abs=1e-6)
    ahead = max(x for x, y in first.points if abs(y) < 0.02)
    assert ahead == pytest.approx(2.35, abs=1e-3)  # the wall ahead, in the world
    assert seen.computed["/World/ROS_Clock/ros2_publish_clock"] == 640


def test_the_first_line_says_what_it_is(page: Path) -> None:
    body = page.read_text(encoding="utf-8").partition("<main>")[2]
    assert "dry run from published node source, not Isaac Sim" in body[:200]


def test_a_stage_without_robot_or_topics_has_a_page_as_well(tmp_path: Path) -> None:
    gone = run_of(tmp_path, "05", {"deactivate": "/turtlebot3_burger"}, drive=BRIEF)
    assert "Checks" in render(gone.behaviour, gone.replays, the_lab())
    (tmp_path / "none.usda").write_text("no stage")
    none = dry_run(tmp_path / "none.usda", the_lab(), "05")
    assert "unreadable" in render(none.behaviour, none.replays, the_lab())


def test_names_of_a_stage_are_no_markup(tmp_path: Path) -> None:
    frame = "ROS_OdomTF/ros2_publish_raw_transform_tree.inputs:childFrameId"
    found = run_of(tmp_path, "05", {"set": [frame, EVIL]}, drive=BRIEF)
    text = render(found.behaviour, found.replays, the_lab())
    assert EVIL not in text
    assert "&lt;script&gt;" in text


def test_a_failing_check_comes_first_and_leads_to_its_node(
    chromium: Browser, tmp_path: Path
) -> None:
    port = "ROS_OdomTF/ros2_publish_odometry.inputs:chassisFrameId"
    found = run_of(tmp_path, "05", {"set": [port, "base_link"]}, drive=BRIEF)
    failing = next(check for check in found.behaviour.checks if check.verdict == "bad")
    path = tmp_path / "sim.html"
    judged = check_stage(tmp_path / "Lab3_05.usda").findings
    path.write_text(render(found.behaviour, found.replays, the_lab(), judged), encoding="utf-8")
    chromium.open(path)
    first = chromium.one(".checks li")
    assert first.get_attribute("class") == "bad"
    assert first.find_elements("css selector", ".fix")
    chromium.run("for (const each of document.querySelectorAll('details')) each.open = false")
    link = first.find_element("css selector", ".cause a")
    assert link.text == failing.prim
    link.click()
    assert chromium.run(
        "const r = document.querySelector('.lab3 :target').getBoundingClientRect();"
        "return r.height > 0 && r.top >= 0 && r.bottom <= innerHeight"
    )


RADIUS = {"set": ["ROS_Drive/differential_controller.inputs:wheelRadius", 0.033]}


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> tuple[DryRun, Path]:
    """A stage whose robot goes less far than it should, and its page."""
    folder = tmp_path_factory.mktemp("slow")
    found = run_of(folder, "05", RADIUS)
    judged, page = check_stage(folder / "Lab3_05.usda").findings, folder / "sim.html"
    page.write_text(render(found.behaviour, found.replays, the_lab(), judged), encoding="utf-8")
    return found, page


def test_only_the_legs_that_are_wrong_are_marked(
    chromium: Browser, slow: tuple[DryRun, Path], page: Path
) -> None:
    chromium.look_at(page)
    assert chromium.all(".legs .bad") == []
    chromium.look_at(slow[1])
    legs = {leg.text.partition(":")[0]: leg for leg in chromium.all(".legs li")}
    marked = {name for name, leg in legs.items() if leg.get_attribute("class") == "bad"}
    assert marked == {"ahead", "back", "left", "fast", "spin"}
    assert "expected 0.40" in legs["ahead"].text


def test_the_repair_names_the_value_that_the_rules_ask_for(
    chromium: Browser, slow: tuple[DryRun, Path]
) -> None:
    chromium.look_at(slow[1])
    assert "set wheelRadius to 0.025" in chromium.one(".checks .bad .fix").text


def test_the_slider_starts_at_the_leg_that_is_wrong(
    chromium: Browser, slow: tuple[DryRun, Path]
) -> None:
    chromium.look_at(slow[1])
    assert chromium.one("output").text.endswith(", ahead")


def test_every_leg_of_a_robot_that_never_moves_is_wrong(tmp_path: Path) -> None:
    gone = run_of(tmp_path, "05", {"remove": "ROS_Drive/ros2_subscribe_twist"})
    assert [leg.name for leg in gone.behaviour.legs if leg.fault] == [
        leg.name for leg in gone.behaviour.legs if leg.name != "sideways"
    ]


def test_a_run_that_a_node_stops_has_drawings_until_then(tmp_path: Path) -> None:
    stage = correct_stage("05")
    STAGES["simulation-stopped"][0](stage)
    path = tmp_path / "Lab3_05.usda"
    stage.GetRootLayer().Export(str(path))
    (drawn,) = dry_run(path, the_lab(), "05", BRIEF).replays.values()
    assert drawn.moments
    assert drawn.speeds == ()


def test_the_slider_starts_where_odometry_leaves_the_robot(tmp_path: Path) -> None:
    port = "ROS_OdomTF/isaac_compute_odometry.inputs:chassisPrim"
    found = run_of(tmp_path, "05", {"targets": [port, "/turtlebot3_burger/wheel_left_link"]})
    seen = found.replays[""]
    assert seen is not None
    odometry = next(check for check in found.behaviour.checks if check.name == "odometry")
    assert odometry.verdict == "bad"
    moment = seen.moments[first_moment(found.behaviour, seen)]
    assert moment.odometry is not None
    assert math.dist(moment.odometry[:2], moment.robot[:2]) > 0.02


def test_a_node_at_fault_is_marked_and_leads_to_its_check(
    chromium: Browser, slow: tuple[DryRun, Path]
) -> None:
    chromium.open(slow[1])
    (frame,) = chromium.all(".faulty")
    assert frame.is_displayed()  # in a graph that is unfolded
    chromium.one(".lab3 a").click()
    assert chromium.one("li:target").get_attribute("class") == "bad"


def test_a_node_that_only_holds_a_value_is_not_said_to_run_never(page: Path) -> None:
    assert ">never<" not in page.read_text(encoding="utf-8")


def test_the_axes_are_outside_of_the_room_and_in_metres(chromium: Browser, page: Path) -> None:
    chromium.look_at(page)
    for name in (".room", ".near"):
        inside = chromium.run(
            "const room = document.querySelector(arguments[0]);"
            "const edge = room.querySelector('.edge').getBoundingClientRect();"
            "return [...room.querySelectorAll('text')].filter((text) => {"
            " const place = text.getBoundingClientRect();"
            " return place.left > edge.left && place.top < edge.bottom; }).length",
            name,
        )
        assert inside == 0
        texts = [text.text for text in chromium.all(f"{name} text")]
        assert {"x, m", "y, m"} <= set(texts)
        assert [float(text) for text in texts if "m" not in text]


def test_a_legend_names_what_is_drawn(chromium: Browser, page: Path) -> None:
    chromium.look_at(page)
    keys = [key.text.split("\n") for key in chromium.all(".key")]
    assert keys == [
        ["wall", "path", "robot", "scan"],
        ["start", "path", "robot", "odometry"],
        ["motion", "odometry", "command", "wheel_left_joint", "wheel_right_joint"],
    ]


def test_what_scrolls_is_reached_with_the_keyboard(chromium: Browser, page: Path) -> None:
    chromium.look_at(page, PHONE)
    assert (
        chromium.run(
            "return [...document.querySelectorAll('.scroll, pre')]"
            ".filter((each) => each.tabIndex < 0 || !each.getAttribute('aria-label')).length"
        )
        == 0
    )


def test_a_ring_of_frames_ends() -> None:
    assert shown_tree(("a", "b"), ("b", "a")) == [
        ("a", False),
        ("└── b  ! part of a cycle", True),
        ("    └── a  ! part of a cycle", True),
    ]
    assert shown_tree(("odom", "base")) == [("odom", False), ("└── base  (static)", False)]


def test_a_tree_that_nothing_connects_is_marked() -> None:
    *_, last = shown_tree(("odom", "base"), ("world", "camera"))
    assert last == ("! 2 roots, where there must be one: odom, world", True)


def shown_tree(*pairs: tuple[str, str]) -> list[tuple[str, bool]]:
    frames = tuple(Frame(*pair, static=len(pairs) == 1) for pair in pairs)
    behaviour = Behaviour("robot.usd", "", 1.0, "ok", frames=frames)
    return tree_lines(TreeReport("", tuple(heard_edges(behaviour, None))))


def test_it_loads_without_a_complaint_and_asks_for_nothing(chromium: Browser, page: Path) -> None:
    chromium.open(page)
    assert chromium.logs() == []
    assert [
        request for request in chromium.requests() if request.startswith(("http:", "https:"))
    ] == []


def test_the_slider_moves_the_robot_and_the_scan(chromium: Browser, page: Path) -> None:
    chromium.open(page)

    def shown() -> set[str]:
        groups = chromium.shown("[data-moment]")
        return {group.get_attribute("data-moment") for group in groups}

    (first,) = shown()
    slider = chromium.one("#moment")
    assert slider.get_attribute("value") == first
    chromium.run("arguments[0].value = 3; arguments[0].dispatchEvent(new Event('input'))", slider)
    assert shown() == {"3"}
    assert re.match(r"\d\.\d s, \w+", chromium.run("return document.querySelector('output').value"))


def test_play_moves_the_slider_to_the_end_and_begins_anew(chromium: Browser, page: Path) -> None:
    chromium.open(page)
    button, slider = chromium.one(".time button"), chromium.one("#moment")
    last = slider.get_attribute("max")

    def click() -> list[str]:
        """Return what the button says and where the slider is before the page plays on."""
        script = "arguments[0].click(); return [arguments[0].textContent, arguments[1].value]"
        return list(chromium.run(script, button, slider))

    chromium.run("arguments[0].value = arguments[0].max - 1", slider)
    assert click() == ["Pause", str(int(last) - 1)]
    assert eventually(lambda: slider.get_attribute("value") == last and button.text == "Play")
    assert chromium.run("return document.querySelector('.now').getAttribute('transform')")
    assert click() == ["Pause", "0"]


def test_a_drawing_of_the_drive_can_be_made_larger(chromium: Browser, page: Path) -> None:
    chromium.open(page)

    def wide() -> float:
        return float(chromium.run("return document.querySelector('.room').clientWidth"))

    before = wide()
    chromium.one("figure .zoom button[aria-label^='Zoom in: The room']").click()
    assert wide() == pytest.approx(1.25 * before, rel=0.02)
    chromium.one("figure .zoom button[aria-label^='Zoom out: The room']").click()
    assert wide() == pytest.approx(before, rel=0.02)


def test_speeds_stand_below_the_place(right: DryRun) -> None:
    assert right.replays.get("") is not None
    speeds = right.replays[""].speeds
    assert right.replays[""].wheels == ("wheel_left_joint", "wheel_right_joint")
    ahead = next(each for each in speeds if each.commanded and each.commanded[0] > 0)
    later = speeds[speeds.index(ahead) + 5]
    assert later.driven[0] == pytest.approx(0.033 / 0.025 * 0.15, rel=0.01)
    assert later.wheels == pytest.approx((0.15 / 0.025,) * 2, rel=0.01)


def test_the_main_picture_needs_no_script(chromium: Browser, page: Path) -> None:
    chromium.scripts(on=False)
    try:
        chromium.open(page)
        assert chromium.shown(".room .scan")
        assert chromium.shown(".at")
        assert not chromium.shown(".time")
    finally:
        chromium.scripts(on=True)


def test_it_fits_and_can_be_read(chromium: Browser, page: Path) -> None:
    chromium.open(page)
    for size in (DESKTOP, PHONE):
        chromium.resize(size)
        assert chromium.run("return document.documentElement.scrollWidth") <= size[0]
        for scheme in ("light", "dark"):
            chromium.scheme(scheme)
            found = chromium.run(CONTRASTS)
            assert len(found) > 60
            assert [(size, scheme, kind) for ratio, kind in found if ratio < 4.5] == []


def test_a_report_with_a_dry_run_shows_its_maps(chromium: Browser, tmp_path: Path) -> None:
    for number, name in (("01", "Lab3_01_ros_clock"), ("05", "Lab3_05_odometry_tf")):
        correct_stage(number).GetRootLayer().Export(str(tmp_path / f"{name}.usda"))
    page = tmp_path / "report.html"
    assert invoke("check", tmp_path, "--sim", "--format", "html", "-o", page).exit_code == 0
    chromium.open(page, PHONE, "dark")
    assert chromium.logs() == []
    assert chromium.run("return document.documentElement.scrollWidth") == PHONE[0]
    assert len(chromium.shown(".maps .room")) == 2
    assert len(chromium.shown(".maps svg .scan")) == 1
    plain = tmp_path / "plain.html"
    invoke("check", tmp_path, "--format", "html", "-o", plain)
    assert ".maps" not in plain.read_text(encoding="utf-8")
