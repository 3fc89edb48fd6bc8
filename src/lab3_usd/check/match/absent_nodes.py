"""Prims of the file that are missing from a graph: why, and where they are."""

from __future__ import annotations

from lab3_usd.check.match.result import Roles
from lab3_usd.check.match.subject import GraphSubject
from lab3_usd.model.absent_prims import nodes_outside_graphs
from lab3_usd.model.stage import ELSEWHERE, OUTSIDE, AbsentPrim, StageModel
from lab3_usd.spec.catalog import Catalog
from lab3_usd.spec.graph import GraphSpec, NodeSpec


def missing_roles(spec: GraphSpec, roles: Roles) -> list[NodeSpec]:
    """Return the roles that no node plays and no node of another type stands in for."""
    if roles.graph is None:
        return []
    return [
        each
        for role, each in spec.nodes.items()
        if roles.node_of[role] is None and role not in roles.retyped
    ]


def absent_nodes(
    spec: GraphSpec, roles: Roles, stage: StageModel, catalog: Catalog
) -> dict[str, AbsentPrim]:
    """Pair missing roles with prims of their type that are in the file but not in the graph.

    A prim that is named like a role is that role's before it may be another's.
    """
    outside = (
        AbsentPrim(node.path, node.type_name, OUTSIDE) for node in nodes_outside_graphs(stage)
    )
    offers = [*(() if roles.graph is None else roles.graph.absent), *outside]
    found: dict[str, AbsentPrim] = {}
    for must_be_named in (True, False):
        for each in missing_roles(spec, roles):
            for offer in offers if each.role not in found else ():
                is_named = offer.path.endswith(f"/{each.role}")
                fits = catalog.get(offer.type_name) is each.type
                if fits and (is_named or not must_be_named):
                    found[each.role] = offer
                    offers.remove(offer)
                    break
    return found


def in_another_graph(spec: NodeSpec, subject: GraphSubject) -> AbsentPrim | None:
    """Return the only node of a type that is in another graph, and that no other role asks for."""
    asked = [node for graph in subject.lab.graphs.values() for node in graph.nodes.values()]
    found = [
        node
        for graph in subject.stage.graphs
        for node in (() if graph is subject.roles.graph else graph.nodes)
        if node.type is spec.type
    ]
    if len(found) != 1 or sum(each.type is spec.type for each in asked) != 1:
        return None
    return AbsentPrim(found[0].path, found[0].type_name, ELSEWHERE)
