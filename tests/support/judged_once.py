"""Equal stages of one file are judged once: most repairs begin and end with the same few."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from pxr import Usd

from lab3_usd.check.checker import judge
from lab3_usd.check.registry import all_rules
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.fix import repairing
from lab3_usd.isaac.platform import Platform
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.stage.read.stage_reader import read_model

_USUAL = tuple(all_rules())
_KNOWN: dict[tuple[str, str], tuple[Lab, RuleResults]] = {}


@contextmanager
def judged_once() -> Iterator[None]:
    """Let repairs have the judgement of a stage that was equal; a test's own rules are asked."""
    with patch.multiple(repairing, read_model=_Unread, judge=_judged):
        yield


class _Unread:
    """A stage that is read where nobody knows how it was judged."""

    def __init__(self, stage: Usd.Stage, platform: Platform, name: str) -> None:
        self.stage, self.platform, self.name = stage, platform, name

    def read(self) -> Any:
        return read_model(self.stage, self.platform, self.name)


def _judged(lab: Lab, checkpoint: Checkpoint, unread: _Unread) -> RuleResults:
    content = _content(unread.stage) if tuple(all_rules()) == _USUAL else ""
    if not content:
        return judge(lab, checkpoint, unread.read())
    key = (checkpoint.id, content)
    if key not in _KNOWN or _KNOWN[key][0] is not lab:
        _KNOWN[key] = (lab, judge(lab, checkpoint, unread.read()))
    return _KNOWN[key][1]


def _content(stage: Usd.Stage) -> str:
    """Return the text of a stage's only layer; '' of a stage of several."""
    root = stage.GetRootLayer()
    if any(layer not in {root, stage.GetSessionLayer()} for layer in stage.GetUsedLayers()):
        return ""
    if not root.dirty:
        data = Path(root.realPath).read_bytes()
        if data.startswith(b"#usda"):
            return data.decode()
    return str(root.ExportToString())
