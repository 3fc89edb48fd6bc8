"""Writes the graphs of a stage as a script that builds them, and the stage without them."""

from __future__ import annotations

from pathlib import Path

from pxr import Usd

from lab3_usd.model.stage import GraphModel, Node, PortState
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.read.stage_reader import read_stage

EVALUATOR, STAGE = "evaluator:type", "pipelineStage"
ON_DEMAND = "og.GraphPipelineStage.GRAPH_PIPELINE_STAGE_ONDEMAND"


def as_script(file: Path, folder: Path) -> tuple[Path, Path]:
    """Return a script that builds the graphs of a stage, and the stage without graphs."""
    model = read_stage(file, lint_platform())
    lines = ["import omni.graph.core as og", "import usdrt.Sdf", ""]
    for graph in model.graphs:
        lines += _edit(graph)
    script, scene = folder / "built.py", folder / "scene.usda"
    script.write_text("\n".join(lines), encoding="utf-8")
    stage = Usd.Stage.Open(str(file))
    for graph in model.graphs:
        stage.RemovePrim(graph.path)
    stage.GetRootLayer().Export(str(scene))
    return script, scene


def _edit(graph: GraphModel) -> list[str]:
    keys = [f'"graph_path": {graph.path!r}', f'"evaluator_name": {graph.attributes[EVALUATOR]!r}']
    if graph.attributes[STAGE] == "pipelineStageOnDemand":
        keys.append(f'"pipeline_stage": {ON_DEMAND}')
    made = [f"({node.name!r}, {node.saved_type!r})" for node in graph.nodes]
    created = [
        f'("{node.name}.{name}", "token")'
        for node in graph.nodes
        for name in node.ports
        if node.type is not None and name not in node.type.ports and node.type.listed(name)
    ]
    values = [
        f'("{node.name}.{state.name}", {_value(state)})'
        for node in graph.nodes
        for state in node.ports.values()
        if state.value is not None or state.targets
    ]
    variables = [
        f"({name!r}, {held.usd_type!r}{'' if held.value is None else f', {held.value!r}'})"
        for name, held in graph.variables.items()
    ]
    return [
        "og.Controller.edit(",
        f"    {{{', '.join(keys)}}},",
        "    {",
        *_command("CREATE_VARIABLES", variables),
        *_command("CREATE_NODES", made),
        *_command("CREATE_ATTRIBUTES", created),
        *_command("CONNECT", [wire for node in graph.nodes for wire in _wires(node)]),
        *_command("SET_VALUES", values),
        "    },",
        ")",
        "",
    ]


def _wires(node: Node) -> list[str]:
    graph = node.path.rpartition("/")[0]
    found = []
    for name, state in node.ports.items():
        for source in state.sources:
            is_here = source.startswith(f"{graph}/")
            shown = source.removeprefix(f"{graph}/") if is_here else source
            found.append(f'("{shown}", "{node.name}.{name}")')
    return found


def _value(state: PortState) -> str:
    if state.targets:
        return f"[{', '.join(f'usdrt.Sdf.Path({path!r})' for path in state.targets)}]"
    return repr(list(state.value) if isinstance(state.value, tuple) else state.value)


def _command(name: str, items: list[str]) -> list[str]:
    if not items:
        return []
    return [
        f"        og.Controller.Keys.{name}: [",
        *(f"            {item}," for item in items),
        "        ],",
    ]
