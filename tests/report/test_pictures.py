"""What the pictures show: the lab's graphs, a stage's faults, the TF tree, in every format."""

from __future__ import annotations

import re
import shutil
import struct
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree as ET

import models
import picture_geometry as geometry
import pytest
from golden import assert_golden_text
from grade_files import stage as stage_file
from html_pages import in_lines
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from lab3_usd.check.match.roles import match
from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.errors import UsageError
from lab3_usd.facts.frame_targets import UnresolvedFrames
from lab3_usd.facts.frames import Edge
from lab3_usd.isaac.values import Value
from lab3_usd.model.finding import Finding
from lab3_usd.model.stage import AbsentPrim, GraphModel, Node, PortState, StageModel
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.report.html import model as html_model
from lab3_usd.report.picture.canvas import on_canvas
from lab3_usd.report.picture.flowcharts import celled, coded, graphviz, mermaid
from lab3_usd.report.picture.model import Box, Curve, Kind, Picture, Row, State, port_id
from lab3_usd.report.picture.picture_file import png
from lab3_usd.report.picture.svg import (
    BELOW_TITLE,
    HEADERS,
    OF_CHANGES,
    ON_HEADER,
    PALETTES,
    THEMES,
    stylesheet,
    svg,
    svg_file,
)
from lab3_usd.report.pictures.graph_picture import graph_picture, spec_picture, stage_pictures
from lab3_usd.report.pictures.node_boxes import findings_by_site
from lab3_usd.report.pictures.tf_picture import frames_picture, spec_frames_picture
from lab3_usd.report.safe_text import dot_string
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.stage.sandboxed_open import FileBounds, opening_within

LAB = models.lab()
CLOCK = LAB.graphs["ROS_Clock"]
DRIVE = LAB.graphs["ROS_Drive"]
PUBLISHER = f"{CLOCK.path}/ros2_publish_clock"
CONTEXT = f"{CLOCK.path}/ros2_context"
TIME = f"{CLOCK.path}/isaac_read_simulation_time"
TICK = f"{CLOCK.path}/on_playback_tick"
EVIL = '<script>alert("1")</script>&\'"]} -->'
SVG = "{http://www.w3.org/2000/svg}"


def finding(
    prim: str, prop: str | None = None, severity: str = "error", **values: str | None
) -> Finding:
    message = values.pop("message", "something is wrong") or ""
    return Finding("X01", "test", severity, prim, message, prop, **values)  # type: ignore[arg-type]


def changed(graph: GraphModel, node: Node) -> GraphModel:
    """The graph with one node in the place of its namesake, or added."""
    nodes = {each.path: each for each in graph.nodes} | {node.path: node}
    return replace(graph, nodes=tuple(nodes[path] for path in sorted(nodes)))


def without(graph: GraphModel, path: str) -> GraphModel:
    return replace(graph, nodes=tuple(node for node in graph.nodes if node.path != path))


def node_of(graph: GraphModel, path: str) -> Node:
    return next(node for node in graph.nodes if node.path == path)


def drawn(
    graph: GraphModel | None, *findings: Finding, spec: GraphSpec = CLOCK, every: bool = False
) -> Picture:
    return graph_picture(spec, match(spec, graph), graph, findings, every_port=every)


def box_of(picture: Picture, key: str) -> Box:
    return next(box for box in picture.boxes if box.key == key)


def row_of(picture: Picture, key: str, port: str) -> Row:
    row = box_of(picture, key).row(port)
    assert row is not None
    return row


def states(parts: Iterable[Box] | Iterable[Curve]) -> dict[State, int]:
    return dict(Counter(part.state for part in parts))


def into(picture: Picture, key: str, port: str) -> dict[tuple[str, str], State]:
    """The sources of the wires into one port, and how each is drawn."""
    return {
        (curve.source.key.rpartition("/")[2], curve.source.port): curve.state
        for curve in picture.curves
        if curve.target.key == key and curve.target.port == port
    }


def clock() -> GraphModel:
    return models.graph_of(CLOCK)


def placed(graph: GraphModel, spec: GraphSpec) -> GraphModel:
    """The graph with its nodes where the spec has them."""
    at = {node.path: spec.nodes[node.name].at for node in graph.nodes}
    return replace(graph, nodes=tuple(replace(node, place=at.get) for node in graph.nodes))


def texts(picture: Picture) -> list[str]:
    root = ET.fromstring(svg(picture))  # noqa: S314 - written by us
    return [element.text or "" for element in root.iter(f"{SVG}text")]


# ---- what is drawn of a spec


@pytest.mark.parametrize("name", list(LAB.graphs))
@pytest.mark.parametrize("every", [False, True], ids=["used ports", "all ports"])
def test_the_picture_of_a_spec_is_readable(name: str, every: bool) -> None:  # noqa: FBT001
    picture = spec_picture(LAB.graphs[name], every_port=every)
    assert geometry.overlapping(picture.boxes) == []
    assert geometry.crossings(picture.boxes, picture.curves) == []
    assert geometry.through_titles(picture.boxes, picture.curves) == []
    assert geometry.loose_ends(picture.boxes, picture.curves) == []
    assert list(geometry.outside(picture)) == []


