"""Which links are wheels, and what their rolling does to the machine."""

from __future__ import annotations

import math

from lab3_usd.model.affine import Affine, Vector
from lab3_usd.sim.robot.joints import HINGE, Joint, Wheel
from lab3_usd.sim.robot.machine import Machine

UPRIGHT = 0.5  # an axle that stands steeper rolls nowhere


def bound(machine: Machine, points: list[Vector]) -> None:
    """Note the circle that a machine takes up on the ground."""
    xs, ys = [each[0] for each in points], [each[1] for each in points]
    machine.middle = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
    u, v = machine.middle
    machine.radius = max(math.hypot(x - u, y - v) for x, y in zip(xs, ys, strict=True))


def wheel_at(
    machine: Machine, joint: Joint, points: dict[str, list[Vector]], touch: float
) -> Wheel | None:
    """Return the wheel at a joint, or None where it does not touch or cannot roll."""
    body = next(each for each, parent in machine.parents.items() if parent is joint)
    low = min((each[2] for each in points[body]), default=math.inf)
    if joint.kind != HINGE or low > touch:
        return None
    inner = joint.bodies.index(body)
    frame = Affine(machine.start.rows).then(machine.rest[body]).then(joint.frames[inner])
    x, y, z = frame.origin
    axle = frame.turn(joint.axis)
    flat = math.hypot(axle[0], axle[1])
    if flat < UPRIGHT:
        return None
    sign = 1.0 if inner else -1.0
    return Wheel(joint, sign, (z - low) * flat, (axle[1] / flat, -axle[0] / flat), (x, y))


def solution(wheels: list[Wheel]) -> list[tuple[float, float, float]]:
    """Return for each wheel what a unit of rolling adds to the base's motion (x, y, turn).

    Each wheel rolls as its drive says, if it has one, and none slides along its axle; what is
    left open stays as small as it can be, what contradicts is evened out.
    """
    lines = []
    for number, wheel in enumerate(wheels):
        (x, y), (u, v) = wheel.contact, wheel.along
        if wheel.joint.holds:
            lines.append(((u, v, x * v - y * u), number))
        lines.append(((-v, u, x * u + y * v), -1))
    matrix = [[1e-9 * (i == j) for j in range(3)] for i in range(3)]
    for row, _ in lines:
        for i in range(3):
            for j in range(3):
                matrix[i][j] += row[i] * row[j]
    back = Affine(tuple(map(tuple, matrix))).inverse()  # type: ignore[arg-type]
    found = [(0.0, 0.0, 0.0)] * len(wheels)
    for row, number in lines:
        if number >= 0:
            found[number] = back.turn(row)
    return found
