"""Which release of Isaac Sim saved a stage, and how far another one renames its node types."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from msgspec import Struct

from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.isaac.releases import order
from lab3_usd.model.finding import node_title
from lab3_usd.model.stage import Node, OldType, StageModel, once_per_stage

_TYPE, _VERSION = "node:type", "node:typeVersion"


class Sign(Struct, frozen=True, eq=False):
    """What tells the releases that may have saved a node."""

    node: Node
    property: str
    what: str
    releases: tuple[str, ...]


class Saved(Struct, frozen=True, eq=False):
    """The release that most signs fit, the latest of several, and all signs.

    `strange` are signs of other releases that the release which opens the stage does not convert.
    """

    release: str
    signs: tuple[Sign, ...]
    strange: tuple[Sign, ...]


class EndedRenaming(Struct, frozen=True, eq=False):
    """The prim at which Isaac Sim stops renaming old types, and those behind it that have some."""

    prim: OldType
    behind: tuple[str, ...]


@once_per_stage
def ended_renaming(stage: StageModel) -> EndedRenaming | None:
    """Return where the renaming of a stage ends when it is opened, None where it comes through.

    `isaacsim/core/deprecation_manager/extension.py:114-146` of v6.0.1 looks at one prim after the
    other: no type raises a TypeError, and a type that two entries of its list match is renamed
    twice, the second time from the root of the stage, or from a prim that refers to an asset.
    """
    for index, prim in enumerate(stage.old_types):
        if _ends_renaming(prim, stage):
            behind = tuple(each.path for each in stage.old_types[index + 1 :] if each.written)
            return EndedRenaming(prim, behind) if behind else None
    return None


def _ends_renaming(prim: OldType, stage: StageModel) -> bool:
    platform = stage.platform
    if not prim.written:
        return order(platform.release) >= order(platform.names.before)
    return platform.changes.breaks.ends_at(prim.written, platform.release) and not prim.in_asset


@once_per_stage
def saved_by(stage: StageModel) -> Saved | None:
    """Return the release that saved a stage, None where nothing tells another one."""
    platform, nodes = stage.platform, live_nodes(stage).values()
    signs = tuple(sign for node in nodes for sign in _signs(node, stage))
    old = tuple(sign for node in nodes for sign in _old_name(node, stage))
    strange = tuple(sign for sign in signs if platform.release not in sign.releases)
    foreign = (*strange, *(sign for sign in old if platform.release not in sign.releases))
    if not foreign:
        return None
    counts = Counter(name for sign in (*signs, *old) for name in sign.releases)
    fitting = max(counts, key=lambda name: (counts[name], order(name)))
    return Saved(fitting, foreign, strange)


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
