"""One way to break each scene item of the lab, through the USD API."""

from __future__ import annotations

import math

from models import LINKS
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt
from sabotage import sensor_sabotage
from scene_stages import (
    FLOOR,
    JOINTS,
    MATERIALS,
    ORIENT,
    ROBOT,
    SCALE,
    SLIDING,
    TRANSLATE,
    WHEELS,
    Change,
    Sabotage,
    aim,
    author,
    clear,
    collider,
    deactivate,
    define,
    drive,
    move_prim,
    put,
    remove,
    retype,
    several,
    slick,
    switch,
    turn,
    undefine,
    void,
    weld,
    with_api,
    without_api,
)


def _no_wheel_collision(wheel: str) -> Change:
    return deactivate(f"{ROBOT}/{wheel}/collisions")


def _prims() -> list[Sabotage]:
    found = [Sabotage("no World", "00", remove("/World"), ("/World", None))]
    found += [Sabotage("World off", "00", deactivate("/World"), ("/World", None))]
    for path in (ROBOT, *(f"{ROBOT}/{link}" for link in LINKS)):
        name = path.rpartition("/")[2]
        found += [
            Sabotage(f"no {name}", "00", remove(path), (path, None)),
            Sabotage(f"{name} off", "00", deactivate(path), (path, None)),
            Sabotage(f"{name} only over", "00", undefine(path), (path, None)),
        ]
    return found


def _units() -> list[Sabotage]:
    return [
        Sabotage(
            "Y up",
            "01",
            lambda stage: void(UsdGeom.SetStageUpAxis(stage, "Y")),
            ("/", "upAxis"),
        ),
        Sabotage(
            "centimetres",
            "01",
            lambda stage: void(UsdGeom.SetStageMetersPerUnit(stage, 0.01)),
            ("/", "metersPerUnit"),
        ),
        Sabotage(
            "grams",
            "01",
            lambda stage: void(UsdPhysics.SetStageKilogramsPerUnit(stage, 0.001)),
            ("/", "kilogramsPerUnit"),
        ),
    ]


def _poses() -> list[Sabotage]:
    at_root = (ROBOT, TRANSLATE)
    return [
        Sabotage("robot moved", "05", put(ROBOT, TRANSLATE, Gf.Vec3d(0, 0, 0)), at_root),
        Sabotage("robot lifted", "00", put(ROBOT, TRANSLATE, Gf.Vec3d(1.8, 0, 0.2)), at_root),
        Sabotage("robot turned", "05", put(ROBOT, ORIENT, turn(90)), (ROBOT, ORIENT)),
        Sabotage("robot scaled", "05", put(ROBOT, SCALE, Gf.Vec3d(2, 2, 2)), (ROBOT, SCALE)),
        Sabotage(
            "lidar link moved",
            "00",
            put(f"{ROBOT}/base_scan", TRANSLATE, Gf.Vec3d(0, 0, 0.182)),
            (f"{ROBOT}/base_scan", TRANSLATE),
        ),
    ]


def _bodies() -> list[Sabotage]:
    found = []
    for link in LINKS:
        path = f"{ROBOT}/{link}"
        body = (path, "physics:rigidBodyEnabled")
        found.append(
            Sabotage(f"{link} no body", "02", without_api(path, "PhysicsRigidBodyAPI"), body)
        )
        off = switch(path, body[1])
        found.append(Sabotage(f"{link} body off", "02", off, body))
        if link != "base_footprint":
            mass = (path, "physics:mass")
            found += [
                Sabotage(f"{link} heavy", "05", put(path, "physics:mass", 1.5), mass),
                Sabotage(f"{link} without mass", "05", clear(path, "physics:mass"), mass),
            ]
    kinematic = switch(f"{ROBOT}/base_link", "physics:kinematicEnabled", on=True)
    site = (f"{ROBOT}/base_link", "physics:kinematicEnabled")
    found += [
        Sabotage(
            f"{link} scaled", "05", put(f"{ROBOT}/{link}", SCALE, size), (f"{ROBOT}/{link}", SCALE)
        )
        for link, size in zip(LINKS, _SIZES, strict=True)
    ]
    wheel, owner = f"{ROBOT}/wheel_left_link", "physics:simulationOwner"
    skirt = f"{ROBOT}/base_link/skirt"
    low = several(
        define(skirt, "Cube"), author(skirt, "size", "Double", 0.022), with_api(skirt, _COLLISION)
    )
    return [
        *found,
        Sabotage("base 1 mm below the wheels", "02", low, (skirt, None)),
        Sabotage(
            "base that tips over",
            "02",
            put(f"{ROBOT}/base_link", "physics:centerOfMass", Gf.Vec3f(0.3, 0, 0.2)),
            (f"{ROBOT}/base_footprint", None),
        ),
        Sabotage("floor that looks down", "02", floor_of_mesh("leftHanded"), (_MESH, None)),
        Sabotage("base kinematic", "02", kinematic, site),
        Sabotage("wheel of no scene", "02", aim(wheel, owner, "/gone"), (wheel, owner)),
    ]


