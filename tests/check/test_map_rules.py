"""Rules about map files: each with a case that it finds and one that it leaves alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from golden import assert_golden, numbered, problems_text
from msgspec.structs import replace

from lab3_usd.check.registry import rules_of
from lab3_usd.deliverables.maps import find_map, map_subject
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder import Agreement, MapSubject
from lab3_usd.spec.load.loader import load_lab

FACTS = load_lab().scene.map
RULES = {found.id: found for found in rules_of("maps", "M")}
GOOD = """\
image: turtlebot3_map.pgm
mode: trinary
resolution: 0.05
origin: [-6.2, -3.32, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


def image(width: int = 177, height: int = 162, *, missing: int = 0) -> bytes:
    return b"P5\n%d %d\n255\n" % (width, height) + b"\xfe" * (width * height - missing)


def given(folder: Path, text: str = GOOD, data: bytes | None = None) -> MapSubject:
    """A submission whose folder `maps` holds the text and the image."""
    maps = folder / "maps"
    maps.mkdir()
    (maps / FACTS.yaml).write_text(text)
    (maps / FACTS.image).write_bytes(image() if data is None else data)
    return map_subject(maps / FACTS.yaml, FACTS, root=folder)


def problems(subject: MapSubject) -> dict[str, list[Problem]]:
    found = {rule_id: list(each.check(subject)) for rule_id, each in RULES.items()}
    return {rule_id: each for rule_id, each in found.items() if each}


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        changed("mode: trinary\n", ""),
        changed("0.05", "5.0e-2"),
        changed("0.05", "5e-2"),
        changed("-6.2", "-62e-1"),
        changed("turtlebot3_map.pgm", "./turtlebot3_map.pgm"),
        changed("turtlebot3_map.pgm", ".//./turtlebot3_map.pgm"),
        changed("[-6.2, -3.32, 0]", "[-6.200000, -3.320000, 0.000000]"),
        changed("turtlebot3_map.pgm", '"turtlebot3_map.pgm"'),
        "# my map\n\n" + GOOD.replace("\n", "   # as in 4.2\n") + "# author: ana\n",
        "\n".join(reversed(GOOD.splitlines())),
        "cost_lethal_threshold: 100\n" + GOOD,
        changed("trinary", "Trinary"),
        changed("trinary", "TRINARY"),
        GOOD.replace(": ", ":\t"),
        GOOD.replace("\n", "\t\n"),
        changed("[-6.2, -3.32, 0]", "[-6.2,\t-3.32,\t0]"),
        changed("negate: 0", "negate: false"),
        changed("negate: 0", "negate: 'no'"),
        changed("negate: 0", "negate: '0'"),
        changed("[-6.2, -3.32, 0]", "['-6.2', '-3.32', '0']"),
    ],
)
def test_a_correct_map_has_no_problem(tmp_path: Path, text: str) -> None:
    assert problems(given(tmp_path, text)) == {}


FAULTS = [
    ("M01", "image: [turtlebot3_map.pgm\n", None),
    ("M01", "no map at all\n", None),
    ("M01", "[" * 100_000, None),
    ("M02", changed("turtlebot3_map.pgm", "/home/ana/maps/turtlebot3_map.pgm"), "image"),
    ("M02", changed("turtlebot3_map.pgm", "C:\\maps\\turtlebot3_map.pgm"), "image"),
    ("M02", changed("turtlebot3_map.pgm", "~/maps/turtlebot3_map.pgm"), "image"),
    ("M02", changed("turtlebot3_map.pgm", "../maps/turtlebot3_map.pgm"), "image"),
    ("M02", changed("image: turtlebot3_map.pgm\n", ""), "image"),
    ("M02", changed("turtlebot3_map.pgm", "7"), "image"),
    ("M02", changed("turtlebot3_map.pgm", "../../turtlebot3_map.pgm"), "image"),
    ("M02", changed("turtlebot3_map.pgm", "/elsewhere/turtlebot3_map.pgm"), "image"),
    ("M03", changed("turtlebot3_map.pgm", "m" * 300), "image"),
    ("M03", changed("turtlebot3_map.pgm", '"\\0"'), "image"),
    ("M06", changed("trinary", "scale"), "mode"),
    ("M06", changed("0.05", "0.5"), "resolution"),
    ("M06", changed("0.05", "5e-1"), "resolution"),
    ("M06", changed("negate: 0", "negate: 1"), "negate"),
    ("M06", changed("0.65", "0.6"), "occupied_thresh"),
    ("M06", changed("0.25", "0.196"), "free_thresh"),
    ("M06", changed("resolution: 0.05\n", ""), "resolution"),
    ("M06", changed("0.05", "five"), "resolution"),
    ("M06", changed("negate: 0", "negate: 0.0"), "negate"),
    ("M06", changed("negate: 0", "negate: '0.0'"), "negate"),
    ("M06", changed("negate: 0", "negate:"), "negate"),
    ("M06", changed("trinary", "tri"), "mode"),
    ("M06", changed("trinary", "[trinary]"), "mode"),
    ("M06", changed("0.05", "true"), "resolution"),
    ("M01", "\t" + GOOD, None),
    ("M07", changed(", 0]", ", false]"), "origin"),
    ("M07", changed("[-6.2, -3.32, 0]", "[-6.2, -3.32, 0, 0]"), "origin"),
    ("M07", changed("-6.2", "0.0"), "origin"),
    ("M07", changed(", 0]", ", 1.57]"), "origin"),
    ("M07", changed("[-6.2, -3.32, 0]", "[-6.2, -3.32]"), "origin"),
    ("M07", changed("origin: [-6.2, -3.32, 0]\n", ""), "origin"),
]


