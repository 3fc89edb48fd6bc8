"""Plays a stage: frame by frame, graphs first, then physics, then the pictures of the sensors."""

from __future__ import annotations

from collections.abc import Sequence

from executor import nodes, publishers, sensors  # noqa: F401 - they register what nodes compute
from executor.affine import AXES, HERE, Affine, about, heading
from executor.behaviour import Evidence, Interface
from executor.drive import RATE, Leg, Session
from executor.execution import FRAME, STEP, Program, Running, compile_graphs
from executor.machines import Machine, Machines
from executor.rays import Beam, Surroundings, sweep
from executor.record import Pose, Recording, Scan
from executor.ros import Network
from executor.scene import Scene
from executor.sensors import Product, Writer, render
from lab3_usd.spec.catalog import Catalog

COMMANDS = 10.0  # a second on /cmd_vel
LATE = 1.0e9  # seconds: what system time counts from


class World:
    """A stage that plays."""

    def __init__(self, scene: Scene, catalog: Catalog) -> None:
        self.scene = scene
        self.program: Program = compile_graphs(scene, catalog)
        self.machines = Machines(scene)
        self.surroundings = Surroundings.of(scene, self.machines)
        self.network = Network("")
        self.products: dict[str, Product] = {}
        self.writers: list[Writer] = []
        self.not_simulated = self.program.not_simulated
        self.dt = 1.0 / RATE
        self.frame = 0
        self.session = 0
        self.since_play = 0.0
        self.simulated = 0.0
        self.commands = 0

    @property
    def wall(self) -> float:
        """System time."""
        return LATE + self.simulated

    def detach(self, node: Running) -> None:
        """Take the writers of a node off their products."""
        self.writers[:] = [each for each in self.writers if each.node is not node]

    def play(self, session: Session, recording: Recording) -> None:
        """Play a session and stop."""
        self.network.environment = session.environment
        robot = self.robot()
        for leg in session.legs:
            for number in range(round(leg.seconds * RATE)):
                self._command(leg, number)
                self._step()
                recording.path.append(self._pose(robot, leg))
        recording.seconds += self.since_play
        self.stop()

    def robot(self) -> Machine | None:
        """Return the machine with the most joints: what is driven."""
        machines = [each for each in self.machines.machines if each.joints]
        return max(machines, key=lambda each: len(each.joints), default=None)

    def stop(self) -> None:
        """Put everything back, as on Stop; what counts on does so."""
        self.program.reset()
        self.writers.clear()
        self.machines.reset()
        self.since_play = 0.0
        self.session += 1
        self.network.contexts.clear()

    def _command(self, leg: Leg, number: int) -> None:
        every = round(RATE / COMMANDS)
        if leg.command is not None and number % every == 0:
            forward, left, turn = leg.command
            self.commands += 1
            twist = ((forward, left, 0.0), (0.0, 0.0, turn))
            self.network.command = (self.commands, twist)

    def _step(self) -> None:
        self.frame += 1
        self.since_play += self.dt
        self.simulated += self.dt
        self.program.run(STEP, self)
        self.machines.step(self.dt)
        self.program.run(FRAME, self)
        render(self)

    def _pose(self, robot: Machine | None, leg: Leg) -> Pose:
        if robot is None:
            return Pose(self.session, self.since_play, leg.name, 0.0, 0.0, 0.0)
        x, y, z = robot.pose().origin
        unit = self.scene.meters_per_unit
        turned = heading(robot.pose())
        return Pose(self.session, self.since_play, leg.name, x * unit, y * unit, turned, z * unit)


def record(scene: Scene, catalog: Catalog, drive: Sequence[Session], wanted: Interface) -> Evidence:
    """Play the sessions, and return what was sent, where the robot went, and what it stood in."""
    world = World(scene, catalog)
    robot = world.robot()
    unit = scene.meters_per_unit
    start = in_metres(robot.pose(), unit) if robot is not None else HERE
    recording = Recording()
    for session in drive:
        world.play(session, recording)
    recording.messages = world.network.sent
    recording.not_simulated = dict(world.not_simulated)
    recording.fired = {path: node.count for path, node in world.program.nodes.items()}
    level = Affine(about(AXES[2], heading(start)), start.origin)

    def walls(at: Affine, scan: Scan) -> tuple[float, ...]:
        """Return what a lidar would see there."""
        beam = Beam(
            scan.angle_min,
            scan.angle_increment,
            len(scan.ranges),
            scan.range_min / unit,
            scan.range_max / unit,
        )
        seen = sweep(beam, world.surroundings.around(in_metres(at, 1.0 / unit)))
        return tuple(each if each < 0 else each * unit for each in seen)

    return Evidence(recording, drive, wanted, level, walls)


def in_metres(place: Affine, unit: float) -> Affine:
    """Return a place with its origin in another unit."""
    x, y, z = place.origin
    return Affine(place.rows, (x * unit, y * unit, z * unit))
