"""Rules about the map files that localization loads (4.2, H1, H4, 8.13)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath, PureWindowsPath
from posixpath import normpath

from lab3_usd.check.registry import rule
from lab3_usd.check.rules.files import is_equal, shortened
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.folder import MapSubject

REFUSED = "map_server cannot load it"
_TRUE = {"y", "yes", "true", "on"}
_FALSE = {"n", "no", "false", "off"}
_WHOLE = re.compile(r"[-+]?[0-9]{1,9}")


def number_in_yaml(value: object) -> float | None:
    """Read a length or a threshold; YAML 1.1 takes `5e-2`, without a point, for text."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        return float(value)
    except ValueError:
        return None


def _switch(value: object) -> int | None:
    """Read a whole number or a truth value."""
    if not isinstance(value, str):
        return int(value) if isinstance(value, int) else None
    text = value.strip().lower()
    if text in _TRUE | _FALSE:
        return int(text in _TRUE)
    return int(text) if _WHOLE.fullmatch(text) else None


def _mode(value: object) -> str | None:
    text = str(value).lower()
    return text if text in {"trinary", "scale", "raw"} else None


# Each gives None where map_server does not load the map.
READ: Mapping[str, Callable[[object], object]] = {
    "mode": _mode,
    "resolution": number_in_yaml,
    "negate": _switch,
    "occupied_thresh": number_in_yaml,
    "free_thresh": number_in_yaml,
}


_ALIKE = 0.9  # of the walls; so many points of a scan have to lie at a wall of its map
_DEFAULTS = {"mode": "trinary"}  # what map_server takes where the file says nothing


@rule("M01", "map-file-unreadable", scope="maps")
def map_file_unreadable(subject: MapSubject) -> Iterator[Problem]:
    """The map file is missing or unreadable.

    Why: map_server fails to configure, so there is no map. AMCL waits forever, and `{above} ->
    {root}` never appears.

    Fix: copy the supplied `{map}` into `{maps}/` again, without editing it.

    Example: `ls {maps}` shows `{map}.txt`.
    """
    if subject.given and subject.fault is not None:
        yield Problem(subject.file, f"map file {subject.fault}", expected=subject.facts.yaml)


@rule("M02", "map-image-path", scope="maps")
def map_image_path(subject: MapSubject) -> Iterator[Problem]:
    """The path of the map image is absolute, elsewhere, or missing.

    Why: the map loads only on the computer where that path exists. On another computer map_server
    refuses to configure.

    Fix: write `image: {map_image}` and put the image into the folder of the YAML file.

    Example: `image: /home/ana/{maps}/{map_image}`.
    """
    if subject.values is None:
        return
    image = subject.values.get("image")
    expected = subject.facts.image
    if not isinstance(image, str) or not image:
        value = "''" if image == "" else shortened(image)
        message = f"'image' is {value if 'image' in subject.values else 'missing'}"
        yield Problem(subject.file, message, "image", expected)
    elif subject.image_absolute:
        message = f"'image' is the absolute path '{image}', which exists on one computer only"
        yield Problem(subject.file, message, "image", expected, image)
    elif normpath(image) != PurePosixPath(image).name:
        message = f"'image' is '{image}', in another folder than the map file"
        yield Problem(subject.file, message, "image", expected, image)


@rule("M03", "map-image-name", scope="maps")
def map_image_name(subject: MapSubject) -> Iterator[Problem]:
    """The map file names another image.

    Why: another image is another map. Its walls do not match the scene, and the robot is never
    where RViz shows it.

    Fix: write `image: {map_image}`, the image supplied with the lab.

    Example: `image: my_map.pgm`.
    """
    image = subject.values.get("image") if subject.values is not None else None
    if not isinstance(image, str) or not image:
        return
    name = PureWindowsPath(image).name
    if name != subject.facts.image:
        message = f"'image' names '{name}', expected '{subject.facts.image}'"
        is_same = (subject.shared_walls or 0) >= _ALIKE  # the same map by another name
        severity: Severity = "warning" if is_same else "error"
        yield Problem(subject.file, message, "image", subject.facts.image, name, severity=severity)


@rule("M04", "map-image-missing", scope="maps")
def map_image_missing(subject: MapSubject) -> Iterator[Problem]:
    """The image is not beside the map file.

    Why: map_server fails to configure and `ros2 lifecycle get /map_server` stays `unconfigured`.

    Fix: copy `{map_image}` into the folder of the map file. File names on Linux are case-sensitive.

    Example: `image: {map_image}` beside a file `{map_image}.png`.
    """
    missing = bool(subject.image_file) and not subject.image_exists
    # Another name is M03's to say.
    if missing and PurePosixPath(subject.image_file).name == subject.facts.image:
        yield Problem(subject.image_file, "map image does not exist")


@rule("M05", "map-image-unreadable", scope="maps")
def map_image_unreadable(subject: MapSubject) -> Iterator[Problem]:
    """The map image is not a readable PGM file.

    Why: map_server refuses a damaged or truncated image, and there is no map. It detects the format
    from the content: a PNG or a PPM with the name of a PGM is loaded, and is a warning.

    Fix: copy the supplied `{map_image}` again. A renamed PNG is still a PNG.

    Example: an image of 28,674 cells of which the last thousand are missing.
    """
    if subject.image_fault is not None:
        yield Problem(subject.image_file, f"map image {subject.image_fault}")
    elif subject.image_format:
        ending = PurePosixPath(subject.image_file).suffix
        message = (
            f"map image is a {subject.image_format} that ends in '{ending}'; map_server loads it"
        )
        yield Problem(subject.image_file, message, severity="warning")


