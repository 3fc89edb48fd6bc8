"""Which release of Isaac Sim saved a stage, by what of its nodes only some releases have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.isaac.releases import order
from lab3_usd.model.finding import node_title
from lab3_usd.model.stage import Node, StageModel, once_per_stage

_TYPE, _VERSION = "node:type", "node:typeVersion"


class Sign(Struct, frozen=True, eq=False):
    """What tells the releases that may have saved a node."""

    node: Node
    property: str
    what: str
    releases: tuple[str, ...]


class Saved(Struct, frozen=True, eq=False):
    """The release that most signs fit, the last one of several, and all signs.

    The `strange` ones are of other releases than the one by which the stage is judged, which it
    does not make good when it opens the stage.
    """

    release: str
    signs: tuple[Sign, ...]
    strange: tuple[Sign, ...]


@once_per_stage
def saved_by(stage: StageModel) -> Saved | None:
    """Return the release that saved a stage, None where nothing tells another one."""
    platform, nodes = stage.platform, live_nodes(stage).values()
    signs = tuple(sign for node in nodes for sign in _signs(node, stage))
    old = tuple(sign for node in nodes for sign in _old_name(node, stage))
    strange = tuple(sign for sign in signs if platform.release not in sign.releases)
    others = (*strange, *(sign for sign in old if platform.release not in sign.releases))
    if not others:
        return None
    counts = Counter(name for sign in (*signs, *old) for name in sign.releases)
    fitting = max(counts, key=lambda name: (counts[name], order(name)))
    return Saved(fitting, others, strange)


def _signs(node: Node, stage: StageModel) -> Iterator[Sign]:
    """Yield what of a node only some releases have: its type, its version and its ports."""
    types, name = stage.platform, node.type_name
    versions = types.versions(name)
    if versions and node.type is None:
        yield Sign(
            node, _TYPE, f"only {types.named(versions)} has the type {name}", tuple(versions)
        )
    numbers: list[int | None] = [*versions.values()]
    if 0 < numbers.count(node.version) < len(numbers):
        alike = tuple(release for release, number in versions.items() if number == node.version)
        what = f"version {node.version} of {node_title(node)} is that of {types.named(alike)}"
        yield Sign(node, _VERSION, what, alike)
    for port in node.ports:
        has_port = node.type is not None and port in node.type.ports
        releases = () if has_port else types.releases_with(name, port)
        if releases:
            yield Sign(node, port, f"only {types.named(releases)} has {port}", releases)


def _old_name(node: Node, stage: StageModel) -> Iterator[Sign]:
    """Yield the name of a type that only early releases have."""
    platform = stage.platform
    if node.written_type and node.written_type not in platform.names.types:
        before = order(platform.names.before)
        releases = tuple(name for name in platform.known_releases if order(name) < before)
        what = f"{node.written_type} is a name from before Isaac Sim {platform.names.before}"
        yield Sign(node, _TYPE, what, releases)
