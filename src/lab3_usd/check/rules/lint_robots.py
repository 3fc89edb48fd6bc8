"""Rules about robots: articulations, odometry, wheels, and who commands their joints."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping

from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.check.registry import Parameter, rule
from lab3_usd.facts.articulations import (
    Command,
    commands,
    commands_of,
    driven_pairs,
    driven_wheels,
    is_empty,
    joints_of,
    named_joints,
    wired_commands,
)
from lab3_usd.facts.endpoints import names_by_node
from lab3_usd.facts.execution_order import live_nodes
from lab3_usd.facts.followed_bodies import Followed, followed_bodies
from lab3_usd.facts.quantities import unit_of
from lab3_usd.facts.reaching_values import effective_value, live_sources
from lab3_usd.facts.wheels import anchor, sizes_of, unknown_shape, wheel_radius
from lab3_usd.isaac.node_types import INPUT
from lab3_usd.model.finding import Problem
from lab3_usd.model.physics import BODY_API, number
from lab3_usd.model.prims import Prim, upwards
from lab3_usd.model.stage import Node, StageModel


@rule("K60", "no-articulation")
def no_articulation(subject: LintSubject) -> Iterator[Problem]:
    """The target of a controller has no articulation.

    Why: the controller looks for the articulation root at its target and below, never above. If
    there is none, or no joint connects a body to it, it logs an error and nothing moves.

    Fix: choose the prim that carries the articulation root, or one above it; the root is a rigid
    body, or above the bodies.

    Example: `inputs:targetPrim` names `/World/robot/base_link`, the root is on `/World/robot`.
    """
    for command in commands(subject.stage):
        is_there = subject.stage.prim(command.robot) is not None
        is_by_path = command.port == command.ports.path
        if not command.robot or not (is_there or is_by_path):
            continue
        if not all(is_empty(root, subject.stage) for root in command.roots):
            continue
        what = "there is no articulation root at or below it"
        if command.roots:
            what = f"no joint connects a body to the articulation root {command.roots[0]}"
        elif not is_there:
            what = "there is no prim at that path"
        yield Problem(
            command.node.path,
            f"{command.port} is {command.robot}, but {what}",
            property=command.port,
            expected="a prim with an articulation root",
            actual=command.robot,
            severity="warning" if is_by_path and subject.is_module else None,
            covers=tuple((root, None) for root in command.roots),
            rests_on=command.unknown,
        )


@rule("K85", "nested-articulation", severity="warning")
def nested_articulation(subject: LintSubject) -> Iterator[Problem]:
    """An articulation root of a commanded robot is below another.

    Why: PhysX does not allow it. Which of the two holds the joints is not defined.

    Fix: remove Articulation Root from one of the two prims.

    Example: `/World/robot` and `/World/robot/base_link` both have an articulation root.

    Basis: OpenUSD's validators reject it, as `NestedArticulation`. PhysX's parser is not public.
    """
    roots = dict.fromkeys(root for command in commands(subject.stage) for root in command.roots)
    for root in roots:
        tops = {top for top in upwards(root.rpartition("/")[0]) if top in roots}
        above = min(tops, key=[*roots].index) if len(tops) > 1 else next(iter(tops), None)
        if above is not None:
            yield Problem(root, f"is an articulation root below another, {above}", related=(above,))


@rule("K67", "odometry-without-body", formerly="no-body-to-follow")
def odometry_without_body(subject: LintSubject) -> Iterator[Problem]:
    """The chassis of odometry is neither body nor articulation root.

    Why: the node logs an error at every update and passes no signal on. Its outputs stay 0:
    odometry shows the robot at its start.

    Fix: choose the robot's base link, a prim with a rigid body, or the one with the articulation
    root. For a prim with the robot schema, its first listed link counts.

    Example: `inputs:chassisPrim` names `/World/robot`, an Xform above the links.
    """
    for odometry in followed_bodies(subject.stage):
        body = odometry.body
        is_empty_root = (  # no body, and an articulation root without joints
            body is not None and BODY_API not in body.apis and is_empty(body.path, subject.stage)
        )
        if not odometry.is_body or is_empty_root:
            yield Problem(
                odometry.node.path,
                f"{odometry.port} is {odometry.prim.path}, {_why_no_body(odometry)}",
                property=odometry.port,
                expected="a rigid body or an articulation root",
                actual=odometry.prim.path,
                rests_on=odometry.unknown,
                assumes=((odometry.body.path, None),) if odometry.body is not None else (),
            )


def _why_no_body(odometry: Followed) -> str:
    if odometry.body is None:
        return f"which lists no link in {odometry.asked.links}"
    fault = "is neither a rigid body nor an articulation root"
    if odometry.is_body:
        fault = "is not a rigid body but an articulation root that no joint connects to a body"
    is_other = odometry.body.path != odometry.prim.path
    return f"and its first link {odometry.body.path} {fault}" if is_other else f"which {fault}"


_SPEED = "linear speed"
_TOLERANCE = Parameter("K64", "tolerance", 0.05, "by what share sizes may differ")  # builders round


@rule(
    "K64",
    "wheel-size",
    severity="warning",
    formerly="wheels-of-another-size",
    parameters=(_TOLERANCE,),
)
def wheel_size(subject: LintSubject) -> Iterator[Problem]:
    """Wheel radius, distance or wheel base differ from the robot's, or between wheels.

    Why: the robot drives faster or slower, or turns more or less, than commanded; odometry that is
    computed from the commands is wrong by the same factor. Wheels of two sizes drive a curve.

    Fix: measure the wheels and set the values in metres, or in stage units if the velocity is
    scaled to them.

    Example: `inputs:wheelRadius = 0.025`, the wheel's collision shape has 0.033.
    """
    tolerance = subject.value(_TOLERANCE)
    for _, controller, pair in driven_pairs(subject.stage):
        one, other = (wheel_radius(joint, subject.stage) or 0.0 for joint in pair)
        if one and other and not math.isclose(one, other, rel_tol=tolerance):
            yield Problem(
                controller.path,
                f"the wheels that it drives have {one:.4g} and {other:.4g} m",
                expected="wheels of one size",
                related=tuple(joint.path for joint in pair),
                rests_on=unknown_shape(pair, subject.stage),
            )
    told: set[tuple[str, str]] = set()  # a controller may drive several pairs
    for _, controller, wheels in driven_wheels(subject.stage):
        yield from _unlike_sizes(controller, wheels, told, subject)


def _unlike_sizes(
    controller: Node,
    wheels: tuple[Prim, ...],
    told: set[tuple[str, str]],
    subject: LintSubject,
) -> Iterator[Problem]:
    """Yield the sizes that a controller states, and that are not those that were measured.

    What is no size at all makes it compute nothing, which is another finding. Each is told once.
    """
    quantity = subject.platform.quantities[controller.type_name]
    sizes = sizes_of(wheels, subject.stage)
    speed = next((INPUT + name for name, taken in quantity.takes.items() if _SPEED in taken), "")
    tolerance = subject.value(_TOLERANCE)
    unit = unit_of(controller, speed, subject.stage)
    units = (1.0, subject.stage.meters_per_unit) if unit is None else (unit,)
    unit_text = "" if unit in {None, 1.0} else f", and the velocity comes in units of {unit:g} m"
    for name, size in quantity.sizes.items():
        port, measured = INPUT + name, sizes.get(size)
        value = number(effective_value(controller, port, subject.live)) or 0.0
        place = (controller.path, port)
        if value <= 0 or not measured or place in told:
            continue
        if not any(math.isclose(value * metres, measured, rel_tol=tolerance) for metres in units):
            told.add(place)
            yield Problem(
                controller.path,
                f"{port} is {value:g}, the wheels measure {measured:.4g} m{unit_text}",
                property=port,
                expected=f"{measured / units[0]:.4g}",
                actual=f"{value:g}",
                related=tuple(joint.path for joint in wheels),
                rests_on=unknown_shape(wheels, subject.stage),
            )


@rule("K65", "joint-commanded-twice", formerly="joint-of-two-controllers")
def joint_commanded_twice(subject: LintSubject) -> Iterator[Problem]:
    """Two nodes command the same joint, or one names it twice.

    Why: each command overwrites the other at every update, and the joint that it was meant for may
    have none. A controller without joint names commands all joints. It is a warning if the names
    come over a wire, as in the graph of the menu for joint states, and the other controller
    commands all joints, and of a copy, which gives the same commands.

    Fix: delete one of the controllers, or give each only its own joints; name each joint once.

    Example: the menu's Differential Controller graph beside another one on the same robot.
    """
    for command in commands(subject.stage):
        if not subject.runs(command.node.path):
            continue
        for name, count in Counter(command.names or ()).items():
            if name and count > 1:
                yield Problem(
                    command.node.path,
                    f"{command.ports.joints} names {name} {count} times",
                    property=command.ports.joints,
                    expected="each joint once",
                    actual=", ".join(command.names or ()),
                )
        rivals = commands_of(command.roots, subject.stage)
        for other in rivals:
            if other is command:
                break
            if not subject.runs(other.node.path):
                continue
            shared, is_sure = _shared(command, other, subject)
            if shared:
                does = "commands" if is_sure else "may command"
                is_copy = _do_the_same(command.node, other.node, subject.stage, set())
                yield Problem(
                    command.node.path,
                    f"{does} {', '.join(shared)}, which {other.node.path} commands as well",
                    property=command.ports.joints,
                    related=(other.node.path,),
                    severity="warning" if is_copy or not is_sure else None,
                )
                break


def _do_the_same(one: Node, other: Node, stage: StageModel, compared: set[tuple[str, str]]) -> bool:
    """Whether two nodes have equal types, values and targets, and so has all that feeds them.

    Topics are compared by their whole names, to which prims above a node may add a namespace.
    """
    if one.path == other.path or (one.path, other.path) in compared:
        return True
    compared.add((one.path, other.path))
    names, live = names_by_node(stage), live_nodes(stage)
    if one.type_name != other.type_name or names.get(one.path) != names.get(other.path):
        return False
    resolved = {INPUT + stage.platform.ros.namespace, *(one.type.topics if one.type else ())}

    def is_alike(port: str) -> bool:
        first, second = (live_sources(node, port, live) for node in (one, other))
        if [name for _, name in first] != [name for _, name in second]:
            return False
        fed = zip(first, second, strict=True)
        return (
            all(_do_the_same(a, b, stage, compared) for (a, _), (b, _) in fed)
            and (bool(first) or one.value(port) == other.value(port))
            and one.targets(port) == other.targets(port)
        )

    ports = {*one.ports, *other.ports} - resolved
    return all(is_alike(port) for port in ports if port.startswith(INPUT))


def _shared(one: Command, other: Command, subject: LintSubject) -> tuple[list[str], bool]:
    """Return the joints that both command by the same kind of command, and whether that is sure."""
    kinds = set(wired_commands(one)) & set(wired_commands(other))
    if not kinds:
        return [], True
    first, second = (named_joints(command, subject.stage) for command in (one, other))
    if first is not None and second is not None:
        return [name for name in first if name in second], True
    # Whatever the other names are, they are among those of a command of all joints.
    named = first or second or []
    return (named if set(named) >= {*joints_of(one, subject.stage)} else []), False


@rule("K66", "joint-order", severity="warning", formerly="left-and-right")
def joint_order(subject: LintSubject) -> Iterator[Problem]:
    """The wheel joints are named right or rear first.

    Why: the controller gives speeds and angles in the order left, right, and an Ackermann
    Controller the speeds of the front wheels before those of the rear. With the names exchanged,
    the robot turns the wrong way, or its wheels slide in turns.

    Fix: exchange the names.

    Example: `jointNames = ["wheel_right_joint", "wheel_left_joint"]`.
    """
    for command, controller, wheels in driven_wheels(subject.stage):
        expected = _in_order(wheels, subject.stage) if len(wheels) in _ORDERS else wheels
        if expected != wheels:
            names = ", ".join(joint.name for joint in wheels)
            unplaced = (subject.stage.unknown_value(joint, "physics:localPos0") for joint in wheels)
            yield Problem(
                command.node.path,
                f"{controller.name} gives the {_ORDERS[len(wheels)]} wheel, but the joint names "
                f"are {names}",
                property=command.ports.joints,
                expected=", ".join(joint.name for joint in expected),
                actual=names,
                related=(controller.path,),
                rests_on=next(filter(None, unplaced), None),
            )


_ORDERS = {
    2: "values of the left and the right",
    4: "values of the front left, front right, rear left and rear right",
}


def _in_order(wheels: tuple[Prim, ...], stage: StageModel) -> tuple[Prim, ...]:
    """Return wheels as a controller has them, the left before the right and the front before."""
    pairs = [(wheels[at], wheels[at + 1]) for at in range(0, len(wheels), 2)]
    if len(pairs) > 1 and _are_swapped(pairs[0][0], pairs[1][0], _ENDS, 0, stage):
        pairs.reverse()
    ordered = (pair[::-1] if _are_swapped(*pair, _SIDES, 1, stage) else pair for pair in pairs)
    return tuple(joint for pair in ordered for joint in pair)


def _are_swapped(
    first: Prim, second: Prim, words: Mapping[str, str], axis: int, stage: StageModel
) -> bool:
    """Whether names say the second of two words before the first, and no place denies it."""
    says_so = [_word(joint, words) for joint in (first, second)] == [*words][::-1]
    one, other = (anchor(joint, stage) for joint in (first, second))
    if one is None or other is None or stage.up_axis != "Z":
        return says_so
    return says_so and one[axis] <= other[axis]


# What names of joints say, and their first letters where these are words.
_SIDES = {"left": "l", "right": "r"}
_ENDS = {"front": "", "rear": ""}


def _word(joint: Prim, words: Mapping[str, str]) -> str | None:
    """Return which of some words the name of a joint says, in full or as a letter."""
    name = joint.name.lower()
    parts = re.split(r"[^a-z]+", name)
    written = (w for w, letter in words.items() if w in name or (letter and letter in parts))
    return next(written, None)
