"""Opening stage files: names that usd-core cannot open are said to be names, not damage."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from pxr import Usd

from lab3_usd.errors import StageError
from lab3_usd.stage.opening import open_stage


def saved(path: Path) -> Path:
    stage = Usd.Stage.CreateInMemory()
    path.write_text(stage.GetRootLayer().ExportToString())
    return path


def test_a_name_in_another_script_is_opened(tmp_path: Path) -> None:
    assert open_stage(saved(tmp_path / "Übung 3.usda"))


def test_a_name_with_layer_arguments_is_said(tmp_path: Path) -> None:
    path = saved(tmp_path / "a:SDF_FORMAT_ARGS:b=c.usda")
    with pytest.raises(StageError, match="SDF_FORMAT_ARGS") as refused:
        open_stage(path)
    assert "damaged" not in str(refused.value)


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes on Linux only")
def test_a_name_that_is_no_utf_8_is_said(tmp_path: Path) -> None:
    path = saved(Path(os.fsdecode(os.fsencode(tmp_path) + b"/a\xff.usda")))
    with pytest.raises(StageError, match="UTF-8") as refused:
        open_stage(path)
    assert str(refused.value).encode("utf-8")