_COLLISION, _MESH = "PhysicsCollisionAPI", "/Environment/GroundPlane/Mesh"


def floor_of_mesh(orientation: str) -> Change:
    """Put a mesh in the place of the ground's plane."""
    corners = Vt.Vec3fArray([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)])
    return several(
        deactivate(FLOOR),
        define(_MESH, "Mesh"),
        author(_MESH, "points", "Point3fArray", corners),
        author(_MESH, "faceVertexCounts", "IntArray", [4]),
        author(_MESH, "faceVertexIndices", "IntArray", [0, 1, 2, 3]),
        author(_MESH, "orientation", "Token", orientation),
        with_api(_MESH, _COLLISION),
    )


_SIZES = [
    *(Gf.Vec3d(1.2, 1.2, 1.2), Gf.Vec3d(1, 1, 0.98), Gf.Vec3d(-1, 1, 1), Gf.Vec3d(1, 1.01, 1)),
    *(Gf.Vec3d(1, 1, 1.5), Gf.Vec3d(1.002, 1, 1)),
]


def _articulation() -> list[Sabotage]:
    api, base = "PhysicsArticulationRootAPI", f"{ROBOT}/base_footprint"
    other = f"{ROBOT}/base_link"
    moved = several(without_api(base, api), with_api(other, api))
    off = switch(base, "physxArticulation:articulationEnabled")
    return [
        Sabotage("no articulation", "02", without_api(base, api), (base, None)),
        Sabotage("articulation off", "02", off, (base, None)),
        Sabotage("articulation elsewhere", "02", moved, (other, None)),
        Sabotage("two articulations", "02", with_api(other, api), (other, None)),
    ]


def _wheels() -> list[Sabotage]:
    found = []
    for name, link in WHEELS.items():
        path, flag = collider(link), "physics:collisionEnabled"
        off = several(
            deactivate(f"{ROBOT}/{link}/collisions"),
            define(f"{ROBOT}/{link}/shape", "Cylinder"),
            with_api(f"{ROBOT}/{link}/shape", "PhysicsCollisionAPI"),
            switch(f"{ROBOT}/{link}/shape", flag),
        )
        found += [
            Sabotage(
                f"{link} no shape", "00", _no_wheel_collision(link), (f"{ROBOT}/{link}", flag)
            ),
            Sabotage(f"{link} shape off", "00", off, (f"{ROBOT}/{link}/shape", flag)),
            Sabotage(
                f"{link} tyre off",
                "00",
                switch(path, flag),
                (path, flag),
            ),
            *_joint(name),
        ]
    return found


