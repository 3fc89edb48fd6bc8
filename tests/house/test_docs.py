"""The documentation is true: its commands run, its code runs, its links lead somewhere."""

from __future__ import annotations

import functools
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import entry_points
from io import StringIO
from pathlib import Path
from unittest.mock import patch

import click
import forking
import pytest
from fork_server import FORKED_WORKERS
from in_process import lab3
from pages import blocks, inline, matches, sessions, tokens
from places import REPOSITORY

from lab3_usd import cli, data
from lab3_usd.check.registry import all_rules
from lab3_usd.commands.table import FORMER
from lab3_usd.report.formats.registry import all_formats
from lab3_usd.spec.load import loader

ROOT = REPOSITORY
DOCS = ROOT / "docs"
FOLDERS = ("schema", "benchmarks")
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *DOCS.glob("*.md"),
        *(ROOT / name / "README.md" for name in FOLDERS),
    ]
)
# A command that needs no shell, and what a page may ask of it afterwards.
ALONE = re.compile(r"""(lab3|usdlab) ([^$&*;<>?`|~\\\n]+)(; echo "exit code \$\?")?""")
SCRIPT = re.compile(r"""python ([\w./]+\.py [\w ./-]+)(; echo "exit code \$\?")?""")
RUN = re.compile(r"(?m)^\s*```(console|python)\b")
RULE = re.compile(r"`([A-Z]{1,2}\d{2,3})`|\b([A-Z]{1,2}\d{2,3}) [a-z]+-[a-z-]+\b")


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


# ---- what a page shows is run, in a copy of what the program needs, one block after the other


@contextmanager
def data_in(checkout: Path) -> Iterator[None]:
    """Make this process find its files as one of another checkout does, and read the lab anew.

    The lab that was loaded before stays what it is: others hold it.
    """
    loaders = {
        name: functools.lru_cache(getattr(loader, name).__wrapped__)
        for name in ("_bundled", "_load")
    }
    with (
        patch.object(data, "PACKAGE", checkout / "src" / "lab3_usd"),
        patch.multiple(loader, **loaders),
    ):
        data.data_folder.cache_clear()
        try:
            yield
        finally:
            data.data_folder.cache_clear()


@dataclass(frozen=True)
class Sandbox:
    """A folder where a page's commands run; `environment` makes them those of this checkout.

    As in a terminal, `cd` holds for the commands that follow. Where `has_own_lab`, they use the lab
    of this folder.
    """

    folder: Path
    environment: dict[str, str]
    has_own_lab: bool = False

    @property
    def place(self) -> Path:
        """The file that names the working directory, once a command has been run."""
        return self.folder.parent / "cwd"

    @property
    def cwd(self) -> str:
        return self.place.read_text().strip() if self.place.exists() else str(self.folder)

    def bash(self, command: str) -> str:
        """Return what a command prints, errors as well, as a terminal shows it."""
        done = subprocess.run(
            ["bash", "-c", f"{command}\npwd > {shlex.quote(str(self.place))}"],  # noqa: S607
            cwd=self.cwd,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=300,
        )
        return done.stdout

    def shown(self, command: str) -> str:
        """Return what a command prints; where no shell is needed, no process is started either.

        What it says goes first, as through a pipe.
        """
        alone = ALONE.fullmatch(command)
        script = SCRIPT.fullmatch(command)
        if script is not None:
            return self.script(shlex.split(script[1])) + ("exit code 0\n" if script[2] else "")
        if alone is None:
            return self.bash(command)
        own = data_in(self.folder) if self.has_own_lab else nullcontext()
        with self.entered(), own:
            done = lab3(*shlex.split(alone[2]), typed=alone[1])
        code = f"exit code {done.returncode}\n" if alone[3] else ""
        return done.stderr + done.stdout + code

    def script(self, words: list[str]) -> str:
        """Return what a script of Python prints, which must end well."""
        argv = patch.object(sys, "argv", words)
        with self.entered(), argv, redirect_stdout(StringIO()) as printed:
            runpy.run_path(words[0], run_name="__main__")
        return printed.getvalue()

    def python(self, text: str) -> str:
        """Return what a program prints."""
        with self.entered(), redirect_stdout(StringIO()) as printed:
            exec(text, {"__name__": "__main__"})  # noqa: S102 - our own page
        return printed.getvalue()

    def prepare(self, text: str) -> None:
        """Run what readers do not see; where that changes to, they are not taken."""
        before = self.cwd
        for line in text.replace("\\\n", " ").splitlines():
            answer = self.shown(f'{line}; echo "exit code $?"')
            assert answer.endswith("exit code 0\n"), f"{line}\n{answer}"
        self.place.write_text(before)

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Make this process one that was started here."""
        before = Path.cwd()
        with patch.dict(os.environ, self.environment, clear=True):
            os.chdir(self.cwd)
            try:
                yield
            finally:
                os.chdir(before)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the program, which no page changes, with what is compiled of it."""
    folder = tmp_path_factory.mktemp("docs") / "lab3-usd"
    shutil.copytree(ROOT / "src", folder / "src")
    return folder


