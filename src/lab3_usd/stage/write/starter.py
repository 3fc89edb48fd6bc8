"""Writes the starter scene of a lab, and checks whether a starter is usable."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics

from lab3_usd.data import lab_folder
from lab3_usd.errors import SpecError, UsageError
from lab3_usd.files import make_folder, write_whole
from lab3_usd.isaac.values import same_numbers
from lab3_usd.model.prims import upwards
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.starter import AttributeSpec, PrimSpec, load_starter_spec
from lab3_usd.spec.scene import ArticulationSpec, RobotSpec, StageUnits
from lab3_usd.stage.read.assets import layer_files
from lab3_usd.stage.read.opening import quiet
from lab3_usd.stage.schema_names import (
    SHADER,
    known_type,
    likely_api,
    likely_property,
    likely_schema,
)
from lab3_usd.stage.write.graphs import author_pose, usd_value

_BODY = "PhysicsRigidBodyAPI"
_SHOWN = 3  # prims that have the name of a missing one
_SUFFIX = ".usda"


def starter_problems(lab: Lab, stage: Usd.Stage) -> list[str]:
    """Return the reasons why a starter is not usable, one line each.

    What hangs below a prim that is not there is left out.
    """
    reasons: list[str] = []
    missing: list[str] = []
    for path in dict.fromkeys(_needed(lab)):
        if not any(path.startswith(f"{above}/") for above in missing):
            reason = _why_missing(stage, path)
            if reason:
                missing.append(path)
                reasons.append(reason)
    added = [sensor.path for sensor in lab.sensors.values()]
    for path in (*added, *(graph.path for graph in lab.graphs.values())):
        prim = stage.GetPrimAtPath(path)
        if prim:
            state = "" if prim.IsDefined() else " (an over without a def)"
            state = state if prim.IsActive() else " (deactivated)"
            reasons.append(f"{path} is there already{state}; the starter must not hold it")
    unread = layer_files(stage).missing if reasons else ()
    reasons += (f"{path} cannot be read; what is missing may be in it" for path in unread)
    return [*_units(lab, stage), *reasons]


def _units(lab: Lab, stage: Usd.Stage) -> Iterator[str]:
    """Yield in which units or with which axis up the stage is not as every number of the lab."""
    spec = lab.scene.stage
    values: dict[str, str | float] = {
        "upAxis": spec.up_axis,
        "metersPerUnit": spec.meters_per_unit,
        "kilogramsPerUnit": spec.kilograms_per_unit,
    }
    for name, expected in values.items():
        # Kilograms have no default in usd-core.
        holder = stage.GetPseudoRoot() if name == "kilogramsPerUnit" else stage
        actual = holder.GetMetadata(name)
        if actual is None:
            continue
        margin = lab.scene.tolerance.margin("unit")
        is_near = isinstance(expected, float) and same_numbers([actual], [expected], margin)
        if actual != expected and not is_near:
            yield f"/ has {name} {_short(actual)}, expected {_short(expected)}; convert the starter"


def _short(value: float | str) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _needed(lab: Lab) -> Iterator[str]:
    """Yield the prims that the lab hangs something on, outermost first."""
    made = {sensor.path for sensor in lab.sensors.values()}
    robots = [robot.path for robot in lab.scene.robots]
    links = [path for robot in lab.scene.robots for path in robot.link_paths]
    if lab.scene.world.graph_parent is not None:
        yield lab.scene.world.graph_parent.path
    yield from robots
    for sensor in lab.sensors.values():
        yield sensor.path.rpartition("/")[0]
    for graph in lab.graphs.values():
        # What holds nothing but graphs is made with them.
        yield from [above for above in upwards(graph.path) if above in links][:1]
        targets = (path for node in graph.nodes.values() for t in node.targets for path in t.prims)
        yield from (path for path in targets if path not in made)


def _why_missing(stage: Usd.Stage, path: str) -> str:
    """Return why the lab can hang nothing on a prim; '' where it can."""
    prim = stage.GetPrimAtPath(path)
    if not prim:
        return (
            f"{path} is missing; the lab adds to it or points at it{_namesakes_text(stage, path)}"
        )
    if not prim.IsActive():
        return f"{path} is deactivated; activate it"
    if not prim.IsDefined():
        return f"{path} is only an over; what defines it cannot be found"
    if prim.IsInstanceProxy() or prim.IsInstance():
        return f"{path} is an instance, which can hold no graph; clear 'instanceable'"
    return ""


def _namesakes_text(stage: Usd.Stage, path: str) -> str:
    """Return where prims of a missing one's name do stand, bodies rather than what is only seen."""
    name = path.rpartition("/")[2]
    namesakes = [prim for prim in stage.Traverse() if prim.GetName() == name]
    bodies = [prim for prim in namesakes if _BODY in prim.GetPrimTypeInfo().GetAppliedAPISchemas()]
    paths = [str(prim.GetPath()) for prim in (bodies or namesakes)[:_SHOWN]]
    verb = "have" if len(paths) > 1 else "has"
    return f"; {' and '.join(paths)} {verb} that name" if paths else ""


