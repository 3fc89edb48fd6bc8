"""Judges the files of a submission beside its stages: maps, parameters, outputs, recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.rule_runs import RuleResults, merge_results, run_family
from lab3_usd.deliverables.drawn_maps import MapFrame, draw_map
from lab3_usd.deliverables.evidence.saved_outputs import read_listed
from lab3_usd.deliverables.maps import SuppliedMap, agreement, find_map, map_subject, read_pgm
from lab3_usd.deliverables.nav2_parameters import read_params
from lab3_usd.deliverables.submission_files import find_parameter_files, folder_named
from lab3_usd.errors import Lab3Error
from lab3_usd.model.finding import Finding
from lab3_usd.model.folder import Agreement, Evidence, EvidenceSubject, Listing, MapSubject
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.ros import MapFacts, RosSpec
from lab3_usd.spec.submission import SubmissionSpec


class FolderContents(Struct, frozen=True):
    """A submission folder, the files that it holds, and what they are judged by.

    `maps` is a folder whose map is judged instead, or the grader's map, which those handed in are
    compared with, and which stands in for a missing one.
    """

    root: Path
    listing: Listing
    lab: Lab
    ros: RosSpec
    spec: SubmissionSpec
    maps: Path | SuppliedMap | None = None

    @property
    def map(self) -> MapFacts | None:
        """What the map has to be: the grader's, else as the lab describes it."""
        return self.maps.facts if isinstance(self.maps, SuppliedMap) else self.lab.scene.map

    @property
    def usable(self) -> list[str]:
        """The paths of the files that may be opened."""
        return [entry.path for entry in self.listing.entries if not entry.why_not]

    @property
    def refused(self) -> frozenset[str]:
        """The paths of the files that are never opened."""
        return frozenset(entry.path for entry in self.listing.entries if entry.why_not)


def judge_maps(
    contents: FolderContents,
    stage: Path | None,
    may_open: Callable[[str], str],
    *,
    handed_in: bool,
) -> RuleResults:
    """Judge the map of a submission; with a stage, also its walls.

    A map that is still to come is not reported. `may_open` receives the image before it is opened,
    and returns a reason not to open it.
    """
    lab, facts = contents.lab, contents.map
    supplied = contents.maps if isinstance(contents.maps, SuppliedMap) else None
    maps = contents.maps if isinstance(contents.maps, Path) else None
    if facts is None:
        return RuleResults()
    root = maps or contents.root
    if maps is not None:
        subject = map_subject(find_map(maps, facts), facts)
    else:
        path = _map_path(contents, facts)
        if not handed_in and (path is None or not path.exists()):
            return RuleResults()
        if path is not None and path.relative_to(root).as_posix() in contents.refused:
            return RuleResults()
        is_missing = path is None or not path.exists()
        if supplied is not None and is_missing and _is_due(contents):
            subject = MapSubject(facts, given=False, file=facts.yaml, replaced=True)
            return run_family("maps", "M", subject, lab)
        subject = map_subject(path, facts, root, may_open)
        if subject.image_file in contents.refused:
            return RuleResults()
    if stage is not None and subject.size == (facts.width, facts.height):
        try:
            agreements = tuple(_wall_agreements(stage, root / subject.image_file, facts, lab))
        except Lab3Error:
            agreements = ()  # what cannot be compared gives no figure
        subject = replace(subject, agreements=agreements)
    if supplied is not None and subject.size == (facts.width, facts.height):
        with suppress(Lab3Error):  # an image of another format, which map_server reads
            grid = read_pgm(root / subject.image_file)
            shares = (_agreement(grid, supplied.grid), _agreement(supplied.grid, grid))
            subject = replace(subject, shared_walls=min(shares))
    return run_family("maps", "M", subject, lab)


def _map_path(contents: FolderContents, facts: MapFacts) -> Path | None:
    """Return where the map is or should be.

    None for a bare folder of stages without one, and before a stage that needs it is handed in.
    """
    name = folder_named(contents.root, contents.spec.folders.maps)
    if name:
        return find_map(contents.root / name, facts)
    if facts.yaml in contents.usable:
        return contents.root / facts.yaml
    if not _is_due(contents) or not contents.listing.stage_folder:
        return None
    return contents.root / contents.spec.folders.maps / facts.yaml


