"""The lines that the repairs of a stage change, each by itself, in whatever files it lies."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from robot_kinds import faulty_fleet

from lab3_usd.fix import line_changes
from lab3_usd.fix.line_changes import Changes, text_changes
from lab3_usd.model.finding import Report
from lab3_usd.pipeline.stage import lint_stage
from lab3_usd.spec.load.loader import load_lab


def whole(text: str, folder: Path) -> Path:
    path = folder / "whole.usda"
    path.write_text(text)
    return path


def with_other_line_ends(text: str, folder: Path) -> Path:
    path = folder / "windows.usda"
    path.write_bytes(text.replace("\n", "\r\n").encode())
    return path


def referred_to(text: str, folder: Path) -> Path:
    """Robots of another file: repairs become overs of the root layer."""
    whole(text, folder)
    path = folder / "root.usda"
    path.write_text(
        '#usda 1.0\n(\n    defaultPrim = "World"\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n\n'
        'def "World" (\n    references = @whole.usda@</World>\n)\n{\n}\n'
    )
    return path


def in_a_sublayer(text: str, folder: Path) -> Path:
    whole(text, folder)
    path = folder / "root.usda"
    path.write_text("#usda 1.0\n(\n    subLayers = [@whole.usda@]\n)\n")
    return path


@pytest.fixture(scope="module")
def faulty() -> str:
    """Two robots with slashes before frames and messages without a time, in untidy text."""
    stage = faulty_fleet(2)
    text = str(stage.GetRootLayer().ExportToString())
    return text.replace("\n        {", " {  # as it was written").replace("    ", "\t")


def changes_of(path: Path) -> Changes:
    return text_changes(Report((lint_stage(path),)), load_lab(), None)


@pytest.mark.parametrize("spread", [whole, with_other_line_ends, referred_to, in_a_sublayer])
def test_the_lines_are_those_of_the_whole_file(
    spread: Callable[[str, Path], Path],
    faulty: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = spread(faulty, tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr(line_changes, "_is_of_single_prims", lambda _: False)
        expected = changes_of(path)
    monkeypatch.delattr(line_changes, "_lines_of_layer")  # no file is read for each of them
    assert len(expected) > 2
    assert changes_of(path) == expected
