"""Submissions at an address: plain files come in, and what fails is one student's affair."""

from __future__ import annotations

import io
import json
import os
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest
from other_labs import files_below, stage, starter, submission
from workers_here import graded_here

from lab3_usd.errors import UsageError
from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.intake.addresses import is_address, public_place
from lab3_usd.grade.intake.remote import (
    entries_at,
    fetched,
    local_path,
)
from lab3_usd.grade.intake.staging import Source
from lab3_usd.grade.intake.submission_copy import Limits, TooLargeError, UnreachedError
from lab3_usd.grade.intake.submissions import StudentSubmission, find_submissions, submissions_in

pytestmark = pytest.mark.usefixtures("equal_judged_once")

fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed")
memory = pytest.importorskip("fsspec.implementations.memory")
STAGE = stage("00").name
RELEASE = threading.Event()
FAILED: set[str] = set()


class Faulty(memory.MemoryFileSystem):  # type: ignore[misc, name-defined]  # fsspec has no types
    """A storage in which names say what is wrong with a file."""

    protocol = "faulty"
    store: ClassVar[dict[str, Any]] = {}
    pseudo_dirs: ClassVar[list[str]] = [""]
    cachable = False
    find = fsspec.AbstractFileSystem.find

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        plain: str = super()._strip_protocol(path.replace("faulty://", "memory://"))
        return plain

    def ls(self, path: str, detail: bool = True, **options: Any) -> Any:  # noqa: FBT001, FBT002 - as fsspec has it
        found = super().ls(path, detail=True, **options)
        for each in [each for each in found if each["type"] == "file"]:
            if "pipe" in each["name"]:
                each["type"] = "other"
            if "link" in each["name"]:
                each["islink"] = True
            if "unsized" in each["name"]:
                each["size"] = None
            if "short" in each["name"]:
                each["size"] += 10
        return found if detail else [each["name"] for each in found]

    def info(self, path: str, **options: Any) -> Any:
        found = super().info(path, **options)
        return {**found, "size": None} if "unsized" in path else found

    def open(self, path: str, mode: str = "rb", **options: Any) -> Any:
        if "forbidden" in path:
            raise PermissionError(13, "Permission denied")
        if "broken" in path:
            raise RuntimeError(f"https://secret@host/{path}")
        if "flaky" in path and path not in FAILED:
            FAILED.add(path)
            raise ConnectionResetError(104, "Connection reset by peer")
        if "hanging" in path:
            RELEASE.wait(30)
        return super().open(path, mode, **options)


@pytest.fixture(autouse=True)
def _storage() -> Iterator[None]:
    fsspec.register_implementation("faulty", Faulty, clobber=True)
    for kind in ("memory", "faulty"):
        fsspec.filesystem(kind).store.clear()
        fsspec.filesystem(kind).pseudo_dirs[:] = [""]
    RELEASE.clear()
    FAILED.clear()
    yield
    RELEASE.set()


def put(files: dict[str, bytes], kind: str = "memory") -> str:
    """Put a class into a storage in memory, and return its address."""
    storage = fsspec.filesystem(kind)
    for name, data in files.items():
        path = f"/class/{name}"
        if name.endswith("/"):
            storage.makedirs(path.rstrip("/"), exist_ok=True)
        else:
            storage.makedirs(path.rpartition("/")[0], exist_ok=True)
            storage.store[path] = memory.MemoryFile(storage, path, data)
    return f"{kind}://class"


def graded(place: Path | str, out: Path, **changes: Any) -> dict[str, dict[str, Any]]:
    graded_here(ClassSettings(place, starter(), out, **changes))
    students = json.loads((out / "grades.json").read_text())["students"]
    return {row["student"]: row for row in students}


def got(address: str, target: Path, limits: Limits | None = None) -> Source:
    """What is fetched of one student."""
    name = address.rpartition("/")[2]
    (source,) = fetched((Source(Path(name), "", address),), target, limits or Limits())
    return source


def test_an_address_on_this_computer_is_a_path(tmp_path: Path) -> None:
    for address in (tmp_path.as_uri(), f"local://{tmp_path}"):
        assert local_path(address) == tmp_path
    assert local_path("memory://class") == "memory://class"


