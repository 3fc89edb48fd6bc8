"""What rules say, in the names that the file has for ports that another release calls otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import StageModel, once_per_stage


def as_written(problem: Problem, stage: StageModel) -> Problem:
    """Return a problem with the names that its file has: in its place, words and edits."""
    written = _written_ports(stage)
    if not written:
        return problem
    names = written.get(problem.prim, {})
    message = problem.message
    for name, other in names.items():
        message = message.replace(name, other)
    return replace(
        problem,
        message=message,
        property=names.get(problem.property or "", problem.property),
        fix=tuple(_edit_as_written(edit, written) for edit in problem.fix),
    )


@once_per_stage
def _written_ports(stage: StageModel) -> dict[str, Mapping[str, str]]:
    """Return the names that the file has for ports, by node, of those that have such names."""
    return {node.path: node.written_ports for node in stage.nodes() if node.written_ports}


def _edit_as_written(edit: Any, written: Mapping[str, Mapping[str, str]]) -> Any:
    names = written.get(edit.prim, {})
    changes: dict[str, Any] = {}
    if getattr(edit, "property", None) in names:
        changes["property"] = names[edit.property]
    if getattr(edit, "to", None) in names:
        changes["to"] = names[edit.to]
    if getattr(edit, "sources", ()):
        changes["sources"] = tuple(_source_as_written(path, written) for path in edit.sources)
    return replace(edit, **changes) if changes else edit


def _source_as_written(path: str, written: Mapping[str, Mapping[str, str]]) -> str:
    prim, _, port = path.rpartition(".")
    return f"{prim}.{written.get(prim, {}).get(port, port)}"
