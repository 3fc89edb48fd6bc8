"""Reads who is who in a Gradescope export: its folders are numbered, a YAML file has the names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lab3_usd.errors import SpecError
from lab3_usd.spec.yaml_file import read_foreign_yaml

METADATA = "submission_metadata.yml"
_MOST_BYTES = 20_000_000


def names_by_folder(path: Path) -> dict[str, tuple[str, str]]:
    """Return student number and name by folder; empty where the file is absent or not readable.

    Without it the folders keep their numbers, so that nobody is left out.
    """
    try:
        data = read_foreign_yaml(path, _MOST_BYTES)
    except SpecError:
        return {}
    found = {}
    for folder, entry in data.items():
        people = entry.get(":submitters") if isinstance(entry, dict) else None
        if isinstance(people, list) and people and all(isinstance(each, dict) for each in people):
            found[folder] = _who(people, folder)
    return found


def _who(people: list[dict[str, Any]], folder: str) -> tuple[str, str]:
    numbers = [each.get(":sid") or each.get(":email") for each in people]
    names = [each.get(":name") for each in people]
    student = "+".join(str(each) for each in numbers if each)
    return student or folder, ", ".join(str(each) for each in names if each) or folder
