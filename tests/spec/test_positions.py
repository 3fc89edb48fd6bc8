"""Messages about files of a lab end with file, line and column, for every kind of mistake."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_process import invoke
from other_labs import MINI, copied

from lab3_usd.errors import SpecError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the small lab."""
    return copied(tmp_path / "lab")


MISTAKES: dict[str, tuple[str, str, str, str]] = {
    "no YAML": ("scene.yaml", "robot:", "robot: [", ": "),
    "a value of the wrong kind": ("scene.yaml", "up_axis: Z", "up_axis: 3", "up_axis"),
    "a key that is not known": ("scene.yaml", "up_axis: Z", "axis: Z", "axis: Z"),
    "a mass": ("scene.yaml", "mass: 0.114", "mass: -0.114", "mass: -0.114"),
    "a wire": (
        "ROS_Clock.yaml",
        "- on_playback_tick.tick ->",
        "- on_playback_tick.tock ->",
        "on_playback_tick.tock ->",
    ),
    "a node type": (
        "ROS_Clock.yaml",
        "isaacsim.ros2.bridge.ROS2PublishClock",
        "isaacsim.ros2.bridge.ROS2Clock",
        "isaacsim.ros2.bridge.ROS2Clock",
    ),
    "a value of a node": ("ROS_Clock.yaml", "topicName:", "topicNam:", "topicNam: "),
    "a frame": ("scene.yaml", "base_frame: base_footprint", "base_frame: base", "base"),
    "a file of points": ("rubric.yaml", "points: 20", "points: twenty", "points: twenty"),
    "a group of an item": ("rubric.yaml", "groups: [ROS_Clock]", "groups: [ROS_Clok]", "ROS_Clok]"),
    "a cap": ("rubric.yaml", "rules: [T07]", "rules: [T99]", "T99"),
    "a deliverable": ("submission.yaml", "endings: [.pdf]", "endings: .pdf", "endings: .pdf"),
    "a line of a checklist": ("submission.yaml", "stages: last", "stage: last", "stage: last"),
    "the map": ("scene.yaml", "resolution: 0.05", "resolution: fine", "resolution: fine"),
    "a topic": ("ros.yaml", "publishers: 1", "publishers: one", "publishers: one"),
    "a command": ("ros.yaml", "kind: node_list", "kind: nodes", "nodes"),
    "a prim of the starter": ("starter.yaml", "type: Plane", "typ: Plane", "typ: Plane"),
    "a kind of the starter": ("starter.yaml", "like: wheel", "like: wheels", "wheels"),
    "an alias of YAML": ("scene.yaml", "up_axis: Z", "up_axis: *up", "*up"),
    "a checkpoint": ("checkpoints.yaml", "graphs: [ROS_Drive]", "graphs: [ROS_Driv]", "ROS_Driv]"),
}


def said_of(folder: Path) -> str:
    """Return what `lab check` says first, of whatever kind the mistake is."""
    try:
        return invoke("lab", "check", folder).output.splitlines()[0]
    except SpecError as error:
        return str(error)


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_said_with_its_place(case: str, folder: Path) -> None:
    file, old, new, pointed = MISTAKES[case]
    path = folder / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    said = said_of(folder)
    number, column = map(int, said.rpartition(f", at {path}:")[2].split(":"))
    line = path.read_text().splitlines()[number - 1][column - 1 :]
    assert line.startswith(pointed), (said, line)


def test_a_mistake_in_a_rubric_of_the_grader_is_said_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text('title: Mine\nitems:\n  clock: {checkpoint: "01", point: 3}\n')
    (tmp_path / "class").mkdir()
    starter = ("--starter", tmp_path, "-o", tmp_path / "book")
    with pytest.raises(SpecError) as refused:
        invoke("--lab", MINI, "grade", tmp_path / "class", "--rubric", path, *starter)
    assert str(refused.value).endswith(f", at {path}:3:29")