@pytest.fixture
def sandbox(program: Path, tmp_path: Path) -> Iterator[Sandbox]:
    folder = tmp_path / program.name
    program.rename(folder)
    for name in ("docs", "graphs", "maps", "schema"):  # and the lab as it is kept compiled
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("*.pyc"))
    # A reader has run `make demo` first.
    (folder / "out").mkdir()
    for name in ("00_student_start", "01_ros_clock", "02_ros_drive", "05_odometry_tf"):
        (folder / "out" / f"Lab3_{name}.usda").touch()
    programs = tmp_path / "bin"
    programs.mkdir()
    installed = "lab3" in {point.name for point in entry_points(group="pytest11")}
    plugin = "" if installed else " -p lab3_usd.pytest_plugin"
    forking.shim(programs / "lab3", "lab3_usd")
    forking.preload("pytest")
    forking.shim(programs / "pytest", "pytest")
    second = "import sys; sys.argv[0] = 'usdlab'; from lab3_usd.cli import run; run()"
    shims = {"usdlab": f'-c "{second}" ', "python": ""}
    for name, arguments in shims.items():
        (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {arguments}"$@"\n')
        (programs / name).chmod(0o755)
    dropped = ("COLUMNS", "PYTEST_ADDOPTS", "PYTEST_CURRENT_TEST", "NO_COLOR", "FORCE_COLOR")
    environment = {key: value for key, value in os.environ.items() if key not in dropped}
    environment |= {
        **FORKED_WORKERS,
        "HOME": str(tmp_path),
        "CHECKOUT": str(ROOT),
        "PATH": f"{programs}{os.pathsep}{environment['PATH']}",
        "PYTHONPATH": str(folder / "src"),
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "" if installed else "1",
        # anyio loads trio and asyncio; what is forked has the program's modules
        "PYTEST_ADDOPTS": f"-p no:anyio -W ignore::pytest.PytestAssertRewriteWarning{plugin}",
    }
    yield Sandbox(folder, environment)
    program.mkdir()
    (folder / "src").rename(program / "src")


def changes_the_program(page: Path) -> bool:
    """Whether a page writes a file of a lab or a module."""
    return any(block.extra.endswith((".yaml", ".py")) for block in blocks(page))


def run_blocks(page: Path, sandbox: Sandbox) -> None:
    """Run what a page shows; a `text` block after Python is what that prints."""
    if changes_the_program(page):
        sandbox = replace(sandbox, has_own_lab=True)
    else:  # a process that has this checkout's program need not import the copy
        path = {"PYTHONPATH": str(ROOT / "src")}
        sandbox = replace(sandbox, environment=sandbox.environment | path)
    printed = None
    for block in blocks(page):
        if block.language == "text" and printed is not None:
            assert matches(block.text.splitlines(), printed), printed
        printed = None
        if block.language == "before":
            sandbox.prepare(block.text)
        elif block.language == "console":
            for command, shown in sessions(block.text):
                answer = sandbox.shown(command)
                assert matches(shown, answer), f"$ {command}\n{answer}"
        elif block.language == "python":
            printed = sandbox.python(block.text)
        elif block.extra:  # a file, or with a plus what is added to its end
            target = sandbox.folder / block.extra.lstrip("+")
            before = target.read_text() if block.extra.startswith("+") else ""
            if block.text not in before:  # an author may have followed the page already
                target.write_text(before + block.text)


def is_run(page: Path) -> bool:
    """The README is run too, with the installed package: tests/house/test_wheel.py."""
    return page.name != "README.md" and RUN.search(page.read_text(encoding="utf-8")) is not None


@pytest.mark.usefixtures("forked_workers")
@pytest.mark.parametrize("page", [page for page in PAGES if is_run(page)], ids=name_of)
def test_what_a_page_shows_is_what_happens(page: Path, sandbox: Sandbox) -> None:
    run_blocks(page, sandbox)


def test_a_page_that_shows_something_else_fails(tmp_path: Path, sandbox: Sandbox) -> None:
    page = tmp_path / "page.md"
    page.write_text("```console\n$ echo one; echo two; echo three\none\n...\nfour\n```\n")
    with pytest.raises(AssertionError):
        run_blocks(page, sandbox)


# ---- commands that are named and not run


def named_commands(page: Path) -> list[str]:
    """Return every `lab3 ...` of a page that stands in a line or a span of its own."""
    spans = [token.content for token in inline(page, "code_inline")]
    lines = [
        line
        for block in blocks(page)
        if block.language in {"sh", "yaml"}
        for line in re.sub(r"\\\n *", "", block.text).splitlines()
    ]
    return [text.strip() for text in (*spans, *lines) if text.strip().startswith("lab3 ")]


def options_of(command: click.Command) -> set[str]:
    taken = {name for param in command.params for name in (*param.opts, *param.secondary_opts)}
    former = {"--out"} if "--output" in taken else set[str]()
    return taken | former | {"-h", "--help"}


def unknown_parts(text: str) -> list[str]:
    """Return the words of a command line that the program does not know."""
    line = text.partition(" #")[0].partition(" > ")[0]
    _, *words = shlex.split(line.replace("...", ""))
    if words[:1] == ["--lab"]:
        words = words[2:]
    if not words or words[0] in {"COMMAND", "help", "--help", "--version"}:
        return []
    name = FORMER.get(words[0], words[0])
    if name not in cli.all_commands():
        return [name]
    command = import_module(cli.all_commands()[name].module).command
    if isinstance(command, click.Group):
        if words[1:2] and words[1] not in command.commands:
            return [words[1]]
        command = command.commands[words[1]] if words[1:] else command
    given = {word.partition("=")[0] for word in words[1:] if word.startswith("-") and word != "--"}
    return sorted(given - options_of(command))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_command_that_a_page_names_exists(page: Path) -> None:
    unknown = {text: unknown_parts(text) for text in named_commands(page)}
    assert {text: words for text, words in unknown.items() if words} == {}


def test_the_readme_lists_every_command() -> None:
    named = {text.split()[1] for text in named_commands(ROOT / "README.md") if len(text) > 5}
    assert set(cli.all_commands()) <= named


def test_the_page_about_formats_names_every_format() -> None:
    spans = {token.content for token in inline(DOCS / "ci.md", "code_inline")}
    assert set(all_formats()) <= spans


def folders_of_the_page_on_architecture() -> set[str]:
    """Return the folders of its tree, by the indent of their lines."""
    open_folders: list[str] = []
    found = set()
    tree = next(block.text for block in blocks(DOCS / "architecture.md") if "src/" in block.text)
    for indent, name in re.findall(r"^( *)([\w/]+)/ *(?= |$)", tree, re.MULTILINE):
        del open_folders[len(indent) // 2 :]
        open_folders.append(name)
        found.add("/".join(open_folders))
    return found


def test_the_page_on_architecture_lists_every_package() -> None:
    packages = {path.parent.relative_to(ROOT) for path in (ROOT / "src").rglob("__init__.py")}
    listed = folders_of_the_page_on_architecture() - {"graphs"}
    # A feature says itself what it is.
    expected = {path.as_posix() for path in packages if path.parent.name != "features"}
    assert listed == expected


# ---- links, anchors, rules


def slug(heading: str) -> str:
    """Return the anchor that GitHub gives to a heading."""
    kept = re.sub(r"[^\w\- ]", "", heading.lower())
    return kept.replace(" ", "-")


@functools.cache
def anchors(page: Path) -> set[str]:
    found = tokens(page)
    return {
        slug("".join(child.content for child in found[place + 1].children or ()))
        for place, token in enumerate(found)
        if token.type == "heading_open"
    }


def links(page: Path) -> list[str]:
    named = [str(token.attrs["href"]) for token in inline(page, "link_open")]
    return named + [str(token.attrs["src"]) for token in inline(page, "image")]


def leads_nowhere(page: Path, link: str) -> bool:
    if link.startswith("https://"):
        return False
    path, _, anchor = link.partition("#")
    target = (page.parent / path).resolve() if path else page
    if not target.exists() or ROOT not in (target, *target.parents):
        return True
    return bool(anchor) and anchor not in anchors(target)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_somewhere(page: Path) -> None:
    assert [link for link in links(page) if leads_nowhere(page, link)] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_picture_says_what_it_shows(page: Path) -> None:
    assert [token.attrs["src"] for token in inline(page, "image") if not token.content] == []


def test_every_page_is_linked_from_the_readme() -> None:
    readme = ROOT / "README.md"
    reached = {(readme.parent / link.partition("#")[0]).resolve() for link in links(readme)}
    assert [name_of(page) for page in PAGES if page not in {readme, *reached}] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_rule_that_a_page_names_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = {first or second for first, second in RULE.findall(text)}
    added = set(re.findall(r'@rule\("(\w+)"', text))  # by the page itself
    assert named - added - set(all_rules()) == set()


# ---- what scripts make


def test_the_reference_of_rules_is_up_to_date() -> None:
    made = runpy.run_path(str(DOCS / "make_rules.py"))["page"]()
    assert made == (DOCS / "rules.md").read_text(encoding="utf-8"), "python docs/make_rules.py"


def test_the_reference_of_lab_files_is_up_to_date() -> None:
    made = runpy.run_path(str(DOCS / "make_lab_files.py"))["page"]()
    page = (DOCS / "lab-files.md").read_text(encoding="utf-8")
    assert made == page, "python docs/make_lab_files.py"


def test_the_table_of_changes_is_up_to_date() -> None:
    page = (DOCS / "moving.md").read_text(encoding="utf-8")
    made = runpy.run_path(str(DOCS / "make_release_changes.py"))["page"](page)
    assert made == page, "python docs/make_release_changes.py"


def test_the_table_of_node_types_that_are_played_is_up_to_date() -> None:
    page = (DOCS / "sim.md").read_text(encoding="utf-8")
    made = runpy.run_path(str(DOCS / "make_played_nodes.py"))["page"](page)
    assert made == page, "python docs/make_played_nodes.py"


def test_every_family_of_rules_is_introduced() -> None:
    script = runpy.run_path(str(DOCS / "make_rules.py"))
    assert set(script["FAMILY_TITLES"]) == set(script["FAMILIES"].values())


def test_the_pictures_are_up_to_date(tmp_path: Path) -> None:
    make = runpy.run_path(str(DOCS / "make_pictures.py"))["make_pictures"]
    with patch.dict(make.__globals__, _lab3=lab3):
        make(tmp_path)
    kept = {path.name: path.read_bytes() for path in (DOCS / "pictures").glob("*.svg")}
    made = {path.name: path.read_bytes() for path in tmp_path.glob("*.svg")}
    assert made == kept, "python docs/make_pictures.py"


def test_the_pictures_are_small() -> None:
    sizes = {path.name: path.stat().st_size for path in (DOCS / "pictures").iterdir()}
    assert {name: size for name, size in sizes.items() if size > 100_000} == {}


def test_the_changelog_tells_of_this_version() -> None:
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert version
    assert f"## [{version[1]}]" in (ROOT / "CHANGELOG.md").read_text()


# ---- size

MOST_WORDS = 26_000
GENERATED = r"<!-- (Written by|Below: written by|table:) "  # what follows is made by a script


def words_by_hand(page: Path) -> int:
    return len(re.split(GENERATED, page.read_text(encoding="utf-8"), maxsplit=1)[0].split())


def test_the_pages_that_people_write_stay_short() -> None:
    words = {name_of(page): words_by_hand(page) for page in PAGES if page.name != "CHANGELOG.md"}
    assert words["docs/rules.md"] < 10, "its words are those of the rules"
    assert sum(words.values()) <= MOST_WORDS, words
