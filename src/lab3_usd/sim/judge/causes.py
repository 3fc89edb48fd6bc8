"""Why a topic is silent or the robot does not move: the node or joint at fault."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from posixpath import commonpath

from msgspec import Struct

from lab3_usd.isaac.node_types import INPUT, NodeType
from lab3_usd.model.dry_run import Scene
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.joint_drives import DRIVEN_AXES
from lab3_usd.model.physics import FAR, number
from lab3_usd.model.traction import Pull
from lab3_usd.physics.machine import Joint, Machine
from lab3_usd.sim.execution.node_instance import NodeInstance
from lab3_usd.sim.execution.program import Program, is_within
from lab3_usd.sim.execution.recording import Message
from lab3_usd.sim.execution.world import SUBSCRIBER
from lab3_usd.sim.judge.expectations import Cause, RunFault, ramps_of

_RADIUS = "wheelRadius"
_TYPE = "type"  # the input of a helper that says what it publishes


# What a fault of these kinds misses could be part of any asset, or of the asset of the robot.
_AROUND: tuple[FaultKind, ...] = (
    "no-ground", "no-wheel-contact", "no-gravity", "no-ray-returns", "no-driven-robot",
)  # fmt: skip
_PART: tuple[FaultKind, ...] = (
    "no-articulation", "unknown-joint", "wrong-command-count", "no-chassis-body", "no-target-prim",
    "missing-frame", "unknown-frame", "missing-camera-prim",
    "no-inertial-sensor",
)  # fmt: skip
# What a robot shows where commands go to its joints in another order.
_OF_ORDER: tuple[FaultKind, ...] = (
    "wrong-turn", "wrong-arc", "wrong-distance", "sideways-drift", "joint-off-target",
)  # fmt: skip
_OF_SURROUNDINGS = ("scan", "map")  # checks that show what stands around the robot
DRIVEN = ("rest", "follows", "limits", "again", "joints")  # checks that show how the robot moves
_TRANSFORMS, _CLOCK = "tf2_msgs/msg/TFMessage", "rosgraph_msgs/msg/Clock"
_SHOWN_BY = {  # checks, and the types of the messages in which they look
    "odometry": ("nav_msgs/msg/Odometry",),
    "clock": (_CLOCK,),
    "stamps": (_CLOCK,),
    "tree": (_TRANSFORMS,),
    "links": (_TRANSFORMS,),
    "joint states": ("sensor_msgs/msg/JointState",),
    "moving frames": (_TRANSFORMS, "nav_msgs/msg/Odometry"),
    "mounted": (_TRANSFORMS, "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Image"),
    "scan": (_TRANSFORMS, "sensor_msgs/msg/LaserScan"),
    "map": (_TRANSFORMS, "sensor_msgs/msg/LaserScan"),
    "camera": (_TRANSFORMS, "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"),
}


class RunCauses(Struct, frozen=True):
    """The causes in one run: its scene and nodes, its robot, its missing assets."""

    scene: Scene
    program: Program
    sent: Sequence[Message]
    robot: Machine | None
    commands: str
    missing: Collection[str] = ()
    unsure: frozenset[str] = frozenset()  # nodes that depend on what is not known
    unit: float = 1.0  # metres of the stage

    def of_silence(self, topic: str, message: str) -> Cause | None:
        """Return why no message of this type comes on a topic."""
        stop = self.of_stop()
        if stop is not None:
            return stop
        for node in self.program.nodes.values():
            kind = node.values.get(_TYPE) if _TYPE in node.values else ""
            sent = node.type.message.get(str(kind or ""), node.type.message.get("", ""))
            if sent == message and SUBSCRIBER not in node.type.role:
                return self._elsewhere(node, topic) or self.broken(node)
        return None

    def of_stop(self) -> Cause | None:
        """Return the node that stopped the simulation, None where none did."""
        return next((c for c in self.of_graphs() if c.kind == "simulation-stopped"), None)

    def of_graphs(self) -> Iterator[Cause]:
        """Yield the parts of the graphs that never run or are dropped."""
        for path, failure in self.program.dead:
            yield Cause(path, failure.reason, failure.kind)

    def ramps(self) -> tuple[float, float]:
        """Return how fast a controller lets the robot go faster, and turn; 0 without a limit."""
        for running in self.program.nodes.values():
            values = {name: number(value) or 0.0 for name, value in running.values.items()}
            ahead, turn = ramps_of(values) if running.type.step_limits else (0.0, 0.0)
            if ahead or turn:
                return running.unit(self.unit) * ahead, turn
        return 0.0, 0.0

    def doubt(self, check: str, fault: RunFault) -> bool:
        """Whether a fault may come from unknown nodes or missing assets."""
        if fault.prim in self.unsure or is_within(fault.prim, self.missing):
            return True
        if fault.kind in _AROUND and self.missing:
            return True
        if fault.kind in _OF_ORDER and self._is_by_number():
            return True
        if check in DRIVEN:
            bodies = self.robot.rest if self.robot is not None else ()
            return (
                any(is_within(body, self.missing) for body in bodies)
                or (fault.kind in _PART and self._has_missing_parts())
                or any(node.drives is not None for node in self._unsure_types())
            )
        if fault.kind in _PART and self._has_missing_parts():
            return True
        sent = {message for kind in self._unsure_types() for message in kind.message.values()}
        shown = _SHOWN_BY.get(check, sent if fault.kind == "silent-topic" else ())
        return not sent.isdisjoint(shown) and not (check == "topics" and fault.prim)

    def asset(self, fault: RunFault) -> Cause | None:
        """Return the missing asset that could hold what a fault misses, None where none is."""
        bodies = self.robot.rest if self.robot is not None else ()
        running = self.program.nodes.get(fault.prim)
        aims = (
            [to for targets in running.node.targets.values() for to in targets] if running else ()
        )
        own = [*filter(None, (fault.prim, *aims, *bodies))]
        near = [path for path in self.missing if any(is_within(each, (path,)) for each in own)]
        near += [path for path in self.missing if any(is_within(path, (aim,)) for aim in aims)]
        near += self.missing if fault.kind in {*_AROUND, *_PART} else ()
        path = next(iter(near), "")
        asset = self.scene.missing.get(path)
        return Cause(path, f"{asset} cannot be found", None) if asset else None

    def _is_by_number(self) -> bool:
        """Whether joints have no names, but the order of the articulation, which no file tells."""
        for node in self.program.nodes.values():
            ports = node.type.drives
            if ports is not None:
                names = ports.joints.removeprefix(INPUT)
                if names not in node.fed and not node.values.get(names):
                    return True
        return False

    def _has_missing_parts(self) -> bool:
        """Whether an asset that was not found belongs to the robot, or could be it."""
        if self.robot is None:
            return bool(self.missing)
        top = commonpath(self.robot.rest)
        return "/" in self.missing or any(
            is_within(path, (top,)) or is_within(top, (path,)) for path in self.missing
        )

    def _unsure_types(self) -> Iterator[NodeType]:
        for path in self.unsure:
            running = self.program.nodes.get(path)
            kind = running.type if running is not None else self.program.unwritten.get(path)
            if kind is not None and SUBSCRIBER not in kind.role:
                yield kind

    def basis(self, check: str, prim: str) -> tuple[str, ...]:
        """Return the prims that a failed check rests on, from the prim at fault on, nearest first.

        After it come the nodes that send on its topic, if topics are checked, and those that the
        check looks at. Wires are followed back from node to node,
        to what triggers as to what feeds, and end at the prims that the nodes refer to. A check of
        the motion also rests on the robot.
        """
        nodes = {node.path: node for graph in self.scene.graphs for node in graph.nodes}
        rivals = self._rivals(prim) if check == "topics" else ()
        basis_paths = dict.fromkeys(filter(None, (prim, *rivals, *self._looked_at(check))))
        waiting = [*basis_paths]
        for path in waiting:
            node = nodes.get(path)
            if node is None:
                continue
            before = [wire.rpartition(".")[0] for s in node.inputs.values() for wire in s.sources]
            before += [target for targets in node.targets.values() for target in targets]
            waiting += [each for each in dict.fromkeys(before) if each not in basis_paths]
            basis_paths.update(dict.fromkeys(before))
        graphs = {path.rpartition("/")[0]: None for path in basis_paths if path in nodes}
        above = [
            each.path
            for path in basis_paths
            if path not in nodes
            for each in self.scene.above(path)
        ]
        basis_paths.update(dict.fromkeys([*graphs, *above]))
        robot = commonpath(self.robot.rest) if self.robot is not None else ""
        tops = [robot] if robot and (check in DRIVEN or robot in basis_paths) else []
        tops += ["/"] if check in _OF_SURROUNDINGS else []
        basis_paths.update(dict.fromkeys(tops[-1:] if check in _OF_SURROUNDINGS else ()))
        own = {*nodes, *(graph.path for graph in self.scene.graphs)}
        for top in tops if robot else above:
            inside = self.scene.below(top) if top != "/" else self.scene.prims.values()
            parts = (part.path for part in inside if part.path not in own)
            basis_paths.update(dict.fromkeys(parts))
        return tuple(basis_paths)

    def is_node(self, prim: str) -> bool:
        """Whether a prim is a node that runs."""
        return prim in self.program.nodes

    def _rivals(self, prim: str) -> Iterator[str]:
        """Yield the nodes that send on a topic on which a node sends."""
        topics = {message.topic for message in self.sent if message.node == prim}
        for message in self.sent:
            if message.topic in topics:
                yield message.node

    def _looked_at(self, check: str) -> Iterator[str]:
        """Yield the nodes that a check looks at: they publish such messages, or drive joints."""
        shown = _SHOWN_BY.get(check, ())
        for node in self.program.nodes.values():
            sends = SUBSCRIBER not in node.type.role and any(
                message in shown for message in node.type.message.values()
            )
            if sends or (check in DRIVEN and node.type.drives is not None):
                yield node.path

    def radii(self) -> tuple[float, float] | None:
        """Return the radius of the wheels and the one that their controller has, where unlike."""
        robot = self.robot
        wheels = robot.wheels if robot is not None else ()
        radii = {round(wheel.radius, 4) for wheel in wheels if wheel.joint.holds}
        nodes = [node for node in self.program.nodes.values() if node.type.step_limits]
        sizes = {
            running.unit(self.unit) / self.unit * (running.values.get(_RADIUS) or 0.0)
            for running in nodes
            if _RADIUS not in running.wires
        }
        if len(radii) == len(sizes) == 1 and radii != sizes and all(sizes):
            return radii.pop() * self.unit, sizes.pop() * self.unit
        return None

    def _elsewhere(self, node: NodeInstance, topic: str) -> Cause | None:
        own = [message for message in self.sent if message.node == node.path]
        elsewhere = next((message for message in own if message.topic != topic), None)
        if elsewhere is not None:
            is_below = elsewhere.topic.endswith(topic)
            kind: FaultKind = "namespaced-topic" if is_below else "wrong-topic"
            return Cause(node.path, f"it publishes {elsewhere.topic}", kind)
        away = next((message for message in own if message.away is not None), None)
        if away is not None:
            return Cause(node.path, f"it publishes in domain {away.away}", "wrong-domain")
        return None

    def broken(self, node: NodeInstance, seen: frozenset[str] = frozenset()) -> Cause | None:
        """Return the first fault among the nodes that feed or drive a node, else its own."""
        seen |= {node.path}
        for running in self._before(node):
            if running.path not in seen:
                cause = self.broken(running, seen)
                if cause is not None:
                    return cause
        if node.failure is not None:
            return Cause(node.path, node.failure.reason, node.failure.kind)
        if not node.count and not node.pulled:
            idle = self.program.idle.get(node.path.rpartition("/")[0])
            if idle:
                return Cause(node.path, idle, "graph-not-evaluated")
            states = map(node.node.inputs.get, node.type.execution_inputs)
            wires = [wire for state in states if state is not None for wire in state.sources]
            waits = any(wire.rpartition(".")[0] in self.unsure for wire in wires)
            reason = "what triggers it is not simulated" if waits else "nothing triggers it"
            return Cause(node.path, reason, "not-executed")
        return None

    def _before(self, node: NodeInstance) -> Iterator[NodeInstance]:
        yield from self.program.before.get(node.path, ())
        yield from (source for source, _ in node.wires.values())

    def of_motion(self) -> Cause | None:
        """Return why commands do not move the robot as they should."""
        robot, stop = self.robot, self.of_stop()
        if stop is not None:
            return stop
        if robot is None:
            return Cause("", "the stage has no robot with joints that turn", "no-driven-robot")
        return next(_of_robot(robot), None) or self.of_joints()

    def _is_own(self, controller: NodeInstance) -> bool:
        """Whether a controller names the robot, or a prim above or below it."""
        ports = controller.type.drives
        targets = controller.node.targets.get(ports.target, ()) if ports is not None else ()
        return self.robot is not None and self.robot.is_named_by(targets)

    def of_joints(self) -> Cause | None:
        """Return why commands do not bring joints where they should."""
        nodes = self.program.nodes.values()
        controllers = [running for running in nodes if running.type.drives is not None]
        if not controllers:
            return Cause("", "no node commands the joints", "no-joint-controller")
        # Those of other robots listen elsewhere, which is no fault of this one.
        controllers = [*filter(self._is_own, controllers)] or controllers
        for controller in controllers:
            cause = self.broken(controller)
            if cause is not None:
                return cause
        chain = [running for node in controllers for running in self._before(node)]
        speeds = next((running for running in chain if running.type.step_limits), controllers[0])
        return Cause(speeds.path, "", None)


def _of_robot(robot: Machine) -> Iterator[Cause]:
    """Yield the causes that keep a robot from following its commands."""
    base = robot.base
    yield from _of_stand(robot)
    if not robot.wheels:
        yield Cause(base, "no wheel of the robot touches the ground", "no-wheel-contact")
    for wheel in robot.wheels:
        if wheel.joint.rollers is not None and wheel.grip is None:
            text = "its wheel is a plain tyre: the attributes of rollers tell the controller alone"
            yield Cause(wheel.joint.path, text, None)
    yield from filter(None, (_of_joint(joint, base) for joint in _rolling(robot)))
    for wheel in robot.wheels:
        if wheel.pull != Pull():
            kind = "of type acceleration " if wheel.joint.is_acceleration else ""
            what = f"the drive {kind}of {wheel.joint.name} is too weak for the weight of the robot"
            yield Cause(base, what, "weak-drive")


def _of_stand(robot: Machine) -> Iterator[Cause]:
    """Yield what keeps a robot from standing on its wheels."""
    base = robot.base
    if robot.kinematic:
        yield Cause(robot.kinematic, "it is kinematic: nothing moves it", "kinematic-link")
    if robot.held:
        yield Cause(base, "a joint connects the robot to the world", "base-fixed-to-world")
    if not robot.pulled:
        yield Cause(base, "gravity does not hold the robot on the ground", "no-gravity")
    if not robot.grounded and robot.no_ground is not None:
        path, why = robot.no_ground
        yield Cause(path, f"it {why}, so that the robot falls", "no-ground")
    if not robot.grounded:
        yield Cause(base, "no ground is below the robot", "no-ground")
    if robot.smooth:
        yield Cause(robot.smooth, "it has no friction on the ground", "no-grip")
    if robot.falls:
        text = "nothing carries its centre of mass: it tips over"
        yield Cause(base, text, "tips-over")
    if robot.carrier is not None:
        path, text = robot.carrier
        yield Cause(path, text, "no-wheel-contact")


def _rolling(robot: Machine) -> Iterator[Joint]:
    """Yield the joints of a robot that are to turn: those that are told speeds, if any are.

    Without a command they are all that a drive may turn, but those that steer its wheels.
    """
    steering = [joint for wheel in robot.wheels for joint in robot.above(wheel.carrier)]
    turned = [joint for joint in robot.joints.values() if joint.kind in DRIVEN_AXES]
    told = [joint for joint in turned if joint.is_told_speeds]
    yield from told or (joint for joint in turned if joint not in steering)


def _of_joint(joint: Joint, site: str) -> Cause | None:
    if joint.locked:
        return Cause(site, f"{joint.name} is held by another joint", "locked-joint")
    if joint.stiffness > 0 or joint.damping <= 0:
        return Cause(site, f"{joint.name} has no velocity drive", "no-velocity-drive")
    if joint.reach < math.radians(FAR):
        return Cause(site, f"{joint.name} cannot turn freely", "limited-joint")
    return None
