"""A class of students who made one mistake each, and carried it along to the last stage."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from breaking import Step, the_lab
from fault_stages import STAGES, steps
from msgspec import Struct
from msgspec.structs import replace
from pxr import Sdf, Usd
from quick_yaml import load
from scene_changes import Change
from scene_sabotage import scene_sabotage

from lab3_usd.check.checker import judge
from lab3_usd.stage.read.stage_reader import read_model

CASES = Path(__file__).resolve().parents[1] / "cases"
GRAPHS = ("ROS_Clock", "ROS_Drive", "ROS_Lidar2D", "ROS_Camera", "ROS_OdomTF")
PUBLISHERS = (
    "ROS_Clock/ros2_publish_clock",
    "ROS_Drive/ros2_subscribe_twist",
    "ROS_Lidar2D/ros2_rtx_lidar_helper",
    "ROS_Camera/ros2_camera_helper",
    "ROS_OdomTF/ros2_publish_odometry",
)
MENU = load((CASES / "N12.yaml").read_text(encoding="utf-8"))["break"]


class Mistake(Struct, frozen=True):
    """A mistake of a student: what it is called, and how to make it in a stage.

    `changes` are made one by one, in each stage that has what they change. Those that are `gross`
    stop what the lab is about.
    """

    name: str
    changes: tuple[Change, ...]
    gross: bool = False

    def make(self, stage: Usd.Stage) -> bool:
        """Make it as far as the stage has what it is about, and return whether anything is."""
        before = stage.GetRootLayer().ExportToString() if self.changes else ""
        return self.made_in(stage, before) != before

    def made_in(self, stage: Usd.Stage, text: str) -> str:
        """Make it in a stage of this text, as far as it can be made, and return the text then."""
        layer = stage.GetRootLayer()
        for change in self.changes:
            try:
                change(stage)
            except Exception:  # noqa: BLE001, PERF203 - usd-core raises whatever it likes for what is not there
                layer.ImportFromString(text)
            else:
                text = layer.ExportToString()
        return text


def _each(step: Callable[[str], list[Step]], names: tuple[str, ...]) -> tuple[Change, ...]:
    return tuple(steps(*step(name)) for name in names)


def _gross() -> Iterator[Mistake]:
    """Yield what stops a whole stage from working, with every graph that it has."""
    on_demand = {"pipelineStage": "pipelineStageOnDemand"}
    yield Mistake(
        "all graphs on demand",
        _each(lambda g: [{"set": [f"{g}.{k}", v]} for k, v in on_demand.items()], GRAPHS),
    )
    yield Mistake("no tick", _each(lambda g: [{"remove": f"{g}/on_playback_tick"}], GRAPHS))
    yield Mistake(
        "no tick wired", (lambda stage: _cut_all(stage, "on_playback_tick.outputs:tick"),)
    )
    yield Mistake("no context wired", (lambda stage: _cut_all(stage, "ros2_context.outputs:"),))
    yield Mistake(
        "all five topics wrong",
        _each(lambda node: [{"set": [f"{node}.inputs:topicName", "/wrong"]}], PUBLISHERS),
    )
    yield Mistake(
        "a namespace at every node",
        _each(
            lambda node: [{"declare": [f"{node}.inputs:nodeNamespace", "string", "robot1"]}],
            PUBLISHERS,
        ),
    )
    yield Mistake("a second controller", (steps(*MENU),))
    for graph in GRAPHS:
        yield Mistake(f"{graph} twice", (steps({"copy": [graph, f"/World/{graph}_copy"]}),))
        yield Mistake(f"a script in {graph}", (steps({
            "node": [f"{graph}/script", "omni.graph.scriptnode.ScriptNode"]
        }),))  # fmt: skip
        yield Mistake(f"{graph} removed", (steps({"remove": graph}),))
        yield Mistake(f"{graph} on demand", (steps({
            "set": [f"{graph}.pipelineStage", "pipelineStageOnDemand"]
        }),))  # fmt: skip
    yield Mistake("garbage maps", ())


def _cut_all(stage: Usd.Stage, source: str) -> None:
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            if any(source in str(path) for path in attribute.GetConnections()):
                attribute.ClearConnections()


def mistakes() -> Iterator[Mistake]:
    """Yield gross mistakes, those of the case files, of the dry run, and of the scene."""
    yield from (replace(mistake, gross=True) for mistake in _gross())
    for path in sorted(CASES.glob("*.yaml")):
        data = load(path.read_text(encoding="utf-8"))
        yield Mistake(f"case {path.stem}", (steps(*data["break"]),))
        for name, more in data.get("more", {}).items():
            yield Mistake(f"case {path.stem} {name}", (steps(*more["break"]),))
    for kind, (change, _) in STAGES.items():
        yield Mistake(f"fault {kind}", (change,))
    for sabotage in scene_sabotage():
        yield Mistake(f"scene {sabotage.name}", (sabotage.apply,))


def failing_at(checkpoint: str, right: Path) -> Iterator[Mistake]:
    """Yield the mistakes with which `check` fails the right stage of a checkpoint."""
    lab = the_lab()
    layer = Sdf.Layer.FindOrOpen(str(right))
    for mistake in mistakes():
        copy = Sdf.Layer.CreateAnonymous(".usda")
        copy.TransferContent(layer)
        stage = Usd.Stage.Open(copy)
        if not mistake.changes:
            yield mistake
        elif mistake.make(stage):
            judged = judge(
                lab, lab.checkpoints[checkpoint], read_model(stage, lab.platform, right.name)
            )
            if any(finding.severity == "error" for finding in judged.findings):
                yield mistake


def hand_in(mistake: Mistake, right: Path, folder: Path) -> None:
    """Write the submission of a student who made it: the right one, with it in every stage."""
    shutil.copytree(right, folder)
    for path in sorted(folder.glob("maps/*")) if not mistake.changes else ():
        path.write_bytes(b"garbage")
    for path in sorted(folder.glob("work/*.usda")):
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.TransferContent(Sdf.Layer.FindOrOpen(str(path)))
        if mistake.make(Usd.Stage.Open(layer)):
            layer.Export(str(path))
