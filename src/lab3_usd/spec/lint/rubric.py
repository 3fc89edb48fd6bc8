"""Points for checkpoints that do not exist, and checkpoints without points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lab3_usd.spec.files import CHECKPOINTS, RUBRIC
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.fault import LabFault
from lab3_usd.spec.lint.topics import misspelled
from lab3_usd.spec.yaml_file import read_yaml


def rubric_faults(lab: Lab) -> Iterator[LabFault]:
    """Yield what the lab's own rubric leaves out or contradicts.

    Everything else about a rubric is said when points are given (`grade/scoring/`).

    Raises:
        SpecError: the file is no YAML.
    """
    if not (lab.folder / RUBRIC).is_file():
        return
    items = _items(read_yaml(lab.folder / RUBRIC))
    asked = set()
    for name, item in items.items():
        checkpoint = item.get("checkpoint", "")
        asked.add(checkpoint)
        if checkpoint and checkpoint not in lab.checkpoints:
            message = f"there is no checkpoint '{checkpoint}'"
            other = f"{CHECKPOINTS} has {', '.join(lab.checkpoints)}"
            yield LabFault(RUBRIC, f"items: {name}: checkpoint", message, other)
        title = str(item.get("title", ""))
        yield from misspelled(lab, title, RUBRIC, f"items: {name}: title")
    for checkpoint in lab.checkpoints:
        if checkpoint not in asked:
            message = "no item of the rubric gives points for it"
            key = f"checkpoints: '{checkpoint}'"
            yield LabFault(CHECKPOINTS, key, message, f"{RUBRIC}: items", "warning")


def _items(data: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    items = data.get("items")
    if not isinstance(items, dict):
        return {}
    return {name: item for name, item in items.items() if isinstance(item, dict)}
