"""What the linter must not find fault with: graphs that work, whoever wrote them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
import quick_yaml
from foreign_robots import add_api, connect, rover, write_node
from layerings import copied
from linting import broken_robot, found_by, linted, said_by, sites_of
from menu_graphs import MENUS, with_menus
from places import REPOSITORY, TESTS
from pxr import Sdf, Usd
from scene_stages import deactivate
from second_author import MIXED, STYLES, author_lab

from lab3_usd import build_checkpoint
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.report.entries import site
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.stage_reader import read_model

EXAMPLE = REPOSITORY / "docs" / "examples" / "carter.usda"
JUDGED = TESTS / "lint_judged.yaml"
# The pairs that publish or move the same thing twice, or share a node.
RIVALS = {
    ("tf", "odometry"): {"K50"},
    ("differential", "differential by number"): {"K22"},
    ("differential", "NVIDIA's differential test"): {"K65"},
    ("differential by number", "NVIDIA's differential test"): {"K65"},
    ("odometry", "NVIDIA's differential test"): {"K40"},
}

OF_RIVALS = sorted({name for pair in RIVALS for name in pair})
# Any two that are no rivals stand together in one of these stages.
AT_PEACE = [pair for pair in combinations(OF_RIVALS, 2) if not {pair, pair[::-1]} & RIVALS.keys()]
NOBODYS_RIVALS = [name for name in MENUS if name not in OF_RIVALS]


@pytest.fixture(scope="module")
def starter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_checkpoint(None, "00", tmp_path_factory.mktemp("starter") / "Lab3_00.usda")


def is_found(site: str, stage: Usd.Stage, release: str) -> bool:
    """Whether the rule that a site begins with finds it in a stage of a release."""
    return site in sites_of(found_by(site.partition(" ")[0], stage, release))


@pytest.mark.parametrize("name", MENUS)
def test_a_menu_of_isaac_sim_builds_no_fault(name: str) -> None:
    rules = {line.split()[0] for line in said_by(with_menus(name), "error", "warning")}
    # A menu that makes no clock leaves it to another one.
    assert rules <= {"K47"}


@pytest.mark.parametrize("pair", RIVALS, ids=" and ".join)
def test_menus_that_are_rivals_build_their_fault(pair: tuple[str, str]) -> None:
    rules = {line.split()[0] for line in said_by(with_menus(*pair), "error")}
    assert rules == RIVALS[pair]


@pytest.mark.parametrize("pair", AT_PEACE, ids=" and ".join)
def test_menus_that_are_no_rivals_build_no_fault(pair: tuple[str, str]) -> None:
    assert said_by(with_menus(*pair, *NOBODYS_RIVALS), "error") == []


@pytest.mark.parametrize(
    "name", ["differential", "differential by number", "NVIDIA's differential test"]
)
def test_joints_that_a_message_names_may_be_commanded_twice(name: str) -> None:
    found = said_by(with_menus("joint states", name), "warning")
    assert [line.split()[0] for line in found if line.startswith("K65")] == ["K65"]


@pytest.mark.parametrize("release", ["5.0", "5.1", "6.1", "6.2"])
def test_the_clock_of_a_menu_has_no_fault_in_an_earlier_release(release: str) -> None:
    assert said_by(with_menus("clock"), "error", "warning", release=release) == []


@pytest.mark.parametrize(
    ("node_type", "release", "told"),
    [
        ("isaacsim.robot.wheeled_robots.AckermannSteering", "6.0", "K30"),
        ("isaacsim.robot.wheeled_robots.AckermannSteering", "5.1", None),
        ("isaacsim.core.nodes.IsaacComputeTransformTree", "5.1", "K30"),
        ("isaacsim.core.nodes.IsaacComputeTransformTree", "6.0", None),
        ("isaacsim.zmq.nodes.ZMQPublishClock", "6.0", "K30"),
        ("isaacsim.zmq.nodes.ZMQPublishClock", "6.1", None),
        ("omni.physx.graph.OnTriggerCollider", "5.0", None),
        ("omni.isaac.core_nodes.IsaacReadSimulatinTime", "6.0", "K32"),
        ("isaacsim.core.nodes.IsaacReadSimulatinTime", "6.0", "K30"),
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


def test_a_type_of_a_later_release_tells_which_release_fits() -> None:
    stage = rover()
    write_node(stage, "/World/Clock/other", "isaacsim.zmq.nodes.ZMQPublishClock", {})
    told = {each.rule: each for each in linted(stage).findings if "other" in each.prim}
    assert told["K30"].hint == (
        "replace the node by one that this release has, or use another; "
        "judge by that release with --isaac 6.1"
    )
    assert told["K36"].actual == "6.2"


def test_a_camera_helper_took_a_window_before_six() -> None:
    stage = rover()
    helper = stage.GetPrimAtPath("/World/Camera/helper")
    helper.GetAttribute("inputs:renderProductPath").ClearConnections()
    helper.CreateAttribute("inputs:viewport", Sdf.ValueTypeNames.Token).Set("Viewport")
    found = "K10 /World/Camera/helper inputs:renderProductPath"
    assert found in said_by(stage)
    assert found not in said_by(stage, release="5.1")
    model = read_model(stage, lint_platform("5.1"), "stage.usda")
    (image,) = (end for end in endpoints(model) if end.topic == "/rgb")
    assert image.runs


EARLY = ("2022.2", "2023.1", "4.2", "4.5")


def test_a_scan_needed_intensities_before_six() -> None:
    stage = rover()
    graph = "/World/Clock"
    ports = {"numRows": 1, "numCols": 2, "linearDepthData": [1.0, 2.0]}
    write_node(stage, f"{graph}/scan", "ros.ROS2PublishLaserScan", ports)
    connect(stage, graph, "tick.tick", "scan.execIn")
    connect(stage, graph, "time.simulationTime", "scan.timeStamp")
    found = f"K10 {graph}/scan inputs:intensitiesData"
    known = load_platform().known_releases
    assert [each for each in known if is_found(found, stage, each)] == [*EARLY, "5.0", "5.1"]


def test_a_camera_with_the_schema_of_a_lidar_was_one_before_six() -> None:
    stage = rover()
    camera = "/World/Rover/chassis/eye"
    add_api(stage.GetPrimAtPath(camera), "IsaacRtxLidarSensorAPI")
    stage.GetPrimAtPath("/World/Lidar/product").GetRelationship("inputs:cameraPrim").SetTargets(
        [camera]
    )
    found = "K70 /World/Lidar/helper inputs:renderProductPath"
    assert found in said_by(stage)
    assert found not in said_by(stage, release="5.1")


@pytest.mark.parametrize(
    ("kind", "releases"),
    [
        ("rgb_h264", ["6.0", "6.1", "6.2"]),
        ("rgb_hevc", ["6.1", "6.2"]),
        ("camera_info", ["2022.2", "2023.1", "4.2"]),
        ("depth", [*EARLY, "5.0", "5.1", "6.0", "6.1", "6.2"]),
    ],
)
def test_a_release_takes_the_kinds_of_images_that_it_has(kind: str, releases: list[str]) -> None:
    stage = rover()
    helper = stage.GetPrimAtPath("/World/Camera/helper")
    helper.CreateAttribute("inputs:type", Sdf.ValueTypeNames.Token).Set(kind)
    found = "K35 /World/Camera/helper inputs:type"
    known = load_platform().known_releases
    assert [each for each in known if not is_found(found, stage, each)] == releases


def test_camera_info_is_the_work_of_another_node_now() -> None:
    stage = rover()
    helper = stage.GetPrimAtPath("/World/Camera/helper")
    helper.CreateAttribute("inputs:type", Sdf.ValueTypeNames.Token).Set("camera_info")
    (found,) = (each for each in linted(stage).findings if each.rule == "K35")
    assert found.expected == "ROS2 Camera Info Helper"
    assert found.hint == "replace the node by a ROS2 Camera Info Helper"


def test_a_list_of_zeros_counts_from_a_later_release_on() -> None:
    stage = rover()
    controller = stage.GetPrimAtPath("/World/Drive/move")
    controller.GetAttribute("inputs:jointNames").ClearConnections()
    controller.CreateAttribute("inputs:jointIndices", Sdf.ValueTypeNames.IntArray).Set([0])
    found = "K69 /World/Drive/move inputs:jointIndices"
    known = load_platform().known_releases
    ignoring = [each for each in known if is_found(found, stage, each)]
    assert ignoring == [*EARLY, "5.0", "5.1", "6.0"]


def test_a_robot_stands_for_its_first_link_from_six_on() -> None:
    stage = rover()
    robot = stage.GetPrimAtPath("/World/Rover")
    robot.CreateRelationship("isaac:physics:robotLinks").SetTargets(["/World/Rover/chassis"])
    compute = stage.GetPrimAtPath("/World/Odometry/compute")
    compute.GetRelationship("inputs:chassisPrim").SetTargets([robot.GetPath()])
    found = "K67 /World/Odometry/compute inputs:chassisPrim"
    assert found not in said_by(stage)
    assert found in said_by(stage, release="5.1")


def in_two_domains(first: int | None, second: int) -> Usd.Stage:
    """Return a robot whose graphs stand there twice, each time in a domain of its own."""
    stage = rover()
    layer = stage.GetRootLayer()
    stage.DefinePrim("/Second", "Xform")
    for name in ("Clock", "Odometry", "Lidar", "Camera"):
        Sdf.CopySpec(layer, f"/World/{name}", layer, f"/Second/{name}")
        for top, domain in (("/World", first), ("/Second", second)):
            context = stage.GetPrimAtPath(f"{top}/{name}/context")
            for port, kind, value in (
                ("domain_id", Sdf.ValueTypeNames.UChar, domain or 0),
                ("useDomainIDEnvVar", Sdf.ValueTypeNames.Bool, domain is None),
            ):
                context.CreateAttribute(f"inputs:{port}", kind).Set(value)
    return stage


def test_two_robots_in_two_domains_are_no_rivals() -> None:
    assert said_by(in_two_domains(1, 2), "error") == []


def test_two_robots_in_one_domain_are_rivals() -> None:
    rules = {each.split()[0] for each in said_by(in_two_domains(1, 1), "error")}
    assert rules == {"K40", "K54"}


def test_a_domain_that_the_environment_may_change_makes_rivals_uncertain() -> None:
    found = linted(in_two_domains(None, 0))
    assert sites_of(found, "error") == []
    assert {"K40", "K54"} <= {each.split()[0] for each in sites_of(found, "warning")}


# In the other styles check finds no fault (test_indifference.py).
@pytest.mark.parametrize("style", [*[*STYLES.values()][1::2], MIXED])
def test_another_author_of_the_lab_makes_no_fault(starter: Path, style: object) -> None:
    stage = copied(starter)
    author_lab(stage, "05", style)  # type: ignore[arg-type]  # styles of the same module
    found = linted(stage)
    assert sites_of(found, "error") == []
    warnings = {each.split()[0] for each in sites_of(found, "warning")}
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
    found = []
    for path in sorted((shared / "corpus").rglob("*.usd*")):
        if {"payloads", "field"}.isdisjoint(path.parts):
            name = path.stem.replace("__", " ")
            kept = [finding for finding in lint_stage(path).findings if finding.severity != "note"]
            found += [(name, f"{each.severity} {each.rule}", site(each)) for each in kept]
    judged = quick_yaml.load(JUDGED.read_text(encoding="utf-8"))
    rows = [(name, row["finding"], row["at"]) for name, rows in judged.items() for row in rows]
    assert rows == found


def test_nothing_crashes_on_any_release() -> None:
    for release in load_platform().known_releases:
        assert not linted(with_menus(*MENUS), release).crashes


LEGAL: dict[str, Any] = quick_yaml.load((TESTS / "lint_legal.yaml").read_text())


@pytest.mark.parametrize("name", LEGAL)
def test_an_unusual_stage_that_works_has_no_error(name: str) -> None:
    case = LEGAL[name] if isinstance(LEGAL[name], dict) else {"steps": LEGAL[name]}
    assert said_by(broken_robot(case.get("robot", "rover"), case["steps"]), "error") == []


def test_there_are_enough_unusual_stages() -> None:
    assert len(LEGAL) >= 25
