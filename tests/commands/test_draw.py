"""`lab3 draw`: which files it writes, from stages and from the lab's own graphs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from in_process import invoke
from linting import add_failing_rule, broken_robot
from places import REPOSITORY
from pxr import Sdf, Usd

from lab3_usd import cli
from lab3_usd.errors import StageError, UsageError
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import build_checkpoint

if TYPE_CHECKING:
    from click.testing import Result

GRAPH = "/World/ROS_Clock"


def draw(*arguments: str | Path) -> Result:
    return invoke("draw", *arguments)


def refused(*arguments: str | Path) -> str:
    """The message of an error of ours, which the program writes as one line."""
    with pytest.raises((UsageError, StageError)) as error:
        draw(*arguments)
    return str(error.value)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A right stage of checkpoint 05."""
    return build_checkpoint(
        None, "05", tmp_path_factory.mktemp("stage") / "Lab3_05_odometry_tf.usda"
    )


@pytest.fixture
def clock(tmp_path: Path) -> Usd.Stage:
    """A stage of checkpoint 01 to break; it has to be saved."""
    path = build_checkpoint(None, "01", tmp_path / "in" / "Lab3_01_ros_clock.usda")
    return Usd.Stage.Open(str(path))


def text_of(result: Result) -> str:
    """The text of the only picture that was written."""
    assert result.exit_code == 0, result.output
    return Path(result.stdout.strip()).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("form", "ending", "start"),
    [
        ("svg", "svg", b"<?xml"),
        ("mermaid", "mmd", b"%% ROS_Clock"),
        ("dot", "dot", b"digraph"),
        ("png", "png", b"\x89PNG"),
    ],
)
def test_a_graph_of_the_lab_is_drawn(tmp_path: Path, form: str, ending: str, start: bytes) -> None:
    if form == "png":
        pytest.importorskip("resvg_py", reason="the extra png is not installed")
    result = draw("ROS_Clock", "-o", tmp_path / "new", "--format", form)
    target = tmp_path / "new" / f"ROS_Clock.{ending}"
    assert result.stdout == f"{target}\n"
    assert target.read_bytes().startswith(start)


def test_the_required_tree_is_drawn_by_its_name(tmp_path: Path) -> None:
    assert "base_footprint" in text_of(draw("TF", "-o", tmp_path))


def test_every_graph_of_a_stage_is_drawn(whole: Path, tmp_path: Path) -> None:
    result = draw(whole, "-o", tmp_path)
    names = [*load_lab().checkpoints["05"].graphs, "TF"]
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines() == [
        str(tmp_path / f"Lab3_05_odometry_tf-{name}.svg") for name in names
    ]


def test_a_right_stage_has_no_fault_marked(whole: Path, tmp_path: Path) -> None:
    draw(whole, "-o", tmp_path)
    marked = [
        path.name
        for path in sorted(tmp_path.iterdir())
        if ' wrong"' in path.read_text() or 'missing"' in path.read_text().partition("</style>")[2]
    ]
    assert marked == []


def test_the_stage_itself_stays_as_it_is(clock: Usd.Stage) -> None:
    path = Path(clock.GetRootLayer().realPath)
    before = path.read_bytes()
    draw(path, "-o", path.parent)
    assert path.read_bytes() == before
    assert len(list(path.parent.iterdir())) == 2


