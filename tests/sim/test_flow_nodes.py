"""Loops, the timeline and writers of attributes, each against what a hand reckons of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from in_process import invoke
from lone_nodes import node, world
from pxr import Sdf, Usd

from lab3_usd.model.dry_run import Affine, Scene, ScenePrim
from lab3_usd.sim.execution.node_instance import MOST_ROUNDS, NodeInstance, push

ACTION = "omni.graph.action."
KIT = "omni.graph.nodes."


def rounds_of(values: dict[str, Any], here: Any) -> tuple[list[object], int]:
    """The values at which the body of a loop is signalled, and how often its end is."""
    loop, body = node(f"{ACTION}ForLoop", values), node("omni.graph.ui_nodes.PrintText")
    end = node("omni.graph.ui_nodes.PrintText")
    seen: list[object] = []

    def note(_: NodeInstance, __: Any) -> bool:
        seen.append(loop.outputs["value"])
        return True

    body.function = note
    loop.follows = {"loopBody": [body], "finished": [end]}
    push(loop, here, 3)
    return seen, end.count


@pytest.mark.parametrize(
    ("start", "stop", "step", "values"),
    [(0, 3, 1, [0, 1, 2]), (2, 9, 3, [2, 5, 8]), (3, 0, -1, [3, 2, 1]), (1, 1, 1, [])],
)
def test_a_loop_signals_for_each_number_before_its_end(
    start: int, stop: int, step: int, values: list[int]
) -> None:
    asked = {"start": start, "stop": stop, "step": step}
    assert rounds_of(asked, world()) == (values, 1)


def test_a_loop_without_a_step_does_nothing() -> None:
    loop = node(f"{ACTION}ForLoop", {"start": 0, "stop": 3, "step": 0})
    assert not loop.compute(world())


def test_what_is_read_in_one_round_is_read_anew_in_the_next() -> None:
    here = world()
    rounds_of({"start": 0, "stop": 3, "step": 1}, here)
    assert here.reading == 1 + 3


def test_a_loop_that_would_take_all_day_is_not_judged() -> None:
    here = world()
    seen, ends = rounds_of({"start": 0, "stop": 10**9, "step": 1}, here)
    assert len(seen) == MOST_ROUNDS
    assert ends == 0
    assert "loops more than" in here.unplayed[""]


def test_the_timeline_gives_the_time_since_play() -> None:
    timeline = node(f"{KIT}GetTimeline")
    assert timeline.compute(world(since_play=4.5))
    assert (timeline.outputs["time"], timeline.outputs["isPlaying"]) == (4.5, True)


def writing(name: str, path: str, here: Any) -> NodeInstance:
    writer = node(
        f"{KIT}WritePrimAttribute", {"name": name, "usePath": True, "primPath": path, "value": 1.0}
    )
    writer.compute(here)
    return writer


def with_belt(robot_at: tuple[float, float, float]) -> Any:
    """A world with a conveyor at x = 5 m, and a robot."""
    place = Affine(origin=(5.0, 0.0, 0.4))
    belt = ScenePrim("/Belt", "Cube", frozenset(), place, {}, {}, seen=True)
    machines = SimpleNamespace(
        machines=[SimpleNamespace(base="/Robot", wheels=("left",))],
        place=lambda _: Affine(origin=robot_at),
    )
    return world(scene=Scene(1.0, "Z", (), {"/Belt": belt}, {}), machines=machines)


def test_a_conveyor_far_from_the_robot_changes_nothing_that_is_judged() -> None:
    here = with_belt((0.0, 0.0, 0.0))
    writer = writing("physxSurfaceVelocity:surfaceVelocity", "/Belt", here)
    assert writer.failure is None
    assert here.unplayed == {}


@pytest.mark.parametrize(
    ("name", "robot_at"),
    [
        ("physxSurfaceVelocity:surfaceVelocity", (4.5, 0.0, 0.0)),
        ("drive:angular:physics:stiffness", (0.0, 0.0, 0.0)),
    ],
    ids=["a conveyor beside the robot", "a joint"],
)
def test_what_a_written_attribute_may_move_is_not_judged(
    name: str, robot_at: tuple[float, float, float]
) -> None:
    here = with_belt(robot_at)
    writing(name, "/Belt", here)
    assert here.unplayed[""] == f"not simulated: /Graph/node changes {name} of /Belt"


def test_a_view_that_the_application_makes_is_written_to_in_every_stage() -> None:
    here = with_belt((0.0, 0.0, 0.0))
    assert writing("focalLength", "/OmniverseKit_Persp", here).failure is None
    assert here.unplayed == {}


def test_a_prim_that_is_not_there_is_not_written_to() -> None:
    writer = writing("visibility", "/Gone", with_belt((0.0, 0.0, 0.0)))
    assert writer.failure is not None
    assert writer.failure.kind == "no-target-prim"


@pytest.mark.parametrize(
    ("output", "is_simulated"), [("time", True), ("frame", False)], ids=["time", "frames"]
)
def test_only_what_is_known_of_the_timeline_is_simulated(
    tmp_path: Path, output: str, *, is_simulated: bool
) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "timeline.usda"))
    stage.DefinePrim("/Graph", "OmniGraph").CreateAttribute(
        "evaluator:type", Sdf.ValueTypeNames.Token
    ).Set("execution")
    types = Sdf.ValueTypeNames
    for name, kind in (
        ("tick", f"{ACTION}OnPlaybackTick"),
        ("now", f"{KIT}GetTimeline"),
        ("print", "omni.graph.ui_nodes.PrintText"),
        ("text", f"{KIT}ToString"),
    ):
        prim = stage.DefinePrim(f"/Graph/{name}", "OmniGraphNode")
        prim.CreateAttribute("node:type", types.Token).Set(kind)
    wires = (
        ("print.inputs:execIn", types.UInt, "tick.outputs:tick"),
        ("print.inputs:text", types.Token, "text.outputs:converted"),
        ("text.inputs:value", types.Token, f"now.outputs:{output}"),
    )
    for target, kind, source in wires:
        path, _, port = target.partition(".")
        attribute = stage.GetPrimAtPath(f"/Graph/{path}").CreateAttribute(port, kind)
        attribute.AddConnection(f"/Graph/{source}")
    stage.Save()
    said = invoke("sim", tmp_path / "timeline.usda").output
    assert ("not simulated: /Graph/now" not in said) is is_simulated
