"""Where boxes stand and wires run: nothing overlaps, whatever the graph looks like."""

from __future__ import annotations

from itertools import pairwise

import picture_geometry as geometry
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from lab3_usd.report.picture import canvas
from lab3_usd.report.picture.canvas import at_editor_positions, position_missing
from lab3_usd.report.picture.layered import (
    Slot,
    WirePiece,
    backward,
    crossings,
    layered,
    ordered_columns,
    ranks,
    stacked,
)
from lab3_usd.report.picture.model import (
    EDGE,
    HEADER,
    Box,
    Curve,
    End,
    Point,
    Row,
    clip_end,
    clip_path,
    sized,
    text_width,
)
from lab3_usd.report.picture.routing import around, points, routed, through

IN, OUT = "inputs:in", "outputs:out"


def box(key: str, at: Point | None = None, inputs: int = 1, outputs: int = 1) -> Box:
    return sized(
        Box(
            key=key,
            title=key,
            subtitle="a node",
            family="data",
            inputs=tuple(Row(f"{IN}{n}", f"in{n}", "in") for n in range(inputs)),
            outputs=tuple(Row(f"{OUT}{n}", f"out{n}", "out") for n in range(outputs)),
            at=at,
        )
    )


def wire(source: str, target: str, leaves: int = 0, arrives: int = 0) -> Curve:
    return Curve(End(source, f"{OUT}{leaves}"), End(target, f"{IN}{arrives}"))


def chain(*keys: str) -> list[Curve]:
    return [wire(one, other) for one, other in pairwise(keys)]


def by_key(boxes: tuple[Box, ...]) -> dict[str, Box]:
    return {each.key: each for each in boxes}


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[Box], list[Curve]]:
    """Graphs of any kind: with circles, loose nodes, and wires that skip columns."""
    count = draw(st.integers(1, 12))
    sides = st.integers(1, 5)
    boxes = [box(f"n{n}", inputs=draw(sides), outputs=draw(sides)) for n in range(count)]
    pick = st.sampled_from(boxes)
    curves = []
    for _ in range(draw(st.integers(0, 20))):
        source, target = draw(pick), draw(pick)
        leaves = draw(st.integers(0, len(source.outputs) - 1))
        arrives = draw(st.integers(0, len(target.inputs) - 1))
        curves.append(wire(source.key, target.key, leaves, arrives))
    return boxes, curves


@given(graphs())
@settings(max_examples=60)
def test_layered_boxes_stand_apart_and_wires_lead_from_port_to_port_beside_them(
    graph: tuple[list[Box], list[Curve]],
) -> None:
    boxes, curves = layered(*graph)
    assert geometry.overlapping(boxes) == []
    assert geometry.crossings(boxes, curves) == []
    assert geometry.loose_ends(boxes, curves) == []


def test_a_wire_leads_to_a_column_further_right() -> None:
    boxes, _ = layered([box("a"), box("b"), box("c")], chain("a", "b", "c"))
    places = by_key(boxes)
    assert places["a"].x + places["a"].w < places["b"].x
    assert places["b"].x + places["b"].w < places["c"].x


def test_a_wire_that_closes_a_circle_runs_below_all_boxes() -> None:
    boxes, curves = layered([box("a"), box("b")], [*chain("a", "b"), wire("b", "a")])
    lowest = max(each.y + each.h for each in boxes)
    assert max(y for _, y in points(curves[0].path)) < lowest
    assert max(y for _, y in points(curves[1].path)) > lowest


def test_a_wire_that_skips_a_column_passes_beside_its_boxes() -> None:
    boxes, curves = layered([box("a"), box("b"), box("c")], [*chain("a", "b", "c"), wire("a", "c")])
    middle = by_key(boxes)["b"]
    passing = [y for x, y in points(curves[2].path) if middle.x <= x <= middle.x + middle.w]
    assert passing
    assert all(y < middle.y or y > middle.y + middle.h for y in passing)


def test_columns_are_ordered_so_that_wires_do_not_cross() -> None:
    boxes, _ = layered([box("a"), box("b"), box("c"), box("d")], [wire("a", "d"), wire("b", "c")])
    places = by_key(boxes)
    assert (places["a"].y < places["b"].y) == (places["d"].y < places["c"].y)


def test_a_source_stands_right_before_what_it_feeds() -> None:
    rank = ranks(["a", "b", "c", "constant"], [("a", "b"), ("b", "c"), ("constant", "c")])
    assert rank == {"a": 0, "b": 1, "c": 2, "constant": 1}


