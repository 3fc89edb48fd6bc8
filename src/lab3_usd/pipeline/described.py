"""Judges the stages that a lab describes: what it contradicts only once it is built."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from lab3_usd.errors import SpecError
from lab3_usd.isaac.platform import Platform
from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.stage import JudgeSettings, check_stage, lint_stage
from lab3_usd.spec.contradictions.names import LabFault, file_of
from lab3_usd.spec.lab import SCENE, STARTER, Checkpoint, Lab
from lab3_usd.spec.positions import has_place, located
from lab3_usd.spec.scene import JointSpec, stands_within
from lab3_usd.stage.schema_names import Misnomer, misnomers

_KEY = re.compile(r"(?<=[a-z])([A-Z])")  # where a name of USD goes on that a key writes with `_`
_DESCRIBED = ("K09",)  # a node that ends the run is there because the lab describes it


def described_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what is wrong with the stages that are built.

    The last one that is required comes first, then each optional one: they have all parts, and the
    linter judges them as well. The lab describes its starter. All are warnings: the lab can be
    loaded.

    Raises:
        StarterError: the starter lacks what the lab needs.
    """
    from lab3_usd.stage.write.builder import BuildOptions, build_files

    required = [point for point in lab.checkpoints.values() if not point.optional]
    whole = [*required[-1:], *(point for point in lab.checkpoints.values() if point.optional)]
    with TemporaryDirectory(prefix="lab3-described-") as folder:
        points = (*whole, *required[:-1])
        plan = {Path(folder) / f"{point.id}.usda": point for point in points}
        try:
            build_files(lab, None, dict(plan), BuildOptions())
        except SpecError as error:
            raise located(error, lab.folder) from error
        names = misnomers(next(iter(plan)), _prim_types(lab.platform))
        yield from dict.fromkeys(_misspelt(misnomer, lab) for misnomer in names)
        sites: set[tuple[str, str | None]] = set()
        for path, point in plan.items():
            props = [each for each in lab.props_at(point).values() if each.asset and each.resolved]
            findings = [
                finding
                for finding in check_stage(path, point.id, lab).findings
                if finding.severity != "note"
                # What a thing refers to lies beside the stages of students.
                and not (
                    finding.rule == "S36"
                    and finding.expected is None
                    and any(prop.stands_at(finding.prim) for prop in props)
                )
            ]
            if point in whole:
                findings += _linted(path, lab)
            for finding in findings:
                place = (finding.prim, finding.property)
                if place not in sites:
                    sites.add(place)
                    yield _fault(finding, point, lab)


def _linted(path: Path, lab: Lab) -> Iterator[Finding]:
    """Yield the errors of the linter, and the warnings that the lab does not mean."""
    meant = (*_DESCRIBED, *lab.policy.accepts)
    for finding in lint_stage(path, JudgeSettings(release=lab.platform.release)).findings:
        if finding.severity == "error" or (
            finding.severity == "warning" and finding.rule not in meant
        ):
            yield finding


def _prim_types(platform: Platform) -> frozenset[str]:
    """Return the types of prims that Isaac Sim has beside those of USD's own schemas."""
    named = [kind.types for kind in platform.sensors.values()]
    named += [kind.types for kind in platform.targets.values()]
    return frozenset(
        (
            platform.graph.type,
            platform.graph.node_type,
            *platform.placed,
            *(name for types in named for name in types),
        )
    )


def _misspelt(misnomer: Misnomer, lab: Lab) -> LabFault:
    message = f"'{misnomer.written}' is not known, '{misnomer.meant}' is"
    what = misnomer.property or "type"
    key = _key_of_prop(lab, misnomer.prim, misnomer.written)
    if key:
        return LabFault(SCENE, key, message, severity="warning")
    file = _file_with(lab, misnomer.prim)
    return LabFault(file, f"{misnomer.prim}: {what}", message, severity="warning")


def _key_of_prop(lab: Lab, prim: str, part: str) -> str:
    """Return the keys of a thing of the scene that names this of a prim, '' where none does.

    That is its type, a schema, a value or a relationship; of its path and number, the prim itself.
    """
    for name, prop in lab.scene.props.items():
        named = {prop.path: "path", prop.type: "type", **dict.fromkeys(prop.apis, "apis")}
        named |= {key: f"targets: {key}" for key in prop.targets}
        named |= {key: f"set: {key}" for key in prop.values}
        if part in named and (prop.stands_at(prim) or prop.path == prim):
            return f"props: {name}: {named[part]}"
    return ""


def _file_with(lab: Lab, prim: str) -> str:
    """Return the file that describes a prim of the scene: that of the requirements, if it does."""
    return SCENE if has_place(lab.folder, SCENE, prim) else STARTER


def _fault(finding: Finding, point: Checkpoint, lab: Lab) -> LabFault:
    """Return what a finding says of the file that describes its prim."""
    file, key = _file_with(lab, finding.prim), finding.prim
    name = (finding.property or "").rpartition(":")[2]
    if file == STARTER or any(finding.prim == sensor.path for sensor in lab.sensors.values()):
        name = finding.property or ""
    elif file == SCENE:
        key_of_joint = _KEY.sub(r"_\1", name).lower()
        name = key_of_joint if key_of_joint in JointSpec.__struct_fields__ else name
    for graph in lab.graphs.values():
        if stands_within(finding.prim, graph.path):
            file, key = file_of(graph), finding.prim.removeprefix(graph.path).lstrip("/") or "graph"
            name = (finding.property or "").rpartition(":")[2]
    if finding.rule == "S36":
        of_prop = _key_of_prop(lab, finding.prim, finding.property or finding.prim)
        file, key, name = (SCENE, of_prop, "") if of_prop else (file, key, name)
    other = f"{finding.rule}, in the stage that is built for checkpoint {lab.key_of(point.id)}"
    return LabFault(file, f"{key}: {name}" if name else key, finding.message, other, "warning")
