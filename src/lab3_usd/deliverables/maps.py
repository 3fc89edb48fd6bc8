"""Occupancy maps: their files as map_server reads them, as handed in, and compared."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from itertools import compress
from pathlib import Path, PurePosixPath, PureWindowsPath

import msgspec
import yaml
from msgspec import Struct

from lab3_usd.data import data_folder, own_lab
from lab3_usd.deliverables.plain_yaml import NOT_YAML, load_plain, not_yaml
from lab3_usd.errors import Lab3Error
from lab3_usd.files import first_bytes
from lab3_usd.model.folder import MapSubject
from lab3_usd.model.occupancy import Cell, OccupancyMap, cells_within
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.spec.ros import MapFacts

OCCUPIED, FREE, UNKNOWN = 0, 254, 205
_WHITE = 255
_TWO_BYTES = 65535
_MOST_CELLS = 10**8
_MOST_COMPARED = 10**6  # cells of a map that a scan is laid on
_MOST_DIGITS = 9
_LONGEST_HEADER = 1 << 16  # bytes; comments in it are some lines
GAP = rb"(?:\s|#[^\n]*\n)+"
# One white space ends the header: in a binary file the next byte is a cell.
_HEADER = re.compile(
    rb"(?P<kind>P[25])"
    + GAP
    + rb"(?P<width>\d{1,9})"
    + GAP
    + rb"(?P<height>\d{1,9})"
    + GAP
    + rb"(?P<white>\d{1,9})(?:[ \t]*#[^\n]*)?\s"
)


class MapError(Lab3Error):
    """A map file cannot be read, or two maps cannot be compared."""


class Grid(Struct, frozen=True):
    """A map image: one byte for each cell, row 0 at the top."""

    width: int
    height: int
    cells: bytes

    def walls(self, threshold: float = 0.65, *, negate: bool = False) -> frozenset[Cell]:
        """Return the cells that map_server calls occupied, black being 1."""
        greys = range(_WHITE + 1)
        marks = bytes((v if negate else _WHITE - v) / _WHITE > threshold for v in greys)
        occupied = compress(range(len(self.cells)), self.cells.translate(marks))
        return frozenset((at % self.width, self.height - 1 - at // self.width) for at in occupied)


def map_yaml(facts: MapFacts) -> str:
    """Write a map's YAML in the order and form of the handout (4.2)."""
    origin = ", ".join(f"{value:.10g}" for value in facts.origin)
    return (
        f"image: {facts.image}\n"
        f"mode: {facts.mode}\n"
        f"resolution: {facts.resolution:.10g}\n"
        f"origin: [{origin}]\n"
        f"negate: {facts.negate}\n"
        f"occupied_thresh: {facts.occupied_thresh:.10g}\n"
        f"free_thresh: {facts.free_thresh:.10g}\n"
    )


def pgm(grid: Grid) -> bytes:
    """Write a grid as a binary PGM."""
    return b"P5\n%d %d\n%d\n" % (grid.width, grid.height, _WHITE) + grid.cells