def test_a_chain_of_thousands_of_nodes_is_laid_out() -> None:
    keys = [f"n{n}" for n in range(3000)]
    edges = list(pairwise(keys))
    assert backward(keys, [*edges, (keys[-1], keys[0])]) == {2999}
    assert ranks(keys, edges)["n2999"] == 2999


def test_no_graph_at_all_is_laid_out() -> None:
    assert layered([], []) == ((), ())


def test_ordering_keeps_the_order_with_the_fewest_crossings() -> None:
    slots = [Slot((key,), rank, 40.0) for key, rank in (("a", 0), ("b", 0), ("c", 1), ("d", 1))]
    links = [WirePiece(("a",), 10, ("d",), 10), WirePiece(("b",), 10, ("c",), 10)]
    assert crossings(ordered_columns(slots, []), links) == 1
    assert crossings(ordered_columns(slots, links), links) == 0


def test_stacked_slots_keep_their_gap() -> None:
    column = (Slot(("a",), 0, 40.0), Slot(("b",), 0, 60.0))
    target = Slot(("c",), 1, 40.0)
    links = [WirePiece((key,), 20, ("c",), 20) for key in "ab"]
    tops = stacked((column, (target,)), links, 10.0)
    assert tops[("b",)] - tops[("a",)] == 50.0


def test_a_single_wire_between_two_boxes_runs_level() -> None:
    _, curves = layered([box("a"), box("b")], chain("a", "b"))
    assert len({round(y, 6) for _, y in points(curves[0].path)}) == 1


def test_saved_places_are_kept() -> None:
    drawn = at_editor_positions([box("a", (100, 50)), box("b", (600, 300))], chain("a", "b"))
    assert drawn is not None
    a, b = drawn[0]
    assert (b.x - a.x, b.y - a.y) == (500, 250)


def test_saved_places_too_close_together_are_drawn_apart_in_the_same_order() -> None:
    drawn = at_editor_positions(
        [box("a", (0, 0)), box("b", (150, 0)), box("c", (0, 60))], chain("a", "b")
    )
    assert drawn is not None
    a, b, c = drawn[0]
    assert geometry.overlapping(drawn[0]) == []
    assert a.x < b.x
    assert a.y < c.y
    assert a.y == b.y


@pytest.mark.parametrize(
    "places",
    [[(0, 0), (0, 0)], [(0, 0), None]],
    ids=["on top of each other", "one place unknown"],
)
def test_saved_places_that_cannot_be_drawn_are_refused(places: list[Point | None]) -> None:
    boxes = [box(key, at) for key, at in zip("ab", places, strict=True)]
    assert at_editor_positions(boxes, []) is None


def test_a_wire_without_a_way_refuses_the_saved_places() -> None:
    boxes = [
        replace(box("a"), x=0.0, y=0.0, w=100.0, h=100.0),
        replace(box("wall"), x=104.0, y=-9000.0, w=20.0, h=18000.0),
        replace(box("b"), x=128.0, y=0.0, w=100.0, h=100.0),
    ]
    assert routed(boxes, chain("a", "b")) is None


def test_saved_places_without_a_way_for_a_wire_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(canvas, "routed", lambda *_: None)
    assert (
        canvas.at_editor_positions([box("a", (0, 0)), box("b", (400, 0))], chain("a", "b")) is None
    )


def test_a_wire_passes_around_a_box_in_its_way() -> None:
    boxes = [box("a", (0, 0)), box("b", (400, 0)), box("c", (800, 0))]
    drawn = at_editor_positions(boxes, [wire("a", "c")])
    assert drawn is not None
    assert geometry.crossings(*drawn) == []
    assert geometry.loose_ends(*drawn) == []


def direction(start: Point, *ahead: Point) -> Point:
    """The way from a point to the first of the others that is elsewhere."""
    x, y = next(point for point in ahead if point != start)
    return x - start[0], y - start[1]


@pytest.mark.parametrize("down", [160.0, -160.0, 400.0])
@pytest.mark.parametrize("gap", [-300.0, -20.0, 0.0, 1.0, 15.0, 35.0, 45.0, 60.0])
def test_no_wire_turns_on_the_spot_where_columns_overlap(gap: float, down: float) -> None:
    one = box("one", (0.0, 0.0))
    two = box("two", (one.w + gap, down))
    placed = at_editor_positions([one, two], [wire("one", "two"), wire("two", "one")])
    assert placed is not None
    for curve in placed[1]:
        for piece, following in pairwise(curve.path):
            (x, y), (next_x, next_y) = (
                direction(*reversed(piece)),
                direction(*following),
            )
            assert -x * next_x - y * next_y > 0


def test_a_wire_to_a_box_on_the_left_passes_around_both() -> None:
    drawn = at_editor_positions([box("a", (800, 0)), box("b", (0, 0))], [wire("a", "b")])
    assert drawn is not None
    assert geometry.crossings(*drawn) == []


