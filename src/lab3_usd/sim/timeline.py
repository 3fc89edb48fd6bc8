"""Plays a stage: frame by frame, physics first, then graphs, then the pictures of the sensors."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from lab3_usd.isaac.platform import Platform
from lab3_usd.model.dry_run import AXES, HERE, Affine, Scene, Segment, about, heading
from lab3_usd.model.physics import number
from lab3_usd.physics.machine import Machine
from lab3_usd.physics.unmodelled import unmodelled
from lab3_usd.sim.execution.changes import unplayed_change
from lab3_usd.sim.execution.drive import RATE, Leg, Session, command_frames, joint_command
from lab3_usd.sim.execution.node_instance import FRAME, STEP, Failure
from lab3_usd.sim.execution.program import Program, compile_graphs, depending, is_within
from lab3_usd.sim.execution.recording import (
    Held,
    JointStates,
    Later,
    Message,
    Points,
    Pose,
    Recording,
    Scan,
    Steering,
    View,
    kept_transforms,
)
from lab3_usd.sim.execution.world import RosEndpoint, Standing, Twist, World, Writer, send, world_of
from lab3_usd.sim.judge.causes import DRIVEN, RunCauses
from lab3_usd.sim.judge.expectations import SIZE, Expected, Trial
from lab3_usd.sim.lidar import Beam, measured
from lab3_usd.sim.nodes.sensors import UNSEEN
from lab3_usd.sim.nodes.transforms import OPTICAL


def render(world: World) -> None:
    """Let each writer publish if its sensor has a new picture."""
    for writer in world.writers:
        if writer.rate > 0:
            if world.since_play + 1e-9 < writer.due:
                continue
            writer.due = (writer.due if writer.rendered else world.since_play) + 1.0 / writer.rate
            writer.due = max(writer.due, world.since_play)
        writer.rendered += 1
        if (writer.rendered - 1) % (writer.skip + 1) == 0:
            stamp = {"system": world.wall, "monotonic": world.simulated}.get(
                writer.clock, world.since_play
            )
            message = _picture(writer, world, stamp)
            if message is not None:
                send(writer.node, world, writer.endpoint, message)


def _picture(writer: Writer, world: World, stamp: float) -> Message | None:
    product, unit = writer.product, world.scene.meters_per_unit
    if writer.kind == "lidar point_cloud":
        place = in_metres(world.machines.place(product.sensor), unit)
        points = Points(place, product.sensor)
        return Message("sensor_msgs/msg/PointCloud2", stamp, writer.frame_id, points)
    if writer.beam is None:
        if world.scene.prims[product.sensor].type != "Camera":
            return None
        if writer.kind in UNSEEN:
            return Message(writer.node.type.message[writer.kind], stamp, writer.frame_id)
        place = in_metres(world.machines.place(product.sensor).then(OPTICAL), unit)
        size = (product.width, product.height)
        view = View(*size, writer.matrix, place=place, sensor=product.sensor)
        if writer.kind == "info":
            return Message("sensor_msgs/msg/CameraInfo", stamp, writer.frame_id, view)
        return Message(writer.node.type.message[writer.kind], stamp, writer.frame_id, view)
    return Message(
        "sensor_msgs/msg/LaserScan", stamp, writer.frame_id, _scan(writer, writer.beam, world)
    )


def _scan(writer: Writer, beam: Beam, world: World) -> Scan:
    at = world.machines.place(writer.product.sensor)
    unit = world.scene.meters_per_unit
    around = world.surroundings.seen(writer.product.sensor, world.machines)
    first = int((writer.rendered - 1) * writer.covered * beam.count) % beam.count
    shown = int(writer.covered * beam.count) if writer.covered < 1.0 else beam.count

    def measure() -> tuple[float, ...]:
        ranges = measured(beam, around(), unit)
        if shown == beam.count:
            return ranges
        kept = {(first + k) % beam.count for k in range(shown)}
        return tuple(distance if k in kept else -1.0 for k, distance in enumerate(ranges))

    return Scan(
        beam.start,
        beam.step,
        beam.near,
        beam.far,
        Later(beam.count, measure),
        in_metres(at, unit),
        1.0 / writer.turns if writer.turns else 0.0,
        sensor=writer.product.sensor,
    )


LEVEL = 2.0  # degrees by which a robot may lean before its scan shows something else
FASTEST = 1000.0  # physics steps a second that are played
EYES = 0.15  # metres above the robot at which a room without a lidar is drawn


class Player:
    """A stage, and the graphs that run in it."""

    def __init__(self, world: World, platform: Platform, body: str = "", place: str = "") -> None:
        self.world = world
        self.program: Program = compile_graphs(world.scene, platform)
        self.robot = world.machines.member.get(body) if body else driven(world, place)
        self.body = body or (self.robot.base if self.robot is not None else "")
        self.start = HERE
        if self.robot is not None:
            self.start = in_metres(world.machines.place(self.body), world.scene.meters_per_unit)
        wheels = self.robot.wheels if self.robot is not None else ()
        self.driven_joints = [wheel.joint for wheel in wheels if wheel.joint.holds]
        self.recording = Recording()
        self.rate = physics_rate(world.scene) if self.program.events.get(STEP) else RATE

    def play(self, session: Session) -> None:
        """Play a session and stop."""
        world = self.world
        world.network.environment = session.environment
        commands = dict(command_frames(session))
        frame = 0
        for leg in session.legs:
            for _ in range(round(leg.seconds * RATE)):
                if frame in commands:
                    world.network.tell(content_of(commands[frame]))
                self.step()
                frame += 1
                self.recording.path.append(self._pose(leg))
            if (leg.joints or leg.steer) and self.robot is not None:
                self.recording.held.append(self._held(leg, self.robot))
        self.recording.seconds += world.since_play
        self.program.reset()
        world.stop()

    def _held(self, leg: Leg, robot: Machine) -> Held:
        """Return where the joints and links of the robot are, and how fast the joints."""
        world = self.world
        return Held(
            world.session,
            world.since_play,
            dict(leg.joints),
            {name: joint.position for name, joint in robot.joints.items()},
            {name: joint.velocity for name, joint in robot.joints.items()},
            {
                body: in_metres(world.machines.place(body), world.scene.meters_per_unit)
                for body in robot.rest
            },
            leg.kind,
        )

    def step(self) -> None:
        """Play one frame, unless a node has stopped the timeline."""
        if not self.world.stopped_by:
            self._play_frame()

    def _play_frame(self) -> None:
        world = self.world
        frame = world.dt
        steps = int((world.frame + 1) * self.rate / RATE) - int(world.frame * self.rate / RATE)
        world.frame += 1
        world.reading += 1
        world.dt = frame / max(1, steps)
        for count in range(max(1, steps)):
            world.since_play += world.dt
            world.simulated += world.dt
            if steps:
                self.program.run(STEP, world, again=count > 0)
            world.machines.step(world.dt)
        world.dt = frame
        self.program.run(FRAME, world, again=steps > 1)
        render(world)
        if world.stopped_by:
            text = f"it stops the simulation {world.since_play:.3g} s after Play"
            stop = (world.stopped_by, Failure(text, "simulation-stopped"))
            if stop not in self.program.dead:  # as in an earlier session
                self.program.dead.append(stop)
            world.machines.reset()

    def _pose(self, leg: Leg) -> Pose:
        world, robot = self.world, self.robot
        if robot is None:
            return Pose(world.session, world.since_play, leg.name, 0.0, 0.0, 0.0)
        place = world.machines.place(self.body)
        x, y, z = place.origin
        unit = world.scene.meters_per_unit
        return Pose(
            world.session,
            world.since_play,
            leg.name,
            x * unit,
            y * unit,
            heading(place),
            z * unit,
            blocked=robot.blocked,
            wheels=tuple([joint.velocity for joint in self.driven_joints]),
        )


def content_of(leg: Leg) -> Twist | JointStates | Steering:
    """Return what the command of a leg says."""
    if leg.steer is not None:
        return Steering(leg.forward, leg.steer)
    if leg.command is not None:
        ahead, left, turn = leg.command
        return ((ahead, left, 0.0), (0.0, 0.0, turn))
    return joint_command(leg)


def physics_rate(scene: Scene) -> float:
    """Return how many physics steps the first physics scene makes a second.

    On Physics Step runs its graph at each (OgnOnPhysicsStep.cpp:72-149 of core nodes).
    """
    steps = number(scene.physics.get("physxScene:timeStepsPerSecond"))
    return min(steps, FASTEST) if steps is not None and steps > 0 else RATE


def driven(world: World, place: str = "") -> Machine | None:
    """Return what is driven: the machine at a place, else anywhere, with the most joints."""
    machines = [machine for machine in world.machines.machines if machine.joints]

    def rank(machine: Machine) -> tuple[bool, int]:
        is_there = bool(place) and any(is_within(body, (place,)) for body in machine.rest)
        return is_there, len(machine.joints)

    return max(machines, key=rank, default=None)


def player_of(
    scene: Scene, platform: Platform, wanted: Expected, standing: Standing | None = None
) -> Player:
    """Return a scene ready to play, which takes commands from the topic that is asked for."""
    ground = wanted.has_ground
    world = world_of(scene, platform, wanted.profile, has_ground=ground, standing=standing)
    world.network.commands = RosEndpoint(wanted.domain, wanted.commands)
    player = Player(world, platform, wanted.robot, wanted.place)
    world.not_simulated.update(player.program.not_simulated)
    change = unplayed_change(scene, player.program, platform)
    if change:
        world.unplayed[""] = change
    if player.robot is not None:
        physics = unmodelled(world.machines, player.robot)
        world.not_simulated |= physics
        for path, reason in physics.items():
            named = f"not simulated: {path}: {reason}"
            world.unplayed.update((check, named) for check in DRIVEN)
        lean = math.degrees(player.robot.lean)
        if lean > LEVEL:
            text = f"not simulated: the robot leans by {lean:.0f} degrees, and its sensors with it"
            world.unplayed.update((check, text) for check in ("scan", "map"))
        world.not_simulated |= player.robot.unclear
        path, reason = next(iter(player.robot.unclear.items()), ("", ""))
        player.recording.unclear = f"not simulated: {path}: {reason}" if path else ""
    return player


def played(
    scene: Scene,
    platform: Platform,
    drive: Sequence[Session],
    wanted: Expected,
    standing: Standing | None = None,
) -> Player:
    """Play the sessions, and return who has.

    What stands there may be shared with plays of the same prims that are over.
    """
    player = player_of(scene, platform, wanted, standing)
    with uncollected():
        for session in drive:
            player.play(session)
    return player


@contextmanager
def uncollected() -> Iterator[None]:
    """Look for no garbage: what a play records stays, and it would be searched again and again.

    A stage of 20 robots takes 3.2 s of the processor, and 5.6 s where it is looked for.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def trial_of(player: Player, drive: Sequence[Session], wanted: Expected) -> Trial:
    """Return what is judged of sessions that were played."""
    world, scene = player.world, player.world.scene
    robot, unit, start = player.robot, scene.meters_per_unit, player.start
    recording = player.recording
    recording.messages = world.network.sent
    recording.static = kept_transforms(
        message
        for message in recording.messages
        if message.topic in wanted.static and message.away is None
    )
    recording.assumed, recording.unplayed = world.assumed, world.unplayed
    recording.gives = world.gives
    recording.not_simulated = unknown_in(world) | player.program.guessed
    recording.fired = {path: node.count for path, node in player.program.nodes.items()}
    level = Affine(about(AXES[2], heading(start)), start.origin)

    def walls(at: Affine, scan: Scan) -> tuple[float, ...]:
        """Return what a lidar would see there."""
        beam = Beam(
            scan.angle_min,
            scan.angle_increment,
            len(scan.ranges),
            scan.range_min,
            scan.range_max,
        )
        around = world.surroundings.around(in_metres(at, 1.0 / unit))
        return measured(beam, tuple(around), unit)

    def cut_room() -> tuple[Segment, ...]:
        return _room(player, start)

    missing = scene.missing.keys() - world.assumed.keys()
    nodes = player.program.nodes
    # The run showed of these helpers of sensors that they are not simulated.
    helpers = {
        path for path in world.not_simulated & nodes.keys() if nodes[path].type.role == "helper"
    }
    causes = RunCauses(
        scene,
        player.program,
        recording.messages,
        robot,
        wanted.commands,
        missing,
        depending(player.program, missing) | helpers,
        unit,
    )
    recording.radii = causes.radii()
    trial = Trial(recording, drive, wanted, level, walls, causes, cut_room)
    if robot is not None:
        if robot.is_given_ground:
            text = f"no ground is below {robot.base}: a ground plane is supplied"
            recording.remarks.append(text)
        recording.wheels = tuple(wheel.joint.name for wheel in robot.wheels if wheel.joint.holds)
        trial.radius, trial.scrubs = robot.radius * unit, robot.scrubs
        trial.factor = _rolled(robot, wanted.wheel_radius / unit)
    return trial