def read_pgm(path: Path) -> Grid:
    """Read a PGM image, binary (P5) or text (P2), with comments; grey values become 0 to 255.

    Raises:
        MapError: the file cannot be read, is no PGM, or holds other cells than it announces.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MapError(f"{path} cannot be read ({error.strerror})") from error
    header = _HEADER.match(data, 0, _LONGEST_HEADER)
    if header is None:
        raise MapError(
            f"{path} is not a PGM image, which begins with P5 or P2, width, height and white"
        )
    width, height, white = (int(header[name]) for name in ("width", "height", "white"))
    if not (0 < width * height <= _MOST_CELLS and 0 < white <= _TWO_BYTES):
        raise MapError(f"{path}: no map has {width} x {height} cells and {white} shades of grey")
    body = data[header.end() :]
    values: Sequence[int]
    if header["kind"] != b"P5":
        words = re.sub(rb"#[^\n]*", b"", body).split()
        if not all(word.isdigit() and len(word) <= _MOST_DIGITS for word in words):
            raise MapError(f"{path}: a text PGM (P2) holds only whole numbers")
        values = [int(word) for word in words]
    elif white > _WHITE:
        values = [body[at] * 256 + body[at + 1] for at in range(0, len(body) - 1, 2)]
    else:
        values = body
    if len(values) < width * height:
        raise MapError(f"{path}: {width} x {height} cells announced, only {len(values)} found")
    cells = values[: width * height]
    if max(cells) > white:
        raise MapError(f"{path}: a cell is {max(cells)}, but white is {white}")
    grey = cells if white == _WHITE else (value * _WHITE // white for value in cells)
    return Grid(width, height, bytes(grey))


def _read_whole(path: Path) -> tuple[dict[str, object], str, Grid]:
    """Return the values of a map file, the name of its image, and its cells.

    Raises:
        MapError: it cannot be read, or is larger than a scan is compared with.
    """
    values, fault = _read(path)
    image = values.get("image") if values is not None else None
    if values is None or not isinstance(image, str):
        raise MapError(f"{path} {fault or 'names no image'}")
    grid = read_pgm(path.parent / image)
    if grid.width * grid.height > _MOST_COMPARED:
        raise MapError(f"{path}: {grid.width} x {grid.height} cells are too many")
    return values, image, grid


def read_map(path: Path, *, given: bool = True) -> OccupancyMap:
    """Read a map as map_server loads it (nav2_map_server, humble: map_io.cpp:114-282).

    Raises:
        MapError: it cannot be read, or is larger than a scan is compared with.
    """
    values, _, grid = _read_whole(path)
    try:
        resolution, threshold = float(values["resolution"]), float(values["occupied_thresh"])  # type: ignore[arg-type]
        x, y, turn = map(float, values["origin"])  # type: ignore[call-overload]
        is_negated = bool(int(values.get("negate", 0)))  # type: ignore[call-overload]
    except (KeyError, TypeError, ValueError) as error:
        raise MapError(f"{path} has no resolution, origin or threshold") from error
    if not (resolution > 0 and all(map(math.isfinite, (resolution, x, y, turn)))):
        raise MapError(f"{path} has no resolution, or an invalid origin")
    walls = grid.walls(threshold, negate=is_negated)
    return OccupancyMap(path.name, resolution, (x, y, turn), grid.width, grid.height, walls, given)


class SuppliedMap(Struct, frozen=True):
    """The map that a grader supplied to the class: its values and its cells."""

    facts: MapFacts
    grid: Grid


def supplied_map(path: Path) -> SuppliedMap:
    """Read the supplied map, a YAML file or the folder that holds it.

    Raises:
        MapError: it cannot be read, is too large, or the lab has no map.
    """
    facts = load_lab().scene.map
    if facts is None:
        raise MapError(f"{path}: the lab has no map to compare with")
    file = find_map(path, facts) if path.is_dir() else path
    if not file.is_file():
        raise MapError(f"{file}: there is no such file")
    values, image, grid = _read_whole(file)
    map_values = {
        "mode": facts.mode,
        **{name: value for name, value in values.items() if name in MapFacts.__struct_fields__},
        "handout": facts.handout,
        "yaml": file.name,
        "image": Path(image).name,
        "width": grid.width,
        "height": grid.height,
    }
    try:
        return SuppliedMap(msgspec.convert(map_values, MapFacts, strict=False), grid)
    except msgspec.ValidationError as error:
        raise MapError(f"{file}: {error}") from error


def map_of_stage(stage: Path, maps: Path | None, lab: Lab) -> OccupancyMap | None:
    """Return the map that a stage is localized in: the one given, that beside it, or the lab's.

    `maps` is a folder or the YAML file itself; beside it is in the folder of the stage, or in that
    of the maps of its submission.

    Raises:
        MapError: it cannot be read.
    """
    facts = lab.scene.map
    if facts is None:
        return None
    if maps is not None:
        return read_map(find_map(maps, facts) if maps.is_dir() else maps)
    name = lab.submission.folders.maps
    above = stage.resolve().parents
    for folder in (above[0], above[0] / name, *(base / name for base in above[1:2])):
        if (folder / facts.yaml).is_file():
            return read_map(folder / facts.yaml)
    ours = data_folder("maps") / facts.yaml
    return read_map(ours, given=False) if own_lab() is None and ours.is_file() else None


def agreement(student: Grid, ours: Grid) -> float:
    """Return the share of the student's occupied cells that lie within one cell of one of ours.

    A cell's neighbours include the diagonal ones. A map without walls agrees with nothing: 0.

    Raises:
        MapError: the maps have different sizes.
    """
    if (student.width, student.height) != (ours.width, ours.height):
        raise MapError(
            f"a map of {student.width} x {student.height} cells cannot be compared "
            f"with one of {ours.width} x {ours.height}"
        )
    walls = student.walls()
    return len(walls & cells_within(ours.walls(), 1)) / len(walls) if walls else 0.0


_PNG = b"\x89PNG\r\n\x1a\n"
_NUMBER = rb"(\d{1,9})"
_BITMAP = re.compile(rb"P[14]" + GAP + _NUMBER + GAP + _NUMBER + rb"\s")
_COLOUR = re.compile(rb"P[36]" + GAP + _NUMBER + GAP + _NUMBER + GAP + _NUMBER + rb"\s")
_ONE_BYTE = 255  # what is lighter than that takes two


class _OtherImage(Struct, frozen=True):
    """An image by its format, the endings that say so, and its size in cells."""

    name: str
    endings: tuple[str, ...]
    width: int
    height: int


_TABS = re.compile(rb"(?<=[^\s])\t+")  # not those that a line begins with


def find_map(folder: Path, facts: MapFacts) -> Path:
    """Return the map YAML of a folder: the one with the handout's name, else the only one there."""
    named = folder / facts.yaml
    paths = sorted(path for path in folder.glob("*.y*ml") if path.is_file())
    return paths[0] if not named.is_file() and len(paths) == 1 else named


