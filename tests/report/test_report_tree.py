"""The TF tree as text, dot and JSON, with what is wrong marked."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from breaking import broken
from in_process import invoke
from msgspec.structs import replace

from lab3_usd.facts.frame_targets import UnresolvedFrames
from lab3_usd.facts.frames import Edge
from lab3_usd.facts.tree import frame_faults, tree_of
from lab3_usd.report.pictures.tf_picture import published_frames_picture
from lab3_usd.report.tf_tree import TreeReport, as_lines, tree_json
from lab3_usd.stage.write.builder import build_checkpoint


def edges(*pairs: str) -> tuple[Edge, ...]:
    """Edges written `parent child [publisher]`."""
    made = []
    for pair in pairs:
        parent, child, publisher = (*pair.split(), "/g/p")[:3]
        made.append(Edge(parent, child, publisher, publisher, "/tf"))
    return tuple(made)


def text(*pairs: str, unknown: tuple[str, ...] = (), verbose: bool = False) -> list[str]:
    return list(as_lines(TreeReport("x.usda", edges(*pairs), unknown), verbose=verbose))


def kinds(*pairs: str) -> list[tuple[str, str]]:
    return [(fault.frame, fault.kind) for fault in frame_faults(tree_of(edges(*pairs)))]


def test_a_tree_is_drawn_in_the_order_it_is_published() -> None:
    assert text("odom base", "base link", "link scan", "base camera") == [
        "odom",
        "└── base",
        "    ├── link",
        "    │   └── scan",
        "    └── camera",
    ]


def test_white_space_around_a_frame_is_shown() -> None:
    report = TreeReport("x", (Edge("odom ", "base ", "/g/p", "/g/p", "/tf"),))
    assert list(as_lines(report)) == ["'odom '", "└── 'base '"]


def test_verbose_names_the_publishers() -> None:
    assert text("odom base /g/raw", verbose=True) == ["odom", "└── base  <- /g/raw (/tf)"]


def test_a_static_transform_says_so() -> None:
    report = TreeReport("x", (Edge("a", "b", "/g/p", "/g/p", "/tf_static", static=True),))
    assert list(as_lines(report)) == ["a", "└── b  (static)"]


def test_a_transform_that_may_be_sent_says_so() -> None:
    report = TreeReport("x", (Edge("a", "b", "/g/p", "/g/p", "/tf", sure=False),))
    assert list(as_lines(report)) == ["a", "└── b  (perhaps)"]
    assert json.loads(tree_json(report))["transforms"][0]["sure"] is False


def test_a_frame_with_two_parents_is_marked_below_both_and_drawn_once() -> None:
    assert text("a b", "x b", "b c") == [
        "a",
        "└── b  ! 2 parents: a, x",
        "    └── c",
        "x",
        "└── b  ! 2 parents: a, x",
        "! 2 roots, where there must be one: a, x",
    ]


def test_a_ring_is_drawn_once_and_marked() -> None:
    assert text("a b", "b a") == [
        "a",
        "└── b  ! part of a cycle",
        "    └── a  ! part of a cycle",
    ]


@pytest.mark.parametrize(
    ("pairs", "found"),
    [
        (("a b", "b c"), []),
        (("a b", "x b"), [("b", "two parents")]),
        (("a b /g/p", "a b /g/q"), [("b", "published twice")]),
        (("a a",), [("a", "own parent")]),
        (("o a", "a a"), [("a", "own parent")]),
        (("a b", "b c", "c b", "c d"), [("b", "two parents"), ("b", "ring"), ("c", "ring")]),
    ],
)
def test_what_tf2_cannot_take_is_a_fault(
    pairs: tuple[str, ...], found: list[tuple[str, str]]
) -> None:
    assert kinds(*pairs) == found


def test_a_frame_that_the_stage_must_not_place_is_marked() -> None:
    report = TreeReport("x", edges("world odom", "odom base"), reserved={"odom": "AMCL"})
    assert list(as_lines(report))[1] == "└── odom  ! only AMCL may place it"


def test_every_frame_stands_below_some_root() -> None:
    assert tree_of(edges("a b", "x y", "r s", "s r")).roots == ("a", "x", "r")


def test_a_deep_tree_is_no_problem() -> None:
    deep = edges(*(f"f{n} f{n + 1}" for n in range(300)))
    assert len(list(as_lines(TreeReport("x", deep)))) == 301


def test_nothing_published_says_so() -> None:
    assert text() == ["no transforms are published"]


def test_unknown_publishers_are_named() -> None:
    assert text(unknown=("/g/any",)) == ["! /g/any publishes frames that the stage does not define"]


LINKS = UnresolvedFrames("/robot", True, "robot.usd", "base", "/g/p", "/g/c", "/tf")  # noqa: FBT003
FRAME = replace(LINKS, prim="/robot/arm", links=False)


def with_hidden(*pairs: str, verbose: bool = False) -> list[str]:
    report = TreeReport("x.usda", edges(*pairs), hidden=(LINKS, FRAME))
    return list(as_lines(report, verbose=verbose))


def test_what_a_missing_asset_could_tell_is_unknown_and_no_frame() -> None:
    assert with_hidden("odom base") == [
        "odom",
        "└── base",
        "? links of /robot: asset not found: robot.usd",
        "? frame of /robot/arm: asset not found: robot.usd",
    ]
    assert with_hidden(verbose=True)[0].endswith("robot.usd  <- /g/p (/tf)")


def test_roots_that_unknown_frames_may_join_are_not_called_too_many() -> None:
    assert not any("roots" in line for line in with_hidden("odom base", "arm hand"))
    assert any("roots" in line for line in text("odom base", "arm hand"))


def test_unknown_frames_are_listed_in_json() -> None:
    report = TreeReport("x.usda", edges("odom base"), hidden=(LINKS, FRAME))
    found = json.loads(tree_json(report))["unknown_frames"]
    assert [(each["prim"], each["links"], each["asset"]) for each in found] == [
        ("/robot", True, "robot.usd"),
        ("/robot/arm", False, "robot.usd"),
    ]


def test_frame_names_cannot_write_to_the_terminal() -> None:
    report = TreeReport("x", edges("a \x1b[2J"))
    assert "\x1b" not in "\n".join(as_lines(report)) + tree_json(report)


def test_the_picture_marks_what_the_lines_mark() -> None:
    reserved = TreeReport("x", edges("world odom", "odom base"), reserved={"odom": "AMCL"})
    curves = published_frames_picture(reserved).curves
    assert [curve.target.key for curve in curves if curve.state == "wrong"] == ["odom"]
    apart = TreeReport("x", edges("odom base", "base arm", "camera lens"))
    top = next(box for box in published_frames_picture(apart).boxes if box.key == "camera")
    assert (top.state, top.subtitle) == ("warned", "not connected to odom")


def test_a_tree_that_nothing_connects_is_a_problem_in_json() -> None:
    report = TreeReport("x", edges("odom base", "base arm", "camera lens"))
    assert json.loads(tree_json(report))["problems"] == [
        {"frame": "camera", "kind": "another tree", "message": "not connected to odom"}
    ]
    unsure = replace(report, hidden=(LINKS,))  # which may connect them
    assert json.loads(tree_json(unsure))["problems"] == []


def test_json_has_transforms_roots_and_problems() -> None:
    data = json.loads(tree_json(TreeReport("x", edges("a b", "c b"), ("/g/any",))))
    assert (data["file"], data["roots"]) == ("x", ["a", "c"])
    assert [t["child"] for t in data["transforms"]] == ["b", "b"]
    assert [p["kind"] for p in data["problems"]] == ["two parents"]
    assert data["unknown_publishers"] == ["/g/any"]


def test_the_command_prints_the_tree_of_the_handout(tmp_path: Path) -> None:
    stage = build_checkpoint(None, "05", tmp_path / "stage.usda")
    result = invoke("tf", stage)
    assert result.exit_code == 0
    assert result.output.splitlines()[:3] == ["odom", "└── base_footprint", "    ├── base_link"]
    assert len(result.output.splitlines()) == 8


@pytest.mark.parametrize("form", ["dot", "json"])
def test_the_command_prints_other_forms(tmp_path: Path, form: str) -> None:
    stage = build_checkpoint(None, "05", tmp_path / "stage.usda")
    result = invoke("tf", stage, "--format", form)
    assert result.exit_code == 0
    assert result.output.startswith({"dot": "digraph", "json": "{"}[form])


@pytest.mark.parametrize(("name", "is_marked"), [("Lab3_05.usda", True), ("robot.usda", False)])
def test_only_a_stage_of_the_lab_leaves_a_frame_to_others(
    tmp_path: Path, name: str, *, is_marked: bool
) -> None:
    steps = [{"set": ["ROS_OdomTF/ros2_publish_raw_transform_tree.inputs:parentFrameId", "world"]}]
    steps.append(
        {"set": ["ROS_OdomTF/ros2_publish_raw_transform_tree.inputs:childFrameId", "odom"]}
    )
    stage = broken("05", steps)
    stage.GetRootLayer().Export(str(tmp_path / name))
    shown = invoke("tf", tmp_path / name).stdout
    assert ("may place it" in shown) == is_marked


def test_a_publisher_that_does_not_fit_stands_below_its_frame() -> None:
    report = TreeReport("x.usda", edges("odom base /World/TF/publish", "base link /World/TF/more"))
    lines = list(as_lines(report, 30, verbose=True))
    assert lines == [
        "odom",
        "└── base",
        "      <- /World/TF/publish (/tf)",
        "    └── link",
        "          <- /World/TF/more (/tf)",
    ]
