"""What a course leaves to its students: where a graph stands, and a constant or its literal."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import quick_yaml
from in_process import invoke
from other_labs import copied
from pxr import Sdf

from lab3_usd.errors import SpecError
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab

CLOCK, SIZE = "/World/ROS_Clock", "/World/ROS_Clock/ros2_publish_clock.inputs:queueSize"
Change = Callable[[Sdf.Layer], object]


def changed(folder: Path, role: dict[str, object] | None = None, **keys: object) -> Path:
    """Give the clock graph keys, and a constant that its publisher is fed by."""
    file = folder / "ROS_Clock.yaml"
    graph = quick_yaml.load(file.read_text()) | keys
    if role is not None:
        del graph["nodes"]["ros2_publish_clock"]["set"]["B6"]["queueSize"]
        kind = "omni.graph.nodes.ConstantUInt64"
        graph["nodes"]["size"] = {"type": kind, "set": {"value": 10}} | role
        graph["wires"]["B6"].append("size.value -> ros2_publish_clock.queueSize")
    file.write_text(quick_yaml.dump(graph))
    return folder


def found(folder: Path, change: Change) -> list[tuple[str, str]]:
    """What is found in the last built stage after a change of its layer."""
    out = folder.parent / "built"
    assert invoke("--lab", folder, "build", "--out", out).exit_code == 0
    stage = max(out.iterdir())
    layer = Sdf.Layer.OpenAsAnonymous(str(stage))
    change(layer)
    layer.Export(str(stage))
    findings = check_stage(stage, lab=load_lab(folder)).findings
    missing = [each.message for each in findings if each.rule == "N01"]
    assert not any("drive" in message for message in missing), "the graph drives nothing"
    return [(each.rule, each.prim) for each in findings if each.severity == "error"]


def move(layer: Sdf.Layer) -> None:
    text = layer.ExportToString()
    layer.ImportFromString(text.replace(CLOCK, "/World/Time").replace('"ROS_Clock"', '"Time"'))


@pytest.mark.parametrize(
    ("keys", "told"), [({}, [("G02", "/World/Time")]), ({"anywhere": True}, [])]
)
def test_a_graph_may_stand_elsewhere_where_the_course_says_so(
    tmp_path: Path, keys: dict[str, object], told: list[object]
) -> None:
    assert found(changed(copied(tmp_path / "lab"), **keys), move) == told


def typed(value: int | None) -> Change:
    """Type a value where the wire of the constant ends, and delete the constant."""

    def change(layer: Sdf.Layer) -> None:
        attribute = layer.GetAttributeAtPath(SIZE)
        attribute.connectionPathList.ClearEdits()
        if value is not None:
            attribute.default = value
        del layer.GetPrimAtPath(CLOCK).nameChildren["size"]

    return change


MISSING, WRONG = ("N01", CLOCK), ("P01", SIZE.partition(".")[0])
LITERALS: dict[str, tuple[dict[str, object], Change, list[object]]] = {
    "the node itself": ({"literal": True}, lambda _: None, []),
    "its value": ({"literal": True}, typed(10), []),
    "another value": ({"literal": True}, typed(9), [WRONG]),
    "neither": ({"literal": True}, typed(None), [MISSING]),
    "where the course wants the node": ({}, typed(10), [MISSING]),
}


@pytest.mark.parametrize("case", LITERALS)
def test_a_literal_in_place_of_a_constant(tmp_path: Path, case: str) -> None:
    role, change, told = LITERALS[case]
    assert found(changed(copied(tmp_path / "lab"), role), change) == told


def test_a_literal_of_what_is_not_set_is_refused(tmp_path: Path) -> None:
    folder = changed(copied(tmp_path / "lab"), {"literal": True, "set": {}})
    with pytest.raises(SpecError, match="size: literal: inputs:value is not set here"):
        load_lab(folder)


def with_second_driver(folder: Path) -> Path:
    """Put an optional milestone, whose graph commands the wheels as well, before the last one."""
    graph = quick_yaml.load((folder / "ROS_Drive.yaml").read_text())
    graph |= {"graph": "Push", "path": "/turtlebot3_burger/Push"}
    graph["nodes"]["ros2_subscribe_twist"]["set"]["C5"]["topicName"] = "/push"
    (folder / "Push.yaml").write_text(quick_yaml.dump(graph))
    points = quick_yaml.load((folder / "checkpoints.yaml").read_text())
    *before, last = points["checkpoints"].items()
    push = {"name": "push", "title": "Push", "part": "C", "optional": True}
    points["checkpoints"] = dict([*before, ("04b", push | {"adds": {"graphs": ["Push"]}}), last])
    (folder / "checkpoints.yaml").write_text(quick_yaml.dump(points))
    return folder


@pytest.mark.parametrize(("place", "told"), [("Push", []), ("Shove", ["N12"])])
def test_what_an_optional_milestone_commands_is_no_second_driver(
    tmp_path: Path, place: str, told: list[str]
) -> None:
    folder = with_second_driver(copied(tmp_path / "lab"))

    def did_the_optional_one(layer: Sdf.Layer) -> None:
        built = (folder.parent / "built").glob("*04b*")
        pushed = Sdf.Layer.FindOrOpen(str(next(built)))
        text = (
            pushed.ExportToString().replace('"Push"', f'"{place}"').replace("/Push/", f"/{place}/")
        )
        other = Sdf.Layer.CreateAnonymous(".usda")
        other.ImportFromString(text)
        Sdf.CopySpec(other, f"/turtlebot3_burger/{place}", layer, f"/turtlebot3_burger/{place}")

    assert [rule for rule, _ in found(folder, did_the_optional_one)] == told
