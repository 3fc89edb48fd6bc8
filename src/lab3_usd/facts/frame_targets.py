"""The frames that target prims give, as Isaac Sim 6.0.1 works them out: names, links, unknown ones.

Isaac Compute Transform Tree goes by schemas and by the namespace. The joints say only below
which link another one hangs; what a robot lists as its links plays no part.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence

from msgspec import Struct

from lab3_usd.isaac.node_types import TfPorts
from lab3_usd.model.physics import (
    ARTICULATION_API,
    BODIES,
    BODY_API,
    bodies_below,
    is_excluded,
    is_joint,
    is_joint_type,
    rigid_bodies,
)
from lab3_usd.model.prims import Prim, is_at_or_below, upwards
from lab3_usd.model.stage import Node, StageModel, UnresolvedAsset, once_per_stage

NAME_OVERRIDE = "isaac:nameOverride"


def frame_of_prim(path: str, stage: StageModel) -> str:
    """Return the frame of a prim: its name override, else the prim's own name."""
    prim = stage.prim(path)
    override = None if prim is None else prim.attributes.get(NAME_OVERRIDE)
    return override if isinstance(override, str) and override else _leaf(path)


def _leaf(path: str) -> str:
    return path.rpartition("/")[2]


def unique_names(paths: Sequence[str], stage: StageModel) -> list[str]:
    """Return a frame name for each prim of one list, as Isaac Compute Transform Tree does.

    The prim with the longest path keeps a name that several want. The others go by the prim's
    name; where that is taken too, an ancestor's name comes before it, but never that of a prim at
    the root, as the first path of the list has one.
    """
    wanted = [frame_of_prim(path, stage) for path in paths]
    owner: dict[str, int] = {}
    for index, name in enumerate(wanted):
        if name not in owner or len(paths[index]) > len(paths[owner[name]]):
            owner[name] = index
    names = [name if owner[name] == index else "" for index, name in enumerate(wanted)]
    start, taken = max(paths[0].find("/", 1), 0) if paths else 0, set(names)
    for index, path in enumerate(paths):
        if not names[index]:
            leaf = _leaf(path)
            names[index] = _qualified(path, start, taken, stage) if leaf in taken else leaf
            taken.add(names[index])
    return names


def _qualified(path: str, start: int, taken: Container[str], stage: StageModel) -> str:
    """Return the first name with an ancestor's before it that is free, else the rest of the path.

    The rest is no unique name for a prim right below one at the root. Isaac Sim counts `start` in
    characters, whatever prim it falls into.
    """
    leaf = _leaf(path)
    end = path.find("/", start + 1)
    while end >= 0:
        above = frame_of_prim(path[:end], stage)
        if above != leaf and f"{above}_{leaf}" not in taken:
            return f"{above}_{leaf}"
        end = path.find("/", end + 1)
    return path[start:].removeprefix("/").replace("/", "_") or leaf


def names_in_turn(paths: Sequence[str], stage: StageModel) -> list[str]:
    """Return a frame name for each prim: who comes first keeps it, the next goes by its path."""
    names: dict[str, str] = {}
    taken: set[str] = set()
    for path in paths:
        if path not in names:
            name = frame_of_prim(path, stage)
            names[path] = path.strip("/").replace("/", "_") if name in taken else name
            taken.add(names[path])
    return [names[path] for path in paths]


ROBOT_API = "IsaacRobotAPI"
LINK_API = "IsaacLinkAPI"
FRAME_APIS = frozenset({LINK_API, "IsaacSiteAPI", "IsaacReferencePointAPI"})
_NO_FRAMES = frozenset({"IsaacJointAPI", ROBOT_API})
_ROBOT_JOINTS = "isaac:physics:robotJoints"

Links = dict[str, str]  # the path of each link with that of its parent link, '' for none


def expansion(target: Prim, stage: StageModel, parent: str) -> Links | None:
    """Return the prims that become frames in the place of a target, None where it stays one.

    An articulation root stands for the bodies at and below it, a robot for everything in its
    subtree that a schema of Isaac Sim calls a link, a site or a reference point. Of a robot, not
    of an articulation, the prim `parent` is left out, below which the others hang.
    """
    if ARTICULATION_API in target.apis:
        bodies = bodies_below(stage, target.path)
        if bodies:
            inside = frozenset(bodies)
            return {path: above(path, inside) for path in bodies}
    if ROBOT_API not in target.apis:
        return None
    parents = joint_parents(target, stage)
    links, shown = _framed(stage)
    frames = {
        path: parents.get(path, "") if path in links else above(path, links)
        for path in shown.get(target.path, ())
    }
    return {path: frames[path] for path in frames if path != parent} if frames else None


