"""What a script writes into the graphs of the stage that it loads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from foreign_robots import rover
from linting import broken_robot
from pxr import Usd

from lab3_usd.pipeline.stage import JudgeSettings, lint_stage

HEAD = "import omni.graph.core as og\nkeys = og.Controller.Keys\n"
CLOCK, TIME = "/World/Clock/clock", "/World/Clock/time"


def found(text: str, stage: Usd.Stage, folder: Path) -> list[str]:
    """Return what is found in a script over a scene, with its lines."""
    path, scene = folder / "robot.py", folder / "scene.usda"
    path.write_text(HEAD + text, encoding="utf-8")
    stage.GetRootLayer().Export(str(scene))
    result = lint_stage(path, JudgeSettings(heeds_ignores=True, scene=str(scene)))
    return sorted(f"{f.rule} {f.line}" for f in result.findings if f.severity != "note")


def without(steps: list[dict[str, Any]]) -> Usd.Stage:
    return broken_robot("rover", steps)


RADIUS = "/World/Drive/drive.inputs:wheelRadius"


@pytest.mark.parametrize(
    "text",
    [
        f'og.Controller.attribute("{RADIUS}").set(0.0)',
        f'og.Controller.edit("/World/Drive", {{keys.SET_VALUES: [("{RADIUS}", 0.0)]}})',
        'og.Controller.attribute("inputs:wheelRadius", "/World/Drive/drive").set(0.0)',
    ],
)
def test_a_wrong_value_of_a_node_of_the_scene_is_found_at_its_line(
    text: str, tmp_path: Path
) -> None:
    assert found(text, rover(), tmp_path) == ["K10 3"]


def test_a_right_value_of_a_node_of_the_scene_is_no_fault(tmp_path: Path) -> None:
    text = 'og.Controller.attribute("/World/Drive/drive.inputs:wheelRadius").set(10.0)'
    assert found(text, rover(), tmp_path) == []


def test_a_port_that_a_node_of_the_scene_lacks_stops_the_script(tmp_path: Path) -> None:
    text = f'og.Controller.attribute("{CLOCK}.inputs:topic").set("clock")'
    assert found(text, rover(), tmp_path) == ["B01 3"]


def test_a_wire_completes_a_graph_of_the_scene(tmp_path: Path) -> None:
    stage = without([{"disconnect": f"{CLOCK}.inputs:execIn"}])
    name = f'og.Controller.attribute("{CLOCK}.inputs:topicName").set("clock")'
    assert found(name, stage, tmp_path) == ["K01 None"]
    wire = f'og.Controller.connect("/World/Clock/tick.outputs:tick", "{CLOCK}.inputs:execIn")'
    assert found(wire, stage, tmp_path) == []


def test_a_wire_that_the_script_takes_away_is_gone(tmp_path: Path) -> None:
    cut = f'og.Controller.disconnect("/World/Clock/tick.outputs:tick", "{CLOCK}.inputs:execIn")'
    assert found(cut, rover(), tmp_path) == ["K01 None"]
    every = f'og.Controller.disconnect_all("{CLOCK}.inputs:execIn")'
    assert found(every, rover(), tmp_path) == ["K01 None"]


def test_a_new_node_joins_those_of_the_scene(tmp_path: Path) -> None:
    text = f"""og.Controller.edit("/World/Clock", {{
    keys.CREATE_NODES: [("odd", "isaacsim.ros2.bridge.ROS2PublishClock")],
    keys.CONNECT: [("/World/Clock/tick.outputs:tick", "odd.inputs:execIn"),
                   ("{TIME}.outputs:simulationTime", "odd.inputs:timestamp")],
    keys.SET_VALUES: [("odd.inputs:topicName", "other_clock")],
}})"""
    assert "K21 6" in found(text, rover(), tmp_path)
    right = found(text.replace("timestamp", "timeStamp"), rover(), tmp_path)
    assert not [each for each in right if each.startswith(("K20", "K01", "K10", "K21", "B"))]


def test_a_node_of_the_scene_that_is_removed_is_gone(tmp_path: Path) -> None:
    text = f'og.Controller.delete_node("{TIME}")'
    assert any(each.startswith("K20") for each in found(text, rover(), tmp_path))


def test_a_new_stage_has_nothing_of_the_scene(tmp_path: Path) -> None:
    text = 'og.Controller.attribute("/World/Drive/drive.inputs:wheelRadius").set(0.0)'
    assert found(f"context.open_stage(path)\n{text}", rover(), tmp_path) == ["K10 4"]
    assert "K10 4" not in found(f"context.new_stage()\n{text}", rover(), tmp_path)
    broken = without([{"disconnect": f"{CLOCK}.inputs:execIn"}])
    node = '("tick", "omni.graph.action.OnPlaybackTick")'
    edit = f'og.Controller.edit("/World/Other", {{keys.CREATE_NODES: [{node}]}})'
    assert found(edit, broken, tmp_path) == ["K01 None"]
    assert found(f"context.new_stage()\n{edit}", broken, tmp_path) == []
