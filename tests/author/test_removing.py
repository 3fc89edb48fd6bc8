"""`lab3 remove` takes away what was added: a text stage is then as it was, to the byte."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from foreign_robots import ROVER, add_rover, new_stage, rover_at
from in_process import invoke
from pxr import Sdf, Usd

from lab3_usd.author.adding import AddOptions, add_graphs
from lab3_usd.author.removing import remove_graph
from lab3_usd.author.request import Options, Request
from lab3_usd.errors import Lab3Error, UsageError
from lab3_usd.isaac.releases import BASE
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.pipeline.stage import JudgeSettings, lint_stage
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.spec.load.loader import load_lab

KINDS = tuple(lint_platform().recipes)
OPTIONS = {
    "gripper": Options(speed=0.001, open=0.04, close=0.0),
    "joints": Options(commands=True),
    "camera": Options(publish=("rgb", "bbox_3d")),
}


def add(path: Path, kind: str, options: Options | None = None) -> bool:
    """Add a graph; whether the stage changed."""
    added = add_graphs(path, [Request(kind, options or Options())], AddOptions(BASE))
    if added.data is not None:
        path.write_bytes(added.data)
    return added.data is not None


def remove(path: Path, kind: str, options: Options | None = None) -> None:
    removed = remove_graph(path, Request(kind, options or Options()), BASE)
    assert removed.data is not None
    path.write_bytes(removed.data)


@pytest.mark.parametrize(
    "kind", [k for k in KINDS if k not in {"ackermann", "holonomic", "imu", "position", "gripper"}]
)
def test_a_stage_is_as_it_was_after_adding_and_removing(tmp_path: Path, kind: str) -> None:
    path = rover_at(tmp_path)
    assert add(path, kind, OPTIONS.get(kind))
    remove(path, kind)
    assert path.read_bytes() == ROVER.read_bytes()


def test_graphs_can_be_removed_in_any_order(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    for kind in ("clock", "drive", "odometry"):
        add(path, kind)
    for kind in ("clock", "odometry", "drive"):
        remove(path, kind)
    assert path.read_bytes() == ROVER.read_bytes()


def test_of_an_extended_graph_the_new_nodes_go(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    add(path, "clock", Options(graph="/World/Ros"))
    before = path.read_bytes()
    add(path, "odometry", Options(into="/World/Ros"))
    remove(path, "odometry")
    assert path.read_bytes() == before


def test_a_parent_that_was_there_before_stays(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    stage = Usd.Stage.Open(str(path))
    stage.DefinePrim("/World/Graphs", "Scope")
    stage.Save()
    del stage
    before = path.read_bytes()
    add(path, "clock")
    remove(path, "clock")
    assert path.read_bytes() == before


def test_two_graphs_of_a_kind_are_asked_about(tmp_path: Path) -> None:
    path = tmp_path / "two.usda"
    stage = new_stage(path)
    for name in ("alpha", "beta"):
        add_rover(stage, f"/World/{name}")
    stage.Save()
    del stage
    for name in ("alpha", "beta"):
        add(path, "drive", Options(robot=f"/World/{name}"))
    with pytest.raises(UsageError, match="/World/Graphs/Drive_beta"):
        remove_graph(path, Request("drive"), BASE)
    remove(path, "drive", Options(robot="/World/beta"))
    with pytest.raises(UsageError, match="no graph of the kind drive of /World/beta"):
        remove_graph(path, Request("drive", Options(robot="/World/beta")), BASE)
    assert not Usd.Stage.Open(str(path)).GetPrimAtPath("/World/Graphs/Drive_beta")


def test_of_two_graphs_of_a_kind_the_one_goes_that_is_asked_for(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    add(path, "joints")
    before = path.read_bytes()
    commands = Options(states=False, commands=True)
    add(path, "joints", commands)
    remove(path, "joints", commands)
    assert path.read_bytes() == before


def test_a_kind_that_is_not_there_is_said_with_the_graphs_there_are(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    add(path, "clock")
    with pytest.raises(UsageError, match="/World/Graphs/Clock"):
        remove_graph(path, Request("drive"), BASE)


def test_the_command_shows_before_it_writes(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    add(path, "clock")
    before = path.read_bytes()
    assert "would remove /World/Graphs" in invoke("remove", "clock", path).output
    assert path.read_bytes() == before
    assert invoke("remove", "clock", path, "--in-place").exit_code == 0
    assert path.read_bytes() == ROVER.read_bytes()


PARTS = 13  # of the stages, each a test of its own


@pytest.mark.parametrize("part", range(PARTS))
def test_every_robot_takes_every_kind_that_fits_and_gives_it_back(
    shared: Path, tmp_path: Path, part: int
) -> None:
    """Each is added, linted, played if it drives, added again to no effect, and removed."""
    stages = tmp_path / "stages"
    shutil.copytree(shared / "authoring" / "stages", stages)
    wrong, right = [], 0
    for file in sorted((shared / "authoring" / "stages").glob("*.usda"))[part::PARTS]:
        path, original = stages / file.name, file.read_bytes()
        path.chmod(0o644)
        for kind in KINDS:
            request = Request(kind, OPTIONS.get(kind, Options()))
            try:
                added = add_graphs(path, [request], AddOptions(BASE))
            except Lab3Error:
                continue  # it does not fit, or asks
            if added.data is None:
                continue
            path.write_bytes(added.data)
            again = add_graphs(path, [request], AddOptions(BASE))
            played = bad_checks(path) if kind in DRIVES and file.name not in TURNED else []
            removed = remove_graph(path, Request(kind), BASE)
            if added.new or again.data is not None or removed.data != original or played:
                wrong.append((file.name, kind, added.new, played))
            path.write_bytes(original)
            right += 1
    assert wrong == []
    assert right


DRIVES = ("drive", "ackermann", "holonomic")
# Not played: robots drive with Z up only; rollers whose written angle turns the robot round; a tree
# of transforms of its own that odometry is not part of.
TURNED = ("yup.usda", "omni3.usda", "has_tf.usda")


def bad_checks(path: Path) -> list[str]:
    checks = dry_run(path, load_lab(), "").behaviour.checks
    bad = [check for check in checks if check.verdict == "bad"]
    # Robots of two wheels whose castor has no collider tip over, whatever drives them.
    return [f"{check.name}: {check.text}" for check in bad if "tips over" not in check.cause]


def test_what_the_linter_told_before_is_no_consequence_of_removing(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    stage = Usd.Stage.Open(str(path))
    laser = stage.GetPrimAtPath("/World/Rover/chassis/laser")
    laser.CreateAttribute("omni:sensor:tickRate", Sdf.ValueTypeNames.Double).Set(0.0)
    stage.Save()
    del stage, laser
    add(path, "clock")
    found = lint_stage(path, JudgeSettings()).findings
    assert found
    assert remove_graph(path, Request("clock"), BASE).new == ()


def test_the_help_of_removing_speaks_of_no_new_graph() -> None:
    words = " ".join(invoke("remove", "--help").output.split())
    assert "--graph PATH The graph to remove." in words
    assert "Where the new graph stands" not in words
    assert "--radius" not in words


def test_the_words_that_added_a_graph_remove_it(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    words = ("drive", path, "--radius", "0.1", "--in-place")
    assert invoke("add", *words).exit_code == 0
    assert invoke("remove", *words).exit_code == 0
    assert path.read_bytes() == ROVER.read_bytes()


def test_a_graph_that_somebody_else_made_is_named_before_it_goes(tmp_path: Path) -> None:
    path = rover_at(tmp_path)
    invoke("add", "tf", path, "--in-place")
    assert "not added by lab3" not in invoke("remove", "tf", path).output
    layer = Sdf.Layer.FindOrOpen(str(path))
    for prim in ("/World/Graphs", "/World/Graphs/TF"):
        layer.GetPrimAtPath(prim).ClearInfo("customData")
    layer.Save()
    named, going, _ = invoke("remove", "tf", path).output.splitlines()
    assert "/World/Graphs/TF was not added by lab3, but does what lab3 add tf adds" in named
    assert "would remove /World/Graphs" in going
    assert not json.loads(invoke("remove", "tf", path, "--format", "json").output)["added_by_lab3"]