@once_per_stage
def _framed(stage: StageModel) -> tuple[frozenset[str], Mapping[str, Sequence[str]]]:
    """Return the links of a stage, and the prims that are frames by what they stand at or below."""
    shown: dict[str, list[str]] = {}
    for prim in stage.with_api(FRAME_APIS.__contains__):
        if prim.present and not _NO_FRAMES & set(prim.apis):
            for top in upwards(prim.path):
                shown.setdefault(top, []).append(prim.path)
    return frozenset(prim.path for prim in stage.with_api(LINK_API) if prim.present), shown


def joint_parents(robot: Prim, stage: StageModel) -> Links:
    """Map each link to the one on which the robot's joints hang it; the last joint counts."""
    parents: Links = {}
    for path in robot.relationships.get(_ROBOT_JOINTS, ()):
        joint = stage.prims.get(path)  # a joint that is deactivated is still read
        if joint is None or not is_joint(joint) or is_excluded(joint):
            continue
        parent, child = (joint.relationships.get(name, ()) for name in BODIES)
        if parent and child:
            parents[child[0]] = parent[0]
    return parents


def above(path: str, paths: Container[str]) -> str:
    """Return the nearest prim above `path` that is one of `paths`, '' for none."""
    return next((each for each in upwards(path.rpartition("/")[0]) if each in paths), "")


@once_per_stage
def articulation_links(root: Prim, stage: StageModel) -> Links | None:
    """Return the links that joints tie to an articulation root, parents first; None for no root."""
    if ARTICULATION_API not in root.apis:
        return None
    parents, children = _tied_links(stage)
    ahead = [_topmost(path, parents) for path in bodies_below(stage, root.path)]
    links: Links = {}
    for path in ahead:  # which grows
        if path not in links:
            links[path] = parents.get(path, "")
            ahead.extend(children.get(path, ()))
    return links or None


@once_per_stage
def _tied_links(stage: StageModel) -> tuple[Links, Mapping[str, Sequence[str]]]:
    """Map each link to the one on which the first of its joints hangs it, and those to theirs."""
    parents: Links = {}
    for joint in stage.of_type(is_joint_type):
        if joint.present:
            parent_body, body = (joint.relationships.get(name, ()) for name in BODIES)
            if parent_body and body and stage.prim(parent_body[0]) and stage.prim(body[0]):
                parents.setdefault(body[0], parent_body[0])
    children: dict[str, list[str]] = {}
    for child, parent in parents.items():
        children.setdefault(parent, []).append(child)
    return parents, children


def _topmost(path: str, parents: Links) -> str:
    """Climb to the link that no joint hangs below another."""
    seen = {path}
    while parents.get(path) and parents[path] not in seen:
        path = parents[path]
        seen.add(path)
    return path


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


_NO_PORTS = TfPorts()


def tf_ports(node: Node) -> TfPorts:
    """Return the ports of a node that carry frames; none for a node of another kind."""
    ports = None if node.type is None else node.type.tf
    return _NO_PORTS if ports is None else ports


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


def parent_frame(node: Node, stage: StageModel) -> str:
    """Return the frame below which a node hangs those that have no other parent."""
    prim = parent_prim(node)
    return frame_of_prim(prim, stage) if prim else stage.platform.world_frame


@once_per_stage
def computed_pairs(node: Node, stage: StageModel) -> Sequence[Pair]:
    """Return the frames that a node's target prims give, in the order of the targets.

    Targets that do not exist, and those whose frames only a missing asset knows, give
    none.
    """
    sources: list[tuple[str, str]] = []  # target prim, prim of the frame
    links: Links = {}
    expanded: set[str] = set()
    for target in listed_targets(node):
        made = _frames_of(target, node, stage)
        if made != {target: ""}:
            expanded.add(target)
        sources.extend((target, path) for path in made)
        links.update(made)
    paths = [path for _, path in sources]
    if computes(node):
        names = unique_names(paths, stage)
    else:
        first = [parent_prim(node)] if parent_prim(node) else []
        names = names_in_turn([*first, *paths], stage)[len(first) :]
    frames = {**_bodies_above(paths, node, stage), **dict(zip(paths, names, strict=True))}
    top = parent_frame(node, stage)
    pairs = [
        Pair(frames.get(links[path], top), name, target, path, target in expanded)
        for (target, path), name in zip(sources, names, strict=True)
    ]
    if computes(node):
        return pairs
    # The old way of a publisher leaves out a body that would be its own parent.
    return [
        pair
        for pair in pairs
        if pair.parent != pair.child or BODY_API not in stage.prims[pair.prim].apis
    ]


