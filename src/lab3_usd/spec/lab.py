"""The description of a lab as data: what a correct stage is.

The lab's files, its handout, graph specs, requirements and checkpoints.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cached_property, lru_cache
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.platform import Platform
from lab3_usd.spec.graph import GraphSpec, NodeSpec
from lab3_usd.spec.props import PropSpec
from lab3_usd.spec.ros import FROM_THE_FIRST, RosSpec, TopicSpec
from lab3_usd.spec.scene import RobotSpec, SceneSpec, SensorSpec, stands_within
from lab3_usd.spec.submission import SubmissionSpec

CATALOG = "node_types.yaml"
CHECKPOINTS = "checkpoints.yaml"
ROS = "ros.yaml"
RUBRIC = "rubric.yaml"
SCENE = "scene.yaml"
STARTER = "starter.yaml"
SUBMISSION = "submission.yaml"


class Handout(Struct, frozen=True, forbid_unknown_fields=True):
    """The number of sections in each part, and the sections that ask for nothing in a stage.

    Sections are called A1 in a part A, 4.1 in a part 4, Ex 4.1 in a part Ex 4. `rules` gives the
    section of findings that concern no item of the lab.
    """

    sections: Mapping[str, int] = {}
    by_hand: tuple[str, ...] = ()
    rules: Mapping[str, str] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Name every section."""
        return tuple(
            f"{lead}{number}"
            for lead, count in zip(self.leads.values(), self.sections.values(), strict=True)
            for number in range(1, count + 1)
        )

    def behind(self, rule: str, item: str) -> str:
        """Return the section behind a rule, that of its item where the lab names none."""
        return self.rules.get(rule, item)

    @property
    def leads(self) -> dict[str, str]:
        """What the names of the sections of each part begin with."""
        return {part: f"{part}." if part[-1:].isdigit() else part for part in self.sections}


class Removal(Struct, frozen=True):
    """What a checkpoint takes away, and the section that asks for it, '' where none is named."""

    path: str
    handout: str = ""


class Checkpoint(Struct, frozen=True):
    """One checkpoint: its number, file name without ending, and everything it must hold.

    `graphs` and `sensors` are cumulative; `new` names the graphs this checkpoint adds,
    `removals` are what was there and is to be gone, `silent` the topics that go with it. `unsent`
    are frames of the tree that none of its graphs sends. `key` is how the files of the lab refer to
    it.
    """

    id: str
    file: str
    title: str
    part: str
    graphs: tuple[str, ...]
    new: tuple[str, ...]
    sensors: tuple[str, ...]
    new_sensors: tuple[str, ...]
    frames: bool = False
    topics: bool = False
    localization: bool = False
    key: str = ""
    optional: bool = False
    removals: tuple[Removal, ...] = ()
    silent: frozenset[str] = frozenset()
    unsent: frozenset[str] = frozenset()

    @property
    def removed(self) -> tuple[str, ...]:
        """The paths of what is to be gone."""
        return tuple(removal.path for removal in self.removals)

    def is_removed(self, path: str) -> bool:
        """Whether a prim is to be gone."""
        return any(stands_within(path, gone) for gone in self.removed)


class StampReset(Struct, frozen=True, forbid_unknown_fields=True, rename={"agree": "with"}):
    """Inputs of helpers that restart time stamps, and the input of the time that they are to equal.

    `{ports: [resetSimulationTimeOnStop], with: resetOnStop}`: P09 notes where they differ.
    """

    ports: tuple[str, ...]
    agree: str


class Policy(Struct, frozen=True, forbid_unknown_fields=True):
    """Rules for every graph.

    `tick` names the event that starts the course's graphs, for its readers. `accepts` are rules of
    the linter whose findings in the lab's own stages are meant, so that `lab check` leaves them
    out. Names of ROS are Isaac Sim's, and need not be given: where a lab gives them, they must be
    the same.
    """

    handout: str
    keep_default: tuple[str, ...]
    stamp_reset: StampReset
    tick: str
    accepts: tuple[str, ...] = ()
    namespace: str = ""
    namespace_attribute: str = ""
    tree_topics: tuple[str, ...] = ()


class FrameEdge(tuple[str, str]):
    """A transform of the TF tree: parent and child."""

    __slots__ = ()
    written = "'parent -> child'"

    @classmethod
    def parse(cls, text: str) -> FrameEdge:
        """Read an edge as the specs write it.

        Raises:
            ValueError: it is written otherwise.
        """
        parent, child = filter(None, text.split(" -> "))
        return cls((parent, child))


