"""Judges any Isaac Sim stage without a spec, and counts what could not be judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.check.fold import fold
from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import import_rules, own_rules, rules_of
from lab3_usd.check.rule_runs import RuleResults, merge_results, run_rules
from lab3_usd.facts.stalled_nodes import nodes_of_unknown_type
from lab3_usd.model.finding import NodeCoverage, NotJudged
from lab3_usd.model.stage import OVER, nodes_outside_graphs

import_rules("F", "K", "Y")


def lint(subject: LintSubject) -> RuleResults:
    """Run every rule over a stage, which is read as they ask, and count its nodes.

    With a gap and without an error a stage is not judged: it is no pass.

    Raises:
        StageError: the file turns out to be damaged.
    """
    try:
        files = run_rules(rules_of("model", "F"), (subject,), None)
        rules = rules_of("lint", "K", "Y")
        if subject.stage.build is not None:
            rules = [*rules_of("script", "B"), *rules]
        stage = run_rules(rules, (subject,), None)
        own = run_rules(own_rules().values(), (subject,), None)
        stage = merge_results((replace(stage, findings=tuple(fold(stage.findings))), own))
        # What cannot be found leaves the stage not judged; whether it should be there is not known.
        missing = tuple(replace(finding, severity="note") for finding in files.findings)
        waiting = dict(_waiting(subject))
        unknown = {node.path: node.type_name for node in nodes_of_unknown_type(subject.stage)}
        return replace(
            merge_results((replace(files, findings=missing), stage)),
            gaps=tuple(_gaps(subject, waiting, unknown)),
            coverage=NodeCoverage(
                nodes=len({*subject.live, *waiting}),
                waiting=Counter(waiting.values()),
                unknown=Counter(unknown.values()),
                partly=_partly(stage.not_judged, subject, unknown),
            ),
        )
    finally:
        # What rules derive holds what they were given, and so the stage.
        subject.stage.judged.clear()


def _waiting(subject: LintSubject) -> Iterator[tuple[str, str]]:
    """Yield each node that may be in a missing asset only, and the asset.

    It is an over, or stands below a graph that is one.
    """
    stage, ignores = subject.stage, subject.platform.graph.ignores
    stray = {node.path for node in nodes_outside_graphs(stage)}
    paths = [node.path for node in stage.orphans if node.path not in stray]
    paths += (prim.path for prim in stage.absent if prim.type_name and prim.reason == OVER)
    paths += stage.overridden
    for graph in subject.graphs():
        paths += (prim.path for prim in graph.absent if prim.reason == OVER)
        paths += (node.path for node in graph.nodes if not graph.active)
    for path in paths:
        asset = stage.unknown(path.rpartition("/")[0])
        if asset is not None and not ignores(path):
            yield path, asset.asset


def _partly(
    left_open: tuple[NotJudged, ...], subject: LintSubject, unknown: Mapping[str, str]
) -> dict[str, int]:
    """Count the nodes at which a rule left something open, by the first asset they wait for."""
    assets: dict[str, str] = {}
    for entry in left_open:
        if entry.prim in subject.live and entry.prim not in unknown:
            assets.setdefault(entry.prim, entry.asset)
    return Counter(assets.values())


def _gaps(
    subject: LintSubject, waiting: Mapping[str, str], unknown: Mapping[str, str]
) -> Iterator[str]:
    """Yield what matters and could not be judged: a sublayer, a graph, whether there is a graph."""
    stage = subject.stage
    for missing in stage.unresolved:
        if missing.kind == "sublayer":
            yield f"the sublayer {missing.asset} of the stage cannot be found"
    graphs: dict[str, list[str]] = {}
    for path in dict.fromkeys((*subject.live, *waiting)):
        graphs.setdefault(path.rpartition("/")[0], []).append(path)
    for graph, paths in graphs.items():
        if all(path in waiting or path in unknown for path in paths):
            assets = sorted({waiting[path] for path in paths if path in waiting})
            types = sorted({unknown[path] for path in paths if path in unknown})
            reasons = [f"{asset} cannot be found" for asset in assets]
            reasons += ["unknown types " + ", ".join(types)] if types else []
            yield f"no node of {graph} could be judged: {'; '.join(reasons)}"
    reported_kinds = ("sublayer", "script")
    missing_parts = [missing for missing in stage.unresolved if missing.kind not in reported_kinds]
    if not graphs and missing_parts and not any(graph.active for graph in subject.graphs()):
        assets = sorted({missing.asset for missing in missing_parts})
        more = f" and {len(assets) - 1} more" if len(assets) > 1 else ""
        yield f"the stage has no graph of its own; one may be in a missing asset: {assets[0]}{more}"
