"""Loads a rubric; unknown keys and values without effect are errors."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from msgspec import Struct, to_builtins
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.errors import SpecError
from lab3_usd.grade.scoring.load_items import load_items, one_of
from lab3_usd.grade.scoring.rubric import Cap, Late, Points, Rubric
from lab3_usd.model.finding import REQUIREMENT_KINDS, Requirement
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.files import RUBRIC
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.records import record
from lab3_usd.spec.yaml_file import read_foreign_yaml, read_yaml


class _RubricFile(Struct, forbid_unknown_fields=True):
    title: str
    items: dict[str, dict[str, Any]]
    weights: dict[str, Points] = {}
    caps: tuple[Cap, ...] = ()
    late: Late = Late()


def load_rubric(path: Path | None, lab: Lab) -> Rubric:
    """Load the rubric at `path`, None for that of the lab.

    Raises:
        SpecError: the file is missing or wrong; the line names the item and the key.
    """
    file = path if path is not None else lab.folder / RUBRIC
    if path is None and not file.is_file():
        message = f"{lab.title} has no {RUBRIC}; name a rubric with --rubric"
        raise SpecError(message)
    data = read_yaml(file) if path is None else read_foreign_yaml(file)
    where = file.name
    said = record(data, _RubricFile, where)
    asked = everything_asked(lab)
    for kind in said.weights:
        one_of(kind, REQUIREMENT_KINDS, f"{where}: weights")
    lines = [line.text for line in lab.submission.checklist]
    items = load_items(said.items, asked, lines, where)
    for number, cap in enumerate(said.caps, start=1):
        _check_cap(cap, said.items, asked, f"{where}: cap {number}")
    rubric = Rubric(
        title=said.title,
        digest="",
        weights=dict.fromkeys(REQUIREMENT_KINDS, 1.0) | said.weights,
        items=items,
        caps=said.caps,
        late=said.late,
        asked={
            item.id: tuple(each for each in asked.get(item.checkpoint, ()) if item.asks(each))
            for item in items
        },
    )
    return replace(rubric, digest=_digest(rubric))


def _digest(rubric: Rubric) -> str:
    """Return what tells the rubric from others, the order of its items and caps included.

    What the checkpoints ask for is no part of it: that is the lab's, not the rubric's.
    """
    said = to_builtins(replace(rubric, asked={}))
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()


def everything_asked(lab: Lab) -> dict[str, tuple[Requirement, ...]]:
    """Return every requirement of every checkpoint, as an empty stage leaves it: not met."""
    empty = StageModel("", 1.0, 1.0, (), {})
    return {
        number: tuple(
            Requirement(each.id, each.group, each.kind, each.title, met=False, handout=each.handout)
            for each in judge(lab, checkpoint, empty).requirements
        )
        for number, checkpoint in lab.checkpoints.items()
    }


def _check_cap(cap: Cap, items: Collection[str], checkpoints: Collection[str], place: str) -> None:
    """Refuse a cap that could limit nothing."""
    from lab3_usd.check.registry import all_rules  # noqa: PLC0415 - only where a rubric has caps

    if not cap.rules:
        message = f"{place}: 'rules' is empty; name the rules whose errors limit the points"
        raise SpecError(message)
    for rule in cap.rules:
        one_of(rule, all_rules(), place)
    for name in cap.items:
        one_of(name, items, place)
    for pattern in cap.checkpoints:
        if not any(fnmatchcase(number, pattern) for number in checkpoints):
            one_of(pattern, checkpoints, place)
