"""The messages of ROS 2 Humble: which there are, and the ports that generic nodes make of them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Protocol

import msgspec
from msgspec.structs import replace

from lab3_usd.data import data_folder
from lab3_usd.isaac.node_types import INPUT, OUTPUT, NodeType, Port

NAMED = ("inputs:messagePackage", "inputs:messageSubfolder", "inputs:messageName")
MESSAGES, SERVICES = "msg", "srv"
_NAME = r"[A-Z][A-Za-z0-9]*"


class _File(msgspec.Struct, forbid_unknown_fields=True):
    about: str
    messages: dict[str, dict[str, str]]


@cache
def messages() -> Mapping[str, Mapping[str, str]]:
    """Return the fields of each message: OGN's word for their types, by the names of the ports."""
    path = data_folder("graphs") / "isaac" / "messages.json"
    return msgspec.json.decode(path.read_bytes(), type=_File).messages


@cache
def _packages() -> Mapping[str, frozenset[str]]:
    """Return the names of the messages of each package."""
    names_of: dict[str, set[str]] = {}
    for kind in messages():
        package, _, name = kind.partition(f"/{MESSAGES}/")
        names_of.setdefault(package, set()).add(name)
    return {package: frozenset(names) for package, names in names_of.items()}


def why_no_message(package: str, folder: str, name: str) -> str:
    """Return why there can be no such message, '' where there may be one.

    A package that ROS 2 Humble does not have may be somebody's own, unless it is one of Humble's
    except for an s at its end.
    """
    if folder not in {MESSAGES, "action"}:
        return f"messages are in {MESSAGES}, not in {folder}"
    if re.fullmatch(_NAME, name) is None:
        return f"{name} is not the name of a message"
    packages = _packages()
    if folder == MESSAGES and package in packages and name not in packages[package]:
        return f"{package} has no {name}"
    for other in (f"{package}s", package.removesuffix("s")):
        if package not in packages and other in packages:
            return f"there is no package {package}, but {other}"
    return ""


def why_no_service(package: str, folder: str, name: str) -> str:
    """Return why there can be no such service, '' where there may be one."""
    if folder != SERVICES:
        return f"services are in {SERVICES}, not in {folder}"
    is_message = name in _packages().get(package, ())
    if is_message or re.fullmatch(_NAME, name) is None:
        return f"{name} is not the name of a service"
    return ""


class Written(Protocol):
    """What is written of a port: its value, and the sources of its wires."""

    @property
    def value(self) -> object:
        """The value, None where there is none."""

    @property
    def sources(self) -> Sequence[str]:
        """The ports that are wired into it."""


def with_named_message(kind: NodeType, written: Mapping[str, Written]) -> NodeType:
    """Return a type with the ports of the message that a node names, unless a wire brings it.

    `written` are the ports of the node by full name.
    """
    if not kind.grows_by_message:
        return kind
    states = {name: written[name] for name in NAMED if name in written}
    if any(state.sources for state in states.values()):
        return kind
    return with_message(
        kind, {name: state.value for name, state in states.items() if state.value is not None}
    )


def with_message(kind: NodeType, values: Mapping[str, object]) -> NodeType:
    """Return a type with the ports that a node of it makes of the message that its values name.

    `values` are by full names of inputs. A type that makes none, and a node whose message is not
    known, keep what they have. Source: OgnROS2Publisher.cpp:535-625: other ports are removed when
    the node computes first, with their wires.
    """
    if not kind.grows_by_message or kind.role not in {"publisher", "subscriber"}:
        return kind
    parts = [values.get(name, kind.default(name, None)) for name in NAMED]
    return _with_fields(kind, "/".join(map(str, parts)))


@lru_cache(maxsize=256)
def _with_fields(kind: NodeType, message: str) -> NodeType:
    fields = messages().get(message)
    if fields is None:
        return kind
    start = INPUT if kind.role == "publisher" else OUTPUT
    ports = {start + field: Port(start + field, ogn, ogn) for field, ogn in fields.items()}
    return replace(kind, ports={**kind.ports, **ports}, grows_by_message=False)
