"""What a lab adds to a problem of any stage: the section that asks for it, and the repair."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from lab3_usd.check.lab_frames import TfView, trees_of_nodes
from lab3_usd.check.match.rule_inputs import GraphSubject, StageSubject
from lab3_usd.check.repairs import edits_at, removal_or_repair
from lab3_usd.model.changes import Edit
from lab3_usd.model.finding import Problem


def with_demand(problem: Problem, subject: Any) -> Problem:
    """Return a problem with the demand of the spec at its site; unchanged if there is none.

    The spec's repair has precedence over the rule's, which is a guess. `subject` is that of the
    rule: a graph with its spec, a stage with all specs, or its transforms.
    """
    if isinstance(subject, TfView):
        return _with_tree(problem, subject)
    sections: list[str] = []
    edits: list[Edit] = []
    graphs = subject.graphs if isinstance(subject, StageSubject) else ()
    for graph in (subject,) if isinstance(subject, GraphSubject) else graphs:
        sections += _sections(problem, graph)
        if problem.property is not None:
            edits += edits_at(graph, f"{problem.prim}.{problem.property}")
    return replace(
        problem,
        handout=problem.handout or next(iter(sections), None),
        fix=tuple(edits) or problem.fix,
    )


def _with_tree(problem: Problem, view: TfView) -> Problem:
    """Return a problem of transforms with the section that asks for the tree.

    A tree that no listener of the lab hears is an extra: what is wrong with it is a warning.
    """
    sent = trees_of_nodes(view).get(problem.prim, ())
    is_extra = bool(sent) and all(map(view.is_beside, sent))
    severity = problem.severity or ("warning" if is_extra else None)
    repair = removal_or_repair(view.subject, problem.prim, problem.property, severity)
    return replace(
        problem,
        handout=problem.handout or (None if problem.property else view.subject.lab.frames.handout),
        severity=severity,
        fix=problem.fix or repair,
    )


def _sections(problem: Problem, subject: GraphSubject) -> Iterator[str]:
    """Yield the section that asks for the property of a problem, else for its node or graph."""
    roles, spec = subject.roles, subject.spec
    if roles.graph is not None and problem.prim == roles.graph.path:  # whatever its property
        yield spec.handout
    role = roles.role_of.get(problem.prim)
    if role is not None:
        node = spec.nodes[role]
        wires = (wire for wire in spec.wires_into(role) if wire.target.port == problem.property)
        settings = (setting for setting in node.settings if setting.port == problem.property)
        targets = (target for target in node.targets if target.port == problem.property)
        yield from (wire.handout for wire in wires)
        yield from (setting.handout for setting in settings)
        yield from (target.handout for target in targets)
        yield from (section for port, section in node.keep if port == problem.property)
        yield node.handout
