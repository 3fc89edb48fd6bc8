"""The documentation as one site: every page has its place, and no link leads nowhere."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import quick_yaml
from places import REPOSITORY

from lab3_usd.check.registry import all_rules, own_rules

pytest.importorskip("mkdocs", reason="MkDocs is not installed")
CONFIG = REPOSITORY / "mkdocs.yml"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built with warnings as errors."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "-f", CONFIG, "-d", folder]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(command, capture_output=True, text=True, env=quiet, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_every_page_of_the_documentation_is_in_the_site(site: Path) -> None:
    pages = {path.stem for path in (REPOSITORY / "docs").glob("*.md")}
    assert pages - {path.stem for path in site.glob("*.html")} == set()


def test_every_page_of_the_documentation_is_in_the_navigation() -> None:
    text = CONFIG.read_text().partition("\nnav:\n")[2]
    named = {line.strip("- ") for line in text.splitlines()}
    assert {path.name for path in (REPOSITORY / "docs").glob("*.md")} - named == set()


def test_every_rule_has_a_page_at_its_address(site: Path) -> None:
    pages = {path.stem for path in site.glob("rules/*.html")}
    assert pages == all_rules().keys() - own_rules()
    assert 'href="rules/K64.html"' in (site / "rules.html").read_text(encoding="utf-8")
    assert "[parameters.K64]" in (site / "rules" / "K64.html").read_text(encoding="utf-8")


def test_the_first_page_is_the_readme(site: Path) -> None:
    assert "Isaac Sim" in (site / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("asked", ["fonts.googleapis.com", 'data-md-component="source"'])
def test_the_site_asks_no_other_computer(site: Path, asked: str) -> None:
    """Fonts, and the number of stars that the theme asks GitHub for."""
    assert asked not in (site / "index.html").read_text(encoding="utf-8")


def test_the_site_can_be_searched(site: Path) -> None:
    index = quick_yaml.load((site / "search" / "search_index.json").read_text(encoding="utf-8"))
    assert any("never-executes" in page["text"] for page in index["docs"])
