"""What the rules of a stage are given: the spec, the stage, and which prim plays which role."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from msgspec import Struct, field

from lab3_usd.check.model import GraphModel, Node, StageModel
from lab3_usd.spec.spec import Checkpoint, GraphSpec, Lab

if TYPE_CHECKING:
    from lab3_usd.check.finding import Finding, Requirement
    from lab3_usd.check.wire_fault import WireFault


class Roles(Struct, frozen=True):
    """Which node of a stage plays which role of a graph spec.

    `graph` is None when the stage holds nothing that could be the graph. `stand_ins` maps a node
    that does the work of another (a second context with the same settings) to the role it may
    stand in for; `retyped` holds, for a role without a node, the node of another type that stands
    in its place; `extra` are the nodes that play no role. `together` names the graphs of the lab
    that one graph of the stage holds, where it holds several.
    """

    graph: GraphModel | None
    node_of: Mapping[str, Node | None]
    role_of: Mapping[str, str]
    stand_ins: Mapping[str, str] = field(default_factory=dict)
    extra: tuple[Node, ...] = ()
    retyped: Mapping[str, Node] = field(default_factory=dict)
    together: tuple[str, ...] = ()


class GraphSubject(Struct, frozen=True, eq=False):
    """One graph of the spec beside its graph in the stage.

    `live` holds the live nodes of the whole stage by path, `wire_faults` what is wrong with the
    wires of this graph. `lost_with` is the prim that the graph is missing together with, whose own
    finding names it.
    """

    lab: Lab
    checkpoint: Checkpoint
    spec: GraphSpec
    roles: Roles
    stage: StageModel
    live: Mapping[str, Node]
    wire_faults: tuple[WireFault, ...] = ()
    lost_with: str = ""


class StageSubject(Struct, frozen=True, eq=False):
    """The whole stage at one checkpoint.

    `blamed` holds the prims that already have an error from the rules of their graph: what
    follows from that error is not said again. `homes` maps where the handout has the robot and
    its links to where they stand instead; `lab` reads as if they belonged there. `lost` maps each
    graph that is missing together with a prim to that prim, whose finding names the graph.
    """

    lab: Lab
    checkpoint: Checkpoint
    stage: StageModel
    roles: Mapping[str, Roles]
    blamed: frozenset[str] = frozenset()
    homes: Mapping[str, str] = field(default_factory=dict)
    lost: Mapping[str, str] = field(default_factory=dict)


class Outcome(Struct, frozen=True, eq=False):
    """What came out of judging a stage: what was asked of it, and everything that was found."""

    subject: StageSubject
    requirements: tuple[Requirement, ...]
    findings: tuple[Finding, ...]
