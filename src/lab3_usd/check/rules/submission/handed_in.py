"""Rules about what a submission shows: the starter, each part's work, the other deliverables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem, StageResult
from lab3_usd.model.folder.submission import SubmissionSubject

_SHOWN = 3  # titles that a message names


@rule("X06", "starter-not-there", scope="submission", severity="note")
def starter_not_there(subject: SubmissionSubject) -> Iterator[Problem]:
    """The supplied starter is missing from the folder of the starter.

    Why: without it nobody can see whether it was overwritten, and the stages are not compared with
    it.

    Fix: put the supplied file into `{assets}`, or give it with `--starter`.

    Example: a submission without the folder `{assets}`.
    """
    if subject.starter is None and subject.listing.stage_folder:
        name = f"{subject.spec.stages.starter}{subject.spec.stages.endings[0]}"
        path = f"{subject.spec.folders.starter}/{name}"
        yield Problem(path, "the starter is not here", handout=subject.spec.folders.handout)


@rule("X07", "starter-overwritten", scope="submission")
def starter_overwritten(subject: SubmissionSubject) -> Iterator[Problem]:
    """The starter holds parts of the lab, or can no longer be opened.

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
    """A checkpoint lacks something that the previous checkpoint had.

    Why: each part builds on the previous one. If a stage was saved from an older file, or something
    was deleted by accident, all later stages lack it too.

    Fix: open the previous checkpoint, repeat the last part there, and save it under this name.

    Example: `{stage4}` was made from `{stage2}`: what `{stage3}` adds is missing.
    """
    results = [each for each in subject.results.items() if each[1].verdict != "unreadable"]
    for (before, earlier), (number, later) in pairwise(results):
        if subject.digests.get(before) == subject.digests.get(number):
            continue
        lost = _lost(earlier, later)
        if lost:
            path = subject.listing.stages[number].path
            message = f"checkpoint {before} had what is gone here: {_few(tuple(lost))}"
            where = subject.listing.stages[before].path
            handout = subject.spec.stages.handout
            yield Problem(path, message, actual=str(len(lost)), handout=handout, related=(where,))


def _lost(earlier: StageResult, later: StageResult) -> list[str]:
    """Return the titles of what the earlier stage has and the later one lacks."""
    had = {each.id for each in earlier.requirements if each.met}
    return [
        f"{each.group}: {each.title}"
        for each in later.requirements
        if each.id in had and not each.met
    ]


@rule("X09", "same-file-twice", scope="submission")
def same_file_twice(subject: SubmissionSubject) -> Iterator[Problem]:
    """The stages of two checkpoints are the same file, although a part is between them.

    Why: each of these checkpoints adds something to the one before. A copy under another name shows
    nothing.

    Fix: save the stage at the end of each part under its own name.

    Example: `{stage1}` and `{stage2}` have the same bytes.
    """
    for number, first in _copies(subject.digests, subject.spec.stages.differ).items():
        stages = subject.listing.stages
        message = f"the same file, to the byte, as checkpoint {first}"
        handout, where = subject.spec.stages.handout, stages[first].path
        yield Problem(stages[number].path, message, actual=where, handout=handout, related=(where,))


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
    """A deliverable beside the stages was not found.

    Why: report, images, video, configuration and logs are deliverables. They may have been handed
    in elsewhere, so this is only a note.

    Fix: put them into the submission: a report as PDF, the images in a folder, the link to the
    video in a text file.

    Example: no link to a video in any text file.
    """
    for name, wanted in subject.spec.deliverables.items():
        found = subject.listing.found.get(name, ())
        if len(found) >= wanted.at_least:
            continue
        count = f"{len(found)} of at least {wanted.at_least}" if wanted.at_least > 1 else "not"
        message = f"{wanted.title}: {count} found"
        yield Problem(
            ".", message, None, str(wanted.at_least), str(len(found)), wanted.handout,
            hint=wanted.hint,
        )  # fmt: skip


def _few(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
