"""What tf2 makes of transforms: a tree, or what keeps them from being one.

Whoever asks gives the transforms that one listener hears: those of one domain, on one topic and its
static twin. Published transforms, recorded ones and those of a dry run are all judged here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import chain
from types import MappingProxyType
from typing import Generic, Protocol, TypeVar

from msgspec import Struct


def is_acyclic(pairs: Iterable[tuple[str, str]]) -> bool:
    """Whether no name leads back to itself."""
    after: dict[str, list[str]] = {}
    waiting: dict[str, int] = {}
    for before, name in pairs:
        after.setdefault(before, []).append(name)
        waiting[name] = waiting.get(name, 0) + 1
    ahead = [name for name in after if name not in waiting]
    while ahead:
        for name in after.pop(ahead.pop(), ()):
            waiting[name] -= 1
            if not waiting[name]:
                ahead.append(name)
    return not after


def first_connected(names: Iterable[str], pairs: Iterable[Sequence[str]]) -> dict[str, str]:
    """Map each name to the first one of those that pairs connect with it."""
    first = {name: name for name in names}

    def top(name: str) -> str:
        while first[name] != name:
            first[name] = name = first[first[name]]
        return name

    order = {name: number for number, name in enumerate(first)}
    for one, other in pairs:
        low, high = sorted((top(one), top(other)), key=order.__getitem__)
        first[high] = low
    return {name: top(name) for name in first}


class Placement(Protocol):
    """A transform, wherever it is from: `publisher` is empty where nobody knows who sends it."""

    @property
    def parent(self) -> str:
        """The frame above."""

    @property
    def child(self) -> str:
        """The frame that is placed."""

    @property
    def publisher(self) -> str:
        """Who sends it."""


class SentTransform(Struct, frozen=True):
    """A transform of which no more than this is known."""

    parent: str
    child: str
    publisher: str = ""


_Edge = TypeVar("_Edge", bound=Placement)
_NONE: Mapping[str, str] = MappingProxyType({})


class Tree(Struct, Generic[_Edge], frozen=True, dict=True):
    """The transforms that one tf2 listener receives, in the order in which they are known.

    tf2 rejects a frame that is its own parent, keeps the latest of several parents, and finds no
    transform in a cycle.
    """

    edges: tuple[_Edge, ...]

    @cached_property
    def by_child(self) -> dict[str, list[_Edge]]:
        """The transforms that place each frame."""
        placed: dict[str, list[_Edge]] = {}
        for edge in self.edges:
            placed.setdefault(edge.child, []).append(edge)
        return placed

    @cached_property
    def by_parent(self) -> dict[str, list[_Edge]]:
        """The transforms below each frame."""
        below: dict[str, list[_Edge]] = {}
        for edge in self.edges:
            below.setdefault(edge.parent, []).append(edge)
        return below

    @cached_property
    def frames(self) -> frozenset[str]:
        """All frames that the transforms name."""
        return frozenset((*self.by_parent, *self.by_child))

    @cached_property
    def self_parents(self) -> tuple[_Edge, ...]:
        """The transforms of frames below themselves."""
        return tuple(edge for edge in self.edges if edge.parent == edge.child)

    @cached_property
    def several_parents(self) -> dict[str, tuple[str, ...]]:
        """The frames with more than one parent beside themselves, with these."""
        parents = {child: self.parents_of(child) for child in self.by_child}
        return {child: names for child, names in parents.items() if len(names) > 1}

    def parents_of(self, child: str) -> tuple[str, ...]:
        """Return the parents of a frame beside itself, each once."""
        above = (edge.parent for edge in self.by_child.get(child, ()) if edge.parent != child)
        return tuple(dict.fromkeys(above))

    @cached_property
    def several_publishers(self) -> dict[tuple[str, str], tuple[_Edge, ...]]:
        """The transforms, by parent and child, that more than one publisher sends."""
        sent: dict[tuple[str, str], list[_Edge]] = {}
        for edge in self.edges:
            if edge.parent != edge.child:
                sent.setdefault((edge.parent, edge.child), []).append(edge)
        return {
            pair: tuple(edges)
            for pair, edges in sent.items()
            if len({edge.publisher for edge in edges}) > 1
        }

    def above(self, child: str) -> tuple[str, ...]:
        """Return the frames above one, the nearest first; of several parents the first counts."""
        above: dict[str, None] = {}
        while parents := self.parents_of(child):
            child = parents[0]
            if child in above:
                break
            above[child] = None
        return tuple(above)

    @cached_property
    def cycle(self) -> tuple[str, ...]:
        """The frames of cycles, and of what lies between two of them, as the edges name them.

        A frame below itself is none: tf2 does not take the transform.
        """
        return tuple(_frames_in_cycles(edge for edge in self.edges if edge.parent != edge.child))

    @cached_property
    def roots(self) -> tuple[str, ...]:
        """The frames below no other, then one frame of every cycle that hangs below none."""
        tops = dict.fromkeys(name for name in self.by_parent if name not in self.by_child)
        reached: set[str] = set()
        for top in [*tops, *self.by_parent]:
            if top not in reached:
                tops[top] = None
                self._reach(reached, [top])
        return tuple(tops)

    def below(self, *tops: str) -> set[str]:
        """Return the frames that hang below some, and these."""
        reached: set[str] = set()
        self._reach(reached, list(tops))
        return reached

    def _reach(self, reached: set[str], ahead: list[str]) -> None:
        """Add the frames that hang below some, and these, to those that were reached before."""
        while ahead:
            name = ahead.pop()
            if name not in reached:
                reached.add(name)
                ahead.extend(edge.child for edge in self.by_parent.get(name, ()))

    @cached_property
    def parts(self) -> tuple[tuple[tuple[_Edge, ...], frozenset[str]], ...]:
        """The trees that nothing connects: their transforms and frames, the largest first."""
        pairs = [(edge.parent, edge.child) for edge in self.edges]
        first = first_connected(chain.from_iterable(pairs), pairs)
        latest = {first[edge.parent]: number for number, edge in enumerate(self.edges)}
        edges: dict[str, list[_Edge]] = {name: [] for name in latest}
        frames: dict[str, set[str]] = {name: set() for name in latest}
        for edge in self.edges:
            edges[first[edge.parent]].append(edge)
            frames[first[edge.parent]].update((edge.parent, edge.child))
        ordered = sorted(latest, key=lambda name: (-len(frames[name]), latest[name]))
        return tuple((tuple(edges[name]), frozenset(frames[name])) for name in ordered)

    @cached_property
    def islands(self) -> dict[str, str]:
        """The frames that nothing connects with the largest tree, with the top of their own."""
        order = {top: number for number, top in enumerate(self.roots)}
        return {
            frame: min(frames & order.keys(), key=order.__getitem__, default=frame)
            for _, frames in self.parts[1:]
            for frame in sorted(frames)
        }


def tree_of(edges: Iterable[_Edge]) -> Tree[_Edge]:
    """Return what tf2 makes of transforms that one listener hears."""
    return Tree(tuple(edges))


def _frames_in_cycles(edges: Iterable[Placement]) -> list[str]:
    """Return the frames of cycles, and of what lies between two of them, as the edges name them."""
    pairs = [(edge.parent, edge.child) for edge in edges]
    if is_acyclic(pairs):
        return []
    import networkx as nx

    graph = nx.DiGraph(pairs)
    components = nx.strongly_connected_components(graph)
    rings = {name for component in components if len(component) > 1 for name in component}
    rings.update(nx.nodes_with_selfloops(graph))
    below = rings.union(*(nx.descendants(graph, name) for name in rings))
    above = rings.union(*(nx.ancestors(graph, name) for name in rings))
    return [name for name in graph if name in above and name in below]


class FrameFault(Struct, frozen=True):
    """Something that tf2 cannot make a tree of, at one frame."""

    frame: str
    kind: str
    message: str


def frame_faults(heard: Tree[_Edge], reserved: Mapping[str, str] = _NONE) -> list[FrameFault]:
    """Return what is wrong with a tree, in the order of the frames.

    `reserved` are the frames that only something outside the stage may place, with its name.
    """
    faults = []
    own, rings = {edge.child for edge in heard.self_parents}, {*heard.cycle}
    for frame in heard.by_child:
        names = heard.parents_of(frame)
        if frame in reserved:
            faults.append(FrameFault(frame, "reserved", f"only {reserved[frame]} may place it"))
        if frame in heard.several_parents:
            faults.append(
                FrameFault(frame, "two parents", f"{len(names)} parents: {', '.join(names)}")
            )
        for name in names:
            times = len(
                {edge.publisher for edge in heard.several_publishers.get((name, frame), ())}
            )
            if times:
                text = f"{times} publishers below {name}"
                faults.append(FrameFault(frame, "published twice", text))
        if frame in own:
            faults.append(FrameFault(frame, "own parent", "its own parent"))
        elif frame in rings:
            faults.append(FrameFault(frame, "ring", "part of a cycle"))
    return faults
