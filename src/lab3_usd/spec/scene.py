"""What the lab asks of the scene itself, as data: units, robot, world, sensors and the map."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from msgspec import Meta, Struct

from lab3_usd.isaac.values import Margin
from lab3_usd.spec.ros import MapFacts

if TYPE_CHECKING:
    from lab3_usd.spec.props import PropSpec

Number = Annotated[float, Meta(ge=-1e9, le=1e9)]  # finite, and no room is larger
Positive = Annotated[float, Meta(ge=0, le=1e9)]
Unit = Annotated[float, Meta(gt=0, le=1e9)]
Limit = float  # of a joint: an infinite one is none
Number3 = tuple[Number, Number, Number]
Plain = str | bool | int | float | tuple[Any, ...]
ANYWHERE = "anywhere"  # recognised off the robot as well
SCENE_GROUP = "Scene"  # of the requirements that are about no graph and no sensor


def stands_within(path: str, top: str) -> bool:
    """Whether a prim is another one, or below it."""
    return path == top or path.startswith(f"{top}/")


class StageUnits(Struct, frozen=True, forbid_unknown_fields=True):
    """Up axis and units of a stage, and its default prim, where one is asked for."""

    handout: str
    up_axis: Literal["Y", "Z"]
    meters_per_unit: Unit
    kilograms_per_unit: Unit
    default_prim: str = ""


_NEAR_ZERO = 1e-3  # of the tolerance: below it a lone number is as good as zero
_ONE_SIZE = 0.02  # by how much the radii of two wheels of a robot may differ


class Tolerances(Struct, frozen=True, forbid_unknown_fields=True):
    """Metres, degrees and factors; `mass` and `number` are relative.

    They hold for the description and for the starter. Vectors and colors are measured by their
    longest part. Near zero, limits and drives of joints may differ by `number`, other numbers by a
    thousandth of it.
    """

    mass: Positive
    root_position: Positive
    root_angle: Positive
    sensor_position: Positive
    sensor_angle: Positive
    number: Positive
    scale: Positive
    link_position: Positive
    axle_angle: Positive
    rest: Positive

    def margin(self, kind: Literal["mass", "unit", "joint", "wheel", "number"]) -> Margin:
        """Return what numbers of a kind may differ by."""
        return {
            "mass": Margin(self.mass),
            "unit": Margin(self.number),
            "joint": Margin(self.number, self.number),
            "wheel": Margin(_ONE_SIZE),
            "number": Margin(self.number, _NEAR_ZERO * self.number),
        }[kind]


class PoseSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The pose in the parent: metres, degrees about X then Y then Z, factors."""

    translate: Number3
    rotate: Number3
    scale: Number3
    handout: str = ""

    def __post_init__(self) -> None:
        """Refuse a scale with which nothing is left of a prim."""
        if 0 in self.scale:
            raise ValueError("scale has a 0, with which nothing is left of the prim")


class ArticulationSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The prim with the articulation root ('' for none)."""

    target: str
    handout: str
    api: str = "PhysicsArticulationRootAPI"
    switch: str = "physxArticulation:articulationEnabled"


class LinkSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """A link of the robot.

    With `offset: [0, 0, 0.2]` it is there on the robot in the first checkpoint, and its joint holds
    it there. One that is `held` must not move on the robot; a base is fixed to the world.
    """

    handout: str
    mass: Number | None = None
    offset: Number3 | None = None
    collision: bool = False
    held: bool = False


class WheelSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The two wheels that drive: by joint, the link that it turns (`left_joint: left_wheel`).

    Of more than two, as of a car, describe all as `joints` of the robot. `axle` is the direction
    about which they drive forward. The robot turns about `centre`, the point between them, along X
    and Y of the base.
    """

    handout: str
    joints: Mapping[str, str]
    joints_below: str
    distance: Number
    axle: Number3
    left: str = ""
    centre: tuple[Number, Number] = (0.0, 0.0)


class JointSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """A joint of the robot that turns no wheel, by its name.

    It connects two links, '' for the world. `limits` are degrees of a revolute joint, metres of a
    prismatic one, and -.inf and .inf where it has none; the values of its drive are as the editor
    shows them.
    """

    handout: str
    type: str
    links: tuple[str, str]
    axis: str = ""
    limits: tuple[Limit, Limit] | None = None
    stiffness: Number | None = None
    damping: Number | None = None
    max_force: Number | None = None

    @property
    def drive(self) -> dict[str, float]:
        """What is asked of its drive, by the name in USD."""
        values = {
            "stiffness": self.stiffness,
            "damping": self.damping,
            "maxForce": self.max_force,
        }
        return {name: value for name, value in values.items() if value is not None}


class RobotSpec(Struct, frozen=True, forbid_unknown_fields=True, dict=True):
    """A robot; after the checkpoint `pose_is_error_until` it may have driven.

    `base_frame` is the link whose frame odometry moves, the robot itself without one. `links` are
    bodies below `path`, by name or, below other links, by path. Shapes below prims with names in
    `appearance_below: [visuals]` are its look, and hide no sensor. `name` is its group in
    requirements and points, where it is one of `robots` its key.
    """

    FORMER: ClassVar[Mapping[str, str]] = {"looks_below": "appearance_below"}

    path: str
    handout: str
    pose: PoseSpec | None = None
    base_frame: str = ""
    links: Mapping[str, LinkSpec] = {}
    articulation: ArticulationSpec = ArticulationSpec("", "")
    pose_is_error_until: str = ""
    wheels: WheelSpec = WheelSpec("", {}, "", 0.0, (0.0, 1.0, 0.0))
    joints: Mapping[str, JointSpec] = {}
    appearance_below: tuple[str, ...] = ()
    name: str = ""

    @property
    def group(self) -> str:
        """The group of its requirements: the scene's, where it has no name."""
        return self.name or SCENE_GROUP

    @property
    def title(self) -> str:
        """What titles call it."""
        return self.name or "robot"

    @property
    def called(self) -> str:
        """What sentences call it."""
        return self.name or "the robot"

    @property
    def key(self) -> str:
        """What leads to it in its file."""
        return f"robots: {self.name}" if self.name else "robot"

    @property
    def base(self) -> str:
        """The path of the link that is the base."""
        return self.path_of(self.base_frame)

    @cached_property
    def link_paths(self) -> tuple[str, ...]:
        """The paths of the links."""
        return tuple(map(self.path_of, self.links))

    @property
    def turned_links(self) -> frozenset[str]:
        """The links that wheel joints and described joints tie, which are asked for themselves."""
        return frozenset(
            (*self.wheels.joints.values(), *(j.links[1] for j in self.joints.values()))
        )

    def path_of(self, link: str) -> str:
        """Return the path of a link, that of the robot for ''."""
        return f"{self.path}/{link}" if link else self.path

    def link_at(self, path: str) -> str:
        """Return the name of the link at a path."""
        return path.removeprefix(f"{self.path}/")

    def joint_path(self, name: str) -> str:
        """Return where the handout shows a wheel joint."""
        return "/".join(filter(None, (self.path, self.wheels.joints_below, name)))


# What stands for the robot of a scene that has none: a path that no prim is at or below.
NO_ROBOT = RobotSpec("-", "")


class GraphParent(Struct, frozen=True, forbid_unknown_fields=True):
    """The prim of the world that contains graphs; one that holds nothing else comes with them."""

    path: str
    handout: str


class WorldPart(Struct, frozen=True, forbid_unknown_fields=True):
    """A part of the world, recognised by its type; `usual` is its path in the handout."""

    handout: str
    usual: str


class ObservationCamera(WorldPart, frozen=True, forbid_unknown_fields=True):
    """The camera that watches the robot from outside."""

    type: str


class WorldSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The world around the robot; omit the parts that are not required."""

    graph_parent: GraphParent | None = None
    ground: WorldPart | None = None
    light: WorldPart | None = None
    physics_scene: WorldPart | None = None
    observation_camera: ObservationCamera | None = None


class Unwanted(Struct, frozen=True, forbid_unknown_fields=True):
    """Names and paths of prims that must be absent."""

    handout: str = ""
    names: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()


class ForbiddenPrims(Struct, frozen=True, forbid_unknown_fields=True):
    """Prims that a starter must not contain, and those that would be a second lidar."""

    starter: Unwanted = Unwanted()
    lidar: Unwanted = Unwanted()


class SensorAttribute(Struct, frozen=True, forbid_unknown_fields=True):
    """A value of a sensor as USD has it; the checker requires it if it is `required`.

    With `required: if authored` a camera needs it only where the stage writes one.
    """

    GONE: ClassVar[Mapping[str, str]] = {
        "unset": "leave it out, what is not set has the value of its schema"
    }

    type: str
    value: Any
    required: bool | str = False  # a text: only where it is written
    schema: bool = False  # USD's own schema has it
    handout: str = ""


class ViewSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The direction of view and of up in the image, in the frame of the link."""

    along: Number3
    up: Number3

    def __post_init__(self) -> None:
        """Refuse directions that are none."""
        if not any(self.along) or not any(self.up):
            raise ValueError("along and up are directions, which 0, 0, 0 is not")


class SlipSpec(ViewSpec, frozen=True, forbid_unknown_fields=True):
    """A view that reveals a certain mistake; the hint is the usual one unless another is given."""

    message: str
    hint: str = ""


class KeptValue(Struct, frozen=True, forbid_unknown_fields=True):
    """A value that must not change, and the effect of another one."""

    value: Plain
    otherwise: str


class ScanSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Values with which a lidar gives another scan.

    `circle` limits the azimuth, which is a full circle from `whole` on. `emitters` begins the names
    of lists with an entry for each emitter; `elevation` ends the name of their angles, whose limit
    is `level`. Values in `keep` must not change; `ranges` names the near and far range, between
    which there is something at the start.
    """

    GONE: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("above_zero", "rising"), "leave it out, the schema of the sensor limits its values"
    )

    handout: str
    emitters: str
    elevation: str
    level: Number
    circle: Mapping[str, Number]
    whole: Number
    keep: Mapping[str, KeptValue]
    ranges: tuple[str, str] | None = None


class SensorSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """A sensor.

    The `kind` selects the rules: L for `lidar`, C for `camera`, D for any other. A prim of the type
    at another path is taken for it on the robot, with `recognised: anywhere` also elsewhere. `apis`
    are written, `rate_api` brings a rate; `keep_default` and `plain_image` are USD's defaults.
    """

    FORMER: ClassVar[Mapping[str, str]] = {"looks": "view"}

    kind: str
    path: str
    type: str
    handout: str
    pose: PoseSpec
    recognised: Literal["on the robot", "anywhere"] = "on the robot"
    asset_suffix: str = ""
    apis: tuple[str, ...] = ()
    required_api: str = ""
    required_apis: tuple[str, ...] = ()
    attributes: Mapping[str, SensorAttribute] = {}
    scan: ScanSpec | None = None
    view: ViewSpec | None = None
    slips: tuple[SlipSpec, ...] = ()
    default_handout: str = ""
    keep_default: Mapping[str, Plain] = {}
    plain_image: Mapping[str, Plain] = {}
    rate_api: str = ""

    @property
    def name(self) -> str:
        """The name of the sensor's prim."""
        return self.path.rpartition("/")[2]

    @property
    def required(self) -> dict[str, SensorAttribute]:
        """The attributes that are checked."""
        return {
            name: attribute for name, attribute in self.attributes.items() if attribute.required
        }


class SceneSpec(Struct, frozen=True):
    """The scene: units, robots, sensors, world and map."""

    stage: StageUnits
    tolerance: Tolerances
    robots: tuple[RobotSpec, ...]
    world: WorldSpec
    forbidden: ForbiddenPrims = ForbiddenPrims()
    sensors: Mapping[str, SensorSpec] = {}
    map: MapFacts | None = None
    namespaces: Mapping[str, str] = {}
    props: Mapping[str, PropSpec] = {}

    @property
    def robot(self) -> RobotSpec:
        """The first robot, which examples and Nav2 speak of; NO_ROBOT where there is none."""
        return self.robots[0] if self.robots else NO_ROBOT

    def robot_of(self, path: str) -> RobotSpec | None:
        """Return the robot to which a path belongs, None where it belongs to none."""
        return next((robot for robot in self.robots if stands_within(path, robot.path)), None)

    def group_of(self, path: str) -> str:
        """Return the group of what is asked at a path: that of its robot, else the scene's."""
        robot = self.robot_of(path)
        return SCENE_GROUP if robot is None else robot.group