def test_addresses_are_told_from_paths() -> None:
    assert is_address("s3://course/lab3")
    assert not is_address("/course/lab3")
    assert not is_address("C:\\course")


@pytest.mark.parametrize(
    ("address", "printed"),
    [
        ("https://user:pa/ss@w:ord@host/class", "https://***@host/class"),
        ("ftp://user@host/class", "ftp://***@host/class"),
        ("simplecache::s3://KEY:SE/CRET@bucket/lab3", "simplecache::s3://***@bucket/lab3"),
        ("https://host/all.zip?sig=abc&x=1", "https://host/all.zip?***"),
        ("http://host:8000/jane@uni/a?.zip", "http://host:8000/jane@uni/a?.zip"),
        ("s3://course/lab3", "s3://course/lab3"),
    ],
)
def test_what_opens_a_storage_is_not_printed(address: str, printed: str) -> None:
    assert public_place(address) == printed


def test_a_path_is_printed_as_it_is() -> None:
    assert public_place(Path("a:b@c?d=e")) == "a:b@c?d=e"


@pytest.mark.parametrize("address", ["nonsense://course", "file:///no/such/folder"])
def test_an_address_that_cannot_be_listed_is_an_error(address: str) -> None:
    with pytest.raises(UsageError, match=address):
        entries_at(address)


def test_a_file_and_a_folder_are_fetched_and_a_task_at_hand_is_left_alone(tmp_path: Path) -> None:
    put({"a.zip": b"PK", "jane/work/a.usda": b"#usda 1.0"})
    sources = (
        Source(Path("a.zip"), "a.zip", "memory://class/a.zip"),
        Source(Path("jane"), "", "memory://class/jane"),
    )
    here = fetched(sources, tmp_path, Limits())
    assert [(source.path.name, source.name) for source in here] == [
        ("a.zip", "a.zip"),
        ("jane", ""),
    ]
    assert sorted(files_below(tmp_path).values()) == [b"#usda 1.0", b"PK"]
    at_hand = (Source(tmp_path),)
    assert fetched(at_hand, tmp_path, Limits()) == at_hand


def test_a_key_with_dots_is_not_written_outside(tmp_path: Path) -> None:
    put({"jane/../../../escaped.usda": b"x", "jane/good.usda": b"y"})
    target = tmp_path / "target"
    got("memory://class/jane", target)
    assert list(files_below(target).values()) == [b"y"]
    assert not list(tmp_path.rglob("escaped.usda"))


@pytest.mark.parametrize("limits", [Limits(files=1), Limits(total_size=3)])
def test_more_than_a_submission_may_hold_is_not_fetched(tmp_path: Path, limits: Limits) -> None:
    put({f"jane/{name}.usda": b"#usda" for name in ("a", "b")})
    with pytest.raises(TooLargeError):
        got("memory://class/jane", tmp_path, limits)
    assert files_below(tmp_path) == {}


def test_files_that_nobody_hands_in_are_neither_fetched_nor_counted(tmp_path: Path) -> None:
    put({f"jane/{name}": b"#usda" for name in ("work/a.usda", ".git/b", "__MACOSX/c")})
    got("memory://class/jane", tmp_path, Limits(files=1))
    assert [path.rpartition("/")[2] for path in files_below(tmp_path)] == ["a.usda"]


def test_a_link_at_an_address_on_this_computer_is_not_followed(tmp_path: Path) -> None:
    submission(tmp_path / "outside", "00")
    submission(tmp_path / "class" / "honest", "00")
    work = tmp_path / "class" / "cheat" / "work"
    work.mkdir(parents=True)
    (work / STAGE).symlink_to(tmp_path / "outside" / "work" / STAGE)
    (tmp_path / "class" / "thief").symlink_to(tmp_path / "outside")
    os.mkfifo(tmp_path / "class" / "pipe.zip")
    rows = graded((tmp_path / "class").as_uri(), tmp_path / "book")
    assert {name: row["status"] for name, row in rows.items()} == {
        "cheat": "empty",
        "honest": "graded",
        "pipe": "empty",
        "thief": "empty",
    }
    assert sum(row["earned"] for row in rows.values()) == rows["honest"]["earned"] > 0


