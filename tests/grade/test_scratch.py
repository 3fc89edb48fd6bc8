"""Temporary folders: what a killed run left is removed, and nothing that a person made."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import forking
import pytest
from click.testing import CliRunner
from machine import full_disk
from other_labs import starter, submission

from lab3_usd.cli import lab3
from lab3_usd.grade.intake import scratch
from lab3_usd.grade.intake.scratch import MARKER, make_scratch, remove_abandoned, remove_scratch

pytestmark = pytest.mark.usefixtures("forked_workers")

PREFIXES = ("lab3-grade-", "lab3-starter-", "lab3-class-")
ABANDON = """
import sys, tempfile
from lab3_usd.grade.intake.scratch import make_scratch
tempfile.tempdir = sys.argv[1]
folder = make_scratch("lab3-class-")
(folder / "class").mkdir()
(folder / "class" / "a.usda").write_text("#usda 1.0")
print(folder, flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    starter()  # these are made once, and not here
    forking.run([sys.executable, "-c", ""], check=True)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def parent(temporary: Path) -> Path:
    return temporary / f"lab3-scratch-{os.geteuid()}"


def abandoned(temporary: Path) -> Path:
    """Leave a folder as a run does that is killed."""
    with forking.Popen(
        [sys.executable, "-c", ABANDON, str(temporary)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        folder = Path(process.stdout.readline().rstrip("\n"))
        process.kill()
    return folder


def aged(folder: Path) -> Path:
    """Let a folder, and all in it, be old."""
    for path in (*folder.rglob("*"), folder):
        os.utime(path, (0, 0))
    return folder


def contents(top: Path) -> dict[str, bytes | str | None]:
    """Return every path below a folder, with what a file holds or where a link leads."""
    return dict(_contents(top, top))


def _contents(folder: Path, top: Path) -> Iterator[tuple[str, bytes | str | None]]:
    for path in folder.iterdir():
        name = str(path.relative_to(top))
        if path.is_symlink():
            yield name, str(path.readlink())
        elif path.is_dir():
            yield name, None
            yield from _contents(path, top)
        else:
            yield name, path.read_bytes()


def furnished(folder: Path, elsewhere: Path) -> None:
    """Fill a folder with others of the names that runs give to theirs, and with links to one."""
    for prefix in PREFIXES:
        for name in ("notes", "a1b2c3d4"):
            (folder / f"{prefix}{name}" / "files").mkdir(parents=True)
            (folder / f"{prefix}{name}" / "grades.txt").write_text("ana 10")
            (folder / f"{prefix}{name}" / "files" / "a.txt").write_text("b")
            aged(folder / f"{prefix}{name}")
        (folder / f"{prefix}new").mkdir()
        (folder / f"{prefix}link").symlink_to(elsewhere)


def in_order(number: int, parent: Path) -> Path:
    return parent if number == 1 else parent.with_name(f"{parent.name}-{number}")


def run(command: str, given: Path, out: Path) -> None:
    """Grade a class, or check a folder as a stranger's; both with real workers."""
    options = ["--jobs", "1", "--output", str(out)] if command == "grade" else ["--untrusted"]
    words = [command, *options, "--starter", str(starter()), str(given)]
    result = CliRunner().invoke(lab3, words)
    assert result.exit_code in {0, 1}, result.output


@pytest.mark.parametrize("command", ["grade", "check"])
def test_no_folder_of_a_person_is_removed_whatever_it_is_called(
    command: str, temporary: Path, parent: Path, tmp_path: Path
) -> None:
    killed = abandoned(temporary)
    elsewhere = tmp_path / "elsewhere"
    submission(elsewhere / "ana", "00")
    students = []
    for place in (temporary, parent, in_order(2, parent), killed.parent):
        place.mkdir(exist_ok=True)
        furnished(place, elsewhere)
        students.append(aged(submission(place / "lab3-class-fall2026" / "ana", "00").parent))
    before = contents(temporary)
    for number, given in enumerate([students[0], students[-1]]):  # each run removes everywhere
        run(command, given if command == "grade" else given / "ana", tmp_path / f"out{number}")
    own = {str(path.relative_to(temporary)) for path in (killed.parent / MARKER, killed)}
    kept = {
        name: held
        for name, held in before.items()
        if not any(name.startswith(part) for part in own)
    }
    assert contents(temporary).items() >= kept.items()


@pytest.mark.parametrize("command", ["grade", "check"])
def test_what_a_killed_run_left_is_removed_and_the_folder_of_all_with_it(
    command: str, temporary: Path, tmp_path: Path
) -> None:
    folder = abandoned(temporary)
    assert (folder / "class" / "a.usda").exists()
    given = submission(tmp_path / "class" / "ana", "00")
    run(command, given.parent if command == "grade" else given, tmp_path / "out")
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize("what", ["folder", "class", "parent", "temporary"])
def test_what_a_run_is_given_stays_also_where_a_killed_run_made_it(
    what: str, temporary: Path
) -> None:
    folder = abandoned(temporary)
    parent = folder.parent.parent
    remove_abandoned(
        [{"folder": folder, "class": folder / "class", "parent": parent}.get(what, temporary)]
    )
    assert (folder / "class" / "a.usda").exists()
    remove_abandoned([])
    assert list(temporary.iterdir()) == []


def test_a_folder_of_a_killed_run_that_somebody_renamed_or_copied_is_theirs(
    temporary: Path,
) -> None:
    top = abandoned(temporary).parent
    copy = shutil.copytree(top, top.with_name("lab3-class-copy"))
    renamed = top.rename(top.with_name("lab3-class-fall2026"))
    before = contents(temporary)
    remove_abandoned([])
    assert contents(temporary) == before
    assert copy.exists()
    assert renamed.exists()


def owned_by_another(folder: Path) -> Callable[[int], os.stat_result]:
    """Return what tells of open files, and of this folder that another user owns it."""
    really, number = os.fstat, folder.stat().st_ino

    def told(handle: int) -> os.stat_result:
        status = really(handle)
        if status.st_ino != number:
            return status
        return os.stat_result((*status[:4], status.st_uid + 1, *status[5:]))

    return told


@pytest.mark.parametrize("what", ["empty", "class", "file", "link", "open", "marked", "foreign"])
def test_a_place_that_is_not_ours_is_left_alone_and_another_taken(
    what: str, parent: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    if what == "file":
        parent.write_text("notes")
    elif what == "link":
        parent.symlink_to(elsewhere)
    else:
        parent.mkdir(0o700)
    if what == "class":
        submission(parent / "lab3-class-fall2026" / "ana", "00")
    if what == "marked":  # by a copy of a marker
        (parent / MARKER).write_text(f"{parent.name} 1\n")
    if what in {"open", "foreign"}:
        parent.rmdir()
        scratch._make_parent(parent)
        if what == "open":
            parent.chmod(0o777)
    if what == "foreign":
        monkeypatch.setattr(os, "fstat", owned_by_another(parent))
    before = contents(parent.parent)
    folder = make_scratch("lab3-grade-")
    assert not folder.is_relative_to(parent)
    remove_abandoned([])
    remove_scratch(folder)
    assert contents(parent.parent) == before
    assert list(elsewhere.iterdir()) == []


def test_where_every_name_is_taken_a_folder_lies_among_other_temporary_files(
    temporary: Path,
) -> None:
    for path in list(scratch._parents()):
        path.mkdir()
    folder = make_scratch("lab3-grade-")
    assert folder.parent == temporary
    remove_abandoned([])
    assert folder.exists()
    remove_scratch(folder)
    assert not folder.exists()


def test_a_folder_without_a_marker_stays_though_a_run_may_have_made_it(parent: Path) -> None:
    folder = make_scratch("lab3-grade-")
    (parent / "lab3-grade-unmarked").mkdir()
    remove_abandoned([])
    remove_scratch(folder)
    assert sorted(path.name for path in parent.iterdir()) == [MARKER, "lab3-grade-unmarked"]


def test_of_a_folder_of_ours_nothing_is_removed_but_what_we_put_in_it(temporary: Path) -> None:
    top = abandoned(temporary).parent
    submission(top / "lab3-class-fall2026" / "ana", "00")
    remove_abandoned([])
    assert [path.name for path in top.iterdir()] == ["lab3-class-fall2026"]
    assert (top / "lab3-class-fall2026" / "ana").exists()


def test_a_folder_that_took_the_place_of_ours_is_not_removed(parent: Path) -> None:
    folder = make_scratch("lab3-grade-")
    folder.parent.rename(parent / "moved")
    folder.mkdir(parents=True)
    (folder / "notes.txt").write_text("mine")
    remove_scratch(folder)
    assert (folder / "notes.txt").read_text() == "mine"


def test_only_the_user_may_enter_the_folder_of_all(parent: Path) -> None:
    folder = make_scratch("lab3-grade-")
    assert folder.parent.parent == parent
    assert parent.stat().st_mode & 0o777 == 0o700
    remove_scratch(folder)
    assert not parent.exists()


def test_a_full_disk_leaves_no_folder(temporary: Path) -> None:
    first = make_scratch("lab3-grade-")
    with full_disk(), pytest.raises(OSError, match="File too large"):
        make_scratch("lab3-grade-")
    remove_scratch(first)
    assert list(temporary.iterdir()) == []
