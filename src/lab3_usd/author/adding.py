"""Adds graphs to a stage in memory: planned from facts, proved by the linter, written as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.author.editing import Editing, new_since
from lab3_usd.author.frame_holes import frame_above, sent_frames
from lab3_usd.author.holes import planned, subjects
from lab3_usd.author.places import graph_to_extend, new_path
from lab3_usd.author.request import Options, Request, checked
from lab3_usd.author.rivals import rivals
from lab3_usd.author.task import Hole, Task
from lab3_usd.check.registry import Parameters
from lab3_usd.errors import StageError, UsageError
from lab3_usd.facts.frame_targets import frame_of_prim, tf_ports
from lab3_usd.facts.frames import all_edges
from lab3_usd.facts.planned_graphs import Likeness, extension, graph_at, likeness, names_any
from lab3_usd.files import FileState, copy_beside
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.model.changes import AddGraph, DropPrim, Retarget
from lab3_usd.model.finding import Finding
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.edit.added import added_prims, variants_at
from lab3_usd.stage.read.opening import open_stage, quiet
from lab3_usd.stage.read.stage_reader import read_model

_TO_LIGHT = "it was there before, and shows only now"
_MOST_SHOWN = 4
_FRAMES = "tf"


class Addition(Struct, frozen=True):
    """One request and what became of it.

    `graph` is the graph that is new, extended or there already, `nodes` how many nodes are new;
    none where the stage has all that is asked for. `holes` say what was filled in. `replaced` is
    a graph that made way, `notes` are what else there is to say.
    """

    request: Request
    graph: str
    nodes: int
    extends: bool = False
    holes: tuple[Hole, ...] = ()
    replaced: str = ""
    notes: tuple[str, ...] = ()

    @property
    def is_there(self) -> bool:
        """Whether nothing is to be added."""
        return not self.nodes and not self.notes


class Added(Struct, frozen=True):
    """A stage with graphs added: the findings that came, and the new bytes of its file.

    `data` is None where nothing changes. `awaited` are the new findings that another command
    resolves, each with how; `new` the others, for which nothing is written unless forced.
    """

    path: Path
    additions: tuple[Addition, ...]
    awaited: tuple[tuple[Finding, str], ...]
    new: tuple[Finding, ...]
    state: FileState
    data: bytes | None


class AddOptions(Struct, frozen=True):
    """How to add: by which release, in spite of findings or not, in place of graphs or not.

    `parameters` are those of the rules that judge the result.
    """

    release: str
    force: bool = False
    replaces: bool = False
    parameters: Parameters = ()


@quiet()
def add_graphs(path: Path, requests: Sequence[Request], options: AddOptions) -> Added:
    """Add graphs to a stage in memory; no file is written.

    Raises:
        AmbiguousError: several answers fit.
        UsageError: a request is wrong, or something does already what is asked for.
        StageError: the stage cannot be opened or edited.
    """
    with closing(Editing.begin(path, options.release, options.parameters)) as editing:
        before = editing.findings()
        additions: list[Addition] = []
        for request in requests:
            wanted = with_frames(request, editing.model)
            additions += [add_one(editing, each, options) for each in wanted]
        after = editing.findings()
        data = editing.new_root()
    awaited, new = new_findings(before, after, additions, editing.platform)
    return Added(path, tuple(additions), awaited, new, editing.state, data)


def new_findings(
    before: Sequence[Finding],
    after: Sequence[Finding],
    additions: Sequence[Addition],
    platform: Platform,
) -> tuple[tuple[tuple[Finding, str], ...], tuple[Finding, ...]]:
    """Return the new errors and warnings: those that another command resolves, and the others."""
    leaves: dict[str, str] = {}
    for addition in additions:
        recipe = platform.recipes.get(addition.request.kind)
        leaves |= recipe.leaves if recipe is not None else {}
    tops = [addition.graph for addition in additions]
    awaited, new = [], []
    for finding in new_since(before, after):
        places = (finding.prim, *finding.related)
        if finding.rule in leaves:
            awaited.append((finding, leaves[finding.rule]))
        elif any(is_at_or_below(place.partition(".")[0], top) for place in places for top in tops):
            new.append(finding)
        else:
            awaited.append((finding, _TO_LIGHT))
    return tuple(awaited), tuple(new)


def with_frames(request: Request, model: StageModel) -> tuple[Request, ...]:
    """Return a request, and that for the frame of its sensor where it is to come along."""
    if not request.options.with_tf:
        return (request,)
    recipe = checked(request, model.platform.recipes)
    _, sensor = subjects(model, recipe, request.options)
    if sensor is None:
        return (request,)
    frame = request.options.frame
    if frame is not None and frame != sensor.frame:
        raise UsageError(
            f"--with-tf sends {sensor.frame}, the name of {sensor.prim.path}, and not {frame}; "
            "leave --frame out, or give the prim isaac:nameOverride"
        )
    tf = Options(
        targets=(sensor.prim.path,),
        parent=sensor.carrier or None,
        namespace=request.options.namespace,
        domain=request.options.domain,
    )
    return request, Request(_FRAMES, tf)


def _variants(editing: Editing, subject: str) -> Iterator[Hole]:
    """Yield the variants in which a robot or sensor lives."""
    selected = ", ".join(variants_at(editing.session.stage, subject)) if subject else ""
    if selected:
        why = "with another one selected the graph may find nothing"
        yield Hole("variant", selected, "variant", selected, why)


def add_one(editing: Editing, request: Request, options: AddOptions) -> Addition:
    """Add one graph to a stage that is being edited.

    Raises:
        UsageError: as `add_graphs`.
    """
    model = editing.model
    recipe = checked(request, model.platform.recipes)
    if request.options.node is not None:
        return _add_to_node(editing, request)
    robot, sensor = subjects(model, recipe, request.options)
    subject = sensor.prim.path if sensor else robot.path if robot else ""
    into = request.options.into
    if into is not None:
        path = graph_to_extend(into, model).path
    else:
        path = new_path(request, recipe, subject, model, partial(_stands, editing))
    task = Task(model, recipe, request.options, path, robot, sensor, options.force)
    plan = planned(task)
    graph, shared, values = plan.graph, plan.shared, plan.values
    shown = tuple(hole for hole in (*plan.holes, *_variants(editing, subject)) if hole.label)
    live = {each.path for each in model.graphs if each.active and not each.instanced}
    there = [likeness(graph, each, model) for each in model.graphs if each.path in live]
    same = next((each for each in there if each.is_same), None)
    if same is not None:
        return Addition(request, same.path, 0, holes=shown)
    sender = _sender_of_all(task, values)
    if sender:
        return Addition(request, sender, 0, holes=shown)
    alike = [each.path for each in there if each.is_alike and _is_about(each.path, subject, model)]
    alike += [each for each in _own_graphs(editing, recipe, subject) if each not in alike]
    made_way: list[str] = []
    if into is not None:
        own = next(each for each in there if each.path == into)
        graph = extension(graph, shared, own, model)
    elif request.options.graph is not None and _stands(editing, path):
        if path not in alike or not options.replaces:
            standing = next((each for each in there if each.path == path and each.is_alike), None)
            if standing is not None:
                raise _other_values(standing)
            raise UsageError(
                f"--graph {path} is taken: a graph is there; choose another path, or extend it "
                f"with --into {path}"
            )
        made_way = [path]
    write = AddGraph.of(graph, recipe.kind)
    editing.edit([*map(DropPrim, made_way), *((write,) if into is None else write.contents)])
    new = frozenset(f"{graph.path}/{role}" for role in graph.nodes)
    first = _in_the_way(new, recipe, alike, editing.model)
    if first and options.replaces and into is None and set(first) <= {*alike}:
        made_way = list(first)
        drops = map(DropPrim, (graph.path, *made_way))
        graph = replace(graph, path=request.options.graph or made_way[0])
        editing.edit([*drops, AddGraph.of(graph, recipe.kind)])
        new = frozenset(f"{graph.path}/{role}" for role in graph.nodes)
        first = _in_the_way(new, recipe, [], editing.model)
    for path, text in first.items():
        if path in alike:
            raise _other_values(next(each for each in there if each.path == path))
        raise UsageError(text)
    return Addition(
        request,
        graph.path,
        len(graph.nodes),
        extends=into is not None,
        holes=shown,
        replaced=", ".join(made_way),
        notes=tuple(_frame_notes(task, values, editing.model)),
    )


def _in_the_way(
    new: frozenset[str], recipe: Recipe, alike: Sequence[str], model: StageModel
) -> dict[str, str]:
    """Return the graphs that do already what new nodes do, each with what does what."""
    first: dict[str, str] = {}
    for rival, what in rivals(new, model):
        first.setdefault(rival.rpartition("/")[0], f"{rival} {what}")
    for graph in alike if recipe.is_single else ():
        first.setdefault(graph, f"{graph} is a {recipe.kind} of the same robot already")
    return first


def _other_values(own: Likeness) -> UsageError:
    """Return the error that a graph is there with other values than those asked for."""
    differences = "; ".join(own.differences[:_MOST_SHOWN]) or "other nodes"
    return UsageError(f"{own.path} is there with other values: {differences}; --replace renews it")


def _is_about(path: str, subject: str, model: StageModel) -> bool:
    """Whether a graph names a robot or sensor, or prims of it; of no subject any graph is."""
    graph = graph_at(path, model)
    return not subject or (graph is not None and names_any(graph.nodes, (subject,)))


def _sender_of_all(task: Task, values: dict[str, Any]) -> str:
    """Return a graph that sends each frame asked for below the same parent, '' for none."""
    if "frames" not in task.recipe.needs or not values["targets"]:
        return ""
    model, parent, sent = task.stage, values["parent"], sent_frames(task)
    top = frame_of_prim(parent, model) if parent else model.platform.world_frame
    edges = {target: sent.get(frame_of_prim(target, model)) for target in values["targets"]}
    if any(e is None or (e.prim, e.parent) != (target, top) for target, e in edges.items()):
        return ""
    return next(edge.publisher.rpartition("/")[0] for edge in edges.values() if edge is not None)


def _stands(editing: Editing, path: str) -> bool:
    return bool(editing.session.stage.GetPrimAtPath(path))


def _own_graphs(editing: Editing, recipe: Recipe, subject: str) -> list[str]:
    """Return the graphs that the same recipe brought for the same robot or sensor."""
    form, model = editing.platform.graph, editing.model
    marked = added_prims(editing.session.stage, form.type, form.node_type).graphs
    return [
        graph.path
        for graph in model.graphs
        if marked.get(graph.path) == recipe.kind and _is_about(graph.path, subject, model)
    ]


def _frame_notes(task: Task, values: dict[str, Any], model: StageModel) -> list[str]:
    """Return what sends the frame of a sensor that nobody sends."""
    sensor, frame = task.sensor, values.get("frame")
    if sensor is None or not isinstance(frame, str) or task.options.with_tf:
        return []
    if frame in {name for edge in all_edges(model) for name in (edge.parent, edge.child)}:
        return []
    if frame != sensor.frame:
        return [f"nothing sends the frame {frame}, which is not a prim's: publish it elsewhere"]
    parent = f" --parent {sensor.carrier}" if sensor.carrier else ""
    how = f"lab3 add tf STAGE --targets {sensor.prim.path}{parent}"
    return [f"nothing sends the frame {frame}: --with-tf, or {how}"]


def _add_to_node(editing: Editing, request: Request) -> Addition:
    """Append prims to a node that makes frames, whichever node of the two is named.

    Raises:
        UsageError: there is no such node, or the frames would not fit.
    """
    model, options = editing.model, request.options
    node = next((node for node in model.nodes() if node.path == options.node), None)
    if node is None:
        raise UsageError(f"--node {options.node}: there is no such node")
    if options.into is not None and node.path.rpartition("/")[0] != options.into:
        raise UsageError(f"--node {options.node}: is not in {options.into}")
    makers = [
        maker
        for port in tf_ports(node).arrays
        for source in node.sources(port)
        for maker in model.nodes()
        if maker.path == source.partition(".")[0]
    ]
    maker = makers[0] if makers else node
    ports = tf_ports(maker).prims
    if not ports:
        raise UsageError(f"--node {options.node}: makes no frames of prims")
    targets = options.targets or ()
    if not targets:
        raise UsageError("--node goes with --targets: name the prims that it gets")
    parents = maker.targets(ports[0])
    top = parents[0] if parents else ""
    if options.parent is not None and options.parent != top:
        raise UsageError(
            f"--parent {options.parent}: {maker.path} has {top or 'no parent prim'}; add a graph "
            "for another parent"
        )
    frame = frame_above(targets, top, model)
    there = maker.targets(ports[1])
    new = tuple(target for target in targets if target not in there)
    graph = maker.path.rpartition("/")[0]
    shown = ", ".join(frame_of_prim(target, model) for target in targets)
    holes = (
        Hole("targets", targets, "frames", shown, "given", "--targets"),
        Hole("parent", top, "parent", frame, f"as {maker.path}", "--parent"),
    )
    if not new:
        return Addition(request, graph, 0, holes=holes)
    sent = {edge.child: edge.publisher for edge in all_edges(model)}
    for name in (frame_of_prim(target, model) for target in new):
        if name in sent:
            raise UsageError(f"{sent[name]} sends the frame {name} already")
    editing.edit([Retarget(maker.path, ports[1], (*there, *new))])
    note = f"{len(new)} prims more in {maker.path}.{ports[1]}"
    return Addition(request, graph, 0, extends=True, holes=holes, notes=(note,))


@quiet()
def check_added(added: Added, data: bytes, target: Path) -> None:
    """Open and judge the bytes of an extended stage where they are going to stand.

    Raises:
        StageError: no stage can be opened from them there, or assets are missing there.
        UsageError: nothing can be written there.
    """
    with copy_beside(target, data) as copy:
        there, here = (
            read_model(open_stage(path), lint_platform(), str(path)) for path in (copy, added.path)
        )
    lost = {missing.asset for missing in there.unresolved}
    lost -= {missing.asset for missing in here.unresolved}
    if lost:
        raise StageError(
            f"{target}: {', '.join(sorted(lost))} cannot be found from there; write it beside the "
            "stage, or --layer FILE"
        )
