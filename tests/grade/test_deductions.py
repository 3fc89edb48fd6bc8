"""What a student reads of lost points: each fault in its own words, and what is carried over."""

from __future__ import annotations

from lab3_usd.grade.deductions import carried_text, reasons
from lab3_usd.grade.scoring import Deduction

RADIUS = "inputs:wheelRadius is 0.25, expected 0.025"
MISSING = "node Make Array is missing"


def lost(requirement: str, points: float, found: str = "", again: str = "") -> Deduction:
    titles = {
        "Drive/setting/controller.radius": "Differential Controller: wheelRadius = 0.025",
        "Drive/node/make_array": "node Make Array",
        "Drive/wire/make_array.input0": "left.value -> make_array.input0",
    }
    title = titles.get(requirement, requirement)
    return Deduction("drive", requirement, title, points, "P01", "work/a.usda:7", found, again)


def test_a_wrong_value_is_said_with_the_value_that_was_found() -> None:
    (line,) = reasons([lost("Drive/setting/controller.radius", 15.0, RADIUS)])
    assert line.text == f"-15.00 Differential Controller: {RADIUS} (P01 work/a.usda:7)"


def test_a_requirement_without_a_named_fault_is_said_as_it_is() -> None:
    (line,) = reasons([lost("Drive/node/make_array", 1.0)])
    assert line.text == "-1.00 node Make Array (P01 work/a.usda:7)"


def test_one_fault_is_one_line_with_all_that_it_costs() -> None:
    names = ("Drive/node/make_array", "Drive/wire/make_array.input0")
    (line,) = reasons([lost(name, 1.5, MISSING) for name in names])
    assert line.text == (f"-3.00 {MISSING} (1 more requirement not met by it) (P01 work/a.usda:7)")


def test_what_is_carried_over_is_one_line_that_unfolds() -> None:
    again = [lost("", 0.5, RADIUS, again="The robot drives"), lost("", 0.25, "", again="The clock")]
    first, last = reasons([lost("Drive/node/make_array", 1.0), *again])
    assert (first.below, last.points, last.title) == ((), 0.75, "carried over from earlier parts")
    assert [line.title for line in last.below] == [f"The robot drives: {RADIUS}", "The clock: "]
    assert carried_text(again) == "carried over into 1 item: -0.75"
    assert carried_text([]) == ""
