"""Rules about the files of a submission.

Which are there, what they are called, and what they show.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

from lab3_usd.check.registry import rule
from lab3_usd.data import as_called
from lab3_usd.model.finding import Problem, Severity, StageResult
from lab3_usd.model.folder import StageFile, SubmissionSubject
from lab3_usd.spec.submission import is_called


@rule("X01", "missing-stage", scope="submission")
def missing_stage(subject: SubmissionSubject) -> Iterator[Problem]:
    """The stage of a checkpoint is missing.

    Why: each part of the lab is judged by the stage that was saved at its end. Later stages do not
    show that earlier ones worked.

    Fix: save the stage under the name in the handout into the folder `{stages}`. If it was
    forgotten, open the next stage, delete what its part added, and save it under the missing name.

    Example: `{stages}` holds `{stage2}` and `{stage4}`, but no `{stage3}`.
    """
    if not subject.handed_in:
        return
    handout, ending = subject.spec.stages.handout, subject.spec.stages.endings[0]
    unusable = {entry.name.partition(".")[0] for entry in subject.listing.entries if entry.why_not}
    for number, checkpoint in subject.lab.checkpoints.items():
        if checkpoint.optional:
            continue
        is_there = any(is_called(stem, checkpoint.file) for stem in unusable)
        if number in subject.listing.stages or is_there:
            continue
        name = f"{checkpoint.file}{ending}"
        folder = subject.listing.stage_folder
        path = f"{folder}/{name}" if folder else name
        yield Problem(
            path, f"the stage of checkpoint {number} is missing", None, name, None, handout
        )


@rule("X02", "misnamed-stage", scope="submission")
def misnamed_stage(subject: SubmissionSubject) -> Iterator[Problem]:
    """A stage has another name.

    Why: a program that collects the files by name does not find it. File names on Linux are
    case-sensitive.

    Fix: rename the file to the name given here.

    Example: `{stage3}.txt` instead of `{stage3}`.
    """
    for stage, name in _stages(subject, "misnamed"):
        message = f"seems to be the stage of checkpoint {stage.checkpoint}, which is called {name}"
        yield _named(stage, message, name, subject.spec.stages.handout)


@rule("X03", "misplaced-stage", scope="submission", severity="warning")
def misplaced_stage(subject: SubmissionSubject) -> Iterator[Problem]:
    """A stage is not in its folder.

    Why: the handout asks for one folder of stages. Relative paths to textures and references break
    in another folder.

    Fix: open the stage and save it into the folder `{stages}`, so that Isaac Sim updates its
    relative paths.

    Example: `{stage3}` beside the folder `{stages}`.
    """
    for stage, name in _stages(subject, "misplaced"):
        place = subject.listing.stage_folder or "the submission itself"
        message = f"stage of checkpoint {stage.checkpoint} lies elsewhere, expected in {place}"
        yield _named(stage, message, name, subject.spec.stages.handout)


@rule("X04", "no-usd-extension", scope="submission", formerly="no-usd-ending")
def no_usd_extension(subject: SubmissionSubject) -> Iterator[Problem]:
    """A stage has the unknown extension `.uda`.

    Why: neither Isaac Sim nor USD opens it. `.usda` is probably meant.

    Fix: rename the file to end in `.usda`, and open it once in Isaac Sim to check that it is
    complete.

    Example: `{stem1}.uda`.
    """
    for stage, name in _stages(subject, "slip"):
        ending = stage.path.rpartition(".")[2]
        message = (
            f"'.{ending}' is not an ending of USD; '{subject.spec.stages.endings[0]}' is meant"
        )
        yield _named(stage, message, name)


@rule(
    "X05", "two-stage-files", scope="submission", severity="warning", formerly="stage-in-two-forms"
)
def two_stage_files(subject: SubmissionSubject) -> Iterator[Problem]:
    """A checkpoint has several stages.

    Why: the submission does not say which of the two counts. One is judged: the one with the name
    in the handout in the folder `{stages}`, with the handout's own extension. It is a note if the
    other is in another folder or has another name.

    Fix: delete the older of the two.

    Example: `{stem3}.usda` and `{stem3}.usd`.
    """
    handout = subject.spec.stages.handout
    for stage in subject.listing.stages.values():
        judged = f"second file for checkpoint {stage.checkpoint}; {stage.path} is judged"
        for path in stage.others:
            yield Problem(path, f"a {judged}", handout=handout, related=(stage.path,))
        for path in stage.more:
            message = f"seems to be a {judged}"
            yield Problem(path, message, handout=handout, severity="note", related=(stage.path,))


@rule("X13", "stage-not-judged", scope="submission", severity="note")
def stage_not_judged(subject: SubmissionSubject) -> Iterator[Problem]:
    """A stage's name gives no checkpoint.

    Why: stages are found by their names, so that nothing in this file counts. It is a warning where
    its content fits a checkpoint that has no stage.

    Fix: rename the file to the name given here if it is that stage, else delete it.

    Example: `{stages}/finished.usda`.
    """
    ending, handout = subject.spec.stages.endings[0], subject.spec.stages.handout
    for stage in subject.unjudged:
        number = stage.checkpoint
        name = f"{subject.lab.checkpoints[number].file}{ending}" if number else None
        fits = f"; its content fits checkpoint {number}, which is called {name}" if number else ""
        is_missed = bool(number) and number not in subject.listing.stages
        message = f"was not judged: it has the name of no checkpoint{fits}"
        severity: Severity | None = "warning" if is_missed else None
        yield Problem(stage.path, message, expected=name, handout=handout, severity=severity)


@rule("X11", "file-not-opened", scope="submission")
def file_not_opened(subject: SubmissionSubject) -> Iterator[Problem]:
    """A file is a link out, a pipe, a device, or unreadable.

    Why: such files are never opened. A link shows another file on every computer, and reading a
    pipe can wait forever.

    Fix: put the file itself into the submission, readable for everybody.

    Example: `{stages}/{stage3}` is a link to a file in somebody's home.
    """
    handout = subject.spec.folders.handout
    for entry in subject.listing.entries:
        if entry.why_not:
            yield Problem(entry.path, f"was not opened: {entry.why_not}", handout=handout)


@rule("X12", "too-many-files", scope="submission", severity="warning")
def too_many_files(subject: SubmissionSubject) -> Iterator[Problem]:
    """The folder contains too many files.

    Why: only the first thousands of files were examined. The rest of the submission was not seen.

    Fix: hand in the folder of the lab alone, without installations, caches or build folders.

    Example: a whole home folder.
    """
    if not subject.listing.complete:
        count = len(subject.listing.entries)
        yield Problem(".", f"only the first {count} files were looked at", actual=str(count))


def _stages(subject: SubmissionSubject, how: str) -> Iterator[tuple[StageFile, str]]:
    """Yield the stages that are named in one way, with the name each should have."""
    ending = subject.spec.stages.endings[0]
    for number, stage in subject.listing.stages.items():
        if stage.naming == how:
            yield stage, f"{subject.lab.checkpoints[number].file}{ending}"


def _named(stage: StageFile, message: str, name: str, handout: str | None = None) -> Problem:
    actual = stage.path.rpartition("/")[2]
    return Problem(stage.path, message, None, name, actual, handout)


_SHOWN = 3  # titles that a message names


@rule("X06", "starter-not-there", scope="submission", severity="note")
def starter_not_there(subject: SubmissionSubject) -> Iterator[Problem]:
    """The supplied starter is missing.

    Why: without it, overwriting cannot be noticed, and the stages are not compared with it.

    Fix: put the supplied file into `{assets}`, or give it with `--starter`.

    Example: a submission without the folder `{assets}`.
    """
    if subject.handed_in and subject.starter is None and subject.listing.stage_folder:
        name = f"{subject.spec.stages.starter}{subject.spec.stages.endings[0]}"
        path = f"{subject.spec.folders.starter}/{name}"
        yield Problem(path, "the starter is not here", handout=subject.spec.folders.handout)


@rule("X07", "starter-overwritten", scope="submission")
def starter_overwritten(subject: SubmissionSubject) -> Iterator[Problem]:
    """The starter contains parts of the lab, or cannot be opened.

    Why: the handout says not to overwrite it. It is the file to return to, and the stages are
    compared with it.

    Fix: put the supplied file into `{assets}` again.

    Example: `{graph_name}` in `{starter}`.
    """
    starter = subject.starter
    if starter is None:
        return
    handout = subject.spec.stages.handout
    if starter.fault:
        yield Problem(starter.path, f"the starter cannot be used: {starter.fault}", handout=handout)
    elif starter.holds:
        message = f"the starter was overwritten: it holds {_few(starter.holds)}"
        yield Problem(starter.path, message, actual=starter.holds[0], handout=handout)


@rule("X08", "lost-work", scope="submission", severity="warning")
def lost_work(subject: SubmissionSubject) -> Iterator[Problem]:
    """A checkpoint lacks what the previous one had.

    Why: each part builds on the previous one. If a stage was saved from an older file, or something
    was deleted by accident, all later stages lack it too. Wrong values and cut wires have findings
    of their own: what counts are nodes and prims that are gone. Before the folder is submitted,
    only many losses at once are reported.

    Fix: open the previous checkpoint, repeat the last part there, and save it under this name.

    Example: `{stage4}` was made from `{stage2}`: what `{stage3}` adds is missing.
    """
    results = [item for item in subject.results.items() if item[1].verdict != "unreadable"]
    for (before, earlier), (number, later) in pairwise(results):
        if subject.digests.get(before) == subject.digests.get(number):
            continue
        lost = _lost(earlier, later)
        if len(lost) > (0 if subject.handed_in else _SHOWN):
            path = subject.listing.stages[number].path
            message = f"these parts of checkpoint {before} are missing here: {_few(tuple(lost))}"
            earlier_path = subject.listing.stages[before].path
            handout = subject.spec.stages.handout
            yield Problem(
                path, message, actual=str(len(lost)), handout=handout, related=(earlier_path,)
            )


def _lost(earlier: StageResult, later: StageResult) -> list[str]:
    """Return the titles of the nodes and prims that the earlier stage has and the later lacks."""
    had = {requirement.id for requirement in earlier.requirements if requirement.met}
    gone = {name for finding in later.findings if finding.absent for name in finding.unmet}
    return [
        f"{requirement.group}: {requirement.title}"
        for requirement in later.requirements
        if requirement.id in had and not requirement.met
        if requirement.kind == "node" or requirement.id in gone or requirement.id.endswith("/prim")
    ]


@rule("X09", "same-file-twice", scope="submission")
def same_file_twice(subject: SubmissionSubject) -> Iterator[Problem]:
    """Two checkpoints that must differ are the same file.

    Why: each of these checkpoints adds something to the one before. A copy under another name shows
    nothing.

    Fix: save the stage at the end of each part under its own name.

    Example: `{stage1}` and `{stage2}` have the same bytes.
    """
    for number, first in _copies(subject.digests, subject.spec.stages.differ).items():
        stages = subject.listing.stages
        message = f"the same file, to the byte, as checkpoint {first}"
        handout, first_path = subject.spec.stages.handout, stages[first].path
        yield Problem(
            stages[number].path, message, actual=first_path, handout=handout, related=(first_path,)
        )


def _copies(digests: Mapping[str, str], differ: tuple[str, ...]) -> dict[str, str]:
    """Map each checkpoint whose file an earlier one has already to that one."""
    first: dict[str, str] = {}
    copies = {}
    for number in differ:
        digest = digests.get(number)
        if digest is not None and first.setdefault(digest, number) != number:
            copies[number] = first[digest]
    return copies


@rule("X10", "deliverable-not-found", scope="submission", severity="note")
def deliverable_not_found(subject: SubmissionSubject) -> Iterator[Problem]:
    """A deliverable was not found.

    Why: report, pictures, video, configuration and logs are deliverables. They may have been handed
    in elsewhere, so this is only a note.

    Fix: put them into the submission: a report as PDF, the pictures in a folder, the link to the
    video in a text file.

    Example: no link to a video in any text file.
    """
    if not subject.handed_in:
        return
    for name, wanted in subject.spec.deliverables.items():
        files = subject.listing.deliverables.get(name, ())
        if len(files) >= wanted.at_least:
            continue
        count = f"{len(files)} of at least {wanted.at_least}" if wanted.at_least > 1 else "not"
        message = f"{wanted.title}: {count} found"
        yield Problem(
            ".", message, None, str(wanted.at_least), str(len(files)), wanted.handout,
            hint=as_called(wanted.hint),
        )  # fmt: skip


def _few(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
