"""The package as it is installed elsewhere: wheel and source archive carry every data file."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from importlib.util import cache_from_source
from pathlib import Path

import pytest
from pages import blocks, matches, sessions
from pxr import Sdf

from lab3_usd.spec.load.compiled import FILE

# One worker makes the archives and the environment, the others need not make them again.
DATA = ("graphs", "maps", "schema")


def run(*command: str | Path, cwd: Path) -> str:
    """Run a command as a user's shell would, without the paths of this test run."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def names_in(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


def modules_in(wheel: Path) -> set[str]:
    """The compiled templates."""
    return {name for name in names_in(wheel) if "/report/html/templates/compiled/" in name}


def files_below(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


# Makes the source archive, and the wheel from what that holds; it takes less time to pack loosely.
BUILD = """
import gzip, os, shutil, sys, zlib
from functools import partial
from unittest.mock import patch
from hatchling.build import build_sdist, build_wheel
folder = sys.argv[1]
zlib.Z_DEFAULT_COMPRESSION = 0
with patch.object(gzip, "GzipFile", partial(gzip.GzipFile, compresslevel=0)):
    name = build_sdist(folder)
shutil.unpack_archive(os.path.join(folder, name), os.path.join(folder, "unpacked"))
(source,) = os.scandir(os.path.join(folder, "unpacked"))
os.chdir(source)
build_wheel(folder)
"""


@pytest.fixture(scope="session")
def archives(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made as `python -m build` does: the wheel from the source archive."""
    folder = tmp_path_factory.mktemp("archives")
    run(sys.executable, "-c", BUILD, folder, cwd=repository)
    return folder


@pytest.fixture(scope="session")
def wheel(archives: Path) -> Path:
    (wheel,) = archives.glob("*.whl")
    return wheel


@pytest.fixture(scope="session")
def sdist(archives: Path) -> Path:
    (archive,) = archives.glob("*.tar.gz")
    return archive


@pytest.fixture(scope="session")
def elsewhere(wheel: Path, repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new environment with the wheel in it; the dependencies are those of this one.

    A path in a .pth file lends packages, but not this environment's own .pth files, so the
    checkout stays out of reach.
    """
    folder = tmp_path_factory.mktemp("elsewhere")
    run(sys.executable, "-m", "venv", "--without-pip", "env", cwd=folder)
    lent = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (packages_of(folder) / "lent.pth").write_text("\n".join(sorted(lent)) + "\n")
    pip = ("env/bin/python", "-m", "pip", "--disable-pip-version-check")
    alone = ("--no-deps", "--no-index", "--ignore-installed")
    run(*pip, "install", "--quiet", *alone, "--no-compile", wheel, cwd=folder)
    lend_compiled(repository / "src" / "lab3_usd", packages_of(folder) / "lab3_usd")
    return folder


def lend_compiled(source: Path, copy: Path) -> None:
    """Give modules what Python compiled of equal ones: by their sizes and times it knows them."""
    for path in source.rglob("*.py"):
        same, compiled = copy / path.relative_to(source), Path(cache_from_source(str(path)))
        if compiled.is_file():
            shutil.copystat(path, same)
            lent = Path(cache_from_source(str(same)))
            lent.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(compiled, lent)


def packages_of(folder: Path) -> Path:
    (packages,) = folder.glob("env/lib/python*/site-packages")
    return packages


# Runs commands one after the other, and prints of each what it printed, errors first, and how it
# ended.
SESSION = """
import io, json, sys
from lab3_usd import cli
told = []
for sys.argv in json.loads(sys.argv[1]):
    sys.stdout, sys.stderr = out, err = [io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in "oe"]
    status = 0
    try:
        cli.main()
    except SystemExit as leaving:
        status = leaving.code or 0
    for stream in (err, out):
        stream.flush()
    told.append(((err.buffer.getvalue() + out.buffer.getvalue()).decode(), status))
json.dump(told, sys.__stdout__)
"""
STATUS = '; echo "exit code $?"'


@pytest.mark.skipif(os.name == "nt", reason="the console blocks are those of a POSIX shell")
@pytest.mark.timeout(300)  # processes of a new environment, which compile what they import
def test_the_first_ten_minutes_of_the_readme(
    elsewhere: Path, repository: Path, tmp_path: Path
) -> None:
    """Install, demo, lint, check, fix, dry run, and a stage of one's own.

    What needs no shell is run in one process of the new environment.
    """
    programs = elsewhere / "env" / "bin"
    kept = {name: os.environ[name] for name in ("HOME", "LANG") if name in os.environ}
    environment = {**kept, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    page = [*blocks(repository / "README.md")]
    consoles = [sessions(block.text) for block in page if block.language == "console"]
    # The first screen has two files of the clone; test_docs runs it.
    examples = [example for console in consoles[1:] for example in console]
    commands = [command.removesuffix(STATUS) for command, _ in examples]
    assert [each for each in commands if not re.fullmatch(r"lab3 [\w ./-]+", each)] == []
    calls = json.dumps([shlex.split(command) for command in commands])
    done = subprocess.run(
        [programs / "python", "-c", SESSION, calls], cwd=tmp_path, env=environment,
        capture_output=True, text=True, check=True, timeout=100,
    )  # fmt: skip
    for (command, expected), (printed, status) in zip(
        examples, json.loads(done.stdout), strict=True
    ):
        code = f"exit code {status}\n" if command.endswith(STATUS) else ""
        assert matches(expected, printed + code), f"$ {command}\n{printed}{code}"
    Sdf.Layer.FindOrOpen(str(tmp_path / "carter.usda")).Export(str(tmp_path / "my_robot.usd"))
    own = subprocess.run(
        [programs / "lab3", "lint", "my_robot.usd"], cwd=tmp_path, env=environment,
        capture_output=True, text=True, check=False, timeout=100,
    )  # fmt: skip
    assert "my_robot.usd: fail, 3 errors" in own.stderr + own.stdout


EXAMPLE = "lab3_usd/_data/docs/examples/carter.usda"  # which `lab3 demo` copies


def test_wheel_carries_the_package_and_every_data_file(wheel: Path, repository: Path) -> None:
    package = {f"lab3_usd/{name}" for name in files_below(repository / "src" / "lab3_usd")}
    data = {
        f"lab3_usd/_data/{folder}/{name}"
        for folder in DATA
        for name in files_below(repository / folder)
    }
    graphs = "lab3_usd/_data/graphs"
    compiled = {f"{graphs}/{FILE}"} | modules_in(wheel)
    assert names_in(wheel) == package | data | compiled | {EXAMPLE}
    templates = {name for name in package if name.endswith(".html.j2")}
    assert len(modules_in(wheel)) >= len(templates)
    assert "lab3_usd/py.typed" in package


def test_what_is_installed_is_the_wheel(elsewhere: Path, wheel: Path) -> None:
    installed = files_below(packages_of(elsewhere) / "lab3_usd")
    assert {f"lab3_usd/{name}" for name in installed} == names_in(wheel)


def test_source_archive_carries_what_runs_its_tests(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"Makefile", ".ci/run", "requirements/run.txt", "tests/house/test_wheel.py"} <= names


def test_the_installed_package_is_the_wheels(elsewhere: Path) -> None:
    where = run("env/bin/python", "-c", "import lab3_usd; print(lab3_usd.__file__)", cwd=elsewhere)
    assert Path(where.strip()).is_relative_to(elsewhere)


def test_the_installed_package_reads_no_yaml_at_start(elsewhere: Path) -> None:
    code = "import sys; from lab3_usd import load_lab; load_lab(); print('yaml' in sys.modules)"
    assert run("env/bin/python", "-B", "-c", code, cwd=elsewhere).strip() == "False"


def test_the_installed_package_compiles_no_template(elsewhere: Path) -> None:
    code = (
        "import sys; from lab3_usd.report.html.templates import fill_page; import jinja2;"
        "jinja2.Environment.compile = None;"
        "from lab3_usd.report.html.templates import jinja_environment;"
        "names = ('report.html.j2', 'class.html.j2');"
        "print(len([jinja_environment().get_template(name) for name in names]))"
    )
    assert run("env/bin/python", "-c", code, cwd=elsewhere).strip() == "2"
