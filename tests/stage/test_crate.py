"""Binary layers whose tables do not fit into their file: refused before usd-core makes room."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from places import SHARED, TESTS
from pxr import Sdf, Usd, UsdGeom

from lab3_usd.errors import StageError
from lab3_usd.stage.read.crate import check_binary, entry_counts
from lab3_usd.stage.read.opening import open_stage

REAL = (SHARED / "corpus", TESTS)
ABSURD = 782_958_592  # of a stage that was cut by 86 bytes, read as a number of sections


@cache
def layer() -> bytes:
    stage = Usd.Stage.CreateInMemory()
    mesh = UsdGeom.Mesh.Define(stage, "/World/Floor")
    mesh.CreatePointsAttr([(n, n / 2, 1.0) for n in range(300)])
    for n in range(40):
        stage.DefinePrim(f"/World/Box{n}", "Cube")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/World"))
    return in_binary(stage.GetRootLayer())


def in_binary(text: Sdf.Layer) -> bytes:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "layer.usdc")
        text.Export(str(path))
        return path.read_bytes()


def contents(data: bytes) -> int:
    (place,) = struct.unpack_from("<q", data, 16)
    return int(place)


def sections(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Each section: its name, where its entry in the table stands, where it begins."""
    table = contents(data)
    for index in range(struct.unpack_from("<Q", data, table)[0]):
        entry = table + 8 + 32 * index
        name, begin, _ = struct.unpack_from("<16sqq", data, entry)
        yield name.rstrip(b"\0"), entry, begin


def changed(data: bytes, place: int, number: int) -> bytes:
    with_number = bytearray(data)
    struct.pack_into("<q", with_number, place, number)
    return bytes(with_number)


def refused(data: bytes) -> bool:
    try:
        check_binary(io.BytesIO(data), data[:8])
    except StageError:
        return True
    return False


def damages() -> dict[str, bytes]:
    data = layer()
    found = {"count of sections": changed(data, contents(data), ABSURD)}
    for name, entry, begin in sections(data):
        found[f"beginning of {name.decode()}"] = changed(data, entry + 16, len(data))
        found[f"size of {name.decode()}"] = changed(data, entry + 24, ABSURD)
        found[f"count of {name.decode()}"] = changed(data, begin, ABSURD)
    begins = {name: begin for name, _, begin in sections(data)}
    found["unpacked size of TOKENS"] = changed(data, begins[b"TOKENS"] + 8, ABSURD)
    found["packed size of TOKENS"] = changed(data, begins[b"TOKENS"] + 16, ABSURD)
    found["second count of PATHS"] = changed(data, begins[b"PATHS"] + 8, ABSURD)
    return found


@pytest.mark.parametrize("damage", damages())
def test_a_table_that_does_not_fit_is_refused(damage: str) -> None:
    assert refused(damages()[damage])


BEGIN_OF_VALUES = 88  # behind the bootstrap; the first is the names of the root's children


@pytest.mark.parametrize("length", [1, 300], ids=["children of the root", "points of the mesh"])
def test_a_list_that_says_it_is_longer_than_the_file_is_refused(length: int) -> None:
    place = layer().index(struct.pack("<Q", length), BEGIN_OF_VALUES)
    assert refused(changed(layer(), place, ABSURD * length))


@pytest.mark.parametrize("name", [0x7FFF0001, 0], ids=["no token", "a name that no prim has"])
def test_a_child_that_is_no_prim_is_damage(tmp_path: Path, name: int) -> None:
    path = tmp_path / "stage.usdc"
    path.write_bytes(changed(layer(), BEGIN_OF_VALUES + 8, name))
    with pytest.raises(StageError, match=r"stage\.usdc: cannot be read: it is damaged"):
        open_stage(path)


def test_a_layer_with_wires_and_targets_is_opened(tmp_path: Path) -> None:
    path = tmp_path / "stage.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    prim = stage.DefinePrim("/a")
    prim.CreateRelationship("to").SetTargets([Sdf.Path("/b")])
    prim.CreateAttribute("in", Sdf.ValueTypeNames.Int).SetConnections([Sdf.Path("/b.out")])
    stage.Save()
    assert open_stage(path).GetPrimAtPath("/a")


