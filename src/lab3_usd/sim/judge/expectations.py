"""What is expected of a drive over ROS, and the recording that is judged by it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec import Struct

from lab3_usd.model.dry_run import FOLLOWS, HERE, Affine, Segment, rotation
from lab3_usd.model.fault import FaultKind
from lab3_usd.model.occupancy import MapFit, OccupancyMap
from lab3_usd.model.transforms import Vector, length, minus
from lab3_usd.sim.execution.drive import NO_LIMITS, RATE, Leg, Session
from lab3_usd.sim.execution.recording import Held, Message, Pose, Recording, Scan

if TYPE_CHECKING:
    from lab3_usd.sim.execution.node_instance import NodeInstance
    from lab3_usd.sim.judge.causes import RunCauses

SIZE = (0.6, 1.5)  # how much of a command a robot with mass that follows it may do
SOON = 6  # frames in which a robot may come to rest
STARTED = 3  # frames after which a command has come through the graphs to the wheels


class RunTolerance(Struct, frozen=True):
    """Tolerances: in seconds, (metres, radians), and fractions of a command."""

    lag: float  # between a stamp and the clock
    still: tuple[float, float]
    slip: tuple[float, float]
    size: tuple[float, float]
    cells: int  # between a point of the scan and a wall of the map
    met: float  # the part of the points that lie so near


EXACT = RunTolerance(
    0.1,
    (2e-3, math.radians(0.3)),
    (0.02, math.radians(3.0)),
    (1 - FOLLOWS, 1 + FOLLOWS),
    cells=1,
    met=0.9,
)
PHYSICAL = RunTolerance(
    0.5, (0.02, math.radians(2.0)), (0.1, math.radians(10.0)), SIZE, cells=3, met=0.5
)


class Expected(Struct, frozen=True):
    """The expected topics, frames, rates and limits; '' is not required.

    `limits` are metres and radians a second, `view` is the direction of the camera from the base,
    `upward` what is up in its image.
    """

    types: dict[str, str] = {}  # message type by topic
    domain: int = 0
    commands: str = ""
    clock: str = ""
    odometry: str = ""
    transforms: str = ""
    scan: str = ""
    image: str = ""
    info: str = ""
    root: str = ""
    base: str = ""
    scan_rate: float = 0.0
    image_rate: float = 0.0
    limits: tuple[float, float] = NO_LIMITS
    view: Vector = (0.0, 0.0, 0.0)
    upward: Vector = (0.0, 0.0, 0.0)
    turn_rate: float = 0.0  # of the lidar, a second
    frames: tuple[str, ...] = ()  # that the tree is to have below its root
    roots: tuple[str, ...] = ()  # of all trees, where there are several
    joint_commands: str = ""  # the topic by which joints are commanded
    is_car: bool = False  # whether the lab has a controller that steers
    has_rollers: bool = False  # whether the lab has a controller of wheels with rollers
    wheel_radius: float = 0.0  # that the lab asks of controllers, metres
    centre: tuple[float, float] = (0.0, 0.0)  # of its turns, in the frame of the base, metres
    profile: dict[str, Any] = {}  # of a lidar whose own cannot be read
    static: frozenset[str] = frozenset()  # topics of transforms that are kept
    restarts: bool = False  # whether the clock begins anew after Stop
    goes_with_environment: bool = False  # whether another ROS_DOMAIN_ID may move all topics
    robot: str = ""  # the body that is watched; that of the robot with the most joints where empty
    goal_status: str = ""  # the topic of the status of goals
    map: str = ""
    map_frame: str = ""
    joint_states: str = ""
    place: str = ""  # the path of the lab's only robot, which is watched before others
    trees: int = 0  # as many trees of any roots may be there; 0 where a lab names the roots
    haste: float = 1.0  # times that a clock may run faster than the simulation, or slower
    has_ground: bool = False  # whether a stage without ground below its robots is given some


class Cause(NamedTuple):
    """The node that causes a fault, what is wrong with it, and the kind of that."""

    prim: str
    reason: str
    kind: FaultKind | None  # None where only the node is known


def ramps_of(values: Mapping[str, float]) -> tuple[float, float]:
    """Return how fast the inputs of a controller let a robot go faster, and turn; 0: at once.

    A car takes its acceleration from an input that another one limits
    (ackermann_controller.py:110-135).
    """
    most, gentle = abs(values.get("maxAcceleration", 0.0)), abs(values.get("acceleration", 0.0))
    if "acceleration" in values:
        return min(gentle, most or math.inf), 0.0
    least = min(most, abs(values.get("maxDeceleration", 0.0)))
    return least, abs(values.get("maxAngularAcceleration", 0.0))


class RunFault(NamedTuple):
    """A fault of a run: its message, its kind, and the prim at fault if known.

    What the run does not know for sure is no fault: `sure` is false then.
    """

    message: str
    kind: FaultKind
    prim: str = ""
    cause: str = ""
    sure: bool = True


def caused(message: str, kind: FaultKind, cause: Cause | None) -> RunFault:
    """Return a fault with its cause, where that is known, which may be of a kind of its own."""
    if cause is None:
        return RunFault(message, kind)
    return RunFault(message, cause.kind or kind, cause.prim, cause.reason)


class Stretch(NamedTuple):
    """A leg, the pose before it, and the poses in it."""

    leg: Leg
    before: Pose
    poses: Sequence[Pose]

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return len(self.poses) / RATE

    @property
    def steady(self) -> Stretch:
        """The part in which the wheels turn as commanded; all of it where it is too short."""
        if len(self.poses) <= 2 * STARTED:
            return self
        return Stretch(self.leg, self.poses[STARTED - 1], self.poses[STARTED:])

    @property
    def turned(self) -> float:
        """How far the robot turned, beyond a whole turn as well."""
        pairs = pairwise([self.before, *self.poses])
        return sum(angle(later.heading - pose.heading) for pose, later in pairs)

    @property
    def path_length(self) -> float:
        """How far the robot went, along its path."""
        pairs = pairwise([self.before, *self.poses])
        return sum(math.hypot(later.x - pose.x, later.y - pose.y) for pose, later in pairs)


class Trial(Struct):
    """A recorded drive and what it is judged by.

    `walls` returns the expected scan at a pose, `cut_room` what stands still, cut at the height of
    the lidar.
    """

    recording: Recording
    drive: Sequence[Session]
    wanted: Expected
    start: Affine = HERE
    walls: Callable[[Affine, Scan], tuple[float, ...]] | None = None
    causes: RunCauses | None = None
    cut_room: Callable[[], tuple[Segment, ...]] = tuple
    radius: float = 0.0  # of the robot
    tolerance: RunTolerance = EXACT
    factor: float = 1.0  # metres that the wheels roll for each metre commanded
    map: OccupancyMap | None = None  # what it is localized in
    map_fault: str = ""  # why that cannot be read
    # Where the map has the root of TF, from when on; several if unknown.
    located: tuple[Sequence[tuple[float, Affine]], ...] = ()
    fit: MapFit | None = None  # of its scans on the map
    scrubs: bool = False  # whether its wheels slide in a turn, so that it turns about as commanded
    # The checks that stand in place of those of a lab and of two driven wheels, by name.
    own_checks: dict[str, Look] = {}

    @property
    def nodes(self) -> Mapping[str, NodeInstance]:
        """The nodes that run, none of a recording."""
        return {} if self.causes is None else self.causes.program.nodes

    @property
    def room(self) -> tuple[Segment, ...]:
        """What stands still, cut at the height of the lidar; nothing where that is unknown."""
        return self.cut_room()

    def stretches(self, *names: str) -> Iterator[Stretch]:
        """Yield the legs of the first session that have one of these names."""
        poses = [pose for pose in self.recording.path if not pose.session]
        first = 0
        for leg in self.drive[0].legs:
            count = round(leg.seconds * RATE)
            if leg.name in names and poses[first : first + count]:
                yield Stretch(leg, poses[max(0, first - 1)], poses[first : first + count])
            first += count

    def pose(self, message: Message) -> Pose:
        """Return where the robot was when a message was sent."""
        poses = [pose for pose in self.recording.path if pose.session == message.session]
        return poses[min(len(poses), max(1, round(message.at * RATE))) - 1]

    def motion_fault(self, message: str, kind: FaultKind) -> RunFault:
        """Return a fault of how the robot moves, with its cause."""
        return caused(message, kind, self.causes.of_motion() if self.causes is not None else None)

    def follows(self, driven: float, commanded: float, *, turning: bool = False) -> bool:
        """Whether the robot does what it is commanded, by the wheels that it has."""
        least, most = SIZE if turning and self.scrubs else self.tolerance.size
        return least <= driven / (commanded * self.factor) <= most

    def reached(self, speed: float, seconds: float, *, turning: bool = False) -> float:
        """Return the part of a way that acceleration limits let a robot do, from rest."""
        limit = self.causes.ramps()[turning] if self.causes is not None else 0.0
        if not (limit and speed and seconds):
            return 1.0
        ramp = abs(speed) / limit / seconds  # the part of the time in which it gets going
        return 1.0 - ramp / 2 if ramp < 1 else 1.0 / (2 * ramp)

    @property
    def has_ramps(self) -> bool:
        """Whether acceleration limits let the robot get going and stop only slowly."""
        return self.causes is not None and any(self.causes.ramps())

    def judged_part(self, stretch: Stretch) -> tuple[Stretch, float]:
        """Return the part of a leg by which it is judged, and the seconds in which it drives."""
        part = stretch if self.has_ramps else stretch.steady
        return part, part.seconds

    def expected_text(self, commanded: float, unit: str) -> str:
        """Return the motion that the wheels give for a command, if it differs."""
        return f", expected {commanded * self.factor:{unit}}" if self.factor != 1.0 else ""

    def when(self, sessions: Sequence[int]) -> str:
        """Say in which sessions, if not in all from the first on."""
        if 0 in sessions:
            return ""
        outside = self.drive[sessions[0]].environment
        return f" with ROS_DOMAIN_ID={outside}" if outside else " after Stop and Play"

    def never_moves(self) -> bool:
        """Whether the robot never moves."""
        first = self.recording.path[0]
        poses = [pose for pose in self.recording.path if not pose.session]
        ways = [displacement(first, pose) for pose in poses[::SOON]]
        near, turned = self.tolerance.still
        return all(math.hypot(x, y) < near and abs(turn) < turned for x, y, turn in ways)


class Look(NamedTuple):
    """A check of a trial of one kind, and whether it is asked for and something came for it."""

    faults: Callable[[Any], Iterator[RunFault]]
    is_asked: Callable[[Any], bool]


def displacement(before: Pose, after: Pose) -> tuple[float, float, float]:
    """Return how far it went ahead and to the left, and how far it turned."""
    dx, dy = after.x - before.x, after.y - before.y
    c, s = math.cos(before.heading), math.sin(before.heading)
    return c * dx + s * dy, c * dy - s * dx, angle(after.heading - before.heading)


def angle(radians: float) -> float:
    """Return an angle between minus and plus half a turn."""
    return math.remainder(radians, 2 * math.pi)


def is_about(driven: float, commanded: float) -> bool:
    """Whether the driven distance is close to the commanded one."""
    return SIZE[0] <= driven / commanded <= SIZE[1]


PLACE = (0.02, math.radians(2.0))  # of a sensor, between TF and where it is


def in_root(trial: Trial, frame: str, moment: Message | Held) -> Affine | None:
    """Return where TF has a frame at the time of a message, or None where it does not have it."""
    sent = trial.recording.tree(trial.wanted.transforms, moment.session)
    frames = {kept.child: kept for kept, _ in trial.recording.static} | sent.at(moment.at)
    place = HERE
    for _ in range(len(frames)):
        if frame not in frames:
            break
        transform = frames[frame]
        frame = transform.parent
        place = Affine(rotation(transform.rotation), transform.translation).then(place)
    return place if frame == trial.wanted.root else None


def agree(first: Affine, second: Affine) -> bool:
    """Whether two places are the same, as far as a sensor may be off."""
    if length(minus(first.origin, second.origin)) > PLACE[0]:
        return False
    w = first.inverse().then(second).rigid().quaternion()[0]
    return 2 * math.acos(min(1.0, abs(w))) <= PLACE[1]
