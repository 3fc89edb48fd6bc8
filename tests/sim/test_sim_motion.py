"""Rolling, falling, walls and rays, against cases worked out by hand."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence

import pytest
from breaking import correct_stage
from pxr import Gf, Sdf, Usd, UsdGeom
from scene_stages import (
    FLOOR,
    JOINTS,
    ROBOT,
    Change,
    deactivate,
    define,
    put,
    remove,
    several,
    weld,
    with_api,
)

from lab3_usd.model.dry_run import AXES, HERE, Affine, ScenePrim, about, rotation
from lab3_usd.physics.machine import Machine
from lab3_usd.physics.machines import Machines
from lab3_usd.physics.surfaces import (
    Surface,
    cut,
    distance_to_segments,
    height_at,
    joined_segments,
    placed_surface,
)
from lab3_usd.sim.lidar import Beam, sweep
from lab3_usd.spec.load.loader import load_platform
from lab3_usd.stage.read.scene import read_scene

DT = 1.0 / 60.0


def machine(*changes: Change) -> tuple[Machines, Machine]:
    stage = correct_stage("05")
    several(*changes)(stage)
    machines = Machines(read_scene(stage, load_platform()))
    return machines, machines.member[f"{ROBOT}/base_footprint"]


def turned(machines: Machines, robot: Machine, left: float, right: float, frames: int) -> Machine:
    for name, speed in zip(("left", "right"), (left, right), strict=True):
        robot.joints[f"wheel_{name}_joint"].target_velocity = speed
    for _ in range(frames):
        machines.step(DT)
    return robot


def test_wheels_that_turn_alike_roll_straight() -> None:
    robot = turned(*machine(), left=2.0, right=2.0, frames=30)
    assert robot.x == pytest.approx(2.0 * 0.033 * 0.5)
    assert (robot.y, robot.yaw) == pytest.approx((0.0, 0.0))


def test_wheels_that_turn_otherwise_go_on_a_circle() -> None:
    robot = turned(*machine(), left=1.0, right=3.0, frames=60)
    angle = 2.0 * 0.033 / 0.16
    radius = 2.0 * 0.033 / angle
    assert robot.yaw == pytest.approx(angle)
    assert robot.x == pytest.approx(radius * math.sin(angle))
    assert robot.y == pytest.approx(radius * (1 - math.cos(angle)))


def test_a_wheel_further_out_turns_the_robot_less() -> None:
    wide = put(f"{JOINTS}/wheel_left_joint", "physics:localPos0", Gf.Vec3f(0, 0.1, 0.023))
    robot = turned(*machine(wide), left=-1.0, right=1.0, frames=60)
    assert robot.yaw == pytest.approx(2.0 * 0.033 / 0.18)


def test_wheels_that_are_not_on_one_axle_slide_in_a_turn() -> None:
    assert not machine()[1].scrubs
    ahead = put(f"{JOINTS}/wheel_left_joint", "physics:localPos0", Gf.Vec3f(0.05, 0.08, 0.023))
    assert machine(ahead)[1].scrubs


def test_a_spring_holds_a_wheel_back() -> None:
    """Stiffness 10 and damping 0.2: it settles 0.02 s x speed ahead of where it began."""
    stiff = put(f"{JOINTS}/wheel_left_joint", "drive:angular:physics:stiffness", 10.0)
    machines, robot = machine(stiff)
    turned(machines, robot, left=1.0, right=0.0, frames=120)
    assert robot.joints["wheel_left_joint"].position == pytest.approx(0.02, rel=1e-3)


def test_a_drive_without_force_moves_nothing() -> None:
    names = (f"{JOINTS}/wheel_{each}_joint" for each in ("left", "right"))
    weak = [put(name, "drive:angular:physics:maxForce", 0.0) for name in names]
    robot = turned(*machine(*weak), left=2.0, right=2.0, frames=30)
    assert robot.x == 0.0


def test_a_wheel_turns_as_far_as_its_joint_lets_it() -> None:
    """90 degrees forward, as far as it wants back."""
    left = put(f"{JOINTS}/wheel_left_joint", "physics:upperLimit", 90.0)
    machines, robot = machine(left)
    turned(machines, robot, left=4.0, right=4.0, frames=60)
    assert robot.joints["wheel_left_joint"].position == pytest.approx(math.pi / 2)
    assert robot.yaw > 0
    turned(machines, robot, left=-4.0, right=-4.0, frames=60)
    assert robot.joints["wheel_left_joint"].position == pytest.approx(math.pi / 2 - 4.0)


def test_what_a_stage_says_of_a_drive_is_a_command() -> None:
    """90 degrees a second on both wheels."""
    name = "drive:angular:physics:targetVelocity"
    both = [put(f"{JOINTS}/wheel_{each}_joint", name, 90.0) for each in ("left", "right")]
    machines, robot = machine(*both)
    machines.step(DT)
    assert robot.velocity[0] == pytest.approx(math.pi / 2 * 0.033)


def test_a_robot_that_hangs_on_the_world_stays() -> None:
    hold = weld(f"{JOINTS}/hold", body1=f"{ROBOT}/base_footprint")
    robot = turned(*machine(hold), left=2.0, right=2.0, frames=30)
    assert (robot.x, robot.yaw) == (0.0, 0.0)


HUB = f"{ROBOT}/hub"
ON_A_WHEEL = several(
    define(HUB, "Xform"),
    with_api(HUB, "PhysicsRigidBodyAPI"),
    weld(f"{JOINTS}/hub", body0=f"{ROBOT}/wheel_left_link", body1=HUB),
)


def test_a_second_joint_locks_a_wheel_and_what_is_fixed_on_it_does_not() -> None:
    lock = weld(f"{JOINTS}/lock", body0=f"{ROBOT}/base_link", body1=f"{ROBOT}/wheel_left_link")
    assert machine(lock)[1].joints["wheel_left_joint"].locked
    robot = machine(ON_A_WHEEL)[1]
    assert HUB in robot.rest
    assert not robot.joints["wheel_left_joint"].locked


def test_what_is_fixed_on_a_wheel_turns_with_it() -> None:
    machines, robot = machine(ON_A_WHEEL)
    for frames in (0, 10):
        turned(machines, robot, left=2.0, right=2.0, frames=frames)
        hub, wheel = (machines.place(path) for path in (HUB, f"{ROBOT}/wheel_left_link"))
        assert hub.quaternion() == pytest.approx(wheel.quaternion())


def test_a_lifted_robot_falls_on_its_wheels_and_without_ground_it_falls_on() -> None:
    _, robot = machine(put(ROBOT, "xformOp:translate", Gf.Vec3d(1.8, 0, 0.2)))
    assert robot.home == pytest.approx(-0.2, abs=1e-6)
    machines, robot = machine(deactivate(FLOOR))
    assert not robot.grounded
    turned(machines, robot, left=2.0, right=2.0, frames=60)
    assert robot.drop < -4.0
    assert robot.x == 0.0


def test_a_wall_stops_it() -> None:
    """The wall stands at x = 2.35, and the robot reaches about 0.08 m ahead of its origin."""
    robot = turned(*machine(), left=8.0, right=8.0, frames=300)
    assert robot.blocked
    assert 2.35 - 0.15 < 1.8 + robot.x < 2.35 - 0.05


def test_loose_bodies_stay_behind() -> None:
    machines, robot = machine(remove(f"{JOINTS}/scan_joint"))
    before = machines.place(f"{ROBOT}/base_scan").origin
    turned(machines, robot, left=2.0, right=2.0, frames=60)
    assert machines.place(f"{ROBOT}/base_scan").origin == before


def prim(kind: str, **values: object) -> ScenePrim:
    return ScenePrim("/shape", kind, frozenset(), Affine(), values, {}, seen=True)


def test_a_cube_is_cut_into_a_square() -> None:
    square = joined_segments(cut([placed_surface(prim("Cube", size=2.0), HERE)], 0.5))
    assert len(square) == 4
    assert distance_to_segments(square, 0.0, 0.0) == pytest.approx(1.0)
    assert cut([placed_surface(prim("Cube", size=2.0), HERE)], 1.5) == []


@pytest.mark.parametrize(
    ("shape", "radius"),
    [
        (prim("Cylinder", radius=0.5, height=1.0, axis="Z"), 0.5),
        (prim("Sphere", radius=0.5), 0.4),
        (prim("Capsule", radius=0.5, height=0.6, axis="Z"), 0.5),
        (prim("Cone", radius=0.5, height=1.0, axis="Z"), 0.1),
    ],
    ids=lambda each: getattr(each, "type", ""),
)
def test_round_shapes_are_cut_into_circles(shape: ScenePrim, radius: float) -> None:
    found = cut([placed_surface(shape, HERE)], 0.3)
    assert max(math.hypot(x, y) for x, y, _, _ in found) == pytest.approx(radius, rel=0.01)


def mesh(faces: Sequence[int]) -> Surface:
    """Return a square that rises with y, of the points of one face."""
    points = array("f", (0, 0, 0, 1, 0, 0, 1, 1, 2, 0, 1, 2))
    values = {"points": points, "faceVertexCounts": [len(faces)], "faceVertexIndices": faces}
    buffers = {
        name: memoryview(value if isinstance(value, array) else array("i", value))
        for name, value in values.items()
    }
    return placed_surface(prim("Mesh", **buffers), HERE)


def test_a_mesh_is_what_its_faces_say() -> None:
    square = [mesh((0, 1, 2, 3))]
    assert height_at(square, 0.5, 0.5, 9.0) == pytest.approx(1.0)
    assert height_at(square, 0.5, 0.5, 0.9) is None
    assert height_at(square, 1.5, 0.5, 9.0) is None
    assert sorted(cut(square, 1.0)) == [(0.5, 0.5, 0.0, 0.5), (1.0, 0.5, 0.5, 0.5)]


@pytest.mark.parametrize("faces", [(0, 1, 2, 4), (0, 1, 2, -1)])
def test_a_face_of_points_that_are_not_there_is_none(faces: Sequence[int]) -> None:
    assert cut([mesh(faces)], 1.0) == []


def test_arrays_of_geometry_are_read_as_buffers_and_only_where_a_ray_can_meet_them() -> None:
    stage = Usd.Stage.CreateInMemory()
    shape = UsdGeom.Mesh.Define(stage, "/Mesh")
    shape.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (1, 1, 2)])
    shape.CreateNormalsAttr([(0, 0, 1)] * 3)
    UsdGeom.PointInstancer.Define(stage, "/Trees").CreatePositionsAttr([(0, 0, 0)])
    prims = read_scene(stage, load_platform()).prims
    assert isinstance(prims["/Mesh"].values["points"], memoryview)
    assert "normals" not in prims["/Mesh"].values
    assert "positions" not in prims["/Trees"].values


def test_what_is_below_a_prim_follows_it_in_the_stage() -> None:
    stage = Usd.Stage.CreateInMemory()
    for path in ("/A/B/C", "/AB", "/A/D"):
        stage.DefinePrim(path)
    scene = read_scene(stage, load_platform())
    assert [below.path for below in scene.below("/A")] == ["/A", "/A/B", "/A/B/C", "/A/D"]
    assert list(scene.below("/B")) == []


ROOM = (
    (-1.0, -1.0, 1.0, -1.0),
    (1.0, -1.0, 1.0, 1.0),
    (1.0, 1.0, -1.0, 1.0),
    (-1.0, 1.0, -1.0, -1.0),
)


def test_rays_in_a_square_room() -> None:
    beam = Beam(-math.pi, math.pi / 4, 8, 0.1, 10.0)
    assert sweep(beam, ROOM) == pytest.approx([1, math.sqrt(2)] * 4)


def test_rays_begin_at_the_near_range_and_end_at_the_far() -> None:
    near = [(0.5, -0.2, 0.5, 0.2)]
    quarter = math.pi / 2
    assert sweep(Beam(-math.pi, quarter, 4, 0.1, 10.0), (*ROOM, *near))[2] == pytest.approx(0.5)
    assert sweep(Beam(-math.pi, quarter, 4, 0.6, 10.0), (*ROOM, *near))[2] == pytest.approx(1.0)
    assert sweep(Beam(-math.pi, quarter, 4, 0.1, 0.9), ROOM) == (-1.0,) * 4


@pytest.mark.parametrize(
    "axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.6, 0.8), (0.6, 0.0, -0.8)]
)
@pytest.mark.parametrize("degrees", [0, 30, 90, 179, 180])
def test_a_rotation_comes_back_as_its_quaternion(
    axis: tuple[float, float, float], degrees: int
) -> None:
    place = Affine(about(axis, math.radians(degrees)))
    again = rotation(place.quaternion())
    for one, other in zip(again, place.rows, strict=True):
        assert one == pytest.approx(other, abs=1e-7)
    for one, other in zip(place.then(place.inverse()).rows, AXES, strict=True):
        assert one == pytest.approx(other, abs=1e-12)


def test_a_lidar_stands_where_usd_says_though_usd_does_not_know_its_type() -> None:
    stage = correct_stage("05")
    lidar = stage.GetPrimAtPath(f"{ROBOT}/base_scan/Lidar2D")
    lidar.GetAttribute("xformOp:translate").Set(Gf.Vec3d(0, 0, 0.1))
    assert read_scene(stage, load_platform()).prims[
        str(lidar.GetPath())
    ].world.origin == pytest.approx((1.768, 0.0, 0.282))


def test_a_version_that_is_no_number_is_none() -> None:
    stage = correct_stage("05")
    clock = stage.GetPrimAtPath("/World/ROS_Clock/ros2_publish_clock")
    clock.RemoveProperty("node:typeVersion")
    clock.CreateAttribute("node:typeVersion", Sdf.ValueTypeNames.String).Set("two")
    nodes = (node for graph in read_scene(stage, load_platform()).graphs for node in graph.nodes)
    assert next(node for node in nodes if node.path == str(clock.GetPath())).version == 0


def test_samples_at_the_start_are_what_plays() -> None:
    stage = correct_stage("05")
    publisher = stage.GetPrimAtPath("/World/ROS_Clock/ros2_publish_clock")
    port = publisher.GetAttribute("inputs:topicName")
    port.Set("/late", 0.0)
    wall = UsdGeom.Xformable(stage.GetPrimAtPath("/Environment/Walls/East"))
    wall.GetPrim().GetAttribute("xformOp:translate").Set(Gf.Vec3d(9, 0, 0), 0.0)
    scene = read_scene(stage, load_platform())
    clock = next(graph for graph in scene.graphs if graph.path == "/World/ROS_Clock")
    node = next(each for each in clock.nodes if each.path == str(port.GetPrim().GetPath()))
    assert node.inputs["inputs:topicName"].value == "/late"
    assert scene.prims["/Environment/Walls/East"].world.origin[0] == 9.0
