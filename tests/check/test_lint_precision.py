"""What the linter must not find fault with: graphs that work, whoever wrote them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest
from foreign_robots import rover
from layerings import copied
from linting import linted, said_by
from menu_graphs import MENUS, with_menus
from places import REPOSITORY
from pxr import Sdf
from scene_changes import deactivate
from second_author import MIXED, STYLES, author_lab

from lab3_usd import build_checkpoint
from lab3_usd.judge.lint import lint_stage
from lab3_usd.report.entries import site

EXAMPLE = REPOSITORY / "docs" / "examples" / "carter.usda"
# The pairs that publish or move the same thing twice.
RIVALS = {
    ("tf", "odometry"): {"K50"},
    ("differential", "NVIDIA's differential test"): {"K65"},
}


@pytest.fixture(scope="module")
def starter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_checkpoint(None, "00", tmp_path_factory.mktemp("starter") / "Lab3_00.usda")


@pytest.mark.parametrize("name", MENUS)
def test_a_menu_of_isaac_sim_builds_no_fault(name: str) -> None:
    rules = {line.split()[0] for line in said_by(with_menus(name), "error", "warning")}
    # A menu that makes no clock leaves it to another one.
    assert rules <= {"K47"}


@pytest.mark.parametrize("pair", list(combinations(MENUS, 2)), ids=" and ".join)
def test_two_menus_build_no_fault_unless_they_are_rivals(pair: tuple[str, str]) -> None:
    rules = {line.split()[0] for line in said_by(with_menus(*pair), "error")}
    assert rules == RIVALS.get(pair, set())


@pytest.mark.parametrize("release", ["5.0", "5.1"])
def test_the_clock_of_a_menu_has_no_fault_in_an_earlier_release(release: str) -> None:
    assert said_by(with_menus("clock"), "error", "warning", release=release) == []


@pytest.mark.parametrize(
    ("node_type", "release", "told"),
    [
        ("isaacsim.robot.wheeled_robots.AckermannSteering", "6.0", "K30"),
        ("isaacsim.robot.wheeled_robots.AckermannSteering", "5.1", "K32"),
        ("isaacsim.core.nodes.IsaacComputeTransformTree", "5.1", "K30"),
        ("isaacsim.core.nodes.IsaacComputeTransformTree", "6.0", None),
    ],
)
def test_a_type_is_judged_by_the_release_that_is_asked_for(
    node_type: str, release: str, told: str | None
) -> None:
    stage = rover()
    node = stage.DefinePrim("/World/Clock/other", "OmniGraphNode")
    node.CreateAttribute("node:type", Sdf.ValueTypeNames.Token).Set(node_type)
    said = {each.split()[0] for each in said_by(stage, release=release) if "Clock/other" in each}
    assert said & {"K30", "K32"} == ({told} if told else set())


@pytest.mark.parametrize("style", [*STYLES.values(), MIXED])
def test_another_author_of_the_lab_makes_no_fault(starter: Path, style: object) -> None:
    stage = copied(starter)
    author_lab(stage, "05", style)  # type: ignore[arg-type]  # styles of the same module
    assert said_by(stage, "error") == []
    warnings = {each.split()[0] for each in said_by(stage, "warning")}
    assert warnings <= {"K64"}  # the handout's wheel radius


def test_a_graph_that_others_inherit_is_judged_where_it_is_inherited() -> None:
    stage = with_menus("clock")
    layer, graph = stage.GetRootLayer(), "/Graph/ROS_Clock"
    Sdf.PrimSpec(layer, "Templates", Sdf.SpecifierClass)
    Sdf.CopySpec(layer, graph, layer, "/Templates/Clock")
    stage.RemovePrim(graph)
    stage.DefinePrim(graph, "OmniGraph").GetInherits().AddInherit("/Templates/Clock")
    assert said_by(stage, "error", "warning") == []
    deactivate(f"{graph}/OnPlaybackTick")(stage)
    assert {each.split()[1] for each in said_by(stage, "error")} == {f"{graph}/PublishClock"}


def test_missing_connections_of_a_vendor_are_named() -> None:
    found = lint_stage(EXAMPLE).findings
    assert [(each.rule, f"{each.prim.rpartition('/')[2]}.{each.property}") for each in found] == [
        ("K11", "joint_name_array.inputs:input0"),
        ("K01", "publish_odometry.inputs:execIn"),
        ("K10", "publish_transform_tree.inputs:timeStamp"),
        ("K47", "publish_odom_transform.None"),
        ("K53", "publish_odom_transform.None"),
    ]


def test_every_finding_of_a_real_stage_was_judged(shared: Path) -> None:
    told = []
    for path in sorted((shared / "corpus").rglob("*.usd*")):
        if "payloads" not in path.parts:
            name = path.stem.replace("__", " ")
            found = [finding for finding in lint_stage(path).findings if finding.severity != "note"]
            told += [f"| {name} | {each.severity} {each.rule} | `{site(each)}`" for each in found]
    page = (EXAMPLE.parents[1] / "lint-corpus.md").read_text().splitlines()
    judged = [row.rpartition(" | right")[0] for row in page if " | right" in row]
    assert judged == told


def test_nothing_crashes_on_any_release() -> None:
    for release in ("5.0", "5.1", "6.0"):
        assert not linted(with_menus(*MENUS), release).crashes
