"""Reads a composed stage into plain data, in one traversal."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace
from pxr import Usd

from lab3_usd.errors import StageError
from lab3_usd.isaac.graph_form import VARIABLE
from lab3_usd.isaac.messages import with_named_message
from lab3_usd.isaac.names import OtherName
from lab3_usd.isaac.node_types import INPUT, OUTPUT, NodeType
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.topics import PRODUCT
from lab3_usd.isaac.values import Value
from lab3_usd.model.compounds import opened_nodes
from lab3_usd.model.stage import (
    DEACTIVATED,
    OVER,
    AbsentPrim,
    GraphModel,
    GraphVariable,
    Node,
    OldType,
    PortState,
    RenderProduct,
    Script,
    StageModel,
)
from lab3_usd.stage.read.assets import (
    EVERYTHING,
    IS_PRESENT,
    find_muted,
    find_unresolved,
    is_defined_in,
    is_in_asset,
    is_in_scene,
)
from lab3_usd.stage.read.colliders import StageColliders
from lab3_usd.stage.read.details import StageDetails
from lab3_usd.stage.read.opening import cached, held, open_stage, quiet, stage_errors
from lab3_usd.stage.read.prims import PrimIndex, PrimReader, StagePrims
from lab3_usd.stage.read.properties import (
    CENTIMETRES,
    RELATIONSHIP,
    AuthoredProperties,
    AuthoredProperty,
    authored_data,
    changes_after_start,
    compounds_in,
    plain_value,
    stage_number,
)

if TYPE_CHECKING:
    from lab3_usd.model.dry_run import Scene

_POSITION = "ui:nodegraph:node:pos"
_NAMESPACE = "isaac:namespace"
_CAMERA, _RESOLUTION = "camera", "resolution"
_NODE_TYPE, _VERSION = "node:type", "node:typeVersion"


def read_stage(path: Path | str, platform: Platform) -> StageModel:
    """Read the stage at `path` as it is composed, payloads loaded.

    Raises:
        StageError: the file cannot be opened; the line says why.
    """
    return read_model(open_stage(Path(path)), platform, str(path))


@quiet()
def read_model(stage: Usd.Stage, platform: Platform, path: str) -> StageModel:
    """Read an open stage; `path` is the name it goes by.

    Raises:
        StageError: the file is damaged in a way that shows only now.
    """
    with stage_errors(path):
        key = ("model", id(stage), platform)
        return cached(key, lambda: _read_model(held(stage), platform, path))


def _read_model(stage: Usd.Stage, platform: Platform, path: str) -> StageModel:
    unresolved = tuple(find_unresolved(stage))
    hidden = tuple(dict.fromkeys(missing.prim for missing in unresolved))
    scan = _Scan(stage, platform, hidden)
    scan.run()
    scan.open_compounds()
    scan.settle_names()
    reader = PrimReader(stage, path, hidden, platform)
    prims = StagePrims(reader, platform.graph, scan.others)
    kilograms = stage.GetPseudoRoot().GetMetadata("kilogramsPerUnit")
    default = stage.GetDefaultPrim()
    return StageModel(
        platform=platform,
        up_axis=str(stage.GetMetadata("upAxis")),
        meters_per_unit=stage_number(stage.GetMetadata("metersPerUnit"), CENTIMETRES),
        kilograms_per_unit=stage_number(kilograms, 1.0),  # which UsdPhysics assumes
        graphs=tuple(scan.graph(path) for path in scan.graphs),
        prims=prims,
        orphans=tuple(scan.nodes[""]),
        absent=tuple(scan.absent[""]),
        unresolved=unresolved,
        colliders=StageColliders(prims, reader),
        muted=tuple(find_muted(stage)),
        default_prim=str(default.GetPath()) if default else "",
        instances=frozenset(scan.instances),
        overridden=tuple(scan.overridden),
        scripts=tuple(scan.scripts),
        moving=changes_after_start(stage),
        products=_named_products(stage, scan),
        old_types=tuple(scan.old_types),
        scene=lambda: _scene(stage, platform, path),
        details=StageDetails(reader),
    )


def _scene(stage: Usd.Stage, platform: Platform, path: str) -> Scene:
    from lab3_usd.stage.read.scene import read_scene  # which few stages need

    with stage_errors(path):
        return read_scene(stage, platform)


def _named_products(stage: Usd.Stage, scan: _Scan) -> dict[str, RenderProduct]:
    """Return the render products that nodes name, also those that the application ignores."""
    nodes: dict[NodeType, list[Node]] = {}
    for node in chain.from_iterable(scan.nodes.values()):
        if node.type is not None:
            nodes.setdefault(node.type, []).append(node)
    named: list[object] = []
    for kind, members in nodes.items():
        ports = [name for name in kind.ports if name.startswith(PRODUCT)]
        named += (node.value(port) for node in members for port in ports)
        if kind.product is not None:
            named += (path for node in members for path in node.targets(kind.product.named))
    products = {}
    for path in (path for path in named if isinstance(path, str) and path.startswith("/")):
        prim = stage.GetPrimAtPath(path)
        if prim:
            properties = AuthoredProperties(prim)
            camera, size = properties[_CAMERA].targets(), properties[_RESOLUTION].value()
            pixels = size if isinstance(size, tuple) else ()
            products[path] = RenderProduct(
                path,
                next(iter(camera), ""),
                tuple(number for number in pixels if isinstance(number, int)),
            )
    return products


class _Scan:
    """One traversal: reads graphs and their nodes, and notes which other prims there are.

    `nodes` and `absent` are by the path of their graph, '' for those outside every graph.
    """

    def __init__(self, stage: Usd.Stage, platform: Platform, hidden: tuple[str, ...]) -> None:
        self._stage = stage
        self._platform = platform
        self._hidden = hidden
        self._place = partial(_place, stage)
        self._own_layers = stage.GetLayerStack() if hidden else ()
        self.others = PrimIndex()
        self.graphs: dict[str, Usd.Prim] = {}
        self.nodes: dict[str, list[Node]] = {"": []}
        self.absent: dict[str, list[AbsentPrim]] = {"": []}
        self.scripts: list[Script] = []
        self.instances: set[str] = set()
        self.overridden: list[str] = []
        self.old_types: list[OldType] = []
        self._inner: dict[str, tuple[str, ...]] = {}
        self._namespaces: dict[str, tuple[str, ...]] = {"/": ()}
        self._types: dict[str, tuple[str, NodeType | None, Mapping[str, OtherName]]] = {}

    def run(self) -> None:
        """Look at every prim; at those that the application made for itself only for scripts."""
        form = self._platform.graph
        for top in self._stage.GetPseudoRoot().GetFilteredChildren(EVERYTHING):
            if not top.IsAbstract():  # classes are judged where they are inherited
                self._tree(top, is_ignored=form.ignores(str(top.GetPath())))
        if self._stage.GetPrototypes():
            outside = Usd.PrimRange(self._stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate)
            self.instances |= {str(prim.GetPath()) for prim in outside if prim.IsInstance()}

    def open_compounds(self) -> None:
        """Let the nodes in compounds be nodes of the graphs around them."""
        nodes = [node for members in self.nodes.values() for node in members]
        types = {node.path: node.type_name for node in nodes}
        compound = self._platform.building.compound
        compounds = compounds_in(self._stage, self.graphs, types, compound)
        if compounds.graphs:
            graphs = [*self.nodes]
            self._inner = {path: compounds.within(path, graphs) for path in graphs}
            compounds.move(self.nodes)
            compounds.move(self.absent)
            self.graphs = {path: at for path, at in self.graphs.items() if path in self.nodes}
            opened = {node.path: node for node in opened_nodes(nodes, compounds)}
            for graph, members in self.nodes.items():
                self.nodes[graph] = [opened[node.path] for node in members if node.path in opened]

    def settle_names(self) -> None:
        """Let wires leave from ports by their own names, and note what a file calls the others.

        A file that has names of a release has them for the ports that it leaves out, too.
        """
        names = self._platform.names
        if not names.ports:
            return
        nodes = {node.path: node for graph in self.nodes.values() for node in graph}
        port_names = {
            path: self._platform.other_ports(node.type_name) for path, node in nodes.items()
        }
        releases = set(self._releases(nodes, port_names))
        for graph, members in self.nodes.items() if releases else ():
            self.nodes[graph] = [_settled(node, port_names, releases) for node in members]

    def _releases(
        self, nodes: Mapping[str, Node], port_names: Mapping[str, Mapping[str, OtherName]]
    ) -> Iterator[str]:
        """Yield the releases whose names nodes have, for types or at either end of a wire."""
        for node in nodes.values():
            if node.written_type in self._platform.names.types:
                yield self._platform.names.types[node.written_type].release
            for written in node.written_ports.values():
                yield port_names[node.path][written].release
            for path, _, port in (
                w.rpartition(".") for s in node.ports.values() for w in s.sources
            ):
                if port in port_names.get(path, {}):
                    yield port_names[path][port].release

    def _tree(self, top: Usd.Prim, *, is_ignored: bool) -> None:
        """Look at a prim at the root and at all below it.

        Nothing else is done for each prim of a stage, so this must be quick.
        """
        form = self._platform.graph
        scripts = frozenset(self._platform.scripts.apis)
        above: list[str] = []  # the graphs around the prim, innermost last
        for prim in Usd.PrimRange(top, EVERYTHING):
            kind = Usd.Prim.GetTypeName(prim)
            apis = Usd.PrimTypeInfo.GetAppliedAPISchemas(Usd.Prim.GetPrimTypeInfo(prim))
            is_node = kind == form.node_type
            path = str(Usd.Prim.GetPath(prim)) if above or is_node else ""
            while above and not f"{path}/".startswith(f"{above[-1]}/"):
                above.pop()
            if is_ignored:
                if prim.IsActive():
                    node_type = _text(plain_value(authored_data(prim, _NODE_TYPE)))
                    self._note_script(str(prim.GetPath()), node_type, apis)
            elif is_node:
                self._node(prim, path, apis, above[-1] if above else "")
            else:
                self.others.add(prim, kind, apis)
                if above or kind == form.type or not scripts.isdisjoint(apis):
                    self._other(prim, kind, apis, above)
                elif self._hidden and not kind and has_custom_ports(prim):
                    self.overridden.append(str(prim.GetPath()))

    def _other(self, prim: Usd.Prim, kind: str, apis: Sequence[str], above: list[str]) -> None:
        """Look closer at a prim that is a graph, is in one or carries schemas."""
        path = str(prim.GetPath())
        if kind == self._platform.graph.type:
            self.graphs[path] = prim
            self.nodes[path], self.absent[path] = [], []
            above.append(path)
        elif above:
            self._note_absent(prim, above[-1])
        if self._is_live(prim):
            self._note_script(path, "", apis)

    def _is_live(self, prim: Usd.Prim) -> bool:
        return bool(IS_PRESENT(prim) or (prim.IsActive() and is_in_scene(prim, self._hidden)))

    def _node(self, prim: Usd.Prim, path: str, apis: Sequence[str], graph: str) -> None:
        if not self._is_live(prim):
            self._note_absent(prim, graph)
            return
        properties = AuthoredProperties(prim)
        names = properties.names()
        written = _text(properties[_NODE_TYPE].value())
        own = _text(properties[_NAMESPACE].value()) if _NAMESPACE in names else ""
        version = properties[_VERSION].value()
        type_name, kind, own_names = self._type(written)
        ports = read_ports(properties, kind, own_names)
        is_old = not written or self._platform.names.is_old(written)
        if is_old and IS_PRESENT(prim) and not prim.IsInstanceProxy():
            self.old_types.append(OldType(path, written, is_in_asset(prim)))
        if not type_name and not ports:
            return  # a leftover, which is not a node
        namespaces = self._namespaces_above(prim, path)
        if own:
            namespaces = self._namespaces[path] = (*namespaces, own)
        self._note_script(path, type_name, apis)
        self.nodes[graph].append(
            Node(
                path=path,
                type_name=type_name,
                type=None if kind is None else with_named_message(kind, ports),
                version=version if isinstance(version, int) else None,
                ports=ports,
                place=self._place,
                namespaces=namespaces,
                own_namespace=own,
                is_local=not self._hidden or is_defined_in(prim, self._own_layers),
                written_type="" if written == type_name else written,
                written_ports=_written_ports(properties, own_names),
            )
        )

    def _type(self, written: str) -> tuple[str, NodeType | None, Mapping[str, OtherName]]:
        """Return what `node:type` means: a name, its type, and other names of its ports."""
        if written not in self._types:
            name, platform = self._platform.type_name(written), self._platform
            self._types[written] = name, platform.types.get(name), platform.other_ports(name)
        return self._types[written]

    def _note_absent(self, prim: Usd.Prim, graph: str) -> None:
        """Keep a prim that looks like a node and is none: its own graph may miss it."""
        properties = AuthoredProperties(prim)
        type_name = _text(properties[_NODE_TYPE].value())
        ports = read_ports(properties, *self._type(type_name)[1:])
        if not (ports or type_name):
            return
        reason = (
            f"of type {prim.GetTypeName() or 'none'}, expected {self._platform.graph.node_type}"
        )
        if not prim.IsActive():
            reason = DEACTIVATED
        elif not is_in_scene(prim, self._hidden):
            reason = OVER
        self.absent[graph].append(AbsentPrim(str(prim.GetPath()), type_name, reason, ports))

    def _note_script(self, path: str, node_type: str, apis: Sequence[str]) -> None:
        scripts = self._platform.scripts
        carrier = node_type if scripts.runs(node_type) else scripts.among(apis)
        if carrier is not None:
            self.scripts.append(Script(path, carrier))

    def _namespaces_above(self, prim: Usd.Prim, path: str) -> tuple[str, ...]:
        """Return the namespaces of the prims above the one at a path, outermost first.

        A node that is none says nothing.
        """
        ahead = []
        while (path := path.rpartition("/")[0] or "/") not in self._namespaces:
            prim = Usd.Prim.GetParent(prim)
            ahead.append((path, prim))
        namespaces = self._namespaces[path]
        for path, prim in reversed(ahead):
            is_node = Usd.Prim.GetTypeName(prim) == self._platform.graph.node_type
            own = None if is_node else plain_value(authored_data(prim, _NAMESPACE))
            if isinstance(own, str) and own:
                namespaces = (*namespaces, own)
            self._namespaces[path] = namespaces
        return namespaces

    def graph(self, path: str) -> GraphModel:
        """Return a graph with its nodes and what looks like one."""
        prim, attributes, variables = self.graphs[path], {}, {}
        properties = AuthoredProperties(prim)
        for name in properties.names():
            value = properties[name].value()
            if value is not None:
                attributes[name] = value
            if name.startswith(VARIABLE):
                declared = GraphVariable(properties[name].type, value)
                variables[name.removeprefix(VARIABLE)] = declared
        return GraphModel(
            path=path,
            active=self._is_live(prim),
            attributes=attributes,
            nodes=tuple(self.nodes[path]),
            variables=variables,
            absent=tuple(self.absent[path]),
            instanced=prim.IsInstanceProxy(),
            inner=self._inner.get(path, ()),
            hidden=0 if prim.IsActive() else _nodes_in_layers(prim, self._platform.graph.node_type),
        )


def _nodes_in_layers(graph: Usd.Prim, node_type: str) -> int:
    """Return how many nodes the layers hold in a prim of which USD composes no children."""
    specs = (spec for spec in graph.GetPrimStack() if not spec.expired)
    return len(
        {child.name for spec in specs for child in spec.nameChildren if child.typeName == node_type}
    )


def _written_ports(
    properties: AuthoredProperties, own_names: Mapping[str, OtherName]
) -> dict[str, str]:
    """Return the ports of a prim that it has under names of other releases, with these."""
    if not own_names:
        return {}
    names = properties.names()
    return {other.name: name for name, other in own_names.items() if name in names}


def _settled(
    node: Node, port_names: Mapping[str, Mapping[str, OtherName]], releases: Collection[str]
) -> Node:
    """Return a node whose wires come from ports by their own names, beside what the file has."""
    ports = dict(node.ports)
    for name, state in node.ports.items():
        sources: list[str] = []
        for path in state.sources:
            prim, _, port = path.rpartition(".")
            other = port_names.get(prim, {}).get(port)
            sources.append(path if other is None else f"{prim}.{other.name}")
        if sources:
            ports[name] = replace(state, sources=tuple(sources))
    implied = {
        other.name: name
        for name, other in port_names[node.path].items()
        if other.release in releases and other.name not in node.ports
    }
    return replace(node, ports=ports, written_ports={**implied, **node.written_ports})


def has_custom_ports(prim: Usd.Prim) -> bool:
    """Whether a prim has ports as Kit writes those of nodes, and not those of shaders."""
    properties = (spec for prim_spec in prim.GetPrimStack() for spec in prim_spec.properties)
    return any(spec.custom and spec.name.startswith((INPUT, OUTPUT)) for spec in properties)


def read_ports(
    properties: AuthoredProperties, kind: NodeType | None, own_names: Mapping[str, OtherName]
) -> Mapping[str, PortState]:
    """Return the ports among the properties of a prim, by full name; `kind` is its node type.

    Of outputs only the names count: what flows through them is made at run time. `own_names` are
    the names of other releases, each with the port that it means.
    """
    ports = {}
    names = properties.names()
    for written in names:
        name = written
        if written in own_names:
            name = own_names[written].name
            if name in names:
                continue  # the file has the port under its own name, too
        if name.startswith(OUTPUT):
            ports[name] = PortState(name)
        elif name.startswith(INPUT):
            ports[name] = _input(name, properties[written], kind)
    return ports


def _input(name: str, authored: AuthoredProperty, kind: NodeType | None) -> PortState:
    value, sources = authored.value(), authored.sources()
    if value is None and not sources:
        if authored.type == RELATIONSHIP:
            return PortState(name, RELATIONSHIP, targets=authored.targets())
        port = None if kind is None else kind.port(name)
        # Files declare a port that takes values of several types as a token; Kit keeps its literal
        # beside the attribute's value.
        if authored.type == "token" if port is None else port.is_union:
            value = plain_value(authored.custom_data("omni", "graph", "attrValue"))
    # The type of a port without a value says nothing that a rule asks about.
    return PortState(name, "" if value is None else authored.type, value, sources)


def _text(value: Value | None) -> str:
    return str(value or "")


def _place(stage: Usd.Stage, path: str) -> tuple[float, float] | None:
    """Return where a graph editor shows a node; a picture does without if the file is damaged."""
    prim = stage.GetPrimAtPath(path)
    try:
        with stage_errors(path):
            value = AuthoredProperties(prim)[_POSITION].value() if prim else None
    except StageError:
        return None
    if not isinstance(value, tuple) or len(value) != 2:  # noqa: PLR2004 - x and y
        return None
    x, y = value
    return (float(x), float(y)) if isinstance(x, float) and isinstance(y, float) else None
