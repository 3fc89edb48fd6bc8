"""Rules about a parameter file of Nav2 that a student hands in (I3, 8.15, 8.16)."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping

from lab3_usd.check.registry import rule
from lab3_usd.check.rules.files import is_equal, shortened
from lab3_usd.facts.likely_names import did_you_mean, likely_name
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder import NavigationSubject, Parameter
from lab3_usd.spec.ros import ParameterDemand


def _problem(
    subject: NavigationSubject, parameter: Parameter, message: str, expected: str
) -> Problem:
    """Say what is wrong with a parameter, with its line."""
    actual, line = shortened(parameter.value), f"line {parameter.line}"
    return Problem(subject.file, f"{line}: {message}", parameter.site, expected, actual)


def _wrong_value(
    subject: NavigationSubject, parameter: Parameter, why: str, expected: object
) -> Problem:
    """Say that a parameter has a wrong value; `why` ends the message."""
    message = f"{parameter.name} is {shortened(parameter.value)}{why}"
    return _problem(subject, parameter, message, str(expected))


@rule("V09", "other-release-plugin", scope="navigation", formerly="plugin-of-another-release")
def other_release_plugin(subject: NavigationSubject) -> Iterator[Problem]:
    """A plugin has a name that Humble does not know.

    Why: Humble names some plugins with a slash, and others with two colons. With another name the
    node cannot load the plugin, and the lifecycle manager activates nothing. Plugins of packages
    that are no part of Nav2 are not judged.

    Fix: write the name that Humble uses.

    Example: `nav2_navfn_planner::NavfnPlanner` instead of `nav2_navfn_planner/NavfnPlanner`, or
    `differential` instead of `nav2_amcl::DifferentialMotionModel`.
    """
    navigation = subject.navigation
    ours = {_plain(name): name for name in (*navigation.plugins, *navigation.former_plugins)}
    ours |= {_plain(name): now for name, now in navigation.former_plugins.items()}
    packages = {name.partition("/")[0] for name in ours if "/" in name}
    ours |= {
        plain.partition("/")[2]: name for plain, name in reversed(ours.items()) if "/" in plain
    }
    for parameter in subject.parameters:
        if parameter.last not in navigation.parameters.plugin:
            continue
        value = str(parameter.value)
        plain = _plain(value)
        name = ours.get(plain, value)
        if value != name:
            yield _wrong_value(subject, parameter, f", here it is called {name}", name)
        elif plain not in ours and plain.partition("/")[0] in packages:
            likely = likely_name(plain, ours)
            hint = did_you_mean(ours[likely] if likely else None)
            why = f", which is not a plugin of Humble{hint}"
            yield _wrong_value(subject, parameter, why, "a plugin of Humble")


def _plain(plugin: str) -> str:
    return plugin.replace("::", "/")


@rule("V10", "invalid-parameters", scope="navigation", formerly="parameters-refused")
def invalid_parameters(subject: NavigationSubject) -> Iterator[Problem]:
    """The parameter parser of ROS 2 rejects the file.

    Why: the parser stops at the first error, and no node that is started with the file comes up.

    Fix: write all numbers of a list with the same type (`[0.22, 0.0, 1.0]`), give every name a
    value, and write `ros__parameters` with two underscores.

    Example: `max_velocity: [0.22, 0, 1.0]` mixes an integer with floating-point numbers.
    """
    for refusal in subject.refusals:
        message = f"line {refusal.line}: {refusal.why}, which ROS 2 rejects"
        yield Problem(subject.file, message, refusal.name)


@rule("V11", "parameter-type", scope="navigation", formerly="parameter-of-another-type")
def parameter_type(subject: NavigationSubject) -> Iterator[Problem]:
    """A parameter has another type than declared.

    Why: rclcpp converts nothing: the node stops with `Wrong parameter type` when it is configured.

    Fix: write a double with a decimal point (`1.0`), an integer without one, and neither in quotes.

    Example: `robot_radius: 1` where Nav2 declares a double.
    """
    declared = {name: kind for kind, names in subject.navigation.types.items() for name in names}
    refused = {refusal.name for refusal in subject.refusals}
    for parameter in subject.parameters:
        kind, actual = declared.get(parameter.last), parameter.kind
        if not kind or not actual or actual == kind or parameter.site in refused:
            continue
        why = f" ({_words(actual)}), expected {_words(kind)}"
        yield _wrong_value(subject, parameter, why, kind)


def _words(kind: str) -> str:
    """Say a type: `double_array` is a list of doubles."""
    single = kind.removesuffix("_array")
    if single != kind:
        return f"a list of {single}s"
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


@rule("V01", "parameters-unreadable", scope="navigation")
def parameters_unreadable(subject: NavigationSubject) -> Iterator[Problem]:
    """The parameter file cannot be read, or is empty.

    Why: the launch stops, or every node uses its defaults without a message.

    Fix: correct the indentation at the line named here. The values of each node are below
    `ros__parameters:`.

    Example: a tab in the indentation.
    """
    if subject.fault is not None:
        yield Problem(subject.file, f"parameter file {subject.fault}")


@rule("V02", "not-simulation-time", scope="navigation")
def not_simulation_time(subject: NavigationSubject) -> Iterator[Problem]:
    """A node cannot use simulation time.

    Why: the `use_sim_time:=true` of Humble's launch files replaces the value of an existing key,
    and never adds the key. A node without the key uses a clock that is decades ahead of Isaac
    Sim's. Every transform and scan is too old for it, and Nav2 reports timing errors continuously.
    A key with another value than true is replaced: a note.

    Fix: write `use_sim_time: true` under the `ros__parameters` of the node, and start both launch
    files with `use_sim_time:=true`.

    Example: `amcl` without `use_sim_time`.
    """
    name = subject.navigation.parameters.sim_time
    by_node = {p.node: p for p in subject.parameters if p.name == name}
    replaced = [parameter for parameter in by_node.values() if parameter.value is not True]
    if replaced:
        actual = shortened(replaced[0].value)
        kind = "the text " if isinstance(replaced[0].value, str) else ""
        more = f" in {len(replaced)} nodes" if len(replaced) > 1 else ""
        message = (
            f"line {replaced[0].line}: {name} is {kind}{actual}{more}; "
            "right only where the launch replaces it by use_sim_time:=true"
        )
        yield Problem(subject.file, message, replaced[0].site, "true", actual, severity="note")
    if by_node.keys() & {"*", "**"}:
        return
    for node in dict.fromkeys(p.node for p in subject.parameters):
        if _last(node) in subject.navigation.timed and node not in by_node:
            message = f"{name} is absent in {node}, expected true; the launch cannot add it"
            yield Problem(subject.file, message, f"{node}.{name}", "true")


@rule("V03", "wrong-base-frame", scope="navigation")
def wrong_base_frame(subject: NavigationSubject) -> Iterator[Problem]:
    """A node uses a frame that the robot does not have.

    Why: tf2 cannot find it, AMCL never publishes, and the costmaps stay empty.

    Fix: write `{base}`. Any frame of the robot at or below it works.

    Example: `robot_base_frame: base` of another robot.
    """
    robot = [child for _, child in subject.frames.edges]
    for parameter in subject.parameters:
        is_base = parameter.last in subject.navigation.parameters.base_frame
        if is_base and parameter.value not in robot:
            expected = next(iter(subject.frames.deeper), "")
            yield _wrong_value(subject, parameter, ", but the robot has no such frame", expected)


@rule("V04", "wrong-frame", scope="navigation")
def wrong_frame(subject: NavigationSubject) -> Iterator[Problem]:
    """A node uses another fixed frame.

    Why: the TF tree contains `{above} -> {root} -> {base}`. A costmap in `world`, or an AMCL that
    publishes `{above} -> odom_combined`, is not connected to it.

    Fix: write the frame of the lab: `map` for AMCL, planner and global costmap, `odom` for odometry
    and the local costmap.

    Example: `odom_frame_id: world`.
    """
    for wanted in subject.navigation.frames:
        node, name, frame = wanted.node, wanted.name, wanted.frame
        for parameter in subject.parameters:
            is_meant = _last(parameter.node) == node and parameter.name == name
            if is_meant and parameter.value != frame:
                yield _wrong_value(subject, parameter, f", expected {frame}", frame)


@rule("V05", "wrong-scan-topic", scope="navigation")
def wrong_scan_topic(subject: NavigationSubject) -> Iterator[Problem]:
    """AMCL or a costmap subscribes to another scan topic.

    Why: nothing publishes that topic. AMCL never corrects the pose, and obstacles never appear.

    Fix: write `{scan}`.

    Example: `scan_topic: scan_fixed`.
    """
    navigation = subject.navigation
    for parameter in [*_named(subject, navigation.parameters.scan), *_laser_topics(subject)]:
        topic = _topic(parameter.value)
        if topic != navigation.scan_topic:
            is_forbidden = topic == navigation.wrong_scan_topic
            why = ", which the handout forbids" if is_forbidden else ""
            yield _wrong_value(subject, parameter, why, navigation.scan_topic)


@rule("V06", "wrong-map-topic", scope="navigation")
def wrong_map_topic(subject: NavigationSubject) -> Iterator[Problem]:
    """AMCL or the static layer subscribes to another map.

    Why: the map server publishes `{map_topic}`; without it AMCL waits and the global costmap is
    empty.

    Fix: write `map_topic: map`, or remove the line.

    Example: `map_topic: /my_map`.
    """
    navigation = subject.navigation
    for parameter in _named(subject, navigation.parameters.map):
        if _topic(parameter.value) not in {navigation.map_topic, "/"}:
            yield _wrong_value(subject, parameter, "", navigation.map_topic)


@rule("V07", "other-speed", scope="navigation", severity="note")
def other_speed(subject: NavigationSubject) -> Iterator[Problem]:
    """A speed limit differs from the Differential Controller's.

    Why: the graph limits the speed of the robot. With a higher limit in Nav2 the robot is slower
    than Nav2 expects. A lower limit only makes it slower.

    Fix: nothing is required. Write the values expected here to use the same limits.

    Example: `max_vel_x: 0.26`, the default of Nav2.
    """
    navigation = subject.navigation
    names = navigation.parameters
    limits = {
        **dict.fromkeys(names.linear, navigation.linear_speed),
        **dict.fromkeys(names.angular, navigation.angular_speed),
    }
    wanted = [navigation.linear_speed, 0.0, navigation.angular_speed]
    demands = navigation.demands
    for parameter in subject.parameters:
        meant = (demand for demand in demands if _is_meant(parameter, demand, subject))
        if any(_unmet(parameter, demand, subject) for demand in meant):
            continue  # no speed at all
        limit, value = limits.get(parameter.last), parameter.value
        if limit is not None and parameter.kind != "string" and not is_equal(value, limit):
            yield _wrong_value(subject, parameter, f", the graph allows {limit}", limit)
        elif (
            isinstance(value, list)
            and parameter.last in names.speeds
            and not is_equal(value, wanted)
        ):
            yield _wrong_value(subject, parameter, f", the graph allows {wanted}", wanted)


@rule("V08", "stamped-velocity", scope="navigation", severity="warning")
def stamped_velocity(subject: NavigationSubject) -> Iterator[Problem]:
    """Stamped velocity commands, newer than Humble, are enabled.

    Why: Humble ignores it. A later Nav2 would publish TwistStamped, which Isaac Sim's Twist
    subscriber cannot receive, and the robot would never move.

    Fix: remove the line, and check for which release the parameter file was written.

    Example: `enable_stamped_cmd_vel: true`.
    """
    name = subject.navigation.parameters.stamped
    for parameter in subject.parameters:
        if parameter.last == name and parameter.value is True:
            yield _wrong_value(subject, parameter, ", expected plain Twist commands", "false")


@rule("V12", "plugin-without-type", scope="navigation")
def plugin_without_type(subject: NavigationSubject) -> Iterator[Problem]:
    """A list names a plugin that has no block with its type.

    Why: the node reads the type from `plugin` in a block of the plugin's name, and ends without it.
    The lifecycle manager then activates nothing. Only of Nav2's own lists it knows the types.

    Fix: add the block with its `plugin`, or take the name out of the list.

    Example: `planner_plugins: [Fast]` without a block `Fast`.

    Basis: `nav2_util/node_utils.hpp:139-152` of the humble branch; its nodes add the types of their
    own lists alone (`planner_server.cpp:58`, `behavior_server.cpp:44`).
    """
    given = {(_last(parameter.node), parameter.name) for parameter in subject.parameters}
    refused = {refusal.name for refusal in subject.refusals}
    for listing in subject.navigation.plugin_lists:
        for parameter in subject.parameters:
            node = _last(parameter.node)
            is_meant = node in listing.nodes and parameter.name == listing.name
            if not is_meant or parameter.site in refused:
                continue
            value = parameter.value
            names = tuple(map(str, value if isinstance(value, list) else [value]))
            for name in () if names in listing.known else dict.fromkeys(names):
                if name and (node, f"{name}.plugin") not in given:
                    message = f"{parameter.name} names {name}, and {name}.plugin is not set"
                    yield _problem(subject, parameter, message, f"a block {name}")


_NOTHING = (None, "", "[]")  # a footprint that is none (costmap_2d_ros.cpp:410)


@rule("V13", "useless-parameter", scope="navigation")
def useless_parameter(subject: NavigationSubject) -> Iterator[Problem]:
    """A value ends its node, or leaves the robot without a way or a speed.

    Why: each message says what happens.

    Fix: write a value as expected here.

    Example: `max_decel: [2.5, 0.0, 3.2]`, which must be 0 or below: the velocity smoother ends.
    """
    for demand in subject.navigation.demands:
        judged = [p for p in subject.parameters if _is_meant(p, demand, subject)]
        for parameter in judged:
            expected = _unmet(parameter, demand, subject)
            if expected:
                yield _wrong_value(subject, parameter, f": {demand.effect}", expected)
        nodes = dict.fromkeys(p.node for p in subject.parameters if _last(p.node) in demand.nodes)
        for node in nodes if demand.unset else ():
            if not any(parameter.node == node for parameter in judged):
                (name,) = demand.names
                message = f"{name} is absent in {node}: {demand.effect}"
                yield Problem(subject.file, message, f"{node}.{name}", shortened(demand.equals))


def _is_meant(parameter: Parameter, demand: ParameterDemand, subject: NavigationSubject) -> bool:
    is_of_node = not demand.nodes or _last(parameter.node) in demand.nodes
    if not is_of_node or parameter.last not in demand.names:
        return False
    place = (parameter.node, demand.unless)
    values = (p.value for p in subject.parameters if (p.node, p.name) == place)
    return not any(other not in _NOTHING for other in values)


def _unmet(parameter: Parameter, demand: ParameterDemand, subject: NavigationSubject) -> str:
    """Return what a value should be, '' for one that is right; other types are another finding."""
    value = parameter.value
    if demand.equals is not None:
        is_right = not isinstance(value, bool) or value is demand.equals
        return "" if is_right else shortened(demand.equals)
    if demand.like:
        wanted = str(getattr(subject.navigation, demand.like))
        return "" if _topic(value) == wanted else wanted
    numbers = _numbers(value)
    if demand.at_most_of:
        place = (parameter.node, demand.at_most_of)
        lists = [_numbers(p.value) for p in subject.parameters if (p.node, p.name) == place]
        pairs = zip(numbers, lists[0], strict=False) if lists else ()
        return f"at most {demand.at_most_of}" if any(low > high for low, high in pairs) else ""
    ends = [numbers[0], numbers[-1]] if numbers else []
    bounds = (
        (demand.above, numbers, operator.gt, "above"),
        (demand.ends_above, ends, operator.gt, "above"),
        (demand.below, numbers, operator.lt, "below"),
        (demand.at_least, numbers, operator.ge, "at least"),
        (demand.at_most, numbers, operator.le, "at most"),
        (demand.never, numbers, operator.ne, "not"),
    )
    unmet = [
        f"{word} {bound:g}"
        for bound, judged, fits, word in bounds
        if bound is not None and not all(fits(each, bound) for each in judged)
    ]
    return unmet[0] if unmet else ""


def _numbers(value: object) -> list[float]:
    items = value if isinstance(value, list) else [value]
    return [i for i in items if isinstance(i, (int, float)) and not isinstance(i, bool)]


@rule("V14", "source-without-scan", scope="navigation")
def source_without_scan(subject: NavigationSubject) -> Iterator[Problem]:
    """A source of a costmap marks no obstacle.

    Why: without values, a source listens in the namespace of its costmap, and everything above its
    `max_obstacle_height` of 0 m is left out. A scan is not a point cloud. Without `marking`
    obstacles are only cleared.

    Fix: write the values named here for the source.

    Example: `observation_sources: scan` without a block `scan`.

    Basis: `nav2_costmap_2d/plugins/obstacle_layer.cpp`, which declares the defaults.
    """
    for listing, sources in _listed_sources(subject):
        unmarked = []
        for place, values in sources.items():
            if not values:
                name = place.rpartition(".")[2]
                message = f"{listing.name} names {name}, which has no values: it sees no obstacle"
                yield _problem(subject, listing, message, f"a block {name}")
                continue
            marking = values.get("marking")
            unmarked += [marking] if marking is not None and marking.value is False else []
            topic = values.get("topic")
            if topic is None or _topic(topic.value) == subject.navigation.scan_topic:
                yield from _of_scan(values, listing, place, subject)
        if len(unmarked) == len(sources):
            for marking in unmarked:
                yield _wrong_value(subject, marking, ": no obstacle is marked", "true")


def _listed_sources(
    subject: NavigationSubject,
) -> Iterator[tuple[Parameter, dict[str, dict[str, Parameter]]]]:
    """Yield the lists of sources of the costmaps' layers, and the values of each source."""
    for listing in _named(subject, (subject.navigation.parameters.sources,)):
        layer = listing.name.rpartition(".")[0]
        names = listing.value.split() if isinstance(listing.value, str) else ()
        own = [parameter for parameter in subject.parameters if parameter.node == listing.node]
        sources = {}
        for place in (f"{layer}.{name}" if layer else name for name in names):
            values = (parameter for parameter in own if parameter.name.rpartition(".")[0] == place)
            sources[place] = {parameter.last: parameter for parameter in values}
        yield listing, sources