def opens_all(_name: str) -> str:
    """Have nothing against opening a file."""
    return ""


def map_subject(
    yaml_path: Path | None,
    facts: MapFacts,
    root: Path | None = None,
    may_open: Callable[[str], str] = opens_all,
) -> MapSubject:
    """Read a map YAML and the image it names; None says that no map was handed in.

    Files are named relative to `root`, by default the YAML's folder. A read error is a fault
    of the subject, not an exception. The caller compares it with the walls of a stage. `may_open`
    receives the image before it is opened, and returns a reason not to open it.
    """
    if yaml_path is None:
        return MapSubject(facts, given=False, file=facts.yaml)
    base = root if root is not None else yaml_path.parent
    file = _relative(yaml_path, base)
    values, fault = _read(yaml_path)
    image = values.get("image") if values is not None else None
    if not isinstance(image, str) or not image:
        return MapSubject(facts, given=True, file=file, values=values, fault=fault)
    windows, posix = PureWindowsPath(image), PurePosixPath(image)
    absolute = windows.is_absolute() or posix.is_absolute() or image.startswith("~")
    image_path = yaml_path.parent / (windows.name if absolute else image)
    inside = _is_inside(image_path, base)
    exists = inside and image_path.is_file()
    refused = may_open(_relative(image_path, base)) if exists else ""
    shown = _image(image_path) if exists and not refused else _Image(fault=refused or None)
    return MapSubject(
        facts,
        given=True,
        file=file,
        values=values,
        image_file=_relative(image_path, base) if exists or (inside and not absolute) else "",
        image_absolute=absolute,
        image_exists=exists,
        image_fault=shown.fault,
        image_format=shown.format,
        size=shown.size,
    )


