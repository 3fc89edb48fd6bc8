"""Rules about names that nodes are given as texts: variables, paths of prims, properties."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.likely_names import did_you_mean, likely_name, likely_port
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.stalled_nodes import feeds
from lab3_usd.facts.stuck_nodes import is_made_later
from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.finding import Problem, display
from lab3_usd.model.joint_drives import DRIVE, drive_prefix
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import Node, StageModel, absence_reason

# Inputs of Kit's nodes that read or write a prim, by the pages of Read and Write Prim Attribute:
# the prim itself, or its path where that is to be used, and the property.
_PRIM, _PATH, _BY_PATH, _PROPERTY = (
    INPUT + name for name in ("prim", "primPath", "usePath", "name")
)
_OF_DRIVES = "drive:"
# UsdPhysics, PhysicsDriveAPI
_DRIVE_NAMES = ("damping", "maxForce", "stiffness", "targetPosition", "targetVelocity", "type")


@rule("K99", "unknown-name", scope="lint")
def unknown_name(subject: LintSubject) -> Iterator[Problem]:
    """A node names a variable, prim or property that does not exist.

    Why: it reads nothing, writes nothing, or never signals; what depends on it gets no value. A
    script of the stage can make variables while it runs: then it is a warning.

    Fix: correct the name, or create the variable in Window > Graph Editors > Variables.

    Example: Write Prim Attribute with `inputs:primPath = "/World/Rovr"`, a robot called
    `/World/Rover`.
    """
    for node in subject.live.values():
        if node.type is None or not (subject.runs(node.path) or feeds(node, subject.stage)):
            continue
        if node.type.variable:
            yield from _variable(node, node.type.variable[0], subject)
        elif node.has_port(_BY_PATH) and node.has_port(_PATH):
            yield from _prim_and_property(node, subject)


def _variable(node: Node, port: str, subject: LintSubject) -> Iterator[Problem]:
    """Yield that the graph of a node has no variable of the name that it reads or sets."""
    name = effective_value(node, port, subject.live)
    variables = _variables(node.path, subject.stage)
    if not isinstance(name, str) or name in variables:
        return
    near, stage = likely_name(name, variables), subject.stage
    # Nothing of a scene makes variables in the graphs that a script makes.
    missing = (stage.unknown_node if stage.build else stage.unknown)(node.path)
    what = f"is {display(name)}, which is not a variable of its graph{did_you_mean(near)}"
    yield Problem(
        node.path,
        f"{port} {what if name else 'is empty: it names no variable of its graph'}",
        property=port,
        expected=near or ", ".join(variables) or "a variable of the graph",
        actual=name,
        severity="warning" if stage.scripts else None,
        rests_on=stage.unknown_inputs(node) or missing,
    )


def _variables(path: str, stage: StageModel) -> list[str]:
    """Return the variables of the graphs around a node: a compound is a graph in a graph."""
    above = {*upwards(path)}
    graphs = (graph for graph in stage.graphs if graph.path in above)
    return [
        name.removeprefix(VARIABLE)
        for graph in graphs
        for name in (*graph.attributes, *(VARIABLE + own for own in graph.variables))
        if name.startswith(VARIABLE)
    ]


def _prim_and_property(node: Node, subject: LintSubject) -> Iterator[Problem]:
    """Yield that there is no prim at a path, or that its property is misspelt."""
    path = next(iter(node.targets(_PRIM)), "")
    if effective_value(node, _BY_PATH, subject.live) is True:
        written = effective_value(node, _PATH, subject.live)
        path = written if isinstance(written, str) else ""
        if path and subject.stage.prim(path) is None and not is_made_later(path, subject.stage):
            is_path = path.startswith("/")
            reason = absence_reason(subject.stage, path) if is_path else "is not a path of a prim"
            yield Problem(
                node.path,
                f"{_PATH} is {display(path)}, which {reason}",
                property=_PATH,
                expected="the path of a prim",
                actual=path,
                severity="warning" if subject.is_module else None,
                rests_on=subject.stage.unknown(path) if is_path else None,
            )
    prim, name = subject.stage.prim(path), effective_value(node, _PROPERTY, subject.live)
    if prim is None or not isinstance(name, str) or not name or name in _properties(prim):
        return
    # A name that is in no file may be of a schema: not every other one is misspelt.
    ports = {f"{INPUT}{own}": own for own in _properties(prim)}
    near = ports.get(likely_port(INPUT + name, [*ports]) or "")
    if near or name.startswith(_OF_DRIVES):
        yield Problem(
            node.path,
            f"{_PROPERTY} is {display(name)}, and {path} has no such property{did_you_mean(near)}",
            property=_PROPERTY,
            expected=near or "a property of the prim",
            actual=name,
            rests_on=subject.stage.unknown(path),
        )


def _properties(prim: Prim) -> list[str]:
    """Return the properties of a prim that its file has, and those of its drives."""
    kinds = (api.removeprefix(f"{DRIVE}:") for api in prim.apis if api.startswith(f"{DRIVE}:"))
    driven = (drive_prefix(kind) + name for kind in kinds for name in _DRIVE_NAMES)
    return [*prim.attributes, *prim.relationships, *driven]
