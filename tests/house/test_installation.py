"""The command that adds an extra, wherever the program was installed."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest

from lab3_usd.installation import command_line, install_command

REQUIRES = [
    "click>=8",
    "resvg-py<0.6,>=0.4; extra == 'png'",
    "numpy<3,>=2.1; extra == 'sim'",
    "rosbags<0.12,>=0.11; extra == 'sim'",
    'lab3-usd[sim]; extra == "live"',
    'cyclonedds<12,>=11.0.1; extra == "live"',
]
PNG = "resvg-py<0.6,>=0.4"
SIM = ["numpy<3,>=2.1", "rosbags<0.12,>=0.11"]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment of its own, with a name that needs quotes."""
    environment = tmp_path / "lab3 usd"
    environment.mkdir()
    monkeypatch.setattr(metadata, "requires", lambda _: REQUIRES)
    monkeypatch.setattr(sys, "prefix", str(environment))
    monkeypatch.setattr(sys, "executable", str(environment / "python"))
    return environment


def without_pip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pip", None)


def test_pip_is_that_of_the_python_that_runs(place: Path) -> None:
    words = shlex.split(install_command("png"))
    assert words == [str(place / "python"), "-m", "pip", "install", PNG]


def test_pipx_injects_into_its_own_environment(place: Path) -> None:
    (place / "pipx_metadata.json").touch()
    assert shlex.split(install_command("png")) == ["pipx", "inject", "lab3 usd", PNG]


def test_uv_names_the_python_where_there_is_no_pip(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_pip(monkeypatch)
    words = shlex.split(install_command("png"))
    assert words == ["uv", "pip", "install", "--python", str(place / "python"), PNG]


@pytest.mark.parametrize(
    ("written", "named"),
    [
        ('extras = ["png"], directory = "/a b"', "lab3-usd[png,sim] @ /a b"),
        ('git = "https://h/o/n?rev=c0ffee"', "lab3-usd[sim] @ git+https://h/o/n@c0ffee"),
        ('specifier = ">=0.2"', "lab3-usd[sim]"),
    ],
)
def test_a_tool_of_uv_is_installed_again_with_the_extras_that_it_has(
    place: Path, written: str, named: str
) -> None:
    receipt = f'[tool]\nrequirements = [{{ name = "lab3-usd", {written} }}]\n'
    (place / "uv-receipt.toml").write_text(receipt)
    assert shlex.split(install_command("sim")) == ["uv", "tool", "install", named]


@pytest.mark.usefixtures("place")
def test_an_extra_brings_the_extras_that_it_needs() -> None:
    assert shlex.split(install_command("live"))[4:] == [*SIM, "cyclonedds<12,>=11.0.1"]


@pytest.mark.usefixtures("place")
@pytest.mark.parametrize("found", ["nothing", "files"])
def test_without_metadata_the_extra_itself_is_named(
    monkeypatch: pytest.MonkeyPatch, found: str
) -> None:
    def fail(name: str) -> list[str]:
        raise metadata.PackageNotFoundError(name)

    answers: dict[str, Callable[[str], list[str]]] = {"nothing": lambda _: [], "files": fail}
    monkeypatch.setattr(metadata, "requires", answers[found])
    assert shlex.split(install_command("png"))[-1] == "lab3-usd[png]"


def test_a_shell_of_windows_gets_double_quotes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    assert command_line("pipx", r"C:\a b\python.exe", PNG) == (rf'pipx "C:\a b\python.exe" "{PNG}"')