def remove_context(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{GRAPH}/ros2_context")


def rename_topic(stage: Usd.Stage) -> None:
    stage.GetAttributeAtPath(f"{GRAPH}/ros2_publish_clock.inputs:topicName").Set("/klock")


def cut_wire(stage: Usd.Stage) -> None:
    stage.GetAttributeAtPath(f"{GRAPH}/ros2_publish_clock.inputs:execIn").ClearConnections()


def add_clock(stage: Usd.Stage) -> None:
    first = stage.GetAttributeAtPath(f"{GRAPH}/isaac_read_simulation_time.node:type")
    second = stage.DefinePrim(f"{GRAPH}/again", "OmniGraphNode")
    second.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set(first.Get())


@pytest.mark.parametrize(
    ("change", "marks"),
    [
        (remove_context, ['class="n ghost"', 'class="w missing"']),
        (rename_topic, ['class="r wrong"', ">/klock</text>", ">expected /clock</text>"]),
        (cut_wire, ['class="w x missing"']),
        (add_clock, ['class="b extra"']),
    ],
)
def test_a_fault_is_marked_once(
    change: Callable[[Usd.Stage], None], marks: list[str], clock: Usd.Stage, tmp_path: Path
) -> None:
    change(clock)
    clock.Save()
    text = text_of(draw(clock.GetRootLayer().realPath, "-o", tmp_path / "out"))
    assert {mark: text.count(mark) for mark in marks} == dict.fromkeys(marks, 1)


def test_a_stage_whose_name_has_no_checkpoint_is_drawn_as_it_is(
    whole: Path, tmp_path: Path
) -> None:
    other = tmp_path / "mine.usda"
    other.write_bytes(whole.read_bytes())
    result = draw(other, "-o", tmp_path / "out", "--format", "dot")
    assert result.exit_code == 0, result.output
    assert "not judged" in result.stderr
    assert len(result.stdout.splitlines()) == 6


def test_a_stage_with_nothing_to_draw_is_said(tmp_path: Path) -> None:
    bare = tmp_path / "mine.usda"
    Usd.Stage.CreateNew(str(bare)).Save()
    assert "nothing to draw" in refused(bare, "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_checkpoint_can_be_said(whole: Path, tmp_path: Path) -> None:
    other = tmp_path / "mine.usda"
    other.write_bytes(whole.read_bytes())
    result = draw(other, "-o", tmp_path / "out", "--checkpoint", "05")
    assert result.stderr == ""
    assert (tmp_path / "out" / "mine-ROS_Drive.svg").exists()


def test_an_unknown_checkpoint_is_wrong_use(whole: Path, tmp_path: Path) -> None:
    assert "'42'" in refused(whole, "-o", tmp_path, "--checkpoint", "42")


def test_an_unknown_graph_names_those_there_are(tmp_path: Path) -> None:
    message = refused("ROS_Klock", "-o", tmp_path)
    assert "ROS_Klock" in message
    assert "ROS_Clock, ROS_Drive" in message


def test_a_file_that_is_no_stage_is_said(tmp_path: Path) -> None:
    broken = tmp_path / "Lab3_01_ros_clock.usda"
    broken.write_text("this is no stage")
    assert "Lab3_01_ros_clock.usda" in refused(broken, "-o", tmp_path)


def test_a_picture_that_exists_is_not_replaced_unasked(tmp_path: Path) -> None:
    old = tmp_path / "ROS_Clock.svg"
    old.write_text("mine")
    assert "--force" in refused("ROS_Clock", "-o", tmp_path)
    assert old.read_text() == "mine"
    assert draw("ROS_Clock", "-o", tmp_path, "--force").exit_code == 0
    assert old.read_text() != "mine"


def test_no_picture_is_written_when_one_exists(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "Lab3_05_odometry_tf-TF.svg").write_text("mine")
    refused(whole, "-o", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["Lab3_05_odometry_tf-TF.svg"]


def test_graphs_of_one_name_are_numbered(clock: Usd.Stage, tmp_path: Path) -> None:
    for folder in ("/A", "/B"):
        clock.DefinePrim(f"{folder}/Mine", "OmniGraph")
    clock.GetRootLayer().Save()
    result = draw(clock.GetRootLayer().realPath, "-o", tmp_path / "out")
    names = [Path(line).name for line in result.stdout.splitlines()]
    assert names[1:] == ["Lab3_01_ros_clock-Mine.svg", "Lab3_01_ros_clock-Mine-2.svg"]


def test_names_that_differ_in_case_are_numbered(clock: Usd.Stage, tmp_path: Path) -> None:
    for graph in ("/A/ROS_Clock", "/A/ros_clock", "/B/Ros_Clock_2"):
        clock.DefinePrim(graph, "OmniGraph")
    clock.GetRootLayer().Save()
    lines = draw(clock.GetRootLayer().realPath, "-o", tmp_path / "out").stdout.splitlines()
    names = [Path(line).name.casefold() for line in lines]
    assert len(names) == len({*names}) == 4


@pytest.mark.parametrize(("theme", "dark"), [("dark", True), ("light", False)])
def test_a_theme_can_be_chosen(tmp_path: Path, theme: str, dark: bool) -> None:  # noqa: FBT001
    text = text_of(draw("ROS_Clock", "-o", tmp_path, "--theme", theme))
    assert ("fill:#1b1e23" in text) == dark
    assert "prefers-color-scheme" not in text


def test_unused_ports_can_be_drawn(tmp_path: Path) -> None:
    assert "qosProfile" in text_of(draw("ROS_Clock", "-o", tmp_path, "--all-ports"))
    assert "qosProfile" not in text_of(draw("ROS_Clock", "-o", tmp_path, "--force"))


@pytest.mark.usefixtures("own_rules")
def test_a_rule_that_fails_is_said_and_the_pictures_are_written(
    clock: Usd.Stage, tmp_path: Path
) -> None:
    add_failing_rule("W99", "graph", KeyError, "x")
    result = draw(clock.GetRootLayer().realPath, "-o", tmp_path / "out")
    assert result.exit_code == cli.EXIT_CRASH
    assert result.stderr.startswith("lab3: rule W99 failed: KeyError: 'x', at linting.py:")
    assert Path(result.stdout.strip()).exists()


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A robot of no lab, with a clock that has no time and a transform that is published twice."""
    steps = [
        {"disconnect": "/World/Clock/clock.inputs:timeStamp"},
        {"copy": ["/World/Odometry/transform", "/World/Odometry/again"]},
    ]
    path = tmp_path / "rover.usda"
    stage = broken_robot("rover", steps)
    stage.GetRootLayer().Export(str(path))
    return path


def test_what_the_linter_finds_is_marked_in_any_stage(robot: Path, tmp_path: Path) -> None:
    result = draw(robot, "--lint", "-o", tmp_path / "out")
    pictures = {path.stem: path.read_text() for path in map(Path, result.stdout.split())}
    marked = {name for name, text in pictures.items() if "with an error" in text}
    assert marked == {"rover-Clock", "rover-Odometry"}
    assert "1 wrong" in pictures["rover-TF"]


def test_a_linted_stage_has_no_checkpoint(robot: Path, tmp_path: Path) -> None:
    out = ("-o", tmp_path / "out")
    assert "exclude each other" in refused(robot, "--lint", "--checkpoint", "01", *out)
    assert "the lab names the release" in refused("ROS_Clock", "--isaac", "5.1", *out)


@pytest.fixture(scope="module")
def linted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The pictures of a robot with two trees, a gap between wires and a node that never runs."""
    folder = tmp_path_factory.mktemp("linted")
    draw("--lint", REPOSITORY / "docs" / "examples" / "carter.usda", "-o", folder)
    return {path.stem: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def test_an_error_at_a_port_without_a_wire_counts_and_frames_its_node(
    linted: dict[str, str],
) -> None:
    picture = linted["carter-differential_drive"]
    assert "10 nodes, 11 wires, 1 with an error" in picture
    assert picture.count('<rect class="b wrong"') == 1


def test_a_node_with_a_warning_is_no_extra_node(linted: dict[str, str]) -> None:
    picture = linted["carter-odometry"]
    assert ("publish_odom_transform · warning" in picture, "· extra" in picture) == (True, False)


def test_a_tree_that_nothing_connects_is_marked(linted: dict[str, str]) -> None:
    picture = linted["carter-TF"]
    assert "3 transforms, 1 in another tree" in picture
    assert "not connected to chassis_link" in picture


def test_a_picture_shrinks_to_the_window(linted: dict[str, str]) -> None:
    assert "max-width:max(100%,999.6px);height:auto" in linted["carter-differential_drive"]


def test_no_lab_asks_for_the_tf_of_a_stage_without_a_checkpoint(tmp_path: Path) -> None:
    draw(REPOSITORY / "docs" / "examples" / "carter.usda", "-o", tmp_path)
    picture = (tmp_path / "carter-TF.svg").read_text(encoding="utf-8")
    assert ("1 in another tree" in picture, "not asked for" in picture) == (True, False)
