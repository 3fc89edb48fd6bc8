"""A repair as data: what has to change in a stage so that one finding is settled."""

from __future__ import annotations

from typing import TypeAlias

from msgspec import Struct

from lab3_usd.spec.catalog import Value


class SetValue(Struct, frozen=True, tag="set", tag_field="edit"):
    """Give an attribute this value; it keeps its own type where that can hold the value."""

    prim: str
    property: str
    type: str
    value: Value


class ClearValue(Struct, frozen=True, tag="clear", tag_field="edit"):
    """Leave a property to its default: no value, no targets."""

    prim: str
    property: str


class Connect(Struct, frozen=True, tag="connect", tag_field="edit"):
    """Connect an input to these property paths and to nothing else; to none, disconnect it."""

    prim: str
    property: str
    type: str
    sources: tuple[str, ...] = ()


class Retarget(Struct, frozen=True, tag="retarget", tag_field="edit"):
    """Let a relationship name these prims and no others."""

    prim: str
    property: str
    targets: tuple[str, ...] = ()


class RenameProperty(Struct, frozen=True, tag="rename-property", tag_field="edit"):
    """Give a property that is misspelt its right name, with what it holds."""

    prim: str
    property: str
    to: str


class ApplySchema(Struct, frozen=True, tag="apply-schema", tag_field="edit"):
    """Apply an API schema to a prim."""

    prim: str
    schema: str


class RemoveSchema(Struct, frozen=True, tag="remove-schema", tag_field="edit"):
    """Take an API schema off a prim."""

    prim: str
    schema: str


class Activate(Struct, frozen=True, tag="activate", tag_field="edit"):
    """Let a prim be active and defined."""

    prim: str


class Restore(Struct, frozen=True, tag="restore", tag_field="edit"):
    """Make a prim, or one property of it, what it is in the starter or as the lab adds it."""

    prim: str
    property: str | None = None


class AddNode(Struct, frozen=True, tag="add-node", tag_field="edit"):
    """Add the node that plays a role of a graph of the lab, without connections."""

    prim: str
    graph: str
    role: str


class AddGraph(Struct, frozen=True, tag="add-graph", tag_field="edit"):
    """Add a whole graph of the lab."""

    prim: str
    graph: str


class RemovePrim(Struct, frozen=True, tag="remove-prim", tag_field="edit"):
    """Remove a prim with all that is below it."""

    prim: str


class MovePrim(Struct, frozen=True, tag="move-prim", tag_field="edit"):
    """Move or rename a prim; what names it follows."""

    prim: str
    to: str


Edit: TypeAlias = (
    SetValue
    | ClearValue
    | Connect
    | Retarget
    | RenameProperty
    | ApplySchema
    | RemoveSchema
    | Activate
    | Restore
    | AddNode
    | AddGraph
    | RemovePrim
    | MovePrim
)


class Repair(Struct, frozen=True):
    """The edits that settle one finding, with a title for people.

    A repair is `safe` where it changes values, connections, targets or schemas of prims that are
    there. One that adds, removes or moves prims is done only when it is asked for.
    """

    title: str
    edits: tuple[Edit, ...]
    safe: bool = True


class TextChange(Struct, frozen=True):
    """Lines of a file that give way to others; `first` counts from 0, `last` is not included."""

    file: str
    first: int
    last: int
    text: str
