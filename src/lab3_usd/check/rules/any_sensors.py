"""Rules about several sensors together, with and without a lab."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.match.rule_inputs import ModelSubject
from lab3_usd.check.registry import rule
from lab3_usd.facts.execution_order import run_states
from lab3_usd.facts.render_products import read_sensors
from lab3_usd.facts.sensor_values import values_of
from lab3_usd.isaac.releases import is_release_within
from lab3_usd.model.finding import Problem


@rule("K93", "unequal-lidars")
@rule("L13", "unequal-scan-rates", scope="stage")
def unequal_lidars(subject: ModelSubject) -> Iterator[Problem]:
    """Two lidars are read whose scan rates differ.

    Why: Isaac Sim 6.0 crashes seconds after Play; the next release does not.

    Fix: give all lidars the same scan rate, or read one of them only.

    Example: `omni:sensor:Core:scanRateBaseHz` 10 of one lidar and 20 of the other.

    Basis: IsaacSim issue 718, which NVIDIA has reproduced. The renderer is not public.
    """
    stage, platform = subject.stage, subject.platform
    running = run_states(stage)
    first: dict[tuple[str, str], tuple[str, float]] = {}
    for node, asked, prim in read_sensors(stage):
        if node.path not in running or prim.type not in asked.types:
            continue
        path = prim.path
        for name in asked.equal if is_release_within(platform.release, *asked.equal_in) else ():
            values = values_of(prim, stage)
            rate = values.number(name)
            if rate is None:
                continue
            other = first.setdefault((prim.type, name), (path, rate))
            if other[0] == path or other[1] == rate:
                continue
            (right, expected), (odd, actual) = other, (path, rate)
            if actual == values.default(name):  # more often the other one was changed
                (right, expected), (odd, actual) = (path, rate), other
            yield Problem(
                odd,
                f"{name} is {actual:g}, and {expected:g} at {right}: Isaac Sim "
                f"{platform.release} crashes",
                property=name,
                expected=f"{expected:g}",
                actual=f"{actual:g}",
                related=(right, node.path),
                assumes=((odd, name), (right, name)),
                rests_on=stage.unknown_value(prim, name),
            )
