"""Writes `lab-files.md`, the reference of every key of a lab, from the records of its files.

Run `python docs/make_lab_files.py` after a record has changed; a test compares the two. Examples
are the first values in the bundled lab and in the second one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lab3_usd.grade.lab_schemas import FILES, GRAPH, schema_of
from lab3_usd.spec.yaml_file import read_yaml

PAGE = Path(__file__).with_name("lab-files.md")
ROOT = PAGE.parent.parent
LABS = (ROOT / "graphs", PAGE.parent / "examples" / "labs" / "jetbot")
INTRODUCTION = """\
# The files of a lab

<!-- Written by docs/make_lab_files.py from the records of the files: change those, not this. -->

Every key of every file, with its type, its default and an example. A key without a default must be
there. `lab3 lab schema FILE` prints the same as a JSON schema; [the guide](authors.md) shows how a
lab is made. Lengths are metres, angles degrees, masses kilograms. `<name>` stands for
names of yours.
"""
_LONG = 60  # characters of an example
_Examples = dict[tuple[str, str], str]


def page() -> str:
    """Return the whole page."""
    lines = [INTRODUCTION]
    told: set[str] = set()
    for file in FILES:
        schema = schema_of(file)
        examples: _Examples = {}
        for path in _paths(file):
            _collect(read_yaml(path), schema, schema, "", examples)
        title = "the file of a graph" if file == GRAPH else f"`{file}`"
        lines += [f"## {title[:1].upper()}{title[1:]}\n", *_record("", schema, examples)]
        for name, record in schema["$defs"].items():
            if _shown(name) not in told and record.get("properties"):
                told.add(_shown(name))
                lines += [f"### {_shown(name)}\n", *_record(name, record, examples)]
    return "\n".join(lines)


def _paths(file: str) -> Iterator[Path]:
    """Yield the files of the two labs that are of a kind."""
    for lab in LABS:
        if file == GRAPH:
            yield from (path for path in sorted(lab.glob("*.yaml")) if path.name not in FILES)
        elif (lab / file).is_file():
            yield lab / file


def _shown(name: str) -> str:
    """Return the name of a record as it is headed: Link for LinkSpec."""
    return name.rpartition(".")[2].lstrip("_").removesuffix("Spec").removesuffix("Entry")


def _record(name: str, record: Mapping[str, Any], examples: _Examples) -> Iterator[str]:
    """Yield what a record is, and a table of its keys."""
    if record.get("description"):
        yield f"{record['description'].strip()}\n"
    yield "| key | type | default | example |"
    yield "|---|---|---|---|"
    for key, value in record["properties"].items():
        example = examples.get((name, key), "")
        default = ""
        if key not in record.get("required", ()):
            default = _code(json.dumps(value["default"])) if "default" in value else "none"
        cells = (f"`{key}`", _type(value), default, _code(example) if example else "")
        yield f"| {' | '.join(cells)} |"
    yield ""


def _code(text: str) -> str:
    return f"`{text}`".replace("|", "\\|")


_NAMES = {
    "string": "text",
    "integer": "whole number",
    "number": "number",
    "boolean": "true or false",
}


def _type(schema: Mapping[str, Any]) -> str:
    """Return what a value may be."""
    if "$ref" in schema:
        name = _shown(schema["$ref"].rpartition("/")[2])
        return f"[{name}](#{name.lower()})"
    if "anyOf" in schema:
        kinds = (_type(option) for option in schema["anyOf"] if option.get("type") != "null")
        return " or ".join(dict.fromkeys(kinds))
    if "enum" in schema:
        return "one of " + ", ".join(f"`{value}`" for value in schema["enum"] if value)
    kind = schema.get("type")
    if kind == "array":
        inner = schema.get("items")
        length = len(schema.get("prefixItems", ()))
        return f"list of {_type(inner) if isinstance(inner, dict) else length}"
    if kind == "object":
        inner = schema.get("additionalProperties")
        return f"`<name>`: {_type(inner)}" if isinstance(inner, dict) else "mapping"
    return _NAMES.get(str(kind), "any value")


def _collect(
    data: Any, schema: Mapping[str, Any], whole: Mapping[str, Any], name: str, examples: _Examples
) -> None:
    """Keep the first value of each key of each record."""
    for option in (schema, *schema.get("anyOf", ())):
        if "$ref" in option:
            name = option["$ref"].rpartition("/")[2]
            _collect(data, whole["$defs"][name], whole, name, examples)
    if isinstance(data, dict):
        for key, value in data.items():
            inner = schema.get("properties", {}).get(key)
            if inner is not None:
                examples.setdefault((name, key), _example(value))
            else:
                inner = schema.get("additionalProperties")
            if isinstance(inner, dict):
                _collect(value, inner, whole, name, examples)
    elif isinstance(data, list) and isinstance(schema.get("items"), dict):
        for value in data:
            _collect(value, schema["items"], whole, name, examples)


def _example(value: Any) -> str:
    """Return a value in one line of YAML, cut where it is long."""
    text = json.dumps(value, ensure_ascii=False)
    if len(text) <= _LONG:
        return text
    return "" if isinstance(value, dict) else f"{text[: _LONG - 3]}..."


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
