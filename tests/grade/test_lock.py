"""Two runs never write to one gradebook."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import forking
import pytest
from grade_files import submission
from other_labs import starter
from workers_here import graded_here

from lab3_usd.errors import NoRoomError, UsageError
from lab3_usd.grade.class_run import ClassSettings
from lab3_usd.grade.lock import LOCK, locked

HOLD = """
import sys
from pathlib import Path
from lab3_usd.grade.lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@contextmanager
def held(out: Path) -> Iterator[subprocess.Popen[str]]:
    """Let another process hold a gradebook."""
    with forking.Popen(
        [sys.executable, "-c", HOLD, str(out)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process


def killed(out: Path) -> int:
    """Leave a gradebook as a run does that was killed, and return its process."""
    with held(out) as process:
        process.send_signal(signal.SIGKILL)
    return process.pid


@pytest.mark.parametrize("force", [False, True])
def test_a_second_run_is_refused_and_told_whose_the_gradebook_is(
    *, force: bool, tmp_path: Path
) -> None:
    with (
        held(tmp_path / "book") as process,
        pytest.raises(UsageError, match=f"is being written by process {process.pid} on "),
        locked(tmp_path / "book", force=force),
    ):
        pytest.fail("two runs hold one gradebook")


def test_a_lock_that_a_killed_run_left_is_told_and_taken_with_force(tmp_path: Path) -> None:
    process = killed(tmp_path / "book")
    with (
        pytest.raises(UsageError, match=rf"process {process} .* was killed; give --force"),
        locked(tmp_path / "book"),
    ):
        pytest.fail("a lock was taken without --force")
    with locked(tmp_path / "book", force=True):
        assert json.loads((tmp_path / "book" / LOCK).read_text())["process"] == os.getpid()


def test_a_lock_of_another_host_may_be_of_a_run_that_goes_on(tmp_path: Path) -> None:
    owner = {"process": 1, "host": "elsewhere", "since": "2026-11-24T10:00:00+00:00"}
    (tmp_path / LOCK).write_text(json.dumps(owner))
    with (
        pytest.raises(UsageError, match=r"on elsewhere .* if that has ended, give --force"),
        locked(tmp_path),
    ):
        pytest.fail("a lock was taken without --force")


@pytest.mark.parametrize("is_new", [False, True])
def test_nothing_of_a_lock_stays(*, is_new: bool, tmp_path: Path) -> None:
    out = tmp_path / "book"
    if not is_new:
        out.mkdir()
    with locked(out):
        assert [path.name for path in out.iterdir()] == [".lab3-grade.lock"]
    assert out.exists() != is_new


def test_a_class_is_not_graded_into_a_gradebook_that_another_run_writes(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "ana", "00")
    settings = ClassSettings(tmp_path / "class", starter(), tmp_path / "book")
    with held(tmp_path / "book"), pytest.raises(UsageError, match="is being written"):
        graded_here(settings)


def test_a_killed_run_goes_on_with_resume_and_force(tmp_path: Path) -> None:
    submission(tmp_path / "class" / "ana", "00")
    killed(tmp_path / "book")
    book = ClassSettings(tmp_path / "class", starter(), tmp_path / "book", resume=True)
    with pytest.raises(UsageError, match="--force"):
        graded_here(book)
    forced = ClassSettings(
        tmp_path / "class", starter(), tmp_path / "book", resume=True, force=True
    )
    assert len(graded_here(forced)) == 1
    assert not (tmp_path / "book" / LOCK).exists()


@pytest.mark.parametrize("force", [False, True])
def test_a_file_of_that_name_that_is_no_lock_stays(*, force: bool, tmp_path: Path) -> None:
    (tmp_path / LOCK).write_text("notes")
    with pytest.raises(UsageError, match="is not a lock of a run"), locked(tmp_path, force=force):
        pass
    assert (tmp_path / LOCK).read_text() == "notes"


def test_a_full_disk_names_the_lock_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", full)
    book = tmp_path / "book"
    with pytest.raises(NoRoomError, match=f"{LOCK} cannot be written"), locked(book):
        pass
    assert not book.exists()
