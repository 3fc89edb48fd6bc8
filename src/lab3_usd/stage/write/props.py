"""Makes the things of a scene that a lab describes, and changes them at later checkpoints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from pxr import Gf, Sdf, Usd, UsdGeom

from lab3_usd.spec.lab import SCENE, Checkpoint, Lab
from lab3_usd.spec.load.starter import AttributeSpec, PrimSpec
from lab3_usd.spec.props import PlaceSpec, PropSpec
from lab3_usd.stage.write.starter import connect_prim, write_prim

_BINDING, _BINDING_API = "material:binding", "MaterialBindingAPI"
_OPERATION, _TRANSLATE = "xformOp:", "xformOp:translate"


def author_props(
    layer: Sdf.Layer, lab: Lab, checkpoint: Checkpoint, before: Mapping[str, PropSpec]
) -> None:
    """Make the things that come with a checkpoint, and those that differ from `before`.

    Raises:
        SpecError: USD does not take a value.
    """
    props = lab.props_at(checkpoint).items()
    new = {
        name: prop
        for name, prop in props
        if prop.since == checkpoint.id or before.get(name, prop) != prop
    }
    if not new:
        return
    stage = Usd.Stage.Open(layer)
    metres = lab.scene.stage.meters_per_unit
    made = [
        (prop, prim)
        for name, prop in new.items()
        for prim in _written(prop, stage, metres, f"{SCENE}: props: {name}: set")
    ]
    for prop, prim in made:
        if prop.asset and prop.since == checkpoint.id:
            prim.GetReferences().AddReference(prop.asset)
        for name, variant in prop.variants.items():
            prim.GetVariantSets().AddVariantSet(name).SetVariantSelection(variant)
        connect_prim(stage, PrimSpec(str(prim.GetPath()), targets=tuple(prop.targets.items())))
        if prop.place is not None:
            _place(prim, prop.place, metres)


def _written(prop: PropSpec, stage: Usd.Stage, metres: float, site: str) -> Iterator[Usd.Prim]:
    """Write what the things are, and yield them."""
    attributes = tuple(
        AttributeSpec(name, value, prop.types.get(name))
        for name, value in prop.plain_values.items()
    )
    binds = any(name.startswith(_BINDING) for name in prop.targets)
    for path in prop.places([str(prim.GetPath()) for prim in stage.TraverseAll()]):
        there = stage.GetPrimAtPath(path)
        spec = PrimSpec(
            path,
            prop.type or (there.GetTypeName() if there else "Xform"),
            apis=(*prop.apis, _BINDING_API) if binds else prop.apis,
            attributes=attributes,
            targets=tuple(prop.targets.items()),
            site=site,
        )
        write_prim(stage, spec, metres)
        prim = stage.GetPrimAtPath(path)
        _order_operations(prim, (each.name for each in attributes))
        yield prim


def _order_operations(prim: Usd.Prim, names: Iterable[str]) -> None:
    """Let the operations of a pose take effect, those that have no order yet after the others."""
    posed = [name for name in names if name.startswith(_OPERATION)]
    if posed:
        order = UsdGeom.Xformable(prim).GetXformOpOrderAttr()
        before = list(order.Get() or ())
        order.Set(before + [name for name in posed if name not in before])


def _place(prim: Usd.Prim, place: PlaceSpec, metres: float) -> None:
    """Move a prim to a place in the world, by the outermost operation of its pose."""
    cache = UsdGeom.XformCache()
    wanted = cache.GetLocalToWorldTransform(prim).ExtractTranslation()
    for axis, value in place.axes.items():
        wanted[axis] = value / metres
    to_world = cache.GetParentToWorldTransform(prim)
    was = to_world.GetInverse().Transform(cache.GetLocalToWorldTransform(prim).ExtractTranslation())
    moved = to_world.GetInverse().Transform(wanted) - was
    xform = UsdGeom.Xformable(prim)
    rest = [each for each in xform.GetOrderedXformOps() if each.GetOpName() != _TRANSLATE]
    operation = next(
        (each for each in xform.GetOrderedXformOps() if each.GetOpName() == _TRANSLATE), None
    )
    if operation is None:
        operation = xform.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
        xform.SetXformOpOrder([operation, *rest])
        operation.Set(Gf.Vec3d(moved))
    else:
        value = operation.Get()
        operation.Set(type(value)(Gf.Vec3d(value) + moved))
