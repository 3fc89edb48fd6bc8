"""What others find the project by, and what a release does up to the upload."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
import quick_yaml
from places import REPOSITORY

from lab3_usd.commands.table import all_commands
from lab3_usd.data import SITE

WORKFLOW = REPOSITORY / ".github" / "workflows" / "release.yml"
SKILL = REPOSITORY / "skills" / "lab3-usd" / "SKILL.md"


def version() -> str:
    found = re.search(
        r'^version = "(.+)"$', (REPOSITORY / "pyproject.toml").read_text(), re.MULTILINE
    )
    assert found is not None
    return found[1]


def test_the_change_log_has_the_version_of_the_package() -> None:
    assert f"## [{version()}]" in (REPOSITORY / "CHANGELOG.md").read_text()


def test_the_pages_of_rules_are_in_the_documentation_that_the_package_names() -> None:
    package = (REPOSITORY / "pyproject.toml").read_text()
    named = re.search(r'^Documentation = "(.*)"$', package, re.MULTILINE)
    site = quick_yaml.load((REPOSITORY / "mkdocs.yml").read_text()).get("site_url", "")
    assert SITE == (named[1] if named else "") == site.removesuffix("/")


@pytest.mark.parametrize("name", ["pyproject.toml", "mkdocs.yml", "CITATION.cff", "src"])
def test_nothing_that_is_published_leads_to_an_owner_that_is_none(name: str) -> None:
    path = REPOSITORY / name
    files = [path] if path.is_file() else path.rglob("*.py")
    assert [
        file for file in files if re.search(r"https?://\S*OWNER", file.read_text("utf-8"))
    ] == []


@pytest.mark.filterwarnings("ignore:.*make_default_short_help:DeprecationWarning")  # click-man's
def test_each_command_has_a_manual_page(tmp_path: Path) -> None:
    pytest.importorskip("click_man", reason="click-man is not installed")
    runpy.run_path(str(REPOSITORY / "docs" / "make_man.py"))["write"](tmp_path)
    names = {path.stem.removeprefix("lab3-") for path in tmp_path.glob("lab3-*.1")}
    assert set(all_commands()) <= names
    assert "--isaac" in (tmp_path / "lab3-lint.1").read_text().replace("\\", "")


def test_a_citation_names_the_version_of_the_package() -> None:
    citation = quick_yaml.load((REPOSITORY / "CITATION.cff").read_text())
    assert citation["version"] == version()


def test_pages_pin_a_commit_while_no_release_has_a_tag() -> None:
    for page in ("docs/ci.md", "docs/install.md", "docs/examples/workflow.yml"):
        text = (REPOSITORY / page).read_text()
        named = re.findall(r"(?:lab3-usd@|rev: )(\w[\w.]*)", text)
        assert set(named) == {"COMMIT"}, page


def test_nothing_is_uploaded_that_was_not_tested_and_checked() -> None:
    jobs = quick_yaml.load(WORKFLOW.read_text())["jobs"]
    runs = [step.get("run") for step in jobs["build"]["steps"]]
    assert runs.index("make test") < runs.index("make dist") < len(runs) - 1
    assert jobs["publish"]["needs"] == "build"


def test_only_the_job_that_uploads_may_sign_and_write() -> None:
    content = quick_yaml.load(WORKFLOW.read_text())
    assert content["permissions"] == {"contents": "read"}
    assert "permissions" not in content["jobs"]["build"]
    assert set(content["jobs"]["publish"]["permissions"]) == {"id-token", "contents"}


def test_the_skill_has_the_name_of_its_folder_and_says_when_to_use_it() -> None:
    _, head, _ = SKILL.read_text().split("---\n", 2)
    fields = quick_yaml.load(head)
    assert fields["name"] == SKILL.parent.name
    assert "Use it when" in fields["description"]
    assert len(fields["description"]) <= 1024


def test_the_skill_names_commands_that_exist() -> None:
    named = set(re.findall(r"`lab3 (\w+)", SKILL.read_text()))
    assert named <= set(all_commands())
