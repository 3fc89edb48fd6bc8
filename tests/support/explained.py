"""Which points are lost without that a finding speaks of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from lab3_usd.check.match.graphs import match_all
from lab3_usd.check.match.rule_inputs import Roles
from lab3_usd.check.robot.location import relocated_lab, relocated_spec, robot_relocations
from lab3_usd.check.robot.sensors import sensor_relocations
from lab3_usd.model.finding import Finding, Requirement
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.lab import Lab


def unexplained(
    lab: Lab,
    stage: StageModel,
    requirements: Iterable[Requirement],
    findings: Iterable[Finding],
) -> list[str]:
    """Return the ids of the unmet requirements that no finding speaks of."""
    told = list(findings)
    placed = relocated_lab(lab, robot_relocations(lab, stage))
    relocations = sensor_relocations(placed, stage)
    specs = {name: relocated_spec(spec, relocations) for name, spec in placed.graphs.items()}
    roles = match_all(specs, stage)
    return [
        requirement.id
        for requirement in requirements
        if not requirement.met and not any(_speaks(found, requirement, roles) for found in told)
    ]


def _speaks(found: Finding, asked: Requirement, roles: Mapping[str, Roles]) -> bool:
    if asked.kind == "scene":
        return found.severity == "error"  # met unless an error concerns it
    if asked.kind == "frame":
        return _speaks_of_frame(found, asked.id.rpartition("/")[2])
    if _names_graph(found, asked.group):
        return True
    ends = list(_ends(asked))
    own = roles[asked.group]
    if any(_says_gone(found, role, own) for role, _ in ends):
        return True
    return asked.kind != "node" and any(_names(found, role, port, own) for role, port in ends)


def _names_graph(found: Finding, name: str) -> bool:
    if found.rule == "G01":
        return f"graph {name} is missing" in found.message
    return name in found.message.partition("; missing with it: ")[2].split(", ")


def _ends(asked: Requirement) -> Iterator[tuple[str, str]]:
    """Yield the roles and ports that a requirement of a graph is about."""
    ends = asked.title.split(" -> ") if asked.kind == "wire" else [asked.id.rpartition("/")[2]]
    for end in ends:
        role, _, port = end.partition(".")
        yield role, port


def _says_gone(found: Finding, role: str, roles: Roles) -> bool:
    if found.rule == "N01":
        return roles.graph is not None and (
            found.prim == roles.graph.path and f"({role})" in found.message
        )
    other = roles.retyped.get(role)
    return found.rule == "N03" and other is not None and found.prim == other.path


def _names(found: Finding, role: str, port: str, roles: Roles) -> bool:
    node = roles.node_of[role]
    if node is None:
        return False
    site = f"{node.path}.inputs:{port}"
    return site == f"{found.prim}.{found.property}" or site in found.related


def _speaks_of_frame(found: Finding, frame: str) -> bool:
    return frame in f"{found.prim} {found.message} {found.expected}"