@pytest.mark.parametrize("name", list(LAB.graphs))
def test_the_picture_of_a_spec_has_every_node_wire_and_value(name: str) -> None:
    spec = LAB.graphs[name]
    picture = spec_picture(spec)
    assert [box.key for box in picture.boxes] == [f"{spec.path}/{role}" for role in spec.nodes]
    assert len(picture.curves) == len(spec.wires)
    shown = {(box.key, row.port) for box in picture.boxes for row in box.settings if row.value}
    asked = set()
    for role, node in spec.nodes.items():
        asked |= {(f"{spec.path}/{role}", setting.port) for setting in node.settings}
        asked |= {(f"{spec.path}/{role}", target.port) for target in node.targets}
    assert shown == asked


def test_a_node_is_titled_as_in_the_editor() -> None:
    box = box_of(spec_picture(CLOCK), PUBLISHER)
    assert (box.title, box.subtitle) == ("ROS2 Publish Clock", "ros2_publish_clock")


def test_execution_wires_are_dashed_and_data_wires_are_not() -> None:
    dashed = {curve.target.port: curve.dashed for curve in spec_picture(CLOCK).curves}
    assert dashed == {"inputs:execIn": True, "inputs:context": False, "inputs:timeStamp": False}


def test_values_are_shown_beside_their_names() -> None:
    picture = spec_picture(CLOCK)
    assert row_of(picture, PUBLISHER, "inputs:topicName").value == ("/clock",)
    assert row_of(picture, TIME, "inputs:resetOnStop").value == ("False",)


def test_target_prims_have_a_line_each() -> None:
    spec = LAB.graphs["ROS_OdomTF"]
    row = row_of(
        spec_picture(spec), f"{spec.path}/isaac_compute_transform_tree", "inputs:targetPrims"
    )
    assert len(row.value) == 6
    assert row.value[-1] == "…/base_footprint/Camera_1"


def test_a_constant_gives_its_value_to_the_right() -> None:
    row = row_of(spec_picture(DRIVE), f"{DRIVE.path}/constant_left_joint", "inputs:value")
    assert (row.side, row.wired, row.value) == ("out", True, ("wheel_left_joint",))


def test_unused_ports_are_counted_or_drawn() -> None:
    used = box_of(spec_picture(CLOCK), PUBLISHER)
    every = box_of(spec_picture(CLOCK, every_port=True), PUBLISHER)
    assert used.more == "+ 2 more ports"
    assert used.row("inputs:qosProfile") is None
    assert every.more == ""
    assert every.row("inputs:qosProfile") is not None


def test_the_header_tells_what_kind_of_node_it_is() -> None:
    families = {box.key.rpartition("/")[2]: box.family for box in spec_picture(DRIVE).boxes}
    assert families["on_playback_tick"] == "event"
    assert families["ros2_subscribe_twist"] == "ros"
    assert families["differential_controller"] == "action"
    assert families["ros2_context"] == "data"


# ---- what is drawn of a stage


def test_a_right_graph_has_no_mark() -> None:
    picture = drawn(clock())
    assert states(picture.boxes) == {"ok": 4}
    assert states(picture.curves) == {"ok": 3}
    assert {row.state for box in picture.boxes for row in box.rows} == {"ok"}


def test_prim_names_do_not_matter() -> None:
    renamed = "/World/ROS_Clock/my_clock"
    graph = changed(without(clock(), PUBLISHER), replace(node_of(clock(), PUBLISHER), path=renamed))
    picture = drawn(graph)
    assert states(picture.boxes) == {"ok": 4}
    assert box_of(picture, renamed).subtitle == "my_clock"


def test_nodes_stand_where_the_editor_has_them() -> None:
    picture = drawn(placed(clock(), CLOCK))
    tick, context = box_of(picture, TICK), box_of(picture, CONTEXT)
    assert tick.x == context.x
    assert tick.y < context.y < box_of(picture, TIME).y


def test_nodes_on_top_of_each_other_are_laid_out_anew() -> None:
    graph = clock()
    nodes = tuple(replace(node, place=lambda _: (0, 0)) for node in graph.nodes)
    heap = replace(graph, nodes=nodes)
    places = [[(box.x, box.y) for box in drawn(each).boxes] for each in (heap, graph)]
    assert places[0] == places[1]


def test_a_missing_node_is_a_ghost_with_its_wires() -> None:
    picture = drawn(placed(without(clock(), CONTEXT), CLOCK), finding(CLOCK.path))
    ghost = box_of(picture, CONTEXT)
    assert (ghost.state, ghost.subtitle) == ("missing", "ros2_context · missing")
    assert ghost.row("inputs:domain_id") is not None
    assert into(picture, PUBLISHER, "inputs:context") == {
        ("ros2_context", "outputs:context"): "missing"
    }
    assert geometry.overlapping(picture.boxes) == []


def test_a_missing_graph_is_a_ghost_as_a_whole() -> None:
    picture = drawn(None, finding(CLOCK.path))
    assert states(picture.boxes) == {"missing": 4}
    assert states(picture.curves) == {"missing": 3}


def test_the_ghost_of_a_node_whose_name_is_taken_is_drawn_beside_it() -> None:
    other = models.node(CONTEXT, "omni.graph.nodes.ConstantToken")
    graph = changed(without(clock(), CONTEXT), other)
    roles = replace(match(CLOCK, graph), retyped={})
    picture = graph_picture(CLOCK, roles, graph, ())
    assert states(picture.boxes) == {"ok": 3, "missing": 1, "extra": 1}
    assert len({box.key for box in picture.boxes}) == 5