NAMES = list(numbered(rule_id for rule_id, _, _ in FAULTS))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[Problem]]]:
    """What is said of each fault."""
    root, said = tmp_path_factory.mktemp("faults"), {}
    for name, (_, content, _) in zip(NAMES, FAULTS, strict=True):
        folder = root / name
        folder.mkdir()
        said[name] = problems(given(folder, content))
    return said


def test_what_is_said_of_each_fault_is_as_it_was(
    found: dict[str, dict[str, list[Problem]]],
) -> None:
    shown = {name: problems_text(problems, load_lab()) for name, problems in found.items()}
    assert_golden("map-faults", shown)


def test_a_fault_in_the_file_gives_its_finding_and_no_other(
    found: dict[str, dict[str, list[Problem]]],
) -> None:
    for name, (rule_id, _, site) in zip(NAMES, FAULTS, strict=True):
        assert list(found[name]) == [rule_id], name
        (problem,) = found[name][rule_id]
        assert (problem.prim, problem.property) == (f"maps/{FACTS.yaml}", site), name
        assert load_lab().handout.rules[rule_id]


REFUSED = "map_server cannot load it"


@pytest.mark.parametrize(
    ("text", "refused"),
    [
        (changed("negate: 0", "negate: 0.0"), True),
        (changed("negate: 0", "negate: 1"), False),
        (changed("negate: 0", "negate: true"), False),
        (changed("trinary", "scale"), False),
        (changed("trinary", "tri"), True),
        (changed("0.05", "0.5"), False),
        (changed("0.05", "'0.5'"), False),
        (changed("0.05", "five"), True),
        (changed("resolution: 0.05\n", ""), True),
        (changed("-6.2", "0"), False),
        (changed("-6.2", "west"), True),
        (changed("[-6.2, -3.32, 0]", "0"), True),
        (changed("[-6.2, -3.32, 0]", "[-6.2, -3.32]"), True),
    ],
)
def test_what_map_server_refuses_is_said_and_nothing_else(
    tmp_path: Path, text: str, *, refused: bool
) -> None:
    """As nav2_map_server's map_io.cpp of Humble did with each of these files."""
    ((problem,),) = problems(given(tmp_path, text)).values()
    assert (REFUSED in problem.message) is refused


