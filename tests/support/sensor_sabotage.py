"""One way to break each thing that the lab asks of the lidar and the camera."""

from __future__ import annotations

from pxr import Gf
from scene_changes import (
    CAMERA,
    LIDAR,
    ORIENT,
    ROBOT,
    SCALE,
    TICK,
    TRANSLATE,
    TURNS,
    Sabotage,
    clear,
    deactivate,
    define,
    detach,
    move_prim,
    put,
    remove,
    retype,
    turn,
    undefine,
    without_api,
)

CORE = "omni:sensor:Core:"
SCANLESS: dict[str, object] = {
    f"{CORE}patternFiringRateHz": 0,
    f"{CORE}nearRangeM": 120.0,
    f"{CORE}farRangeM": 0.0,
    f"{CORE}numberOfEmitters": 0,
    f"{CORE}emitterState:s001:azimuthDeg": [],
}


def _lidar() -> list[Sabotage]:
    elsewhere, renamed = "/World/Lidar2D", f"{ROBOT}/base_scan/Example_Rotary_2D"
    api = "OmniSensorGenericLidarCoreAPI"
    found = [
        Sabotage("no lidar", "03", remove(LIDAR), (LIDAR, None)),
        Sabotage("lidar off", "03", deactivate(LIDAR), (LIDAR, None)),
        Sabotage("lidar only over", "03", undefine(LIDAR), (LIDAR, None)),
        Sabotage("lidar a camera", "03", retype(LIDAR, "Camera"), (LIDAR, None)),
        Sabotage("lidar an Xform", "03", retype(LIDAR, "Xform"), (LIDAR, None)),
        Sabotage("lidar renamed", "03", move_prim(LIDAR, renamed), (renamed, None)),
        Sabotage("lidar elsewhere", "03", move_prim(LIDAR, elsewhere), (elsewhere, None)),
        Sabotage(
            "lidar moved", "05", put(LIDAR, TRANSLATE, Gf.Vec3d(0, 0, 0.05)), (LIDAR, TRANSLATE)
        ),
        Sabotage("lidar turned", "05", put(LIDAR, ORIENT, turn(5)), (LIDAR, ORIENT)),
        Sabotage("lidar scaled", "05", put(LIDAR, SCALE, Gf.Vec3d(1, 1, 2)), (LIDAR, SCALE)),
        Sabotage("lidar without schema", "05", without_api(LIDAR, api), (LIDAR, None)),
        Sabotage(
            "second lidar", "05", define("/World/Lidar_01", "OmniLidar"), ("/World/Lidar_01", None)
        ),
        Sabotage(
            "leftover of the menu",
            "03",
            define("/World/Example_Rotary_2D_01", "Xform"),
            ("/World/Example_Rotary_2D_01", None),
        ),
    ]
    for name, value in ((TICK, 20.0), (TURNS, 20), (TICK, 0.0), (TURNS, 0)):
        what = f"{name} {value:g}"
        found.append(Sabotage(what, "05", put(LIDAR, name, value), (LIDAR, name)))
    for name, nothing in SCANLESS.items():
        what = f"{name} {nothing}"
        found.append(Sabotage(what, "05", put(LIDAR, name, nothing), (LIDAR, name)))
    for name, metres in ((f"{CORE}farRangeM", 0.2), (f"{CORE}nearRangeM", 50.0)):
        blind = put(LIDAR, name, metres)
        found.append(
            Sabotage(f"{name} {metres:g}, within which is nothing", "05", blind, (LIDAR, name))
        )
    for path in (LIDAR, CAMERA):
        what = f"{path.rpartition('/')[2]} stays behind"
        found.append(Sabotage(what, "05", detach(path), (path, "xformOpOrder")))
    return found


def _camera() -> list[Sabotage]:
    elsewhere, renamed = "/World/Camera_1", f"{ROBOT}/base_footprint/Camera"
    typed, back = Gf.Quatd(0.5, 0.5, 0.5, -0.5), Gf.Quatd(0.5, 0.5, 0.5, 0.5)
    near, far = Gf.Vec2f(1, 100), Gf.Vec2f(0.01, 1e7)
    clip = "clippingRange"
    return [
        Sabotage("no camera", "04", remove(CAMERA), (CAMERA, None)),
        Sabotage("camera off", "04", deactivate(CAMERA), (CAMERA, None)),
        Sabotage("camera only over", "04", undefine(CAMERA), (CAMERA, None)),
        Sabotage("camera an Xform", "04", retype(CAMERA, "Xform"), (CAMERA, None)),
        Sabotage("camera renamed", "04", move_prim(CAMERA, renamed), (renamed, None)),
        Sabotage("camera elsewhere", "04", move_prim(CAMERA, elsewhere), (elsewhere, None)),
        Sabotage(
            "camera moved", "05", put(CAMERA, TRANSLATE, Gf.Vec3d(0, 0, 0.2)), (CAMERA, TRANSLATE)
        ),
        Sabotage("camera scaled", "05", put(CAMERA, SCALE, Gf.Vec3d(2, 2, 2)), (CAMERA, SCALE)),
        Sabotage("camera typed", "05", put(CAMERA, ORIENT, typed), (CAMERA, ORIENT)),
        Sabotage("camera backward", "05", put(CAMERA, ORIENT, back), (CAMERA, ORIENT)),
        Sabotage("camera level", "05", put(CAMERA, ORIENT, Gf.Quatd(1)), (CAMERA, ORIENT)),
        Sabotage("focal length", "05", put(CAMERA, "focalLength", 24.0), (CAMERA, "focalLength")),
        Sabotage("focal length unset", "05", clear(CAMERA, "focalLength"), (CAMERA, "focalLength")),
        Sabotage("near plane", "05", put(CAMERA, clip, near), (CAMERA, clip)),
        Sabotage("far plane", "05", put(CAMERA, clip, far), (CAMERA, clip)),
        Sabotage("clipping unset", "05", clear(CAMERA, clip), (CAMERA, clip)),
        Sabotage("camera rate", "05", put(CAMERA, TICK, 30.0), (CAMERA, TICK)),
    ]


def _too_early() -> list[Sabotage]:
    return [
        Sabotage(f"{path} in the starter", "00", define(path, kind), (path, None))
        for path, kind in (
            (LIDAR, "OmniLidar"),
            (CAMERA, "Camera"),
            ("/World/Example_Rotary", "OmniLidar"),
            ("/World/ActionGraph", "OmniGraph"),
            ("/World/MyGraph", "OmniGraph"),
            ("/World/ROS_Odometry", "Xform"),
        )
    ]


def sensor_sabotage() -> list[Sabotage]:
    """Return every fault of the sensors that is tried."""
    return [*_lidar(), *_camera(), *_too_early()]