def test_a_node_of_another_type_has_no_ports_but_its_own() -> None:
    step = "outputs:step"
    other = models.node(TICK, "isaacsim.core.nodes.OnPhysicsStep")
    publisher = models.wired(node_of(clock(), PUBLISHER), "inputs:execIn", f"{TICK}.{step}")
    graph = changed(changed(clock(), other), publisher)
    picture = drawn(graph, finding(TICK, "node:type"))
    assert box_of(picture, TICK).row("outputs:tick") is None
    assert into(picture, PUBLISHER, "inputs:execIn").keys() == {("on_playback_tick", step)}
    array = f"{DRIVE.path}/make_array"
    other = models.node(array, "omni.graph.action.OnTick")
    picture = drawn(changed(models.graph_of(DRIVE), other), finding(array, "node:type"), spec=DRIVE)
    assert box_of(picture, array).row("inputs:value") is None
    assert box_of(picture, f"{DRIVE.path}/constant_left_joint").state == "ok"


def test_a_missing_wire_is_a_ghost() -> None:
    graph = changed(clock(), models.wired(node_of(clock(), PUBLISHER), "inputs:timeStamp"))
    picture = drawn(graph, finding(PUBLISHER, "inputs:timeStamp"))
    assert states(picture.curves) == {"ok": 2, "missing": 1}
    assert row_of(picture, PUBLISHER, "inputs:timeStamp").state == "missing"


def test_a_wire_from_the_wrong_port_is_marked_beside_the_missing_one() -> None:
    node = models.wired(node_of(clock(), PUBLISHER), "inputs:timeStamp", f"{TICK}.outputs:time")
    picture = drawn(changed(clock(), node), finding(PUBLISHER, "inputs:timeStamp"))
    assert into(picture, PUBLISHER, "inputs:timeStamp") == {
        ("isaac_read_simulation_time", "outputs:simulationTime"): "missing",
        ("on_playback_tick", "outputs:time"): "wrong",
    }


def test_an_unasked_wire_is_extra() -> None:
    node = models.wired(node_of(clock(), PUBLISHER), "inputs:queueSize", f"{TICK}.outputs:frame")
    picture = drawn(
        changed(clock(), node), finding(PUBLISHER, "inputs:queueSize", severity="warning")
    )
    assert states(picture.curves) == {"ok": 3, "extra": 1}


def test_a_wire_that_nobody_finds_fault_with_is_not_marked() -> None:
    twin = replace(node_of(clock(), CONTEXT), path=f"{CLOCK.path}/ros2_context_01")
    node = models.wired(
        node_of(clock(), PUBLISHER), "inputs:context", f"{twin.path}.outputs:context"
    )
    graph = changed(changed(clock(), twin), node)
    nodes = {role: node_of(graph, f"{CLOCK.path}/{role}") for role in CLOCK.nodes}
    roles = Roles(
        graph,
        nodes,
        {each.path: role for role, each in nodes.items()},
        equivalents={twin.path: "ros2_context"},
    )
    picture = graph_picture(CLOCK, roles, graph, ())
    assert states(picture.curves) == {"ok": 3}
    assert states(picture.boxes) == {"ok": 5}


def test_a_wire_from_a_deactivated_node_comes_from_a_box_that_says_so() -> None:
    old = f"{CLOCK.path}/old_time"
    node = models.wired(node_of(clock(), PUBLISHER), "inputs:timeStamp", f"{old}.outputs:x")
    graph = changed(clock(), node)
    graph = replace(graph, absent=(AbsentPrim(old, "", "deactivated"),))
    picture = drawn(graph, finding(PUBLISHER, "inputs:timeStamp"))
    assert box_of(picture, old).subtitle == "deactivated"
    assert into(picture, PUBLISHER, "inputs:timeStamp")["old_time", "outputs:x"] == "wrong"


def test_a_wire_from_a_port_that_a_node_does_not_have_is_drawn_from_it() -> None:
    node = models.wired(node_of(clock(), PUBLISHER), "inputs:timeStamp", f"{TIME}.outputs:nothing")
    picture = drawn(changed(clock(), node), finding(PUBLISHER, "inputs:timeStamp"))
    assert row_of(picture, TIME, "outputs:nothing").wired
    assert geometry.loose_ends(picture.boxes, picture.curves) == []


def test_a_wrong_value_stands_above_the_expected_one() -> None:
    node = models.valued(node_of(clock(), PUBLISHER), "inputs:topicName", "/klock")
    picture = drawn(
        changed(clock(), node), finding(PUBLISHER, "inputs:topicName", expected="'/clock'")
    )
    row = row_of(picture, PUBLISHER, "inputs:topicName")
    assert (row.state, row.value, row.expected) == ("wrong", ("/klock",), ("/clock",))


def test_a_wrong_default_is_shown() -> None:
    node = models.valued(node_of(clock(), TIME), "inputs:resetOnStop", None)
    picture = drawn(changed(clock(), node), finding(TIME, "inputs:resetOnStop", expected="False"))
    row = row_of(picture, TIME, "inputs:resetOnStop")
    assert (row.state, row.value, row.muted) == ("wrong", ("True",), True)