def jumps(data: bytes) -> int:
    """Where the last of the three tables of paths begins, behind their sizes."""
    place = {name: begin for name, _, begin in sections(data)}[b"PATHS"] + 16
    for _ in range(2):
        place += 8 + struct.unpack_from("<Q", data, place)[0]
    return place + 8


@pytest.mark.parametrize("back", [1, 2, 4])
def test_a_path_whose_next_one_lies_behind_the_last_is_refused(back: int) -> None:
    begin = jumps(layer())
    end = begin + struct.unpack_from("<Q", layer(), begin - 8)[0]
    damaged = bytearray(layer())
    damaged[end - back] ^= 0x80  # of the last differences, which are -1
    assert refused(bytes(damaged))


def test_a_child_in_a_package_that_is_no_prim_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "stage.usdz"
    path.write_bytes(packed({"a.usdc": changed(layer(), BEGIN_OF_VALUES + 8, 0)}))
    with pytest.raises(StageError, match=r"stage\.usdz: cannot be read: it is damaged"):
        open_stage(path)


def test_a_whole_layer_is_not() -> None:
    counts = entry_counts(io.BytesIO(layer()))
    assert counts[b"SPECS"] > 40
    assert not refused(layer())


def test_nothing_is_refused_of_real_stages() -> None:
    for path in (path for folder in REAL for path in sorted(folder.rglob("*.usd*"))):
        with path.open("rb") as file:
            check_binary(file, file.read(8))


def cut_off(data: bytes) -> bytes:
    return data[: len(data) // 2]


@pytest.mark.parametrize("ending", ["usdc", "usd", "usdz"])
def test_a_stage_with_an_absurd_count_is_said_to_be_damaged(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"stage.{ending}"
    damaged = changed(layer(), contents(layer()), ABSURD)
    path.write_bytes(damaged if ending != "usdz" else packed({"a.usdc": damaged}))
    with pytest.raises(StageError, match="damaged or cut short"):
        open_stage(path)


def packed(files: dict[str, bytes]) -> bytes:
    """A package as OpenUSD writes it, but for the alignment of its files."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as package:
        for name, data in files.items():
            package.writestr(name, data)
    return whole.getvalue()


def test_every_layer_of_a_package_is_looked_at() -> None:
    assert not refused(packed({"a.usda": b"#usda 1.0", "b.usdc": layer()}))
    assert refused(packed({"a.usdc": layer(), "b.usdc": cut_off(layer())}))


@pytest.mark.parametrize("length", [30, 200, 2000])
def test_a_package_that_is_cut_is_damaged(length: int) -> None:
    assert refused(packed({"a.usdc": layer()})[:length])


ARCS = {
    "reference": 'def "World" (references = @./robot.usdc@) {}',
    "payload": 'def "World" (payload = @robot.usdc@</World>) {}',
    "variant": """def "World" (variantSets = "v") {
        variantSet "v" = { "a" ( references = @robot.usdc@ ) {} }
    }""",
}


@pytest.mark.parametrize("form", ["usda", "usdc"])
@pytest.mark.parametrize("arc", [*ARCS, "sublayer"])
def test_a_damaged_layer_that_a_stage_leads_to_is_named(
    tmp_path: Path, arc: str, form: str
) -> None:
    text = f"#usda 1.0\n{ARCS[arc]}" if arc in ARCS else "#usda 1.0\n(subLayers = [@robot.usdc@])"
    root, middle = Sdf.Layer.CreateAnonymous(".usda"), tmp_path / f"middle.{form}"
    root.ImportFromString(text)
    root.Export(str(middle))
    stage = tmp_path / "stage.usda"
    stage.write_text(f"#usda 1.0\n(subLayers = [@./{middle.name}@])")
    robot = tmp_path / "robot.usdc"
    robot.write_bytes(layer())
    assert open_stage(stage)
    robot.write_bytes(changed(layer(), contents(layer()), ABSURD))
    with pytest.raises(StageError, match=r"stage\.usda: leads to .*robot\.usdc, which cannot be"):
        open_stage(stage)
