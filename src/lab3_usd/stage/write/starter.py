"""Writes the starter scene of a lab: the stage that a student is given before the first graph."""

from __future__ import annotations

from pathlib import Path

from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics

from lab3_usd.data import lab_folder
from lab3_usd.errors import SpecError, UsageError
from lab3_usd.files import write_whole
from lab3_usd.spec.files import STARTER
from lab3_usd.spec.load.starter import (
    AttributeSpec,
    PoseSpec,
    PrimSpec,
    load_starter_spec,
)
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.write.author import quaternion, usd_value

_SUFFIX = ".usda"


@quiet()
def build_starter(target: Path | str, *, force: bool = False) -> None:
    """Write the starter scene of the lab to `target` as text USD.

    The file is written whole or not at all, and is the same to the byte every time.

    Raises:
        UsageError: `target` does not end in `.usda`, exists already, or cannot be written.
        SpecError: the description of the starter is wrong.
    """
    target = Path(target)
    if target.suffix != _SUFFIX:
        message = f"{target}: the starter is a text stage, give it a name that ends in {_SUFFIX}"
        raise UsageError(message)
    text: str = starter_layer(lab_folder()).ExportToString()
    write_whole(target, text.encode(), force=force)


def starter_layer(folder: Path) -> Sdf.Layer:
    """Make the starter that the files in `folder` describe, in memory.

    Raises:
        SpecError: a file is wrong, or asks for a prim, attribute or value that USD does not take.
    """
    spec = load_starter_spec(folder)
    layer = Sdf.Layer.CreateAnonymous(_SUFFIX)
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, spec.units.up_axis)
    UsdGeom.SetStageMetersPerUnit(stage, spec.units.meters_per_unit)
    UsdPhysics.SetStageKilogramsPerUnit(stage, spec.units.kilograms_per_unit)
    layer.documentation = spec.doc
    layer.defaultPrim = spec.default_prim
    for prim_spec in spec.prims:
        _write_prim(stage, prim_spec, spec.units.meters_per_unit)
    _write_library(stage, spec.prims)
    return layer


def _write_prim(stage: Usd.Stage, spec: PrimSpec, metres: float) -> None:
    prim = stage.OverridePrim(spec.path) if spec.over else stage.DefinePrim(spec.path, spec.type)
    if spec.doc:
        prim.SetDocumentation(spec.doc)
    for api in spec.apis:
        prim.AddAppliedSchema(api)
    if spec.pose is not None:
        _write_pose(prim, spec.pose, metres)
    for attribute in spec.attributes:
        _write_attribute(prim, attribute)
    for name, paths in spec.targets:
        prim.CreateRelationship(name, custom=False).SetTargets([Sdf.Path(path) for path in paths])
    _write_extent(prim)


def _write_library(stage: Usd.Stage, prims: tuple[PrimSpec, ...]) -> None:
    """Turn library prims back into overs, then let the links refer to them."""
    for spec in prims:
        if spec.over:
            # Defining a shape has defined everything above it.
            stage.GetPrimAtPath(spec.path).SetSpecifier(Sdf.SpecifierOver)
    for spec in prims:
        if spec.reference:
            stage.GetPrimAtPath(spec.path).GetReferences().AddInternalReference(spec.reference)


def _write_pose(prim: Usd.Prim, pose: PoseSpec, metres: float) -> None:
    """Write the three operations that Isaac Sim's own editor writes, in its order.

    `metres` is the length of one unit of the stage.
    """
    xform = UsdGeom.Xformable(prim)
    double = UsdGeom.XformOp.PrecisionDouble
    xform.AddTranslateOp(double).Set(Gf.Vec3d(pose.translate) / metres)
    xform.AddOrientOp(double).Set(quaternion(pose.rotate))
    xform.AddScaleOp(double).Set(Gf.Vec3d(pose.scale))


def _write_attribute(prim: Usd.Prim, spec: AttributeSpec) -> None:
    where = f"{STARTER}: {prim.GetPath()}: {spec.name}"
    attribute = prim.GetAttribute(spec.name)
    if spec.type is not None:
        attribute = _declare(prim, spec.name, spec.type)
    if not attribute:
        message = f"{where} is not known to USD here, give its type as well"
        raise SpecError(message)
    try:
        attribute.Set(usd_value(spec.value, attribute.GetTypeName()))
    except (Tf.ErrorException, TypeError) as error:
        message = f"{where} is {spec.value!r}, expected a {attribute.GetTypeName()}"
        raise SpecError(message) from error


def _declare(prim: Usd.Prim, name: str, declared: str) -> Usd.Attribute:
    """Declare an attribute of a schema that only Isaac Sim has, as a text layer words its type."""
    kind = declared.removeprefix("uniform ")
    variability = Sdf.VariabilityVarying if kind == declared else Sdf.VariabilityUniform
    value_type = Sdf.ValueTypeNames.Find(kind)
    if not value_type:
        message = f"{STARTER}: {prim.GetPath()}: {name}: '{kind}' is no type of USD"
        raise SpecError(message)
    return prim.CreateAttribute(name, value_type, False, variability)  # noqa: FBT003 - no keyword


def _write_extent(prim: Usd.Prim) -> None:
    """Write how far a shape reaches, which readers would else have to work out."""
    if prim.IsA(UsdGeom.Boundable):
        boundable = UsdGeom.Boundable(prim)
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode.Default())
        if extent:
            boundable.CreateExtentAttr([corner + Gf.Vec3f(0.0) for corner in extent])
