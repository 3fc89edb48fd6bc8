"""Repairs that rules share: what makes a property of a node right, and what undoes a node."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import GraphSubject, StageSubject
from lab3_usd.facts.likely_names import likely_port
from lab3_usd.facts.wires import connections
from lab3_usd.isaac.names import origin
from lab3_usd.isaac.node_types import INPUT, NodeType, Port
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import order
from lab3_usd.model.changes import (
    Activate,
    ClearValue,
    Connect,
    Edit,
    MovePrim,
    RemovePrim,
    RenameProperty,
    Restore,
    Retarget,
    SetValue,
)
from lab3_usd.model.finding import Problem, Severity
from lab3_usd.model.stage import GraphModel, Node, StageModel, UnresolvedAsset

TYPE, VERSION = "node:type", "node:typeVersion"


def can_become(node: Node, kind: NodeType, stage: StageModel) -> bool:
    """Whether a node of another type would keep all of its wires, and what stands below it.

    A compound is what stands below it, whatever it is called.
    """
    if is_compound(node, stage):
        return False
    inputs = (name for name, state in node.ports.items() if state.sources)
    outputs = (wire.source_port for wire in connections(stage) if wire.source is node)
    return all(kind.port(name) is not None for name in (*inputs, *outputs))


def restoration(path: str, stage: StageModel) -> Edit:
    """Return what brings back an absent prim: one that is only deactivated is activated."""
    prim = stage.prims.get(path)
    return Restore(path) if prim is None or prim.active else Activate(path)


def moved_back(problem: Problem, path: str, places: tuple[str, ...]) -> Problem:
    """Return the problem of an absent prim, which seems to be the one at the first of `places`."""
    if not places:
        return problem
    return replace(
        problem,
        message=f"{problem.message}; it seems to be the prim at {places[0]}",
        related=places,
        hint=f"rename or drag {places[0]} back to {path} in the Stage panel",
        fix=(MovePrim(places[0], path),) if len(places) == 1 else (),
    )


def restorable(
    problem: Problem,
    handout: str,
    *unmet: str,
    related: tuple[str, ...] = (),
    rests_on: UnresolvedAsset | None = None,
) -> Problem:
    """Return a problem of a property with what asks for that, and the property restored.

    `unmet` are the requirements that it fails.
    """
    fix = problem.fix or (Restore(problem.prim, problem.property),)
    return replace(
        problem, handout=handout, unmet=unmet, related=related, rests_on=rests_on, fix=fix
    )


def is_compound(node: Node, stage: StageModel) -> bool:
    """Whether a node holds a graph, which does its work."""
    return any(graph.path.startswith(f"{node.path}/") for graph in stage.graphs)


def folded_into_readers(node: Node, stage: StageModel) -> tuple[Edit, ...]:
    """Return what gives the targets of a node to those that read it, and removes the node.

    Nothing where a node reads it that does not do the same by itself.
    """
    fold = stage.platform.changes.folds.get(node.type_name)
    readers = dict.fromkeys(
        wire.node.path for wire in connections(stage) if wire.source_prim == node.path
    )
    nodes = [reader for reader in stage.nodes() if reader.path in readers]
    if fold is None or not nodes or any(reader.type_name != fold.into for reader in nodes):
        return ()
    edits: list[Edit] = []
    for reader in nodes:
        for own, theirs in fold.targets.items():
            if node.targets(INPUT + own):
                edits.append(Retarget(reader.path, INPUT + theirs, node.targets(INPUT + own)))
        for name, state in reader.ports.items():
            kept = [path for path in state.sources if not path.startswith(f"{node.path}.")]
            if len(kept) < len(state.sources):
                port = None if reader.type is None else reader.type.port(name)
                if port is not None and port.is_execution:
                    # What triggers the node, whose type another release has.
                    kind = stage.platform.base.get(node.type_name)
                    signals = () if kind is None else kind.execution_inputs
                    kept += [path for signal in signals for path in node.sources(signal)]
                usd_type = "token" if port is None else port.usd_type
                edits.append(Connect(reader.path, name, usd_type, tuple(dict.fromkeys(kept))))
    return (*edits, RemovePrim(node.path))


def edits_at(subject: GraphSubject, *properties: str) -> tuple[Edit, ...]:
    """Return what makes properties right, given by their paths, of nodes that play a role."""
    retyped = {node.path: role for role, node in subject.roles.retyped.items()}
    edits: list[Edit] = []
    for path in properties:
        prim, _, name = path.partition(".")
        role, node = (
            subject.roles.role_of.get(prim, retyped.get(prim)),
            subject.live_nodes.get(prim),
        )
        if role is not None and node is not None:
            edits += _property_edits(subject, role, node, name)
    return tuple(edits)


def edits_in_stage(whole: StageSubject, prim: str, name: str | None) -> tuple[Edit, ...]:
    """Return what makes a property of a node right by every graph in which it plays a role."""
    graphs = whole.graphs if name else ()
    return tuple(edit for subject in graphs for edit in edits_at(subject, f"{prim}.{name}"))


def removal_or_repair(
    whole: StageSubject, prim: str, name: str | None = None, severity: Severity | None = None
) -> tuple[Edit, ...]:
    """Return the edits that undo what a node does: one without a role is removed if it is sure."""
    played = (
        path
        for roles in whole.roles.values()
        for path in (*roles.role_of, *(node.path for node in roles.retyped.values()))
    )
    is_removed = severity in {None, "error"} and prim not in played
    return (RemovePrim(prim),) if is_removed else edits_in_stage(whole, prim, name)


def _property_edits(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[Edit]:
    """Yield what makes one property of a node right; nothing where it is."""
    spec = subject.spec.nodes[role]
    port = spec.type.port(name)
    if name in {TYPE, VERSION}:
        if is_compound(node, subject.stage):
            return
        if node.saved_type != spec.type.type:
            yield SetValue(node.path, TYPE, "token", spec.type.type)
        if node.version != spec.type.version:
            yield SetValue(node.path, VERSION, "int", spec.type.version)
    elif port is None:
        # The port was likely meant to be one that the type has; else it is not connected.
        likely = likely_port(name, [*spec.type.ports])
        if likely is not None and _misspelt(spec.type, node, likely) == name:
            yield from _property_edits(subject, role, node, likely)
        elif node.sources(name):
            yield Connect(node.path, name, "token")
    elif port.is_target:
        expected = next((target.prims for target in spec.targets if target.port == name), ())
        if node.targets(name) != expected:
            yield Retarget(node.path, name, expected)
    else:
        written = _misspelt(spec.type, node, name)
        if written is not None:
            yield RenameProperty(node.path, written, name)
        sources = tuple(_sources(subject, role, node, name))
        if node.sources(name) != sources:
            yield Connect(node.path, name, port.usd_type, sources)
        yield from _value_edits(subject, role, node, port)


class OtherNames(Struct, frozen=True, eq=False):
    """The nodes of a graph that have names of one release, and the first such name.

    `what` says in words which names of which release they are, `known` is what the name means.
    Where this release does not know them, and does not rename them either, they are `is_unknown`.
    """

    nodes: tuple[Node, ...]
    what: str
    written: str
    known: str
    edits: tuple[Edit, ...] = ()
    is_unknown: bool = False

    @property
    def count(self) -> str:
        """How many nodes there are, in words."""
        return "1 node" if len(self.nodes) == 1 else f"{len(self.nodes)} nodes"


def other_names(graph: GraphModel, platform: Platform) -> Iterator[OtherNames]:
    """Yield the names of other releases that nodes of a graph have, for types and then for ports.

    Names that the release by which the stage is judged has, too, are no other names.
    """
    is_early = order(platform.release) < order(platform.names.before)
    if is_early:
        yield from _new_names(graph, platform)
    types: dict[str, list[Node]] = {}
    ports: dict[str, list[tuple[Node, str, str]]] = {}
    for node in graph.nodes if graph.active else ():
        port_names = platform.other_ports(node.type_name)
        if node.type is not None and node.written_type:
            type_name = platform.names.types.get(node.written_type)
            if type_name is None and is_early:
                continue  # it has the names of this release
            if type_name is None or not platform.is_own(type_name.release):
                types.setdefault(platform.names.origin(node.written_type), []).append(node)
        for name, written in node.written_ports.items():
            release = port_names[written].release
            if name in node.ports and not platform.is_own(release):
                ports.setdefault(origin(release), []).append((node, written, name))
    for where, nodes in types.items():
        # A file with names of a later release is left to that: here it would lose them.
        is_later = getattr(platform.names.types.get(nodes[0].written_type), "release", "")
        edits = (
            ()
            if is_later
            else (SetValue(node.path, TYPE, "token", node.type_name) for node in nodes)
        )
        what = f"{'a type name' if len(nodes) == 1 else 'type names'} {where}"
        first = nodes[0]
        yield OtherNames(tuple(nodes), what, first.saved_type, first.type_name, tuple(edits))
    for where, uses in ports.items():
        _, written, name = uses[0]
        nodes = list({node.path: node for node, _, _ in uses}.values())
        what = f"{'a port name' if len(uses) == 1 else 'port names'} {where}"
        yield OtherNames(tuple(nodes), what, written, name)


def _new_names(graph: GraphModel, platform: Platform) -> Iterator[OtherNames]:
    """Yield the names of types that a release before the last renaming does not have."""
    former = {
        node.path: (node, name)
        for node in (graph.nodes if graph.active else ())
        if node.type is not None and not node.written_type
        if (name := platform.names.former(node.type_name)) is not None
    }
    if former:
        nodes = tuple(node for node, _ in former.values())
        what = "a type name" if len(nodes) == 1 else "type names"
        yield OtherNames(
            nodes,
            f"{what} of Isaac Sim {platform.names.before} and later",
            nodes[0].type_name,
            former[nodes[0].path][1],
            tuple(SetValue(path, TYPE, "token", name) for path, (_, name) in former.items()),
            is_unknown=True,
        )


def _misspelt(kind: NodeType, node: Node, name: str) -> str | None:
    """Return the property that was likely meant to be a port which the node does not have."""
    unknown = [port for port in node.ports if kind.port(port) is None]
    written = likely_port(name, unknown) if name not in node.ports else None
    return written if written and likely_port(written, [*kind.ports]) == name else None


def _sources(subject: GraphSubject, role: str, node: Node, name: str) -> Iterator[str]:
    """Yield what an input should be connected to; an optional connection stays."""
    from lab3_usd.check.match.conformance import source_path

    for wire in (*subject.spec.wires, *subject.spec.optional_wires):
        source = subject.roles.node_of[wire.source.role]
        if (wire.target.role, wire.target.port) == (role, name) and source is not None:
            path = source_path(source, wire)
            if wire in subject.spec.wires or path in node.sources(name):
                yield path


def _value_edits(subject: GraphSubject, role: str, node: Node, port: Port) -> Iterator[Edit]:
    from lab3_usd.check.match.conformance import setting_matches

    spec, state = subject.spec.nodes[role], node.state(port.name)
    setting = next((asked for asked in spec.settings if asked.port == port.name), None)
    if setting is not None:
        is_typed = state is None or state.usd_type in {"", port.usd_type}
        if not is_typed or not setting_matches(node, setting, node.value(port.name)):
            yield SetValue(node.path, port.name, port.usd_type, setting.value)
        return
    # The handout does not set this input; a value below a connection does no harm.
    is_connected = any(wire.target.port == port.name for wire in subject.spec.wires_into(role))
    if not is_connected and state is not None and state.value not in (None, port.default):
        yield ClearValue(node.path, port.name)
