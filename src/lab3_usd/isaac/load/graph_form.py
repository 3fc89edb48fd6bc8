"""Loads how Isaac Sim saves graphs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from lab3_usd.isaac.graph_form import Evaluation, GraphAttribute, GraphForm
from lab3_usd.isaac.values import typed_value
from lab3_usd.yaml_file import as_record


class _AttributeEntry(Struct, forbid_unknown_fields=True):
    type: str
    value: Any
    accepted: tuple[Any, ...] | None = None
    required: bool = False
    unwritten: Any = None
    handout: str | None = None


class GraphEntry(Struct, forbid_unknown_fields=True):
    """The attributes of a graph."""

    type: str
    node_type: str
    gui_api: str
    attributes: dict[str, _AttributeEntry]
    evaluation: Evaluation
    ignored_below: tuple[str, ...]


def graph_form(entry: GraphEntry, where: str) -> GraphForm:
    """Return the form of graphs.

    Raises:
        SpecError: a value is not of its type; the line opens with `where`.
    """
    return GraphForm(
        type=entry.type,
        node_type=entry.node_type,
        gui_api=entry.gui_api,
        attributes=tuple(
            _attribute(name, attribute, f"{where}: {name}")
            for name, attribute in entry.attributes.items()
        ),
        evaluation=entry.evaluation,
        ignored_below=entry.ignored_below,
    )


def _attribute(name: str, entry: _AttributeEntry, place: str) -> GraphAttribute:
    usd_type, unwritten = entry.type, entry.unwritten
    accepted = (entry.value,) if entry.accepted is None else entry.accepted
    return GraphAttribute(
        name=name,
        usd_type=usd_type,
        value=typed_value(entry.value, usd_type, place),
        accepted=tuple(typed_value(value, usd_type, place) for value in accepted),
        required=entry.required,
        unwritten=None if unwritten is None else typed_value(unwritten, usd_type, place),
        handout=entry.handout,
    )


def attribute_over(
    attribute: GraphAttribute, said: Mapping[str, Any], where: str
) -> GraphAttribute:
    """Return an attribute with what a lab says of it.

    Raises:
        SpecError: it says something else than attributes have; the line opens with `where`.
    """
    base = {
        "type": attribute.usd_type,
        "value": attribute.value,
        "accepted": attribute.accepted,
        "required": attribute.required,
        "unwritten": attribute.unwritten,
        "handout": attribute.handout,
    }
    return _attribute(attribute.name, as_record({**base, **said}, _AttributeEntry, where), where)
