"""Puts the lab together out of the files of `graphs/`, each checked against the others."""

from __future__ import annotations

from pathlib import Path

from lab3_usd.errors import SpecError
from lab3_usd.spec.catalog import Catalog
from lab3_usd.spec.load_catalog import FILE as CATALOG_FILE
from lab3_usd.spec.load_catalog import parse_catalog
from lab3_usd.spec.load_checkpoints import FILE as CHECKPOINT_FILE
from lab3_usd.spec.load_checkpoints import (
    graph_names,
    parse_checkpoints,
    parse_frames,
    parse_policy,
)
from lab3_usd.spec.load_graph import parse_graph
from lab3_usd.spec.load_ros import load_ros
from lab3_usd.spec.load_submission import load_submission
from lab3_usd.spec.scene_spec import SCENE_FILE, check_scene
from lab3_usd.spec.spec import GraphSpec, Lab
from lab3_usd.spec.yaml_file import read_yaml


def assemble(folder: Path) -> Lab:
    """Read every file of the lab.

    Raises:
        SpecError: a file is missing or wrong.
    """
    catalog = parse_catalog(read_yaml(folder / CATALOG_FILE))
    rules = read_yaml(folder / CHECKPOINT_FILE)
    graphs = _load_graphs(folder, graph_names(rules), catalog)
    scene = read_yaml(folder / SCENE_FILE)
    check_scene(scene)
    return Lab(
        folder=folder,
        catalog=catalog,
        graphs=graphs,
        checkpoints=parse_checkpoints(rules, graphs),
        policy=parse_policy(rules),
        frames=parse_frames(rules),
        ros=load_ros(folder),
        submission=load_submission(folder),
        scene=scene,
    )


def _load_graphs(folder: Path, names: list[str], catalog: Catalog) -> dict[str, GraphSpec]:
    graphs: dict[str, GraphSpec] = {}
    for name in names:
        file = f"{name}.yaml"
        if not (folder / file).is_file():
            message = f"{CHECKPOINT_FILE}: asks for the graph '{name}', but there is no {file}"
            raise SpecError(message)
        spec = parse_graph(read_yaml(folder / file), catalog, file)
        if spec.name != name:
            message = f"{file}: describes the graph '{spec.name}', expected '{name}'"
            raise SpecError(message)
        graphs[name] = spec
    return graphs
