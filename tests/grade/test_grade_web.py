"""Submissions on a web server: the same gradebook as from the folder, and faults of the server."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from http import HTTPStatus
from importlib.util import find_spec
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from in_process import lab3
from msgspec.structs import replace
from other_labs import cut_wire, files_below, stage, starter, submission
from web_server import WebServer, served
from workers_here import graded_here, workers_here

from lab3_usd.errors import UsageError
from lab3_usd.grade.class_run import ClassSettings, grade_class
from lab3_usd.grade.gradebook import Rows
from lab3_usd.grade.intake.submissions import find_submissions, submissions_in

pytestmark = [
    pytest.mark.usefixtures("equal_judged_once"),
    *(
        pytest.mark.skipif(find_spec(name) is None, reason=f"{name} is not installed")
        for name in ("fsspec", "aiohttp")  # to import them takes a while, in each worker
    ),
]
STAGE = stage("00").name
PASSWORD = "s3cret@/:"  # noqa: S105 - of a server on this computer
IN_ADDRESS = "s3cret%40%2F%3A"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A class in all forms: folders with names of all kinds, archives, a lone stage."""
    folder = tmp_path / "served" / "class"
    submission(folder / "Jané, Döe & 100% #1_1234567_assignsubmission_file", "00", "01")
    cut_wire(submission(folder / "ben", "00", "01") / "work" / stage("01").name)
    (folder / "ben" / ".git").mkdir()
    (folder / "ben" / ".git" / "config").write_text("x")
    (folder / "ben" / "demo.mp4").write_bytes(bytes(100))
    packed = submission(tmp_path / "packed", "00")
    shutil.make_archive(str(folder / "carl"), "zip", packed)
    shutil.copy(stage("00"), folder / f"dora_{STAGE}")
    (folder / "eve").mkdir()
    return folder


@pytest.fixture
def server(place: Path) -> Iterator[WebServer]:
    with served(place.parent) as running:
        yield running


def graded(place: Path | str, out: Path) -> Rows:
    return graded_here(ClassSettings(place, starter(), out))


def lab3_grade(place: str, out: Path) -> CompletedProcess[str]:
    with workers_here():
        return lab3("grade", place, "--starter", starter(), "--output", out)


@pytest.mark.parametrize("end", ["", "/"])
def test_a_folder_of_a_web_server_gives_the_same_gradebook(
    place: Path, server: WebServer, tmp_path: Path, end: str
) -> None:
    graded(place, tmp_path / "alone")
    graded(f"{server.address}/class{end}", tmp_path / "book")
    assert files_below(tmp_path / "book") == files_below(tmp_path / "alone")


def test_the_archive_of_a_class_on_a_web_server_gives_the_same_gradebook(
    place: Path, server: WebServer, tmp_path: Path
) -> None:
    shutil.make_archive(str(place.parent / "all"), "zip", place)
    graded(place.parent / "all.zip", tmp_path / "alone")
    graded(f"{server.address}/all.zip?X-Signature=abc", tmp_path / "book")
    assert files_below(tmp_path / "book") == files_below(tmp_path / "alone")


def test_one_submission_on_a_web_server_is_graded(
    place: Path, server: WebServer, tmp_path: Path
) -> None:
    (row,) = graded(f"{server.address}/class/ben", tmp_path / "book")
    (alone,) = graded(place / "ben", tmp_path / "alone")
    assert row == alone


def test_links_of_a_page_that_lead_elsewhere_are_no_entries(
    place: Path, server: WebServer, tmp_path: Path
) -> None:
    (place / "index.html").write_text(
        '<a href="../">Up</a> <a href="/">Home</a> <a href="?C=N;O=D">Name</a>'
        '<a href="#top">Top</a> <a href="mailto:ta@uni.edu">TA</a>'
        f'<a href="{server.address}/other/x.zip">x</a>'
        '<a href="ben/work/">deep</a> <a href="./">here</a> <a href="ben/">ben</a>'
    )
    del tmp_path
    with submissions_in(f"{server.address}/class") as location:
        assert [found.student for found in find_submissions(location)] == ["ben"]


def test_what_is_not_read_is_not_downloaded(server: WebServer, tmp_path: Path) -> None:
    asked = server.asked
    graded(f"{server.address}/class", tmp_path / "book")
    assert not [path for path in asked if ".git/config" in path]
    assert len([path for path in asked if "demo.mp4" in path]) == 1  # how large it is


def test_a_password_in_an_address_opens_the_server_and_is_never_printed(
    server: WebServer, tmp_path: Path
) -> None:
    server.password = PASSWORD
    host = server.address.removeprefix("http://")
    (tmp_path / "served" / "class" / "notes.txt").write_text("of no student")
    right = lab3_grade(f"http://user:{IN_ADDRESS}@{host}/class", tmp_path / "book")
    assert (right.returncode, right.stdout.partition(" ")[0]) == (0, "5")
    assert "ignored, since they belong to no student: notes.txt" in right.stderr
    for address in (
        f"http://user:{IN_ADDRESS}wrong@{host}/class",
        f"http://user:{IN_ADDRESS}wrong@{host}/all.zip",
        f"http://user:{IN_ADDRESS}@{host}/nothing-here",
        f"http://user:{IN_ADDRESS}@127.0.0.1:1/class",
        f"nonsense://user:{IN_ADDRESS}@{host}/class",
        f"nonsense://user:{PASSWORD}@{host}/class",
        f"{server.address}/class?token=s3cret&x=y",
        "https://127.0.0.1:1/all.zip?token=s3cret",
    ):
        wrong = lab3_grade(address, tmp_path / "other")
        assert (wrong.returncode, wrong.stdout) == (2, "")
        assert len(wrong.stderr.splitlines()) == 1
        assert "s3cret" not in wrong.stderr
    assert "s3cret" not in right.stdout + right.stderr
    assert not [name for name, data in files_below(tmp_path / "book").items() if b"s3cret" in data]


