"""Reads a parameter file of Nav2 as handed in, with the line of every value."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from lab3_usd.deliverables.plain_yaml import NOT_YAML, PlainLoader, not_yaml
from lab3_usd.errors import SpecError
from lab3_usd.model.folder import NavigationSubject, Parameter, Refusal, kind_of
from lab3_usd.spec.lab import FrameSpec
from lab3_usd.spec.ros import RosSpec

_PARAMETERS = "ros__parameters"
_EXPONENT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")
_ALIKE = re.compile(r"ros_*param(eter)?s?", re.IGNORECASE)


def read_params(
    path: Path, ros: RosSpec, frames: FrameSpec, root: Path | None = None
) -> NavigationSubject:
    """Read a parameter file; a read error is a fault of the subject, not an exception.

    The file is named relative to `root`, by default its own folder.

    Raises:
        SpecError: the lab has no navigation.
    """
    base = root if root is not None else path.parent
    try:
        file = path.relative_to(base).as_posix()
    except ValueError:
        file = path.as_posix()
    navigation = ros.navigation
    if navigation is None:
        raise SpecError(
            "ros.yaml: 'navigation' is missing, so that parameters of Nav2 cannot be judged"
        )
    names = navigation.parameters.rewritten
    try:
        entries = tuple(_entries(path.read_bytes(), names))
    except OSError as error:
        return NavigationSubject(
            ros, navigation, frames, file, fault=f"cannot be read ({error.strerror})"
        )
    except NOT_YAML as error:
        return NavigationSubject(ros, navigation, frames, file, fault=not_yaml(error))
    parameters = tuple(parameter for parameter in entries if isinstance(parameter, Parameter))
    refusals = tuple(refusal for refusal in entries if isinstance(refusal, Refusal))
    fault = None if entries else f"has no '{_PARAMETERS}'"
    return NavigationSubject(ros, navigation, frames, file, parameters, refusals, fault)


def _entries(data: bytes, rewritten: Sequence[str]) -> Iterator[Parameter | Refusal]:
    loader = PlainLoader(data)
    try:
        root = loader.get_single_node()
        repeated = _repeated(root)
        if repeated is not None:
            raise yaml.MarkedYAMLError(problem_mark=repeated.start_mark)
        for node in _nodes(loader, root, ()):
            why = _refusal_text(node, rewritten) if isinstance(node, Parameter) else None
            yield node
            if why is not None and isinstance(node, Parameter):
                yield Refusal(node.site, f"'{node.name}' {why}", node.line)
    finally:
        loader.dispose()


def _refusal_text(parameter: Parameter, rewritten: Sequence[str]) -> str | None:
    """Say why the parser of ROS 2 refuses a value (rcl_yaml_param_parser/src/parse.c)."""
    value = parameter.value
    if value is None:
        return None if parameter.last in rewritten else "has no value"
    if not isinstance(value, list):
        return None
    if any(isinstance(item, list) for item in value):
        return "is a list of lists"
    kinds = list(dict.fromkeys(kind_of(item) or "nothing" for item in value))
    return f"mixes {' and '.join(kinds)} in one list" if len(kinds) > 1 else None


def _repeated(root: Any) -> Any:
    """Return a node that the file repeats by an alias, which ROS 2 does not read either."""
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, yaml.CollectionNode):
            if id(node) in seen:
                return node
            seen.add(id(node))
            for part in node.value:
                waiting.extend(part if isinstance(part, tuple) else [part])
    return None


def _nodes(
    loader: Any,
    node: Any,
    names: tuple[str, ...],
) -> Iterator[Parameter | Refusal]:
    """Find the parameters of every node; `names` are the namespaces and the node above them."""
    for key, value in _pairs(node):
        place, line = ".".join((*names, key)), value.start_mark.line + 1
        inside = isinstance(value, yaml.MappingNode)
        if key == _PARAMETERS or (inside and _ALIKE.fullmatch(key)):
            if key != _PARAMETERS:
                yield Refusal(place, f"'{key}' is not '{_PARAMETERS}'", line - 1)
            elif not (inside and names):
                yield Refusal(place, f"'{key}' needs a node above and values below it", line)
            yield from _values(loader, value, ".".join(names), ())
        elif inside:
            yield from _nodes(loader, value, (*names, key.strip("/")))
        else:
            yield Refusal(place, f"'{key}' is outside '{_PARAMETERS}'", line)


def _values(loader: Any, node: Any, owner: str, names: tuple[str, ...]) -> Iterator[Parameter]:
    for key, value in _pairs(node):
        name = (*names, key)
        if isinstance(value, yaml.MappingNode):
            yield from _values(loader, value, owner, name)
        else:
            plain = _as_number(loader.construct_object(value, deep=True))
            yield Parameter(owner, ".".join(name), plain, value.start_mark.line + 1)


def _as_number(value: object) -> object:
    """Return the number that a text is for ROS 2 and not for YAML 1.1: `5e-2` without a point."""
    if isinstance(value, list):
        return [_as_number(item) for item in value]
    return float(value) if isinstance(value, str) and _EXPONENT.fullmatch(value) else value


def _pairs(node: Any) -> list[tuple[str, Any]]:
    """Return names and nodes of a mapping; nothing of what is no mapping."""
    if not isinstance(node, yaml.MappingNode):
        return []
    return [(str(key.value), value) for key, value in node.value if key.id == "scalar"]
