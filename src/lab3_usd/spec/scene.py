"""What the lab asks of the scene itself, as data: units, robot, world, sensors and the map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from lab3_usd.spec.ros import MapFacts

Number = Annotated[float, Meta(ge=-1e9, le=1e9)]  # finite, and no room is larger
Number3 = tuple[Number, Number, Number]
Plain = str | bool | int | float | tuple[Any, ...]
ANYWHERE = "anywhere"  # recognised off the robot as well


class StageUnits(Struct, frozen=True, forbid_unknown_fields=True):
    """The axis that is up, and the units of a stage."""

    handout: str
    up_axis: str
    meters_per_unit: Number
    kilograms_per_unit: Number


class Tolerances(Struct, frozen=True, forbid_unknown_fields=True):
    """How exactly numbers must be met: metres, degrees, factors; `mass` and `number` relative."""

    mass: Number
    root_position: Number
    root_angle: Number
    sensor_position: Number
    sensor_angle: Number
    number: Number
    scale: Number
    link_position: Number
    axle_angle: Number
    rest: Number


class PoseSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Where a prim stands in its parent: metres, degrees about X then Y then Z, factors."""

    translate: Number3
    rotate: Number3
    scale: Number3
    handout: str = ""


class ArticulationSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The prim with the articulation root ('' for none), its schema, and what switches it off."""

    target: str
    handout: str
    api: str = "PhysicsArticulationRootAPI"
    switch: str = "physxArticulation:articulationEnabled"


class LinkSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """A link of the robot; None where nothing is asked of its mass or its place on the robot.

    One with a place, and one that is `held`, must not move on the robot.
    """

    handout: str
    mass: Number | None = None
    offset: Number3 | None = None
    collision: bool = False
    held: bool = False


class WheelSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The wheels by joint, where their joints are shown, the axle that drives forward, the left.

    The joints stand at `joints_below`, a path below the robot's; `distance` is between the wheels.
    """

    handout: str
    joints: Mapping[str, str]
    joints_below: str
    distance: Number
    axle: Number3
    left: str = ""


class RobotSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The robot; from the checkpoint after `pose_is_error_until` on it may have driven.

    `base_frame` is the link that stands for the robot: its name is the frame that odometry moves.
    `links` are the bodies right below `path`, by their names. What lies below prims of the names in
    `looks_below` is how it looks, or collides.
    """

    path: str
    handout: str
    pose: PoseSpec
    base_frame: str
    links: Mapping[str, LinkSpec]
    articulation: ArticulationSpec = ArticulationSpec("", "")
    pose_is_error_until: str = ""
    wheels: WheelSpec = WheelSpec("", {}, "", 0.0, (0.0, 1.0, 0.0))
    looks_below: tuple[str, ...] = ()

    @property
    def base(self) -> str:
        """The path of the link that is the base."""
        return f"{self.path}/{self.base_frame}"

    @property
    def link_paths(self) -> tuple[str, ...]:
        """The paths of the links."""
        return tuple(f"{self.path}/{name}" for name in self.links)

    def joint_path(self, name: str) -> str:
        """Return where the handout shows a wheel joint."""
        return "/".join(filter(None, (self.path, self.wheels.joints_below, name)))


class GraphParent(Struct, frozen=True, forbid_unknown_fields=True):
    """The prim of the world below which graphs stand."""

    path: str
    handout: str


class WorldPart(Struct, frozen=True, forbid_unknown_fields=True):
    """A part of the world, recognised by its type; `usual` is where the handout shows it."""

    handout: str
    usual: str


class ObservationCamera(WorldPart, frozen=True, forbid_unknown_fields=True):
    """The camera that watches the robot from outside."""

    type: str


class WorldSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The world around the robot; None for what is not asked for."""

    graph_parent: GraphParent
    ground: WorldPart | None = None
    light: WorldPart | None = None
    physics_scene: WorldPart | None = None
    observation_camera: ObservationCamera | None = None


class Unwanted(Struct, frozen=True, forbid_unknown_fields=True):
    """The names and paths of prims that must not be there."""

    handout: str = ""
    names: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()


class ForbiddenPrims(Struct, frozen=True, forbid_unknown_fields=True):
    """What a starter must not hold, and what would be a second lidar."""

    starter: Unwanted = Unwanted()
    lidar: Unwanted = Unwanted()


class SensorAttribute(Struct, frozen=True, forbid_unknown_fields=True):
    """A value that is written at a sensor; one that is `required` is checked."""

    type: str
    value: Any
    required: bool | str = False  # a text: only where it is written
    unset: str = ""  # what the schema's own value does: it is `right`, or `unclear`
    schema: bool = False  # USD's own schema has it
    handout: str = ""


class ViewSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Where a camera looks and what is up in its image, in the frame of its link."""

    along: Number3
    up: Number3


class SlipSpec(ViewSpec, frozen=True, forbid_unknown_fields=True):
    """A view that tells which mistake was made."""

    message: str
    hint: str


class KeptValue(Struct, frozen=True, forbid_unknown_fields=True):
    """A value that nobody should change, and what happens otherwise."""

    value: Plain
    otherwise: str


class ScanSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The values by which a lidar gives no scan or another one.

    Of a pair in `rising` the first is less than the second. `circle` has the limits of the azimuth,
    `whole` the degrees from which on they are a circle. `emitters` opens the names of the lists
    with an entry for each emitter; `elevation` ends that of the angles, `level` is their limit.
    `ranges` are the near and the far range, in metres.
    """

    handout: str
    above_zero: tuple[str, ...]
    rising: tuple[tuple[str, str], ...]
    emitters: str
    elevation: str
    level: Number
    circle: Mapping[str, Number]
    whole: Number
    keep: Mapping[str, KeptValue]
    ranges: tuple[str, str] | None = None


class SensorSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """A sensor of any kind; a lidar may have a `scan`, a camera where it `looks`.

    The `kind` decides the rules: L for `lidar`, C for `camera`, D for any other word, such as
    `imu`. One that is `recognised` `anywhere` is every prim of the type, also off the robot.
    `apis` are the schemas that are written, `rate_api` the one that brings a rate. `keep_default`
    and `plain_image` have what USD takes where nothing is written.
    """

    kind: str
    path: str
    type: str
    handout: str
    pose: PoseSpec
    recognised: str = "on the robot"
    asset_suffix: str = ""
    apis: tuple[str, ...] = ()
    required_api: str = ""
    required_apis: tuple[str, ...] = ()
    attributes: Mapping[str, SensorAttribute] = {}
    scan: ScanSpec | None = None
    looks: ViewSpec | None = None
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


class SceneSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Everything that `scene.yaml` says."""

    stage: StageUnits
    tolerance: Tolerances
    robot: RobotSpec
    world: WorldSpec
    forbidden: ForbiddenPrims = ForbiddenPrims()
    sensors: Mapping[str, SensorSpec] = {}
    map: MapFacts | None = None
