"""The nine built stages, walked with a table typed from the handout."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations, product
from pathlib import Path
from typing import Any

import pytest
from handout_table import (
    CAMERA,
    CLOCK_LAYOUT,
    COUNTS,
    FILES,
    GRAPHS,
    ROS_CLOCK,
    ROS_DRIVE,
    SENSORS,
    TYPES,
    Graph,
    Sensor,
    Wire,
)
from in_process import invoke
from pxr import Gf, Sdf, Usd, UsdGeom, UsdValidation

from lab3_usd.grade.rubric import everything_asked, load_rubric
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.write.builder import BuildOptions, build_files, plan_files

Nodes = dict[str, Usd.Prim]
STAGES = range(6)  # the later ones are the last of them, byte for byte
HELD = [
    pytest.param(number, graph, id=f"{number:02}-{graph.path.rpartition('/')[2]}")
    for number in STAGES
    for graph in GRAPHS
    if number >= graph.since
]
SENSED = [
    pytest.param(number, sensor, id=f"{number:02}-{sensor.path.rpartition('/')[2]}")
    for number in STAGES
    for sensor in SENSORS
    if number >= sensor.since
]
# What Isaac Sim writes on every node besides its ports.
OF_EVERY_NODE = {
    "node:type",
    "node:typeVersion",
    "ui:nodegraph:node:expansionState",
    "ui:nodegraph:node:pos",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    lab = load_lab()
    out = tmp_path_factory.mktemp("nine")
    build_files(lab, None, plan_files(lab, out, list(lab.checkpoints), "usda"), BuildOptions())
    return out


@pytest.fixture(scope="module")
def stages(folder: Path) -> list[Usd.Stage]:
    return [Usd.Stage.Open(str(folder / f"{name}.usda")) for name in FILES]


def wires_into(prim: Usd.Prim) -> Iterator[tuple[Sdf.Path, str]]:
    """Each connection as its source and the name of the attribute that it ends at."""
    for attribute in prim.GetAttributes():
        for source in attribute.GetConnections():
            yield source, attribute.GetName()


def wires_of(nodes: Nodes) -> list[Wire]:
    """All wires between nodes, under the handout's names; strangers keep their path."""
    name_of = {prim.GetPath(): name for name, prim in nodes.items()}
    wires = []
    for name, prim in nodes.items():
        for source, port in wires_into(prim):
            origin = source.GetPrimPath()
            wires.append((name_of.get(origin, str(origin)), source.name, name, port))
    return wires


def values_of(prim: Usd.Prim) -> dict[str, Any]:
    return {
        attribute.GetName(): attribute.Get()
        for attribute in prim.GetAttributes()
        if attribute.HasAuthoredValue() and attribute.GetName() not in OF_EVERY_NODE
    }


def likeness(graph: Graph, nodes: Nodes) -> int:
    right = len(set(wires_of(nodes)) & set(graph.wires))
    return right + sum(values_of(prim) == graph.values.get(n, {}) for n, prim in nodes.items())


def assignments(graph: Graph, prims: list[Usd.Prim]) -> Iterator[Nodes]:
    """Every way to name the prims as the handout does that keeps to the types."""
    by_type: dict[str, list[Usd.Prim]] = {}
    for prim in prims:
        by_type.setdefault(prim.GetAttribute("node:type").Get(), []).append(prim)
    wanted: dict[str, list[str]] = {}
    for name, node_type in graph.nodes.items():
        wanted.setdefault(node_type, []).append(name)
    orders = [permutations(by_type.get(each, [])) for each in wanted]
    for chosen in product(*orders):
        pairs = zip(wanted.values(), chosen, strict=True)
        yield {n: p for names, some in pairs for n, p in zip(names, some, strict=False)}


def named_nodes(stage: Usd.Stage, graph: Graph) -> Nodes:
    """The graph's prims by the handout's names, which the names of the prims do not decide."""
    prims = stage.GetPrimAtPath(graph.path).GetChildren()
    return max(assignments(graph, prims), key=lambda nodes: likeness(graph, nodes))


@pytest.mark.parametrize(("graph", "counts"), list(zip(GRAPHS, COUNTS, strict=True)))
def test_the_table_itself_is_complete(graph: Graph, counts: tuple[int, int]) -> None:
    assert (len(graph.nodes), len(set(graph.wires))) == counts
    ends = {name for source, _, target, _ in graph.wires for name in (source, target)}
    assert ends == set(graph.nodes)
    assert {*graph.values, *graph.targets} <= set(graph.nodes)


def test_the_table_uses_every_type_of_the_handout() -> None:
    assert {t for graph in GRAPHS for t in graph.nodes.values()} == set(TYPES.values())


