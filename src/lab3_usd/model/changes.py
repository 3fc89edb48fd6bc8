"""Changes as data: differences between stages, and the edits of repairs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

from msgspec import Struct

from lab3_usd.isaac.graph import CORNER, Graph, Node, Variable, Wire
from lab3_usd.isaac.values import Value

if TYPE_CHECKING:
    from lab3_usd.spec.submission import StarterRules


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


class SetType(Struct, frozen=True, tag="set-type", tag_field="edit"):
    """Give a prim another type; what is in it and below it stays."""

    prim: str
    type: str


class Restore(Struct, frozen=True, tag="restore", tag_field="edit"):
    """Make a prim, or one property of it, what it is in the starter or as the lab adds it."""

    prim: str
    property: str | None = None


class AddNode(Struct, frozen=True, omit_defaults=True, tag="add-node", tag_field="edit"):
    """Add a node of a type to a graph, with values and targets of its inputs and no connections.

    `added` are the dynamic inputs that come with it, `kind` names the recipe that brings it.
    """

    prim: str
    type: str
    values: tuple[tuple[str, Value], ...] = ()
    targets: tuple[tuple[str, tuple[str, ...]], ...] = ()
    added: tuple[str, ...] = ()
    place: tuple[float, float] = CORNER
    kind: str = ""

    @classmethod
    def of(cls, prim: str, node: Node, kind: str = "") -> AddNode:
        """Return the edit that adds a planned node."""
        values, targets = tuple(node.values.items()), tuple(node.targets.items())
        # Python 3.10 has several empty tuples, of which msgspec leaves out the default alone.
        return cls(prim, node.type.type, values, targets, node.added or (), node.place, kind)


class AddGraph(Struct, frozen=True, omit_defaults=True, tag="add-graph", tag_field="edit"):
    """Add an Action Graph with all that is in it; `kind` names the recipe that brings it."""

    prim: str
    nodes: tuple[AddNode, ...] = ()
    wires: tuple[Connect, ...] = ()
    variables: tuple[Variable, ...] = ()
    kind: str = ""

    @classmethod
    def of(cls, graph: Graph, kind: str = "") -> AddGraph:
        """Return the edit that adds a planned graph."""
        nodes = tuple(AddNode.of(f"{graph.path}/{n.role}", n, kind) for n in graph.nodes.values())
        wires = tuple(wire_edit(graph.path, w, graph.nodes[w.target.role]) for w in graph.wires)
        return cls(graph.path, nodes, wires, graph.variables, kind)

    @property
    def contents(self) -> tuple[Edit, ...]:
        """The edits that add the nodes and wires to a graph that is there."""
        return (*self.nodes, *self.wires)


def wire_edit(graph: str, wire: Wire, target: Node) -> Connect:
    """Return the edit that makes a planned wire of a graph, which ends at the node `target`."""
    port = target.type.port(wire.target.port)
    source = f"{graph}/{wire.source.role}.{wire.source.port}"
    usd_type = port.usd_type if port is not None else ""
    return Connect(f"{graph}/{target.role}", wire.target.port, usd_type, (source,))


class RemovePrim(Struct, frozen=True, tag="remove-prim", tag_field="edit"):
    """Remove a prim with all that is below it."""

    prim: str


class DropPrim(Struct, frozen=True, tag="drop-prim", tag_field="edit"):
    """Take out what the root layer says of a prim and all below it, whatever other layers say."""

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
    | SetType
    | Restore
    | AddNode
    | AddGraph
    | RemovePrim
    | DropPrim
    | MovePrim
)


def touched(edit: Edit) -> tuple[tuple[str, str], ...]:
    """Return the properties and the schemas that an edit changes, each by its prim and its name.

    One of a whole prim changes none by itself.
    """
    match edit:
        case SetValue() | ClearValue() | Connect() | Retarget():
            names: tuple[str, ...] = (edit.property,)
        case RenameProperty():
            names = (edit.property, edit.to)
        case Restore():
            names = () if edit.property is None else (edit.property,)
        case ApplySchema() | RemoveSchema():
            names = (f"apiSchemas[{edit.schema}]",)
        case _:
            names = ()
    return tuple((edit.prim, name) for name in names)


class Repair(Struct, frozen=True):
    """The edits that repair one finding, with a title.

    A repair is `safe` where it changes values, connections, targets or schemas of prims that are
    there. One that adds, removes or moves prims, or that is only likely what was meant, is done
    only when it is asked for.
    """

    title: str
    edits: tuple[Edit, ...]
    safe: bool = True


_NEEDS_CONSENT = (AddGraph, AddNode, RemovePrim, DropPrim, MovePrim)


def repair_by(edits: tuple[Edit, ...]) -> Repair:
    """Return the repair that makes these edits, safe where none adds, removes or moves a prim."""
    is_safe = not any(
        isinstance(edit, _NEEDS_CONSENT) or (isinstance(edit, Restore) and edit.property is None)
        for edit in edits
    )
    titles = []
    for edit in edits:
        verb = str(type(edit).__struct_config__.tag).replace("-", " ")
        name = getattr(edit, "property", None)
        titles.append(f"{verb} {edit.prim}{f'.{name}' if name else ''}")
    return Repair("; ".join(titles), edits, is_safe)


class TextChange(Struct, frozen=True):
    """Lines of a file to replace; `first` counts from 0, `last` is not included."""

    file: str
    first: int
    last: int
    text: str


# In the order of reports. What comes over ROS follows from what stands above it.
Part = Literal["graph", "node", "value", "wire", "target", "robot", "scene", "topic", "frame"]
PARTS: tuple[Part, ...] = get_args(Part)
ChangeKind = Literal["added", "removed", "changed"]
EDITS: tuple[ChangeKind, ...] = ("removed", "changed", "added")


class StageChange(Struct, frozen=True):
    """One difference between two stages.

    `path` is a prim, named as the second stage names it where both have it; of a topic it is the
    name, of a transform the child frame. `was` and `now` are words for people, '' for nothing.
    """

    part: Part
    edit: ChangeKind
    path: str
    property: str = ""
    was: str = ""
    now: str = ""


class StageDiff(Struct, frozen=True):
    """Two stages by their given names, and all their differences."""

    before: str
    after: str
    changes: tuple[StageChange, ...] = ()


# What a difference is about, the gravest first.
Kind = Literal["type", "schema", "physics", "place", "look", "added"]
KINDS: tuple[Kind, ...] = get_args(Kind)
Site = tuple[str, str | None]


class Difference(Struct, frozen=True):
    """One difference from the starter; `property` is empty for types and schemas."""

    kind: Kind
    property: str
    was: str
    now: str
    physics: bool


class Change(Struct, frozen=True):
    """A prim of the starter that was changed.

    `absent` is the reason why the prim is not in the stage, '' if it is there. `count` is the
    number of absent prims, and `physics` is true if any of them is a collider, body or joint.
    `related` are the targets of its relationships, `body` its rigid body, '' for none.
    """

    prim: str
    type: str
    differences: tuple[Difference, ...] = ()
    absent: str = ""
    count: int = 1
    physics: bool = False
    related: tuple[str, ...] = ()
    body: str = ""


class StarterSubject(Struct, frozen=True):
    """A stage beside the starter it was made from.

    `faulty_sites` holds the sites where other rules have found an error already, `related_prims`
    the prims that an error relates to: one of them that is absent is reported as moved.
    `supplied` are the changed prims that stand where the starter has something: only they can be
    restored. `shaped` and `placed` are requirements by prim, which a change of the shapes below the
    prim fails, or of the frames of the joint.
    """

    rules: StarterRules
    changes: tuple[Change, ...]
    faulty_sites: frozenset[Site] = frozenset()
    related_prims: frozenset[str] = frozenset()
    supplied: frozenset[str] = frozenset()
    shaped: Mapping[str, str] = {}
    placed: Mapping[str, str] = {}
