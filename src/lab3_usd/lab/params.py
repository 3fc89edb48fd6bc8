"""Reads a parameter file of Nav2 as handed in, with the line of every value."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from lab3_usd.check.subjects_lab import NavigationSubject, Parameter
from lab3_usd.lab.plain_yaml import PlainLoader
from lab3_usd.spec.ros_spec import RosSpec
from lab3_usd.spec.spec import FrameSpec

_PARAMETERS = "ros__parameters"


def read_params(
    path: Path, ros: RosSpec, frames: FrameSpec, root: Path | None = None
) -> NavigationSubject:
    """Read a parameter file; what cannot be read is said in the subject, not raised.

    The file is named relative to `root`, by default its own folder.
    """
    base = root if root is not None else path.parent
    try:
        file = path.relative_to(base).as_posix()
    except ValueError:
        file = path.as_posix()
    try:
        parameters = tuple(_parameters(path.read_bytes()))
    except OSError as error:
        return NavigationSubject(ros, frames, file, fault=f"cannot be read ({error.strerror})")
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f", see line {mark.line + 1}" if mark is not None else ""
        return NavigationSubject(ros, frames, file, fault=f"is not YAML{place}")
    fault = None if parameters else f"has no '{_PARAMETERS}'"
    return NavigationSubject(ros, frames, file, parameters, fault)


def _parameters(data: bytes) -> Iterator[Parameter]:
    loader = PlainLoader(data)
    try:
        root = loader.get_single_node()
        repeated = _repeated(root)
        if repeated is not None:
            raise yaml.MarkedYAMLError(problem_mark=repeated.start_mark)
        yield from _nodes(loader, root, ())
    finally:
        loader.dispose()


def _repeated(root: Any) -> Any:  # noqa: ANN401
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


def _nodes(loader: Any, node: Any, names: tuple[str, ...]) -> Iterator[Parameter]:  # noqa: ANN401
    """Find the parameters of every node; `names` are the namespaces and the node above them."""
    for key, value in _pairs(node):
        if key == _PARAMETERS:
            yield from _values(loader, value, ".".join(names), ())
        else:
            yield from _nodes(loader, value, (*names, key.strip("/")))


def _values(loader: Any, node: Any, owner: str, names: tuple[str, ...]) -> Iterator[Parameter]:  # noqa: ANN401
    for key, value in _pairs(node):
        name = (*names, key)
        if isinstance(value, yaml.MappingNode):
            yield from _values(loader, value, owner, name)
        else:
            plain = loader.construct_object(value, deep=True)
            yield Parameter(owner, ".".join(name), plain, value.start_mark.line + 1)


def _pairs(node: Any) -> list[tuple[str, Any]]:  # noqa: ANN401
    """Return names and nodes of a mapping; nothing of what is no mapping."""
    if not isinstance(node, yaml.MappingNode):
        return []
    return [(str(key.value), value) for key, value in node.value if key.id == "scalar"]