@rule("M06", "map-value", scope="maps")
def map_value(subject: MapSubject) -> Iterator[Problem]:
    """A value of the map file is wrong.

    Why: the resolution scales all walls, `negate` exchanges free and occupied, and the thresholds
    decide which grey is a wall. AMCL then matches the scan with the wrong places.

    Fix: restore the supplied values in the YAML file. The handout says not to change them.

    Example: `resolution: 0.5` instead of `0.05`.
    """
    if subject.values is None:
        return
    for name, read in READ.items():
        expected = getattr(subject.facts, name)
        actual = subject.values.get(name, _DEFAULTS.get(name))
        value = read(actual)
        if is_equal(value, expected):
            continue
        given = name in subject.values or actual is not None
        fault = f"is {shortened(actual)}" if given else "is missing"
        message = f"'{name}' {fault}, expected {expected}"
        message += f"; {REFUSED}" if value is None else ""
        actual_said = shortened(actual) if given else None
        yield Problem(subject.file, message, name, str(expected), actual_said)


@rule("M07", "map-origin", scope="maps")
def map_origin(subject: MapSubject) -> Iterator[Problem]:
    """The map has another origin.

    Why: the whole map is shifted or turned relative to the scene. The scan is beside the walls,
    wherever the initial pose is set.

    Fix: write the supplied `origin`. Set the initial pose in RViz instead of moving the map.

    Example: `origin: [0, 0, 0]`.
    """
    if subject.values is None:
        return
    expected = subject.facts.origin
    actual = subject.values.get("origin")
    values = [number_in_yaml(number) for number in actual] if isinstance(actual, list) else []
    if is_equal(values, expected):
        return
    actual_text = shortened(actual)
    message = f"'origin' is {actual_text}, expected {_numbers(expected)}"
    message += f"; {REFUSED}" if len(values) != len(expected) or None in values else ""
    yield Problem(subject.file, message, "origin", _numbers(expected), actual_text)


@rule("M08", "map-size", scope="maps")
def map_size(subject: MapSubject) -> Iterator[Problem]:
    """The map image is not 177 x 162 cells.

    Why: it is another map, or it was cropped or scaled. Rows and columns no longer match resolution
    and origin.

    Fix: copy the supplied `{map_image}` again.

    Example: an image of 384 x 384 cells, the map of another world.
    """
    wanted = (subject.facts.width, subject.facts.height)
    if subject.size is not None and subject.size != wanted:
        actual, expected = (f"{width} x {height}" for width, height in (subject.size, wanted))
        message = f"map image has {actual} cells, expected {expected}"
        yield Problem(subject.image_file, message, None, expected, actual)


@rule("M09", "map-agreement", scope="maps", severity="note")
def map_agreement(subject: MapSubject) -> Iterator[Problem]:
    """The map was compared with the walls of the stage.

    Why: a low figure may mean that the map belongs to another scene, and that AMCL cannot find the
    robot. The handout does not say where in the scene the origin of the map is, so this figure is
    only a note.

    Fix: nothing, if the scan overlaps the walls in RViz. Otherwise compare map and scene.

    Example: 93 % with the origin at the world's, 41 % at the robot's start.
    """
    if not subject.agreements:
        return
    closest = max(subject.agreements, key=lambda agreement: agreement.figure)
    figures = ", ".join(
        f"{agreement.figure:.0%} {agreement.about}" for agreement in subject.agreements
    )
    yield Problem(
        subject.file,
        f"walls of the map and the stage agree to {figures}",
        actual=f"{closest.figure:.3f}",
    )


@rule("M10", "map-not-given", scope="maps", severity="note")
def map_not_given(subject: MapSubject) -> Iterator[Problem]:
    """A stage is checked without its map.

    Why: the map is part of these checkpoints, but is a file beside the stage.

    Fix: check the whole submission folder, or name the folder of the map with `--maps`.

    Example: `lab3 check {map_stage}`.
    """
    if subject.replaced:
        message = "map was not submitted; the grader's map replaces it"
        yield Problem(subject.file, message, severity="warning")
    elif not subject.given:
        yield Problem(subject.file, "map is not given, so not checked")


@rule("M11", "map-differs", scope="maps")
def map_differs(subject: MapSubject) -> Iterator[Problem]:
    """The map has other walls than the grader's.

    Why: the scan lies beside the walls of another map, and AMCL is lost. Below 90 % in common it is
    an error, else a warning; 100 % is a note.

    Fix: copy the supplied `{map}` and `{map_image}` into `{maps}/` again.

    Example: `lab3 grade --maps`, and a map of another room: 12 %.
    """
    if subject.shared_walls is None:
        return
    is_other, is_same = subject.shared_walls < _ALIKE, subject.shared_walls == 1
    yield Problem(
        subject.image_file,
        f"map has {subject.shared_walls:.0%} of its walls in common with the grader's map",
        expected=f"at least {_ALIKE:.0%}",
        actual=f"{subject.shared_walls:.3f}",
        severity="error" if is_other else "note" if is_same else "warning",
    )


def _numbers(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"