def png(width: int = 177, height: int = 162, *, end: bytes = b"IEND") -> bytes:
    sizes = width.to_bytes(4, "big") + height.to_bytes(4, "big") + b"\x08\0\0\0\0"
    chunks = ((b"IHDR", sizes), (b"IDAT", b"cells"), (end, b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        len(data).to_bytes(4, "big") + name + data + b"\0\0\0\0" for name, data in chunks
    )


CELLS = 177 * 162


@pytest.mark.parametrize(
    ("data", "name"),
    [
        (png(), "PNG"),
        (b"P6\n177 162\n255\n" + b"\xfe" * (3 * CELLS), "PPM"),
        (b"P6\n177 162\n65535\n" + b"\xfe" * (6 * CELLS), "PPM"),
        (b"P3\n# mine\n177 162\n255\n" + b"254 " * (3 * CELLS), "PPM"),
        (b"P4\n177 162\n" + b"\0" * (23 * 162), "PBM"),
        (b"P1\n177 162\n" + b"0" * CELLS, "PBM"),
    ],
)
def test_another_image_under_the_name_of_a_pgm_is_a_warning(
    tmp_path: Path, data: bytes, name: str
) -> None:
    found = problems(given(tmp_path, data=data))
    assert list(found) == ["M05"]
    (problem,) = found["M05"]
    assert problem.severity == "warning"
    assert name in problem.message
    assert REFUSED not in problem.message


def test_another_image_has_a_size_too(tmp_path: Path) -> None:
    assert set(problems(given(tmp_path, data=png(384, 384)))) == {"M05", "M08"}


def test_an_image_whose_ending_tells_what_it_is_is_only_another_one(tmp_path: Path) -> None:
    (tmp_path / FACTS.yaml).write_text(changed("turtlebot3_map.pgm", "turtlebot3_map.png"))
    (tmp_path / "turtlebot3_map.png").write_bytes(png())
    assert list(problems(map_subject(tmp_path / FACTS.yaml, FACTS))) == ["M03"]


@pytest.mark.parametrize(
    "data",
    [
        png(end=b"tEXt"),
        png()[:-20],
        b"P6\n177 162\n255\n" + b"\xfe" * (2 * CELLS),
        b"P6\n0 162\n255\n",
        b"P3\n177 162\n255\n" + b"254 " * CELLS,
        b"P4\n177 162\n",
        b"P1\n177 162\n0 1",
        b"no image at all",
    ],
)
def test_an_image_that_is_not_whole_is_an_error(tmp_path: Path, data: bytes) -> None:
    (problem,) = problems(given(tmp_path, data=data))["M05"]
    assert problem.severity is None
    assert REFUSED in problem.message


def test_a_missing_file_is_found(tmp_path: Path) -> None:
    assert list(problems(map_subject(tmp_path / FACTS.yaml, FACTS))) == ["M01"]


def test_another_image_is_found(tmp_path: Path) -> None:
    subject = given(tmp_path, changed("turtlebot3_map.pgm", "my_map.pgm"))
    assert list(problems(subject)) == ["M03"]


def test_another_image_that_exists_is_found_once(tmp_path: Path) -> None:
    (tmp_path / FACTS.yaml).write_text(changed("turtlebot3_map.pgm", "my_map.pgm"))
    (tmp_path / "my_map.pgm").write_bytes(image())
    (problem,) = problems(map_subject(tmp_path / FACTS.yaml, FACTS))["M03"]
    assert (problem.expected, problem.actual) == (FACTS.image, "my_map.pgm")


def test_a_missing_image_is_found(tmp_path: Path) -> None:
    (tmp_path / FACTS.yaml).write_text(GOOD)
    found = problems(map_subject(tmp_path / FACTS.yaml, FACTS))
    assert {rule_id: [p.prim for p in each] for rule_id, each in found.items()} == {
        "M04": [FACTS.image]
    }


@pytest.mark.parametrize("data", [b"\x89PNG\r\n", image(missing=900), b""])
def test_an_image_that_cannot_be_read_is_found(tmp_path: Path, data: bytes) -> None:
    found = problems(given(tmp_path, data=data))
    assert [p.prim for p in found["M05"]] == [f"maps/{FACTS.image}"]
    assert list(found) == ["M05"]


@pytest.mark.parametrize("size", [(384, 384), (177, 161), (162, 177)])
def test_an_image_of_another_size_is_found(tmp_path: Path, size: tuple[int, int]) -> None:
    found = problems(given(tmp_path, data=image(*size)))
    actual = f"{size[0]} x {size[1]}"
    assert [(p.expected, p.actual) for p in found["M08"]] == [("177 x 162", actual)]
    assert list(found) == ["M08"]


def test_a_text_image_is_as_good(tmp_path: Path) -> None:
    data = b"P2\n# drawn by hand\n177 162\n255\n" + b"254\n" * (177 * 162)
    assert problems(given(tmp_path, data=data)) == {}


def test_agreement_with_the_walls_is_a_figure_and_no_fault(tmp_path: Path) -> None:
    guesses = (Agreement(0.93, "from the world's origin"), Agreement(0.41, "from the start"))
    (tmp_path / FACTS.yaml).write_text(GOOD)
    (tmp_path / FACTS.image).write_bytes(image())
    subject = replace(map_subject(tmp_path / FACTS.yaml, FACTS), agreements=guesses)
    found = problems(subject)
    assert [p.actual for p in found["M09"]] == ["0.930"]
    assert list(found) == ["M09"]
    assert RULES["M09"].severity == "note"


def test_a_stage_alone_gets_one_note() -> None:
    found = problems(map_subject(None, FACTS))
    assert list(found) == ["M10"]
    assert RULES["M10"].severity == "note"


def test_the_map_is_found_by_its_name(tmp_path: Path) -> None:
    for name in (FACTS.yaml, "other.yaml"):
        (tmp_path / name).write_text(GOOD)
    assert find_map(tmp_path, FACTS).name == FACTS.yaml


def test_an_only_map_of_another_name_is_found(tmp_path: Path) -> None:
    (tmp_path / "map.yml").write_text(GOOD)
    assert find_map(tmp_path, FACTS).name == "map.yml"


def test_no_map_is_looked_for_under_its_name(tmp_path: Path) -> None:
    assert find_map(tmp_path, FACTS) == tmp_path / FACTS.yaml


def test_a_map_outside_the_submission_keeps_its_path(tmp_path: Path) -> None:
    path = tmp_path / FACTS.yaml
    assert map_subject(path, FACTS, root=tmp_path / "work").file == path.as_posix()


def test_the_bundled_map_has_no_problem(repository: Path) -> None:
    if not (repository / "maps" / FACTS.yaml).is_file():
        pytest.skip("the bundled map has not been made yet")
    subject = map_subject(repository / "maps" / FACTS.yaml, FACTS)
    assert problems(subject) == {}
