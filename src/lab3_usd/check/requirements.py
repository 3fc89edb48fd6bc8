"""What a checkpoint asks for, item by item, and which items a stage meets."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import lru_cache

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.lab_frames import (
    TfView,
    differs_from_spec,
    frame_sources,
    lacks_only_the_camera,
    missing_frames,
    tf_views,
    unknown_frame,
)
from lab3_usd.check.match.conformance import (
    Found,
    is_fed,
    is_variable_met,
    settings_of,
    target_matches,
)
from lab3_usd.check.match.rule_inputs import GraphSubject, StageSubject
from lab3_usd.check.message_suffixes import is_idle_choice
from lab3_usd.check.registry import TF, Demand, Demands, frame_places, in_tree, scene_demands
from lab3_usd.check.repairs import TYPE
from lab3_usd.check.robot.location import relocated_path
from lab3_usd.check.robot.sensors import sensor_group
from lab3_usd.facts.tree import tree_of
from lab3_usd.model.finding import Finding, Requirement, display, role_title
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import GraphModel, Node, once_per_stage
from lab3_usd.spec.graph import GraphSpec, Setting, Target, Variable, Wire
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.scene import SCENE_GROUP

_Expected = Setting | Target | Wire | Variable


class _GraphItem(Struct, frozen=True):
    """One thing asked of a graph, and the requirement that it is when it is met.

    `expected` is what the node with this role must have, None where it must only exist.
    """

    role: str
    expected: _Expected | None
    met: Requirement

    @property
    def port(self) -> str:
        """The property that it is about; '' for the node itself."""
        if isinstance(self.expected, Wire):
            return self.expected.target.port
        if isinstance(self.expected, Variable):
            return self.expected.attribute
        return "" if self.expected is None else self.expected.port


def graph_requirements(subject: GraphSubject) -> Iterator[Requirement]:
    """Yield every node, setting, target and wire of one graph, met or not."""
    settings = {(each.spec.role, each.setting.port): each for each in settings_of(subject)}
    nested = nested_nodes(subject)
    for item in _items_of(subject):
        expected, graph = item.expected, subject.roles.graph
        node, is_slight = subject.roles.node_of.get(item.role), False
        if type(expected) is Variable:
            is_met = graph is not None and is_variable_met(graph, expected)
        elif node is None:
            is_met = False
        elif type(expected) is Wire:
            source = subject.roles.node_of[expected.source.role]
            equivalents = subject.roles.equivalents
            is_met = source is not None and is_fed(source, node, expected, equivalents)
        elif type(expected) is Setting:
            judged = settings[item.role, expected.port]
            is_met = judged.met
            is_slight = not is_met and _is_slight(subject, judged)
        else:
            is_met = type(expected) is not Target or target_matches(node, expected)
        if not is_met:
            yield replace(item.met, met=False, slight=is_slight)
        else:
            yield replace(item.met, judged=False) if item.role in nested else item.met


@once_per_stage
def nested_nodes(subject: GraphSubject) -> dict[str, Node]:
    """Return the nodes of roles, by role, that are no direct children of a graph.

    Whether Isaac Sim runs them is unknown.
    """
    graphs = {path for graph in subject.stage.graphs for path in (graph.path, *graph.inner)}
    matched = subject.matched
    return {spec.role: node for node, spec in matched if node.path.rpartition("/")[0] not in graphs}


def _items_of(subject: GraphSubject) -> list[_GraphItem]:
    spec, lab = subject.spec, subject.lab
    is_of_lab = lab.graphs.get(spec.name) is spec  # else it reads as one that stands elsewhere
    return _lab_items(lab, spec.name) if is_of_lab else _graph_items(spec)


@lru_cache(maxsize=64)
def _lab_items(lab: Lab, graph: str) -> list[_GraphItem]:
    """Return what a lab asks of a graph, which is the same for every stage."""
    return _graph_items(lab.graphs[graph])


def _graph_items(graph: GraphSpec) -> list[_GraphItem]:
    items = []
    for variable in graph.variables:
        title = f"variable {variable.name} = {display(variable.value)}"
        name = f"variable/{variable.name}"
        items.append(_item(graph.name, name, title, variable.handout, "", variable))
    for role, spec in graph.nodes.items():
        node = role_title(spec)
        items.append(_item(graph.name, f"node/{role}", node, spec.handout, role))
        for setting in spec.settings:
            short = setting.port.partition(":")[2]
            name, title = f"setting/{role}.{short}", f"{node}: {short} = {display(setting.value)}"
            items.append(_item(graph.name, name, title, setting.handout, role, setting))
        for target in spec.targets:
            if target.port not in spec.frames_from:
                short = target.port.partition(":")[2]
                name, title = (
                    f"target/{role}.{short}",
                    f"{node}: {short} = {', '.join(target.prims)}",
                )
                items.append(_item(graph.name, name, title, target.handout, role, target))
    for wire in graph.wires:
        name, title = f"wire/{wire.target.short}", str(wire)
        items.append(_item(graph.name, name, title, wire.handout, wire.target.role, wire))
    return items


def _item(
    graph: str, name: str, title: str, handout: str, role: str, expected: _Expected | None = None
) -> _GraphItem:
    kind = name.partition("/")[0]
    met = Requirement(f"{graph}/{name}", graph, kind, title, met=True, handout=handout)
    return _GraphItem(role, expected, met)


def _is_slight(subject: GraphSubject, judged: Found) -> bool:
    """Whether the robot does the same with the wrong value that is there.

    A number is so near that a dry run finds its effect right, even beside that of another. Each
    conversion between metres and the unit of the stage leaves metres as they are.
    """
    value, wanted = judged.value, judged.setting.value
    if not isinstance(wanted, float):
        return is_idle_choice(subject, judged.spec.role, judged.setting, value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    from lab3_usd.model.dry_run import FOLLOWS

    return math.isclose(value, wanted, rel_tol=FOLLOWS / 2)


def demands_of(lab: Lab, checkpoint: Checkpoint) -> tuple[Demand, ...]:
    """Return what the rules demand of the scene, prim by prim in the order of the scene file."""
    return _in_order(lab, checkpoint, scene_demands())


@lru_cache(maxsize=16)
def _in_order(lab: Lab, checkpoint: Checkpoint, stated: tuple[Demands, ...]) -> tuple[Demand, ...]:
    robots = lab.scene.robots
    joints = (robot.joint_path(name) for robot in robots for name in robot.wheels.joints)
    links = (path for robot in robots for path in (robot.path, *robot.link_paths))
    sensors = (lab.sensors[name].path for name in checkpoint.sensors)
    parent = lab.scene.world.graph_parent
    parts = ["/", *([] if parent is None else [parent.path]), *links, "assembly"]
    parts += [*joints, "world", "starter", *sensors]
    places = {part: number for number, part in enumerate(parts)}
    demands = (demand for demands in stated for demand in demands(lab, checkpoint))
    return tuple(
        sorted(demands, key=lambda demand: places.get(demand.part or demand.prim, len(places)))
    )


def with_unmet(findings: Iterable[Finding], subject: StageSubject, lab: Lab) -> Iterator[Finding]:
    """Yield the findings; what says that a prim is absent fails all that is asked of it and below.

    The demands read as in `lab`, whose prims are looked up where they really stand.
    """
    for finding in findings:
        gone = [demand.id for _, demand in _demands_below(finding, subject, lab)]
        yield replace(finding, unmet=(*finding.unmet, *gone)) if gone else finding


def _demands_below(
    finding: Finding, subject: StageSubject, lab: Lab
) -> Iterator[tuple[str, Demand]]:
    """Yield what is asked of a prim that is absent and of those below it, with their paths."""
    robots = [robot.path for robot in lab.scene.robots]
    for demand in demands_of(lab, subject.checkpoint) if finding.absent else ():
        path = _actual_path(demand.prim, robots, subject.relocations)
        if is_at_or_below(path, finding.prim):
            yield path, demand


def scene_requirements(lab: Lab, checkpoint: Checkpoint) -> Iterator[Requirement]:
    """Yield what is demanded of the scene, as it is met."""
    for each in demands_of(lab, checkpoint):
        yield Requirement(each.id, each.group, "scene", each.title, met=True, handout=each.handout)


def with_named_faults(
    requirements: Iterable[Requirement], findings: Iterable[Finding]
) -> list[Requirement]:
    """Return the requirements, those that errors name as unmet."""
    unmet = unmet_by(findings)
    return [
        replace(requirement, met=False, slight=False) if requirement.id in unmet else requirement
        for requirement in requirements
    ]


def unmet_by(findings: Iterable[Finding]) -> set[str]:
    """Return the ids of the requirements that errors fail."""
    errors = (finding for finding in findings if finding.severity == "error")
    return {name for finding in errors for name in finding.unmet}


def _actual_path(path: str, robots: Collection[str], relocations: Mapping[str, str]) -> str:
    """Return the path of a prim of the lab; for a link that was moved, the path it should have."""
    for expected, actual in relocations.items():
        if path == expected and expected not in robots:
            return path
        path = relocated_path(path, {expected: actual})
    return path


def frame_requirements(subject: StageSubject) -> Iterator[Requirement]:
    """Yield every TF edge that the checkpoint asks the stage to publish.

    One that a missing asset may hold, or that the handout's own way does not give, costs nothing.
    """
    if not subject.checkpoint.frames:
        return
    trees = subject.lab.frames.trees or (None,)
    for tree, view in zip(trees, tf_views(subject), strict=True):
        spec, waived = view.subject.lab.frames, _waived_frames(view)
        heard = tree_of(view.edges)
        published = {(edge.parent, edge.child) for edge in view.edges}
        where = "" if tree is None else f" on {tree.topic}"
        for parent, child in spec.edges:
            met = (parent, child) in published or child in waived
            met = met or (parent in spec.deeper and parent in heard.above(child))
            title = f"{parent} -> {child} is published{where}"
            ((place, _),) = frame_places(child)
            name = place if tree is None else in_tree(place, tree.topic)
            yield Requirement(name, TF, "frame", title, met, spec.handout)


def _waived_frames(view: TfView) -> set[str]:
    """Return the required frames whose absence is no fault.

    Those are the ones that a missing asset may hold, and those that F9 itself loses.
    """
    waived: set[str] = set()
    for maker in frame_sources(view):
        if not differs_from_spec(view, maker.node.path):
            given = (frame for frame in maker.prims if unknown_frame(frame, maker, view))
            waived.update(given)
            if lacks_only_the_camera(maker, view):
                waived.update(missing_frames(maker, view))
    return waived - set(view.children)


def with_costs(
    findings: Collection[Finding], subjects: Iterable[GraphSubject], lab: Lab
) -> Iterator[Finding]:
    """Yield the findings with the requirements of graphs that they fail, and the parts they cost.

    A finding about a property fails the requirements of that property; one about a missing node,
    all requirements of the node; one about a missing graph, all requirements of the graph.
    """
    subjects = tuple(subjects)
    sites: dict[tuple[str, str | None], list[str]] = {}
    of_node: dict[str, list[str]] = {}
    costly = any(finding.severity != "note" for finding in findings)
    for subject in subjects if costly else ():
        roles, name = subject.roles, subject.spec.name
        for item in _items_of(subject):
            of_node.setdefault(f"{name}/node/{item.role}", []).append(item.met.id)
            node, retyped = roles.node_of.get(item.role), roles.retyped.get(item.role)
            if roles.graph is None:
                sites.setdefault((subject.spec.path, None), []).append(item.met.id)
            elif type(item.expected) is Variable:
                sites.setdefault((roles.graph.path, item.port), []).append(item.met.id)
            elif retyped is not None:
                sites.setdefault((retyped.path, TYPE), []).append(item.met.id)
            elif node is not None and item.expected is not None:
                sites.setdefault((node.path, item.port), []).append(item.met.id)
    for finding in findings:
        named = [name for unmet in finding.unmet for name in of_node.get(unmet, [unmet])]
        related = (path.rpartition(".")[::2] for path in finding.related if "." in path)
        for site in ((finding.prim, finding.property), *related):
            named += sites.get(site, [])
        unmet = tuple(dict.fromkeys(named))
        costs = finding.costs or _parts_at(finding, subjects, lab)
        yield replace(finding, unmet=unmet, costs=costs)


def _parts_at(finding: Finding, subjects: Iterable[GraphSubject], lab: Lab) -> tuple[str, ...]:
    """Return the graph or sensor that holds the prim of a finding, or a related one; else Scene."""
    places = {
        subject.spec.name: subject.spec.path
        if subject.roles.graph is None
        else subject.roles.graph.path
        for subject in subjects
    }
    places |= {sensor_group(lab, name): sensor.path for name, sensor in lab.sensors.items()}
    for prim in (finding.prim, *finding.related):
        for part, path in places.items():
            if is_at_or_below(prim, path):
                return (part,)
    robot = lab.scene.robot_of(finding.prim)
    if robot is not None:
        return (robot.group,)
    return (SCENE_GROUP,) if finding.supplied else ()


def with_other_faults(
    requirements: Iterable[Requirement],
    findings: Iterable[Finding],
    graphs: Mapping[str, GraphModel | None],
) -> tuple[Requirement, ...]:
    """Where all requirements are met, add one for each part that has errors all the same.

    A graph at another path, or a second one beside it, is a fault although every node is there: a
    stage that fails has not met everything. `graphs` are the graphs of the stage by their names in
    the lab; what lies in none of them is of the scene.
    """
    required = tuple(requirements)
    errors = [finding for finding in findings if finding.severity == "error"]
    if not (errors and all(requirement.met for requirement in required)):
        return required
    added: dict[str, Requirement] = {}
    for finding in errors:
        group = _group_of(finding, graphs)
        title = f"nothing else is wrong: {finding.rule} {finding.name}"
        item = f"{group}/other/{finding.rule}"
        added.setdefault(
            group, Requirement(item, group, "scene", title, met=False, handout=finding.handout)
        )
    return (*required, *added.values())


def with_unknown(
    requirements: tuple[Requirement, ...],
    left_open: Collection[Finding],
    subject: StageSubject,
    lab: Lab,
) -> tuple[Requirement, ...]:
    """Return the requirements; those that fail only because of something unknown are not judged.

    What the stage defines below a prim that may be absent is judged as it is written.
    """
    errors = [finding for finding in left_open if finding.severity == "error"]
    unknown = unmet_by(with_costs(errors, subject.graphs, lab))
    for finding in errors:
        below = _demands_below(finding, subject, lab)
        unknown |= {demand.id for path, demand in below if subject.stage.prim(path) is None}
    return tuple(
        replace(item, judged=False) if item.met and item.id in unknown else item
        for item in requirements
    )


def _group_of(finding: Finding, graphs: Mapping[str, GraphModel | None]) -> str:
    for prim in (finding.prim, *finding.related):
        for name, graph in graphs.items():
            if graph is not None and is_at_or_below(prim, graph.path):
                return name
    return SCENE_GROUP
