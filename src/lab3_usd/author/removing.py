"""Removes graphs from a stage in memory, with the parents that hold nothing else."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import closing
from pathlib import Path

from msgspec import Struct

from lab3_usd.author.editing import Editing, new_since
from lab3_usd.author.holes import planned, subjects
from lab3_usd.author.request import Request, recipe_of
from lab3_usd.author.task import Task
from lab3_usd.errors import AmbiguousError, UsageError
from lab3_usd.facts.endpoints import endpoints
from lab3_usd.facts.planned_graphs import graph_at, likeness, names_any
from lab3_usd.facts.robots import robots
from lab3_usd.files import FileState
from lab3_usd.isaac.node_types import NodeType
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.isaac.topics import resolved_topic
from lab3_usd.model.changes import DropPrim
from lab3_usd.model.finding import Finding
from lab3_usd.model.prims import is_at_or_below, upwards
from lab3_usd.model.stage import GraphModel, Node, StageModel
from lab3_usd.stage.edit.added import added_prims, is_bare, is_in_root_alone, is_over
from lab3_usd.stage.read.opening import quiet


class Removed(Struct, frozen=True):
    """A stage without a graph: the prims that went, and the findings that came.

    `graph` is the graph that went, or that lost nodes; `is_foreign` where no recipe brought it, but
    it does what one does.
    """

    path: Path
    graph: str
    is_foreign: bool
    prims: tuple[str, ...]
    new: tuple[Finding, ...]
    state: FileState
    data: bytes | None


class Candidate(Struct, frozen=True):
    """A graph, or the nodes that a recipe brought to one, which may be what is meant."""

    graph: str
    nodes: tuple[str, ...] = ()
    is_foreign: bool = False


@quiet()
def remove_graph(path: Path, request: Request, release: str) -> Removed:
    """Remove what a recipe adds from a stage in memory; no file is written.

    Raises:
        AmbiguousError: several graphs can be meant.
        UsageError: there is none, or it stands in another layer.
        StageError: the stage cannot be opened or edited.
    """
    with closing(Editing.begin(path, release)) as editing:
        before = editing.findings()
        chosen = _chosen(request, editing)
        prims = _prims(chosen, editing)
        editing.edit([DropPrim(prim) for prim in prims])
        new = tuple(new_since(before, editing.findings()))
        data = editing.new_root()
    return Removed(path, chosen.graph, chosen.is_foreign, prims, new, editing.state, data)


def _chosen(request: Request, editing: Editing) -> Candidate:
    model, options = editing.model, request.options
    recipe = recipe_of(request.kind, editing.platform.recipes)
    candidates = list(_candidates(recipe, editing))
    named = options.graph or options.into
    if named is not None:
        candidates = [each for each in candidates if each.graph == named]
    for top in filter(None, (options.robot, options.prim)):
        parts = {top}  # and where it is of a robot, the links and sensors of that
        for robot in robots(model):
            if top in (robot.path, robot.root, robot.base):
                parts |= {robot.path, *robot.links, *(each.prim.path for each in robot.sensors)}
        candidates = [each for each in candidates if _names(each, parts, model)]
    for preferred in (
        lambda each: _is_about(each, request, model),
        lambda each: not each.is_foreign,  # a recipe brought it
        lambda each: _is_asked(each, request, model),
    ):
        if len(candidates) > 1:
            candidates = [*filter(preferred, candidates)] or candidates
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        raise AmbiguousError("graph", [each.graph for each in candidates], "--graph")
    there = ", ".join(graph.path for graph in model.graphs) or "none"
    where = f" at {named}" if named else ""
    where += "".join(f" of {top}" for top in (options.robot, options.prim) if top)
    raise UsageError(f"there is no graph of the kind {recipe.kind}{where}; graphs: {there}")


def _candidates(recipe: Recipe, editing: Editing) -> Iterator[Candidate]:
    """Yield the graphs and nodes of a kind: brought by recipes or alike."""
    form = editing.platform.graph
    added = added_prims(editing.session.stage, form.type, form.node_type)
    candidates = [Candidate(path) for path, kind in added.graphs.items() if kind == recipe.kind]
    by_graph: dict[str, list[str]] = {}
    for path, kind in added.nodes.items():
        if kind == recipe.kind:
            by_graph.setdefault(path.rpartition("/")[0], []).append(path)
    candidates += [Candidate(graph, tuple(nodes)) for graph, nodes in by_graph.items()]
    paths = {candidate.graph for candidate in candidates} | set(added.graphs)
    yield from candidates
    for graph in editing.model.graphs:
        if graph.path not in paths and _does(graph, recipe, editing):
            yield Candidate(graph.path, is_foreign=True)


def _does(graph: GraphModel, recipe: Recipe, editing: Editing) -> bool:
    """Whether a graph does what a recipe does, and no other recipe fits better."""
    own = {node.type.type for node in graph.nodes if node.type is not None and _tells(node.type)}
    if not own:
        return False
    sizes = {}
    for other in editing.platform.recipes.values():
        kinds = (editing.platform.types.get(node.type) for node in other.nodes.values())
        telling = {kind.type for kind in kinds if kind is not None and _tells(kind)}
        if own <= telling:
            sizes[other.kind] = len(telling)
    return sizes.get(recipe.kind) == min(sizes.values(), default=-1)


def _tells(kind: NodeType) -> bool:
    """Whether a type shows what a graph is for: it talks ROS, moves joints or makes frames."""
    return bool(kind.role or kind.drives or kind.tf or kind.step_limits)


def _nodes(candidate: Candidate, model: StageModel) -> list[Node]:
    graph = graph_at(candidate.graph, model)
    nodes = () if graph is None else graph.nodes
    return [n for n in nodes if not candidate.nodes or n.path in candidate.nodes]


def _names(candidate: Candidate, tops: Collection[str], model: StageModel) -> bool:
    """Whether a graph names one of these prims, or a prim below one."""
    nodes = _nodes(candidate, model)
    values = (state.value for node in nodes for state in node.ports.values())
    texts = (value for value in values if isinstance(value, str))
    return names_any(nodes, tops) or any(
        is_at_or_below(text, top) for text in texts for top in tops
    )


def _is_about(candidate: Candidate, request: Request, model: StageModel) -> bool:
    """Whether a graph is about the prims and topics that a request names."""
    options = request.options
    nodes = _nodes(candidate, model)
    topics = {end.topic for end in endpoints(model) if end.node in nodes}
    wanted = [_names(candidate, (top,), model) for top in options.targets or ()]
    given = options.topic
    for topic in [given] if isinstance(given, str) else [*(given or {}).values()]:
        space = options.namespace or ""
        ends = resolved_topic(topic, space)
        wanted.append(any(name == ends or (name or "").endswith(ends) for name in topics))
    return all(wanted)


def _is_asked(candidate: Candidate, request: Request, model: StageModel) -> bool:
    """Whether a graph has what the request would add."""
    recipe = recipe_of(request.kind, model.platform.recipes)
    graph = graph_at(candidate.graph, model)
    if graph is None:
        return False
    try:
        subject = subjects(model, recipe, request.options)
        task = Task(model, recipe, request.options, candidate.graph, *subject, force=True)
        return likeness(planned(task).graph, graph, model).is_same
    except UsageError:  # what it was made of is gone
        return False


def _prims(candidate: Candidate, editing: Editing) -> tuple[str, ...]:
    """Return the prims that go: the graph and its empty parents, or nodes.

    Raises:
        UsageError: another layer has them.
    """
    stage = editing.session.stage
    prims = candidate.nodes or (candidate.graph,)
    for path in prims:
        if not is_in_root_alone(stage, path):
            raise UsageError(
                f"{path} is not in {editing.path.name} alone: remove it in the file that defines it"
            )
    return prims if candidate.nodes else (_highest(candidate.graph, editing),)


def _highest(path: str, editing: Editing) -> str:
    """Return the highest prim that holds nothing but a graph."""
    form = editing.platform.graph
    added = added_prims(editing.session.stage, form.type, form.node_type)
    is_ours = path in added.graphs
    top = path
    for parent in upwards(path.rpartition("/")[0]):
        is_ours_or_over = parent in added.parents or is_over(editing.session.stage, parent)
        is_removable = is_ours_or_over or not is_ours
        if not is_removable or not is_bare(editing.session.stage, parent, top.rpartition("/")[2]):
            break
        top = parent
    return top
