"""The same graphs, written by another author and spread over other files, are no mistake."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import breaking
import pytest
from handout_table import FOOTPRINT, ROBOT, graphs_until
from layerings import LAYERINGS, copied, one_text_file, with_relative_paths
from pxr import Sdf, Usd
from second_author import MIXED, STYLES, Style, author_lab

from lab3_usd.model.finding import StageResult
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import build_checkpoint

Write = Callable[[Path, Path, str, Style], Path]


@pytest.fixture(scope="module")
def starter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_checkpoint(None, "00", tmp_path_factory.mktemp("starter") / "Lab3_00.usda")


def said(result: StageResult, *severities: str) -> list[tuple[str, str, str | None]]:
    return [
        (finding.rule, finding.prim, finding.property)
        for finding in result.findings
        if finding.severity in severities
    ]


def assert_clean(result: StageResult) -> None:
    assert not result.crashes
    assert said(result, "error", "warning") == []
    assert result.score.earned == result.score.possible > 0


# Of the other styles lint finds no fault (test_lint_precision.py).
@pytest.mark.parametrize("name", [*STYLES][::2])
def test_however_the_graphs_are_written(starter: Path, tmp_path: Path, name: str) -> None:
    assert_clean(check_stage(one_text_file(tmp_path, starter, "05", STYLES[name]), "05"))


@pytest.mark.parametrize(
    ("checkpoint", "write"),
    [
        *(("05", write) for write in LAYERINGS),
        *list(zip(load_lab().checkpoints, LAYERINGS, strict=False))[1::3],
        ("08", LAYERINGS[4]),
    ],
)
def test_however_the_stage_is_spread_over_files(
    starter: Path, tmp_path: Path, checkpoint: str, write: Write
) -> None:
    assert_clean(check_stage(write(tmp_path, starter, checkpoint, MIXED), checkpoint))


def test_relative_paths_are_really_in_the_file(starter: Path, tmp_path: Path) -> None:
    path = with_relative_paths(tmp_path, starter, "05", Style())
    assert path.read_text().count(".connect = <../") == 50


@pytest.mark.parametrize("seed", range(3))
def test_no_order_of_nodes_and_ports_matters(starter: Path, tmp_path: Path, seed: int) -> None:
    path = one_text_file(tmp_path, starter, "05", replace(MIXED, names="random", seed=100 + seed))
    assert_clean(check_stage(path, "05"))


# What decisions of the lab say of graphs that work, though they are not quite the handout's.


def stage_of(starter: Path) -> Usd.Stage:
    return breaking.copied(_authored(starter).GetRootLayer())


@cache
def _authored(starter: Path) -> Usd.Stage:
    stage = copied(starter)
    author_lab(stage, "05", Style(names="editor"))
    return stage


def judged(stage: Usd.Stage, folder: Path) -> StageResult:
    path = folder / "Lab3_05_changed.usda"
    stage.GetRootLayer().Export(str(path))
    return check_stage(path)


def _copy(stage: Usd.Stage, source: str, target: str) -> None:
    Sdf.CopySpec(stage.GetRootLayer(), source, stage.GetRootLayer(), target)


@pytest.mark.parametrize("kind", ["ros2_context", "on_playback_tick"])
def test_a_second_equal_node_stands_in_for_the_first(
    starter: Path, tmp_path: Path, kind: str
) -> None:
    graph = f"{ROBOT}/ROS_Drive"
    stage = stage_of(starter)
    _copy(stage, f"{graph}/{kind}", f"{graph}/{kind}_01")
    port = "inputs:context" if kind == "ros2_context" else "inputs:execIn"
    wired = stage.GetPrimAtPath(f"{graph}/ros2_subscribe_twist").GetAttribute(port)
    source = wired.GetConnections()[0]
    wired.SetConnections([source.ReplacePrefix(f"{graph}/{kind}", f"{graph}/{kind}_01")])
    result = judged(stage, tmp_path)
    assert said(result, "error") == []
    rules = [rule for rule, _, _ in said(result, "warning")]
    assert rules == ["N02"]
    assert result.score.earned == result.score.possible


def test_a_second_context_with_another_domain_stands_in_for_nothing(
    starter: Path, tmp_path: Path
) -> None:
    graph = f"{ROBOT}/ROS_Drive"
    stage = stage_of(starter)
    _copy(stage, f"{graph}/ros2_context", f"{graph}/ros2_context_01")
    stage.GetPrimAtPath(f"{graph}/ros2_context_01").GetAttribute("inputs:domain_id").Set(7)
    wired = stage.GetPrimAtPath(f"{graph}/ros2_subscribe_twist").GetAttribute("inputs:context")
    wired.SetConnections([f"{graph}/ros2_context_01.outputs:context"])
    errors = said(judged(stage, tmp_path), "error")
    assert len(errors) == 1


def test_type_names_from_before_4_5_are_one_warning_per_graph(
    starter: Path, tmp_path: Path
) -> None:
    stage = stage_of(starter)
    old = {
        "isaacsim.core.nodes.": "omni.isaac.core_nodes.",
        "isaacsim.ros2.bridge.": "omni.isaac.ros2_bridge.",
        "isaacsim.robot.wheeled_robots.": "omni.isaac.wheeled_robots.",
    }
    for prim in stage.Traverse():
        name = prim.GetAttribute("node:type").Get() if prim.HasAttribute("node:type") else ""
        for new, before in old.items():
            if name.startswith(new):
                prim.GetAttribute("node:type").Set(name.replace(new, before))
    result = judged(stage, tmp_path)
    assert said(result, "error") == []
    expected = sorted(("N06", graph.path, None) for graph in graphs_until("05"))
    assert sorted(said(result, "warning")) == expected


def test_a_port_that_only_older_versions_have_is_no_fault(starter: Path, tmp_path: Path) -> None:
    stage = stage_of(starter)
    time = stage.GetPrimAtPath("/World/ROS_Clock/isaac_read_simulation_time")
    time.CreateAttribute("inputs:swhFrameNumber", Sdf.ValueTypeNames.UInt, custom=True).Set(0)
    assert_clean(judged(stage, tmp_path))


def test_targets_may_stand_in_any_order(starter: Path, tmp_path: Path) -> None:
    stage = stage_of(starter)
    node = stage.GetPrimAtPath(f"{ROBOT}/ROS_OdomTF/isaac_compute_transform_tree")
    targets = node.GetRelationship("inputs:targetPrims")
    targets.SetTargets(targets.GetTargets()[::-1])
    assert_clean(judged(stage, tmp_path))


def test_a_settings_prim_below_a_graph_is_no_node(starter: Path, tmp_path: Path) -> None:
    stage = stage_of(starter)
    below = stage.DefinePrim("/World/ROS_Clock/computegraphSettings", "ComputeGraphSettings")
    below.SetActive(False)  # noqa: FBT003 - pxr takes it so
    assert_clean(judged(stage, tmp_path))


@pytest.mark.parametrize("top", ["/Replicator", "/Render"])
def test_graphs_that_isaac_sim_makes_for_itself_are_ignored(
    starter: Path, tmp_path: Path, top: str
) -> None:
    stage = stage_of(starter)
    stage.DefinePrim(top)
    stage.DefinePrim(f"{top}/SDGPipeline", "OmniGraph")
    _copy(stage, "/World/ROS_Clock/ros2_publish_clock", f"{top}/SDGPipeline/publish")
    assert_clean(judged(stage, tmp_path))


def test_a_render_product_that_was_saved_while_running_is_ignored(
    starter: Path, tmp_path: Path
) -> None:
    stage = stage_of(starter)
    node = stage.GetPrimAtPath(f"{FOOTPRINT}/Camera_1/ROS_Camera/isaac_create_render_product")
    node.GetRelationship("inputs:renderProductPrim").SetTargets(
        ["/Render/HydraTextures/Replicator"]
    )
    assert_clean(judged(stage, tmp_path))
