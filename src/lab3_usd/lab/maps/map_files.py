"""Reads a map as handed in, right or wrong, for the rules about maps."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath

import yaml
from msgspec import Struct

from lab3_usd.lab.maps.grid import GAP, MapError, read_pgm
from lab3_usd.lab.plain_yaml import load_plain
from lab3_usd.model.folder.lab_files import MapSubject
from lab3_usd.spec.ros import MapFacts

_PNG = b"\x89PNG\r\n\x1a\n"
_NUMBER = rb"(\d{1,9})"
_BITMAP = re.compile(rb"P[14]" + GAP + _NUMBER + GAP + _NUMBER + rb"\s")
_COLOUR = re.compile(rb"P[36]" + GAP + _NUMBER + GAP + _NUMBER + GAP + _NUMBER + rb"\s")
_TWO_BYTES = 255  # what is lighter than that takes two


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
    others = sorted(path for path in folder.glob("*.y*ml") if path.is_file())
    return others[0] if not named.is_file() and len(others) == 1 else named


def map_subject(yaml_path: Path | None, facts: MapFacts, root: Path | None = None) -> MapSubject:
    """Read a map YAML and the image it names; None says that no map was handed in.

    Files are named relative to `root`, by default the YAML's folder. What cannot be read is said in
    the subject, not raised. The caller compares it with the walls of a stage.
    """
    if yaml_path is None:
        return MapSubject(facts, given=False, file=facts.yaml)
    base = root if root is not None else yaml_path.parent
    file = _relative(yaml_path, base)
    values, fault = _read(yaml_path)
    image = values.get("image") if values is not None else None
    if not isinstance(image, str) or not image:
        return MapSubject(facts, given=True, file=file, values=values, fault=fault)
    absolute = _is_absolute(image)
    image_path = yaml_path.parent / (PureWindowsPath(image).name if absolute else image)
    inside = _is_inside(image_path, base)
    exists = inside and image_path.is_file()
    shown = _image(image_path) if exists else _Image()
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


def _is_absolute(image: str) -> bool:
    """Whether a path holds for one computer only, whichever system that runs."""
    windows = PureWindowsPath(image).is_absolute()
    return windows or PurePosixPath(image).is_absolute() or image.startswith("~")


def _is_inside(path: Path, base: Path) -> bool:
    """Whether a path that somebody else wrote stays in the submission and can be asked for."""
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except (OSError, ValueError):
        return False
    return path.resolve().is_relative_to(base.resolve())


def _load(data: bytes) -> object:
    """Read a YAML as map_server's yaml-cpp does, which takes a tab for a blank between words."""
    try:
        return load_plain(data)
    except yaml.YAMLError:
        if b"\t" not in data:
            raise
        return load_plain(_TABS.sub(b" ", data))


def _read(path: Path) -> tuple[dict[str, object] | None, str | None]:
    try:
        data = _load(path.read_bytes())
    except FileNotFoundError:
        return None, "is not handed in"
    except OSError as error:
        return None, f"cannot be read ({error.strerror})"
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        return None, "is not YAML" + (f", see line {mark.line + 1}" if mark is not None else "")
    if not isinstance(data, dict):
        return None, "holds no keys such as 'image' and 'resolution'"
    return {str(key): value for key, value in data.items()}, None


class _Image(Struct, frozen=True):
    """What an image file shows."""

    size: tuple[int, int] | None = None
    fault: str | None = None
    format: str = ""


def _image(path: Path) -> _Image:
    try:
        grid = read_pgm(path)
    except (MapError, OSError, ValueError) as error:
        fault = str(error).replace(str(path), "").lstrip(": ")
    else:
        return _Image((grid.width, grid.height))
    try:
        other = _other_image(path.read_bytes())
    except OSError:
        other = None
    if other is None:
        return _Image(fault=f"{fault}; map_server cannot load it")
    told = path.suffix.lower() in other.endings
    return _Image((other.width, other.height), format="" if told else other.name)


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
        found = header.match(data)
        if found:
            width, height, *white = (int(group) for group in found.groups())
            image = _OtherImage(name, (ending, ".pnm"), width, height)
            return image if _is_whole(data[:2], data[found.end() :], image, *white) else None
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
    return len(body) >= 3 * cells * (2 if white > _TWO_BYTES else 1)


def _png(data: bytes) -> _OtherImage | None:
    """Read the size of a PNG out of its first chunk; None unless its last one is there."""
    chunks = dict(_chunks(data))
    header = chunks.get(b"IHDR")
    if header is None or b"IDAT" not in chunks or b"IEND" not in chunks:
        return None
    width, height = (int.from_bytes(data[header + at : header + at + 4], "big") for at in (0, 4))
    return _OtherImage("PNG", (".png",), width, height)


def _chunks(data: bytes) -> Iterator[tuple[bytes, int]]:
    """Yield the name of each chunk that is whole, and where what it holds begins."""
    at = len(_PNG)
    while (end := at + 12 + int.from_bytes(data[at : at + 4], "big")) <= len(data):
        yield data[at + 4 : at + 8], at + 8
        at = end
