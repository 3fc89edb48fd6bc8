"""`lab3 doctor`: says what works, what is missing, and by its exit code whether it matters."""

from __future__ import annotations

import re
import shutil
import sys
from importlib import metadata
from pathlib import Path

import pytest
from in_process import invoke
from other_labs import copied
from places import REPOSITORY

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.features.doctor import doctor
from lab3_usd.features.doctor.doctor import Diagnosis
from lab3_usd.installation import install_command


@pytest.mark.usefixtures("forked_workers")
def test_here_everything_that_is_needed_works() -> None:
    result = invoke("doctor")
    firsts = [line for line in result.stdout.splitlines()[1:] if line[0] != " "]
    states = {line.split()[1]: line.split()[0] for line in firsts}
    assert result.exit_code == 0
    assert states["packages"] == states["checking"] == "ok"
    assert set(states) == {"packages", "checking", *doctor.EXTRAS, "browser", "sandbox"}


def test_the_page_of_the_installation_lists_the_extras() -> None:
    page = (REPOSITORY / "docs/install.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \| (.+) \|$", page, re.MULTILINE)
    assert dict(rows) == {name: purpose for name, (_, purpose) in doctor.EXTRAS.items()}


def test_the_versions_are_those_that_are_installed() -> None:
    assert f"click {metadata.version('click')}" in doctor.dependencies().text


def test_a_package_that_is_missing_is_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metadata, "requires", lambda _: ["click>=8", "no-such-thing<2", "x; y"])
    found = doctor.dependencies()
    assert (found.state, found.text) == ("bad", "not installed: no-such-thing")


def test_files_that_are_not_installed_are_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(name: str) -> list[str]:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", fail)
    assert doctor.dependencies().state == "missing"


def test_stages_that_cannot_be_built_are_bad(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (copied(tmp_path / "lab") / "checkpoints.yaml").write_text("title: [")
    monkeypatch.setenv(LAB_VARIABLE, str(tmp_path / "lab"))
    found = doctor.checking()
    assert found.state == "bad"
    assert "checkpoints.yaml" in found.text


def test_a_missing_extra_is_named_with_what_installs_it() -> None:
    found = doctor.extra("png", "no-such-package", "pictures")  # noqa: S610 - not Django
    assert found.state == "missing"
    head, command = doctor.diagnosis_lines(found)
    assert head.split() == ["missing", "png", "pictures"]
    assert command == " " * 20 + install_command("png")


def test_lines_fit_the_terminal_but_for_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = list(
        doctor.diagnosis_lines(Diagnosis("png", "missing", "a word " * 40, "one command " * 20))
    )
    assert max(map(len, lines[:-1])) <= 80
    assert all(line.startswith(" " * 20) for line in lines[1:])
    assert lines[-1].strip() == ("one command " * 20).strip()


def test_every_extra_of_users_is_looked_for() -> None:
    provided = set(metadata.metadata("lab3-usd").get_all("Provides-Extra") or ())
    assert set(doctor.EXTRAS) == provided - {"test", "dev"}


@pytest.mark.usefixtures("forked_workers")
def test_something_bad_is_exit_code_1(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metadata, "requires", lambda _: ["no-such-thing<2"])
    assert invoke("doctor").exit_code == doctor.EXIT_FOUND


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_a_browser_is_looked_for_where_the_system_brings_none(
    monkeypatch: pytest.MonkeyPatch, platform: str
) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setattr(doctor.sys, "platform", platform)
    assert doctor.browser().state == ("missing" if platform == "linux" else "ok")


@pytest.mark.parametrize(
    ("held", "state"), [({"files": True}, "ok"), ({"files": False, "limits": True}, "missing")]
)
def test_walls_that_are_not_there_are_named(held: dict[str, bool], state: str) -> None:
    found = doctor.walls(held)
    assert found.state == state
    assert "files" in found.text


def test_a_worker_that_does_not_start_is_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/no/python")
    assert doctor.sandbox().state == "bad"