def _frames_of(target: str, node: Node, stage: StageModel) -> Links:
    links = _expansion(target, node, stage)
    if links is not None:
        return links
    is_there = stage.prim(target) is not None and not unknown_target(target, stage)
    return {target: ""} if is_there else {}


def links_given_by(target: str, node: Node, stage: StageModel) -> tuple[str, ...]:
    """Return the prims that a target prim of a node represents; itself if it is a frame."""
    links = _expansion(target, node, stage)
    return (target,) if links is None else tuple(links)


def _expansion(target: str, node: Node, stage: StageModel) -> Links | None:
    """Return what a target prim of a node becomes; None where it stays one, or there is none."""
    prim = stage.prim(target)
    if prim is None:
        return None
    if computes(node):
        return expansion(prim, stage, parent_prim(node))
    return articulation_links(prim, stage)


def expands(target: str, node: Node, stage: StageModel) -> bool:
    """Whether a target prim of a node stands for other prims than itself."""
    return _expansion(target, node, stage) is not None


def unresolved_frames_of(node: Node, stage: StageModel) -> Iterator[UnresolvedFrames]:
    """Yield what only a missing asset could tell of the frames that a node's targets give."""
    for target in listed_targets(node) if stage.unresolved else ():
        missing, is_there = unknown_target(target, stage), stage.prim(target) is not None
        if missing is not None:
            yield UnresolvedFrames(target, links=is_there, asset=missing.asset)
        elif expands(target, node, stage):  # below one that stands for its links may be more
            for below in stage.unresolved:
                if is_at_or_below(below.prim, target) and stage.unknown(below.prim):
                    yield UnresolvedFrames(below.prim, links=True, asset=below.asset)


def _bodies_above(paths: Sequence[str], node: Node, stage: StageModel) -> dict[str, str]:
    """Return the frames of bodies that are no targets themselves, but stand above targets.

    The computing node follows them to know where a target without a body is, and hangs below
    them the links that their joints tie to them.
    """
    if not computes(node):
        return {}
    bodies = rigid_bodies(stage)
    still = (path for path in (*paths, parent_prim(node)) if path not in bodies)
    nearest = (above(path, bodies) for path in still)
    return {path: frame_of_prim(path, stage) for path in nearest if path}


_SAYS_NOTHING = frozenset({"", "Xform", "Scope"})  # types that a robot may have


class UnresolvedFrames(Struct, frozen=True):
    """Frames that only a missing asset could tell: those of a prim, or of the links at and below.

    `parent` is the frame below which they would hang, `publisher` the node that would send them
    and `cause` the one whose target `prim` is.
    """

    prim: str
    links: bool
    asset: str
    parent: str = ""
    publisher: str = ""
    cause: str = ""
    topic: str = ""

    @property
    def what(self) -> str:
        """What cannot be known, in words."""
        return f"{'links' if self.links else 'frame'} of {self.prim}"

    def may_be(self, frame: str) -> bool:
        """Whether a frame of this name could be among them."""
        return self.links or _leaf(self.prim) == frame

    def may_give(self, prim: str) -> bool:
        """Whether the frame of this prim could be among them."""
        return is_at_or_below(prim, self.prim) or _leaf(prim) == _leaf(self.prim)


def unknown_target(target: str, stage: StageModel) -> UnresolvedAsset | None:
    """Return the missing asset that holds the target, or what the target stands for.

    What the stage defines itself it also names: a link or a sensor stays what it is.
    """
    prim, asset = stage.prim(target), stage.unknown(target)
    if asset is None or prim is None:
        return asset
    carries_asset = any(missing.prim == target for missing in stage.unresolved)
    is_defined = prim.type not in _SAYS_NOTHING or set(prim.apis) & {BODY_API, *FRAME_APIS}
    return asset if carries_asset and not is_defined else None
