"""Reads who is who in a Gradescope export: its folders are numbered, a YAML file has the names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from msgspec import Struct

from lab3_usd.spec.yaml_file import refuse_deep

METADATA = "submission_metadata.yml"
LARGEST = 20_000_000  # bytes
_Safe: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_TOP = re.compile(rb"^(?=[^\s#%-])", re.MULTILINE)  # where an entry of the whole file begins
_NOTHING = {"", "~", "null", "Null", "NULL"}


class _AsText(_Safe):  # type: ignore[misc]  # the base is chosen at run time
    """A safe loader that takes every value as the text it is, whatever its tag says."""

    yaml_constructors: Mapping[Any, Any] = {}
    yaml_multi_constructors: Mapping[Any, Any] = {}
    yaml_implicit_resolvers: Mapping[Any, Any] = {}


class StudentNames(Struct, frozen=True):
    """Student number and name by folder, and in a few words what could not be read."""

    by_folder: Mapping[str, tuple[str, str]]
    fault: str


def read_metadata(path: Path) -> StudentNames:
    """Return who is who from a file; folders that it does not name keep their numbers."""
    try:
        if path.stat().st_size > LARGEST:
            return StudentNames({}, f"it is larger than {LARGEST // 1_000_000} MB")
        return names_in(path.read_bytes())
    except OSError as error:
        return StudentNames({}, f"it cannot be read: {error.strerror}")


def names_in(data: bytes | str) -> StudentNames:
    """Return who is who from the bytes of the file; a text says why there are none."""
    if isinstance(data, str):
        return StudentNames({}, data)
    found: dict[str, tuple[str, str]] = {}
    fault = ""
    for document in _documents(data):
        if isinstance(document, str):
            fault = fault or document
            continue
        for folder, entry in document.items():
            who = _people(entry)
            if isinstance(folder, str) and who:
                found.setdefault(folder, _who(who, folder))
    return StudentNames(found, fault)


def _people(entry: Any) -> list[dict[Any, Any]]:  # noqa: ANN401 - whatever YAML holds
    people = entry.get(":submitters") if isinstance(entry, dict) else None
    return [each for each in people if isinstance(each, dict)] if isinstance(people, list) else []


class _Fault(Struct, frozen=True):
    """What is wrong with a piece of YAML, and after how many lines (-1: not known)."""

    text: str
    line: int = -1


def _documents(data: bytes) -> Iterator[dict[Any, Any] | str]:
    """Yield the whole file, or where it is faulty what can be read of it, and the fault."""
    whole = _loaded(data)
    if not isinstance(whole, _Fault):
        yield whole
        return
    yield whole.text
    begins = [found.start() for found in _TOP.finditer(data)]
    for start, end in zip(begins, [*begins, len(data)][1:], strict=True):
        piece = data[start:end]
        part = _loaded(piece)
        if isinstance(part, _Fault) and part.line > 0:
            part = _loaded(b"\n".join(piece.splitlines()[: part.line]))
        if not isinstance(part, _Fault):
            yield part


def _loaded(data: bytes) -> dict[Any, Any] | _Fault:
    try:
        refuse_deep(data)
        found = yaml.load(data, Loader=_AsText)  # noqa: S506 - a safe loader
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        problem = getattr(error, "problem", None) or "is no YAML"
        mark = getattr(error, "problem_mark", None)
        if mark is None:
            return _Fault(problem)
        return _Fault(f"line {mark.line + 1}: {problem}", mark.line)
    return found if isinstance(found, dict) else _Fault("it is no mapping")


def _who(people: list[dict[Any, Any]], folder: str) -> tuple[str, str]:
    numbers = [_text(each, ":sid") or _text(each, ":email") for each in people]
    names = [_text(each, ":name") for each in people]
    student = "+".join(filter(None, numbers))
    return student or folder, ", ".join(filter(None, names)) or folder


def _text(person: dict[Any, Any], key: str) -> str:
    value = person.get(key)
    return value.strip() if isinstance(value, str) and value.strip() not in _NOTHING else ""
