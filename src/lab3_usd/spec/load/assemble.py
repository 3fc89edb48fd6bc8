"""Puts the lab together out of the files of `graphs/`, each checked against the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from lab3_usd.data import data_folder
from lab3_usd.errors import SpecError
from lab3_usd.spec.catalog import Catalog
from lab3_usd.spec.files import CATALOG, CHECKPOINTS, SCENE
from lab3_usd.spec.graph import GraphSpec
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.load.catalog import parse_catalog
from lab3_usd.spec.load.checkpoints import accumulate, read_checkpoint_file
from lab3_usd.spec.load.graph import parse_graph
from lab3_usd.spec.load.isaac_types import load_isaac_types
from lab3_usd.spec.load.ros import load_ros
from lab3_usd.spec.load.scene import parse_scene
from lab3_usd.spec.load.submission import load_submission
from lab3_usd.spec.yaml_file import read_yaml


def assemble(folder: Path) -> Lab:
    """Read every file of the lab.

    Raises:
        SpecError: a file is missing or wrong.
    """
    said = read_checkpoint_file(read_yaml(folder / CHECKPOINTS))
    files = _graph_files(folder, said.graph_names())
    catalog = _catalog(folder, files)
    graphs = {name: _graph(name, data, catalog) for name, data in files.items()}
    scene = parse_scene(read_yaml(folder / SCENE))
    return Lab(
        folder=folder,
        title=said.title,
        catalog=catalog,
        graphs=graphs,
        checkpoints=accumulate(said, graphs, tuple(scene.sensors)),
        policy=said.policy,
        frames=said.frames,
        ros=load_ros(folder),
        submission=load_submission(folder),
        handout=said.handout,
        scene=scene,
    )


def _catalog(folder: Path, graphs: Mapping[str, Mapping[str, Any]]) -> Catalog:
    """Return the node types of the lab, and those of Isaac Sim that its graphs name besides.

    What the lab's own catalog leaves out is as in the bundled one.
    """
    catalog = parse_catalog(_catalog_data(folder / CATALOG))
    more = sorted(set(_named_types(graphs)) - set(catalog.types))
    known = load_isaac_types().catalog.types if more else {}
    types = {name: known[name] for name in more if name in known}
    return replace(catalog, types={**catalog.types, **types})


def _catalog_data(own: Path) -> dict[str, Any]:
    """Return the lab's own file over that of the bundled lab, type by type."""
    bundled = data_folder("graphs") / own.name
    if own == bundled:
        return read_yaml(own)
    base, said = read_yaml(bundled), read_yaml(own) if own.exists() else {}
    types = said.get("types", {})
    if not isinstance(types, dict):
        return said  # which its reader refuses
    return {**base, **said, "types": {**base["types"], **types}}


def _named_types(graphs: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the node types that files of graphs name; what is wrong in a file is told later."""
    for data in graphs.values():
        nodes = data.get("nodes")
        for node in nodes.values() if isinstance(nodes, dict) else ():
            if isinstance(node, dict) and isinstance(node.get("type"), str):
                yield node["type"]


def _graph_files(folder: Path, names: list[str]) -> dict[str, dict[str, Any]]:
    found = {}
    for name in names:
        file = f"{name}.yaml"
        if not (folder / file).is_file():
            message = f"{CHECKPOINTS}: asks for the graph '{name}', but there is no {file}"
            raise SpecError(message)
        found[name] = read_yaml(folder / file)
    return found


def _graph(name: str, data: Mapping[str, Any], catalog: Catalog) -> GraphSpec:
    file = f"{name}.yaml"
    spec = parse_graph(data, catalog, file)
    if spec.name != name:
        message = f"{file}: describes the graph '{spec.name}', expected '{name}'"
        raise SpecError(message)
    return spec
