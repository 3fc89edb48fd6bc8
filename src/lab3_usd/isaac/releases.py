"""The releases of Isaac Sim: their order, and what one has otherwise than another."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from lab3_usd.isaac.node_types import KIND, NodeType, Port

BASE = (
    "6.0"  # the release that the types are written for, and by which a stage is judged by default
)

_OLDEST, _YEARS = 2000, 2100  # years that name releases lie between


def is_release_within(release: str, since: str, until: str) -> bool:
    """Whether a release is one of those from `since` to `until`, '' for no bound."""
    return (not since or order(since) <= order(release)) and (
        not until or order(release) <= order(until)
    )


@lru_cache(maxsize=64)
def order(release: str) -> tuple[int, ...]:
    """Return what sorts releases: those that are named after years came before 4.0."""
    first, *rest = (int(part) for part in release.split("."))
    return (first - _YEARS if first > _OLDEST else first, *rest)


class TypeChanges(Struct, frozen=True):
    """How a node type differs in another release: ports by full name, defaults and tokens.

    `ports` are those that only that release has, `message` kinds of messages. A release that offers
    other kinds and has none of its own takes no others.
    """

    version: int | None = None
    ports: Mapping[str, Port] = {}
    lacks: tuple[str, ...] = ()
    defaults: Mapping[str, Any] = {}
    allowed: Mapping[str, tuple[str, ...]] = {}
    message: Mapping[str, str] = {}


class Release(Struct, frozen=True):
    """What another release has otherwise than the one that the platform describes.

    `has` are types that only the other one has, `lacks` those that it does not have.
    """

    has: Mapping[str, NodeType]
    lacks: tuple[str, ...]
    types: Mapping[str, TypeChanges]


def both_changes(first: TypeChanges | None, second: TypeChanges | None) -> TypeChanges:
    """Return what two sets of changes of one type say, the second one before the first."""
    if first is None or second is None:
        return first or second or TypeChanges()
    return TypeChanges(
        version=second.version or first.version,
        ports={**first.ports, **second.ports},
        lacks=tuple(dict.fromkeys((*first.lacks, *second.lacks))),
        defaults={**first.defaults, **second.defaults},
        allowed={**first.allowed, **second.allowed},
        message={**first.message, **second.message},
    )


def changed(node_type: NodeType, changes: TypeChanges | None) -> NodeType:
    """Return a type as another release has it."""
    if changes is None:
        return node_type
    ports = {name: port for name, port in node_type.ports.items() if name not in changes.lacks}
    for name in ports.keys() & changes.defaults.keys():
        ports[name] = replace(ports[name], default=changes.defaults[name], former=None)
    for name in ports.keys() & changes.allowed.keys():
        ports[name] = replace(ports[name], allowed=changes.allowed[name])
    tf = node_type.tf
    if tf is not None and set(tf.arrays) & set(changes.lacks):
        tf = replace(tf, arrays=())
    kinds = () if changes.message else changes.allowed.get(KIND, ())
    message = {kind: name for kind, name in node_type.message.items() if not kinds or kind in kinds}
    return replace(
        node_type,
        version=changes.version or node_type.version,
        ports={**ports, **changes.ports},
        tf=tf,
        message={**message, **changes.message},
    )
