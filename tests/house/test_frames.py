"""How many calls of ours stand between a command and a rule."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from breaking import correct_stage
from in_process import invoke

from lab3_usd.data import PACKAGE

MOST = 8  # from the command to the rule, both of them counted
RULES = f"{PACKAGE}/check/rules/"


def calls_to(frame: FrameType | None) -> list[str]:
    """Return the functions of this package that led to a frame, from its command on."""
    names: list[str] = []
    while frame is not None:
        code = frame.f_code
        if code.co_filename.startswith(str(PACKAGE)):
            names.append(f"{Path(code.co_filename).stem}.{code.co_name}")
        if code.co_name == "command":
            break
        frame = frame.f_back
    return names[::-1]


@pytest.mark.parametrize("command", ["check", "lint"])
def test_few_calls_stand_between_a_command_and_a_rule(command: str, tmp_path: Path) -> None:
    path = tmp_path / "Lab3_05.usda"
    correct_stage("05").GetRootLayer().Export(str(path))
    chains: list[list[str]] = []

    def note_rule(frame: FrameType, event: str, _value: Any) -> None:
        caller = frame.f_back.f_code.co_name if frame.f_back is not None else ""
        is_rule = caller == "run_rules" and frame.f_code.co_filename.startswith(RULES)
        if event == "call" and is_rule and not chains:
            chains.append(calls_to(frame))

    before = sys.getprofile()
    sys.setprofile(note_rule)
    try:
        invoke(command, str(path))
    finally:
        sys.setprofile(before)
    (chain,) = chains
    assert len(chain) <= MOST, chain
