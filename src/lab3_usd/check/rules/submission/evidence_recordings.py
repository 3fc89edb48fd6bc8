"""Rules about what the recordings of the running system show."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.check.rules.submission.file_values import shortened
from lab3_usd.model.dry_run.behaviour import Check
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder.lab_files import GOAL, EvidenceSubject, RecordingShown

_OF_EVIDENCE = "E"


@rule("E18", "recording-shows-fault", scope="evidence")
def recording_shows_fault(subject: EvidenceSubject) -> Iterator[Problem]:
    """A recording shows that the running system does something wrong.

    Why: a recording of `ros2 bag record` holds what the other commands print, and how the robot
    moved. What an evidence rule would say of an output is an error; what is measured (motion,
    stamps, scans) is a warning, as its tolerances are those of `lab3 bag`. What was not recorded is
    no fault, and neither is what another recording shows to be right.

    Fix: run `lab3 bag` on the recording, which shows all of it. Repair the graph that it names and
    record again.

    Example: `/odom is offered transient_local, not volatile`.
    """
    by_name: dict[str, list[tuple[RecordingShown, Check]]] = {}
    for recording in subject.evidence.recordings:
        for check in recording.checks:
            by_name.setdefault(check.name, []).append((recording, check))
    for name, found in by_name.items():
        recording, check = found[-1]
        if any(each.verdict != "bad" for _, each in found) or _reached(subject, name):
            continue
        yield Problem(
            recording.file,
            shortened(check.message),
            name,
            handout="J1",
            severity="error" if check.rule.startswith(_OF_EVIDENCE) else "warning",
            hint=f"`lab3 rule {check.rule}` explains such faults; `lab3 bag` shows all of it",
        )


def _reached(subject: EvidenceSubject, check: str) -> bool:
    """Whether a saved output shows a goal that succeeded."""
    goal, outputs = subject.ros.goal, subject.evidence.goals.get("", ())
    return check == GOAL and any(e.fact.status == goal.succeeded for e in outputs if goal)


@rule("E19", "recording-not-read", scope="evidence", severity="warning")
def recording_not_read(subject: EvidenceSubject) -> Iterator[Problem]:
    """A recording could not be read, or not all of it was.

    Why: it shows nothing then. One that was not ended by Ctrl-C lacks its end, and large ones are
    not opened. Where the checking computer lacks the extra `sim`, it is a note.

    Fix: end `ros2 bag record` with Ctrl-C, leave images out (`collect.sh --bag` does), and hand in
    the whole folder.

    Example: `run_0.mcap` is missing.
    """
    unread = [each for each in subject.evidence.recordings if each.unread]
    lacking = [each for each in unread if each.for_lack]
    for each in lacking[:1]:
        message = f"{len(lacking)} recordings were not read: {each.unread}"
        hint = "pip install 'lab3-usd[sim]'"
        yield Problem(each.file, message, handout="J1", severity="note", hint=hint)
    for each in unread:
        if not each.for_lack:
            yield Problem(each.file, f"the recording {shortened(each.unread)}", handout="J1")
