"""Rules about what the saved outputs show of the TF tree (J5, J6)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from lab3_usd.check.registry import rule
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.folder.lab_files import Edge, EvidenceSubject, Lookup, Observation, judge_best
from lab3_usd.spec.ros import Command


@rule("E10", "forbidden-transform-shown", scope="evidence")
def forbidden_transform_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A saved TF tree contains `world -> odom`.

    Why: with AMCL's `map -> odom` the frame `odom` has two parents. tf2 jumps between them and
    localization fails.

    Fix: delete or deactivate the transform publisher with parent `world` and child `{root}`, then
    run `view_frames` again.

    Example: `"world" -> "odom"` in frames.gv.
    """
    for shown in subject.evidence.view_frames.get("", ()):
        for each in filter(subject.frames.is_forbidden, shown.fact):
            edge = " -> ".join(each)
            message = f"the TF tree contains {edge}"
            yield Problem(shown.file, message, edge)


@rule("E11", "transform-not-shown", scope="evidence")
def transform_not_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """The saved TF tree lacks a required frame, or the frame has another parent.

    Why: a component that needs the transform from `{above}` to `{lidar_link}`, as Nav2 does for
    every scan, waits for ever. A tree that only lacks `{above} -> {root}` may have been saved
    before localization, with the stage: a note, or an error if evidence is required, because it
    does not show the final tree.

    Fix: set the initial pose if `map -> odom` is missing. Repair the odometry and TF graph if a
    frame of the robot is missing. Then run `view_frames` again while Isaac Sim plays.

    Example: the tree starts at `odom`, because no initial pose was set.
    """
    required: list[tuple[str, str]] = [*subject.frames.edges]
    localization = subject.frames.localization
    if localization is not None and subject.asks_from(localization.since):
        required.insert(0, localization.edge)

    def judge(shown: Observation[tuple[Edge, ...]]) -> list[Problem]:
        if not shown.fact:
            return [Problem(shown.file, "the TF tree is empty")]
        parents = {child: parent for parent, child in shown.fact}
        found = list(_missing(required, parents, subject.frames.deeper_under, shown.file))
        return [_before_localization(subject, each) for each in found]

    yield from judge_best(subject.evidence.view_frames.get("", ()), judge)


def _before_localization(subject: EvidenceSubject, problem: Problem) -> Problem:
    """Make a note of the transform that a tree from before localization cannot show."""
    parent, child = subject.frames.above, subject.frames.root
    if problem.property != f"{parent} -> {child}" or problem.actual is not None:
        return problem
    severity: Severity = "error" if subject.required else "note"
    message = f"the TF tree does not show {parent} -> {child}; was it saved before localization?"
    return replace(problem, message=message, severity=severity)


def _missing(
    required: list[Edge], parents: Mapping[str, str], deeper_under: str, file: str
) -> Iterator[Problem]:
    for parent, child in required:
        actual = parents.get(child)
        edge = f"{parent} -> {child}"
        if actual is None:
            yield Problem(file, f"the TF tree lacks {edge}", edge)
        elif actual != parent and not (
            parent == deeper_under and parent in _ancestors(child, parents)
        ):
            message = f"{child} hangs below {actual}, expected {edge}"
            yield Problem(file, message, edge, parent, actual)


def _ancestors(frame: str, parents: Mapping[str, str]) -> list[str]:
    found: list[str] = []
    while frame in parents and parents[frame] not in found:
        frame = parents[frame]
        found.append(frame)
    return found


@rule("E12", "frame-with-two-parents", scope="evidence")
def frame_with_two_parents(subject: EvidenceSubject) -> Iterator[Problem]:
    """A frame has two parents in one saved TF tree, or different parents in two trees.

    Why: tf2 keeps the latest parent. The tree, and everything placed in it, jumps.

    Fix: find both publishers with `ros2 topic info /tf --verbose`, and delete the wrong one.

    Example: one run of `view_frames` shows `map -> odom`, the next `world -> odom`.
    """
    forbidden = subject.frames.is_forbidden  # of such a transform E10 speaks
    first: dict[str, tuple[str, str]] = {}
    for shown in subject.evidence.view_frames.get("", ()):
        for parent, child in shown.fact:
            known, file = first.setdefault(child, (parent, shown.file))
            if known == parent or forbidden((parent, child)) or forbidden((known, child)):
                continue
            # Two files may be from before and after a repair, one file may not.
            severity: Severity = "error" if file == shown.file else "warning"
            message = f"{child} hangs below {known} and below {parent}"
            yield Problem(shown.file, message, child, related=(file,), severity=severity)


@rule("E13", "transform-lookup-failed", scope="evidence")
def transform_lookup_failed(subject: EvidenceSubject) -> Iterator[Problem]:
    """`tf2_echo` never printed the requested transform.

    Why: the two frames are not connected, or no simulation time arrives. Localization and
    navigation need the same transform.

    Fix: check `{root} -> {base}` first, then AMCL and the initial pose.

    Example: the output repeats `Waiting for transform {above} -> {base}`.
    """
    asked = [c for c in subject.ros.commands if c.to and not c.extra and subject.asks_from(c.since)]
    for command in asked:

        def judge(shown: Observation[Lookup], command: Command = command) -> list[Problem]:
            if shown.fact.found:
                return []
            edge = f"{command.of} -> {command.to}"
            message = f"no transform {edge} was printed"
            return [Problem(shown.file, message, edge)]

        yield from judge_best(subject.evidence.tf2_echo.get(command.target, ()), judge)
