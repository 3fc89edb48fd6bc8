"""Judges one stage at one checkpoint: matches its graphs and runs the rules."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.check.fold import fold
from lab3_usd.check.lab_frames import tf_views
from lab3_usd.check.match.diagnosis import faulty_wires
from lab3_usd.check.match.graphs import match_all, with_literals
from lab3_usd.check.match.rule_inputs import GraphSubject, JudgedStage, LintSubject, StageSubject
from lab3_usd.check.message_suffixes import with_named_nodes
from lab3_usd.check.registry import Scope, import_rules, in_tree, own_rules, rules_of
from lab3_usd.check.requirements import (
    frame_requirements,
    graph_requirements,
    nested_nodes,
    scene_requirements,
    with_costs,
    with_named_faults,
    with_other_faults,
    with_unknown,
    with_unmet,
)
from lab3_usd.check.robot.location import (
    is_root_articulated,
    relocated_lab,
    relocated_spec,
    robot_relocations,
)
from lab3_usd.check.robot.sensors import sensor_relocations
from lab3_usd.check.rule_runs import RuleResults, run_rules
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.reaching_values import LiveNodes
from lab3_usd.model.finding import Crash, Finding, NotJudged, id_order
from lab3_usd.model.stage import Node, StageModel
from lab3_usd.spec.lab import Checkpoint, Lab, articulated_at_roots

GRAPH_FAMILIES = ("G", "N", "P", "R", "W")
# Some have rules of both scopes.
STAGE_FAMILIES = ("F", "S", "L", "C", "D", "T", "Q", "G", "N", "P")

import_rules(*GRAPH_FAMILIES, *STAGE_FAMILIES)


def judge(lab: Lab, checkpoint: Checkpoint, stage: StageModel) -> RuleResults:
    """Run every rule over a stage, which is read as they ask.

    Raises:
        StageError: the file turns out to be damaged.
    """
    try:
        lab = lab.at(checkpoint.id)
        live = LiveNodes(stage.nodes(), live_nodes(stage).variables)
        relocations = robot_relocations(lab, stage)
        placed = relocated_lab(lab, relocations)
        at_root = [robot for robot in placed.scene.robots if is_root_articulated(robot, stage)]
        placed = articulated_at_roots(placed, at_root)
        subjects = tuple(_graph_subjects(placed, checkpoint, stage, live))
        run = _Run()
        run.keep(run_rules(rules_of("graph", *GRAPH_FAMILIES), subjects, lab))
        whole = StageSubject(
            lab=placed,
            checkpoint=checkpoint,
            stage=stage,
            roles={subject.spec.name: subject.roles for subject in subjects},
            relocations=relocations,
            graphs=subjects,
        )
        scopes: tuple[Scope, ...] = ("stage", "robot", "world")
        of_stage = [each for scope in scopes for each in rules_of(scope, *STAGE_FAMILIES)]
        of_stage = [*rules_of("model", "F"), *sorted(of_stage, key=lambda rule: id_order(rule.id))]
        run.keep(run_rules(of_stage, [whole], lab))
        if checkpoint.frames:
            trees = placed.frames.trees or (None,)
            for tree, view in zip(trees, tf_views(whole), strict=True):
                of_frames = run_rules(rules_of("frames", *STAGE_FAMILIES), [view], lab)
                run.keep(of_frames if tree is None else _of_tree(of_frames, tree.topic))
        run.findings[:] = with_unmet(fold(run.findings), whole, lab)
        requirements = [item for subject in subjects for item in graph_requirements(subject)]
        requirements += scene_requirements(lab, checkpoint)
        requirements += frame_requirements(whole)
        requirements = with_named_faults(requirements, run.findings)
        judged_stage = JudgedStage(whole, tuple(requirements), tuple(run.findings))
        run.keep(run_rules(rules_of("requirements", *STAGE_FAMILIES), [judged_stage], lab))
        findings = tuple(with_named_nodes(run.findings, live))
        graphs = {subject.spec.name: subject.roles.graph for subject in subjects}
        judged = with_other_faults(judged_stage.requirements, findings, graphs)
        count = len(run.findings)
        run.keep(run_rules(own_rules().values(), [LintSubject(stage)], lab))
        return RuleResults(
            (*with_costs(findings, subjects, placed), *run.findings[count:]),
            tuple(run.crashes),
            tuple(run.not_judged),
            (*_gaps(placed, stage, run.not_judged), *_nested_nodes(subjects)),
            requirements=with_unknown(judged, run.left_open, whole, lab),
        )
    finally:
        stage.judged.clear()  # which holds what the rules were given, and so the stage


def _of_tree(results: RuleResults, topic: str) -> RuleResults:
    """Return what was found in one of several trees, at the places of its own frames."""

    def placed(finding: Finding) -> Finding:
        unmet = tuple(in_tree(place, topic) for place in finding.unmet)
        covers = tuple((in_tree(place, topic), name) for place, name in finding.covers)
        return replace(finding, unmet=unmet, covers=covers)

    findings, left = (tuple(map(placed, each)) for each in (results.findings, results.left_open))
    return replace(results, findings=findings, left_open=left)


def _gaps(lab: Lab, stage: StageModel, left_open: Iterable[NotJudged]) -> Iterator[str]:
    """Yield what matters and could not be judged: the robot or a link that is in a missing asset.

    An asset that only a sensor or the environment refers to is no gap: what the lab asks of these
    is mostly written in the stage itself.
    """
    parts = (path for robot in lab.scene.robots for path in (robot.path, *robot.link_paths))
    missing = [asset for path in parts if (asset := stage.unknown(path))]
    for name in dict.fromkeys(asset.asset for asset in missing):
        count = sum(entry.asset == name for entry in left_open)
        if count:
            left = (
                "1 requirement of the robot waits"
                if count == 1
                else f"{count} requirements of the robot wait"
            )
            yield f"{left} for {name}, which cannot be found"


def _nested_nodes(subjects: Iterable[GraphSubject]) -> Iterator[str]:
    """Yield the nodes of roles that are not direct children of a graph."""
    for subject in subjects:
        for node in nested_nodes(subject).values():
            yield (
                f"{node.path} is not a direct child of its graph: whether Isaac Sim runs it is "
                "unknown; drag it onto the graph in the Stage panel"
            )


class _Run(Struct, frozen=True):
    """What one run by a lab comes to, in the order in which the rules speak."""

    findings: list[Finding] = field(default_factory=list)
    crashes: list[Crash] = field(default_factory=list)
    not_judged: dict[NotJudged, None] = field(default_factory=dict)
    left_open: list[Finding] = field(default_factory=list)
    said: set[tuple[str | None, ...]] = field(default_factory=set)

    def keep(self, results: RuleResults) -> None:
        """Keep what rules found, once where graphs built in one share a node."""
        self.crashes.extend(results.crashes)
        self.not_judged.update(dict.fromkeys(results.not_judged))
        self.left_open.extend(results.left_open)
        for finding in results.findings:
            said = (finding.prim, finding.property, finding.rule, finding.message)
            if said not in self.said:
                self.said.add(said)
                self.findings.append(finding)


def _graph_subjects(
    lab: Lab,
    checkpoint: Checkpoint,
    stage: StageModel,
    live: Mapping[str, Node],
) -> Iterator[GraphSubject]:
    """Yield every graph of the checkpoint."""
    relocations = sensor_relocations(lab, stage)
    specs = {name: relocated_spec(spec, relocations) for name, spec in lab.graphs.items()}
    matched = match_all(specs, stage, lab.platform.scripts)
    for name in checkpoint.graphs:
        spec, roles = with_literals(specs[name], matched[name])
        yield GraphSubject(
            lab=lab,
            checkpoint=checkpoint,
            spec=spec,
            roles=roles,
            stage=stage,
            live_nodes=live,
            matched=tuple(
                (node, asked)
                for role, asked in spec.nodes.items()
                if (node := roles.node_of[role]) is not None
            ),
            wire_faults=faulty_wires(spec, roles, live),
        )
