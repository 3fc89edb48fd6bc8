"""Rules about node types: unknown ones, old names, versions and releases."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import TYPE, can_become, folded_into_readers
from lab3_usd.facts.likely_names import did_you_mean, is_unregistered, meant_type
from lab3_usd.facts.saved_releases import ended_renaming, saved_by
from lab3_usd.facts.stalled_nodes import nodes_of_unknown_type
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.releases import order
from lab3_usd.model.changes import SetValue
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node


@rule("K30", "unregistered-type")
def unregistered_type(subject: LintSubject) -> Iterator[Problem]:
    """An unregistered node type resembles a registered one, or a node has no type.

    Why: Isaac Sim drops nodes of unknown types when it opens the stage. Type names differ from the
    names of their extensions, and types were renamed and removed. A deprecated type, which Kit may
    still have, is a warning.

    Fix: delete the node, add the one named here from the node list, and connect it as before.

    Example: a ROS2 Context with the prefix of its extension, `ros2.nodes`, not `ros2.bridge`.

    Basis: the types that Isaac Sim's source registers. Kit's handling of other types is not public.
    """
    ended = ended_renaming(subject.stage)
    for node in nodes_of_unknown_type(subject.stage):
        successor = subject.platform.deprecated.get(node.type_name)
        if not node.saved_type:
            if ended is None or node.path != ended.prim.path:  # else K48 says so
                yield Problem(
                    node.path,
                    "the node has no type: Isaac Sim drops it",
                    property=TYPE,
                    expected="the type of the node",
                    rests_on=subject.stage.unknown(node.path),
                )
        elif successor is not None:
            yield Problem(
                node.path,
                f"'{node.saved_type}' is deprecated, its successor is {successor}",
                property=TYPE,
                expected=successor,
                actual=node.saved_type,
                severity="warning",
            )
        elif _is_none(node, subject.platform):
            yield _unregistered(node, subject)


def _is_none(node: Node, platform: Platform) -> bool:
    """Whether a type is surely none of a release.

    Where no release has it, the name in the file tells: Isaac Sim may know more of the old names.
    """
    has_releases = bool(platform.releases_of(node.type_name))
    return is_unregistered(node.type_name if has_releases else node.saved_type, platform)


def _unregistered(node: Node, subject: LintSubject) -> Problem:
    """Return the problem of a type that other releases have, or whose name is near to one."""
    platform, is_script = subject.platform, subject.stage.build is not None
    releases = platform.releases_of(node.type_name)
    later = [name for name in releases if order(name) > order(platform.release)]
    # A type that some release has is what was meant.
    likely = None if releases else meant_type(node.saved_type, platform)
    hint, words = "replace the node by one that this release has, or use another", ""
    if later:
        hint += f"; judge by that release with --isaac {later[0]}"
        words = f"; it came with Isaac Sim {later[0]}"
    elif releases:
        words = f"; Isaac Sim {releases[-1]} was the last release with it"
    successor, work = _successor(node, subject)
    kind = platform.types.get(likely or "")
    is_renamed = kind is not None and can_become(node, kind, subject.stage)
    return Problem(
        node.path,
        f"'{node.saved_type}' is not a node type of Isaac Sim {platform.release}{words}"
        f"{did_you_mean(likely)}{work}",
        property=TYPE,
        expected=likely or successor,
        actual=node.saved_type,
        hint=(f"write {likely}" if is_script else None) if likely else hint,
        fix=(SetValue(node.path, TYPE, "token", likely),)
        if likely and is_renamed
        else folded_into_readers(node, subject.stage),
    )


def _successor(node: Node, subject: LintSubject) -> tuple[str | None, str]:
    """Return the type in place of one that is gone, and words about it."""
    platform = subject.platform
    name, change = platform.changes.successor(node.type_name) or ("", None)
    if change is None or name not in platform.types:
        return None, ""
    carried = [
        port if port == now else f"{port} (as {now})"
        for port, now in change.values.items()
        if (state := node.state(INPUT + port)) is not None
        and (state.value is not None or state.sources)
    ]
    notes = f" ({change.notes})" if change.notes else ""
    values = f"; {', '.join(carried)} carry over" if carried else ""
    return name, f"; {platform.types[name].ui_name} does its work{notes}{values}"


@rule("K32", "unknown-type", severity="note", counted=("unknown node type", "unknown node types"))
def unknown_type(subject: LintSubject) -> Iterator[Problem]:
    """A node type is unknown.

    Why: the type may belong to Kit, to an extension or to a script. Its nodes, and everything that
    depends on them, are not judged.

    Fix: nothing is required. Check the nodes that depend on it yourself.

    Example: a node of a third-party extension.
    """
    paths_by_type: dict[str, list[str]] = {}
    for node in nodes_of_unknown_type(subject.stage):
        if node.saved_type and not _is_none(node, subject.platform):
            paths_by_type.setdefault(node.saved_type, []).append(node.path)
    for name, paths in paths_by_type.items():
        more = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
        text = f"not judged: the type '{name}' of this node{more} is unknown"
        yield Problem(paths[0], text, actual=name, related=tuple(paths[1:]))


@rule(
    "K36",
    "other-release-ports",
    severity="note",
    formerly="saved-by-another-release",
    counted=("sign of another release", "signs of another release"),
)
def other_release_ports(subject: LintSubject) -> Iterator[Problem]:
    """Another release of Isaac Sim saved the nodes.

    Why: a saved node has the version of its type and declares every port of the release that saved
    it. Some defaults differ: Reset On Stop was off before 6.0. The release that opens the stage
    uses its own.

    Fix: judge the stage by the release that you use, with `--isaac`; save it again to be sure.

    Example: a ROS2 Camera Helper with `inputs:viewport`, a port of 5.1.
    """
    saved = saved_by(subject.stage)
    strange = () if saved is None else saved.strange
    earlier = subject.moved_from
    if saved is None or not (strange or subject.is_guessed):
        return
    if earlier is not None and earlier.release == saved.release and not subject.is_guessed:
        return  # which was said already
    first = strange[0] if strange else saved.signs[0]
    fits = f"; --isaac {saved.release} fits best"
    if subject.is_guessed:
        fits = f"; taken as saved by {saved.release}"
    elif saved.release == subject.platform.release:
        fits = f", and most others are of {saved.release}"
    yield Problem(
        first.node.path,
        f"saved by another release: {first.what}{fits}",
        property=first.property,
        expected=subject.platform.release,
        actual=saved.release,
        related=tuple(dict.fromkeys(sign.node.path for sign in strange[1:])),
    )