class ForbiddenTransform(Struct, frozen=True, forbid_unknown_fields=True):
    """A transform that no node may publish, and the usual names of nodes that do."""

    parent: str
    child: str
    nodes: tuple[str, ...]
    handout: str


class LocalizationSpec(Struct, frozen=True, forbid_unknown_fields=True, rename={"since": "from"}):
    """The transform of localization, and the chain of frames that it completes."""

    edge: FrameEdge
    by: str
    since: str
    chain: tuple[str, ...]
    handout: str


class TreeSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """The tree of one robot, on its own topic."""

    topic: str
    edges: tuple[FrameEdge, ...]
    deeper_under: str | tuple[str, ...] = ""


class FrameSpec(Struct, frozen=True, dict=True, forbid_unknown_fields=True):
    """The TF tree.

    Frames may also be deeper below `deeper_under` than the edges say, as in a joint tree. `names`
    are the frames of prims with an `isaac:nameOverride`, by path. Robots in namespaces of their
    own, whose frames may have the same names, have `trees` in place of `edges`: `trees: [{topic:
    /r1/tf, edges: [odom -> base]}, {topic: /r2/tf, edges: [...]}]`.
    """

    handout: str
    edges: tuple[FrameEdge, ...] = ()
    deeper_under: str | tuple[str, ...] = ""
    forbidden: ForbiddenTransform | tuple[ForbiddenTransform, ...] = ()
    names: Mapping[str, str] = {}
    localization: LocalizationSpec | None = None
    trees: tuple[TreeSpec, ...] = ()

    @property
    def joined(self) -> FrameSpec:
        """The frames with the edges of all trees."""
        edges = dict.fromkeys(edge for tree in self.each for edge in tree.edges)
        deeper = [name for tree in self.each for name in tree.deeper]
        return replace(self, edges=tuple(edges), deeper_under=tuple(dict.fromkeys(deeper)))

    @property
    def each(self) -> tuple[FrameSpec, ...]:
        """The frames of each tree; of a single one, these."""
        return tuple(self.on(tree.topic) for tree in self.trees) or (self,)

    def on(self, topic: str) -> FrameSpec:
        """Return the frames of the tree on a topic, all where there are no trees by topic."""
        for tree in self.trees:
            if tree.topic == topic:
                return replace(self, edges=tree.edges, deeper_under=tree.deeper_under)
        return self

    def without(self, frames: Collection[str]) -> FrameSpec:
        """Return the frames without some, and what is right below them."""
        trees = tuple(
            replace(tree, edges=tuple(edge for edge in tree.edges if not {*edge} & {*frames}))
            for tree in self.trees
        )
        edges = tuple(edge for edge in self.edges if not {*edge} & {*frames})
        return replace(self, edges=edges, trees=trees)

    @cached_property
    def roots(self) -> tuple[str, ...]:
        """The frames at the top of what a stage publishes: one for each tree."""
        children = {child for _, child in self.edges}
        first = () if self.localization is None else (self.localization.edge[1],)
        tops = (parent for parent, _ in self.edges if parent not in children)
        return tuple(dict.fromkeys((*first, *tops)))

    @property
    def root(self) -> str:
        """The first frame at the top, '' where a stage publishes none."""
        return next(iter(self.roots), "")

    @property
    def deeper(self) -> tuple[str, ...]:
        """The frames below which others may also be deeper."""
        written = self.deeper_under
        return tuple(filter(None, (written,))) if isinstance(written, str) else written

    @property
    def forbidden_transforms(self) -> tuple[ForbiddenTransform, ...]:
        """The transforms that no node may publish."""
        return self.forbidden if isinstance(self.forbidden, tuple) else (self.forbidden,)

    @cached_property
    def forbidden_names(self) -> frozenset[str]:
        """The usual names of nodes that publish what no node may."""
        return frozenset(name for entry in self.forbidden_transforms for name in entry.nodes)

    @cached_property
    def guarded(self) -> dict[str, str]:
        """The frames that no stage may place: tops that the lab guards, with the sections."""
        said = {entry.child: entry.handout for entry in self.forbidden_transforms}
        localized = () if self.localization is None else (self.localization.edge[1],)
        handout = next(iter(said.values()), self.handout)
        return {
            top: said.get(top, handout) for top in self.roots if top in said or top in localized
        }

    @property
    def above(self) -> str:
        """The frame that localization puts above its root, '' where there is none."""
        return "" if self.localization is None else self.localization.edge[0]

    @property
    def reserved(self) -> dict[str, str]:
        """The root of localization, and the only publisher that may place it; empty for none."""
        return {} if self.localization is None else {self.root: self.localization.by}

    def is_forbidden(self, edge: tuple[str, str]) -> bool:
        """Whether nothing may publish this transform."""
        return any(edge == (entry.parent, entry.child) for entry in self.forbidden_transforms)