def test_wires_of_different_outputs_do_not_share_a_lane() -> None:
    boxes = [box("a", (0, 0), outputs=2), box("b", (400, 0)), box("c", (800, 0), inputs=2)]
    drawn = at_editor_positions(boxes, [wire("a", "c"), wire("a", "c", 1, 1)])
    assert drawn is not None
    one, other = ([y for x, y in points(curve.path) if 450 < x < 700] for curve in drawn[1])
    assert min(abs(y - z) for y in one for z in other) >= 8


@pytest.mark.parametrize("way", [("ghost", "live"), ("live", "ghost")])
def test_a_missing_node_stands_to_its_neighbours_as_in_the_spec(way: tuple[str, str]) -> None:
    live = box("live", (1000, 500))
    ghost = box("ghost", (50, 100))
    boxes = position_missing(
        [live, ghost],
        chain(*way),
        {"live": (450, 150), "ghost": (50, 100)},
        frozenset({"live"}),
    )
    assert by_key(boxes)["ghost"].at == (600, 450)


def test_a_missing_node_does_not_hide_another() -> None:
    live = box("live", (0, 0))
    ghost = box("ghost")
    home = {"live": (0.0, 0.0), "ghost": (0.0, 0.0)}
    boxes = position_missing([live, ghost], [], home, frozenset({"live"}))
    assert by_key(boxes)["ghost"].at == (0, live.h + 26)


@pytest.mark.parametrize("home", [{}, {"ghost": (0.0, 0.0)}], ids=["no role", "a role"])
def test_the_end_of_a_dead_wire_stands_left_of_its_target(home: dict[str, Point]) -> None:
    live = box("live", (1000, 500))
    boxes = position_missing(
        [live, box("ghost")], chain("ghost", "live"), home, frozenset({"live"})
    )
    assert by_key(boxes)["ghost"].at == (1000 - live.w - 80, 500)


def test_a_node_without_place_or_wire_stands_left_of_the_first() -> None:
    live = box("live", (1000, 500))
    boxes = position_missing([live, box("loose")], [], {}, frozenset({"live", "loose"}))
    assert by_key(boxes)["loose"].at == (1000 - live.w - 80, 500)


def test_nodes_made_by_a_script_have_no_places() -> None:
    boxes = position_missing(
        [box("a", (0, 0)), box("b"), box("c")], [], {}, frozenset({"a", "b", "c"})
    )
    assert [each.at for each in boxes] == [None, None, None]


def test_a_box_is_as_high_as_its_rows() -> None:
    assert box("a", inputs=3, outputs=1).h == HEADER + 3 * 22 + 2 * EDGE


def test_a_box_without_rows_is_its_header() -> None:
    assert sized(Box("a", "a", "", "frame")).h == HEADER


def test_every_expected_value_makes_its_row_higher() -> None:
    row = Row("inputs:x", "x", "in", value=("1",))
    plain = sized(Box("a", "a", "", "data", settings=(row,)))
    faulty = sized(Box("a", "a", "", "data", settings=(replace(row, expected=("2",)),)))
    assert faulty.h - plain.h == 15


def test_a_box_is_wide_enough_for_its_title() -> None:
    title = "W" * 40
    assert sized(Box("a", title, "", "data")).w >= text_width(title, 13, bold=True)


@pytest.mark.parametrize("text", ["日本語", "é", "\u0301", "W"])
def test_every_letter_has_a_width(text: str) -> None:
    assert 0 <= text_width(text, 10) <= 11 * len(text)


def test_a_bold_text_is_wider() -> None:
    assert text_width("node", 10, bold=True) > text_width("node", 10)


def test_a_long_text_keeps_its_beginning() -> None:
    assert clip_end("abcdefgh", 4) == "abc…"


def test_a_long_path_keeps_its_last_names() -> None:
    assert clip_path("/robot/base_footprint/Camera_1", 20) == "…/Camera_1"
    assert clip_path("/robot/base", 20) == "/robot/base"
    assert clip_path("x" * 30, 5) == "…xxxx"


def test_a_line_end_in_a_text_is_escaped() -> None:
    assert clip_end("a\nb", 10) == "a\\nb"


def test_a_curve_between_two_points_never_turns_back() -> None:
    xs = [x for x, _ in points(through([(0, 0), (100, 300), (200, 300)]))]
    assert xs == sorted(xs)


def test_the_way_back_keeps_within_its_bulge() -> None:
    xs = [x for x, _ in points(around((100, 0), (0, 0), 80, 26))]
    assert min(xs) >= -26
    assert max(xs) <= 126
