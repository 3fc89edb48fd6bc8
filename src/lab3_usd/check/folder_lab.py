"""What lies in a submission beside its stages: maps, parameter files, saved output."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.finding import Finding
from lab3_usd.check.judged import Judged, join, run_family
from lab3_usd.check.map_walls import wall_agreements
from lab3_usd.check.subjects_lab import Evidence, EvidenceSubject, MapSubject
from lab3_usd.check.submitted import Listing
from lab3_usd.lab.deliverables import find_parameter_files
from lab3_usd.lab.evidence import read_listed
from lab3_usd.lab.map_subject import find_map, map_subject
from lab3_usd.lab.params import read_params
from lab3_usd.lab.submission import folder_named
from lab3_usd.spec.load_ros import map_facts
from lab3_usd.spec.ros_spec import MapFacts, RosSpec
from lab3_usd.spec.spec import Lab
from lab3_usd.spec.submission_spec import SubmissionSpec


class Given(Struct, frozen=True):
    """A folder, what it holds, and what it is judged by."""

    folder: Path
    listing: Listing
    lab: Lab
    ros: RosSpec
    spec: SubmissionSpec

    @property
    def usable(self) -> list[str]:
        """The paths of the files that may be opened."""
        return [entry.path for entry in self.listing.entries if not entry.why_not]

    @property
    def refused(self) -> frozenset[str]:
        """The paths of the files that are never opened."""
        return frozenset(entry.path for entry in self.listing.entries if entry.why_not)


def judge_maps(given: Given, maps: Path | None, stage: Path | None) -> Judged:
    """Judge the map of the submission, or of the folder `maps`; with a stage, also its walls."""
    facts = map_facts(given.lab.scene)
    if maps is not None:
        subject = map_subject(find_map(maps, facts), facts)
        return run_family("maps", "M", _with_walls(subject, maps, stage, given.lab))
    path = _map_path(given, facts)
    if path is not None and path.relative_to(given.folder).as_posix() in given.refused:
        return Judged()
    subject = map_subject(path, facts, root=given.folder)
    if subject.image_file in given.refused:
        return Judged()
    return run_family("maps", "M", _with_walls(subject, given.folder, stage, given.lab))


def _map_path(given: Given, facts: MapFacts) -> Path | None:
    """Return where the map is or should be; None for a bare folder of stages without one."""
    name = folder_named(given.folder, given.spec.folders.maps)
    if name:
        return find_map(given.folder / name, facts)
    if facts.yaml in given.usable:
        return given.folder / facts.yaml
    return given.folder / given.spec.folders.maps / facts.yaml if given.listing.home else None


def _with_walls(subject: MapSubject, root: Path, stage: Path | None, lab: Lab) -> MapSubject:
    facts = subject.facts
    if stage is None or subject.size != (facts.width, facts.height):
        return subject
    figures = wall_agreements(stage, root / subject.image_file, facts, lab)
    return replace(subject, agreements=figures)


def judge_parameters(given: Given) -> Judged:
    """Judge every file of the submission that holds parameters of ROS 2 nodes."""
    usable = [entry for entry in given.listing.entries if not entry.why_not]
    runs = []
    for path in find_parameter_files(given.folder, usable, given.spec.folders):
        subject = read_params(given.folder / path, given.ros, given.lab.frames, given.folder)
        runs.append(run_family("navigation", "V", subject))
    return join(runs)


def read_shown(given: Given) -> Evidence:
    """Read the saved output of the running system."""
    names = [folder_named(given.folder, name) or name for name in given.spec.folders.shown]
    return read_listed(given.folder, given.usable, names, given.ros)


def judge_shown(given: Given, evidence: Evidence, until: str, *, required: bool) -> Judged:
    """Judge the saved output, up to what the checkpoint `until` asks for."""
    subject = EvidenceSubject(
        ros=given.ros,
        frames=given.lab.frames,
        facts=map_facts(given.lab.scene),
        evidence=evidence,
        until=until,
        required=required,
    )
    return run_family("evidence", "E", subject)


def map_findings(maps: Path, lab: Lab) -> tuple[Finding, ...]:
    """Return what is wrong with the map of a folder, for the report of a single stage."""
    facts = map_facts(lab.scene)
    found = run_family("maps", "M", map_subject(find_map(maps, facts), facts))
    return tuple(_at_stage(found.findings, maps))


def lone_stage_notes(checkpoint: str, lab: Lab) -> tuple[Finding, ...]:
    """Return the note that a stage of localization or navigation was checked without its map."""
    if not lab.checkpoints[checkpoint].localization:
        return ()
    found = run_family("maps", "M", map_subject(None, map_facts(lab.scene)))
    return tuple(_at_stage(found.findings, None))


def _at_stage(findings: Iterable[Finding], maps: Path | None) -> Iterable[Finding]:
    """Tell findings about files as findings about a stage, whose sites are prims."""
    for each in findings:
        layer = str(maps / each.prim) if maps is not None else None
        yield replace(
            each, prim="/", property=None, layer=layer, message=f"{each.prim}: {each.message}"
        )