def _is_due(contents: FolderContents) -> bool:
    """Whether a stage that needs the map is handed in, or no stage at all."""
    stages = [contents.lab.checkpoints[stage] for stage in contents.listing.stages]
    return not stages or any(checkpoint.localization for checkpoint in stages)


def _wall_agreements(
    stage_path: Path, image: Path, facts: MapFacts, lab: Lab
) -> Iterator[Agreement]:
    """Compare a map with the one that the stage's walls give.

    Nobody says whether the map's frame is the world's or begins where the robot starts, so both
    are tried.
    """
    from lab3_usd.stage.lidar_plane import SliceOptions, slice_stage
    from lab3_usd.stage.read.opening import open_stage

    robot = lab.scene.robot_of(lab.lidar_link) or lab.scene.robot
    if not lab.lidar_link:
        return
    cut = slice_stage(open_stage(stage_path), SliceOptions(robot.path, lab.lidar_link))
    if cut.robot is None or not cut.segments:
        return
    grid = read_pgm(image)
    start_x, start_y, _ = (0.0, 0.0, 0.0) if robot.pose is None else robot.pose.translate
    guesses = {"the world's": (0.0, 0.0), "the robot's start": (start_x, start_y)}
    for about, (x, y) in guesses.items():
        corner = (facts.origin[0] + x, facts.origin[1] + y)
        frame = MapFrame(facts.resolution, corner, facts.width, facts.height)
        drawn = _drawn(frame, cut.segments, cut.robot)
        yield Agreement(_agreement(grid, drawn.grid), f"with the origin at {about}")


# The stages of a class have the same walls, and most of its maps are the same.
_drawn = lru_cache(maxsize=4)(draw_map)
_agreement = lru_cache(maxsize=8)(agreement)


def judge_parameters(contents: FolderContents) -> RuleResults:
    """Judge every file of the submission that holds parameters of ROS 2 nodes."""
    if contents.ros.navigation is None:
        return RuleResults()
    usable = [entry for entry in contents.listing.entries if not entry.why_not]
    runs = []
    for path in find_parameter_files(contents.root, usable, contents.spec.folders):
        subject = read_params(
            contents.root / path, contents.ros, contents.lab.frames, contents.root
        )
        runs.append(run_family("navigation", "V", subject, contents.lab))
    return merge_results(runs)


def read_saved_outputs(contents: FolderContents) -> Evidence:
    """Read the saved output of the running system."""
    names = [folder_named(contents.root, name) or name for name in contents.spec.folders.shown]
    return read_listed(contents.root, contents.usable, names, contents.ros)


def judge_saved_outputs(
    contents: FolderContents, evidence: Evidence, until: str, *, required: bool, handed_in: bool
) -> RuleResults:
    """Judge the saved output, up to what the checkpoint `until` asks for."""
    lab = contents.lab  # frames of optional checkpoints on the way are not asked for at its end
    subject = EvidenceSubject(
        ros=contents.ros,
        frames=lab.at(until if lab.checkpoints[lab.last].optional else lab.last).frames,
        facts=contents.map,
        evidence=evidence,
        reached=lab.reached(until),
        required=required,
        handed_in=handed_in,
    )
    return run_family("evidence", "E", subject, lab)


def map_findings(maps: Path | None, lab: Lab) -> Iterator[Finding]:
    """Yield what is wrong with the map of a folder, for the report of a stage that needs it.

    Without a folder, that is the note that the stage was checked without its map. The sites are
    those of a stage, whose layer is the file.
    """
    facts = lab.scene.map
    if facts is None:
        return
    path = None if maps is None else find_map(maps, facts)
    for finding in run_family("maps", "M", map_subject(path, facts), lab).findings:
        layer = None if maps is None else str(maps / finding.prim)
        message = f"{finding.prim}: {finding.message}"
        yield replace(finding, prim="/", property=None, layer=layer, message=message)
