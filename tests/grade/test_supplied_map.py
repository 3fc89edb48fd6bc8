"""`--maps`: the map that a class was given, held against those handed in, and in place of none."""

from __future__ import annotations

import csv
import json
import shutil
from functools import cache
from pathlib import Path

import pytest
import quick_yaml
from html_pages import read
from other_labs import MINI, files_below, starter, submission
from workers_here import graded_here

from lab3_usd.data import data_folder
from lab3_usd.deliverables.maps import MapError, supplied_map
from lab3_usd.grade.class_run import ClassSettings, salt_of
from lab3_usd.grade.intake.submission_copy import Limits
from lab3_usd.grade.rubric import load_rubric
from lab3_usd.grade.workers.worker_messages import PoolSettings, Start, decoded_message, encode
from lab3_usd.spec.load.loader import load_lab

MAP, IMAGE = "turtlebot3_map.yaml", "turtlebot3_map.pgm"
STUDENTS = ("other", "none", "renamed", "same", "touched", "early")


@cache
def rubric_with_points_for_the_map() -> str:
    rubric = quick_yaml.load((MINI / "rubric.yaml").read_text(encoding="utf-8"))
    rubric["items"]["nav2"] |= {"files": ["M"], "breaks": ["M01", "M02", "M03", "M11"]}
    return quick_yaml.dump(rubric)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A class whose maps are right, renamed, touched, of another room, or not there."""
    place = tmp_path_factory.mktemp("maps")
    shutil.copytree(data_folder("maps"), place / "maps")
    for name in STUDENTS:
        folder = submission(place / "class" / name, *(["01"] if name == "early" else []))
        if name not in {"none", "early"}:
            shutil.copytree(place / "maps", folder / "maps")
    put_image(place / "class" / "other", lambda cells: cells[::-1])
    put_image(place / "class" / "touched", lambda cells: bytes(12) + cells[12:])
    renamed = place / "class" / "renamed" / "maps"
    (renamed / IMAGE).rename(renamed / "map.pgm")
    text = (renamed / MAP).read_text(encoding="utf-8")
    (renamed / MAP).unlink()
    (renamed / "map.yaml").write_text(text.replace(IMAGE, "map.pgm"), encoding="utf-8")
    graded_here(settings(place, "book", maps=place / "maps"))
    return place


def put_image(student: Path, change: object) -> None:
    path = student / "maps" / IMAGE
    data = path.read_bytes()
    head = data.index(b"255\n") + 4
    path.write_bytes(data[:head] + change(data[head:]))  # type: ignore[operator]


def settings(place: Path, book: str, **more: object) -> ClassSettings:
    rubric = place / "rubric.yaml"
    rubric.write_text(rubric_with_points_for_the_map(), encoding="utf-8")
    return ClassSettings(place / "class", starter(), place / book, rubric, **more)  # type: ignore[arg-type]


def rows(book: Path) -> dict[str, dict[str, str]]:
    with (book / "grades.csv").open(encoding="utf-8", newline="") as table:
        return {row["student"]: row for row in csv.DictReader(table)}


def test_the_table_says_of_each_map_how_far_it_is_the_supplied_one(place: Path) -> None:
    graded = rows(place / "book")
    remarks = {name: row["remarks"].partition(";")[0] for name, row in graded.items()}
    share = "of its walls in common with the grader's map"
    assert remarks["same"] == ""
    assert remarks["touched"] == f"maps/{IMAGE}: map has 99% {share}"
    assert remarks["other"] == f"maps/{IMAGE}: map has 22% {share}"
    assert remarks["none"].startswith(f"{MAP}: map was not submitted")
    assert "map" not in remarks["early"]


def test_a_map_of_another_room_takes_points_and_a_missing_one_does_not(place: Path) -> None:
    points = {name: row["nav2"] for name, row in rows(place / "book").items()}
    whole = dict.fromkeys(("none", "renamed", "same", "touched"), "5.00")
    assert {name: points[name] for name in STUDENTS if name != "early"} == {
        "other": "0.00",
        **whole,
    }


def test_without_the_supplied_map_a_missing_one_takes_points(place: Path) -> None:
    graded_here(settings(place, "without"))
    graded = rows(place / "without")
    assert {name for name in STUDENTS if graded[name]["nav2"] != "5.00"} == {
        "none",
        "early",
        "renamed",  # whether it is the same map, only the supplied one tells
    }
    assert "map" not in graded["other"]["remarks"]


def test_a_gradebook_that_is_continued_keeps_its_map(place: Path, tmp_path: Path) -> None:
    book = tmp_path / "book"
    shutil.copytree(place / "book", book)
    before = files_below(book)
    graded_here(settings(place, str(book), resume=True))
    assert files_below(book) == before


def test_a_kept_map_that_somebody_broke_is_refused(place: Path, tmp_path: Path) -> None:
    (tmp_path / "supplied-map.json").write_text("{}")
    with pytest.raises(
        MapError, match=r"supplied-map\.json: is no map that a gradebook keeps; give"
    ):
        graded_here(settings(place, str(tmp_path), resume=True))


def test_report_and_page_show_the_comparison(place: Path) -> None:
    for shown in (place / "book" / "index.html", place / "book/students/other/report.html"):
        assert "22% of its walls in common" in read(shown.read_text(encoding="utf-8")).text
    report = json.loads((place / "book/students/same/report.json").read_bytes())
    (note,) = [found for found in report["submissions"][0]["findings"] if found["rule"] == "M11"]
    assert (note["severity"], note["actual"]) == ("note", "1.000")


def test_results_are_not_kept_when_another_map_is_supplied(place: Path) -> None:
    rubric = load_rubric(None, load_lab())
    maps = (None, place / "maps", place / "class" / "other" / "maps")
    given = [path and supplied_map(path) for path in maps]
    assert len({salt_of(rubric, starter(), {}, each) for each in given}) == 3


def test_the_supplied_map_tells_what_values_and_names_are_right(tmp_path: Path) -> None:
    """A course whose map has another name, size and origin than the handout's."""
    own = tmp_path / "own"
    own.mkdir()
    (own / "room.pgm").write_bytes(b"P5\n3 2\n255\n" + bytes([0, 254, 254] * 2))
    (own / "room.yaml").write_text(
        "image: room.pgm\nresolution: 0.1\norigin: [1, 2, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    shutil.copytree(own, submission(tmp_path / "class" / "jane") / "maps")
    graded_here(settings(tmp_path, "book", maps=own / "room.yaml"))
    assert rows(tmp_path / "book")["jane"]["nav2"] == "5.00"


def test_what_is_no_map_is_named_before_anything_is_graded(place: Path, tmp_path: Path) -> None:
    with pytest.raises(MapError, match="nowhere: there is no such file"):
        graded_here(settings(place, "unwritten", maps=tmp_path / "nowhere"))
    assert not (place / "unwritten").exists()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("mode: trinary\n", "names no image"),
        (f"image: {IMAGE}\nresolution: wide\n", "Expected `float`.*resolution"),
        (f"image: {IMAGE}\nresolution: 0.05\n", "origin"),
        ("image: gone.pgm\n", "gone.pgm cannot be read"),
    ],
)
def test_a_supplied_map_that_map_server_would_not_load_is_refused(
    tmp_path: Path, text: str, fault: str
) -> None:
    shutil.copyfile(data_folder("maps") / IMAGE, tmp_path / IMAGE)
    (tmp_path / MAP).write_text(text, encoding="utf-8")
    with pytest.raises(MapError, match=fault):
        supplied_map(tmp_path)


def test_workers_on_other_machines_receive_the_map_itself(tmp_path: Path) -> None:
    given = supplied_map(data_folder("maps"))
    start = Start(tmp_path, PoolSettings(None, None, Limits(), supplied_map=given))
    assert decoded_message(encode(start), Start).settings.supplied_map == given