def robots_articulated_at_root(lab: Lab, stage: Usd.Stage) -> list[RobotSpec]:
    """Return the robots whose root carries the articulation, and the handout's prim does not."""
    return [
        robot
        for robot in lab.scene.robots
        if robot.articulation.target
        and _is_articulated(robot.articulation, stage, robot.path)
        and not _is_articulated(robot.articulation, stage, robot.articulation.target)
    ]


def _is_articulated(spec: ArticulationSpec, stage: Usd.Stage, path: str) -> bool:
    prim = stage.GetPrimAtPath(path)
    if not prim or spec.api not in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
        return False
    switch = prim.GetAttribute(spec.switch)
    return not switch or switch.Get() is not False


def deviations(lab: Lab, stage: Usd.Stage) -> Iterator[tuple[str, str]]:
    """Yield each prim because of which the build deviates from the handout, and how."""
    for robot in robots_articulated_at_root(lab, stage):
        root, target = robot.path, robot.articulation.target
        message = f"the articulation root is on {root}; Isaac Sim finds no articulation at the"
        yield root, f"{message} handout's target {target}, so the graphs name {root} instead"


@quiet()
def build_starter(target: Path | str, *, force: bool = False) -> None:
    """Write the starter scene of the lab to `target` as text USD; its folder is made.

    The file is written whole or not at all, and is the same to the byte every time.

    Raises:
        UsageError: `target` does not end in `.usda`, exists already, or cannot be written.
        SpecError: the description of the starter is wrong.
    """
    target = Path(target)
    if target.suffix != _SUFFIX:
        raise UsageError(
            f"{target}: the starter is a text stage, give it a name that ends in {_SUFFIX}"
        )
    text: str = starter_layer(lab_folder()).ExportToString()
    make_folder(target.parent)
    write_whole(target, text.encode(), force=force)


def starter_layer(folder: Path) -> Sdf.Layer:
    """Make the starter that the files in `folder` describe, in memory.

    Raises:
        SpecError: a file is wrong, or asks for a prim, attribute or value that USD does not take.
    """
    spec = load_starter_spec(folder)
    layer = Sdf.Layer.CreateAnonymous(_SUFFIX)
    stage = Usd.Stage.Open(layer)
    set_units(stage, spec.units)
    layer.documentation = spec.doc
    layer.defaultPrim = spec.default_prim
    for prim in spec.prims:
        write_prim(stage, prim, spec.units.meters_per_unit)
    for prim in spec.prims:
        connect_prim(stage, prim)
    for prim in spec.prims:
        if prim.over:
            # Defining a shape has defined everything above it.
            stage.GetPrimAtPath(prim.path).SetSpecifier(Sdf.SpecifierOver)
    for prim in spec.prims:
        if prim.reference:
            stage.GetPrimAtPath(prim.path).GetReferences().AddInternalReference(prim.reference)
    return layer


def set_units(stage: Usd.Stage, units: StageUnits) -> None:
    """Write the units of a stage, and which axis is up."""
    UsdGeom.SetStageUpAxis(stage, units.up_axis)
    UsdGeom.SetStageMetersPerUnit(stage, units.meters_per_unit)
    UsdPhysics.SetStageKilogramsPerUnit(stage, units.kilograms_per_unit)


