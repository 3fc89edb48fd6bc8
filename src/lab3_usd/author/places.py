"""Where a new graph may stand in a stage, and what it is called there."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from lab3_usd.author.request import Request
from lab3_usd.errors import GraphError, UsageError
from lab3_usd.facts.planned_graphs import graph_at
from lab3_usd.isaac.graph import checked_path
from lab3_usd.isaac.recipes import Recipe
from lab3_usd.model.prims import upwards
from lab3_usd.model.stage import GraphModel, StageModel

_PARENT = "Graphs"
_MOST = 100


def new_path(
    request: Request,
    recipe: Recipe,
    subject: str,
    stage: StageModel,
    is_taken: Callable[[str], bool],
) -> str:
    """Return the path of a new graph: the one that is asked for, else the usual one that is free.

    A graph that stands where one is asked for may be the same one again.

    Raises:
        UsageError: the path is taken, is none, or no graph runs there.
    """
    asked = request.options.graph
    if asked is not None and graph_at(asked, stage) is not None:
        return asked
    if asked is not None:
        try:
            checked_path(asked)
        except GraphError as error:
            raise UsageError(f"--graph {error}") from error
        refuse_place(asked, stage)
        if is_taken(asked):
            prim = stage.prim(asked)
            kind = (prim.type if prim else "") or "prim"
            raise UsageError(f"--graph {asked} is taken: a {kind} is there; choose another path")
        return asked
    top = stage.default_prim
    if not top or stage.instance_above(top) or graph_at(top, stage):
        top = ""
    names = _names(recipe.graph, subject.rpartition("/")[2])
    path = next(p for p in (f"{top}/{_PARENT}/{name}" for name in names) if not is_taken(p))
    refuse_place(path, stage)
    return path


def _names(usual: str, subject: str) -> Iterator[str]:
    yield usual
    if subject:
        yield f"{usual}_{subject}"
    yield from (f"{usual}_{number:02}" for number in range(1, _MOST))


def refuse_place(path: str, stage: StageModel) -> None:
    """Refuse a path below an instance or a graph, where Isaac Sim runs no graph.

    Raises:
        UsageError: it is there.
    """
    parent = path.rpartition("/")[0]
    instance = stage.instance_above(parent) if parent else None
    if instance is not None:
        raise UsageError(
            f"{path} is in the instance {instance}: Isaac Sim loads no graph of an instance; "
            "choose a path outside with --graph"
        )
    for above in upwards(parent):
        if graph_at(above, stage):
            raise UsageError(f"{path} is in the graph {above}: extend that one with --into {above}")
        prim = stage.prims.get(above)
        if prim is not None and not prim.active:
            raise UsageError(f"{path} is below {above}, which is deactivated")


def graph_to_extend(path: str, stage: StageModel) -> GraphModel:
    """Return the Action Graph that is to be extended.

    Raises:
        UsageError: there is none at the path, or nothing in it is run by signals.
    """
    target = graph_at(path, stage)
    if target is None:
        paths = ", ".join(graph.path for graph in stage.graphs) or "none"
        raise UsageError(f"--into {path}: there is no graph; the stage has {paths}")
    form = stage.platform.graph
    evaluator = target.attributes.get(form.evaluation.evaluator)
    if evaluator in form.evaluation.all_nodes:
        raise UsageError(
            f"--into {path}: is no Action Graph but a {evaluator} graph, in which every node "
            "computes at each update; choose an Action Graph, or a new one with --graph"
        )
    wanted = form.evaluation.on_demand
    pipeline = target.attributes.get(form.evaluation.stage)
    if pipeline in wanted:
        raise UsageError(f"--into {path}: runs on demand ({pipeline}), not at each frame")
    if not target.active:
        raise UsageError(f"--into {path}: the graph is deactivated")
    if target.instanced or stage.instance_above(path):
        raise UsageError(f"--into {path}: is in an instance, of which Isaac Sim loads no graph")
    return target