@pytest.mark.parametrize(
    ("value", "line"),
    [(("a", "b"), "[a, b]"), ("", '""'), (0.1 + 0.2, "0.3"), ("x" * 50, "x" * 33 + "…")],
)
def test_values_are_written_short(value: Value, line: str) -> None:
    node = models.valued(node_of(clock(), PUBLISHER), "inputs:topicName", value)
    assert row_of(drawn(changed(clock(), node)), PUBLISHER, "inputs:topicName").value == (line,)


def test_a_shortened_value_can_be_read_by_pointing_at_it() -> None:
    node = models.valued(node_of(clock(), PUBLISHER), "inputs:topicName", "x" * 50)
    row = row_of(drawn(changed(clock(), node)), PUBLISHER, "inputs:topicName")
    assert row.note == "x" * 50


def test_a_long_list_of_target_prims_is_cut() -> None:
    spec = LAB.graphs["ROS_OdomTF"]
    path = f"{spec.path}/isaac_compute_transform_tree"
    prims = tuple(f"/prim{number}" for number in range(20))
    graph = models.graph_of(spec)
    graph = changed(graph, models.aimed(node_of(graph, path), "inputs:targetPrims", *prims))
    row = row_of(drawn(graph, spec=spec), path, "inputs:targetPrims")
    assert row.value[-1] == "and 8 more"
    assert len(row.value) == 13


def test_a_relationship_without_a_target_says_so() -> None:
    path = f"{DRIVE.path}/articulation_controller"
    graph = models.graph_of(DRIVE)
    graph = changed(graph, models.aimed(node_of(graph, path), "inputs:targetPrim"))
    assert row_of(drawn(graph, spec=DRIVE), path, "inputs:targetPrim").value == ("no prim",)


def test_a_required_value_of_an_unknown_type_may_be_not_set() -> None:
    ports = {"inputs:topicName": PortState("inputs:topicName", "string")}
    other = replace(models.node(PUBLISHER, "some.other.Publisher"), ports=ports)
    roles = replace(match(CLOCK, clock()), node_of={"ros2_publish_clock": other})
    graph = changed(clock(), other)
    picture = graph_picture(CLOCK, roles, graph, ())
    assert row_of(picture, PUBLISHER, "inputs:topicName").value == ("not set",)


def test_ports_that_only_the_file_has_are_drawn() -> None:
    odd = f"{CLOCK.path}/odd"
    names = ("inputs:mine", "outputs:mine", "state:mine")
    node = replace(
        models.node(odd, "some.Node"), ports={name: PortState(name, "int") for name in names}
    )
    box = box_of(drawn(changed(clock(), node), every=True), odd)
    assert [row.port for row in box.inputs] == ["inputs:mine"]
    assert [row.port for row in box.outputs] == ["outputs:mine", "state:mine"]


def test_a_constant_that_is_wired_itself_has_a_port_on_both_sides() -> None:
    path = f"{DRIVE.path}/constant_left_joint"
    graph = models.graph_of(DRIVE)
    other = f"{DRIVE.path}/constant_right_joint.inputs:value"
    graph = changed(graph, models.wired(node_of(graph, path), "inputs:value", other))
    picture = drawn(graph, spec=DRIVE)
    assert row_of(picture, path, "inputs:value").side == "both"
    assert geometry.loose_ends(picture.boxes, picture.curves) == []


def test_a_value_that_the_handout_leaves_alone_is_a_warning() -> None:
    node = models.valued(node_of(clock(), TIME), "inputs:referenceTimeNumerator", 7)
    port = "inputs:referenceTimeNumerator"
    picture = drawn(changed(clock(), node), finding(TIME, port, severity="warning"))
    assert (row_of(picture, TIME, port).state, row_of(picture, TIME, port).value) == (
        "warned",
        ("7",),
    )


def test_a_note_marks_nothing() -> None:
    picture = drawn(clock(), finding(PUBLISHER, "inputs:topicName", severity="note"))
    row = row_of(picture, PUBLISHER, "inputs:topicName")
    assert (row.state, row.note) == ("ok", "something is wrong")


def test_an_extra_node_is_extra() -> None:
    extra = f"{CLOCK.path}/more"
    graph = changed(clock(), models.node(extra, "omni.graph.nodes.ConstantToken", value="x"))
    picture = drawn(graph, finding(extra, severity="warning"))
    assert box_of(picture, extra).state == "extra"
    assert box_of(picture, extra).subtitle == "more · extra"


def test_an_extra_node_with_an_error_is_wrong() -> None:
    extra = f"{CLOCK.path}/more"
    graph = changed(clock(), models.node(extra, "omni.graph.scriptnode.ScriptNode"))
    assert box_of(drawn(graph, finding(extra)), extra).state == "wrong"


@pytest.mark.parametrize(("kind", "word"), [("graph", "wrong"), ("lint", "error")])
def test_a_caption_has_the_word_of_the_legend(kind: Kind, word: str) -> None:
    picture = graph_picture(None, None, clock(), [finding(TICK)], kind=kind)
    named = on_canvas(replace(picture, kind=kind, judged=True))
    assert box_of(named, TICK).subtitle == f"on_playback_tick · {word}"
    assert word in {entry.text for entry in named.legend}


