"""Runs every check of a behaviour, and names the node behind each fault."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from msgspec import Struct

from lab3_usd.model.dry_run import Check, Verdict
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.physics import FAR
from lab3_usd.sim.execution.program import Program
from lab3_usd.sim.execution.record import Message
from lab3_usd.sim.execution.running import Running
from lab3_usd.sim.judge.evidence import Cause, Evidence, Fault
from lab3_usd.sim.judge.motion import again, follows, limits, moving_frames, odometry, rest
from lab3_usd.sim.judge.sensors import camera, mounted, scan
from lab3_usd.sim.judge.topics import clock, stamps, topics, tree
from lab3_usd.sim.robot.machine import Joint, Machine

_RADIUS = "wheelRadius"
_TYPE = "type"  # the input of a helper that says what it publishes
SUBSCRIBER = "subscriber"


class RunCauses(Struct, frozen=True):
    """What a run knows of its nodes and its robot."""

    program: Program
    sent: Sequence[Message]
    robot: Machine | None
    commands: str

    def of_silence(self, topic: str, message: str) -> Cause | None:
        """Return why no message of this type comes on a topic."""
        for node in self.program.nodes.values():
            if _message(node) == message and SUBSCRIBER not in node.type.role:
                return self._elsewhere(node, topic) or self._broken(node)
        return None

    def remarks(self) -> Iterator[str]:
        """Say what the sizes of the robot do to its commands."""
        robot = self.robot
        radii = {round(each.radius, 4) for each in robot.wheels} if robot is not None else set()
        nodes = [node for node in self.program.nodes.values() if node.type.step_limits]
        told = {
            running.values.get(_RADIUS) or 0.0 for running in nodes if _RADIUS not in running.wires
        }
        if len(radii) == len(told) == 1 and radii != told and all(told):
            wheel, number = radii.pop(), told.pop()
            said = f"the wheels measure {wheel:g} m and the controller is told {number:g} m"
            yield f"{said}: the robot goes {wheel / number:.2f} times as far as it is told"

    def _elsewhere(self, node: Running, topic: str) -> Cause | None:
        own = [message for message in self.sent if message.node == node.path]
        other = next((message for message in own if message.topic != topic), None)
        if other is not None:
            is_below = other.topic.endswith(topic)
            kind: FaultKind = "namespaced-topic" if is_below else "wrong-topic"
            return Cause(node.path, f"it publishes {other.topic}", kind)
        away = next((message for message in own if message.away is not None), None)
        if away is not None:
            return Cause(node.path, f"it publishes in domain {away.away}", "wrong-domain")
        return None

    def _broken(self, node: Running, seen: frozenset[str] = frozenset()) -> Cause | None:
        """Return what is broken: first of what feeds or drives a node, then of the node."""
        seen |= {node.path}
        for running in self._before(node):
            if running.path not in seen:
                cause = self._broken(running, seen)
                if cause is not None:
                    return cause
        if node.failure is not None:
            return Cause(node.path, node.failure.reason, node.failure.kind)
        if not node.count and not node.pulled:
            idle = self.program.idle.get(node.path.rpartition("/")[0])
            if idle:
                return Cause(node.path, idle, "graph-not-evaluated")
            return Cause(node.path, "nothing drives it", "not-executed")
        return None

    def _before(self, node: Running) -> Iterator[Running]:
        for running in self.program.nodes.values():
            if any(node is follower for some in running.follows.values() for follower in some):
                yield running
        for source, _ in node.wires.values():
            yield source

    def of_motion(self) -> Cause | None:
        """Return why commands do not move the robot as they should."""
        return self._of_robot() or self._of_commands()

    def _of_robot(self) -> Cause | None:
        robot = self.robot
        if robot is None:
            return Cause("", "the stage has no robot with joints that turn", "no-driven-robot")
        if robot.held:
            return Cause(robot.base, "a joint ties the robot to the world", "base-fixed-to-world")
        if not robot.pulled:
            return Cause(robot.base, "gravity does not hold the robot on the ground", "no-gravity")
        if not robot.grounded:
            return Cause(robot.base, "no ground is below the robot", "no-ground")
        if not robot.wheels:
            return Cause(robot.base, "no wheel of the robot touches the ground", "no-wheel-contact")
        found = (_of_joint(joint, robot.base) for joint in robot.joints.values())
        return next(filter(None, found), None)

    def _of_commands(self) -> Cause | None:
        nodes = self.program.nodes.values()
        controllers = [running for running in nodes if running.type.drives is not None]
        if not controllers:
            return Cause("", "no node commands the joints", "no-joint-controller")
        for controller in controllers:
            cause = self._broken(controller)
            if cause is not None:
                return cause
        chain = [running for node in controllers for running in self._before(node)]
        speeds = next((running for running in chain if running.type.step_limits), controllers[0])
        return Cause(speeds.path, "", None)


def _of_joint(joint: Joint, site: str) -> Cause | None:
    if joint.locked:
        return Cause(site, f"{joint.name} is held by another joint", "locked-joint")
    if joint.stiffness > 0 or joint.damping <= 0:
        return Cause(site, f"{joint.name} has no velocity drive", "no-velocity-drive")
    if joint.reach < math.radians(FAR):
        return Cause(site, f"{joint.name} cannot turn freely", "limited-joint")
    return None


def _message(node: Running) -> str:
    """Return the type of the messages that a node would send or hear."""
    kind = node.values.get(_TYPE) if _TYPE in node.values else ""
    return node.type.message.get(str(kind or ""), node.type.message.get("", ""))


CHECKS: dict[str, Callable[[Evidence], Iterator[Fault]]] = {
    "topics": topics,
    "rest": rest,
    "follows": follows,
    "limits": limits,
    "odometry": odometry,
    "clock": clock,
    "stamps": stamps,
    "tree": tree,
    "moving frames": moving_frames,
    "mounted": mounted,
    "scan": scan,
    "camera": camera,
    "again": again,
}
SENSED = ("topics", "scan")  # what the assumed profile of a lidar bears on


def judge(evidence: Evidence) -> list[Check]:
    """Return a verdict for each thing that is looked at.

    Where something is not simulated, nothing is a fault: it could be what is missing.
    """
    return [verdict(name, list(look(evidence)), evidence) for name, look in CHECKS.items()]


def verdict(name: str, faults: list[Fault], evidence: Evidence) -> Check:
    """Return the verdict of what was found to be wrong."""
    if not faults:
        return Check(name, "ok")
    unknown = evidence.recording.not_simulated or (name in SENSED and evidence.recording.assumed)
    known = not unknown and any(fault.sure for fault in faults)
    told = next((fault for fault in faults if fault.prim), faults[0])
    said = "; ".join(fault.message for fault in faults)
    outcome: Verdict = "bad" if known else "not-simulated"
    return Check(name, outcome, said, told.prim, told.kind, told.cause)