def test_the_files_are_named_as_in_the_handout(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == [f"{name}.usda" for name in FILES]


@pytest.mark.parametrize("number", STAGES)
def test_a_checkpoint_holds_the_graphs_up_to_its_part(number: int, stages: list[Usd.Stage]) -> None:
    found = [
        str(p.GetPath()) for p in stages[number].TraverseAll() if p.GetTypeName() == "OmniGraph"
    ]
    assert sorted(found) == sorted(graph.path for graph in GRAPHS if number >= graph.since)


@pytest.mark.parametrize("number", STAGES)
def test_a_checkpoint_holds_the_sensors_up_to_its_part(
    number: int, stages: list[Usd.Stage]
) -> None:
    robot = stages[number].GetPrimAtPath("/turtlebot3_burger")
    found = [str(p.GetPath()) for p in Usd.PrimRange(robot) if p.GetTypeName() in SENSOR_TYPES]
    assert sorted(found) == sorted(each.path for each in SENSORS if number >= each.since)


SENSOR_TYPES = {sensor.type for sensor in SENSORS}


@pytest.mark.parametrize("number", STAGES)
def test_no_node_stands_outside_the_graphs(number: int, stages: list[Usd.Stage]) -> None:
    nodes = [p for p in stages[number].TraverseAll() if p.GetTypeName() == "OmniGraphNode"]
    expected = sum(len(graph.nodes) for graph in GRAPHS if number >= graph.since)
    assert len(nodes) == expected
    assert all(prim.GetParent().GetTypeName() == "OmniGraph" for prim in nodes)


@pytest.mark.parametrize("number", STAGES)
def test_a_checkpoint_adds_graphs_and_sensors_and_nothing_else(
    number: int, stages: list[Usd.Stage]
) -> None:
    before = {str(prim.GetPath()) for prim in stages[0].TraverseAll()}
    added = {str(prim.GetPath()) for prim in stages[number].TraverseAll()} - before
    roots = [each.path for each in (*SENSORS, *GRAPHS) if number >= each.since]
    strangers = {
        path
        for path in added
        if path not in roots and not any(path.startswith(f"{root}/") for root in roots)
    }
    assert strangers == set()


@pytest.mark.parametrize(("number", "graph"), HELD)
class TestGraph:
    def test_every_node_is_there_once(
        self, number: int, graph: Graph, stages: list[Usd.Stage]
    ) -> None:
        prims = stages[number].GetPrimAtPath(graph.path).GetChildren()
        types = sorted(prim.GetAttribute("node:type").Get() for prim in prims)
        assert types == sorted(graph.nodes.values())
        assert all(prim.GetTypeName() == "OmniGraphNode" for prim in prims)

    def test_every_wire_is_there_once_and_no_other(
        self, number: int, graph: Graph, stages: list[Usd.Stage]
    ) -> None:
        assert sorted(wires_of(named_nodes(stages[number], graph))) == sorted(graph.wires)

    def test_the_handouts_values_are_authored_and_no_others(
        self, number: int, graph: Graph, stages: list[Usd.Stage]
    ) -> None:
        nodes = named_nodes(stages[number], graph)
        found = {name: values_of(prim) for name, prim in nodes.items()}
        assert found == {name: dict(graph.values.get(name, {})) for name in graph.nodes}
        for name, values in graph.values.items():
            assert [isinstance(found[name][port], bool) for port in values] == [
                isinstance(value, bool) for value in values.values()
            ]

    def test_relationships_name_the_handouts_prims_and_no_others(
        self, number: int, graph: Graph, stages: list[Usd.Stage]
    ) -> None:
        found: dict[str, Mapping[str, tuple[str, ...]]] = {}
        for name, prim in named_nodes(stages[number], graph).items():
            targets = {
                relationship.GetName(): tuple(str(path) for path in relationship.GetTargets())
                for relationship in prim.GetRelationships()
                if relationship.GetTargets()
            }
            if targets:
                found[name] = targets
        assert found == graph.targets

    def test_sources_and_targets_exist(
        self, number: int, graph: Graph, stages: list[Usd.Stage]
    ) -> None:
        stage = stages[number]
        for prim in stage.GetPrimAtPath(graph.path).GetChildren():
            for source, _ in wires_into(prim):
                assert stage.GetAttributeAtPath(source)
            for relationship in prim.GetRelationships():
                assert all(stage.GetPrimAtPath(path) for path in relationship.GetTargets())

    def test_nothing_changes_over_time(
        self, number: int, graph: Graph, stages: list[Usd.Stage]
    ) -> None:
        for prim in Usd.PrimRange(stages[number].GetPrimAtPath(graph.path)):
            assert not any(attribute.GetNumTimeSamples() for attribute in prim.GetAttributes())


def test_the_drive_graphs_nodes_are_called_as_the_handout_renames_them(
    stages: list[Usd.Stage],
) -> None:
    nodes = named_nodes(stages[2], ROS_DRIVE)
    assert {name: prim.GetName() for name, prim in nodes.items()} == {n: n for n in ROS_DRIVE.nodes}


def test_the_array_names_the_left_wheel_first(stages: list[Usd.Stage]) -> None:
    array = named_nodes(stages[2], ROS_DRIVE)["make_array"]
    joints = []
    for port in ("inputs:input0", "inputs:input1"):
        (source,) = array.GetAttribute(port).GetConnections()
        joints.append(stages[2].GetAttributeAtPath(source).Get())
    assert joints == ["wheel_left_joint", "wheel_right_joint"]


def position(prim: Usd.Prim) -> tuple[float, float]:
    return tuple(prim.GetAttribute("ui:nodegraph:node:pos").Get())


def test_the_clock_graph_is_laid_out_as_recommended(stages: list[Usd.Stage]) -> None:
    nodes = named_nodes(stages[1], ROS_CLOCK)
    assert {name: position(prim) for name, prim in nodes.items()} == CLOCK_LAYOUT


@pytest.mark.parametrize("graph", GRAPHS)
def test_wires_run_from_left_to_right(graph: Graph, stages: list[Usd.Stage]) -> None:
    nodes = named_nodes(stages[-1], graph)
    for source, _, target, _ in graph.wires:
        assert position(nodes[source])[0] < position(nodes[target])[0]


@pytest.mark.parametrize("graph", GRAPHS)
def test_no_two_nodes_lie_on_each_other(graph: Graph, stages: list[Usd.Stage]) -> None:
    places = [position(prim) for prim in named_nodes(stages[-1], graph).values()]
    assert len(set(places)) == len(graph.nodes)


@pytest.mark.parametrize(("number", "sensor"), SENSED)
class TestSensor:
    def test_type_and_figures_are_authored(
        self, number: int, sensor: Sensor, stages: list[Usd.Stage]
    ) -> None:
        prim = stages[number].GetPrimAtPath(sensor.path)
        assert (prim.IsActive(), prim.IsDefined()) == (True, True)
        assert prim.GetTypeName() == sensor.type
        for name, value in sensor.values.items():
            attribute = prim.GetAttribute(name)
            assert attribute.HasAuthoredValue()
            assert attribute.Get() == pytest.approx(value, rel=1e-6)

    def test_pose_is_written_as_the_property_panel_does(
        self, number: int, sensor: Sensor, stages: list[Usd.Stage]
    ) -> None:
        prim = stages[number].GetPrimAtPath(sensor.path)
        orient = prim.GetAttribute("xformOp:orient").Get()
        assert list(prim.GetAttribute("xformOpOrder").Get()) == [
            "xformOp:translate",
            "xformOp:orient",
            "xformOp:scale",
        ]
        assert prim.GetAttribute("xformOp:translate").Get() == Gf.Vec3d(*sensor.translate)
        assert (orient.GetReal(), *orient.GetImaginary()) == pytest.approx(sensor.orient)
        assert prim.GetAttribute("xformOp:scale").Get() == Gf.Vec3d(1, 1, 1)


def test_the_camera_looks_forward_with_its_top_up(stages: list[Usd.Stage]) -> None:
    prim = stages[-1].GetPrimAtPath(CAMERA)
    local = UsdGeom.Xformable(prim).GetLocalTransformation()
    looks, up = local.TransformDir(Gf.Vec3d(0, 0, -1)), local.TransformDir(Gf.Vec3d(0, 1, 0))
    assert Gf.IsClose(looks, Gf.Vec3d(1, 0, 0), 1e-9)
    assert Gf.IsClose(up, Gf.Vec3d(0, 0, 1), 1e-9)


def test_the_cameras_aperture_is_left_alone(
    stages: list[Usd.Stage], subtests: pytest.Subtests
) -> None:
    prim = stages[-1].GetPrimAtPath(CAMERA)
    for name in ("horizontalAperture", "verticalAperture"):
        with subtests.test(name=name):
            assert not prim.GetAttribute(name).HasAuthoredValue()


def test_usd_cores_own_validators_find_no_fault(stages: list[Usd.Stage]) -> None:
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stages[-1])
    assert len(validators) > 10
    assert [error.GetMessage() for error in errors] == []


def test_the_files_from_06_on_hold_the_scene_of_05(folder: Path) -> None:
    files = [(folder / f"{name}.usda").read_bytes() for name in FILES]
    assert files[5] == files[6] == files[7] == files[8]
    assert len(set(files[:6])) == 6


def test_the_files_of_the_lab_do_not_contradict_each_other() -> None:
    result = invoke("lab", "check")
    assert (result.exit_code, result.output) == (0, "Lab 3: 0 errors, 0 warnings\n")


def test_the_rubric_gives_a_hundred_points() -> None:
    assert load_rubric(None, load_lab()).points == 100


def test_the_rubric_asks_for_every_requirement_of_every_graph_once() -> None:
    lab = load_lab()
    rubric, asked = load_rubric(None, lab), everything_asked(lab)
    judged = [
        requirement.id
        for item in rubric.items
        if item.groups != ("*",)
        for requirement in rubric.asked[item.id]
    ]
    assert len(judged) == len(set(judged))
    last = list(lab.checkpoints)[-1]
    assert {each.id for each in asked[last] if each.group != "Scene"} <= set(judged)
