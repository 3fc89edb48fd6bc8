"""How Isaac Sim saves and evaluates graph prims, and how `node_types.yaml` says so."""

from __future__ import annotations

from typing import Any

from msgspec import Struct

from lab3_usd.spec.values import Value, typed_value


class GraphAttribute(Struct, frozen=True):
    """An attribute of a graph prim: how it is saved, and which values are as good.

    `unwritten` is what it means that a file leaves it out, None where it must be there.
    """

    name: str
    usd_type: str
    value: Value
    accepted: tuple[Value, ...] = ()
    required: bool = False
    unwritten: Value | None = None
    handout: str | None = None


class Evaluation(Struct, frozen=True, forbid_unknown_fields=True):
    """Which graphs Isaac Sim evaluates while it plays, and which of their nodes compute.

    `mode`, `stage` and `evaluator` are attributes of a graph prim, the lists hold values of theirs.
    A graph whose mode is `by_reference` needs a prim whose relationship `reference` names it; one
    whose stage is `on_demand` needs an event of that stage. In a graph whose evaluator is one of
    `all_nodes` every node computes, in another those that a signal reaches.
    """

    mode: str
    reference: str
    stage: str
    evaluator: str
    by_reference: tuple[str, ...]
    on_demand: tuple[str, ...]
    all_nodes: tuple[str, ...]


class GraphForm(Struct, frozen=True):
    """How Isaac Sim saves graph and node prims."""

    type: str
    node_type: str
    gui_api: str
    attributes: tuple[GraphAttribute, ...]
    evaluation: Evaluation
    ignored_below: tuple[str, ...]

    def ignores(self, path: str) -> bool:
        """Whether the application made what stands at this path, for itself."""
        return any(f"{path}/".startswith(f"{top}/") for top in self.ignored_below)

    def value(self, name: str) -> Value | None:
        """Return the value with which an Action Graph is saved."""
        return next((each.value for each in self.attributes if each.name == name), None)


class _AttributeEntry(Struct, forbid_unknown_fields=True):
    type: str
    value: Any
    accepted: tuple[Any, ...] | None = None
    required: bool = False
    unwritten: Any = None
    handout: str | None = None


class GraphEntry(Struct, forbid_unknown_fields=True):
    """The form of graphs as the file describes it."""

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
            _attribute(name, each, f"{where}: {name}") for name, each in entry.attributes.items()
        ),
        evaluation=entry.evaluation,
        ignored_below=entry.ignored_below,
    )


def _attribute(name: str, entry: _AttributeEntry, where: str) -> GraphAttribute:
    accepted = (entry.value,) if entry.accepted is None else entry.accepted
    unwritten = entry.unwritten
    return GraphAttribute(
        name=name,
        usd_type=entry.type,
        value=typed_value(entry.value, entry.type, where),
        accepted=tuple(typed_value(value, entry.type, where) for value in accepted),
        required=entry.required,
        unwritten=None if unwritten is None else typed_value(unwritten, entry.type, where),
        handout=entry.handout,
    )
