"""Rules about the saved output of the running system.

What is there, nodes, goal, software, TF tree, recordings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from msgspec.structs import replace

from lab3_usd.check.explanations import explaining_rule
from lab3_usd.check.registry import rule
from lab3_usd.check.rules.evidence_topics import not_listed
from lab3_usd.check.rules.files import shortened
from lab3_usd.data import program
from lab3_usd.facts.tree import SentTransform, Tree, tree_of
from lab3_usd.model.dry_run import Check
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.folder import (
    GOAL,
    Edge,
    EvidenceSubject,
    Lookup,
    Observation,
    RecordingShown,
    judge_best,
)
from lab3_usd.spec.ros import Command


@rule("E01", "evidence-not-shown", scope="evidence", severity="note")
def evidence_not_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """The output of a diagnostic command is missing.

    Why: without the output nothing can be judged. The stage alone does not show whether messages
    arrived.

    Fix: run `lab3 collect -o collect.sh`, then `bash collect.sh` in the submission folder while the
    system runs, or save the output of the commands by hand.

    Example: a folder `{shown}` without the output of `ros2 topic hz {scan}`.
    """
    if not subject.handed_in:
        return
    missing: dict[str, list[Command]] = {}
    asked = [c for c in subject.ros.commands if not c.extra and subject.asks_from(c.since)]
    for command in asked:
        if not _is_shown(subject, command):
            missing.setdefault(command.kind.name, []).append(command)
    severity: Severity = "error" if subject.required else "note"
    folder = subject.evidence.folder
    if sum(map(len, missing.values())) == len(asked) and asked:
        message = "no output of a diagnostic command was found"
        yield Problem(folder, message, severity=severity)
        return
    for commands in missing.values():
        lines = ", ".join(f"`{command.line}`" for command in commands)
        section = commands[0].handout.partition(",")[0]
        yield Problem(folder, f"not shown: {lines}", handout=section, severity=severity)


def _is_shown(subject: EvidenceSubject, command: Command) -> bool:
    goal = subject.ros.goal
    if goal is not None and command.of == goal.status:
        recorded = any(one.name == GOAL for e in subject.evidence.recordings for one in e.checks)
        return recorded or bool(subject.evidence.goals)
    shown: Mapping[str, object] = getattr(subject.evidence, command.kind.name)
    recordings = subject.evidence.recordings
    return command.target in shown or any(
        recording.shows(command.kind.name, command.target) for recording in recordings
    )


@rule("E08", "lifecycle-not-active", scope="evidence", needs="localization")
def lifecycle_not_active(subject: EvidenceSubject) -> Iterator[Problem]:
    """A node of localization or navigation was not active.

    Why: an `unconfigured` map server publishes no map, an `inactive` AMCL publishes no `map ->
    odom`, and a navigator that is not active rejects every goal.

    Fix: read the terminal of the launch for the first error, correct the map's path, then start the
    launch again and wait for `Managed nodes are active`.

    Example: `ros2 lifecycle get /amcl` says `inactive [2]`.
    """
    wanted = subject.ros.lifecycle.state
    for node, place in subject.ros.lifecycle.nodes.items():
        if subject.asks_from(place.since):
            judge = partial(_not_in_state, node, wanted, place.handout)
            yield from judge_best(subject.evidence.lifecycle.get(node, ()), judge)


def _not_in_state(
    node: str, wanted: str, handout: str, shown: Observation[str]
) -> Iterator[Problem]:
    if shown.fact != wanted:
        actual = shortened(shown.fact)
        message = f"{node} is '{actual}', expected '{wanted}'"
        yield Problem(shown.file, message, node, wanted, actual, handout)


@rule("E09", "node-not-running", scope="evidence", severity="warning", needs="localization")
def node_not_running(subject: EvidenceSubject) -> Iterator[Problem]:
    """A localization or navigation node is in no saved node list.

    Why: without its lifecycle manager nothing is configured. Without the behaviour server a goal
    fails at the first recovery.

    Fix: save `ros2 node list` while localization and navigation run.

    Example: `/velocity_smoother` is missing, although Nav2 sends its commands through it.
    """
    listed = subject.evidence.node_list.get("", ())
    names = {name for shown in listed for name in shown.fact}
    wanted = {**subject.ros.lifecycle.nodes, **subject.ros.nodes}
    missing = [
        n for n, place in wanted.items() if subject.asks_from(place.since) and n not in names
    ]
    if listed and missing:
        yield not_listed(listed[-1].file, "nodes", missing, wanted[missing[0]].handout)


@rule("E15", "forbidden-publisher", scope="evidence", needs="forbidden transform")
def forbidden_publisher(subject: EvidenceSubject) -> Iterator[Problem]:
    """The publisher of `world -> odom` runs: `_Graph_ROS_Odometry_TFWorld2Odom`.

    Why: it gives `odom` a second parent beside AMCL's `map`. tf2 then jumps between the two and the
    robot jumps on the map.

    Fix: delete the node TFWorld2Odom, or the graph `/Graph/ROS_Odometry` that Isaac Sim's own menu
    created, and save the stage.

    Example: `ros2 topic info /tf --verbose` names it among the publishers.
    """
    endings = tuple(subject.ros.forbidden_nodes.endings)  # none of them fits no name
    seen: dict[str, str] = {}
    for listed in subject.evidence.node_list.get("", ()):
        seen.update((name, listed.file) for name in listed.fact)
    for outputs in subject.evidence.topic_info.values():
        for shown in outputs:
            seen.update((endpoint.node, shown.file) for endpoint in shown.fact)
    for name, file in seen.items():
        if name.endswith(endings):
            message = f"{name} publishes a transform that the lab forbids"
            yield Problem(file, message, name, handout=subject.ros.forbidden_nodes.handout)


@rule("E16", "goal-not-reached", scope="evidence", needs="goal")
def goal_not_reached(subject: EvidenceSubject) -> Iterator[Problem]:
    """No navigation goal succeeded.

    Why: in the last checkpoint the robot reaches its goal. For an aborted goal, Nav2 found no path
    or lost its transforms, or the robot could not move.

    Fix: send a nearby goal in free space, wait until RViz says that it was reached, and save the
    status again (`collect.sh --goal`).

    Example: the last status is 6, aborted.
    """
    goal = subject.ros.goal
    outputs = subject.evidence.goals.get("", ())
    if goal is None or not subject.asks_from(goal.since) or not outputs:
        return
    if any(shown.fact.status == goal.succeeded for shown in outputs):
        return
    last = outputs[-1]
    actual, expected = goal.name(last.fact.status), goal.name(goal.succeeded)
    message = f"the navigation goal is '{actual}', expected '{expected}'"
    yield Problem(last.file, message, None, expected, actual, goal.handout)


@rule("E17", "software-missing", scope="evidence", severity="warning")
def software_missing(subject: EvidenceSubject) -> Iterator[Problem]:
    """The list of installed packages lacks a required one.

    Why: the handout asks for it, and a part of the lab cannot be shown without it.

    Fix: install it, for Humble `sudo apt install ros-humble-` and its name with dashes.

    Example: `tf2_tools` is missing.
    """
    for shown in subject.evidence.packages.get("", ())[-1:]:
        for package, title in subject.ros.system.packages.items():
            if package not in shown.fact:
                message = f"{title} is not installed, there is no package '{package}'"
                yield Problem(shown.file, message, package, handout=subject.ros.system.handout)


@rule("E10", "forbidden-transform-shown", scope="evidence", needs="forbidden transform")
def forbidden_transform_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """A saved TF tree contains `world -> odom`.

    Why: with AMCL's `map -> odom` the frame `odom` has two parents. tf2 jumps between them and
    localization fails.

    Fix: delete or deactivate the transform publisher with parent `world` and child `{root}`, then
    run `view_frames` again.

    Example: `"world" -> "odom"` in frames.gv.
    """
    for shown in subject.evidence.view_frames.get("", ()):
        for pair in filter(subject.frames.is_forbidden, shown.fact):
            edge = " -> ".join(pair)
            message = f"the TF tree contains {edge}"
            yield Problem(shown.file, message, edge)


@rule("E11", "transform-not-shown", scope="evidence")
def transform_not_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """The saved TF tree lacks or moves a required frame.

    Why: a component that needs the transform{localization?} from `{above}`{/} to `{lidar_link}`
    waits forever. {localization?}A tree that only lacks `{above} -> {root}` may have been saved
    before localization, with the stage: a note, or an error if evidence is required, because it
    does not show the final tree.{/}

    Fix: {localization?}set the initial pose if `{above} -> {root}` is missing. {/}Repair the graph
    that publishes the frame. Then run `view_frames` again while Isaac Sim plays.

    Example: {localization?}the tree starts at `{root}`, because no initial pose was
    set{else}`{link}` is missing, because its node was not triggered{/}.
    """
    localization = subject.frames.localization
    is_localized = localization is not None and subject.asks_from(localization.since)
    above = [localization.edge] if localization is not None and is_localized else []

    def judge(shown: Observation[tuple[Edge, ...]]) -> Iterator[Problem]:
        if not shown.fact:
            yield Problem(shown.file, "the TF tree is empty")
            return
        heard = tree_of(SentTransform(*edge) for edge in shown.fact)
        each = (
            [*_missing([*above, *tree.edges], heard, tree.deeper, shown.file)]
            for tree in subject.frames.each  # of which a file shows one
        )
        for problem in min(each, key=len):
            yield _before_localization(subject, problem)

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
    required: list[Edge], heard: Tree[SentTransform], deeper: tuple[str, ...], file: str
) -> Iterator[Problem]:
    for parent, child in required:
        above = heard.parents_of(child)
        edge = f"{parent} -> {child}"
        if not above:
            yield Problem(file, f"the TF tree lacks {edge}", edge)
        elif parent not in above and not (parent in deeper and parent in heard.above(child)):
            message = f"{child} hangs below {above[0]}, expected {edge}"
            yield Problem(file, message, edge, parent, above[0])


@rule("E12", "frame-with-two-parents", scope="evidence")
def frame_with_two_parents(subject: EvidenceSubject) -> Iterator[Problem]:
    """A frame has two parents in the saved TF trees.

    Why: tf2 keeps the latest parent. The tree, and everything placed in it, jumps.

    Fix: find both publishers with `ros2 topic info /tf --verbose`, and delete the wrong one.

    Example: one run of `view_frames` shows `{base} -> {link}`, the next `world -> {link}`.
    """
    heard = tree_of(
        SentTransform(*edge, shown.file)
        for shown in subject.evidence.view_frames.get("", ())
        for edge in shown.fact
        if not subject.frames.is_forbidden(edge)  # of such a transform E10 speaks
    )
    for child, (parent, *_) in heard.several_parents.items():
        first, *edges = (edge for edge in heard.by_child[child] if edge.parent != child)
        for edge in edges:
            if edge.parent == parent:
                continue
            # Two files may be from before and after a repair, one file may not.
            severity: Severity = "error" if edge.publisher == first.publisher else "warning"
            message = f"{child} hangs below {parent} and below {edge.parent}"
            file, related = edge.publisher, (first.publisher,)
            yield Problem(file, message, child, related=related, severity=severity)


@rule("E13", "transform-lookup-failed", scope="evidence")
def transform_lookup_failed(subject: EvidenceSubject) -> Iterator[Problem]:
    """`tf2_echo` never printed the requested transform.

    Why: the two frames are not connected, or no simulation time arrives. Every subscriber that
    needs the transform waits for it.

    Fix: check `{root} -> {base}` first{localization?}, then AMCL and the initial pose{/}.

    Example: the output repeats `Waiting for transform {above} -> {base}`.
    """
    asked = [c for c in subject.ros.commands if c.to and not c.extra and subject.asks_from(c.since)]
    for command in asked:
        outputs = subject.evidence.tf2_echo.get(command.target, ())
        yield from judge_best(outputs, partial(_not_printed, f"{command.of} -> {command.to}"))


def _not_printed(edge: str, shown: Observation[Lookup]) -> Iterator[Problem]:
    if not shown.fact.found:
        yield Problem(shown.file, f"no transform {edge} was printed", edge)


_OF_EVIDENCE = "E"


@rule("E18", "recording-shows-fault", scope="evidence")
def recording_shows_fault(subject: EvidenceSubject) -> Iterator[Problem]:
    """A recording shows a fault of the running system.

    Why: a recording of `ros2 bag record` holds what the other commands print, and how the robot
    moved. A fault that an evidence rule would report is an error; a measured one (motion, stamps,
    ranges) is a warning, since its tolerances are those of `lab3 bag`. Missing topics are not
    faults, nor are faults that another recording refutes.

    Fix: run `lab3 bag` on the recording, which shows all of it. Repair the graph that it names and
    record again.

    Example: `{scan} is offered transient_local, not volatile`.
    """
    by_name: dict[str, list[tuple[RecordingShown, Check]]] = {}
    for recording in subject.evidence.recordings:
        for check in recording.checks:
            by_name.setdefault(check.name, []).append((recording, check))
    for name, results in by_name.items():
        recording, check = results[-1]
        if any(result.verdict != "bad" for _, result in results):
            continue
        goal, outputs = subject.ros.goal, subject.evidence.goals.get("", ())
        if name == GOAL and any(e.fact.status == goal.succeeded for e in outputs if goal):
            continue  # a saved output shows that it was reached
        explained_by = explaining_rule(check)
        yield Problem(
            recording.file,
            shortened(check.message),
            name,
            handout="J1",
            severity="error" if explained_by.startswith(_OF_EVIDENCE) else "warning",
            hint=f"`{program()} rule {explained_by}` explains such faults; "
            f"`{program()} bag` shows all of it",
        )


@rule("E19", "recording-not-read", scope="evidence", severity="warning")
def recording_not_read(subject: EvidenceSubject) -> Iterator[Problem]:
    """A recording could not be read completely.

    Why: an unread recording shows nothing. A recording that was not ended with Ctrl-C is
    incomplete, and large ones are not opened. If the checking computer lacks the extra `sim`, it is
    a note.

    Fix: end `ros2 bag record` with Ctrl-C{camera?}, leave images out (`collect.sh --bag` does){/},
    and hand in the whole folder.

    Example: `run_0.mcap` is missing.
    """
    unread = [recording for recording in subject.evidence.recordings if recording.unread]
    lacking = [shown for shown in unread if shown.for_lack]
    for recording_shown in lacking[:1]:
        message = f"{len(lacking)} recordings were not read: {recording_shown.unread}"
        hint = f"`{program()} doctor` prints the command that installs it"
        yield Problem(recording_shown.file, message, handout="J1", severity="note", hint=hint)
    for shown in unread:
        if not shown.for_lack:
            yield Problem(shown.file, f"the recording {shortened(shown.unread)}", handout="J1")
