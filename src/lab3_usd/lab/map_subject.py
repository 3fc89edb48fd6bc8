"""Reads a map as handed in, right or wrong, for the rules about maps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath, PureWindowsPath

import yaml

from lab3_usd.check.subjects_lab import Agreement, MapSubject
from lab3_usd.lab.maps import MapError, read_pgm
from lab3_usd.lab.plain_yaml import load_plain
from lab3_usd.spec.ros_spec import MapFacts


def find_map(folder: Path, facts: MapFacts) -> Path:
    """Return the map YAML of a folder: the one with the handout's name, else the only one there."""
    named = folder / facts.yaml
    others = sorted(path for path in folder.glob("*.y*ml") if path.is_file())
    return others[0] if not named.is_file() and len(others) == 1 else named


def map_subject(
    yaml_path: Path | None,
    facts: MapFacts,
    root: Path | None = None,
    agreements: Sequence[Agreement] = (),
) -> MapSubject:
    """Read a map YAML and the image it names; None says that no map was handed in.

    Files are named relative to `root`, by default the YAML's folder. What cannot be read is said in
    the subject, not raised. `agreements` are the caller's comparisons with the walls of a stage.
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
    size, image_fault = _size(image_path) if exists else (None, None)
    return MapSubject(
        facts,
        given=True,
        file=file,
        values=values,
        image_file=_relative(image_path, base) if exists or (inside and not absolute) else "",
        image_absolute=absolute,
        image_exists=exists,
        image_fault=image_fault,
        size=size,
        agreements=tuple(agreements),
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


def _read(path: Path) -> tuple[dict[str, object] | None, str | None]:
    try:
        data = load_plain(path.read_bytes())
    except OSError as error:
        return None, f"cannot be read ({error.strerror})"
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        return None, "is not YAML" + (f", see line {mark.line + 1}" if mark is not None else "")
    if not isinstance(data, dict):
        return None, "holds no keys such as 'image' and 'resolution'"
    return {str(key): value for key, value in data.items()}, None


def _size(path: Path) -> tuple[tuple[int, int] | None, str | None]:
    try:
        grid = read_pgm(path)
    except (MapError, OSError, ValueError) as error:
        return None, str(error).replace(str(path), "").lstrip(": ")
    return (grid.width, grid.height), None


def _relative(path: Path, base: Path) -> str:
    try:
        return path.resolve().relative_to(base.resolve()).as_posix()
    except (ValueError, OSError):
        return path.as_posix()