def _joint(name: str) -> list[Sabotage]:
    path, other = f"{JOINTS}/{name}", f"{ROBOT}/{WHEELS[_twin(name)]}"
    enabled = switch(path, "physics:jointEnabled")
    backward = put(path, "physics:localRot0", Gf.Quatf(0.70710678, 0.70710678, 0, 0))
    api = "PhysicsDriveAPI:angular"
    return [
        Sabotage(f"no {name}", "02", remove(path), (path, None)),
        Sabotage(f"{name} off", "02", deactivate(path), (path, None)),
        Sabotage(f"{name} fixed", "02", retype(path, "PhysicsFixedJoint"), (path, None)),
        Sabotage(f"{name} disabled", "02", enabled, (path, "physics:jointEnabled")),
        Sabotage(f"{name} renamed", "00", move_prim(path, f"{path}_1"), (f"{path}_1", None)),
        Sabotage(
            f"{name} wrong wheel", "02", aim(path, "physics:body1", other), (path, "physics:body1")
        ),
        Sabotage(f"{name} in the world", "02", aim(path, "physics:body0"), (path, "physics:body0")),
        Sabotage(f"{name} axis", "02", put(path, "physics:axis", "X"), (path, "physics:axis")),
        Sabotage(f"{name} backward", "02", backward, (path, "physics:localRot0")),
        Sabotage(
            f"{name} stiff", "02", put(path, drive("stiffness"), 10.0), (path, drive("stiffness"))
        ),
        Sabotage(
            f"{name} undamped", "02", put(path, drive("damping"), 0.0), (path, drive("damping"))
        ),
        Sabotage(
            f"{name} damping unset", "02", clear(path, drive("damping")), (path, drive("damping"))
        ),
        Sabotage(
            f"{name} without force",
            "02",
            put(path, drive("maxForce"), 0.0),
            (path, drive("maxForce")),
        ),
        Sabotage(
            f"{name} weak", "02", put(path, drive("maxForce"), 1e-4), (path, drive("maxForce"))
        ),
        Sabotage(
            f"{name} of type acceleration",
            "02",
            put(path, drive("type"), "acceleration"),
            (path, drive("type")),
        ),
        *(
            Sabotage(f"{name} with a {end}", "02", put(path, end, at), (path, end))
            for end, at in (("physics:lowerLimit", -90.0), ("physics:upperLimit", 90.0))
        ),
        Sabotage(f"{name} undriven", "02", without_api(path, api), (path, drive("damping"))),
        Sabotage(
            f"{name} wide",
            "02",
            put(path, "physics:localPos0", Gf.Vec3f(0, 0.1 if "left" in name else -0.1, 0.023)),
            (path, "physics:localPos0"),
        ),
    ]


def _twin(name: str) -> str:
    return next(other for other in WHEELS if other != name)


def _loose() -> list[Sabotage]:
    hold = f"{JOINTS}/root_joint"
    held = weld(hold, body1=f"{ROBOT}/base_footprint")
    lock, cross = f"{JOINTS}/lock", "/World/cross"
    left, right = (f"{ROBOT}/{link}" for link in WHEELS.values())
    scan, place = f"{JOINTS}/scan_joint", "physics:localPos0"
    seconds = {
        "wheel locked": (lock, weld(lock, body0=f"{ROBOT}/base_link", body1=left)),
        "wheels coupled": (cross, weld(cross, "PhysxPhysicsGearJoint", body0=left, body1=right)),
        "wheel on the ground": (lock, weld(lock, "PhysicsDistanceJoint", body1=right)),
        "wheel turned twice": (
            lock,
            weld(lock, "PhysicsRevoluteJoint", body0=f"{ROBOT}/base_footprint", body1=left),
        ),
    }
    found = [Sabotage(name, "02", change, (site, None)) for name, (site, change) in seconds.items()]
    found += [
        Sabotage(f"no {joint}", "02", remove(f"{JOINTS}/{joint}"), (f"{ROBOT}/{link}", None))
        for joint, link in (
            ("base_joint", "base_link"),
            ("scan_joint", "base_scan"),
            ("caster_back_joint", "caster_back_link"),
        )
    ]
    found += [
        # UsdGeom.XformCache places neither a Scope nor a prim without a type, and UsdPhysics makes
        # no body of them.
        Sabotage("robot without a type", "05", retype(ROBOT, ""), (ROBOT, TRANSLATE)),
        Sabotage("robot a Scope", "00", retype(ROBOT, "Scope"), (ROBOT, TRANSLATE)),
        *(
            Sabotage(f"{name} a {kind or 'prim'}", "00", retype(f"{ROBOT}/{name}", kind), site)
            for name in ("base_footprint", "base_scan", "wheel_left_link")
            for kind in ("", "Scope")
            for site in ((f"{ROBOT}/{name}", None),)
        ),
        Sabotage("lidar link on a hinge", "02", retype(scan, "PhysicsRevoluteJoint"), (scan, None)),
        Sabotage(
            "lidar link held elsewhere", "05", put(scan, place, Gf.Vec3f(0.2, 0, 0)), (scan, place)
        ),
    ]
    base = f"{JOINTS}/base_joint"
    excluded = "physics:excludeFromArticulation"
    found += [
        Sabotage("base joint excluded", "02", switch(base, excluded, on=True), (base, excluded)),
        Sabotage("base on a ball joint", "02", retype(base, "PhysicsSphericalJoint"), (base, None)),
        Sabotage(
            "lidar link held on its side",
            "02",
            put(scan, "physics:localRot1", SIDEWAYS),
            (scan, "physics:localRot1"),
        ),
        Sabotage(
            "root is a body", "02", with_api(ROBOT, "PhysicsRigidBodyAPI"), (ROBOT, BODY_SWITCH)
        ),
        *(
            Sabotage(
                f"{link} lies on its side",
                "02",
                turned_wheel(f"{JOINTS}/{name}"),
                (f"{JOINTS}/{name}", "physics:localRot1"),
            )
            for name, link in WHEELS.items()
        ),
        *(
            Sabotage(
                f"{link} collides by its link",
                "02",
                several(
                    without_api(collider(link), "PhysicsCollisionAPI"),
                    with_api(f"{ROBOT}/{link}", "PhysicsCollisionAPI"),
                ),
                (f"{ROBOT}/{link}", "physics:collisionEnabled"),
            )
            for link in WHEELS.values()
        ),
    ]
    left_joint, right_joint = (f"{JOINTS}/{name}" for name in WHEELS)
    exchanged = several(
        put(left_joint, "physics:localPos0", Gf.Vec3f(0, -0.08, 0.023)),
        put(right_joint, "physics:localPos0", Gf.Vec3f(0, 0.08, 0.023)),
    )
    found.append(Sabotage("wheels exchanged", "02", exchanged, (left_joint, "physics:localPos0")))
    return [*found, Sabotage("robot held by the world", "02", held, (hold, "physics:body0"))]