def write_prim(stage: Usd.Stage, spec: PrimSpec, metres: float) -> None:
    """Write a prim of a stage whose unit has a length of `metres`.

    Raises:
        SpecError: USD does not take a value.
    """
    prim = stage.OverridePrim(spec.path) if spec.over else stage.DefinePrim(spec.path, spec.type)
    if spec.doc:
        prim.SetDocumentation(spec.doc)
    for api in spec.apis:
        prim.AddAppliedSchema(api)
    if spec.pose is not None:
        author_pose(stage.GetRootLayer().GetPrimAtPath(spec.path), spec.pose, metres)
    for attribute in sorted(spec.attributes, key=lambda each: each.name != SHADER):
        _write_attribute(prim, attribute, spec.site)
    for name, paths in spec.targets:
        if not _are_properties(paths):
            targets = [Sdf.Path(path) for path in paths]
            prim.CreateRelationship(name, custom=False).SetTargets(targets)
    if prim.IsA(UsdGeom.Boundable):  # how far it reaches, which readers would have to work out
        boundable = UsdGeom.Boundable(prim)
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode.Default())
        if extent:
            boundable.CreateExtentAttr([corner + Gf.Vec3f(0.0) for corner in extent])


def _are_properties(paths: Iterable[str]) -> bool:
    return any("." in path for path in paths)


def connect_prim(stage: Usd.Stage, spec: PrimSpec) -> None:
    """Connect attributes of a prim to outputs, which are made where their prims lack them."""
    prim = stage.GetPrimAtPath(spec.path)
    for name, targets in ((n, paths) for n, paths in spec.targets if _are_properties(paths)):
        paths = [Sdf.Path(target) for target in targets]
        ends = {path: stage.GetPrimAtPath(path.GetPrimPath()) for path in paths}
        kinds = [
            known_type(prim, name),
            *(known_type(end, p.name) for p, end in ends.items() if end),
        ]
        kind = next(filter(None, kinds), Sdf.ValueTypeNames.Token)
        for path, end in ends.items():
            if end and not end.GetAttribute(path.name):
                own = known_type(end, path.name) or kind
                end.CreateAttribute(path.name, own, custom=False)
        attribute = prim.GetAttribute(name) or prim.CreateAttribute(name, kind, custom=False)
        attribute.SetConnections(paths)


def _write_attribute(prim: Usd.Prim, spec: AttributeSpec, place: str) -> None:
    site = f"{place}: '{spec.name}'"
    declared = known_type(prim, spec.name)
    if spec.type is None:
        attribute = prim.GetAttribute(spec.name)
        if declared and not attribute:
            attribute = prim.CreateAttribute(spec.name, declared, custom=False)
    else:  # of a schema that only Isaac Sim has, worded as in a text layer
        kind = spec.type.removeprefix("uniform ")
        variability = Sdf.VariabilityVarying if kind == spec.type else Sdf.VariabilityUniform
        value_type = Sdf.ValueTypeNames.Find(kind)
        if not value_type:
            raise SpecError(f"{site}: '{kind}' is not a type of USD")
        if declared and declared.cppTypeName != value_type.cppTypeName:
            raise SpecError(f"{site} has the type {declared}, not {kind}; leave the type out")
        attribute = prim.CreateAttribute(spec.name, value_type, False, variability)  # noqa: FBT003 - no keyword
    if not attribute:
        raise SpecError(f"{site} is not known to USD here, {_advice(prim, spec.name)}")

    try:
        attribute.Set(usd_value(spec.value, attribute.GetTypeName()))
    except (Tf.ErrorException, TypeError) as error:
        raise SpecError(
            f"{site} is {spec.value!r}, expected a {attribute.GetTypeName()}"
        ) from error


def _advice(prim: Usd.Prim, name: str) -> str:
    """Say what an attribute, or the type of its prim, was likely meant to be."""
    meant = likely_schema(str(prim.GetTypeName()), ())
    if meant is not None:
        return f"nor is the type '{prim.GetTypeName()}'; did you mean {meant}?"
    for api in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
        applied = likely_api(api)
        if applied is not None:
            return f"nor is the schema '{api}'; did you mean {applied}?"
    alike = likely_property(prim, name)
    return f"did you mean {alike}?" if alike else "give its type as well"
