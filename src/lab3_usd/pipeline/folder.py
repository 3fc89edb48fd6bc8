"""Judges a student's whole folder: its stages, maps, parameters, saved output and files."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path, PurePosixPath

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd import hooks
from lab3_usd.check.checklist import ChecklistInput, decide_checklist
from lab3_usd.check.rule_runs import merge_results, run_family
from lab3_usd.deliverables.maps import SuppliedMap, opens_all
from lab3_usd.deliverables.submission_files import list_submission, stage_ending
from lab3_usd.errors import Lab3Error, StageError, failure_text
from lab3_usd.model.finding import Finding, StageResult, Submission, ordered
from lab3_usd.model.folder import Listing, StarterFile, SubmissionSubject, UnjudgedStage
from lab3_usd.pipeline.deliverables import (
    FolderContents,
    judge_maps,
    judge_parameters,
    judge_saved_outputs,
    read_saved_outputs,
)
from lab3_usd.pipeline.results import FAILED, crashed, is_stage_file
from lab3_usd.pipeline.stage import JudgeSettings, judge_stage
from lab3_usd.pipeline.starter_comparison import Starter, open_starter, opened_starter
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.loader import lab_of_team, load_lab
from lab3_usd.spec.submission import named_checkpoint


class _Starters(Struct, frozen=True):
    """The starter to compare stages with, None for none, and the one in the submission."""

    compared: Starter | None = None
    submitted: StarterFile | None = None


class FolderResult(Struct, frozen=True):
    """The results of the stages in the order of their checkpoints, and of the folder itself."""

    results: tuple[StageResult, ...]
    submission: Submission


def is_submission(folder: Path) -> bool:
    """Whether a folder is a submission; a link to a folder does not count as one."""
    try:
        with os.scandir(folder) as scan:
            entries = [(entry.name, entry.is_dir(follow_symlinks=False)) for entry in scan]
    except OSError:
        return False
    return are_submission(entries)


def are_submission(entries: Iterable[tuple[str, bool]]) -> bool:
    """Whether these names, and which of them are folders, are those of one submission.

    It has the folder of stages, or several of the stages. Hidden files and backups, which programs
    leave, do not count.
    """
    lab = load_lab()
    stages, listed = lab.submission.folders.stages.lower(), list(entries)
    named = [name for name, _ in listed if is_stage_file(name)]
    return len([name for name in named if named_checkpoint(name, lab.files)]) > 1 or any(
        is_folder and name.lower() == stages for name, is_folder in listed
    )


def check_folder(
    folder: Path,
    settings: JudgeSettings,
    *,
    supplied_map: SuppliedMap | None = None,
    may_open: Callable[[str], str] = opens_all,
    digests: Mapping[str, str] = {},
) -> FolderResult:
    """Judge every stage at its checkpoint, and the folder as a whole.

    The `supplied_map` counts in place of the maps of `settings`. `may_open` receives each recording
    and map image before it is opened, and says why it is not to be. `digests` are those of files by
    path, as far as they are known. Without `handed_in`, a folder counts as work in progress until
    it holds the last deliverables of the lab.

    Raises:
        StageError: the starter that was given cannot be opened.
        UnknownTeamError: the lab has values by team, and no stage says which team it is.
    """
    lab = load_lab()
    spec = lab.submission
    listing = list_submission(folder, lab, spec)
    lab = lab_of_team(lab, ((stage.path, number) for number, stage in listing.stages.items()))
    maps = supplied_map or settings.maps
    contents = FolderContents(folder, listing, lab, lab.ros, spec, maps)
    starters = find_starters(folder, contents.listing, settings.starter, lab)
    results = dict(_results(contents, replace(settings, starter=starters.compared)))
    until = [*contents.listing.stages][-1] if contents.listing.stages else lab.last
    entries = contents.listing.entries
    evidence = read_saved_outputs(contents)
    if any(entry.is_recording for entry in entries):
        recordings = hooks.read_recordings(folder, entries, (lab, until), may_open)
        evidence = replace(evidence, recordings=recordings)
    required = settings.require_evidence
    handed_in = settings.handed_in or required or _is_concluded(contents)
    stages = contents.listing.stages
    due = [n for n, point in lab.checkpoints.items() if not point.optional or n in stages]
    last_due = due[-1] if due else lab.last  # that must be handed in, or was
    readable = [result.path for result in results.values() if result.verdict != "unreadable"]
    subject = SubmissionSubject(
        lab=lab,
        spec=spec,
        listing=contents.listing,
        results=results,
        digests={
            number: digests.get(result.path) or _digest(Path(result.path))
            for number, result in results.items()
            if result.verdict != "unreadable"  # two placeholders of a cloud are no copies
        },
        starter=starters.submitted,
        unjudged=tuple(_unjudged(contents)),
        handed_in=handed_in,
    )
    judged = merge_results((
        run_family("submission", "X", subject, lab),
        judge_maps(
            contents, Path(readable[-1]) if readable else None, may_open, handed_in=handed_in
        ),
        judge_parameters(contents),
        judge_saved_outputs(
            contents, evidence, last_due if required else until,
            required=required, handed_in=handed_in,
        ),
    ))  # fmt: skip
    findings = ordered(_with_files(judged.findings, folder))
    checklist_input = ChecklistInput(
        lab, spec, contents.ros, contents.listing, results, findings, evidence
    )
    to_come = () if handed_in else tuple(n for n in lab.checkpoints if n not in results)
    submission = Submission(
        str(folder), findings, decide_checklist(checklist_input), judged.crashes, handed_in, to_come
    )
    return FolderResult(tuple(results.values()), submission)


def _is_concluded(contents: FolderContents) -> bool:
    """Whether a folder contains a deliverable that concludes the work, such as the report."""
    held = contents.listing.deliverables
    return any(
        deliverable.concludes and len(held.get(name, ())) >= deliverable.at_least
        for name, deliverable in contents.spec.deliverables.items()
    )


def _results(
    contents: FolderContents, settings: JudgeSettings
) -> Iterator[tuple[str, StageResult]]:
    """Judge the files that USD can open; the others have a finding of their own."""
    endings = (*contents.spec.stages.endings, *contents.spec.stages.openable)
    for number, stage in contents.listing.stages.items():
        if PurePosixPath(stage.path).suffix.lower() not in endings:
            continue
        path = str(contents.root / stage.path)
        try:
            result = judge_stage(path, settings, (contents.lab, number))
        except (Lab3Error, MemoryError):
            raise
        except Exception as error:
            if type(error).__module__.startswith("pxr."):
                raise  # the file is damaged, which the caller tells from a failure of ours
            result = crashed(path, number, failure_text(error), FAILED)
        yield number, result


_MOST_UNJUDGED = 50


def _unjudged(contents: FolderContents) -> Iterator[UnjudgedStage]:
    """Yield the stage files without a checkpoint that no stage refers to.

    The folder of the starter holds assets: only those with parts of the lab are yielded.
    """
    from lab3_usd.stage.graph_signature import files_read

    listing, root, files = contents.listing, contents.root, contents.spec.stages
    stages = listing.stages.values()
    taken = {path for stage in stages for path in (stage.path, *stage.others, *stage.more)}
    left = [
        entry
        for entry in listing.entries
        if not entry.why_not and stage_ending(entry, files)
        if entry.path not in taken and entry.path != listing.starter
    ][:_MOST_UNJUDGED]
    paths = [*(stage.path for stage in stages), *(entry.path for entry in left)]
    # Most are layers of the stages, which come first: then nothing else is opened.
    read = cache(lambda path: files_read(root / path))
    for entry in left:
        own = os.path.realpath(root / entry.path)
        if any(own in read(path) for path in paths if path != entry.path):
            continue
        number = _fitting_checkpoint(root / entry.path, contents)
        is_asset = entry.path.partition("/")[0].lower() == contents.spec.folders.starter
        if number not in ("", contents.lab.first) or not is_asset:
            yield UnjudgedStage(entry.path, number)


def _fitting_checkpoint(path: Path, contents: FolderContents) -> str:
    """Return the checkpoint whose graphs are in a stage, one that has no stage first."""
    from lab3_usd.check.match.graphs import find_graphs
    from lab3_usd.stage.read.opening import open_stage
    from lab3_usd.stage.read.stage_reader import read_model

    lab = contents.lab
    try:
        model = read_model(open_stage(path), lab.platform, str(path))
    except StageError:
        return ""
    graphs = find_graphs(lab.graphs, model)
    graph_names = {name for name, graph in graphs.items() if graph is not None and graph.nodes}
    if not graph_names and model.prim(lab.scene.robot.path) is None:
        return ""
    fitting = [n for n, point in lab.checkpoints.items() if {*point.graphs} == graph_names]
    open_ones = (number for number in fitting if number not in contents.listing.stages)
    return next(open_ones, next(iter(fitting), ""))


def _digest(path: Path) -> str:
    """Return the digest of a file; its path if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return str(path)


