"""Rules about the values in a parameter file of Nav2: what ROS 2 reads, and what Nav2 takes."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.registry import rule
from lab3_usd.check.rules.submission.file_values import shortened
from lab3_usd.model.finding import Problem
from lab3_usd.model.folder.lab_files import NavigationSubject, Parameter


def parameter_problem(
    subject: NavigationSubject, parameter: Parameter, message: str, expected: str
) -> Problem:
    """Say what is wrong with a parameter, with its line."""
    return Problem(
        subject.file,
        f"line {parameter.line}: {message}",
        parameter.site,
        expected,
        shortened(parameter.value),
    )


@rule("V09", "plugin-of-another-release", scope="navigation")
def plugin_of_another_release(subject: NavigationSubject) -> Iterator[Problem]:
    """A plugin has the name of another release than Humble.

    Why: Humble names some plugins with a slash, and others with two colons. With another name the
    node cannot load the plugin, and the lifecycle manager activates nothing.

    Fix: write the name that Humble uses.

    Example: `nav2_navfn_planner::NavfnPlanner` instead of `nav2_navfn_planner/NavfnPlanner`, or
    `nav2_controller/SimpleGoalChecker` instead of `nav2_controller::SimpleGoalChecker`.
    """
    navigation = subject.navigation
    ours = {_plain(name): name for name in navigation.plugins}
    for parameter in subject.parameters:
        if parameter.last not in navigation.parameters.plugin:
            continue
        value = str(parameter.value)
        name = ours.get(_plain(value), value)
        if value != name:
            message = f"{parameter.name} is {shortened(value)}, here it is called {name}"
            yield parameter_problem(subject, parameter, message, expected=name)


def _plain(plugin: str) -> str:
    return plugin.replace("::", "/")


@rule("V10", "parameters-refused", scope="navigation")
def parameters_refused(subject: NavigationSubject) -> Iterator[Problem]:
    """The parameter parser of ROS 2 rejects the file.

    Why: the parser stops at the first error, and no node that is started with the file comes up.

    Fix: write all numbers of a list with the same type (`[0.22, 0.0, 1.0]`), give every name a
    value, and write `ros__parameters` with two underscores.

    Example: `max_velocity: [0.22, 0, 1.0]` mixes an integer with floating-point numbers.
    """
    for refusal in subject.refusals:
        message = f"line {refusal.line}: {refusal.why}, which ROS 2 refuses"
        yield Problem(subject.file, message, refusal.name)


@rule("V11", "parameter-of-another-type", scope="navigation")
def parameter_of_another_type(subject: NavigationSubject) -> Iterator[Problem]:
    """A parameter has another type than Nav2 declares.

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
        said = shortened(parameter.value)
        message = f"{parameter.name} is {said} ({_words(actual)}), expected {_words(kind)}"
        yield parameter_problem(subject, parameter, message, expected=kind)


def _words(kind: str) -> str:
    """Say a type: `double_array` is a list of doubles."""
    single = kind.removesuffix("_array")
    if single != kind:
        return f"a list of {single}s"
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"