class Lab(Struct, frozen=True, eq=False):
    """Everything that the files of a lab say, loaded once.

    `platform` is Isaac Sim, with what the lab adds to its node types.

    `scene` is what a stage holds beside its graphs; `ros` what the running system must show,
    `submission` what is handed in. `points` are what each checkpoint is worth by the lab's rubric.
    `by_team` are the files with values that each team has for itself; they are those of `team`, ''
    for the first one as an example.
    """

    folder: Path
    title: str
    platform: Platform
    graphs: Mapping[str, GraphSpec]
    checkpoints: Mapping[str, Checkpoint]
    policy: Policy
    frames: FrameSpec
    ros: RosSpec
    submission: SubmissionSpec
    handout: Handout
    scene: SceneSpec
    points: Mapping[str, float] = {}
    by_team: tuple[str, ...] = ()
    team: str = ""

    @property
    def first(self) -> str:
        """The first checkpoint: the starter."""
        return next(iter(self.checkpoints))

    @property
    def last(self) -> str:
        """The last checkpoint."""
        return list(self.checkpoints)[-1]

    @property
    def files(self) -> dict[str, str]:
        """The names of the stages, without ending, by checkpoint."""
        return {name: checkpoint.file for name, checkpoint in self.checkpoints.items()}

    @property
    def ids(self) -> dict[str, str]:
        """The ids of the checkpoints, by the keys that the files of the lab refer to."""
        return {checkpoint.key: name for name, checkpoint in self.checkpoints.items()}

    def key_of(self, checkpoint: str) -> str:
        """Return how the files of the lab refer to a checkpoint."""
        point = self.checkpoints.get(checkpoint)
        return checkpoint if point is None else point.key or checkpoint

    def until(self, checkpoint: str) -> tuple[str, ...]:
        """Name the checkpoints up to one of them."""
        order = list(self.checkpoints)
        return tuple(order[: order.index(checkpoint) + 1])

    def reached(self, checkpoint: str) -> tuple[str, ...]:
        """Name the checkpoints whose additions hold at one: no optional one but itself."""
        *before, own = self.until(checkpoint)
        return (*(name for name in before if not self.checkpoints[name].optional), own)

    def added_until(self, checkpoint: str) -> frozenset[str]:
        """Name the graphs and sensors of all checkpoints up to one, of optional ones as well."""
        points = [self.checkpoints[name] for name in self.until(checkpoint)]
        return frozenset(name for point in points for name in (*point.new, *point.new_sensors))

    def same_demands(self, checkpoint: str) -> Checkpoint:
        """Return the first checkpoint that asks of a stage what this one asks: itself for most.

        They differ in what else is handed in with the stage.
        """
        return _same_demands(self, checkpoint)

    def demands(self, checkpoint: Checkpoint) -> tuple[object, ...]:
        """Return everything that the rules for stages ask of a checkpoint."""
        flags = (checkpoint.frames, checkpoint.topics, checkpoint.localization)
        may_have_driven = tuple(
            self.is_after(checkpoint.id, robot.pose_is_error_until) for robot in self.scene.robots
        )
        is_first = checkpoint.id == self.first
        topics = tuple(self.topics_until(checkpoint.id))
        graphs = self.at(checkpoint.id).graphs
        asked = tuple((name, tuple(graphs[name].nodes.values())) for name in checkpoint.graphs)
        removed = (checkpoint.removed, *self.props_at(checkpoint).items())
        return (asked, checkpoint.sensors, topics, flags, may_have_driven, is_first, removed)

    def at(self, checkpoint: str) -> Lab:
        """Return the lab at a checkpoint, without the nodes that later ones add to its graphs."""
        return _at(self, checkpoint)

    def is_after(self, checkpoint: str, earlier: str) -> bool:
        """Whether a checkpoint comes after another; none comes after ''."""
        return earlier != "" and checkpoint not in self.until(earlier)

    @property
    def sensors(self) -> Mapping[str, SensorSpec]:
        """The sensors of the scene file, by the names that checkpoints add them under."""
        return self.scene.sensors

    def frame_of(self, path: str) -> str:
        """Return the TF frame of a prim: the name of the prim, where the lab gives no other."""
        return self.frames.names.get(path, path.rpartition("/")[2])

    def first_sensor(self, kind: str) -> SensorSpec | None:
        """Return the first sensor of a kind in the scene file, None where there is none."""
        return next((sensor for sensor in self.sensors.values() if sensor.kind == kind), None)

    @property
    def lidar_link(self) -> str:
        """The prim at whose height the lab's map is cut: the first lidar's link, '' for none."""
        lidar = self.first_sensor("lidar")
        return "" if lidar is None else lidar.path.rpartition("/")[0]

    @property
    def topics(self) -> Mapping[str, TopicSpec]:
        """The topics of the running system by name, with their message types and QoS."""
        return self.ros.topics

    def props_at(self, checkpoint: Checkpoint) -> dict[str, PropSpec]:
        """Return the things of the scene at a checkpoint, without those that it has removed."""
        reached = (FROM_THE_FIRST, *self.reached(checkpoint.id))
        props = self.scene.props.items()
        there = ((name, prop) for name, prop in props if prop.since in reached)
        order = [*self.checkpoints]
        coming = order[order.index(checkpoint.id) :]
        kept = ((name, prop) for name, prop in there if not checkpoint.is_removed(prop.path))
        return {name: prop.before(coming) for name, prop in kept}

    def topics_until(self, checkpoint: str) -> dict[str, TopicSpec]:
        """Return the topics that are there by a checkpoint."""
        reached = (FROM_THE_FIRST, *self.reached(checkpoint))
        silent = self.checkpoints[checkpoint].silent
        topics = self.topics.items()
        return {name: t for name, t in topics if t.since in reached and name not in silent}


