"""The prims of an open stage, each read when a rule asks for it."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec import Struct, field
from pxr import Sdf, Usd

from lab3_usd.isaac.graph_form import GraphForm
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.values import Value
from lab3_usd.model.physics import BODY_API
from lab3_usd.model.prims import NameFilter, Prim, Prims, name_matches, of_any_name
from lab3_usd.stage.read.assets import EVERYTHING, IS_PRESENT, is_in_scene
from lab3_usd.stage.read.opening import open_stage, quiet, stage_errors
from lab3_usd.stage.read.prim_transforms import TransformCache, is_placeless
from lab3_usd.stage.read.properties import MOST_EMITTERS, AuthoredProperties, plain_value, prim_at

Authored = dict[str, tuple[str, Value]]  # type and value by name

# What rules ask of prims outside the graphs; everything else on a stage is none of their business.
_ATTRIBUTES = re.compile(
    r"^(physics|drive|isaac|isaacmecanumwheel|omni|physx\w*|visibility|focalLength|clippingRange|"
    r"(horizontal|vertical)Aperture(Offset)?|exposure|projection|cameraProjectionType|"
    r"clippingPlanes|inputs:(intensity|exposure|color|diffuse|specular)|"
    r"kind|node|axis|purpose|xformOpOrder|omniGraphs|material)(:|$)"
)
# Prims whose place matters even if they are no rigid bodies, beside the lab's sensors.
_PLACED = ("Xform", "Camera", "Plane", "Cylinder", "Capsule", "")
_PLACE, _ASSETS = ("local", "world"), "assets"
_PROTOTYPE = "/__Prototype_"
# Paths that need no look by usd-core to be known as those of prims.
_PLAIN_PATH = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


@lru_cache(maxsize=4096)
def _is_asked_for(name: str) -> bool:
    return _ATTRIBUTES.match(name) is not None


def schemas(prim: Usd.Prim) -> tuple[str, ...]:
    """Return every schema applied to a prim, known to usd-core or not."""
    return tuple(Usd.Prim.GetPrimTypeInfo(prim).GetAppliedAPISchemas())


class PrimReader:
    """Reads what a prim is and holds; below the `hidden` prims assets are missing.

    It keeps the stage open, and knows none of the prims that it has read: who lets go of those
    lets go of the stage.
    """

    def __init__(
        self, stage: Usd.Stage, name: str, hidden: tuple[str, ...], platform: Platform
    ) -> None:
        """Read from `stage`, which goes by `name` where it turns out to be damaged.

        Prims of the types that the platform says are placed, and have the attributes that it names.
        """
        self.stage = stage
        self.transforms = TransformCache(hidden)
        self.hidden = hidden
        self.name = name
        self.placed = {*_PLACED, *platform.placed}
        self.sensor_attributes = platform.attributes

    def read(self, prim: Prim, name: str) -> None:
        """Set the field of a prim, and those that are read with it.

        Raises:
            StageError: the file is damaged there.
        """
        with stage_errors(self.name):
            source = prim_at(self.stage, prim.path)
            if name == _ASSETS:
                prim.assets = tuple(dict.fromkeys(_referred(source)))
            elif name not in _PLACE:
                self._read_values(source, prim)
            elif source and (prim.type in self.placed or BODY_API in prim.apis):
                prim.local, prim.world = self.transforms.of(source, prim.path)
            else:
                prim.local, prim.world = None, None

    def _read_values(self, source: Usd.Prim, prim: Prim) -> None:
        attributes: dict[str, Value] = {}
        relationships: dict[str, tuple[str, ...]] = {}
        properties = AuthoredProperties(source)
        for name in properties.names():
            if not (_is_asked_for(name) or name in self.sensor_attributes):
                continue
            authored = properties[name]
            value = authored.value(MOST_EMITTERS)
            if value is not None:
                attributes[name] = value
            targets = authored.targets() if value is None else ()
            if not targets and name in self.sensor_attributes:
                targets = authored.sources()
            if targets:
                relationships[name] = targets
        prim.attributes, prim.relationships = attributes, relationships


def _referred(prim: Usd.Prim) -> Iterator[str]:
    """Yield the files that references and payloads of a prim name, found or not."""
    for spec in prim.GetPrimStack():
        for key in ("references", "payload"):
            listed = spec.GetInfo(key)
            yield from (item.assetPath for item in listed.GetAppliedItems() if item.assetPath)


class PrimIndex(Struct, frozen=True):
    """The prims of a stage in the order of a traversal, each with its type and its schemas.

    Their numbers stand by type and schema.
    """

    prims: list[tuple[Usd.Prim, str, Sequence[str]]] = field(default_factory=list)
    by_type: defaultdict[str, list[int]] = field(default_factory=lambda: defaultdict(list))
    by_api: defaultdict[str, list[int]] = field(default_factory=lambda: defaultdict(list))

    def add(self, prim: Usd.Prim, type_name: str, apis: Sequence[str]) -> None:
        """Add the next prim."""
        number = len(self.prims)
        # Of most prims, the schemas are none: no list is kept for each.
        self.prims.append((prim, type_name, apis or ()))
        self.by_type[type_name].append(number)
        for api in apis:
            self.by_api[api].append(number)


class StagePrims(Prims):
    """The prims of an open stage that are no nodes, and that no application made for itself."""

    def __init__(self, reader: PrimReader, form: GraphForm, index: PrimIndex) -> None:
        """Take the index that one scan of the stage has made."""
        self._reader = reader
        self._read = reader.read
        self._form = form
        self._index = index
        self._by_name: defaultdict[str, list[int]] = defaultdict(list)
        self._known: dict[str, Prim] = {}
        self._answers: dict[tuple[int, NameFilter], list[Prim]] = {}  # by index and key

    def __getitem__(self, path: str) -> Prim:
        """Return the prim at a path, in the scene or not."""
        prim = self.get(path)
        if prim is None:
            raise KeyError(path)
        return prim

    def get(self, path: str, default: Prim | None = None) -> Prim | None:  # type: ignore[override]
        """Return the prim at a path, in the scene or not, else the default."""
        stored = self._known.get(path)
        if stored is not None:
            return stored
        with stage_errors(self._reader.name):
            prim = self._find(path)
            if not prim or Usd.Prim.IsPseudoRoot(prim):
                return default
            kind = Usd.Prim.GetTypeName(prim)
            return self._prim(prim, path, kind) if self._counts(kind, path) else default

    def __contains__(self, path: object) -> bool:
        """Whether there is a prim at a path."""
        return isinstance(path, str) and self.get(path) is not None

    def __iter__(self) -> Iterator[str]:
        """Iterate over the paths."""
        return (str(Usd.Prim.GetPath(prim)) for prim, _, _ in self._index.prims)

    def __len__(self) -> int:
        """Count the prims."""
        return len(self._index.prims)

    def of_type(self, name_filter: NameFilter) -> Sequence[Prim]:
        """Return the prims of the types asked for."""
        return self._chosen(self._index.by_type, name_filter)

    def with_api(self, name_filter: NameFilter) -> Sequence[Prim]:
        """Return the prims to which a schema asked for is applied."""
        return self._chosen(self._index.by_api, name_filter)

    def named(self, name_filter: NameFilter) -> Sequence[Prim]:
        """Return the prims whose own name is asked for."""
        if not self._by_name:
            with stage_errors(self._reader.name):
                for number, (prim, _, _) in enumerate(self._index.prims):
                    self._by_name[Usd.Prim.GetName(prim)].append(number)
        return self._chosen(self._by_name, name_filter)

    def below(
        self, top: str, asked: NameFilter = of_any_name, left_out: frozenset[str] = frozenset()
    ) -> Iterator[Prim]:
        """Yield those at and below a prim that are of the types asked for, and not `left_out`."""
        start = self._find(top) if left_out.isdisjoint(top.split("/")) else None
        with stage_errors(self._reader.name):
            prims: Any = iter(Usd.PrimRange(start, EVERYTHING)) if start else ()
            for prim in prims:
                if left_out and Usd.Prim.GetName(prim) in left_out:
                    prims.PruneChildren()
                    continue
                kind = Usd.Prim.GetTypeName(prim)
                if name_matches(kind, asked):
                    path = str(Usd.Prim.GetPath(prim))
                    if not Usd.Prim.IsPseudoRoot(prim) and self._counts(kind, path):
                        yield self._prim(prim, path, kind)

    def _find(self, path: str) -> Usd.Prim | None:
        """Return the prim at a path as the stage itself writes it; a file may say any text."""
        is_plain = _PLAIN_PATH.fullmatch(path) is not None
        if not is_plain and (path[:1] != "/" or not Sdf.Path.IsValidPathString(path)[0]):
            return None
        prim = self._reader.stage.GetPrimAtPath(path)
        is_at_path = prim and (is_plain or str(Usd.Prim.GetPath(prim)) == path)
        return prim if is_at_path and not path.startswith(_PROTOTYPE) else None

    def _counts(self, kind: str, path: str) -> bool:
        return kind != self._form.node_type and not self._form.ignores(path)

    def _prim(
        self, prim: Usd.Prim, path: str, kind: str, apis: Sequence[str] | None = None
    ) -> Prim:
        """Return the prim at a path, whose values and place are still to be read."""
        stored = self._known.get(path)
        if stored is None:
            is_present, hidden = IS_PRESENT(prim), self._reader.hidden
            stored = self._known[path] = Prim.unread(
                path,
                kind,
                schemas(prim) if apis is None else tuple(apis),
                self._read,
                active=is_present or prim.IsActive(),
                defined=is_present or is_in_scene(prim, hidden),
                placeless=is_placeless(kind, path, hidden),
            )
        return stored

    def _chosen(self, index: Mapping[str, list[int]], name_filter: NameFilter) -> Sequence[Prim]:
        """Return the prims of every key that is asked for, each once and as they are traversed."""
        prims = self._answers.get((id(index), name_filter))
        if prims is None:
            if isinstance(name_filter, str):
                numbers = index.get(name_filter, [])
            else:
                numbers = sorted({n for key in index if name_filter(key) for n in index[key]})
            with stage_errors(self._reader.name):
                found = (self._index.prims[number] for number in numbers)
                prims = [
                    self._prim(prim, str(Usd.Prim.GetPath(prim)), kind, apis)
                    for prim, kind, apis in found
                ]
            self._answers[id(index), name_filter] = prims
        return prims


@quiet()
def authored_attributes(path: Path, prims: Iterable[str]) -> dict[str, Authored]:
    """Return the types and values of the attributes that a stage writes at prims, by prim.

    Raises:
        StageError: the stage cannot be read.
    """
    with stage_errors(str(path)):
        stage = open_stage(path)
        authored: dict[str, Authored] = {}
        for prim_path in prims:
            values = authored.setdefault(prim_path, {})
            for attribute in stage.GetPrimAtPath(prim_path).GetAuthoredAttributes():
                value = plain_value(attribute.Get())
                if value is not None:
                    values[attribute.GetName()] = (str(attribute.GetTypeName()), value)
    return authored