def test_a_node_of_another_type_stands_in_its_place() -> None:
    other = models.node(TICK, "omni.graph.action.OnTick")
    picture = drawn(changed(clock(), other), finding(TICK, "node:type"))
    box = box_of(picture, TICK)
    assert (box.state, box.title) == ("wrong", "On Tick")
    assert box.subtitle == "on_playback_tick · expected On Playback Tick"
    assert states(picture.boxes) == {"ok": 3, "wrong": 1}


def test_a_node_without_a_type_is_drawn() -> None:
    picture = drawn(changed(clock(), models.node(f"{CLOCK.path}/what", "")))
    assert box_of(picture, f"{CLOCK.path}/what").title == "node without a type"


def test_a_fault_of_the_graph_is_a_line_below_the_title() -> None:
    wrong = finding(CLOCK.path, "evaluator:type", message="it is a push graph", actual="push")
    picture = drawn(clock(), wrong)
    assert [(remark.state, remark.text) for remark in picture.remarks] == [
        ("wrong", "it is a push graph")
    ]
    assert "it is a push graph" in texts(picture)


def test_a_remark_that_is_a_note_has_no_mark() -> None:
    note = finding(CLOCK.path, severity="note", message="by the way", actual="this")
    picture = drawn(clock(), note)
    assert "by the way" in texts(picture)
    assert svg(picture).count('class="k') == svg(drawn(clock())).count('class="k')


def test_a_graph_that_no_spec_describes_is_drawn_as_it_is() -> None:
    picture = graph_picture(None, None, clock(), ())
    assert states(picture.boxes) == {"ok": 4}
    assert len(picture.curves) == 3
    assert not picture.judged


def test_an_empty_graph_is_drawn() -> None:
    empty = models.graph("/World/Empty")
    assert graph_picture(None, None, empty, ()).boxes == ()
    assert "/World/Empty" in texts(graph_picture(None, None, empty, ()))[1]


def test_a_node_wired_to_itself_is_drawn() -> None:
    node = models.wired(node_of(clock(), PUBLISHER), "inputs:timeStamp", f"{PUBLISHER}.outputs:own")
    picture = drawn(changed(clock(), node), finding(PUBLISHER, "inputs:timeStamp"))
    assert geometry.crossings(picture.boxes, picture.curves) == []


# ---- the pictures of a whole stage


def of_stage(stage: StageModel, checkpoint: str | None) -> list[str]:
    asked = None if checkpoint is None else LAB.checkpoints[checkpoint]
    return [picture.title for picture in stage_pictures(LAB, asked, stage)]


def test_a_stage_has_a_picture_per_graph_and_one_of_its_frames() -> None:
    assert of_stage(models.stage(), "05") == [*LAB.graphs, "TF"]


def test_graphs_that_the_checkpoint_asks_for_are_drawn_though_missing() -> None:
    assert of_stage(models.only(), "02") == ["ROS_Clock", "ROS_Drive"]


def test_the_starter_has_no_pictures() -> None:
    assert of_stage(models.only(), "00") == []


def test_graphs_beyond_the_lab_are_drawn_too() -> None:
    assert of_stage(models.only(models.graph("/World/Mine")), "00") == ["Mine"]


def test_a_deactivated_graph_is_not_drawn() -> None:
    assert of_stage(models.only(models.graph("/World/Mine", active=False)), "00") == []


def test_without_a_checkpoint_nothing_is_judged() -> None:
    pictures = list(stage_pictures(LAB, None, models.only(without(clock(), PUBLISHER))))
    assert [(picture.title, picture.judged) for picture in pictures] == [("ROS_Clock", False)]
    assert states(pictures[0].boxes) == {"ok": 3}


# ---- the TF tree


def edge(parent: str, child: str, publisher: str = "/graph/publisher") -> Edge:
    return Edge(parent, child, publisher, publisher, "/tf")


ASKED = tuple(edge(*pair) for pair in LAB.frames.edges)


def tree(*edges: Edge, required: bool = True, localized: bool = False) -> dict[str, State]:
    picture = frames_picture(LAB.frames, edges, required=required, localized=localized)
    assert geometry.overlapping(picture.boxes) == []
    assert geometry.crossings(picture.boxes, picture.curves) == []
    return {f"{curve.source.key} {curve.target.key}": curve.state for curve in picture.curves}


def test_the_required_tree_begins_with_what_localization_publishes() -> None:
    picture = spec_frames_picture(LAB.frames)
    first = picture.curves[0]
    assert (first.source.key, first.target.key, first.dashed) == ("map", "odom", True)
    assert len(picture.curves) == 1 + len(LAB.frames.edges)
    assert geometry.overlapping(picture.boxes) == []


def test_a_right_tree_has_no_mark() -> None:
    assert set(tree(*ASKED).values()) == {"ok"}
    assert tree(*ASKED, localized=True)["map odom"] == "ok"


def test_a_frame_that_nothing_publishes_is_missing() -> None:
    assert tree(*ASKED[:-1])["base_footprint Camera_1"] == "missing"


def test_before_the_tree_is_asked_for_no_frame_is_missing() -> None:
    assert tree(*ASKED[:1], required=False) == {"odom base_footprint": "ok"}


def test_frames_may_hang_deeper_in_the_robot() -> None:
    deeper = (*ASKED[:2], edge("base_link", "base_scan"), *ASKED[3:])
    assert set(tree(*deeper).values()) == {"ok"}


