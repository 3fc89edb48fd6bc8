"""The prims of a stage that are not nodes, and what an open stage tells of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from msgspec import Struct, field

from lab3_usd.isaac.values import Value


def is_at_or_below(path: str, top: str) -> bool:
    """Whether `path` is the prim `top` or one below it; everything is below '/'."""
    if not path.startswith(top):
        return False
    rest = path[len(top) :]
    return not rest or rest[0] == "/" or top.endswith("/")


def upwards(path: str) -> Iterator[str]:
    """Yield the path of a prim and those above it, nearest first, without the root of the stage."""
    while path:
        yield path
        path = path.rpartition("/")[0]


Matrix = tuple[float, ...]  # 16 numbers in rows, as USD multiplies: row vectors, translation last
NameFilter = str | Callable[[str], bool]  # a name, or what tells whether a name is asked for


class Prim(Struct, eq=False):
    """A prim that is not a node.

    `type` is the type name as saved, known to usd-core or not; `apis` every applied schema.
    `attributes` holds the values that rules ask about, `relationships` their targets, and what an
    attribute that a lab describes is connected to. `local` and `world` are transforms in stage
    units, None if the prim has no pose. A `placeless` prim is not Xformable: it has the pose of its
    parent, and is not a body. `assets` are the files that it refers to, as layers name them.

    `read` reads the fields that `unread` left out: it is called with the prim and the name of the
    first of them that is asked for, and sets at least that one.
    """

    path: str
    type: str
    apis: tuple[str, ...]
    active: bool = True
    defined: bool = True
    placeless: bool = False
    attributes: Mapping[str, Value] = field(default_factory=dict)
    relationships: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    local: Matrix | None = None
    world: Matrix | None = None
    assets: tuple[str, ...] = ()
    read: Callable[[Prim, str], None] | None = None

    @classmethod
    def unread(
        cls,
        path: str,
        type_name: str,
        apis: tuple[str, ...],
        read: Callable[[Prim, str], None],
        *,
        active: bool,
        defined: bool,
        placeless: bool,
    ) -> Prim:
        """Return a prim whose values and place are read when they are asked for."""
        prim = cls(path, type_name, apis, active, defined, placeless, read=read)
        del prim.attributes, prim.relationships, prim.local, prim.world, prim.assets
        return prim

    def __getattr__(self, name: str) -> Any:
        """Read a field for the first time."""
        if name.startswith("__") or name == "read" or self.read is None:
            raise AttributeError(name)
        self.read(self, name)
        return object.__getattribute__(self, name)

    @property
    def name(self) -> str:
        """The prim name."""
        return self.path.rpartition("/")[2]

    @property
    def parent(self) -> str:
        """The path of the parent prim; '' for a prim at the root."""
        return self.path.rpartition("/")[0]

    @property
    def present(self) -> bool:
        """Whether the prim is part of the scene."""
        return self.active and self.defined


def name_matches(name: str, asked: NameFilter) -> bool:
    """Whether a name is asked for."""
    return name == asked if isinstance(asked, str) else asked(name)


def of_any_name(_: str) -> bool:
    """Ask for all names."""
    return True


class Prims(Mapping[str, Prim]):
    """The prims of a stage that are not nodes, by path, parents before children.

    The answers here look at every prim; a stage that is read as it is asked knows them better.
    """

    def __init__(self, prims: Mapping[str, Prim]) -> None:
        """Take prims that were read already."""
        self._prims = prims

    def __getitem__(self, path: str) -> Prim:
        """Return the prim at a path, in the scene or not."""
        return self._prims[path]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the paths."""
        return iter(self._prims)

    def __len__(self) -> int:
        """Count the prims."""
        return len(self._prims)

    def of_type(self, asked: NameFilter) -> Iterable[Prim]:
        """Return the prims of the types asked for."""
        return (prim for prim in self.values() if name_matches(prim.type, asked))

    def with_api(self, asked: NameFilter) -> Iterable[Prim]:
        """Return the prims to which a schema asked for is applied."""
        return (
            prim for prim in self.values() if any(name_matches(api, asked) for api in prim.apis)
        )

    def named(self, asked: NameFilter) -> Iterable[Prim]:
        """Return the prims whose own name is asked for."""
        return (prim for prim in self.values() if name_matches(prim.name, asked))

    def below(
        self, top: str, asked: NameFilter = of_any_name, left_out: frozenset[str] = frozenset()
    ) -> Iterable[Prim]:
        """Return those at and below a prim that are of the types asked for.

        What stands at or below a prim with one of the names `left_out` is not among them.
        """
        return (
            prim
            for prim in self.of_type(asked)
            if is_at_or_below(prim.path, top) and left_out.isdisjoint(prim.path.split("/"))
        )


class Collider(Struct, frozen=True, gc=False):
    """The box around one collision shape in world space, in metres."""

    path: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]


class Colliders:
    """The collision shapes of a stage; without any where none were read."""

    def below(self, top: str) -> Iterable[Collider]:
        """Return the boxes of the shapes at and below a prim."""
        return ()

    def beside(self, top: str) -> Iterable[Collider]:
        """Return the boxes of the shapes that are not `below` a prim."""
        return ()

    def bounds(self) -> Iterable[Collider]:
        """Return boxes that hold the shapes: those of meshes may be larger than the meshes."""
        return ()

    def measured(self, path: str) -> Collider | None:
        """Return the box of the shapes of a collision prim."""
        return None

    def shape(self, path: str) -> Collider | None:
        """Return the box around a prim's own shape, whether it collides or not."""
        return None


class Details:
    """Answers about the prims of a stage; none where no stage is open."""

    def fallback(self, path: str, name: str) -> Value | None:
        """Return what the schema of a prim gives an attribute that has no value."""
        return None

    def is_file(self, path: str, name: str) -> bool:
        """Whether an attribute names a file."""
        return False

    def variant(self, path: str, variants: str) -> str:
        """Return which one of a prim's set of variants is selected, '' for none."""
        return ""

    def other_type(self, path: str, name: str, asked: str) -> tuple[str, str] | None:
        """Return the type that a layer gives an attribute, and the one in which it is read.

        They are told where both are of text, and not the same: the second is that of the schema,
        else the one that is `asked` for.
        """
        return None

    def local(self, path: str) -> Matrix | None:
        """Return the transform of a prim in its parent; None where none is authored."""
        return None

    def origin(self, path: str) -> tuple[float, float, float] | None:
        """Return where the origin of a prim is in the world, in metres; None without a prim."""
        return None

    def material(self, path: str, binding: str) -> str:
        """Return the material with which USD draws a prim, or lets it slide; '' for none.

        `binding` is the relationship for one purpose, as `material:binding:physics`.
        """
        return ""