def _rolled(robot: Machine, stated: float) -> float:
    """Return how far the wheels roll for each metre of wheels of the stated radius.

    Wheels of a size that is not about that radius are not the robot's own: they change nothing.
    """
    radii = [wheel.radius for wheel in robot.wheels if wheel.joint.holds]
    if not radii or not stated:
        return 1.0
    factor = sum(radii) / len(radii) / stated
    return factor if SIZE[0] <= factor <= SIZE[1] else 1.0


def _room(player: Player, start: Affine) -> tuple[Segment, ...]:
    """Return what stands still, cut at the height of the lidar, or a little above the ground."""
    world, unit = player.world, player.world.scene.meters_per_unit
    scans = (
        message.data for message in player.recording.messages if isinstance(message.data, Scan)
    )
    place = next((scan.place for scan in scans), None)
    height = start.origin[2] + EYES if place is None else place.origin[2]
    cut = world.surroundings.level(height / unit)
    return tuple((a * unit, b * unit, c * unit, d * unit) for a, b, c, d in cut)


def unknown_in(world: World) -> dict[str, str]:
    """Return what is not simulated, by prim.

    So is what stands on assets that cannot be found, except lidars, which are assumed.
    """
    return world.not_simulated | {
        prim: f"{asset} cannot be found"
        for prim, asset in world.scene.missing.items()
        if prim not in world.assumed
    }


def in_metres(place: Affine, unit: float) -> Affine:
    """Return a place with its origin in another unit."""
    if unit == 1.0:
        return place
    x, y, z = place.origin
    return Affine(place.rows, (x * unit, y * unit, z * unit))
