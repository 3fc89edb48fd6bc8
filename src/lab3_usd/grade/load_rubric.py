"""Loads a rubric and refuses everything in it that nobody would read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from msgspec import to_builtins
from msgspec.structs import replace

from lab3_usd.check.checker import judge
from lab3_usd.check.finding import Requirement
from lab3_usd.check.model import StageModel
from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.grade.rubric import COLUMNS, VISIBILITIES, Cap, Item, Late, Rubric
from lab3_usd.spec.load_submission import load_submission
from lab3_usd.spec.spec import Lab
from lab3_usd.spec.yaml_file import expect, known_keys, need, read_foreign_yaml, texts

FILE = "rubric.yaml"
_NUMBER = (int, float)
_LEAST, _MOST = 0.001, 1e6  # of points and weights: their sums and shares stay sane numbers
_ITEM_KEYS = (
    "title", "points", "checkpoint", "groups", "requirements", "checklist",
    "partial", "optional", "needs", "visibility",
)  # fmt: skip


def load_rubric(path: Path | None, lab: Lab) -> Rubric:
    """Load the rubric at `path`, None for the bundled one.

    Raises:
        SpecError: the file is missing or wrong; the line names the item and the key.
    """
    file = path if path is not None else data_folder("graphs") / FILE
    data = read_foreign_yaml(file)
    where = file.name
    known_keys(data, ("title", "weights", "items", "caps", "late"), where)
    asked = everything_asked(lab)
    items = _items(need(data, "items", dict, where), asked, where)
    rubric = Rubric(
        title=need(data, "title", str, where),
        digest="",
        weights=_weights(data.get("weights", {}), asked, where),
        items=items,
        caps=_caps(data.get("caps", []), items, where),
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


def _items(
    data: Mapping[str, Any], asked: Mapping[str, tuple[Requirement, ...]], where: str
) -> tuple[Item, ...]:
    if not data:
        message = f"{where}: 'items' is empty; a rubric needs at least one"
        raise SpecError(message)
    items: dict[str, Item] = {}
    for name, spec in data.items():
        _check_name(name, where)
        place = f"{where}: {name}"
        item = _item(name, expect(spec, dict, place), place)
        _check_needs(item, tuple(data), place)
        if item.checklist:
            _check_line(item, place)
        else:
            _check_requirements(item, asked, place)
        items[name] = item
    return tuple(items.values())


def _item(name: str, spec: Mapping[str, Any], place: str) -> Item:
    known_keys(spec, _ITEM_KEYS, place)
    if ("checkpoint" in spec) == ("checklist" in spec):
        message = f"{place}: give either 'checkpoint' or 'checklist'"
        raise SpecError(message)
    values: dict[str, Any] = {
        key: texts(spec, key, place) for key in ("groups", "requirements", "needs") if key in spec
    }
    values |= {key: need(spec, key, bool, place) for key in ("partial", "optional") if key in spec}
    number = spec.get("checkpoint")
    if isinstance(number, int) and not isinstance(number, bool):
        message = f"{place}: 'checkpoint' is {number}, expected text; write it in quotes, as \"01\""
        raise SpecError(message)
    values |= {
        key: need(spec, key, str, place) for key in ("checkpoint", "checklist") if key in spec
    }
    if "visibility" in spec:
        values["visibility"] = _one_of(need(spec, "visibility", str, place), VISIBILITIES, place)
    title = need(spec, "title", str, place)
    return Item(id=name, title=title, points=_positive(spec, "points", place), **values)


def _check_name(name: str, where: str) -> None:
    """Refuse what can head no column of the table of grades."""
    if not name or not name.isprintable() or name != name.strip():
        message = f"{where}: items: {name!r} is no name for an item"
        raise SpecError(message)
    if name.casefold() in COLUMNS:
        message = f"{where}: items: '{name}' is a column of grades.csv; choose another name"
        raise SpecError(message)


def _check_needs(item: Item, names: tuple[str, ...], place: str) -> None:
    """Refuse what does not stand above: an item is judged after those that it needs."""
    above = names[: names.index(item.id)]
    for name in item.needs:
        if name in above:
            continue
        why = f"no item is called that; those above are {', '.join(above) or 'none'}"
        if name == item.id:
            why = "which is the item itself"
        elif name in names:
            why = (
                f"which stands below it; an item may only need items above it, so move '{name}' up"
            )
        message = f"{place}: needs '{name}', {why}"
        raise SpecError(message)


def _check_line(item: Item, place: str) -> None:
    lines = [line.text for line in load_submission().checklist]
    if item.checklist not in lines:
        message = f"{place}: no checklist of the handout has the line '{item.checklist}'"
        raise SpecError(message)


def _check_requirements(
    item: Item, asked: Mapping[str, tuple[Requirement, ...]], place: str
) -> None:
    _one_of(item.checkpoint, tuple(asked), place)
    there = asked[item.checkpoint]
    for key, patterns in (("groups", item.groups), ("requirements", item.requirements)):
        for pattern in patterns:
            name = "group" if key == "groups" else "id"
            if not any(fnmatchcase(getattr(each, name), pattern) for each in there):
                groups = ", ".join(dict.fromkeys(each.group for each in there))
                message = (
                    f"{place}: '{pattern}' in '{key}' is nothing that checkpoint {item.checkpoint} "
                    f"asks for; its groups are {groups}"
                )
                raise SpecError(message)
    if not any(item.asks(requirement) for requirement in there):
        message = f"{place}: its groups and requirements have nothing in common"
        raise SpecError(message)


def _weights(
    data: object, asked: Mapping[str, tuple[Requirement, ...]], where: str
) -> dict[str, float]:
    kinds = tuple(dict.fromkeys(each.kind for found in asked.values() for each in found))
    place = f"{where}: weights"
    given = expect(data, dict, place)
    known_keys(given, kinds, place)
    return dict.fromkeys(kinds, 1.0) | {kind: _positive(given, kind, place) for kind in given}


def _caps(data: object, items: tuple[Item, ...], where: str) -> tuple[Cap, ...]:
    from lab3_usd.check.registry import all_rules  # noqa: PLC0415 - only where a rubric has caps

    caps = []
    for number, spec in enumerate(expect(data, list, f"{where}: 'caps'"), start=1):
        place = f"{where}: cap {number}"
        known_keys(expect(spec, dict, place), ("rules", "items", "at_most", "because"), place)
        rules = texts(spec, "rules", place)
        if not rules:
            message = f"{place}: 'rules' is empty; name the rules whose errors limit the points"
            raise SpecError(message)
        named = texts(spec, "items", place, optional=True)
        for rule in rules:
            _one_of(rule, tuple(all_rules()), place)
        for name in named:
            _one_of(name, tuple(item.id for item in items), place)
        because = need(spec, "because", str, place)
        caps.append(Cap(rules, named, _share(spec, place), because))
    return tuple(caps)


def _late(given: object, where: str) -> Late:
    place = f"{where}: late"
    data = expect(given, dict, place)
    known_keys(data, ("at_most", "students"), place)
    at_most = _share(data, place) if "at_most" in data else 1.0
    return Late(at_most, texts(data, "students", place, optional=True))


def _positive(data: Mapping[str, Any], key: str, place: str) -> float:
    return _between(need(data, key, _NUMBER, place), (_LEAST, _MOST), f"{place}: '{key}'")


def _share(data: Mapping[str, Any], place: str) -> float:
    return _between(need(data, "at_most", _NUMBER, place), (0, 1), f"{place}: 'at_most'")


def _between(value: float, ends: tuple[float, float], place: str) -> float:
    least, most = ends
    if least <= value <= most:
        return float(value)
    try:
        shown = f"{value:g}"
    except OverflowError:
        shown = "a number without end"
    message = f"{place} is {shown}, expected a number from {least:.7g} to {most:.7g}"
    raise SpecError(message)


def _one_of(value: str, known: tuple[str, ...], place: str) -> str:
    if value not in known:
        message = f"{place}: '{value}' is not known; known are {', '.join(known)}"
        raise SpecError(message)
    return value
