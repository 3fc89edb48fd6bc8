"""YAML of unknown origin: what would bring its loader down is refused before."""

from __future__ import annotations

import sys
from pathlib import Path

import forking
import pytest
import yaml

from lab3_usd.errors import SpecError
from lab3_usd.yaml_file import read_foreign_yaml, refuse_deep


@pytest.mark.parametrize(
    "text", [b"a: [[[1], {b: 2}], 3]\n", b"- - - a\n  - b\n" * 200, b"", b"a: &x [1]\nb: *x\n"]
)
def test_what_is_flat_is_let_pass(text: bytes) -> None:
    refuse_deep(text)


@pytest.mark.parametrize("text", [b"[" * 51, b"- " * 51 + b"a", b"{a: " * 51])
def test_what_is_nested_deeply_is_refused(text: bytes) -> None:
    with pytest.raises(yaml.MarkedYAMLError, match="nested more than 50 levels"):
        refuse_deep(text)


def test_a_list_of_names_that_is_nested_deeply_crashes_nothing() -> None:
    code = (
        "from lab3_usd.grade.intake.platforms import names_in\n"
        "print(names_in(b'a: ' + b'[' * 100_000).fault)\n"
    )
    # In a process of its own, which is the only one that a crash of the loader ends.
    done = forking.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.startswith("line 1: ")  # libyaml may refuse it first, in its own words


@pytest.mark.parametrize(
    "text",
    [
        "!!map [1]",
        "a: !!map [1]",
        "!!set [a]",
        "a: !!set [a]",
        "? !!str [a]\n: b",
        "? !!str {a: b}\n: c",
        "a: !!omap {b: c}",
        "a: !!pairs {b: c}",
        "a: !!seq {b: c}",
        "a: !!str [b]",
        "a: !!int [1]",
        "a: !!float {b: 1}",
        "a: !!bool []",
        "a: !!null [1]",
        "a: !!binary [1]",
        "a: !!timestamp [1]",
        "a: !!python/name:os.system x",
        "a: !mine 1",
    ],
)
def test_a_tag_that_does_not_fit_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "rubric.yaml"
    path.write_text(text)
    with pytest.raises(SpecError, match=r"^rubric\.yaml: ") as error:
        read_foreign_yaml(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["a: 1\nb: [c,\n", "a: 1\nb: 'c", "a: 1\nb\n", "b: {c: [1\n\n"])
def test_a_text_that_ends_too_early_is_told_so(tmp_path: Path, text: str) -> None:
    path = tmp_path / "rubric.yaml"
    path.write_text(text)
    with pytest.raises(SpecError, match=r"^rubric\.yaml: line \d: the file ends too early: close"):
        read_foreign_yaml(path)


@pytest.mark.parametrize("text", ["a: [c}\nb: 1\n", "a: 1\n a: 2\nb: 1\n", "a: 1\na: 2"])
def test_a_text_that_is_wrong_before_its_end_is_told_what_is_wrong(
    tmp_path: Path, text: str
) -> None:
    path = tmp_path / "rubric.yaml"
    path.write_text(text)
    with pytest.raises(SpecError) as error:
        read_foreign_yaml(path)
    assert "too early" not in str(error.value)
