"""Rules about node types: unknown ones, old names, versions and releases."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import TYPE, VERSION, modern_types
from lab3_usd.check.ros.execution import nodes_of_unknown_type
from lab3_usd.check.ros.running import LintSubject
from lab3_usd.check.ros.topics import did_you_mean, likely_type
from lab3_usd.model.changes import SetValue
from lab3_usd.model.finding import Problem
from lab3_usd.model.stage import Node
from lab3_usd.spec.isaac import NEWEST


@rule("K30", "unregistered-type", scope="lint")
def unregistered_type(subject: LintSubject) -> Iterator[Problem]:
    """A node has a type that Isaac Sim does not register, and that is near one it does.

    Why: Isaac Sim leaves a node of an unknown type out when it opens the stage. Names of types
    differ from the names of their extensions, and types were renamed and removed.

    Fix: delete the node, add the one named here from the node list, and connect it as before.

    Example: a ROS2 Context with the prefix of its extension, `ros2.nodes`, not `ros2.bridge`.
    """
    for node in nodes_of_unknown_type(subject):
        of_release, likely = _other_release(node, subject), _likely(node, subject)
        if of_release is None or (likely is None and not of_release):
            continue
        yield Problem(
            node.path,
            f"'{node.type_name}' is not a node type of Isaac Sim {subject.release}{of_release}"
            f"{did_you_mean(likely)}",
            property=TYPE,
            expected=likely,
            actual=node.type_name,
            hint=None
            if likely
            else "replace the node by one that this release has, or use another",
            fix=(SetValue(node.path, TYPE, "token", likely),) if likely else (),
        )


def _other_release(node: Node, subject: LintSubject) -> str | None:
    """Say which other releases have a type: '' where none has, None where this one has it."""
    name = subject.catalog.modern(node.type_name)
    gone = subject.types.releases_of(name)
    if subject.release in gone:
        return None
    if subject.types.is_later(name, subject.release):
        return "; it came with a later release"
    return f"; Isaac Sim {gone[-1]} was the last release with it" if gone else ""


def _likely(node: Node, subject: LintSubject) -> str | None:
    """Return the type that was likely meant, None where none is near."""
    if subject.types.is_later(node.type_name, subject.release):
        return None
    alike = subject.catalog.lookalikes.get(node.type_name)
    return alike or likely_type(node.type_name, subject.catalog.types)


@rule("K31", "deprecated-types", scope="lint", severity="warning", formerly="old-names")
def old_names(subject: LintSubject) -> Iterator[Problem]:
    """Nodes of a graph have type names from before Isaac Sim 4.5.

    Why: Isaac Sim 4.5 and later rename these types when they open the stage, as far as they know
    them. The stage was saved by an older release, whose defaults were others.

    Fix: open the stage in the release that you use, look at the graph, and save it again.

    Example: a ROS2 Context whose type begins with `omni.isaac`.
    """
    for graph in subject.graphs():
        old = [
            node
            for node in (graph.nodes if graph.active else ())
            if subject.catalog.modern(node.type_name) != node.type_name
        ]
        if old:
            now = subject.catalog.modern(old[0].type_name)
            count = (
                "1 node has a type name" if len(old) == 1 else f"{len(old)} nodes have type names"
            )
            yield Problem(
                graph.path,
                f"{count} from before Isaac Sim 4.5: {old[0].type_name}, now {now}",
                expected=now,
                actual=old[0].type_name,
                related=tuple(node.path for node in old),
                fix=tuple(modern_types(old, subject.catalog)),
            )


@rule(
    "K32",
    "unknown-type",
    scope="lint",
    severity="note",
    counted=("unknown node type", "unknown node types"),
)
def unknown_type(subject: LintSubject) -> Iterator[Problem]:
    """Nothing is known of a node type.

    Why: the type may belong to Kit, to an extension or to a script. What its nodes do, and what
    depends on them, is not judged.

    Fix: nothing is wrong. Look yourself at what these nodes feed.

    Example: a node of an extension that somebody wrote.
    """
    paths_by_type: dict[str, list[str]] = {}
    for node in nodes_of_unknown_type(subject):
        of_release = _other_release(node, subject)
        if of_release is None or (_likely(node, subject) is None and not of_release):
            paths_by_type.setdefault(node.type_name, []).append(node.path)
    for name, paths in paths_by_type.items():
        more = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
        yield Problem(
            paths[0],
            f"not judged: the type '{name}' of this node{more} is unknown",
            actual=name,
            related=tuple(paths[1:]),
        )


@rule(
    "K33",
    "newer-version",
    scope="lint",
    severity="note",
    counted=("node of a newer version", "nodes of a newer version"),
)
def newer_version(subject: LintSubject) -> Iterator[Problem]:
    """A node was saved by a newer version of its type than the one that is known.

    Why: ports and defaults may have changed since, so that what is said of this node may be wrong.

    Fix: nothing is wrong. Judge the node by the release that saved it.

    Example: ROS2 Camera Helper of version 4, while 6.0.1 has 3.
    """
    for node in subject.live.values():
        if node.type is None or node.type.is_open or node.version is None:
            continue
        if node.version > node.type.version:
            yield Problem(
                node.path,
                f"{subject.title(node)} has version {node.version}; "
                f"the newest known is {node.type.version}",
                property=VERSION,
                expected=str(node.type.version),
                actual=str(node.version),
            )


@rule(
    "K36",
    "other-release-ports",
    scope="lint",
    severity="note",
    formerly="saved-by-another-release",
    counted=("sign of another release", "signs of another release"),
)
def saved_by_another_release(subject: LintSubject) -> Iterator[Problem]:
    """Nodes have ports that their types have no longer.

    Why: a saved node declares every port of the release that saved it. Some defaults were others
    then: Reset On Stop was off before 6.0. The release that opens the stage takes its own.

    Fix: judge the stage by the release that you use, with `--isaac`; save it again to be sure.

    Example: a ROS2 Camera Helper with `inputs:viewport`, a port of 5.1.
    """
    gone_ports: list[tuple[Node, str, str]] = []
    for node in subject.live.values():
        kind = node.type
        for port in node.ports if kind is not None and subject.release == NEWEST else ():
            releases = subject.types.releases_with(kind.type, port) if kind is not None else []
            if releases:
                gone_ports.append((node, port, releases[-1]))
    if gone_ports:
        node, port, release = gone_ports[0]
        yield Problem(
            node.path,
            f"saved by Isaac Sim {release} or earlier: {port} no longer exists",
            property=port,
            related=tuple(dict.fromkeys(later.path for later, _, _ in gone_ports[1:])),
        )