def _of_scan(
    values: Mapping[str, Parameter], listing: Parameter, place: str, subject: NavigationSubject
) -> Iterator[Problem]:
    """Yield what keeps a source from marking what a scan shows."""
    navigation = subject.navigation
    kind, height = values.get("data_type"), values.get("max_obstacle_height")
    if kind is not None and kind.value != navigation.parameters.laser:
        yield _wrong_value(subject, kind, ", the topic has scans", navigation.parameters.laser)
    least = f"above {navigation.scan_height:g}"
    if height is None:
        message = f"{place}.max_obstacle_height is not set: 0 m, below the lidar"
        yield _problem(subject, listing, message, least)
    elif any(number <= navigation.scan_height for number in _numbers(height.value)):
        yield _wrong_value(subject, height, ", below the lidar", least)


def _named(subject: NavigationSubject, names: tuple[str, ...]) -> list[Parameter]:
    return [parameter for parameter in subject.parameters if parameter.last in names]


def _laser_topics(subject: NavigationSubject) -> Iterator[Parameter]:
    """Yield the topics of the laser sources that the layers of the costmaps list."""
    for _, sources in _listed_sources(subject):
        for values in sources.values():
            kind = values.get("data_type")
            if kind is None or kind.value == subject.navigation.parameters.laser:
                yield from (p for name, p in values.items() if name == "topic")


def _last(node: str) -> str:
    return node.rpartition(".")[2]


def _topic(value: object) -> str:
    return "/" + str(value).strip().lstrip("/")