def test_a_frame_with_two_parents_is_wrong_at_the_one_that_is_not_asked_for() -> None:
    found = tree(*ASKED, edge("base_link", "base_scan"))
    assert found["base_link base_scan"] == "wrong"
    assert found["base_footprint base_scan"] == "ok"


def test_a_transform_that_two_nodes_publish_is_wrong() -> None:
    assert tree(*ASKED, edge(*LAB.frames.edges[0], "/other"))["odom base_footprint"] == "wrong"


@pytest.mark.parametrize("parent", ["world", "map", "odom"])
def test_odom_below_another_frame_is_wrong(parent: str) -> None:
    assert tree(*ASKED, edge(parent, "odom"), required=False)[f"{parent} odom"] == "wrong"


def test_a_frame_beside_the_robot_is_extra() -> None:
    assert tree(*ASKED, edge("odom", "table"))["odom table"] == "extra"


@pytest.mark.parametrize(("parent", "child"), [("here", "there"), ("ring", "ring")])
def test_a_frame_without_connection_is_wrong(parent: str, child: str) -> None:
    assert tree(*ASKED, edge(parent, child))[f"{parent} {child}"] == "wrong"


def test_a_frame_says_who_publishes_it() -> None:
    picture = frames_picture(LAB.frames, ASKED, localized=True)
    subtitles = {box.title: box.subtitle for box in picture.boxes}
    assert (subtitles["odom"], subtitles["base_link"]) == ("by AMCL", "by publisher")


def hidden_at(prim: str, *, links: bool) -> UnresolvedFrames:
    return UnresolvedFrames(
        prim, links=links, asset="robot.usd", parent="base_footprint", publisher="/graph/publisher"
    )


def test_what_a_missing_asset_could_tell_is_drawn_as_unknown_and_not_as_missing() -> None:
    names = [child for _, child in LAB.frames.edges[1:-1]]
    unknown = [hidden_at(f"/turtlebot3_burger/{name}", links=False) for name in names]
    picture = frames_picture(LAB.frames, [ASKED[0], ASKED[-1]], unknown)
    assert [box.family for box in picture.boxes].count("absent") == len(names)
    assert {curve.state for curve in picture.curves} == {"ok"}
    assert "absent" in {entry.kind for entry in picture.legend}
    assert picture.subtitle == f"2 transforms  ·  {len(names)} unknown"
    (missing,) = [
        curve for curve in frames_picture(LAB.frames, [ASKED[0], *ASKED[2:]], unknown[1:]).curves
        if curve.state == "missing"
    ]  # fmt: skip
    assert missing.target.key == names[0]


def test_unknown_links_of_a_robot_are_one_box_and_excuse_every_frame() -> None:
    picture = frames_picture(LAB.frames, ASKED[:1], [hidden_at("/robot", links=True)])
    box = picture.boxes[-1]
    assert (box.title, box.subtitle) == ("links of robot", "asset not found")
    assert {curve.state for curve in picture.curves} == {"ok"}
    assert box.family in svg(picture)


# ---- SVG


def evil_picture() -> Picture:
    node = models.valued(node_of(clock(), PUBLISHER), "inputs:topicName", EVIL)
    node = models.aimed(node, "inputs:odd", EVIL)
    graph = changed(clock(), node)
    graph = changed(graph, models.node(f"{CLOCK.path}/odd", EVIL))
    message = finding(PUBLISHER, "inputs:topicName", message=EVIL, expected=EVIL)
    remark = finding(CLOCK.path, message=EVIL, actual=EVIL)
    return drawn(graph, message, remark)


@pytest.mark.parametrize("theme", THEMES)
def test_an_svg_is_well_formed(theme: str) -> None:
    text = svg_file(spec_picture(DRIVE), theme)  # type: ignore[arg-type]  # one of the themes
    assert ET.fromstring(text).tag == f"{SVG}svg"  # noqa: S314 - written by us


def test_markup_from_a_stage_stays_text() -> None:
    root = ET.fromstring(svg(evil_picture()))  # noqa: S314 - written by us
    tags = {element.tag.removeprefix(SVG) for element in root.iter()}
    assert tags <= {"svg", "g", "rect", "path", "circle", "text", "title", "a"}
    assert any(text.startswith("<script>alert(") for text in texts(evil_picture()))


def test_control_characters_from_a_stage_do_not_break_the_svg() -> None:
    node = models.valued(node_of(clock(), PUBLISHER), "inputs:topicName", "a\x00\x1b\nb\ud800")
    shown = texts(drawn(changed(clock(), node)))
    assert "a\\x00\\x1b\\nb\\ud800" in shown


def test_every_node_and_port_has_an_id_of_its_own() -> None:
    picture = spec_picture(DRIVE)
    ids = re.findall(r' id="([^"]*)"', svg(picture))
    rows = [port_id(box.key, row.port) for box in picture.boxes for row in box.rows]
    nodes = [port_id(box.key) for box in picture.boxes]
    assert sorted(ids) == sorted([*rows, *nodes, port_id(DRIVE.path)])
    assert len(set(ids)) == len(ids)


def test_a_prefix_keeps_the_ids_of_two_pictures_apart() -> None:
    alone, prefixed = (
        re.findall(r' id="([^"]*)"', svg(spec_picture(CLOCK), prefix)) for prefix in ("", "s1-")
    )
    assert prefixed == [f"s1-{identity}" for identity in alone] != []


