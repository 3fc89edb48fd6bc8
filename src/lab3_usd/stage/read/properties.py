"""Reads the properties of composed prims as plain values, as the timeline starts with them.

Isaac Sim plays a stage from its first time code, and a time sample or spline overrides the default
value. So the values at that time are written into the session layer, where every query finds them.

When usd-core is first asked for a property that no layer holds, or for its type, it parses all of
its schemas, once per process. That takes as long as checking a stage. So the layers are asked which
properties they hold, and the stage only for values, sources and targets that exist.

Methods that run for every prim or attribute are called on the class (`Usd.Prim.GetPath(prim)`). A
call on the object first runs a validity check, which takes longer than most answers. So the prim
must be valid: without that check, an invalid prim ends the process.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import astuple
from pxr import Gf, Sdf, Tf, Usd

from lab3_usd.isaac.node_types import INPUT, OUTPUT
from lab3_usd.isaac.values import Value
from lab3_usd.model.compounds import Compounds, compounds_of
from lab3_usd.model.stage import AnimatedAttribute, same_value
from lab3_usd.stage.read.crate import CRATE

CENTIMETRES = 0.01  # per unit, where a stage does not say
LONGEST = 4096  # elements; longer arrays (points, faces) are nothing a rule asks about
MOST_EMITTERS = 1_000_000  # elements of the lists of a sensor
# Sets of types, as to ask whether a value is an instance of one takes many times as long.
_NUMBERS = {int, float}
_PLAIN = {type(None), bool, int, float, str}
_VECTORS = {
    *(Gf.Vec2d, Gf.Vec2f, Gf.Vec2h, Gf.Vec2i),
    *(Gf.Vec3d, Gf.Vec3f, Gf.Vec3h, Gf.Vec3i),
    *(Gf.Vec4d, Gf.Vec4f, Gf.Vec4h, Gf.Vec4i),
}
_HALF = "e"
_QUATERNIONS = {Gf.Quatd, Gf.Quatf, Gf.Quath}
_KEY = "changes after the start"  # of the session layer's custom data
_NEAR_ZERO = 1e-6
RELATIONSHIP = "rel"
_WITH_VARIABLES = {Sdf.AssetPath, Sdf.AssetPathArray}  # the stage makes a path of it
_CRATE_WITH_SPLINES = bytes((0, 12, 0))  # the version, which follows the name of the format
_SPLINE, _SPLINE_TEXT = "spline", b".spline"
_VALUE, _SOURCES, _TARGETS = "default", "connectionPaths", "targetPaths"


def plain_value(value: Any, longest: int = LONGEST) -> Value | None:
    """Return the value without Gf, Sdf and Vt; None for none, or an array that is not needed.

    Quaternions come in OGN's order x, y, z, w. Longer arrays than `longest` are not needed.
    """
    kind = type(value)
    if kind in _PLAIN:
        result: Value | None = value
        return result
    if kind in _QUATERNIONS:
        x, y, z = elements(value.imaginary)
        return (x, y, z, float(value.real))
    if kind is Sdf.AssetPath:
        return str(value.path)
    return tuple(elements(value)) if kind in _VECTORS else _items(value, longest)


def _items(value: Any, longest: int) -> Value | None:
    try:
        count = len(value)
    except TypeError:
        return None
    if count > longest:
        return None
    # Iterating over a Vt or Gf type is five to twenty times as slow as asking for its elements.
    items = [plain_value(value[index]) for index in range(count)]
    return tuple([item for item in items if item is not None])  # which is quicker of a list


def stage_number(value: Any, default: float) -> float:
    """Return a number that a stage says of itself, else the default.

    A damaged file may say anything; to usd-core that is nothing.
    """
    return float(value) if type(value) in _NUMBERS else default


def elements(vector: Any) -> list[Any]:
    """Return the numbers of a vector of Gf's.

    Raises:
        TypeError: the value is none.
    """
    view = memoryview(vector)
    if view.format == _HALF:  # which Python reads no buffer of
        return [vector[index] for index in range(len(vector))]
    return view.tolist()


def hold_start_values(stage: Usd.Stage) -> None:
    """Hold every attribute with time samples or a spline at its start value.

    A stage is held once, as it was when that was asked first. Prims of instances stay as they are,
    for no layer can say anything else of one instance.
    """
    session = stage.GetSessionLayer()
    if _KEY in session.customLayerData:
        return
    layers = stage.GetUsedLayers()
    has_samples = any(layer.ListAllTimeSamples() for layer in layers)
    if not (has_samples or any(map(_may_have_splines, layers))):
        return
    start = stage.GetStartTimeCode()
    sampled = [
        attribute
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate)
        for attribute in Usd.Prim.GetAuthoredAttributes(prim)
        if Usd.Attribute.HasSpline(attribute)
        or (has_samples and Usd.Attribute.GetNumTimeSamples(attribute))
    ]
    if not sampled:
        return
    held = [(attribute, attribute.Get(start)) for attribute in sampled]
    changes = [change for attribute, value in held for change in _changes(attribute, value, start)]
    with Sdf.ChangeBlock():
        for attribute, value in held:
            prim = Sdf.CreatePrimInLayer(session, attribute.GetPrim().GetPath())
            spec = Sdf.AttributeSpec(prim, attribute.GetName(), attribute.GetTypeName())
            spec.default = Sdf.ValueBlock() if value is None else value
        import json

        session.customLayerData = {_KEY: json.dumps([astuple(change) for change in changes])}


def _may_have_splines(layer: Sdf.Layer) -> bool:
    """Whether attributes of a layer may have splines, which usd-core lists nowhere.

    A binary file with splines is of a format that has them. To look at every property takes a tenth
    of the time of judging a stage.
    """
    if layer.empty:
        return False
    try:
        with Path(layer.realPath).open("rb") as file:
            data = file.read()
            if data.startswith(CRATE):
                return data[len(CRATE) : len(CRATE) + 3] >= _CRATE_WITH_SPLINES
            return data.rfind(_SPLINE_TEXT) >= 0  # which takes half the time of `in`
    except (OSError, ValueError):  # in memory, or in a package
        return True


def release_start_values(stage: Usd.Stage) -> None:
    """Release every held attribute."""
    if _KEY in stage.GetSessionLayer().customLayerData:
        stage.GetSessionLayer().Clear()


def changes_after_start(stage: Usd.Stage) -> tuple[AnimatedAttribute, ...]:
    """Return the attributes of a held stage that change after the start."""
    written = stage.GetSessionLayer().customLayerData.get(_KEY)
    if written is None:
        return ()
    import json

    return tuple(AnimatedAttribute(*change) for change in json.loads(written))


def _changes(attribute: Usd.Attribute, first: Any, start: float) -> Iterator[AnimatedAttribute]:
    """Yield the first sample or knot after the start that is not as the value there."""
    end = attribute.GetStage().GetEndTimeCode()  # which a curve may reach beyond its last knot
    for time in attribute.GetTimeSamples() or (*attribute.GetSpline().GetKnots(), end):
        then = attribute.Get(time) if time > start else first
        if then == first:
            continue
        before = plain_value(first)
        if before is None or not same_value(before, plain_value(then), near_zero=_NEAR_ZERO):
            prim, name = str(attribute.GetPrim().GetPath()), str(attribute.GetName())
            yield AnimatedAttribute(prim, name, time, _text(first), _text(then))
            return


def _text(value: Any) -> str:
    plain = plain_value(value)
    return "another value" if plain is None else str(plain)


def prim_at(stage: Usd.Stage, path: str) -> Usd.Prim:
    """Return the prim at a path that some prim has, an invalid one where this stage has none."""
    return stage.GetPrimAtPath(_path_of(path))


@lru_cache(maxsize=4096)
def _path_of(path: str) -> Sdf.Path:
    """Return the path of a prim, which usd-core takes longer to make of text than to follow."""
    return Sdf.Path(path)


def authored_data(prim: Usd.Prim, name: str) -> Any:
    """Return the value that a layer gives to one attribute of a prim, None where none does."""
    attribute = Usd.Prim.GetAttribute(prim, name)
    if not Usd.Attribute.HasAuthoredMetadata(attribute, _VALUE):
        return None
    return Usd.Attribute.Get(attribute)


def targets_of(relationship: Usd.Relationship) -> list[Sdf.Path]:
    """Return where a relationship leads: nowhere if it is none, or if a layer has an attribute.

    Whatever layers say, what a schema calls a relationship is one; usd-core then fails to compose.

    Raises:
        Tf.ErrorException: the file is damaged there.
    """
    if not relationship:
        return []
    try:
        targets: list[Sdf.Path] = Usd.Relationship.GetTargets(relationship)
    except Tf.ErrorException:
        if all(type(spec) is Sdf.RelationshipSpec for spec in relationship.GetPropertyStack()):
            raise
        return []
    return targets


class AuthoredProperty(Struct, frozen=True, eq=False, gc=False):
    """A property of a prim as its layers have it, the strongest first; without any, it is empty.

    `alone` is that of the only layer, where it is an attribute: most are, and need no composition.
    """

    owner: AuthoredProperties
    name: str
    specs: list[Any]
    alone: Sdf.AttributeSpec | None

    @property
    def _is_relationship(self) -> bool:
        return bool(self.specs) and type(self.specs[0]) is Sdf.RelationshipSpec

    def _is_authored(self, field: str) -> bool:
        """Whether a layer gives this to an attribute; a stronger relationship hides it."""
        for spec in self.specs:
            if Sdf.Spec.HasInfo(spec, field):
                return not self._is_relationship
        return False

    @property
    def type(self) -> str:
        """The declared type of an attribute, `rel` for a relationship, '' for neither."""
        if self.alone is not None:
            return str(self.alone.typeName)
        if not self.specs:
            return ""
        return RELATIONSHIP if self._is_relationship else str(self.specs[0].typeName)

    def value(self, longest: int = LONGEST) -> Value | None:
        """Return the value that a layer gives to an attribute, as `plain_value` does."""
        if self.alone is not None:
            raw = self.alone.default
            kind = type(raw)
            if kind in _PLAIN:
                result: Value | None = raw
                return result
            if kind not in _WITH_VARIABLES:
                return plain_value(raw, longest)
        if not self._is_authored(_VALUE):
            return None
        raw = Usd.Attribute.Get(Usd.Prim.GetAttribute(self.owner.prim, self.name))
        return plain_value(raw, longest)

    def sources(self) -> tuple[str, ...]:
        """Return the properties that an attribute is connected to."""
        if self.alone is not None:
            if not Sdf.Spec.HasInfo(self.alone, _SOURCES):
                return ()
            if self.owner.is_plain:
                return _paths(self.alone, _SOURCES)
        elif not self._is_authored(_SOURCES):
            return ()
        attribute = Usd.Prim.GetAttribute(self.owner.prim, self.name)
        return tuple(map(str, Usd.Attribute.GetConnections(attribute)))

    def targets(self) -> tuple[str, ...]:
        """Return the prims that a relationship leads to."""
        if not self._is_relationship:
            return ()
        if len(self.specs) == 1 and self.owner.is_plain:
            return _paths(self.specs[0], _TARGETS)
        relationship = Usd.Prim.GetRelationship(self.owner.prim, self.name)
        return tuple(map(str, Usd.Relationship.GetTargets(relationship)))

    def custom_data(self, *keys: str) -> Any:
        """Return what the strongest layer has under nested keys of the custom data."""
        for spec in self.specs:
            value = spec.GetInfo("customData")
            for key in keys:
                value = value.get(key) if isinstance(value, dict) else None
            if value is not None:
                return value
        return None


def _paths(spec: Sdf.PropertySpec, field: str) -> tuple[str, ...]:
    """Return the paths that the only layer of a property lists, which needs no composition."""
    paths = Sdf.Spec.GetInfo(spec, field)
    return tuple(map(str, paths.GetAppliedItems())) if paths else ()


class AuthoredProperties:
    """The properties of a prim that a layer holds."""

    __slots__ = ("_index", "_is_plain", "_names", "_stack", "prim")

    def __init__(self, prim: Usd.Prim) -> None:
        """Look at the layers that say something of a prim."""
        self.prim = prim
        self._stack = Usd.Prim.GetPrimStack(prim)
        self._index = Usd.Prim.GetPrimIndex(prim)
        self._names: list[str] | None = None
        self._is_plain: bool | None = None

    @property
    def is_plain(self) -> bool:
        """Whether no composition arc brings anything to the prim."""
        if self._is_plain is None:
            self._is_plain = not self._index.rootNode.children
        return self._is_plain

    def names(self) -> list[str]:
        """Return their names, sorted.

        Raises:
            Tf.ErrorException: one has no name, as in a binary file with flipped bits.
        """
        if self._names is None:
            self._names = sorted(self._index.ComputePrimPropertyNames())
            if self._names and not self._names[0]:
                Usd.Prim.GetAuthoredProperties(self.prim)  # tells of the damage
        return self._names

    def __getitem__(self, name: str) -> AuthoredProperty:
        """Return the property of this name, also one that a damaged file does not list."""
        path, specs = _path_on_prim(name), []
        for prim in self._stack if path else ():
            spec = Sdf.PrimSpec.GetPropertyAtPath(prim, path)
            if spec is not None:
                specs.append(spec)
        alone = specs[0] if len(specs) == 1 and type(specs[0]) is Sdf.AttributeSpec else None
        return AuthoredProperty(self, name, specs, alone)


@lru_cache(maxsize=4096)
def _path_on_prim(name: str) -> Sdf.Path | None:
    """Return the path of a property as seen from its prim, None where none may have the name."""
    return Sdf.Path.reflexiveRelativePath.AppendProperty(name) or None


def compounds_in(
    stage: Usd.Stage, graphs: Collection[str], types: Mapping[str, str], compound_type: str
) -> Compounds:
    """Return the compounds of a stage with these graphs and nodes, by path with their types."""
    inner, fed = compounds_of(graphs, types, compound_type), {}
    for path in inner:
        properties = AuthoredProperties(stage.GetPrimAtPath(path))
        for name in properties.names():
            if name.startswith((INPUT, OUTPUT)):
                fed[f"{path}.{name}"] = properties[name].sources()
    return Compounds(inner, fed)