def test_the_reason_of_a_web_server_is_said(server: WebServer) -> None:
    server.password = PASSWORD
    for address, reason in (
        (f"{server.address}/class", "401 Unauthorized"),
        (f"{server.address}/all.zip", "401 Unauthorized"),
        ("http://127.0.0.1:1/class", "Connection refused"),
    ):
        with (
            pytest.raises(UsageError, match=f"{address}: cannot be .* \\({reason}\\)"),
            submissions_in(address) as location,
        ):
            find_submissions(location)


@pytest.mark.parametrize("fault", ["short", "gone", HTTPStatus.INTERNAL_SERVER_ERROR])
@pytest.mark.parametrize("where", ["class/ben/work/", "carl.zip", STAGE])
def test_what_a_server_does_not_give_whole_is_no_grade(
    server: WebServer, tmp_path: Path, fault: str | HTTPStatus, where: str
) -> None:
    def faulty(path: str) -> str | HTTPStatus | None:
        return fault if path.endswith(where) else None

    server.fault = faulty
    rows = {row["student"]: row for row in graded(f"{server.address}/class", tmp_path / "book")}
    affected = {"class/ben/work/": {"ben"}, "carl.zip": {"carl"}}.get(where, {"ben", "dora"})
    assert affected <= {name for name, row in rows.items() if row["status"] == "tool failed"}
    for name in affected:
        assert rows[name]["reason"].startswith(f"tool failed: {name}")


@pytest.mark.parametrize("fault", ["half", "page"])
@pytest.mark.parametrize("where", ["carl.zip", STAGE, "all.zip"])
def test_what_a_server_gives_in_place_of_a_file_is_no_grade(
    place: Path, server: WebServer, tmp_path: Path, fault: str, where: str
) -> None:
    server.fault = lambda path: fault if path.endswith(where) else None
    if where == "all.zip":
        shutil.make_archive(str(place.parent / "all"), "zip", place)
        with pytest.raises(UsageError, match=r"download ended|web page in its place"):
            graded(f"{server.address}/all.zip", tmp_path / "book")
        return
    rows = {row["student"]: row for row in graded(f"{server.address}/class", tmp_path / "book")}
    for name in {"carl.zip": ["carl"]}.get(where, ["ben", "dora"]):
        assert rows[name]["status"] == "tool failed"
        assert ("download ended" if fault == "half" else "a web page") in rows[name]["reason"]


@pytest.mark.parametrize("fault", ["page", "form"])
def test_a_login_in_place_of_a_folder_is_no_empty_submission(
    server: WebServer, tmp_path: Path, fault: str
) -> None:
    server.fault = lambda path: fault if path.endswith("/ben/") else None
    rows = {row["student"]: row for row in graded(f"{server.address}/class", tmp_path / "book")}
    assert rows["ben"]["status"] == "tool failed"
    assert "in place of the list of its files" in rows["ben"]["reason"]
    assert rows["eve"]["status"] == "empty"  # its listing names nothing


def test_a_login_in_place_of_the_class_is_said(server: WebServer, tmp_path: Path) -> None:
    server.fault = lambda _path: "form"
    with pytest.raises(UsageError, match="as where one has to log in"):
        graded(f"{server.address}/class", tmp_path / "book")


def test_a_name_with_a_null_byte_costs_nobody_else_a_grade(
    place: Path, server: WebServer, tmp_path: Path
) -> None:
    (place / "index.html").write_text('<a href="ben/">ben</a> <a href="z%00.zip">z</a>')
    (place / "ben" / "index.html").write_text(
        '<a href="work/">work</a> <a href="a%00.usda">a</a> <a href="b%00/">b</a>'
    )
    rows = {row["student"]: row for row in graded(f"{server.address}/class", tmp_path / "book")}
    assert rows["ben"]["status"] == "graded"
    assert "do not print" in rows["z\0"]["reason"]
    assert len(rows) == 2


def test_a_server_that_dies_half_way_takes_no_points_and_the_run_goes_on_later(
    place: Path, server: WebServer, tmp_path: Path
) -> None:
    graded(place, tmp_path / "alone")

    def die(done: int, _total: int) -> None:
        if done == 2:
            server.fault = lambda _path: "gone"

    settings = ClassSettings(f"{server.address}/class", starter(), tmp_path / "book")
    with workers_here():
        rows = list(grade_class(settings, die))
        assert {row["status"] for row in rows} <= {"graded", "empty", "tool failed"}
        assert all("cannot be" in row["reason"] for row in rows if row["status"] == "tool failed")
        server.fault = lambda _path: None
        grade_class(replace(settings, resume=True))
    assert files_below(tmp_path / "book") == files_below(tmp_path / "alone")
