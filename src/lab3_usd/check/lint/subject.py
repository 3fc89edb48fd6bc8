"""What the rules of the linter are given: a stage, and everything known of Isaac Sim's nodes."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.check.ros.running import Nodes, live_nodes, run_states
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.spec.catalog import Catalog
from lab3_usd.spec.isaac import IsaacTypes
from lab3_usd.spec.lab import Lab


class LintSubject(Struct, frozen=True, eq=False):
    """A stage without a spec. Of the lab only its facts about Isaac Sim and ROS are asked."""

    lab: Lab
    types: IsaacTypes
    stage: StageModel
    release: str

    @property
    def catalog(self) -> Catalog:
        """The node types of the release by which the stage is judged."""
        return self.lab.catalog

    @property
    def live(self) -> Nodes:
        """The nodes of all active graphs by path."""
        return live_nodes(self.stage, self.lab)

    def runs(self, path: str) -> bool:
        """Whether a node runs, or may run, while the timeline plays."""
        return path in run_states(self.stage, self.lab)

    def graphs(self) -> Iterator[GraphModel]:
        """Yield the graphs that no application made for itself, in the scene or not."""
        ignores = self.catalog.graph.ignores
        return (graph for graph in self.stage.graphs if not ignores(graph.path))

    def title(self, node: Node) -> str:
        """Return what a node is called in the graph editor."""
        return node.type.ui_name if node.type is not None else node.type_name or "a node"

    def is_open(self, path: str) -> bool:
        """Whether an asset that cannot be found could say otherwise of the prim at a path."""
        return self.stage.unresolved_above(path) is not None