SIDEWAYS = Gf.Quatf(0.70710678, 0.70710678, 0, 0)
BODY_SWITCH = "physics:rigidBodyEnabled"


def turned_wheel(joint: str) -> Change:
    """Turn the frame of a wheel joint on its wheel, beside what it is turned by already."""

    def change(stage: Usd.Stage) -> None:
        attribute = stage.GetPrimAtPath(joint).GetAttribute("physics:localRot1")
        attribute.Set((attribute.Get() or Gf.Quatf(1)) * SIDEWAYS)

    return change


_GRAVITY = ("/physicsScene", "physics:gravityMagnitude")
_PULL = ("/physicsScene", "physics:gravityDirection")


LIGHTS = ("/Environment/Lights/Sun", "/Environment/Lights/Sky")


def _world() -> list[Sabotage]:
    flag = "physics:collisionEnabled"
    lights = several(*map(remove, LIGHTS))
    return [
        Sabotage("no ground", "00", remove("/Environment/GroundPlane"), ("/Environment", None)),
        Sabotage("ground off", "00", deactivate(FLOOR), (FLOOR, None)),
        Sabotage("ground soft", "00", without_api(FLOOR, "PhysicsCollisionAPI"), (FLOOR, flag)),
        Sabotage(
            "ground switched off",
            "05",
            switch(FLOOR, flag),
            (FLOOR, flag),
        ),
        Sabotage("ground and tyres slick", "02", slick(*MATERIALS), (MATERIALS[1], SLIDING)),
        Sabotage("ground low", "00", _lower_floor, (ROBOT, None)),
        Sabotage("environment off", "00", deactivate("/Environment"), ("/Environment", None)),
        Sabotage("no light", "04", lights, ("/Environment", None)),
        Sabotage("lights off", "04", deactivate("/Environment/Lights"), ("/Environment", None)),
        Sabotage(
            "lights invisible",
            "04",
            several(*(author(light, "visibility", "Token", "invisible") for light in LIGHTS)),
            (LIGHTS[0], "visibility"),
        ),
        Sabotage(
            "lights without intensity",
            "04",
            several(*(author(light, "inputs:intensity", "Float", 0.0) for light in LIGHTS)),
            (LIGHTS[0], "inputs:intensity"),
        ),
        # UsdLuxLightAPI: emission is intensity * 2^exposure * color.
        Sabotage(
            "lights underexposed",
            "04",
            several(*(author(light, "inputs:exposure", "Float", -40.0) for light in LIGHTS)),
            (LIGHTS[0], "inputs:exposure"),
        ),
        Sabotage(
            "lights of black",
            "04",
            several(*(author(light, "inputs:color", "Color3f", Gf.Vec3f(0)) for light in LIGHTS)),
            (LIGHTS[0], "inputs:color"),
        ),
        # UsdLuxLightAPI: multipliers of what materials scatter and reflect.
        Sabotage(
            "lights that no material shows",
            "04",
            several(
                *(
                    author(light, f"inputs:{share}", "Float", 0.0)
                    for light in LIGHTS
                    for share in ("diffuse", "specular")
                )
            ),
            (LIGHTS[0], "inputs:diffuse"),
        ),
        Sabotage("no physics", "01", remove("/physicsScene"), ("/physicsScene", None)),
        Sabotage("physics off", "01", deactivate("/physicsScene"), ("/physicsScene", None)),
        Sabotage(
            "weightless",
            "01",
            put(*_GRAVITY, 0.0),
            _GRAVITY,
        ),
        Sabotage("gravity in centimetres", "01", put(*_GRAVITY, 981.0), _GRAVITY),
        Sabotage("gravity without end", "01", put(*_GRAVITY, math.inf), _GRAVITY),
        Sabotage("gravity of a number that is none", "01", put(*_GRAVITY, math.nan), _GRAVITY),
        Sabotage(
            "links without weight", "01", _weightless_links, (f"{ROBOT}/{LINKS[0]}", _NO_WEIGHT)
        ),
        Sabotage("robot in a scene without gravity", "01", _other_owner, ("/other", _GRAVITY[1])),
        Sabotage("ground to the side", "00", put(FLOOR, "axis", "X"), (FLOOR, "axis")),
        Sabotage("ground upside down", "00", turned_floor(180), (FLOOR, _TURNED)),
        Sabotage("ground on a slope", "00", turned_floor(6), (FLOOR, _TURNED)),
        Sabotage("gravity up", "02", put(*_PULL, Gf.Vec3f(0, 0, 1)), _PULL),
        Sabotage("gravity tilted", "02", put(*_PULL, Gf.Vec3f(0.2, 0, -1)), _PULL),
        Sabotage("wheel sunk", "00", _sink_wheel, (f"{ROBOT}/wheel_left_link", None)),
    ]


