"""What the rules of a stage are given: the spec, the stage, and which prim plays which role."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Protocol

from msgspec import Struct, field

from lab3_usd.check.match.result import Roles, WireFault
from lab3_usd.model.finding import Finding, Requirement
from lab3_usd.model.stage import Node, StageModel
from lab3_usd.spec.graph import GraphSpec, NodeSpec
from lab3_usd.spec.lab import Checkpoint, Lab


class ModelSubject(Protocol):
    """A stage, whatever is asked of it."""

    @property
    def stage(self) -> StageModel:
        """The stage."""


class GraphSubject(Struct, frozen=True, eq=False):
    """One graph of the spec beside its graph in the stage.

    `live_nodes` holds the live nodes of the whole stage by path, `wire_faults` what is wrong with
    the wires of this graph. `missing_with` is the prim that the graph is missing together with,
    whose own finding names it.
    """

    lab: Lab
    checkpoint: Checkpoint
    spec: GraphSpec
    roles: Roles
    stage: StageModel
    live_nodes: Mapping[str, Node]
    wire_faults: tuple[WireFault, ...] = ()
    missing_with: str = ""

    def matched(self) -> Iterator[tuple[Node, NodeSpec]]:
        """Yield each role that a node plays, the node first."""
        for role, spec in self.spec.nodes.items():
            node = self.roles.node_of[role]
            if node is not None:
                yield node, spec


class StageSubject(Struct, frozen=True, eq=False):
    """The whole stage at one checkpoint.

    `faulty_prims` holds the prims that already have an error from the rules of their graph: what
    follows from that error is not said again. `relocations` maps where the handout has the robot
    and its links to where they stand instead; `lab` reads as if they belonged there.
    `missing_graphs` maps each graph that is missing together with a prim to that prim, whose
    finding names the graph.
    """

    lab: Lab
    checkpoint: Checkpoint
    stage: StageModel
    roles: Mapping[str, Roles]
    faulty_prims: frozenset[str] = frozenset()
    relocations: Mapping[str, str] = field(default_factory=dict)
    missing_graphs: Mapping[str, str] = field(default_factory=dict)


class Outcome(Struct, frozen=True, eq=False):
    """What came out of judging a stage: what was asked of it, and everything that was found."""

    subject: StageSubject
    requirements: tuple[Requirement, ...]
    findings: tuple[Finding, ...]
