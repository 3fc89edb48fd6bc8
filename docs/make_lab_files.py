"""Writes `lab-files.md`, every key of a lab, and schemas, from the records of its files.

Run `python docs/make_lab_files.py` after a record has changed; a test compares the two. Examples
are the first values in the bundled lab and in the examples.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lab3_usd.grade.lab_schemas import FILES, GRAPH, schema_of, schema_texts
from lab3_usd.yaml_file import read_yaml

PAGE = Path(__file__).with_name("lab-files.md")
ROOT = PAGE.parent.parent
_EXAMPLES = PAGE.parent / "examples" / "labs"
LABS = (ROOT / "graphs", _EXAMPLES / "jetbot", _EXAMPLES / "warehouse")
INTRODUCTION = """\
# The files of a lab

<!-- Written by docs/make_lab_files.py from the records of the files: change those, not this. -->

Every key of every file, with an example, or its type where no example exists: `[text]` is a list,
`{name: number}` a mapping with names of yours, `|` separates alternatives. A **key** in bold is
required. Another one has its default after `=`, else it is empty or off. Most records also have a
`handout`, the section that asks for it. Lengths are metres, angles degrees, masses kilograms;
only values by the names that USD has for them, as under `set`, are as USD has them.
`lab3 lab schema FILE` prints the complete JSON schema. [The guide](authors.md) shows how to make a
lab.
"""
_LONG = 32  # characters of an example
_Examples = dict[tuple[str, str], str]


def page() -> str:
    """Return the whole page."""
    lines = [INTRODUCTION]
    shown: set[str] = set()
    for file in FILES:
        schema = schema_of(file)
        examples: _Examples = {}
        for path in _paths(file):
            _collect(read_yaml(path), schema, schema, "", examples)
        title = "the file of a graph" if file == GRAPH else f"`{file}`"
        lines += [f"## {title[:1].upper()}{title[1:]}\n", *_record("", schema, examples)]
        for name, record in schema["$defs"].items():
            if _shown(name) not in shown and record.get("properties"):
                shown.add(_shown(name))
                lines += [f"### {_shown(name)}\n", *_record(name, record, examples)]
    return "\n".join(lines)


def _paths(file: str) -> Iterator[Path]:
    """Yield the files of the labs that are of a kind."""
    for lab in LABS:
        if file == GRAPH:
            yield from (path for path in sorted(lab.glob("*.yaml")) if path.name not in FILES)
        elif (lab / file).is_file():
            yield lab / file


def _shown(name: str) -> str:
    """Return the name of a record as it is headed: Link for LinkSpec."""
    return name.rpartition(".")[2].lstrip("_").removesuffix("Spec").removesuffix("Entry")


def _record(name: str, record: Mapping[str, Any], examples: _Examples) -> Iterator[str]:
    """Yield what a record is, and its keys."""
    if record.get("description"):
        yield f"{record['description'].strip()}\n"
    keys = []
    for key, value in record["properties"].items():
        if key == _SECTION and "$ref" not in str(value):
            continue
        example = examples.get((name, key), "")
        parts = [f"**`{key}`**" if key in record.get("required", ()) else f"`{key}`"]
        has_record = "$ref" in str(value)
        if value.get("default") and not has_record:
            default = json.dumps(value["default"])
            parts.append(f"= `{default}`")
            example = "" if example == default else example
        shows_type = bool(example) and example not in _EMPTY and "anyOf" not in value
        if has_record or not (shows_type or value.get("default")):
            parts.append(_type(value) if has_record else f"`{_type(value)}`")
        if shows_type and not has_record:
            parts.append(f"`{example}`")
        keys.append(" ".join(parts))
    yield "\\\n".join(keys) + "\n"


_SECTION = "handout"  # in most records, of the same meaning
_EMPTY = ("{}", "[]")
_NAMES = {"integer": "number", "number": "number", "boolean": "bool", "string": "text"}


def _type(schema: Mapping[str, Any]) -> str:
    """Return what a value may be."""
    if "$ref" in schema:
        name = _shown(schema["$ref"].rpartition("/")[2])
        return f"[{name}](#{name.lower()})"
    if "anyOf" in schema:
        options = [option for option in schema["anyOf"] if option.get("type") != "null"]
        kinds = map(_type, sorted(options, key=lambda option: option.get("type") == "object"))
        return "|".join(dict.fromkeys(kinds))
    if "enum" in schema:
        return "|".join(str(value) for value in schema["enum"] if value)
    kind = schema.get("type")
    if kind == "array":
        fixed = schema.get("prefixItems", ())
        parts = [_type(part) for part in fixed or (schema.get("items") or {},)]
        return f"[{', '.join(parts)}]" if "](" not in parts[0] else f"list of {parts[0]}"
    if kind == "object":
        inner = schema.get("additionalProperties")
        held = _type(inner) if isinstance(inner, dict) else "any"
        return f"{{name: {held}}}" if "](" not in held else f"`name`: {held}"
    return _NAMES.get(str(kind), "any")


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
    """Write the page, and the schemas of the second lab."""
    PAGE.write_text(page(), encoding="utf-8")
    for name, text in schema_texts().items():
        (LABS[1] / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
