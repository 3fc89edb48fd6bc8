"""How Isaac Sim saves graphs, and which of them it evaluates."""

from __future__ import annotations

from msgspec import Struct

from lab3_usd.isaac.values import Value

VARIABLE = "graph:variable:"  # how the attributes of a graph begin that hold its variables


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
    """The graphs that Isaac Sim evaluates, and the nodes that compute.

    `mode`, `stage` and `evaluator` are attributes of a graph. A graph whose mode is in
    `by_reference` needs a prim whose relationship `reference` names it; a target of the name
    `placeholder` is that prim, or the graph itself. A graph whose stage is in
    `on_demand` needs an event of that stage. With an evaluator of `all_nodes` every node computes,
    otherwise those that a signal reaches.
    """

    mode: str
    reference: str
    placeholder: str
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
        is_near = path.startswith(self.ignored_below)  # which most paths are not
        return is_near and any(f"{path}/".startswith(f"{top}/") for top in self.ignored_below)

    def value(self, name: str) -> Value | None:
        """Return the value with which an Action Graph is saved."""
        return next((each.value for each in self.attributes if each.name == name), None)