def _is_inside(path: Path, base: Path) -> bool:
    """Whether a path that somebody else wrote stays in the submission and can be asked for."""
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except (OSError, ValueError):
        return False
    return path.resolve().is_relative_to(base.resolve())


def _read(path: Path) -> tuple[dict[str, object] | None, str | None]:
    """Return the keys of a map's YAML, or what is wrong with it."""
    try:
        text = path.read_bytes()
        try:
            data = load_plain(text)
        except yaml.YAMLError:
            if b"\t" not in text:
                raise
            # The yaml-cpp of map_server takes a tab for a blank between words.
            data = load_plain(_TABS.sub(b" ", text))
    except FileNotFoundError:
        return None, "was not submitted"
    except OSError as error:
        return None, f"cannot be read ({error.strerror})"
    except NOT_YAML as error:
        return None, not_yaml(error)
    if not isinstance(data, dict):
        return None, "has no keys such as 'image' and 'resolution'"
    return {str(key): value for key, value in data.items()}, None


class _Image(Struct, frozen=True):
    """What an image file shows."""

    size: tuple[int, int] | None = None
    fault: str | None = None
    format: str = ""


def _image(path: Path) -> _Image:
    try:
        grid = read_pgm(path)
        return _Image((grid.width, grid.height))
    except MapError as error:
        fault = str(error).replace(str(path), "").lstrip(": ")
    image = _other_image(first_bytes(path, -1))
    if image is None:
        return _Image(fault=f"{fault}; map_server cannot load it")
    is_expected_ending = path.suffix.lower() in image.endings
    return _Image((image.width, image.height), format="" if is_expected_ending else image.name)


def _relative(path: Path, base: Path) -> str:
    try:
        return path.resolve().relative_to(base.resolve()).as_posix()
    except (ValueError, OSError):
        return path.as_posix()


def _other_image(data: bytes) -> _OtherImage | None:
    """Return what a file holds where it is a whole PNG, PPM or PBM image."""
    if data.startswith(_PNG):
        return _png(data)
    for header, name, ending in ((_COLOUR, "PPM", ".ppm"), (_BITMAP, "PBM", ".pbm")):
        match = header.match(data, 0, _LONGEST_HEADER)
        if match:
            width, height, *white = (int(group) for group in match.groups())
            image = _OtherImage(name, (ending, ".pnm"), width, height)
            return image if _is_whole(data[:2], data[match.end() :], image, *white) else None
    return None


def _is_whole(kind: bytes, body: bytes, image: _OtherImage, white: int = 1) -> bool:
    """Whether as many values stand after a header as it announces."""
    cells = image.width * image.height
    if cells == 0:
        return False
    if kind == b"P1":  # digits, which need no blanks between them
        return sum(map(body.count, (b"0", b"1"))) >= cells
    if kind == b"P3":
        return len(body.split()) >= 3 * cells
    if kind == b"P4":
        return len(body) >= (image.width + 7) // 8 * image.height
    return len(body) >= 3 * cells * (2 if white > _ONE_BYTE else 1)


def _png(data: bytes) -> _OtherImage | None:
    """Read the size of a PNG out of its first chunk; None unless its last one is there."""
    chunks: dict[bytes, int] = {}  # where the content of each whole chunk begins, by its name
    at = len(_PNG)
    while (end := at + 12 + int.from_bytes(data[at : at + 4], "big")) <= len(data):
        chunks[data[at + 4 : at + 8]] = at + 8
        at = end
    header = chunks.get(b"IHDR")
    if header is None or b"IDAT" not in chunks or b"IEND" not in chunks:
        return None
    width, height = (int.from_bytes(data[n : n + 4], "big") for n in (header, header + 4))
    return _OtherImage("PNG", (".png",), width, height)