def _with_files(findings: Iterable[Finding], folder: Path) -> Iterator[Finding]:
    """Add the file to open to findings whose site is a file of the folder."""
    for finding in findings:
        path = folder / finding.prim
        is_file = not path.is_symlink() and path.is_file()
        yield replace(finding, layer=str(path)) if is_file else finding


def find_starters(
    folder: Path, listing: Listing, supplied: Path | Starter | None, lab: Lab
) -> _Starters:
    """Open the supplied starter, else the submission's own; only the first is trusted.

    Raises:
        StageError: the supplied starter cannot be opened.
    """
    trusted = None if supplied is None else opened_starter(supplied, lab)
    if listing.starter is None:
        return _Starters(trusted)
    submitted = StarterFile(listing.starter)
    try:
        own = open_starter(folder / listing.starter, lab, trusted=False)
        holds = tuple(_holds(own, trusted, lab))
    except StageError as error:
        fault = str(error).removeprefix(f"{folder / listing.starter}: ")
        return _Starters(trusted, replace(submitted, fault=fault))
    compared = trusted if trusted is not None else None if holds else own
    return _Starters(compared, replace(submitted, holds=holds))


def _holds(own: Starter, trusted: Starter | None, lab: Lab) -> Iterator[str]:
    """Yield what a starter should not contain yet, or what differs from the supplied one."""
    from lab3_usd.stage.compare.stages import compare_starter
    from lab3_usd.stage.read.stage_reader import read_model

    model = read_model(own.stage, lab.platform, str(own.path))
    added = [graph.path for graph in model.graphs]
    added += (sensor.path for sensor in lab.sensors.values() if model.prim(sensor.path))
    yield from added
    if trusted is not None and not added:
        first = next(iter(lab.checkpoints))
        changes = compare_starter(trusted.stage, own.stage, lab, first).changes
        yield from (f"a change of {change.prim}" for change in changes)