_NO_WEIGHT, _TURNED = "physxRigidBody:disableGravity", "xformOp:rotateXYZ"


def _weightless_links(stage: Usd.Stage) -> None:
    for link in LINKS:
        prim = stage.GetPrimAtPath(f"{ROBOT}/{link}")
        prim.CreateAttribute(_NO_WEIGHT, Sdf.ValueTypeNames.Bool).Set(True)  # noqa: FBT003


def _other_owner(stage: Usd.Stage) -> None:
    several(define("/other", "PhysicsScene"), put("/other", _GRAVITY[1], 0.0))(stage)
    for link in LINKS:
        aim(f"{ROBOT}/{link}", "physics:simulationOwner", "/other")(stage)


def turned_floor(degrees: float) -> Change:
    return lambda stage: void(
        UsdGeom.Xformable(stage.GetPrimAtPath(FLOOR)).AddRotateXYZOp().Set(Gf.Vec3f(degrees, 0, 0))
    )


def _lower_floor(stage: Usd.Stage) -> None:
    plane = UsdGeom.Xformable(stage.GetPrimAtPath(FLOOR))
    plane.AddTranslateOp().Set(Gf.Vec3d(0, 0, -0.1))


def _sink_wheel(stage: Usd.Stage) -> None:
    put(f"{ROBOT}/wheel_left_link", TRANSLATE, Gf.Vec3d(0, 0.08, 0.0))(stage)


def scene_sabotage() -> list[Sabotage]:
    """Return every fault that is tried, each at a checkpoint that asks for the item."""
    parts = (
        _prims,
        _units,
        _poses,
        _bodies,
        _articulation,
        _wheels,
        _loose,
        _world,
    )
    return [*(each for part in parts for each in part()), *sensor_sabotage()]
