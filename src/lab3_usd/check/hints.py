"""Hints that name the graph and the node as the editor of Isaac Sim shows them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.model.finding import Finding
from lab3_usd.model.formatting import node_title
from lab3_usd.model.stage import Node

_THE_NODE = "the node"


def with_named_nodes(findings: Iterable[Finding], nodes: Mapping[str, Node]) -> Iterator[Finding]:
    """Yield findings; the hint of one about a node says which node of which graph.

    `nodes` are those of the stage by path. Of two alike in one graph the name of the prim stands
    in brackets behind the title.
    """
    findings = tuple(findings)
    if not any(each.hint for each in findings):
        yield from findings
        return
    alike = Counter((_graph(path), node_title(node)) for path, node in nodes.items())
    graphs = {_graph(path) for path in nodes}
    for finding in findings:
        node = nodes.get(finding.prim)
        if node is None or not finding.hint:
            yield finding
            continue
        title, name = node_title(node), finding.prim.rpartition("/")[2]
        shown = title
        if alike[_graph(finding.prim), title] > 1:
            shown = f"{title} ({name})"
        yield replace(finding, hint=_named(finding.hint, title, shown, _graph_of(finding, graphs)))


def _named(hint: str, title: str, shown: str, graph: str) -> str:
    if f"{title} (" not in hint:
        hint = hint.replace(title, shown, 1)
    hint = hint.replace(_THE_NODE, shown, 1) if shown not in hint else hint
    return hint if graph in hint else f"in {graph}, {hint}"


def _graph(path: str) -> str:
    return path.rpartition("/")[0]


def _graph_of(finding: Finding, graphs: Collection[str]) -> str:
    return shown_graph(_graph(finding.prim), graphs)


def shown_graph(path: str, graphs: Iterable[str]) -> str:
    """Return the name of a graph as the editor shows it, its path where another has that name."""
    name = path.rpartition("/")[2]
    alike = any(each != path and each.rpartition("/")[2] == name for each in graphs)
    return path if alike else name
