"""Rules about graphs: present, at their path, Action Graphs, in time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lab3_usd.check.match.conformance import is_variable_met, right_once_renamed
from lab3_usd.check.match.rule_inputs import GraphSubject, StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.model.changes import Activate, AddGraph, Edit, MovePrim, RemovePrim, SetType, SetValue
from lab3_usd.model.finding import Place, Problem, Severity, display
from lab3_usd.model.prims import is_at_or_below
from lab3_usd.model.stage import GraphModel, absence_reason

_ANOTHER = "another graph"


def _inactive(subject: GraphSubject) -> GraphModel | None:
    """Return the graph at the right path that is in the file but not in the scene."""
    for graph in subject.stage.graphs:
        if graph.path == subject.spec.path and not graph.active:
            return graph
    return None


@rule("G01", "missing-graph", scope="graph")
def missing_graph(subject: GraphSubject) -> Iterator[Problem]:
    """A required Action Graph is missing or deactivated.

    Why: nothing of what the graph publishes or commands exists. Its nodes are not reported one by
    one.

    Fix: select the graph's parent in the Stage panel, open Window > Graph Editors > Action Graph,
    click New Action Graph and give it the name in the handout. For a deactivated graph, right-click
    it in the Stage panel and choose Activate. If its parent is missing too, the finding about the
    parent names the graph.

    Example: no `{graph}` from the checkpoint on that adds it.
    """
    if subject.roles.graph is not None:
        return
    spec = subject.spec
    yield Problem(
        prim=spec.path,
        message=f"graph {spec.name} is missing{_why_missing(subject)}",
        expected=spec.path,
        handout=spec.handout,
        hint=_way_to_have(subject),
        fix=tuple(_restoring_edits(subject)),
        assumes=(_missing_at(subject),),
    )


def _way_to_have(subject: GraphSubject) -> str:
    """Return how to repair a missing graph: one that is in the file already is not made again."""
    spec = subject.spec
    prim = subject.stage.prims.get(spec.path)
    if prim is None or _inactive(subject) is None:
        return f"make the graph {spec.name} at {spec.path} as section {spec.handout} shows"
    if not prim.active:
        return f"right-click {spec.path} in the Stage panel and choose Activate"
    return f"write def instead of over for {spec.path} in the file"


def _missing_at(subject: GraphSubject) -> Place:
    """Return the place at which a finding stands that names a missing graph."""
    return subject.spec.path, "(missing)"


def with_missing_graphs(problem: Problem, subject: StageSubject) -> Problem:
    """Return a problem about a prim that names the graphs which are missing with it.

    A prim that is only elsewhere has lost its graphs where none of them came along.
    """
    below = [graph for graph in subject.graphs if is_at_or_below(graph.spec.path, problem.prim)]
    missing = [graph for graph in below if graph.roles.graph is None]
    is_left_behind = problem.absent or len(missing) == len(below)
    if not missing or not is_left_behind:
        return problem
    names = ", ".join(graph.spec.name for graph in missing)
    message = f"{problem.message}; missing with it: {names}"
    return replace(problem, message=message, covers=tuple(map(_missing_at, missing)))


def _restoring_edits(subject: GraphSubject) -> Iterator[Edit]:
    """Yield the edits that restore a graph; a prim of another kind at its path stays.

    One that holds nodes is a graph that lost its type.
    """
    prim = subject.stage.prims.get(subject.spec.path)
    if prim is None:
        yield AddGraph.of(subject.spec.graph)
    elif not prim.present:
        yield Activate(prim.path)
    elif any(node.path.rpartition("/")[0] == prim.path for node in subject.stage.orphans):
        yield SetType(prim.path, subject.lab.platform.graph.type)


def _why_missing(subject: GraphSubject) -> str:
    path, stage = subject.spec.path, subject.stage
    prim, missing = stage.prims.get(path), stage.unresolved_above(path)
    instance = stage.instance_above(path)
    if prim is not None and prim.active and not prim.defined and missing is not None:
        return f": only an over is here, and {missing.asset} below it cannot be found"
    if _inactive(subject) is not None:
        return f": the one at its path {absence_reason(stage, path)}"
    if prim is not None:
        return f": the prim at its path is {prim.type or 'of no type'}, not an Action Graph"
    return f": {instance} is an instance, below which nothing can be added" if instance else ""


@rule("G02", "misplaced-graph", scope="graph")
def misplaced_graph(subject: GraphSubject) -> Iterator[Problem]:
    """A graph has another path or name.

    Why: paths determine the names of the ROS 2 nodes, and later steps of the handout look for the
    graph at its path. The content of the graph is still judged. Wires that lead to its nodes by the
    right path are not told: the right name mends them.

    Fix: rename the graph in the Stage panel, or drag it below the prim that the handout names.

    Example: `/World/ActionGraph` instead of `{graph}`.
    """
    graph, spec = subject.roles.graph, subject.spec
    # A graph moves with its sensor, and need not where the sensor alone stands elsewhere.
    right = (spec.path, subject.lab.graphs[spec.name].path)
    is_free = spec.anywhere or bool(subject.roles.merged_graphs)
    if graph is not None and graph.path not in right and not is_free:
        message = f"this is the graph {spec.name}, expected at {spec.path}"
        hint = f"rename the graph in the Stage panel, or drag it, to {spec.path}"
        standing = _in_the_way(subject)
        if standing is not None:
            message += f", where {standing} is"
            what = "move" if standing == _ANOTHER else "delete"
            hint = f"{what} the prim at {spec.path} first, then {hint}"
        mended = [fault.wire for fault in right_once_renamed(subject) if fault.wire]
        if mended:
            message += f"; {len(mended)} wire{'s' * (len(mended) > 1)} lead to its nodes there"
        yield Problem(
            prim=graph.path,
            message=message,
            expected=spec.path,
            actual=graph.path,
            unmet=tuple(f"{spec.name}/wire/{wire.target.short}" for wire in mended),
            handout=spec.handout,
            hint=hint,
            related=() if standing is None else (spec.path,),
            covers=((spec.path, None),) if standing is None else (),
            fix=(MovePrim(graph.path, spec.path),) if standing is None else (),
        )


def _in_the_way(subject: GraphSubject) -> str | None:
    """Say what takes the path that a graph with the right content should have."""
    path = subject.spec.path
    for graph in subject.stage.graphs:
        if graph.path == path:
            if not graph.active:
                return "a deactivated graph"
            return _ANOTHER if graph.nodes else "an empty graph"
    prim = subject.stage.prims.get(path)
    return None if prim is None else f"another prim ({prim.type or 'of no type'})"


@rule("G05", "graphs-in-one", scope="graph")
def graphs_in_one(subject: GraphSubject) -> Iterator[Problem]:
    """One graph contains the nodes of several.

    Why: each part of the lab has its own graph at its own path. The ROS 2 nodes are named after the
    graph, and later steps of the handout look for the graph there. The content is still judged,
    part by part.

    Fix: create the graphs named here and move the nodes of each part into its graph. Each graph
    needs its own tick, context and time.

    Example: `/World/ActionGraph` holds the nodes of {graph_name} and of {next_graph_name}.
    """
    graph, names = subject.roles.graph, subject.roles.merged_graphs
    asked = [name for name in names if name in subject.checkpoint.graphs]
    if graph is None or not names or subject.spec.name != asked[0]:
        return
    later = [name for name in names if name not in asked]
    paths = tuple(subject.lab.graphs[name].path for name in asked)
    message = f"this one graph holds {_listed(names)}, expected each in a graph of its own"
    if later:
        message += f"; {_listed(later)} belongs to a later checkpoint"
    yield Problem(
        prim=graph.path,
        message=message,
        expected=", ".join(paths),
        actual=graph.path,
        handout=subject.spec.handout,
        related=tuple(path for path in paths if path != graph.path),
        hint=f"make {_listed(paths)}, and move the nodes of each part into its own graph",
        costs=tuple(asked[-1:]),  # the part that was added last
    )


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


@rule("G08", "wrong-variable", scope="graph")
def wrong_variable(subject: GraphSubject) -> Iterator[Problem]:
    """A variable of the graph is missing, or has another type or value.

    Why: Read Variable finds nothing, or another value, and what depends on it stays still or does
    something else.

    Fix: open the graph, then Window > Graph Editors > Variables, add the variable with the type
    named here, and type its initial value.

    Example: a graph that reads `running`, and has no such variable.
    """
    graph = subject.roles.graph
    if graph is None:
        return
    for variable in subject.spec.variables:
        state = graph.variables.get(variable.name)
        if is_variable_met(graph, variable):
            continue
        expected = f"{variable.usd_type} {display(variable.value)}"
        actual = f"{state.usd_type} {display(state.value)}" if state else "missing"
        yield Problem(
            graph.path,
            f"variable '{variable.name}' is {actual}, expected {expected}",
            property=variable.attribute,
            expected=expected,
            actual=actual,
            handout=variable.handout,
            unmet=(f"{subject.spec.name}/variable/{variable.name}",),
            fix=(SetValue(graph.path, variable.attribute, variable.usd_type, variable.value),),
        )


@rule("G04", "early-graph", scope="stage", severity="warning")
def early_graph(subject: StageSubject) -> Iterator[Problem]:
    """The stage contains a graph of a later checkpoint.

    Why: the file may have been saved late, after work on the next part had begun. The starter
    checkpoint must not contain any graph.

    Fix: save each checkpoint before you start the next part.

    Example: `{next_graph}` in a checkpoint before the one that adds it.
    """
    added = subject.lab.added_until(subject.checkpoint.id)
    later = {spec.path: spec for name, spec in subject.lab.graphs.items() if name not in added}
    severity: Severity | None = None if subject.checkpoint.graphs else "error"
    for graph in subject.stage.graphs:
        spec = later.get(graph.path)
        if graph.active and spec is not None:
            message = f"graph {spec.name} belongs to a later checkpoint; was this saved late?"
            fix = (RemovePrim(graph.path),)
            yield Problem(graph.path, message, handout=spec.handout, severity=severity, fix=fix)
