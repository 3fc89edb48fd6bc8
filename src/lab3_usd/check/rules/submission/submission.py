"""Rules about the files of a submission: which are there, and what they are called (4.4, 6.1)."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder.submission import StageFile, SubmissionSubject


@rule("X01", "missing-stage", scope="submission")
def missing_stage(subject: SubmissionSubject) -> Iterator[Problem]:
    """The stage of a checkpoint is missing from the submission.

    Why: each part of the lab is judged by the stage that was saved at its end. Later stages do not
    show that earlier ones worked.

    Fix: save the stage under the name in the handout into the folder `{stages}`. If it was
    forgotten, open the next stage, delete what its part added, and save it under the missing name.

    Example: `{stages}` holds `{stage2}` and `{stage4}`, but no `{stage3}`.
    """
    handout, ending = subject.spec.stages.handout, subject.spec.stages.endings[0]
    unusable = {entry.name.partition(".")[0] for entry in subject.listing.entries if entry.why_not}
    for number, checkpoint in subject.lab.checkpoints.items():
        if number in subject.listing.stages or checkpoint.file in unusable:
            continue
        name = f"{checkpoint.file}{ending}"
        folder = subject.listing.stage_folder
        path = f"{folder}/{name}" if folder else name
        yield Problem(
            path, f"the stage of checkpoint {number} is missing", None, name, None, handout
        )


@rule("X02", "misnamed-stage", scope="submission")
def misnamed_stage(subject: SubmissionSubject) -> Iterator[Problem]:
    """A stage has another name than the handout lists.

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
    """A stage has its right name, but is not in the folder of stages.

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


@rule("X04", "no-usd-ending", scope="submission")
def no_usd_ending(subject: SubmissionSubject) -> Iterator[Problem]:
    """A stage has the extension `.uda`, which USD does not have.

    Why: neither Isaac Sim nor USD opens it. `.usda` is probably meant.

    Fix: rename the file to end in `.usda`, and open it once in Isaac Sim to check that it is
    complete.

    Example: `{stem1}.uda`.
    """
    for stage, name in _stages(subject, "slip"):
        ending = stage.path.rpartition(".")[2]
        message = f"'.{ending}' is no ending of USD; '{subject.spec.stages.endings[0]}' is meant"
        yield _named(stage, message, name)


@rule("X05", "stage-in-two-forms", scope="submission", severity="warning")
def stage_in_two_forms(subject: SubmissionSubject) -> Iterator[Problem]:
    """A checkpoint has more than one stage.

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


@rule("X11", "file-not-opened", scope="submission")
def file_not_opened(subject: SubmissionSubject) -> Iterator[Problem]:
    """A file is a link out of the submission, a pipe or device, or cannot be read.

    Why: such files are never opened. A link shows another file on every computer, and reading a
    pipe waits for ever.

    Fix: put the file itself into the submission, readable for everybody.

    Example: `{stages}/{stage3}` is a link to a file in somebody's home.
    """
    handout = subject.spec.folders.handout
    for entry in subject.listing.entries:
        if entry.why_not:
            yield Problem(entry.path, f"was not opened: {entry.why_not}", handout=handout)


@rule("X12", "too-many-files", scope="submission", severity="warning")
def too_many_files(subject: SubmissionSubject) -> Iterator[Problem]:
    """The folder holds more files than a submission can have.

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
