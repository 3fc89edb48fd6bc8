"""Rules about what a stage of one release of Isaac Sim meets in another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase

from msgspec.structs import replace

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import rule
from lab3_usd.check.repairs import TYPE
from lab3_usd.facts.feeding import used_nodes
from lab3_usd.facts.reaching_values import effective_value
from lab3_usd.facts.render_products import read_lidars, read_sensors
from lab3_usd.facts.saved_releases import ended_renaming
from lab3_usd.facts.sensor_values import values_of
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.isaac.platform import Platform
from lab3_usd.isaac.release_changes import ANY, GonePort, Meaning, leads_past
from lab3_usd.isaac.releases import order
from lab3_usd.model.changes import ClearValue, RenameProperty, SetValue
from lab3_usd.model.finding import Problem, display, node_title
from lab3_usd.model.stage import Node, Unknown, same_value

_LOOK = "nothing is wrong with the stage: see whether it still does what you want"


@rule("K29", "gone-setting")
def gone_setting(subject: LintSubject) -> Iterator[Problem]:
    """A setting has no effect in this release, and the node behaves differently.

    Why: an earlier release had the port. What it did is now done by something else, and its value
    is not carried over: nothing warns when the stage is opened.

    Fix: do what the finding says in place of the port.

    Example: `inputs:ForceLimit` of a Surface Gripper of 4.5; later ones hold it in a prim.

    Basis: the `.ogn` files and the code of the nodes in both releases.
    """
    changes, platform = subject.platform.changes, subject.platform
    for node in subject.live.values():
        gone = {
            port: change
            for port in node.ports
            if (node.type is not None and node.type.port(port) is None)
            and platform.releases_with(node.type_name, port)
            and (change := changes.gone(node.type_name, port)) is not None
        }
        yield from _without_prim(node, gone)
        for port, change in gone.items():
            other = node.state(change.off_for)
            if not change.off_for or node.ports[port].value is not False or other is None:
                continue
            # A path that leads where the node's target does changes nothing.
            aims = {path for name in node.ports for path in node.targets(name)}
            if other.value and other.value not in aims:
                yield Problem(
                    node.path,
                    f"{change.off_for} is {display(other.value)}, and {port} no longer turns it "
                    f"off: {change.by}",
                    property=change.off_for,
                    actual=display(other.value),
                    expected="no value",
                    fix=(ClearValue(node.path, change.off_for),),
                )


def _without_prim(node: Node, gone: dict[str, GonePort]) -> Iterator[Problem]:
    lost = [port for port, change in gone.items() if change.prim and not node.targets(change.prim)]
    if lost:
        change = gone[lost[0]]
        yield Problem(
            node.path,
            f"of an earlier release: {', '.join(lost)}; {change.by}, and {change.prim} names "
            "none, so the node does nothing",
            property=change.prim,
            expected="a prim",
            covers=tuple((node.path, port) for port in lost),
        )


@rule("K48", "interrupted-renaming", severity="warning")
def interrupted_renaming(subject: LintSubject) -> Iterator[Problem]:
    """Isaac Sim stops renaming old node types at this node.

    Why: when a stage is opened, old type names are replaced one after the other. An error at this
    node ends that, and the nodes behind it in the stage stay unknown: they do nothing. Saving the
    stage then does not help.

    Fix: rename the types in the file before you open it, with `lab3 fix --lint`, and replace this
    node, or give it its type.

    Example: an Ackermann Controller of 4.2 in a stage that is opened in 6.0, or an empty
    `node:type`.

    Basis: `isaacsim/core/deprecation_manager/extension.py:114-146`. When it is run, it raises at an
    Ackermann Controller in 5.1 and 6.0.1, not in 6.2, and at an empty type in 6.0.1 and 6.2.
    """
    ended = ended_renaming(subject.stage)
    if ended is None:
        return
    path, count = ended.prim.path, len(ended.behind)
    behind = "1 node behind it stays" if count == 1 else f"{count} nodes behind it stay"
    yield Problem(
        path,
        f"Isaac Sim {subject.platform.release} stops renaming old types at this node"
        f"{'' if ended.prim.written else ', which has no type'}: {behind} unknown",
        property=TYPE,
        actual=ended.prim.written or None,
        related=ended.behind,
        severity=None if ended.prim.written else "error",
        hint="repair the file before it is opened: lab3 fix --lint",
    )


@rule("K49", "skipped-readings", severity="warning")
def skipped_readings(subject: LintSubject) -> Iterator[Problem]:
    """A helper leaves out readings of a sensor that has a rate of its own.

    Why: since 6.0 Frame Skip Count counts readings of the sensor; before, it counted frames of the
    application. A stage that made 10 Hz of 60 frames now gets a sixth of the rate of the sensor.

    Fix: set Frame Skip Count to 0, and the tick rate of the sensor to the rate that you want.

    Example: `inputs:frameSkipCount = 5` for a lidar with a tick rate of 10.

    Basis: the settings of the application (`base.kit:151`), and NVIDIA's guide to sensor timing.
    """
    skips = subject.platform.changes.skips
    if order(subject.platform.release) < order(skips.since):
        return
    for node, left_out, rate in _skipping(subject):
        published = f"{rate / (left_out + 1):.2f}".rstrip("0").rstrip(".")
        yield Problem(
            node.path,
            f"{skips.input} is {left_out}: {left_out} of {left_out + 1} readings are left out, "
            f"{published} of {rate:g} a second are published",
            property=skips.input,
            expected="0",
            actual=str(left_out),
            fix=(ClearValue(node.path, skips.input),),
            likely=True,
        )


def _skipping(subject: LintSubject) -> Iterator[tuple[Node, int, float]]:
    """Yield the nodes that leave out readings of a sensor, how many, and its rate."""
    skips, names = subject.platform.changes.skips, subject.platform.sensor_models.lidar
    for node, _, prim in read_sensors(subject.stage):
        left_out = effective_value(node, skips.input, subject.live)
        rate = values_of(prim, subject.stage).number(names.rate)
        if isinstance(left_out, int) and left_out > 0 and rate is not None and rate > 0:
            yield node, left_out, rate


@rule(
    "K39",
    "other-release",
    severity="warning",
    counted=("other meaning in this release", "other meanings in this release"),
)
def other_release(subject: LintSubject) -> Iterator[Problem]:
    """The stage behaves differently in this release than in the one that it comes from.

    Why: a port without a value has the default of the release that opens the stage, some values are
    lost, and some mean another thing. Isaac Sim says nothing of it. It is found only with `--from`:
    the stage does not tell which of the two was meant. There is one finding for each change and
    graph.

    Fix: write the value that the stage had before, or accept the other one. What has no repair here
    is for you to look at.

    Example: Isaac Read Simulation Time without a value of Reset On Stop: it is off until 5.1.

    Basis: the `.ogn` files of both releases, their change logs and NVIDIA's migration guides.
    """
    before = subject.moved_from
    if before is None or before.release == subject.platform.release:
        return
    yield from _other_defaults(subject, before)
    yield from _lost_values(subject, before)
    yield from _other_sensors(subject, before)
    for meaning, text in subject.platform.changes.told(before.release, subject.platform.release):
        for problem in _other_meaning(subject, meaning, text):
            yield replace(problem, identity=meaning.id, severity=meaning.severity, hint=_LOOK)


def _other_defaults(subject: LintSubject, before: Platform) -> Iterator[Problem]:
    """Yield the inputs without a value or a wire whose default is another one."""
    places: dict[tuple[str, str, str], list[Node]] = {}
    for node in subject.live.values():
        then = before.types.get(node.type_name)
        if node.type is None or then is None or node.path not in used_nodes(subject.stage):
            continue
        for port in node.type.ports:
            state = node.state(port)
            is_open = state is None or (
                state.value is None and not state.sources and not state.targets
            )
            is_open = is_open and port.startswith(INPUT) and port in then.ports
            is_same = same_value(then.default(port, node.version), node.value(port))
            if is_open and not is_same and not _is_idle(node, port, subject):
                key = (node.path.rpartition("/")[0], node.type_name, port)
                places.setdefault(key, []).append(node)
    changes, releases = subject.platform.changes, (before.release, subject.platform.release)
    for (_, kind, port), nodes in places.items():
        was = before.types[kind].default(port, nodes[0].version)
        now = nodes[0].value(port)
        if was is None or now is None or changes.does_nothing(kind, port, releases[1]):
            continue
        words = changes.defaults.get(port)
        effect = f" ({words[0 if now else 1]})" if words else ""
        usd_type = subject.platform.types[kind].ports[port].usd_type
        message = (
            f"{port} has no value{_more(nodes)}: Isaac Sim {releases[1]} uses "
            f"{display(now)}{effect}, {releases[0]} uses {display(was)}"
        )
        yield replace(
            _at(nodes, message, port),
            expected=display(was),
            actual=display(now),
            hint=f"write {display(was)} to keep what the stage did, or accept {display(now)}",
            fix=tuple(SetValue(node.path, port, usd_type, was) for node in nodes),
            comes_first=port == next(iter(changes.defaults)),  # which most stages meet
        )


def _is_idle(node: Node, port: str, subject: LintSubject) -> bool:
    """Whether a port of a node does nothing, because of the values of other inputs."""
    values = subject.platform.changes.idle.get(node.type_name, {}).get(port, {})
    pairs = ((effective_value(node, other, subject.live), v) for other, v in values.items())
    return bool(values) and all(actual == value for actual, value in pairs)


def _lost_values(subject: LintSubject, before: Platform) -> Iterator[Problem]:
    """Yield the values of ports that only the other release has."""
    places: dict[tuple[str, str, str], list[Node]] = {}
    for node in subject.live.values():
        then = before.types.get(node.type_name)
        if node.type is None or then is None:
            continue
        for port, state in node.ports.items():
            is_lost = port in then.ports and node.type.port(port) is None
            value = None if isinstance(state.value, Unknown) else state.value
            was = then.default(port, node.version)
            is_set = value is not None and not same_value(was, value)
            if is_lost and (is_set or state.targets) and not state.sources:
                key = (node.path.rpartition("/")[0], node.type_name, port)
                places.setdefault(key, []).append(node)
    for (_, kind, port), nodes in places.items():
        gone = subject.platform.changes.gone(kind, port) or GonePort()
        if gone.prim or gone.off_for or gone.drop:
            continue  # which K29 and K21 say, or which does nothing
        instead = f": {gone.by}" if gone.by else ""
        yield _at(
            nodes,
            f"{port} has a value{_more(nodes)}, and {node_title(nodes[0])} has no such port in "
            f"Isaac Sim {subject.platform.release}{instead}",
            port,
        )


def _at(nodes: list[Node], message: str, port: str | None = None) -> Problem:
    """Return the problem of several nodes of one graph."""
    related = tuple(node.path for node in nodes[1:])
    return Problem(nodes[0].path, message, property=port, related=related)


def _more(places: list[Node]) -> str:
    return f" at {len(places)} nodes" if len(places) > 1 else ""


def _other_sensors(subject: LintSubject, before: Platform) -> Iterator[Problem]:
    """Yield what of the sensors that are read counts in one of the two releases alone."""
    changes, models = subject.platform.changes, subject.platform.sensor_models
    since, now, then = changes.sensors.since, subject.platform.release, before.release
    if leads_past(since, then, now):
        whole = models.lidar.whole
        for prim in read_lidars(subject.stage):
            if prim.attributes.get(whole) is None:
                yield Problem(
                    prim.path,
                    f"{whole} has no value: the sensor says now whether each message is a whole "
                    f"turn, and the helper of Isaac Sim {then} saw to it",
                    property=whole,
                    expected="True",
                    fix=(SetValue(prim.path, whole, "bool", value=True),),
                    rests_on=subject.stage.unknown(prim.path),
                )
    elif leads_past(since, now, then):
        for node, left_out, _ in _skipping(subject):
            yield Problem(
                node.path,
                f"{changes.skips.input} is {left_out}: it counts frames of the application here, "
                f"and readings of the sensor in Isaac Sim {then}",
                property=changes.skips.input,
                actual=str(left_out),
            )
        for prim in read_lidars(subject.stage):
            for name in prim.attributes:
                former = [old for old, new in models.renamed.items() if new == name]
                renaming = [RenameProperty(prim.path, name, old) for old in former]
                if former:
                    yield Problem(
                        prim.path,
                        f"{name} is {' or '.join(former)} in Isaac Sim {now}",
                        property=name,
                        expected=former[0],
                        actual=display(prim.attributes[name]),
                        fix=tuple(renaming if len(former) == 1 else ()),
                    )


def _other_meaning(subject: LintSubject, meaning: Meaning, text: str) -> Iterator[Problem]:
    """Yield a change of meaning, once for each graph, robot or asset."""
    if meaning.asset:
        assets = [each for each in subject.stage.unresolved if meaning.asset in each.asset]
        more = f" and {len(assets) - 1} more" if len(assets) > 1 else ""
        for first in assets[:1]:
            yield Problem(first.prim, f"{first.asset}{more}: {text}")
    if meaning.schema:
        for prim in subject.stage.with_api(meaning.schema):
            if prim.present and meaning.lacks not in prim.apis:
                yield Problem(prim.path, text)
    graphs: dict[str, list[Node]] = {}
    for node in subject.live.values():
        is_asked = node.type_name in meaning.types and node.path in used_nodes(subject.stage)
        if is_asked and _means(node, meaning, subject):
            graphs.setdefault(node.path.rpartition("/")[0], []).append(node)
    if sum(map(len, graphs.values())) < meaning.least:
        return
    for nodes in graphs.values():
        where = f"{node_title(nodes[0])}{_more(nodes)}: {text}"
        yield _at(nodes, where, next(iter(meaning.value), None))


def _means(node: Node, meaning: Meaning, subject: LintSubject) -> bool:
    """Whether a change of meaning is about a node as it is."""
    for port, asked in meaning.value.items():
        state = node.state(port)
        is_written = state is not None and state.value is not None
        if not (is_written if asked == ANY else effective_value(node, port, subject.live) == asked):
            return False
    if meaning.port and not any(
        fnmatchcase(port, meaning.port)
        and port not in meaning.but
        and (state.targets or state.sources)
        for port, state in node.ports.items()
    ):
        return False
    return not meaning.attributes or _reads_other(node, meaning.attributes, subject)


def _reads_other(node: Node, names: Iterable[str], subject: LintSubject) -> bool:
    """Whether a node reads a sensor that has one of these attributes otherwise than its schema."""
    for reader, _, prim in read_sensors(subject.stage):
        attributes = values_of(prim, subject.stage).attributes if reader is node else {}
        for name in names:
            value = prim.attributes.get(name)
            if value is not None and name in attributes and attributes[name].default != value:
                return True
    return False
