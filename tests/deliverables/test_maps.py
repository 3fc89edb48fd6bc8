from __future__ import annotations

import json
import math
import tracemalloc
from pathlib import Path
from typing import Any

import pytest
import yaml
from grade_files import LAB
from in_process import invoke
from msgspec.structs import replace
from places import SHARED
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from lab3_usd.data import data_folder
from lab3_usd.deliverables.drawn_maps import DrawnMap, MapFrame, draw_map
from lab3_usd.deliverables.maps import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Grid,
    MapError,
    agreement,
    map_yaml,
    pgm,
    read_pgm,
)
from lab3_usd.errors import UsageError
from lab3_usd.stage.lidar_plane import SliceOptions, slice_stage
from lab3_usd.stage.write.starter import build_starter

OUTSIDE = SHARED / "turtlebot3"
INCH = 0.0254

# Handout 4.2, word for word.
FACTS = LAB.scene.map
assert FACTS is not None
HANDOUT_YAML = """\
image: turtlebot3_map.pgm
mode: trinary
resolution: 0.05
origin: [-6.2, -3.32, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


def box(x0: float, y0: float, x1: float, y1: float) -> list[Any]:
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


def picture(grid: Grid) -> list[str]:
    letters = {OCCUPIED: "#", FREE: ".", UNKNOWN: "?"}
    return [
        "".join(letters[at(grid, column, row)] for column in range(grid.width))
        for row in range(grid.height)
    ]


def draw(segments: list[Any], start: tuple[float, float] = (3.5, 3.5)) -> DrawnMap:
    return draw_map(MapFrame(1.0, (0.0, 0.0), 8, 6), segments, start)


# -- drawing


def test_a_room_is_free_inside_occupied_around_and_unknown_beyond() -> None:
    drawn = draw(box(1.5, 1.5, 6.5, 4.5))
    assert picture(drawn.grid) == [
        "????????",
        "?######?",
        "?#....#?",
        "?#....#?",
        "?######?",
        "????????",
    ]
    assert drawn.closed


def test_the_first_row_is_the_top() -> None:
    drawn = draw([((0.5, 5.5), (2.5, 5.5))])
    assert picture(drawn.grid)[0] == "###....."


def test_the_inside_of_a_thing_in_the_room_is_unknown() -> None:
    drawn = draw_map(MapFrame(1.0, (0.0, 0.0), 5, 5), box(1.5, 1.5, 3.5, 3.5), (0.5, 0.5))
    assert picture(drawn.grid) == [".....", ".###.", ".#?#.", ".###.", "....."]


def test_the_back_of_a_wall_is_unknown() -> None:
    segments = box(1.5, 1.5, 6.5, 4.5) + box(0.5, 0.5, 7.5, 5.5)
    assert picture(draw(segments).grid) == [
        "????????",
        "?######?",
        "?#....#?",
        "?#....#?",
        "?######?",
        "????????",
    ]


def test_walls_at_the_edges_of_the_map_are_seen() -> None:
    assert picture(draw(box(0.5, 0.5, 7.5, 5.5)).grid) == [
        "########",
        "#......#",
        "#......#",
        "#......#",
        "#......#",
        "########",
    ]


def test_free_space_does_not_slip_through_a_diagonal_wall() -> None:
    drawn = draw_map(MapFrame(1.0, (0.0, 0.0), 5, 5), [((0.1, 4.9), (4.9, 0.1))], (0.5, 0.5))
    assert at(drawn.grid, 4, 0) == UNKNOWN
    assert at(drawn.grid, 0, 4) == FREE


def test_a_steep_wall_leaves_no_gap() -> None:
    frame = MapFrame(1.0, (0.0, 0.0), 4, 60)
    drawn = draw_map(frame, [((1.2, 0.0), (2.8, 60.0))], (0.5, 30.5))
    assert all(at(drawn.grid, 3, row) == UNKNOWN for row in range(60))


def test_a_wall_on_the_edge_of_two_cells_is_in_the_upper_one() -> None:
    # 0.15 / 0.05 is 2.9999999999999996 in floating point.
    frame = MapFrame(0.05, (0.0, 0.0), 6, 3)
    drawn = draw_map(frame, [((0.15, 0.0), (0.15, 0.14))], (0.01, 0.01))
    assert picture(drawn.grid) == ["...#??"] * 3


def test_a_wall_that_leaves_the_map_is_cut_at_its_edge() -> None:
    drawn = draw([((-100.0, 2.5), (1000.0, 2.5))], (3.5, 3.5))
    assert picture(drawn.grid)[3] == "########"


def test_free_space_at_the_edge_is_told() -> None:
    assert not draw([((0.5, 0.5), (7.5, 0.5))]).closed


@pytest.mark.parametrize("start", [(8.5, 1.0), (-0.1, 1.0), (1.0, 6.0)])
def test_a_start_outside_the_map_is_refused(start: tuple[float, float]) -> None:
    with pytest.raises(UsageError):
        draw([], start)


def test_a_start_on_a_wall_is_refused() -> None:
    with pytest.raises(UsageError):
        draw([((3.0, 3.5), (4.0, 3.5))])


# -- files


def test_a_written_image_reads_back(tmp_path: Path) -> None:
    grid = Grid(3, 2, bytes([0, 254, 205, 10, 32, 35]))
    (tmp_path / "map.pgm").write_bytes(pgm(grid))
    assert read_pgm(tmp_path / "map.pgm") == grid


@pytest.mark.parametrize(
    "data",
    [
        b"P5\n2 2\n255\n\x00\x20\x23\xfe",
        b"P5 # by\n# a drawing program\n2\n2 255\n\x00\x20\x23\xfe",
        b"P5\n2 2\n255 # white\n\x00\x20\x23\xfe",
        b"P5\n2 2\n255\n\x00\x20\x23\xfe\n",
        b"P2\n# text\n2 2\n255\n0 32\n35 # a cell\n254\n",
        b"P5\n2 2\n65535\n\x00\x00\x20\x20\x23\x23\xfe\xfe",
    ],
    ids=["plain", "comments", "comment after white", "longer", "text", "two bytes"],
)
def test_images_of_every_kind_are_read(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "map.pgm").write_bytes(data)
    assert read_pgm(tmp_path / "map.pgm") == Grid(2, 2, bytes([0, 32, 35, 254]))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x89PNG\r\n",
        b"P6\n1 1\n255\n\x00\x00\x00",
        b"P5\n2 2\n",
        b"P5\n2 x\n255\n",
        b"P5\n0 2\n255\n",
        b"P5\n999999999 999999999\n255\n",
        b"P5\n2 2\n0\n\x00\x00\x00\x00",
        b"P5\n2 2\n255\n\x00\x00\x00",
        b"P5\n1 1\n100\n\xff",
        b"P2\n1 1\n255\nwhite\n",
    ],
)
def test_a_broken_image_is_one_line(tmp_path: Path, data: bytes) -> None:
    file = tmp_path / "map.pgm"
    file.write_bytes(data)
    with pytest.raises(MapError) as caught:
        read_pgm(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [b"P2", b"P5"])
@pytest.mark.parametrize("gap", [b" ", b"#\n"], ids=["blanks", "comments"])
def test_a_header_without_end_is_not_read(tmp_path: Path, kind: bytes, gap: bytes) -> None:
    file = tmp_path / "map.pgm"
    file.write_bytes(kind + gap * (4 << 20) + b"2 2 255\n1 1 1 1")
    tracemalloc.start()
    with pytest.raises(MapError, match="is not a PGM image"):
        read_pgm(file)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 32 << 20


def test_a_missing_image_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(MapError):
        read_pgm(tmp_path / "none.pgm")


def test_the_handouts_yaml_is_written_word_for_word() -> None:
    assert map_yaml(FACTS) == HANDOUT_YAML


def test_a_written_yaml_keeps_every_digit_that_matters() -> None:
    written = yaml.safe_load(
        map_yaml(
            replace(FACTS, resolution=0.0125, origin=(-1234.5678, 0.1, 0.0), free_thresh=0.196)
        )
    )
    assert (written["resolution"], written["free_thresh"]) == (0.0125, 0.196)
    assert written["origin"] == [-1234.5678, 0.1, 0]


# -- agreement


def at(grid: Grid, column: int, row: int) -> int:
    """Return the grey value of a cell, row 0 at the top."""
    return grid.cells[row * grid.width + column]


def walls(*cells: tuple[int, int]) -> Grid:
    data = bytearray([FREE]) * 25
    for column, row in cells:
        data[row * 5 + column] = OCCUPIED
    return Grid(5, 5, bytes(data))


@pytest.mark.parametrize(
    ("student", "share"),
    [
        (walls((2, 2)), 1.0),
        (walls((3, 3)), 1.0),
        (walls((4, 2)), 0.0),
        (walls((1, 1), (2, 3), (0, 2), (2, 2)), 0.75),
        (walls(), 0.0),
    ],
    ids=["same", "diagonal", "two away", "three of four", "empty"],
)
def test_agreement_is_the_share_of_walls_within_one_cell(student: Grid, share: float) -> None:
    assert agreement(student, walls((2, 2))) == share


def test_walls_at_the_end_of_a_row_are_not_near_the_next_rows_start() -> None:
    assert agreement(walls((0, 2)), walls((4, 1))) == 0.0


def test_maps_of_different_sizes_are_not_compared() -> None:
    with pytest.raises(MapError):
        agreement(walls((2, 2)), Grid(5, 4, bytes(20)))


# -- the bundled map


@pytest.fixture(scope="module")
def starter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("starter") / "starter.usda"
    build_starter(path)
    return path


@pytest.mark.parametrize("name", ["turtlebot3_map.yaml", "turtlebot3_map.pgm"])
def test_the_bundled_map_is_made_from_the_bundled_starter(
    starter: Path, tmp_path: Path, name: str
) -> None:
    result = invoke("map", starter, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert (tmp_path / name).read_bytes() == (data_folder("maps") / name).read_bytes()
    assert "warning" not in result.output


def test_the_bundled_yaml_holds_the_handouts_values() -> None:
    assert (data_folder("maps") / "turtlebot3_map.yaml").read_text() == HANDOUT_YAML


def test_the_bundled_map_has_the_handouts_size_and_the_robot_stands_free() -> None:
    grid = read_pgm(data_folder("maps") / "turtlebot3_map.pgm")
    assert (grid.width, grid.height) == (177, 162)
    assert set(grid.cells) == {OCCUPIED, FREE, UNKNOWN}
    # (1.8, 0) in cells from the lower left corner; row 0 is the top.
    column, row = int((1.8 + 6.2) / 0.05), 162 - 1 - int(3.32 / 0.05)
    near = [at(grid, column + i, row + j) for i in range(-6, 7) for j in range(-6, 7)]
    assert set(near) == {FREE}


def test_nav2_gets_everywhere_through_passages_of_60_cm() -> None:
    grid = read_pgm(data_folder("maps") / "turtlebot3_map.pgm")
    disc = [(i, j) for i in range(-6, 7) for j in range(-6, 7) if math.hypot(i, j) <= 6]
    blocked = {(c + i, 161 - r + j) for c, r in grid.walls() for i, j in disc}
    free = {(c, r) for c in range(177) for r in range(162) if at(grid, c, r) == FREE}
    reached = {(160, 95)}
    waiting = list(reached)
    while waiting:
        column, row = waiting.pop()
        for step in ((column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)):
            if step in free and step not in blocked and step not in reached:
                reached.add(step)
                waiting.append(step)
    unswept = [
        (c, r) for c, r in free - reached if not any((c + i, r + j) in reached for i, j in disc)
    ]
    # What a disc of 60 cm cannot sweep are corners, not rooms or passages.
    assert len(unswept) / len(free) < 0.02


def test_options_change_the_frame(starter: Path, tmp_path: Path) -> None:
    arguments = [str(starter), "-o", str(tmp_path), "--resolution", "0.1", "--origin", "-7", "-4"]
    arguments += ["--size", "100", "90", "--height", "0.45", "--start", "-3", "0"]
    assert invoke("map", *arguments).exit_code == 0
    grid = read_pgm(tmp_path / "turtlebot3_map.pgm")
    assert (grid.width, grid.height) == (100, 90)
    described = yaml.safe_load((tmp_path / "turtlebot3_map.yaml").read_text())
    assert (described["resolution"], described["origin"]) == (0.1, [-7.0, -4.0, 0.0])
    # The crates are 0.4 m high: at 0.45 m the place of one is free.
    assert at(grid, int((-4.6 + 7) / 0.1), 90 - 1 - int((2.9 + 4) / 0.1)) == FREE


def test_an_existing_map_is_kept_unless_forced(starter: Path, tmp_path: Path) -> None:
    image = tmp_path / "turtlebot3_map.pgm"
    image.write_text("mine")
    with pytest.raises(UsageError):
        invoke("map", starter, "-o", tmp_path)
    assert image.read_text() == "mine"
    assert [file.name for file in tmp_path.iterdir()] == ["turtlebot3_map.pgm"]
    assert invoke("map", starter, "-o", tmp_path, "--force").exit_code == 0
    assert read_pgm(image).width == 177


def test_a_stage_without_a_robot_needs_start_and_height(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "room.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.CollisionAPI.Apply(UsdGeom.Cube.Define(stage, "/Box").GetPrim())
    stage.Save()
    arguments = [str(tmp_path / "room.usda"), "-o", str(tmp_path / "map")]
    for more in ([], ["--height", "0.2"]):
        with pytest.raises(UsageError):
            invoke("map", *arguments, *more)
    result = invoke("map", *arguments, "--height", "0.2", "--start", "0", "2")
    assert result.exit_code == 0
    assert "edge of the map" in result.output


def test_what_is_not_on_the_map_is_said(starter: Path, tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(starter))
    UsdPhysics.CollisionAPI.Apply(stage.DefinePrim("/Environment/Curved", "NurbsPatch"))
    stage.DefinePrim("/Environment/Shelf").GetReferences().AddReference("not_here.usd")
    stage.GetRootLayer().Export(str(tmp_path / "room.usda"))
    arguments = [str(tmp_path / "room.usda"), "-o", str(tmp_path / "map")]
    result = invoke("map", *arguments)
    assert result.exit_code == 0
    told = [line for line in result.stderr.splitlines() if line.startswith("warning: ")]
    assert len(told) == 2
    assert "content of 1 missing asset" in told[0]
    assert "/Environment/Curved" in told[1]


def test_a_cut_above_everything_is_refused(starter: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        invoke("map", starter, "-o", tmp_path, "--height", "3")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "option",
    [
        "--resolution nan",
        "--resolution inf",
        "--resolution 0",
        "--height nan",
        "--height -inf",
        "--origin nan 0",
        "--start 0 inf",
        "--size 0 5",
    ],
)
def test_what_is_no_length_is_wrong_use(starter: Path, tmp_path: Path, option: str) -> None:
    result = invoke("map", starter, "-o", tmp_path, *option.split())
    assert result.exit_code == 2, result.output
    assert option.split(maxsplit=1)[0] in result.stderr
    assert not list(tmp_path.iterdir())


# -- an outside reference


def prism(stage: Usd.Stage, path: str, rings: list[list[Any]], place: Gf.Matrix4d) -> None:
    """A mesh of walls without lid: each ring of corners is one closed wall."""
    points: list[Any] = []
    faces: list[int] = []
    for ring in rings:
        first, count = len(points), len(ring)
        points += [(x, y, z) for z in (0.0, ring[0][2]) for x, y, _ in ring]
        for corner in range(count):
            after = (corner + 1) % count
            faces += [first + corner, first + after, first + count + after, first + count + corner]
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.GetPointsAttr().Set(points)
    mesh.GetFaceVertexCountsAttr().Set([4] * (len(faces) // 4))
    mesh.GetFaceVertexIndicesAttr().Set(faces)
    mesh.AddTransformOp().Set(place)
    UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())


def corner_rings(vertices: list[list[float]]) -> list[list[Any]]:
    """The upper corners by their distance from the middle, each ring in the order of its angle."""
    top = [corner for corner in vertices if corner[2] > 0]
    rings: dict[int, list[Any]] = {}
    for corner in sorted(top, key=lambda corner: math.atan2(corner[1], corner[0])):
        rings.setdefault(round(math.hypot(*corner[:2]) / 10), []).append(corner)
    return list(rings.values())


def world_stage(world: dict[str, Any]) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    for item in world["collisions"]:
        x, y, z, _, _, yaw = item["pose"]
        turn = Gf.Rotation(Gf.Vec3d.ZAxis(), math.degrees(yaw))
        place = Gf.Matrix4d(turn, Gf.Vec3d(x, y, z))
        path = f"/{item['name']}"
        if item["type"] == "cylinder":
            shape = UsdGeom.Cylinder.Define(stage, path)
            shape.GetRadiusAttr().Set(item["radius"])
            shape.GetHeightAttr().Set(item["length"])
            shape.AddTransformOp().Set(place)
            UsdPhysics.CollisionAPI.Apply(shape.GetPrim())
        else:
            name = "wall_mesh" if "wall" in item["uri"] else "hexagon_mesh"
            size = Gf.Matrix4d().SetScale(item["scale"][0] * INCH)
            prism(stage, path, corner_rings(world[name]["unique_vertices"]), size * place)
    return stage


@pytest.mark.skipif(not OUTSIDE.is_dir(), reason="../shared/turtlebot3 is not here")
def test_the_map_of_robotis_world_agrees_with_robotis_map(
    capsys: pytest.CaptureFixture[str],
) -> None:
    world = json.loads((OUTSIDE / "turtlebot3_world.json").read_text())
    theirs = read_pgm(OUTSIDE / "map.pgm")
    described = yaml.safe_load((OUTSIDE / "map.yaml").read_text())
    x, y, _ = described["origin"]
    frame = MapFrame(described["resolution"], (x, y), theirs.width, theirs.height)
    cut = slice_stage(world_stage(world), SliceOptions("/robot", "/lidar", 0.182))
    ours = draw_map(frame, cut.segments, (-2.0, -0.5)).grid
    walls_found = agreement(theirs, ours)
    free = [index for index, value in enumerate(theirs.cells) if value == FREE]
    blocked = sum(ours.cells[index] == OCCUPIED for index in free) / len(free)
    figures = f"{walls_found:.1%} of its walls found, {blocked:.2%} of its free cells blocked"
    with capsys.disabled():
        print(f"\nROBOTIS's map: {figures}")  # noqa: T201 - figures to be read, not only held
    assert walls_found >= 0.95
    assert blocked <= 0.02
