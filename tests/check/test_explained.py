"""Every point that is lost is explained: by a finding, or by name inside one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import pytest
from breaking import correct_stage, judged, the_lab
from places import SHARED
from pxr import Usd
from sabotage import graph_faults
from scene_sabotage import scene_sabotage

from lab3_usd.check.checker import judge
from lab3_usd.check.match.graphs import match_all
from lab3_usd.check.match.subject import Roles
from lab3_usd.check.robot.location import relocated_lab, relocated_spec, robot_relocations
from lab3_usd.check.robot.sensors import sensor_relocations
from lab3_usd.model.finding import Finding, Requirement
from lab3_usd.model.stage import StageModel
from lab3_usd.spec.lab import Lab
from lab3_usd.stage.read.opening import open_stage, quiet
from lab3_usd.stage.read.reader import read_model

CORPUS = SHARED / "corpus"
FILES = sorted(path for path in CORPUS.rglob("*") if path.suffix in {".usd", ".usda", ".usdc"})
EVERY = 8  # of the faults of the graphs; all of them take half a minute


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


def left_open(stage: Usd.Stage, checkpoint: str = "05") -> list[str]:
    lab = the_lab()
    with quiet():
        model = read_model(stage, lab, "stage.usda")
    found = judge(lab, lab.checkpoints[checkpoint], model)
    return unexplained(lab, model, found.requirements, found.findings)


@pytest.mark.parametrize("start", range(4))
def test_what_a_fault_of_a_graph_costs_is_explained(start: int) -> None:
    faults = list(graph_faults(the_lab(), the_lab().checkpoints["05"]))
    for fault in faults[start :: EVERY * 4]:
        stage = correct_stage("05")
        fault.break_it(stage)
        assert left_open(stage) == [], fault.name


def test_what_a_fault_of_the_scene_costs_is_explained() -> None:
    for fault in scene_sabotage()[::6]:
        stage = correct_stage("05")
        fault.apply(stage)
        assert left_open(stage) == [], fault.name


@pytest.mark.skipif(not FILES, reason="the corpus of real stages is not beside this checkout")
@pytest.mark.parametrize("checkpoint", ["02", "05", "08"])
def test_what_a_real_stage_loses_is_explained(checkpoint: str) -> None:
    for path in FILES:
        assert left_open(open_stage(path), checkpoint) == [], path.name


def test_a_loss_that_nothing_names_is_noticed() -> None:
    lab = the_lab()
    stage = correct_stage("05")
    graph = lab.graphs["ROS_OdomTF"]
    stage.RemovePrim(f"{graph.path}/isaac_compute_transform_tree")
    found = judged(stage, "05")
    model = read_model(stage, lab, "stage.usda")
    arguments = (lab, model, found.requirements)
    assert unexplained(*arguments, found.findings) == []
    told = [finding for finding in found.findings if finding.rule != "T20"]
    assert {each.partition("/")[0] for each in unexplained(*arguments, told)} == {"TF"}
    assert len(unexplained(*arguments, ())) == sum(
        not requirement.met for requirement in found.requirements
    )


def test_a_frame_that_a_finding_names_is_not_listed_as_lost() -> None:
    graph = the_lab().graphs["ROS_OdomTF"]
    stage = correct_stage("05")
    tree = stage.GetPrimAtPath(f"{graph.path}/isaac_compute_transform_tree")
    targets = tree.GetRelationship("inputs:targetPrims")
    targets.SetTargets([path for path in targets.GetTargets() if path.name != "caster_back_link"])
    rules = {finding.rule for finding in judged(stage, "05").findings}
    assert "T01" in rules
    assert "T20" not in rules