def test_links_lead_from_a_port_to_its_finding() -> None:
    place = port_id(PUBLISHER, "inputs:topicName")
    root = ET.fromstring(svg(spec_picture(CLOCK), "", {place: "#f1"}))  # noqa: S314
    links = list(root.iter(f"{SVG}a"))
    assert [link.get("href") for link in links] == ["#f1"]
    assert [group.get("id") for group in links[0]] == [place]
    assert sum("id" in element.attrib for element in root.iter()) == 1


def test_a_picture_without_links_is_smaller_and_shows_the_same() -> None:
    picture = drawn(without(clock(), CONTEXT), finding(PUBLISHER, "inputs:topicName"))
    bare = svg(picture, links={})
    assert len(bare) < len(svg(picture))
    root = ET.fromstring(bare)  # noqa: S314 - written by us
    assert [element.text for element in root.iter(f"{SVG}text")] == texts(picture)
    assert bare.count('class="r wrong"') == 1


names = st.text(st.characters(categories=["L", "N", "Pc", "Po"]), min_size=1, max_size=8)


@given(names, names)
def test_two_paths_never_have_the_same_id(one: str, other: str) -> None:
    assert (port_id(one) == port_id(other)) == (one == other)


@given(names, names)
def test_an_id_needs_no_escape(prim: str, prop: str) -> None:
    assert re.fullmatch(r"[A-Za-z0-9_-]+", port_id(prim, f"inputs:{prop}"))


def test_a_property_that_is_no_port_belongs_to_its_node() -> None:
    assert port_id(TICK, "node:type") == port_id(TICK)
    assert port_id(TICK, "inputs:x") != port_id(TICK)


def test_faulty_parts_have_a_mark_that_is_not_colour_alone() -> None:
    def marks(picture: Picture) -> int:
        return svg(picture).count('class="k')

    assert marks(drawn(clock())) == 0
    graph = changed(clock(), models.wired(node_of(clock(), PUBLISHER), "inputs:timeStamp"))
    in_drawing_and_legend = 2
    assert marks(drawn(graph, finding(PUBLISHER, "inputs:timeStamp"))) == in_drawing_and_legend
    assert marks(drawn(without(clock(), CONTEXT))) == in_drawing_and_legend


def test_the_legend_explains_the_marks_that_the_picture_has() -> None:
    assert {"missing", "wrong"}.isdisjoint(texts(drawn(clock())))
    marked = texts(drawn(without(clock(), CONTEXT)))
    assert "missing" in marked
    assert "wrong" not in marked


def test_values_that_are_exchanged_are_marked_at_both_nodes() -> None:
    exchanged = replace(finding(PUBLISHER, "inputs:a"), related=("/World/Other.inputs:b", "/World"))
    sites = findings_by_site([exchanged])
    assert sites.state("/World/Other", "inputs:b") == sites.state(PUBLISHER, "inputs:a") == "wrong"
    assert sites.state("/World") == "ok"


def test_the_legend_names_no_line_that_is_not_drawn() -> None:
    lines = [
        {entry.kind for entry in frames_picture(LAB.frames, ASKED, localized=local).legend}
        for local in (False, True)
    ]
    assert lines == [{"data"}, {"data", "execution"}]


def test_the_picture_says_in_words_what_it_shows() -> None:
    root = ET.fromstring(svg(drawn(without(clock(), CONTEXT))))  # noqa: S314
    assert root.get("role") == "img"
    assert root.get("aria-label") == ("ROS_Clock: /World/ROS_Clock, 3 nodes, 2 wires, 2 missing")


def luminance(colour: str) -> float:
    parts = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", list(PALETTES))
@pytest.mark.parametrize(
    ("ink", "grounds"),
    [
        ("text", ["canvas", "body", "fault_tint", "extra_tint", "lit"]),
        ("muted", ["canvas", "body"]),
        ("value", ["body"]),
        ("fault", ["canvas", "body", "fault_tint"]),
        ("extra", ["canvas", "body", "extra_tint"]),
    ],
)
def test_texts_have_enough_contrast(theme: str, ink: str, grounds: list[str]) -> None:
    for palette in (PALETTES[theme], {**PALETTES[theme], **OF_CHANGES[theme]}):
        assert min(contrast(palette[ink], palette[ground]) for ground in grounds) >= 4.5


@pytest.mark.parametrize("theme", list(PALETTES))
@pytest.mark.parametrize("ink", ["data", "execution", "fault", "extra"])
def test_wires_have_enough_contrast(theme: str, ink: str) -> None:
    for palette in (PALETTES[theme], {**PALETTES[theme], **OF_CHANGES[theme]}):
        assert contrast(palette[ink], palette["canvas"]) >= 3


@pytest.mark.parametrize("family", list(HEADERS))
def test_titles_have_enough_contrast(family: str) -> None:
    assert min(contrast(HEADERS[family], ink) for ink in (ON_HEADER, BELOW_TITLE)) >= 4.5


def test_the_theme_auto_follows_the_system_and_the_others_do_not() -> None:
    assert "prefers-color-scheme:dark" in stylesheet("auto")
    assert "prefers-color-scheme" not in stylesheet("light") + stylesheet("dark")
    assert PALETTES["dark"]["canvas"] in stylesheet("dark")


