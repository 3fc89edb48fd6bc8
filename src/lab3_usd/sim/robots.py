"""The robots of a stage that commands over ROS move: the commands of each, and how it is driven."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.errors import UsageError
from lab3_usd.isaac.node_types import NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import JOINT_STATES, ODOMETRY, STEERING, TRANSFORMS, TWIST
from lab3_usd.model.dry_run import AXES, HERE, Affine, Scene, about, heading
from lab3_usd.physics.machine import Machine
from lab3_usd.sim.arms import Reach, joint_drive, named_joints, reach_of
from lab3_usd.sim.execution.drive import Leg, Session
from lab3_usd.sim.execution.node_instance import NodeInstance
from lab3_usd.sim.execution.world import SUBSCRIBER, RosEndpoint, Standing, World, open_endpoint
from lab3_usd.sim.judge.expectations import Expected, ramps_of
from lab3_usd.sim.nodes.robot import articulated
from lab3_usd.sim.nodes.transforms import frame_name
from lab3_usd.sim.timeline import Player, in_metres, player_of

LOOKED_AT = 12  # frames of a first play without commands, which shows who listens to what
AHEAD, TURN = 0.15, 0.8  # metres and radians a second, unless a controller allows less
LEG, RAMPS, LONGEST = 2.0, 12.0, 20.0  # seconds; how many times a robot takes to get going
ROLLERS, WHEEL_BASE = "mecanumAngles", "wheelBase"  # inputs that only some controllers have
WHEEL_RADIUS = "wheelRadius"
STEERED = 0.3  # radians to which a car is steered
HASTE = 10.0  # times that the clock of any stage may run faster than the simulation, or slower


class Robot(Struct, frozen=True):
    """A robot that ROS messages command.

    `body` is the link whose motion is measured, `start` its pose at Play, and `centre` the point
    between the driven wheels, in the frame of that link, about which the robot turns. `odometry`
    and `scan` are the nodes that publish them, '' without one. `moved` are the joints that the
    controllers name, empty if the messages name them; `reach` those that joint commands reach.
    """

    machine: Machine | None  # None where its controller finds no articulation
    controller: str
    commands: RosEndpoint
    kind: str = TWIST  # of the commands
    body: str = ""
    start: Affine = HERE
    centre: tuple[float, float] = (0.0, 0.0)
    speeds: tuple[float, float] = (AHEAD, TURN)  # that its controllers let through
    ramp: float = 0.0  # seconds until it moves as commanded
    wheel_base: float = 0.0  # metres, of a car
    wheel_radius: float = 0.0  # metres, as its controller states it
    has_rollers: bool = False  # on its wheels, which let it go to any side
    odometry: str = ""
    scan: str = ""
    subscriber: str = ""
    controllers: frozenset[str] = frozenset()
    moved: frozenset[str] = frozenset()
    reach: Reach = Reach()

    @property
    def name(self) -> str:
        """The prim that stands for it."""
        return self.body or self.controller

    @property
    def goes_otherwise(self) -> bool:
        """Whether it steers, or goes to any side on rollers, as one on two wheels does not."""
        return self.machine is not None and bool(self.has_rollers or self.wheel_base)

    def hears(self, topic: str, domain: int) -> bool:
        """Whether its commands come on a topic in a domain."""
        return (self.commands.topic, self.commands.domain) == (topic, domain)


def robots_of(
    scene: Scene, platform: Platform, topic: str = "", standing: Standing | None = None
) -> tuple[Robot, ...]:
    """Return the robots that listen to commands; one of several topics is there for each.

    What stands there, with ground below it, may be shared with the plays that follow.

    Raises:
        UsageError: a topic is asked for, and no robot listens to it.
    """
    listening = listening_robots(scene, platform, standing)
    topics = sorted({robot.commands.topic for robot in listening})
    if topic and topic not in topics:
        names = ", ".join(topics) or "nothing"
        raise UsageError(f"--topic {topic}: moves no robot; robots listen to {names}")
    robots: dict[tuple[str, str, int], Robot] = {}
    for robot in sorted(listening, key=lambda robot: robot.kind != TWIST):
        key = (robot.name, robot.commands.topic, robot.commands.domain)
        first = robots.setdefault(key, robot)
        robots[key] = replace(
            first,
            controllers=first.controllers | robot.controllers,
            moved=first.moved | robot.moved,
        )
    return tuple(robots.values())


def labels(robots: Sequence[Robot]) -> list[str]:
    """Return a name for each robot, with its topic and domain where several have one name."""
    names = Counter(robot.name for robot in robots)
    topics = Counter((robot.name, robot.commands.topic) for robot in robots)
    made = []
    for robot in robots:
        label = robot.name
        if names[robot.name] > 1:
            label += f" on {robot.commands.topic}"
        if topics[robot.name, robot.commands.topic] > 1:
            label += f" in domain {robot.commands.domain}"
        made.append(label)
    return made


def owners_of(robots: Sequence[Robot]) -> Callable[[str], frozenset[str]]:
    """Return what gives the bases of the robots to which a prim belongs, or that are below it."""
    below: dict[str, set[str]] = {}
    bodies: dict[str, str] = {}
    for robot in robots:
        for body in robot.machine.rest if robot.machine is not None else ():
            base = robot.machine.base if robot.machine is not None else ""
            bodies[body] = base
            path = body
            while path:
                below.setdefault(path, set()).add(base)
                path = path.rpartition("/")[0]

    def owners(path: str) -> frozenset[str]:
        if path in below:
            return frozenset(below[path])
        while path and path not in bodies:
            path = path.rpartition("/")[0]
        return frozenset({bodies[path]} if path else ())

    return owners


def owned_graphs(robots: Sequence[Robot], scene: Scene) -> dict[str, frozenset[str]]:
    """Return the bases of the robots that the prims named in each graph belong to."""
    owners = owners_of(robots)
    owner_paths = {}
    for graph in scene.graphs:
        named = [path for node in graph.nodes for paths in node.targets.values() for path in paths]
        named += [
            state.value
            for node in graph.nodes
            for state in node.inputs.values()
            if isinstance(state.value, str) and state.value.startswith("/")
        ]
        owner_paths[graph.path] = frozenset(owner for path in named for owner in owners(path))
    return owner_paths


def scene_for(
    robot: Robot, owned: Mapping[str, frozenset[str]], scene: Scene, platform: Platform
) -> Scene:
    """Return a scene without the graphs that name only prims of other robots.

    Those that name none are left out as well, unless they may publish transforms. `owned` are the
    bases of the robots that each graph names.
    """
    if robot.machine is None:
        return scene
    own = {robot.subscriber, robot.odometry, robot.scan, *robot.controllers}
    graphs = {path.rpartition("/")[0] for path in own}
    kept = []
    for graph in scene.graphs:
        owners_of_graph = owned[graph.path]
        types = () if owners_of_graph else [platform.get(node.type) for node in graph.nodes]
        if (
            robot.machine.base in owners_of_graph
            or graph.path in graphs
            or any(t is None or TRANSFORMS in t.message.values() for t in types)
        ):
            kept.append(graph)
    return replace(scene, graphs=tuple(kept))


def listening_robots(
    scene: Scene, platform: Platform, standing: Standing | None = None
) -> list[Robot]:
    """Return a robot for each way from a subscriber of commands to a controller."""
    player = player_of(scene, platform, expected_of(None), standing)
    for _ in range(LOOKED_AT):
        player.step()
    return list(_listening(player))


def hears_commands(kind: NodeType) -> bool:
    """Whether nodes of a type subscribe to commands for robots."""
    return SUBSCRIBER in kind.role and kind.message.get("", "") in {TWIST, STEERING, JOINT_STATES}


def _listening(player: Player) -> Iterator[Robot]:
    """Yield a robot for each subscriber from which wires lead to a controller of joints."""
    world, nodes = player.world, player.program.nodes
    followers = _followers(world.scene)
    frames = {child for message in world.network.sent for _, child in message.frames}
    for node in nodes.values():
        kind = node.type.message.get("", "")
        if not hears_commands(node.type):
            continue
        endpoint: RosEndpoint | None = node.memory.get("endpoint") or open_endpoint(node, world)
        if endpoint is None:
            continue
        behind = [nodes[path] for path in _behind(followers, node.path) if path in nodes]
        for controller in behind:
            if controller.type.drives is not None:
                machine = articulated(controller, world)
                speeds, ramp = _allowed(behind, world)
                reach = _reach(controller, machine, player) if kind == JOINT_STATES else Reach()
                robot = Robot(
                    machine,
                    controller.path,
                    endpoint,
                    kind,
                    speeds=speeds,
                    ramp=ramp,
                    wheel_base=_stated_size(WHEEL_BASE, behind, world),
                    wheel_radius=_stated_size(WHEEL_RADIUS, behind, world),
                    has_rollers=any(ROLLERS in node.values for node in behind),
                    subscriber=node.path,
                    controllers=frozenset({controller.path}),
                    moved=_moved_by(controller, machine, world),
                    reach=reach,
                )
                yield (
                    robot
                    if machine is None
                    else _watched(robot, machine, player, followers, frames)
                )


def _moved_by(controller: NodeInstance, machine: Machine | None, world: World) -> frozenset[str]:
    """Return the joints that a controller moves, none where they come with the commands."""
    if machine is None:
        return frozenset()
    if "jointNames" in controller.fed:
        return frozenset(map(str, controller.items("jointNames", world)))
    return frozenset(named_joints(controller, machine, world) or machine.articulated)


def _reach(controller: NodeInstance, machine: Machine | None, player: Player) -> Reach:
    """Return the joints that commands reach over a controller, except for those of others."""
    if machine is None:
        return Reach()
    world = player.world
    taken = {
        name
        for node in player.program.nodes.values()
        if node.type.drives is not None and node is not controller
        for name in node.items("jointNames", world)
        if articulated(node, world) is machine
    }
    return reach_of(controller, machine, world, taken)


def _followers(scene: Scene) -> dict[str, list[str]]:
    """Return the nodes into which wires lead from each node."""
    by_source: dict[str, list[str]] = {}
    for node in (node for graph in scene.graphs for node in graph.nodes):
        wires = (wire for state in node.inputs.values() for wire in state.sources)
        for source in dict.fromkeys(wire.rpartition(".")[0] for wire in wires):
            by_source.setdefault(source, []).append(node.path)
    return by_source


def _behind(followers: Mapping[str, Sequence[str]], start: str) -> list[str]:
    """Return the nodes into which wires lead from a node, over others as well, nearest first."""
    paths = {start: None}
    for path in (waiting := [start]):
        new = [follower for follower in followers.get(path, ()) if follower not in paths]
        paths.update(dict.fromkeys(new))
        waiting += new
    return [*paths][1:]


def _stated_size(name: str, nodes: Sequence[NodeInstance], world: World) -> float:
    """Return the size that a controller states, in metres; 0 where none is."""
    unit = world.scene.meters_per_unit
    values = (node.number(name, world) * node.unit(unit) for node in nodes if name in node.values)
    return next(values, 0.0)


def _allowed(nodes: Sequence[NodeInstance], world: World) -> tuple[tuple[float, float], float]:
    """Return the speeds that controllers let through, and how long it takes to get there."""
    ahead, turn, ramp = AHEAD, TURN, 0.0
    for node in nodes:
        if not node.type.step_limits:
            continue
        value = {name: abs(node.number(name, world)) for name in node.values}
        unit = node.unit(world.scene.meters_per_unit)
        ahead = min(ahead, 0.9 * unit * (value.get("maxLinearSpeed") or math.inf))
        turn = min(turn, 0.9 * (value.get("maxAngularSpeed") or math.inf))
        rim = value.get("maxWheelSpeed", 0.0) * value.get("wheelRadius", 0.0)
        if rim:
            ahead = min(ahead, 0.9 * unit * rim)
            turn = min(turn, 1.8 * rim / (value.get("wheelDistance") or math.inf))
        gain, turning = ramps_of(value)
        steering = STEERED / (value.get("steeringAngleVelocity") or math.inf)
        ramp = max(ramp, ahead / unit / gain if gain else 0.0, turn / turning if turning else 0.0)
        ramp = max(ramp, steering if steering > LEG / 2 else 0.0)
    slow = min(1.0, LONGEST / RAMPS / ramp) if ramp else 1.0  # to get going within a leg
    return (slow * ahead, slow * turn), slow * ramp


def _watched(
    robot: Robot,
    machine: Machine,
    player: Player,
    followers: Mapping[str, Sequence[str]],
    frames: Collection[str],
) -> Robot:
    """Return a robot with the body by which it is watched: that of odometry, of TF, or its base.

    `frames` are the children of TF.
    """
    world, nodes = player.world, player.program.nodes
    prims, sent = world.scene.prims, world.network.sent
    body = next((body for body in machine.rest if frame_name(prims[body]) in frames), machine.base)
    body = machine.base if robot.kind == JOINT_STATES else body
    publisher = ""
    for node in nodes.values():
        if node.memory.get("path") in machine.rest:
            body = str(node.memory["path"])
            behind = {message.node for message in sent if message.type == ODOMETRY}
            publisher = next((path for path in _behind(followers, node.path) if path in behind), "")
            break
    carried = (
        writer.node.path
        for writer in world.writers
        if writer.beam is not None and world.machines.body_of(writer.product.sensor) in machine.rest
    )
    world.machines.reset()
    start = in_metres(world.machines.place(body), world.scene.meters_per_unit)
    return replace(
        robot,
        body=body,
        start=start,
        centre=_centre(machine, start, world.scene.meters_per_unit),
        odometry=publisher,
        scan=next(carried, ""),
    )


def _centre(machine: Machine, start: Affine, unit: float) -> tuple[float, float]:
    """Return the point between the driven wheels, as seen from where the watched body starts."""
    contacts = [wheel.contact for wheel in machine.wheels if wheel.joint.holds]
    if not contacts:
        return (0.0, 0.0)
    x, y = (sum(places) / len(contacts) for places in zip(*contacts, strict=True))
    base = machine.start.origin
    level = Affine(about(AXES[2], heading(start)), start.origin)
    ahead, left, _ = level.inverse().point((unit * (base[0] + x), unit * (base[1] + y), 0.0))
    return (ahead, left)


def expected_of(robot: Robot | None) -> Expected:
    """Return what is known before a play: which robot is watched, and where its commands come."""
    if robot is None:
        return Expected(has_ground=True, haste=HASTE)
    return Expected(
        domain=robot.commands.domain,
        commands=robot.commands.topic,
        joint_commands=robot.commands.topic if robot.kind == JOINT_STATES else "",
        wheel_radius=robot.wheel_radius,
        centre=robot.centre,
        robot=robot.body,
        has_ground=True,
        haste=HASTE,
    )


def drive_for(robot: Robot | None, unit: float) -> tuple[Session, ...]:
    """Return the drive of a robot, as slow as its controllers let it go."""
    if robot is None:
        return (Session((Leg("idle", LEG),)),)
    if robot.kind == JOINT_STATES and robot.machine is not None:
        return joint_drive(robot.machine, robot.reach, unit)
    ahead, turn = robot.speeds
    seconds = min(LONGEST, max(LEG, RAMPS * robot.ramp))
    # A robot that slows down in its own time is not asked to stop at once.
    pause = Leg("pause" if robot.ramp else "stop", 0.3 + 2 * robot.ramp, (0.0, 0.0, 0.0))
    forward = Leg("ahead", seconds, (ahead, 0.0, 0.0))
    back, left = Leg("back", seconds, (-ahead, 0.0, 0.0)), Leg("left", seconds, (0.0, 0.0, turn))
    turns: tuple[Leg, ...] = (left, pause)
    if robot.kind == STEERING:
        forward, back, pause = (replace(leg, steer=0.0) for leg in (forward, back, pause))
        turning = ahead * math.tan(STEERED) / (robot.wheel_base or math.inf)
        aim = Leg("aim", LEG, (0.0, 0.0, 0.0), steer=STEERED)
        turns = (aim, Leg("arc", 2 * seconds, (ahead, 0.0, turning), steer=STEERED), pause)
    elif robot.wheel_base:
        turns = ()  # how a car takes the turning speed of a Twist is up to its graph
    if robot.has_rollers:
        turns = (*turns, Leg("aside", seconds, (0.0, ahead, 0.0)), pause)
    legs = (Leg("idle", 0.5), forward, pause, back, pause, *turns)
    return (Session(legs), Session((Leg("idle", 0.3), forward)))
