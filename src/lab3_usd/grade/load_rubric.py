"""Loads a rubric and refuses everything in it that nobody would read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from msgspec import to_builtins
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.check.finding import Requirement
from lab3_usd.check.model import StageModel
from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.grade.load_items import load_items
from lab3_usd.grade.load_values import one_of, positive, share
from lab3_usd.grade.rubric import Cap, Item, Late, Rubric
from lab3_usd.spec.spec import Lab
from lab3_usd.spec.yaml_file import expect, known_keys, need, read_foreign_yaml, read_yaml, texts

FILE = "rubric.yaml"
_CAP_KEYS = ("rules", "items", "checkpoints", "at_most", "because")


def load_rubric(path: Path | None, lab: Lab) -> Rubric:
    """Load the rubric at `path`, None for the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the item and the key.
    """
    file = path if path is not None else data_folder("graphs") / FILE
    data = read_yaml(file) if path is None else read_foreign_yaml(file)
    where = file.name
    known_keys(data, ("title", "weights", "items", "caps", "late"), where)
    asked = everything_asked(lab)
    items = load_items(need(data, "items", dict, where), asked, where)
    rubric = Rubric(
        title=need(data, "title", str, where),
        digest="",
        weights=_weights(data.get("weights", {}), asked, where),
        items=items,
        caps=_caps(data.get("caps", []), items, tuple(asked), where),
        late=_late(data.get("late", {}), where),
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


def _weights(
    data: object, asked: Mapping[str, tuple[Requirement, ...]], where: str
) -> dict[str, float]:
    kinds = tuple(dict.fromkeys(each.kind for found in asked.values() for each in found))
    place = f"{where}: weights"
    given = expect(data, dict, place)
    known_keys(given, kinds, place)
    return dict.fromkeys(kinds, 1.0) | {kind: positive(given, kind, place) for kind in given}


def _caps(
    data: object, items: tuple[Item, ...], checkpoints: tuple[str, ...], where: str
) -> tuple[Cap, ...]:
    places = enumerate(expect(data, list, f"{where}: 'caps'"), start=1)
    names = tuple(item.id for item in items)
    return tuple(
        _cap(spec, names, checkpoints, f"{where}: cap {number}") for number, spec in places
    )


def _cap(data: object, items: tuple[str, ...], checkpoints: tuple[str, ...], place: str) -> Cap:
    from lab3_usd.check.registry import all_rules  # noqa: PLC0415 - only where a rubric has caps

    spec = expect(data, dict, place)
    known_keys(spec, _CAP_KEYS, place)
    rules = texts(spec, "rules", place)
    if not rules:
        message = f"{place}: 'rules' is empty; name the rules whose errors limit the points"
        raise SpecError(message)
    named = texts(spec, "items", place, optional=True)
    looked_at = texts(spec, "checkpoints", place, optional=True)
    for rule in rules:
        one_of(rule, tuple(all_rules()), place)
    for name in named:
        one_of(name, items, place)
    for pattern in looked_at:
        if not any(fnmatchcase(number, pattern) for number in checkpoints):
            one_of(pattern, checkpoints, place)
    because = need(spec, "because", str, place)
    return Cap(rules, named, share(spec, place), because, looked_at)


def _late(given: object, where: str) -> Late:
    place = f"{where}: late"
    data = expect(given, dict, place)
    known_keys(data, ("at_most", "students"), place)
    at_most = share(data, place) if "at_most" in data else 1.0
    return Late(at_most, texts(data, "students", place, optional=True))