def test_a_stylesheet_keeps_to_pictures() -> None:
    rules = re.findall(r"^([^@}].*)\{", stylesheet("light"), flags=re.MULTILINE)
    selectors = [part for rule in rules for part in rule.split(",")]
    assert len(selectors) > 20
    assert [selector for selector in selectors if not selector.startswith(".lab3 ")] == []


# ---- the other formats


@pytest.mark.parametrize("theme", THEMES)
def test_a_png_has_the_size_of_its_picture(theme: str) -> None:
    pytest.importorskip("resvg_py", reason="the extra png is not installed")
    picture = spec_picture(CLOCK)
    data = png(picture, theme)  # type: ignore[arg-type]  # one of the themes
    assert data.startswith(b"\x89PNG")
    assert struct.unpack(">II", data[16:24]) == (picture.width, picture.height)


def test_a_huge_picture_becomes_a_smaller_png() -> None:
    pytest.importorskip("resvg_py", reason="the extra png is not installed")
    width, height = struct.unpack(
        ">II", png(replace(spec_picture(CLOCK), width=64000.0, height=640.0))[16:24]
    )
    assert (width, height) == (16000, 160)


def test_a_png_without_its_extra_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    with pytest.raises(UsageError, match="needs the extra png"):
        png(spec_picture(CLOCK))


def test_mermaid_has_a_line_per_node_and_wire() -> None:
    lines = mermaid(spec_picture(CLOCK)).splitlines()
    assert lines[1] == "flowchart LR"
    assert '  n0 -.->|"tick → execIn"| n3' in lines
    assert '  n1 -->|"context → context"| n3' in lines
    assert sum("topicName = /clock" in line for line in lines) == 1


@pytest.mark.parametrize("sign", list("<>\"'`[]{}|;&#%\\"))
def test_mermaid_codes_what_could_end_a_label(sign: str) -> None:
    assert coded(f"a{sign}b") == f"a#{ord(sign)};b"


def test_mermaid_keeps_every_string_of_a_stage_in_its_label() -> None:
    text = mermaid(evil_picture())
    assert "<script" not in text
    assert {line.count('"') for line in text.splitlines()} == {0, 2}


def test_dot_has_a_cell_per_port_and_a_line_per_wire() -> None:
    lines = graphviz(spec_picture(CLOCK)).splitlines()
    assert '  n1:p0 -> n3:p1 [color="#4a5663"];' in lines
    assert '  n0:p0 -> n3:p0 [color="#4a5663", style=dashed];' in lines
    assert lines[0] == 'digraph "ROS_Clock" {'


@pytest.mark.parametrize("sign", list('{}|<>"'))
def test_dot_escapes_what_could_end_a_cell(sign: str) -> None:
    assert celled(f"a{sign}b") == f"a\\{sign}b"


def test_dot_doubles_backslashes() -> None:
    assert celled("a\\b") == "a\\\\b"
    assert dot_string('a\\"b') == '"a\\\\\\"b"'


def test_dot_keeps_every_string_of_a_stage_in_its_quotes() -> None:
    bare = re.compile(r'(?<!\\)(?:\\\\)*"')
    quotes = [len(bare.findall(line)) for line in graphviz(evil_picture()).splitlines()]
    assert max(quotes) >= 2
    assert [number for number in quotes if number % 2] == []


def test_faulty_pictures_are_drawn_as_they_were() -> None:
    node = models.valued(node_of(clock(), PUBLISHER), "inputs:topicName", "/klock")
    more = models.node(f"{CLOCK.path}/more", "some.Type")
    graph = changed(changed(without(clock(), CONTEXT), more), node)
    found = (finding(PUBLISHER, "inputs:topicName", message="it is wrong"), finding(more.path))
    edges = (*ASKED[1:], edge("odom", "more"), edge("more", "base_scan"))
    pictures = {
        "graph": drawn(graph, *found, every=True),
        "frames": frames_picture(LAB.frames, edges, required=True, localized=True),
    }
    for name, picture in pictures.items():
        assert_golden_text(f"picture/{name}.dot", graphviz(picture))
        assert_golden_text(f"picture/{name}.mmd", mermaid(picture))
        assert_golden_text(f"picture/{name}.svg", in_lines(svg(picture)))


def test_of_two_findings_at_one_port_the_graver_is_told_first() -> None:
    port = (PUBLISHER, "inputs:topicName")
    found = [finding(*port, severity, message=severity) for severity in ("note", "error")]
    row = row_of(drawn(clock(), *found), *port)
    assert (row.state, row.note.find("error") < row.note.find("note")) == ("wrong", True)


def test_copies_of_a_stage_for_later_checkpoints_share_its_pictures(
    tmp_path: Path,
) -> None:
    files = [stage_file(number) for number in ("05", "06", "07", "08")]
    for path in files:
        shutil.copy(stage_file("05"), tmp_path / path.name)
    digests = {path.name: "the same" for path in files}
    with opening_within(FileBounds(tmp_path.resolve(), lambda _path: None, digests=digests)):
        results = [check_stage(tmp_path / path.name) for path in files]
        contents = [html_model.read_content(result, LAB) for result in results]
    drawn = [contents[number].pictures for number in range(4)]
    assert drawn[0] is drawn[1]
    assert drawn[1] != drawn[2]  # localization adds a frame to the tree
    assert drawn[2] is drawn[3]