def test_what_cannot_be_fetched_is_the_tools_failure_and_no_grade(tmp_path: Path) -> None:
    data = stage("00").read_bytes()
    address = put(
        {
            f"{name}/work/{STAGE}": data
            for name in ("ali", "broken", "forbidden", "jane", "link", "pipe")
        },
        "faulty",
    )
    rows = graded(address, tmp_path / "book")
    assert {name: row["status"] for name, row in rows.items()} == {
        "ali": "graded",
        "broken": "tool failed",
        "forbidden": "tool failed",
        "jane": "graded",
        "link": "empty",
        "pipe": "empty",
    }
    assert "Permission denied" in rows["forbidden"]["reason"]
    assert "secret" not in rows["broken"]["reason"]
    assert "not fetched" in rows["link"]["reason"]


def test_what_fails_for_a_moment_is_fetched_once_more(tmp_path: Path) -> None:
    address = put({f"flaky/work/{STAGE}": stage("00").read_bytes()}, "faulty")
    (row,) = graded(address, tmp_path / "book").values()
    assert row["status"] == "graded"
    assert FAILED


def test_a_storage_that_hangs_is_not_waited_for(tmp_path: Path) -> None:
    put({"hanging/a.usda": b"x"}, "faulty")
    with pytest.raises(UnreachedError, match=r"took longer than 0\.1 s"):
        got("faulty://class/hanging", tmp_path, Limits(seconds=1, all_times=0.1))


def test_a_download_that_is_shorter_than_listed_is_not_graded(tmp_path: Path) -> None:
    put({"jane/a.usda": b"x", "jane/short.usda": b"12345"}, "faulty")
    with pytest.raises(UnreachedError) as raised:
        got("faulty://class/jane", tmp_path)
    assert str(raised.value) == "jane: short.usda: the download ended after 5 of 15 bytes"


def test_the_reason_names_the_submission(tmp_path: Path) -> None:
    rows = graded(put({"jane/forbidden.usda": b"x"}, "faulty"), tmp_path / "book")
    assert rows["jane"]["reason"] == (
        "tool failed: jane: forbidden.usda: cannot be fetched (Permission denied)"
    )


def test_a_page_that_leads_to_itself_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def twice(_storage: Any, path: str, **_options: Any) -> Any:
        return [{"name": f"{path}/{name}", "type": "directory", "size": 0} for name in "ab"]

    put({"jane/a.usda": b"x"})
    monkeypatch.setattr(memory.MemoryFileSystem, "ls", twice)
    with pytest.raises(TooLargeError):
        got("memory://class/jane", tmp_path, Limits(files=100))


def test_a_file_that_grows_as_it_is_fetched_is_too_large(tmp_path: Path) -> None:
    address = put({"unsized/a.usda": bytes(3 << 20)}, "faulty")
    rows = graded(address, tmp_path / "book", limits=Limits(total_size=1 << 20))
    assert rows["unsized"]["status"] == "too large"


def test_what_nobody_opens_is_not_fetched_and_counts_by_its_name(tmp_path: Path) -> None:
    put({"jane/demo.mp4": bytes(9 << 20), "jane/big.usda": bytes(9000), "jane/a.usda": b"y"})
    source = got("memory://class/jane", tmp_path, Limits(file_size=5000, total_size=6000))
    found = files_below(source.path)
    assert found["a.usda"] == b"y"
    assert sorted(found) == ["a.usda", "big.usda", "demo.mp4"]
    assert len(found["big.usda"]) > 5000
    assert len(found["demo.mp4"]) == 8 << 20  # larger than a picture may be


def test_of_a_listing_files_are_fetched_and_no_folders(tmp_path: Path) -> None:
    put({"jane/a.usda": b"x", "jane/mark/": b"", "jane/folder/b.usda": b"y"})
    storage = fsspec.filesystem("memory")
    storage.store["/class/jane/mark/"] = memory.MemoryFile(storage, "/class/jane/mark/", b"")
    source = got("memory://class/jane", tmp_path)
    assert sorted(path.removeprefix("jane/") for path in files_below(source.path)) == [
        "a.usda",
        "folder/b.usda",
    ]
    assert source.left_out == ()


