"""Lints one script: reads the graphs that it builds, runs the rules, and places the findings.

A script builds different graphs on different ways through it. What is found on one way counts if
it is found on each other way that comes by the same lines.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.registry import Parameters, rule_names
from lab3_usd.check.rule_runs import merge_results
from lab3_usd.errors import StageError
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.build import Span
from lab3_usd.model.finding import (
    BuiltParts,
    Finding,
    IgnoreNote,
    NodeCoverage,
    StageResult,
    is_among,
    ordered,
)
from lab3_usd.pipeline.results import unreadable_result, unused_note

if TYPE_CHECKING:
    from lab3_usd.model.stage import StageModel
    from lab3_usd.scripts.reader import BuiltStage, ReadScript
    from lab3_usd.scripts.sources import Source

NO_GRAPH = "it builds no graph"
_OLD_NAMES = "K31"
_STOPS = ("B", "K21", "K30", _OLD_NAMES)  # what an error of a script is that a handler may expect
_NOTE = re.compile(r"#[ \t]*lab3:[ \t]*ignore\b(?:\[([^\]\n]*)\]|[ \t]+([\w ,-]+))?")


class ScriptSettings(Struct, frozen=True):
    """How to judge a script: by which release, over which scene, and whether its notes count.

    `parameters` are those of rules that a configuration sets.
    """

    platform: Platform
    scene: StageModel | None = None
    heeds_ignores: bool = False
    parameters: Parameters = ()


def lint_script(path: str | Path, settings: ScriptSettings) -> StageResult:
    """Judge the graphs that a script or a notebook builds.

    A script that builds none is not judged, and no fault.
    """
    from lab3_usd.scripts.reader import read_script

    try:
        script = read_script(Path(path), settings.platform, settings.scene)
    except StageError as error:
        return unreadable_result(str(path), None, error)
    if script is None:
        coverage = NodeCoverage(built=BuiltParts())
        return StageResult(str(path), None, coverage=coverage, gaps=(NO_GRAPH,))
    return _judged(str(path), script, settings)


def joined_stage(path: Path, platform: Platform, scene: StageModel | None) -> StageModel:
    """Return the stage with the graphs of all ways through a script, one of each path.

    Raises:
        StageError: the script cannot be read, or builds no graph.
    """
    from lab3_usd.scripts.reader import read_script

    script = read_script(path, platform, scene)
    if script is None or not script.stages:
        raise StageError(f"{path}: {NO_GRAPH}")
    first, *alternatives = sorted(script.stages, key=lambda stage: -len(stage.world.nodes))
    graphs = {graph.path: graph for graph in first.model.graphs}
    unresolved = dict.fromkeys(first.model.unresolved)
    for other in alternatives:
        for graph in other.model.graphs:
            graphs.setdefault(graph.path, graph)
        unresolved.update(dict.fromkeys(other.model.unresolved))
    return replace(first.model, graphs=tuple(graphs.values()), unresolved=tuple(unresolved))


class _Placed(Struct, frozen=True):
    """A finding and the part of the script at which it stands."""

    finding: Finding
    span: Span | None


def _judged(path: str, script: ReadScript, settings: ScriptSettings) -> StageResult:
    from lab3_usd.check.lint import lint
    from lab3_usd.check.match.rule_inputs import LintSubject

    subjects = [LintSubject(each.model, parameters=settings.parameters) for each in script.stages]
    judged = [lint(subject) for subject in subjects]
    placed = [
        [_Placed(finding, _span(finding, stage)) for finding in each.findings]
        for stage, each in zip(script.stages, judged, strict=True)
    ]
    kept = _told_once(
        _certain(script.stages, [_of_made_nodes(each_placed) for each_placed in placed])
    )
    findings = [_in_file(each, path, script.source) for each in kept]
    if settings.heeds_ignores:
        findings = list(
            _without_ignored(findings, [each.span for each in kept], path, script.source)
        )
    results = merge_results(judged)
    gaps = [gap for each in judged for gap in each.gaps] if not script.nodes else []
    if not script.nodes:
        gaps += [
            f"no node could be read: {each.why} in line {each.line} is not known before it runs"
            for each in script.unknown
        ]
    gaps += [f"reading ended in line {line}: it takes too many steps" for line in script.stopped]
    if judged:  # where one way can be judged, something was
        first, *rest = (each.gaps for each in judged)
        gaps += [gap for gap in first if all(gap in own for own in rest)]
    return StageResult(
        path=path,
        checkpoint=None,
        findings=ordered(findings),
        crashes=tuple(dict.fromkeys(results.crashes)),
        not_judged=tuple(dict.fromkeys(results.not_judged)),
        coverage=_coverage(script, [each.coverage for each in judged if each.coverage is not None]),
        gaps=tuple(dict.fromkeys(gaps)),
    )


def _coverage(script: ReadScript, parts: Sequence[NodeCoverage]) -> NodeCoverage:
    """Return how much of the script was read and judged, all ways together."""
    unknown, partly = Counter[str](), Counter[str]()
    for part in parts:
        unknown |= Counter(part.unknown)
        partly |= Counter(part.partly)
    built = BuiltParts(script.graphs, script.wires, script.values, script.unknown)
    return NodeCoverage(nodes=script.nodes, unknown=dict(unknown), partly=dict(partly), built=built)


def _span(finding: Finding, stage: BuiltStage) -> Span | None:
    """Return the part of the script that a finding is about: its wire or value, else its node."""
    if finding.span is not None:
        return finding.span
    build = stage.model.build
    places = {} if build is None else build.places
    prim, name = finding.prim, finding.property
    asked: list[tuple[str, str | None, str | None]]
    asked = [(prim, name, finding.actual), (prim, name, None)] if name else []
    asked += (
        [(node, None, None) for node in finding.related]
        if name is None and (prim, None, None) in places and prim in stage.world.graphs
        else []
    )
    asked.append((prim, None, None))
    above = prim
    while above:
        above = above.rpartition("/")[0]
        asked.append((above, None, None))
    asked += [(node, None, None) for node in finding.related]
    return next((places[key] for key in asked if key in places), None)


def _certain(stages: Sequence[BuiltStage], placed: Sequence[list[_Placed]]) -> Iterator[_Placed]:
    """Yield what is found on every way that comes by the same lines."""
    keys = [{_key(each) for each in findings} for findings in placed]
    visited = [
        {
            *stage.world.places,
            *(graph.at for graph in stage.world.graphs.values()),
            *(node.at for node in stage.world.nodes.values()),
        }
        for stage in stages
    ]
    for stage, findings in zip(stages, placed, strict=True):
        for each in findings:
            spans = {span for span in (each.span, *_related(each.finding, stage)) if span}
            required = (own for own, seen in zip(keys, visited, strict=True) if spans <= seen)
            if all(_key(each) in own for own in required) and not _is_expected(each, stages):
                yield each


def _of_made_nodes(placed: list[_Placed]) -> list[_Placed]:
    """Return findings but those about nodes that are not made, because of the names of their types.

    Whatever else is said of such a node rests on a line at which the script stops.
    """
    stopped = [
        each.finding
        for each in placed
        if each.finding.rule == _OLD_NAMES and each.finding.severity == "error"
    ]
    unmade = {prim for finding in stopped for prim in finding.related}
    return [each for each in placed if each.finding.prim not in unmade]


def _key(placed: _Placed) -> tuple[str, str, str | None, Span | None]:
    return placed.finding.rule, placed.finding.prim, placed.finding.property, placed.span


def _related(finding: Finding, stage: BuiltStage) -> Iterator[Span]:
    places = {} if stage.model.build is None else stage.model.build.places
    for prim in finding.related:
        if (prim, None, None) in places:
            yield places[prim, None, None]


def _is_expected(placed: _Placed, stages: Sequence[BuiltStage]) -> bool:
    """Whether a handler of the script is there for what goes wrong at this line."""
    if placed.span is None or not is_among(placed.finding.rule, _STOPS):
        return False
    line = placed.span[0]
    return any(a <= line < b for stage in stages for a, b in stage.world.guarded)


def _told_once(placed: Iterable[_Placed]) -> list[_Placed]:
    """Return each finding of a line once, however often the line is come by."""
    by_fault: dict[tuple[object, ...], _Placed] = {}
    for each in placed:
        place = each.span or each.finding.prim
        key = (each.finding.rule, place, each.finding.property)
        first = by_fault.setdefault(key, each)
        prim = each.finding.prim
        if first.finding.prim != prim and prim not in first.finding.related:
            related = (*first.finding.related, prim)
            by_fault[key] = _Placed(replace(first.finding, related=related), first.span)
    return list(by_fault.values())


def _in_file(placed: _Placed, path: str, source: Source) -> Finding:
    """Return a finding with its line and column in the file; of a notebook with its cell."""
    finding = placed.finding
    if placed.span is None or not _is_of_one_name(finding, placed.span, source):
        finding = replace(finding, fix=None)
    if placed.span is None:
        return replace(finding, layer=path)
    line, offset = placed.span[0], placed.span[1]
    cell = source.cell(line)
    message = f"{finding.message} ({cell})" if cell else finding.message
    column = None if cell else source.column(line, offset)
    return replace(
        finding,
        layer=path,
        line=source.line(line),
        column=column,
        message=message,
        span=placed.span,
    )


def _is_of_one_name(finding: Finding, span: Span, source: Source) -> bool:
    """Whether the repair of a finding is another name in the lines at which it stands."""
    if source.cells or not finding.actual or not finding.expected:
        return False
    wrong = finding.actual.rpartition(".")[2] if "/" in finding.actual else finding.actual
    return any(wrong in line for line in source.lines[span[0] - 1 : span[2]])


def _without_ignored(
    findings: Sequence[Finding], spans: Sequence[Span | None], path: str, source: Source
) -> Iterator[Finding]:
    """Yield the findings that no comment ignores, and the comments that ignore nothing.

    A comment is about what stands in its line, or alone on a line about what begins in the next.
    """
    notes = list(_notes(source, path))
    used: set[IgnoreNote] = set()
    for finding, span in zip(findings, spans, strict=True):
        covering = {
            note
            for note in notes
            if span
            and is_among(finding.rule, (note.rule,))
            and (span[0] == note.line or span[0] <= (note.written or 0) <= span[2])
        }
        used |= covering
        if not covering:
            yield finding
    for note in notes:
        if note not in used:
            yield from unused_note(replace(note, written=source.line(note.written or 1)))


def _notes(source: Source, path: str) -> Iterator[IgnoreNote]:
    for number, line in enumerate(source.lines, 1):
        match = _NOTE.search(line) if "lab3" in line else None
        if match is None:
            continue
        about = number
        while about <= len(source.lines) and not source.lines[about - 1].split("#")[0].strip():
            about += 1
        names = (match[1] or match[2] or "").split("--")[0]
        for name in [part for part in re.split(r"[ ,]+", names.strip()) if part] or [""]:
            rule = rule_names().get(name.lower(), name.upper())
            yield IgnoreNote(rule, layer=path, line=about, written=number)
