"""Loads the items of a rubric, and refuses those that could not be judged."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase
from typing import Any

from lab3_usd.errors import SpecError
from lab3_usd.grade.scoring.rubric import COLUMNS, Item
from lab3_usd.model.finding import Requirement
from lab3_usd.spec.load.records import records


def load_items(
    data: Mapping[str, Mapping[str, Any]],
    asked: Mapping[str, tuple[Requirement, ...]],
    lines: Collection[str],
    where: str,
) -> tuple[Item, ...]:
    """Return the items of a rubric in their order.

    `asked` is everything that each checkpoint asks for, `lines` are the texts of the checklists.

    Raises:
        SpecError: there is none, or one is wrong; the line names it, and opens with `where`.
    """
    if not data:
        message = f"{where}: 'items' is empty; a rubric needs at least one"
        raise SpecError(message)
    items = records(data, Item, where, "id")
    for name, item in items.items():
        _check_name(name, where)
        place = f"{where}: {name}"
        if bool(item.checkpoint) == bool(item.checklist):
            message = f"{place}: give either 'checkpoint' or 'checklist'"
            raise SpecError(message)
        _check_needs(item, tuple(data), place)
        if item.checklist:
            _check_line(item, lines, place)
        else:
            _check_requirements(item, asked, place)
    return tuple(items.values())


def one_of(value: str, known: Collection[str], place: str) -> None:
    """Refuse a value that is not one of the `known`.

    Raises:
        SpecError: it is not; the message names them.
    """
    if value not in known:
        message = f"{place}: {value!r} is not known; known are {', '.join(known)}"
        raise SpecError(message)


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


def _check_line(item: Item, lines: Collection[str], place: str) -> None:
    if item.checklist not in lines:
        message = f"{place}: no checklist of the handout has the line '{item.checklist}'"
        raise SpecError(message)


def _check_requirements(
    item: Item, asked: Mapping[str, tuple[Requirement, ...]], place: str
) -> None:
    one_of(item.checkpoint, asked, place)
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