def test_a_file_that_no_place_is_left_for_costs_itself_alone(tmp_path: Path) -> None:
    put({"jane/a": b"x", "jane/b.usda": b"z"})
    storage = fsspec.filesystem("memory")
    storage.store["/class/jane/a/c.usda"] = memory.MemoryFile(storage, "/class/jane/a/c.usda", b"y")
    source = got("memory://class/jane", tmp_path)
    assert files_below(source.path)["b.usda"] == b"z"
    assert [file.path for file in source.left_out] == ["a/"]


def found_at(address: str) -> tuple[dict[str, StudentSubmission], list[str]]:
    said: list[str] = []
    with submissions_in(address) as place:
        return {
            find_submission.student: find_submission
            for find_submission in find_submissions(place, said.append)
        }, said


def test_names_of_an_export_at_an_address_are_read() -> None:
    metadata = b"submission_11:\n  :submitters:\n  - :name: Jane\n    :sid: '1001'\n"
    found, said = found_at(
        put({"submission_metadata.yml": metadata, "submission_11/work/a.usda": b"", "x.pdf": b""})
    )
    assert {name: each.name for name, each in found.items()} == {"1001": "Jane"}
    assert [line.rpartition(": ")[2] for line in said] == ["x.pdf"]


def test_names_that_cannot_be_read_at_an_address_are_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    put({"submission_metadata.yml": b"a: b", "submission_11/a.usda": b""})

    def refuse(*_arguments: Any, **_options: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(memory.MemoryFileSystem, "open", refuse)
    found, (line,) = found_at("memory://class")
    assert list(found) == ["submission_11"]
    assert "Permission denied" in line


def test_the_folder_of_one_student_at_an_address_has_the_students_name() -> None:
    put({f"jane/work/{STAGE}": b""})
    assert list(found_at("memory://class/jane")[0]) == ["jane"]


def test_an_empty_folder_at_an_address_is_empty(tmp_path: Path) -> None:
    rows = graded(put({"ali/": b"", f"jane/work/{STAGE}": b"x"}), tmp_path / "book")
    assert (rows["ali"]["status"], rows["jane"]["status"]) == ("empty", "graded")


def test_the_archive_of_a_class_at_an_address_is_unpacked() -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as packed:
        for name in ("ali", "jane"):
            packed.writestr(f"{name}/work/a.usda", b"")
    put({"all.zip": data.getvalue(), "notes.txt": b""})
    assert list(found_at("memory://class/all.zip")[0]) == ["ali", "jane"]
    with pytest.raises(UsageError, match="neither a folder nor an archive"):
        found_at("memory://class/notes.txt")


def test_a_name_that_fsspec_would_read_as_an_address_is_not_fetched(tmp_path: Path) -> None:
    secret = tmp_path / "secret.zip"
    secret.write_bytes(b"PK")
    address = put({"x::file:": b"", "ali::memory:/a.usda": b"", f"jane/work/{STAGE}": b"#"})
    rows = graded(address, tmp_path / "book")
    assert rows["ali::memory:"]["status"] == "tool failed"
    assert "'::'" in rows["ali::memory:"]["reason"]
    assert rows["jane"]["status"] == "graded"


def test_the_archive_of_a_class_that_cannot_be_fetched_is_an_error() -> None:
    put({"forbidden.zip": b"PK"}, "faulty")
    with pytest.raises(UsageError, match=r"cannot be fetched \(Permission denied\)"):
        found_at("faulty://class/forbidden.zip")


def test_a_folder_that_cannot_be_listed_did_not_arrive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put({"jane/a.usda": b"x"})

    def refuse(*_arguments: Any, **_options: Any) -> Any:
        raise TimeoutError

    monkeypatch.setattr(memory.MemoryFileSystem, "ls", refuse)
    with pytest.raises(UnreachedError, match=r"^jane: cannot be listed \(TimeoutError\)$"):
        got("memory://class/jane", tmp_path)


def test_what_lies_at_an_address_that_nobody_knows_did_not_arrive(tmp_path: Path) -> None:
    with pytest.raises(UnreachedError, match="fsspec does not know it"):
        got("nonsense://class/jane", tmp_path)


def test_fetching_ends_when_the_run_does(tmp_path: Path) -> None:
    put({"hanging/a.usda": b"x"}, "faulty")
    source = Source(Path("hanging"), "", "faulty://class/hanging")
    with pytest.raises(UnreachedError, match="cannot be fetched"):
        fetched((source,), tmp_path, Limits(), lambda: True)
