"""Judges the stages that a lab describes: what it contradicts only once it is built."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.lint import LintSettings, lint_stage
from lab3_usd.pipeline.stage import check_stage
from lab3_usd.spec.contradictions.names import LabFault, file_of
from lab3_usd.spec.lab import SCENE, Checkpoint, Lab
from lab3_usd.spec.scene import is_within


def described_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what is wrong with the last stage, and with each optional one, that are built.

    The lab describes its starter. All are warnings: the lab can be loaded.

    Raises:
        StarterError: the starter lacks what the lab needs.
    """
    from lab3_usd.stage.write.builder import BuildOptions, build_files

    required = [point for point in lab.checkpoints.values() if not point.optional][-1:]
    points = [*required, *(point for point in lab.checkpoints.values() if point.optional)]
    with TemporaryDirectory(prefix="lab3-described-") as folder:
        plan = {Path(folder) / f"{point.id}.usda": point for point in points}
        build_files(lab, None, dict(plan), BuildOptions())
        known: set[tuple[str, str | None]] = set()
        for path, point in plan.items():
            for finding in _findings(path, point, lab):
                place = (finding.prim, finding.property)
                if place not in known:
                    known.add(place)
                    yield _fault(finding, point, lab)


def _findings(path: Path, point: Checkpoint, lab: Lab) -> Iterator[Finding]:
    """Yield the errors and warnings of the lab, then the errors of the linter."""
    judged = check_stage(path, point.id, lab).findings
    yield from (finding for finding in judged if finding.severity != "note")
    linted = lint_stage(path, LintSettings(release=lab.platform.release)).findings
    yield from (finding for finding in linted if finding.severity == "error")


def _fault(finding: Finding, point: Checkpoint, lab: Lab) -> LabFault:
    """Return what a finding says of the file that describes its prim."""
    file, key = SCENE, finding.prim
    for graph in lab.graphs.values():
        if is_within(finding.prim, graph.path):
            file, key = file_of(graph), finding.prim.removeprefix(graph.path).lstrip("/") or "graph"
    if finding.property:
        key += f": {finding.property.rpartition(':')[2]}"
    other = f"{finding.rule}, in the stage that is built for checkpoint {lab.key_of(point.id)}"
    return LabFault(file, key, finding.message, other, "warning")
