"""Rules about the saved output of the running system: what is there, nodes, goal, software."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lab3_usd.check.registry import rule
from lab3_usd.check.rules.submission.file_values import shortened
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.folder.lab_files import GOAL, EvidenceSubject, Observation, judge_best
from lab3_usd.spec.ros import Command


@rule("E01", "evidence-not-shown", scope="evidence", severity="note")
def evidence_not_shown(subject: EvidenceSubject) -> Iterator[Problem]:
    """The results lack the output of a diagnostic command that the handout asks for.

    Why: without the output nothing can be judged. The stage alone does not show whether messages
    arrived.

    Fix: run `lab3 collect -o collect.sh`, then `bash collect.sh` in the submission folder while the
    system runs, or save the output of the commands by hand.

    Example: a folder `{shown}` without the output of `ros2 topic hz {scan}`.
    """
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
        each.shows(command.kind.name, command.target) for each in recordings
    )


@rule("E08", "lifecycle-not-active", scope="evidence")
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
            handout = place.handout

            def judge(
                shown: Observation[str], node: str = node, handout: str = handout
            ) -> list[Problem]:
                if shown.fact == wanted:
                    return []
                said = shortened(shown.fact)
                message = f"{node} is '{said}', expected '{wanted}'"
                return [Problem(shown.file, message, node, wanted, said, handout)]

            yield from judge_best(subject.evidence.lifecycle.get(node, ()), judge)


@rule("E09", "node-not-running", scope="evidence", severity="warning")
def node_not_running(subject: EvidenceSubject) -> Iterator[Problem]:
    """Nodes of localization or navigation are missing from all saved node lists.

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
    if not (listed and missing):
        return
    file, handout = listed[-1].file, wanted[missing[0]].handout
    if len(missing) == 1:
        message = f"{missing[0]} is not in the list of nodes"
        yield Problem(file, message, missing[0], handout=handout)
    else:
        message = f"{len(missing)} nodes are not in the list of nodes; was it saved early?"
        yield Problem(file, message, expected=", ".join(missing))


@rule("E15", "forbidden-publisher", scope="evidence")
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


@rule("E16", "goal-not-reached", scope="evidence")
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
    """A required software package is missing from the list of installed packages.

    Why: the handout asks for it, and a part of the lab cannot be shown without it.

    Fix: install it, for Humble `sudo apt install ros-humble-` and its name with dashes.

    Example: `rqt_image_view` is missing.
    """
    for shown in subject.evidence.packages.get("", ())[-1:]:
        for package, title in subject.ros.system.packages.items():
            if package not in shown.fact:
                message = f"{title} is not installed, there is no package '{package}'"
                yield Problem(shown.file, message, package, handout=subject.ros.system.handout)
