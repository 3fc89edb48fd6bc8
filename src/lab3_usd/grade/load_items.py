"""Loads the items of a rubric, and refuses those that could not be judged."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Any

from lab3_usd.check.finding import Requirement
from lab3_usd.errors import SpecError
from lab3_usd.grade.load_values import one_of, positive
from lab3_usd.grade.rubric import COLUMNS, VISIBILITIES, Item
from lab3_usd.spec.loader import load_lab
from lab3_usd.spec.yaml_file import expect, known_keys, need, texts

_ITEM_KEYS = (
    "title", "points", "checkpoint", "groups", "requirements", "checklist",
    "partial", "optional", "needs", "visibility",
)  # fmt: skip


def load_items(
    data: Mapping[str, Any], asked: Mapping[str, tuple[Requirement, ...]], where: str
) -> tuple[Item, ...]:
    """Return the items of a rubric in their order, given everything that each checkpoint asks for.

    Raises:
        SpecError: there is none, or one is wrong; the line names it, and opens with `where`.
    """
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
        values["visibility"] = one_of(need(spec, "visibility", str, place), VISIBILITIES, place)
    title = need(spec, "title", str, place)
    return Item(id=name, title=title, points=positive(spec, "points", place), **values)


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
    lines = [line.text for line in load_lab().submission.checklist]
    if item.checklist not in lines:
        message = f"{place}: no checklist of the handout has the line '{item.checklist}'"
        raise SpecError(message)


def _check_requirements(
    item: Item, asked: Mapping[str, tuple[Requirement, ...]], place: str
) -> None:
    one_of(item.checkpoint, tuple(asked), place)
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
