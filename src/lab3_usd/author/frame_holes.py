"""Frames of links and prims, as recipes ask for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lab3_usd.author.choosing import present_prim
from lab3_usd.author.ros_holes import domain_holes, namespace_holes
from lab3_usd.author.task import Hole, Task, robot_of_task
from lab3_usd.errors import UsageError
from lab3_usd.facts.domains import Domain, may_meet
from lab3_usd.facts.endpoints import namespaces_above, ros_name
from lab3_usd.facts.frame_targets import frame_of_prim
from lab3_usd.facts.frames import Edge, all_edges
from lab3_usd.model.stage import StageModel


def chassis(task: Task) -> Iterator[Hole]:
    """Yield the base that odometry is of, its frame, and the links whose frames come with it."""
    robot, stage, options = robot_of_task(task), task.stage, task.options
    natural = frame_of_prim(robot.base, stage)
    frame = options.frame or natural
    source = "given" if options.frame else f"the name of {robot.base}"
    yield Hole("base_frame", frame, "base", f"{frame}", source, "--frame")
    if options.robot_tf is False:
        yield Hole("link_frames", None)
        return
    links = [link for link in robot.links if link != robot.base]
    if options.frame and options.frame != natural:
        if options.robot_tf:
            raise UsageError(
                f"--frame {options.frame}: the links hang below {natural}, the name of "
                f"{robot.base}; give isaac:nameOverride to that prim, or --no-robot-tf"
            )
        yield Hole("link_frames", None, "links", "none", f"they hang below {natural}", "--robot-tf")
        return
    sent = sent_frames(task)
    already = [link for link in links if frame_of_prim(link, stage) in sent]
    new = tuple(link for link in links if link not in already)
    if already and options.robot_tf:
        first = frame_of_prim(already[0], stage)
        raise UsageError(
            f"the frame {first} is sent already, by {sent[first].publisher}; --no-robot-tf"
        )
    shown = ", ".join(frame_of_prim(link, stage) for link in new) or "none"
    source = f"below {natural}"
    if already:
        sender = sent[frame_of_prim(already[0], stage)].publisher
        source = f"{len(already)} are sent already, by {sender}"
    yield Hole("link_frames", new, "links", shown, source, "--robot-tf")


def sent_frames(task: Task) -> dict[str, Edge]:
    """Return the transforms that are sent where a request would send its own, by their frames."""
    values = {hole.name: hole.value for hole in (*namespace_holes(task), *domain_holes(task))}
    usual = task.recipe.usual
    topic = usual.get("tf_topic") or usual.get("topic", "")
    own = [value for _, value in namespaces_above(task.path, task.stage)]
    name = ros_name(values["tf_namespace"] or next(iter(own), ""), topic)
    domain = Domain(str(values["domain"] or 0), values["domain_by_environment"] is not False)
    return {
        edge.child: edge
        for edge in all_edges(task.stage)
        if edge.topic == name and may_meet(edge.domain, domain)
    }


def frame_above(targets: Iterable[str], parent: str | None, stage: StageModel) -> str:
    """Return the frame of a parent prim, the world's without one.

    Raises:
        UsageError: a target is not there, or would be its own parent.
    """
    top = frame_of_prim(parent, stage) if parent else stage.platform.world_frame
    for target in targets:
        present_prim(target, stage, "--targets")
        if target == parent or frame_of_prim(target, stage) == top:
            raise UsageError(f"{top} would be its own parent: {target} below {parent}")
    return top


def frames(task: Task) -> Iterator[Hole]:
    """Yield the prims whose frames are sent, and the one below which they hang."""
    stage, options, robot = task.stage, task.options, task.robot
    parent = options.parent
    if parent is not None:
        present_prim(parent, stage, "--parent")
    if options.targets is not None:
        targets = options.targets
        if not targets:
            raise UsageError("--targets: names no prim")
        source = "given"
    elif robot is not None:
        if parent is None and not robot.is_fixed:
            parent = robot.base
        targets = tuple(link for link in robot.links if link != parent)
        source = f"the links of {robot.path}"
    else:
        targets, source = (), ""
    top = frame_above(targets, parent, stage)
    shown = ", ".join(frame_of_prim(target, stage) for target in targets)
    yield Hole("targets", targets, "frames", shown, source, "--targets")
    why = f"the base of {robot.path}" if parent and robot else "no prim"
    yield Hole("parent", parent, "parent", top, "given" if options.parent else why, "--parent")
