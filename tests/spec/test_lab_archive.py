"""A lab in a zip: unpacked with the caution that any stranger's archive gets."""

from __future__ import annotations

import os
import stat
import zipfile
from pathlib import Path

import pytest
from in_process import invoke
from workers_here import workers_here

from lab3_usd.data import LAB_VARIABLE
from lab3_usd.errors import Lab3Error


@pytest.fixture(scope="module")
def lab(repository: Path) -> Path:
    return repository / "docs" / "examples" / "labs" / "jetbot"


def packed(lab: Path, target: Path, below: str = "jetbot/") -> Path:
    with zipfile.ZipFile(target, "w") as archive:
        for path in sorted(lab.iterdir()):
            archive.write(path, f"{below}{path.name}")
    return target


@pytest.fixture
def stage(lab: Path, tmp_path: Path) -> Path:
    built = invoke("--lab", lab, "build", "--only", "3", "--out", tmp_path / "stages").stdout
    return Path(built.strip())


@pytest.mark.parametrize("below", ["", "jetbot/"])
def test_an_option_or_the_environment_may_name_a_zip_of_a_lab(
    lab: Path, stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, below: str
) -> None:
    archive = packed(lab, tmp_path / "lab.zip", below)
    assert "checkpoint 3, pass, " in invoke("--lab", archive, "check", stage).stdout
    assert os.environ.get(LAB_VARIABLE) is None
    monkeypatch.setenv(LAB_VARIABLE, str(archive))
    assert "checkpoint 3, pass, " in invoke("check", stage).stdout
    assert os.environ[LAB_VARIABLE] == str(archive)


def test_a_class_is_graded_by_the_lab_in_a_zip(lab: Path, stage: Path, tmp_path: Path) -> None:
    archive = packed(lab, tmp_path / "lab.zip")
    student = tmp_path / "class" / "ann"
    student.mkdir(parents=True)
    (student / stage.name).write_bytes(stage.read_bytes())
    book = tmp_path / "book"
    arguments = ("grade", tmp_path / "class", "--starter", stage, "-o", book)
    with workers_here():
        assert invoke("--lab", archive, *arguments).exit_code == 0
    assert (book / "grades.csv").read_text().splitlines()[1].startswith("ann,")


def entry(name: str, mode: int = stat.S_IFREG | 0o644) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = mode << 16
    return info


ALIASES = "a: &a [1]\n" + "b: [" + "*a, " * 2000 + "*a]\n"
STRANGE = {
    "a program": (entry("jetbot/tools/make.py"), "print(1)"),
    "a name that leads out": (entry("../checkpoints.yaml"), "title: x"),
    "a link that leads out": (entry("jetbot/map.yaml", stat.S_IFLNK | 0o777), "/etc/passwd"),
    "YAML that unfolds": (entry("jetbot/More.yaml"), ALIASES),
    "YAML nested too deeply": (entry("jetbot/More.yaml"), "a: " + "[" * 60 + "]" * 60),
}


@pytest.mark.parametrize("name", STRANGE)
def test_what_is_no_data_of_a_lab_is_refused(name: str, lab: Path, tmp_path: Path) -> None:
    archive = packed(lab, tmp_path / "lab.zip")
    info, text = STRANGE[name]
    with zipfile.ZipFile(archive, "a") as more:
        more.writestr(info, text)
    with pytest.raises(Lab3Error):
        invoke("--lab", archive, "lab", "check")
    assert os.environ.get(LAB_VARIABLE) is None


def test_a_zip_that_grows_too_much_is_refused(lab: Path, tmp_path: Path) -> None:
    archive = packed(lab, tmp_path / "lab.zip")
    with zipfile.ZipFile(archive, "a", zipfile.ZIP_DEFLATED) as more:
        more.writestr("jetbot/zero.usda", b"\0" * (8 << 20))
    with pytest.raises(Lab3Error, match="times its packed size"):
        invoke("--lab", archive, "lab", "check")


@pytest.mark.parametrize(
    ("content", "message"), [(b"no zip", "damaged"), (None, "holds no checkpoints.yaml")]
)
def test_a_zip_of_something_else_is_refused(
    content: bytes | None, message: str, tmp_path: Path
) -> None:
    archive = tmp_path / "lab.zip"
    if content is None:
        with zipfile.ZipFile(archive, "w") as other:
            other.writestr("readme.txt", "hello")
    else:
        archive.write_bytes(content)
    with pytest.raises(Lab3Error, match=message):
        invoke("--lab", archive, "lab", "check")
