"""Writes the lidar and camera prims into a layer as Isaac Sim 6.0.1 saves them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pxr import Gf, Sdf

from lab3_usd.stage.author import define_prim, prepend_apis
from lab3_usd.stage.typed import usd_value, value_type

_DIGITS = 12  # cosines of right angles come out as 1e-17, which nobody would save


def author_sensor(layer: Sdf.Layer, spec: Mapping[str, Any], asset: str | None = None) -> None:
    """Define the sensor of `scene.yaml` with its pose and attributes.

    With `asset`, the prim references the vendor's file as the Create menu does, and only what
    the handout sets is authored over it; without, the prim describes itself.
    """
    prim = define_prim(layer, spec["path"], spec["type"])
    attributes = spec["attributes"]
    if asset is None:
        prepend_apis(prim, list(spec["apis"]))
    else:
        prim.referenceList.prependedItems.append(Sdf.Reference(asset))
        attributes = {name: entry for name, entry in attributes.items() if entry.get("required")}
    for name, entry in attributes.items():
        attribute = Sdf.AttributeSpec(prim, name, value_type(entry["type"]))
        attribute.default = usd_value(entry["value"], entry["type"])
    author_pose(prim, spec["pose"])


def author_pose(prim: Sdf.PrimSpec, pose: Mapping[str, Any]) -> None:
    """Write translate, orient and scale in double precision, as the Property panel does.

    `pose` holds metres, degrees about X, then Y, then Z, and factors.
    """
    rotation = Gf.Rotation(Gf.Vec3d.XAxis(), pose["rotate"][0])
    rotation *= Gf.Rotation(Gf.Vec3d.YAxis(), pose["rotate"][1])
    rotation *= Gf.Rotation(Gf.Vec3d.ZAxis(), pose["rotate"][2])
    ops = (
        ("xformOp:translate", "double3", Gf.Vec3d(*pose["translate"])),
        ("xformOp:orient", "quatd", _rounded(rotation.GetQuat())),
        ("xformOp:scale", "double3", Gf.Vec3d(*pose["scale"])),
    )
    for name, usd_type, value in ops:
        Sdf.AttributeSpec(prim, name, value_type(usd_type)).default = value
    order = Sdf.AttributeSpec(prim, "xformOpOrder", value_type("token[]"), Sdf.VariabilityUniform)
    order.default = [name for name, _, _ in ops]


def _rounded(quaternion: Gf.Quatd) -> Gf.Quatd:
    real, *imaginary = (
        round(part, _DIGITS) + 0.0 for part in (quaternion.GetReal(), *quaternion.GetImaginary())
    )
    return Gf.Quatd(real, *imaginary)
