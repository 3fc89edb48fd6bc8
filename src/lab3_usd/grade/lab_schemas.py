"""JSON schemas of the files of a lab, made from the records that the files are read into."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cache
from inspect import cleandoc
from pathlib import Path
from typing import Any

import msgspec

from lab3_usd.grade.rubric import Item, RubricFile
from lab3_usd.isaac.load.lab_types import LabTypesFile
from lab3_usd.spec.lab import (
    CATALOG,
    CHECKPOINTS,
    ROS,
    RUBRIC,
    SCENE,
    STARTER,
    SUBMISSION,
    FrameEdge,
)
from lab3_usd.spec.load.checkpoints import CheckpointEntry, CheckpointsFile
from lab3_usd.spec.load.graph_file import GraphFile
from lab3_usd.spec.load.lab import RosFile, SceneFile, SubmissionFile
from lab3_usd.spec.load.starter import PrimEntry, StarterFile
from lab3_usd.spec.ros import Command, EvidenceKind, NavigationSpec, SystemSpec, TopicSpec
from lab3_usd.spec.scene import RobotSpec
from lab3_usd.spec.submission import TEAM, ChecklistSpec, Deliverable

FOLDER = "schemas"  # in a lab, beside its files
GRAPH = "graph.yaml"  # stands for the file of every graph
FILES: Mapping[str, type] = {
    GRAPH: GraphFile,
    CHECKPOINTS: CheckpointsFile,
    SCENE: SceneFile,
    ROS: RosFile,
    SUBMISSION: SubmissionFile,
    RUBRIC: RubricFile,
    STARTER: StarterFile,
    CATALOG: LabTypesFile,
}
_DEFS = "#/$defs/{name}"
# What is read entry by entry: the record of an entry, and its field that the key above it fills.
_ENTRIES: Mapping[tuple[type, str], tuple[type, str]] = {
    (CheckpointsFile, "checkpoints"): (CheckpointEntry, ""),
    (SceneFile, "robots"): (RobotSpec, "name"),
    (RosFile, "topics"): (TopicSpec, "name"),
    (RosFile, "evidence"): (EvidenceKind, "name"),
    (RosFile, "commands"): (Command, ""),
    (SubmissionFile, "deliverables"): (Deliverable, "name"),
    (SubmissionFile, "checklist"): (ChecklistSpec, "section"),
    (RubricFile, "items"): (Item, "id"),
    (StarterFile, "prims"): (PrimEntry, ""),
    (StarterFile, "kinds"): (PrimEntry, ""),
    (PrimEntry, "children"): (PrimEntry, ""),
}
# What is written otherwise than it is kept.
_AS_WRITTEN = {
    (Command, "kind"): {"type": "string"},
    (SystemSpec, "domain"): {"anyOf": [{"type": "integer"}, {"type": "string", "const": TEAM}]},
    (RosFile, "navigation"): {"$ref": _DEFS.format(name=NavigationSpec.__name__)},
}
# What a lab may leave out, as it is laid over that of the bundled lab: of a file, and of a record.
_LAID_OVER, _PARTS_LAID_OVER = (CATALOG,), (NavigationSpec,)


def schema_of(file: str) -> dict[str, Any]:
    """Return the JSON schema of a file of a lab, by its name; any other name is a graph's."""
    definitions = _definitions()
    name = file if file in FILES else GRAPH
    root = dict(definitions[FILES[name].__name__])
    if name in _LAID_OVER:
        root.pop("required", None)
    used: dict[str, Any] = {}
    waiting = _references(root)
    while waiting:
        reference = waiting.pop()
        if reference not in used:
            used[reference] = definitions[reference]
            waiting += _references(used[reference])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **root,
        "title": name,
        "$defs": dict(sorted(used.items())),
    }


def schema_file(file: str) -> str:
    """Return the path of the schema of a file, from the folder of its lab."""
    name = file if file in FILES else GRAPH
    return f"{FOLDER}/{Path(name).stem}.json"


def schema_texts() -> dict[str, str]:
    """Return the text of every schema by its path in a lab."""
    return {
        schema_file(name): json.dumps(schema_of(name), indent=1, ensure_ascii=False) + "\n"
        for name in FILES
    }


def with_schema(file: str, text: str) -> str:
    """Return the text of a file of a lab that names its schema, for editors."""
    return f"# yaml-language-server: $schema={schema_file(file)}\n{text}"


@cache
def _definitions() -> dict[str, dict[str, Any]]:
    """Return the schema of every record that a file holds, by its name."""
    kinds = [*FILES.values(), *(entry for entry, _ in _ENTRIES.values()), *_PARTS_LAID_OVER]
    _, definitions = msgspec.json.schema_components(
        dict.fromkeys(kinds), schema_hook=_hook, ref_template=_DEFS
    )
    for (kind, field), (entry, key) in _ENTRIES.items():
        fields = definitions[kind.__name__]["properties"]
        entries: dict[str, Any] = {"$ref": _DEFS.format(name=entry.__name__)}
        inner = fields[field]
        inner = next((option for option in inner.get("anyOf", ()) if len(option) > 1), inner)
        in_list = {"type": "array", "items": entries}
        if inner["type"] == "array":
            fields[field] = in_list
        else:
            is_of_lists = inner.get("additionalProperties", {}).get("type") == "array"
            of_each = in_list if is_of_lists else entries
            fields[field] = {"type": "object", "additionalProperties": of_each}
        if key:
            described = definitions[entry.__name__]
            described["properties"].pop(key, None)
            described["required"] = [name for name in described["required"] if name != key]
    for (kind, field), written in _AS_WRITTEN.items():
        definitions[kind.__name__]["properties"][field] = written
    for part in _PARTS_LAID_OVER:
        definitions[part.__name__]["required"] = ["handout"]
    for definition in definitions.values():
        if "description" in definition:  # which Pythons before 3.13 indent as the source is
            definition["description"] = cleandoc(definition["description"])
        for schema in _mappings(definition):
            if "anyOf" in schema:  # which releases of msgspec order differently
                schema["anyOf"].sort(key=lambda option: option.get("type") == "null")
    return definitions


def _hook(kind: type) -> dict[str, Any]:
    """Describe a type that msgspec does not know, by how it is written."""
    if kind is FrameEdge:
        return {"type": "string", "pattern": "^\\S+ -> \\S+$"}
    raise NotImplementedError(kind)


def _references(schema: Any) -> list[str]:
    """Return the names of the definitions that a schema refers to."""
    return [part["$ref"].rpartition("/")[2] for part in _mappings(schema) if "$ref" in part]


def _mappings(schema: Any) -> Iterator[dict[str, Any]]:
    """Yield every mapping of a schema, itself included."""
    if isinstance(schema, dict):
        yield schema
        schema = [*schema.values()]
    if isinstance(schema, list):
        for part in schema:
            yield from _mappings(part)
