"""The frames that a list of target prims gives, as Isaac Sim 6.0.1 works them out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec import Struct

from lab3_usd.check.tf.frame_names import frame_name, names_in_turn, unique_names
from lab3_usd.check.tf.link_tree import Links, above, articulation_links, expansion
from lab3_usd.check.tf.unresolved_frames import (
    UnresolvedFrames,
    is_target_unresolved,
    unresolved_frames_at,
)
from lab3_usd.model.physics import BODY_API, bodies_below
from lab3_usd.model.stage import Node, StageModel
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.port_groups import TfPorts


class Pair(Struct, frozen=True):
    """A parent and a child frame that a list of target prims gives.

    `target` is the prim that was listed, `prim` the one whose frame the child is; `expanded` says
    that the target stands for other prims than itself.
    """

    parent: str
    child: str
    target: str
    prim: str
    expanded: bool


def tf_ports(node: Node) -> TfPorts:
    """Return the ports of a node that carry frames; none for a node of another kind."""
    found = None if node.type is None else node.type.tf
    return TfPorts() if found is None else found


def computes(node: Node) -> bool:
    """Whether a node hands the frames of its prims on, as one that only computes them does."""
    return bool(tf_ports(node).gives)


def listed_targets(node: Node) -> tuple[str, ...]:
    """Return the target prims of a node that makes frames of prims."""
    ports = tf_ports(node).prims
    return node.targets(ports[1]) if ports else ()


def parent_prim(node: Node) -> str:
    """Return the prim below whose frame a node hangs the others, '' for none."""
    ports = tf_ports(node).prims
    return next(iter(node.targets(ports[0])), "") if ports else ""


def parent_frame(node: Node, stage: StageModel, lab: Lab) -> str:
    """Return the frame below which a node hangs those that have no other parent."""
    prim = parent_prim(node)
    return frame_name(prim, stage) if prim else lab.catalog.world_frame


def computed_pairs(node: Node, stage: StageModel, lab: Lab) -> list[Pair]:
    """Return the frames that a node's target prims give, in the order of the targets.

    Targets that do not exist, and those of which a missing asset holds what they stand for, give
    none.
    """
    found: list[tuple[str, str]] = []  # target prim, prim of the frame
    links: Links = {}
    expanded: set[str] = set()
    targets = listed_targets(node)
    if not targets:
        return []
    for target in targets:
        made = _frames_of(target, node, stage)
        if made != {target: ""}:
            expanded.add(target)
        found.extend((target, path) for path in made)
        links.update(made)
    paths = [path for _, path in found]
    names = _names(paths, node, stage)
    frames = {**_bodies_above(paths, node, stage), **dict(zip(paths, names, strict=True))}
    top = parent_frame(node, stage, lab)
    pairs = [
        Pair(frames.get(links[path], top), name, target, path, target in expanded)
        for (target, path), name in zip(found, names, strict=True)
    ]
    return [pair for pair in pairs if not _is_left_out(pair, node, stage)]


def _frames_of(target: str, node: Node, stage: StageModel) -> Links:
    if stage.prim(target) is None:
        return {}
    links = _expansion(target, node, stage)
    if links is not None:
        return links
    return {} if is_target_unresolved(target, stage) else {target: ""}


def _expansion(target: str, node: Node, stage: StageModel) -> Links | None:
    prim = stage.prims[target]
    if computes(node):
        return expansion(prim, stage, parent_prim(node))
    return articulation_links(prim, stage)


def expands(target: str, node: Node, stage: StageModel) -> bool:
    """Whether a target prim of a node stands for other prims than itself."""
    return stage.prim(target) is not None and _expansion(target, node, stage) is not None


def unresolved_frames_of(node: Node, stage: StageModel) -> Iterator[UnresolvedFrames]:
    """Yield what only a missing asset could tell of the frames that a node's targets give."""
    for target in listed_targets(node) if stage.unresolved else ():
        yield from unresolved_frames_at(target, stage, expands=expands(target, node, stage))


def _names(paths: Sequence[str], node: Node, stage: StageModel) -> list[str]:
    if computes(node):
        return unique_names(paths, stage)
    first = [parent_prim(node)] if parent_prim(node) else []
    return names_in_turn([*first, *paths], stage)[len(first) :]


def _bodies_above(paths: Sequence[str], node: Node, stage: StageModel) -> dict[str, str]:
    """Return the frames of bodies that are no targets themselves, but stand above targets.

    The computing node follows them to know where a target without a body is, and hangs below
    them the links that their joints tie to them.
    """
    if not computes(node):
        return {}
    bodies = set(bodies_below(stage, "/"))
    still = (path for path in (*paths, parent_prim(node)) if path not in bodies)
    found = (above(path, bodies) for path in still)
    return {path: frame_name(path, stage) for path in found if path}


def _is_left_out(pair: Pair, node: Node, stage: StageModel) -> bool:
    """Whether the old way of a publisher leaves a body out that would be its own parent."""
    prim = stage.prims[pair.prim]
    return not computes(node) and pair.parent == pair.child and BODY_API in prim.apis