@lru_cache(maxsize=64)
def _same_demands(lab: Lab, checkpoint: str) -> Checkpoint:
    demands = lab.demands(lab.checkpoints[checkpoint])
    return next(other for other in lab.checkpoints.values() if lab.demands(other) == demands)


@lru_cache(maxsize=64)
def _at(lab: Lab, checkpoint: str) -> Lab:
    reached = ("", *lab.reached(checkpoint))
    # Sensors of earlier checkpoints may have been left out.
    left_out = lab.added_until(checkpoint).difference(lab.checkpoints[checkpoint].sensors)
    skipped = tuple(sensor.path for name, sensor in lab.sensors.items() if name in left_out)
    graphs = {}
    for name, graph in lab.graphs.items():
        later = [role for role, node in graph.nodes.items() if node.since not in reached]
        there = graph.without(later) if later else graph
        earlier = {
            role: _without_targets(_values_at(lab, node, checkpoint), skipped)
            for role, node in there.nodes.items()
        }
        if any(earlier[role] is not node for role, node in there.nodes.items()):
            there = replace(there, nodes=earlier)
        graphs[name] = there
    frames = {*map(lab.frame_of, skipped), *lab.checkpoints[checkpoint].unsent}
    left = lab.frames.without(frames)
    if graphs == lab.graphs and len(left.edges) == len(lab.frames.edges):
        return lab
    return replace(lab, graphs=graphs, frames=left)


def _without_targets(node: NodeSpec, prims: Collection[str]) -> NodeSpec:
    """Return a node whose lists of targets may name some prims, and need not."""
    targets = []
    for target in node.targets:
        kept = tuple(prim for prim in target.prims if prim not in prims)
        optional = tuple(prim for prim in target.prims if prim in prims)
        is_changed = bool(kept and optional)
        targets.append(replace(target, prims=kept, optional=optional) if is_changed else target)
    return node if targets == [*node.targets] else replace(node, targets=tuple(targets))


def _values_at(lab: Lab, node: NodeSpec, checkpoint: str) -> NodeSpec:
    """Return a node with the values that it has at a checkpoint."""
    for last, earlier in node.until.items():
        if not lab.is_after(checkpoint, last):
            return node.with_values(earlier)
    return node


def articulated_at_roots(lab: Lab, robots: Collection[RobotSpec]) -> Lab:
    """Return the lab for a stage whose articulation roots are on the roots of robots.

    Isaac Sim looks for an articulation at the target prim and below, never above: there, the
    handout's target finds none, and the robot root is the target instead.
    """
    if not robots:
        return lab
    roots = {(robot.articulation.target,): (robot.path,) for robot in robots}
    graphs = {}
    for name, graph in lab.graphs.items():
        nodes = {}
        for role, node in graph.nodes.items():
            targets = tuple(
                replace(target, prims=roots[target.prims], handout_prims=target.prims)
                if target.port in node.type.articulation and target.prims in roots
                else target
                for target in node.targets
            )
            nodes[role] = replace(node, targets=targets)
        graphs[name] = replace(graph, nodes=nodes)
    return replace(lab, graphs=graphs)
