"""YAML of unknown origin: what would bring its loader down is refused before."""

from __future__ import annotations

import subprocess
import sys

import pytest
import yaml

from lab3_usd.spec.yaml_file import refuse_deep


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
        "from lab3_usd.grade.gradescope_export import names_in\n"
        "print(names_in(b'a: ' + b'[' * 100_000).fault)\n"
    )
    # In a process of its own, which is the only one that a crash of the loader ends.
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert "nested" in done.stdout
