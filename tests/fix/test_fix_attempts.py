"""Which repairs of a stage are made together: all that help, and none that does harm."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from breaking import correct_stage
from msgspec.structs import replace

from lab3_usd.fix.repairing import (
    USELESS,
    WORSE,
    Attempt,
    deletes_what_waits,
    errors_by_prim,
    most_helpful,
)
from lab3_usd.model.changes import Activate, RemovePrim, Repair
from lab3_usd.model.finding import Finding, Site, site_of
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.edit.session import EditSession

Repaired = Callable[[frozenset[str]], list[str]]


def fault(name: str, prim: str = "/World", *related: str) -> Finding:
    return Finding(
        rule=name,
        name="fault",
        severity="error",
        prim=prim,
        message="",
        related=related,
        fix=Repair("", ()),
    )


def site(name: str) -> Site:
    return site_of(fault(name))


def chosen(asked: str, left: Repaired) -> tuple[str, dict[str, str], int]:
    """What is left of faults named by letters, what was left out and why, after how many tries."""
    tries = 0

    def attempt(kept: frozenset[Site]) -> Attempt:
        nonlocal tries
        tries += 1
        names = left(frozenset(rule for rule, *_ in kept))
        error = "cannot be written" if "!" in names else ""
        return Attempt(tuple(fault(name) for name in names), error=error)

    best, left_out = most_helpful([site(each) for each in asked], attempt)
    after = "".join(each.rule for each in best.after)
    return after, {rule: why for (rule, *_), why in left_out.items()}, tries


def without(asked: str, kept: frozenset[str], **more: str) -> list[str]:
    """The faults that are not repaired, and those which a repair brings."""
    brought = [letter for name in kept for letter in more.get(name, "")]
    return [*(each for each in asked if each not in kept), *brought]


def test_repairs_that_all_help_are_made_at_once() -> None:
    assert chosen("abcd", lambda kept: without("abcd", kept)) == ("", {}, 2)


@pytest.mark.parametrize("bad", "abcde")
def test_one_that_makes_it_worse_is_left_out(bad: str) -> None:
    after, left_out, _ = chosen("abcde", lambda kept: without("abcde", kept, **{bad: "xy"}))
    assert (after, left_out) == (bad, {bad: WORSE})


def test_one_that_cannot_be_written_is_left_out() -> None:
    after, left_out, _ = chosen("abc", lambda kept: without("abc", kept, b="!"))
    assert (after, left_out) == ("b", {"b": "cannot be written"})


def test_one_that_brings_another_fault_to_light_is_made() -> None:
    assert chosen("ab", lambda kept: without("ab", kept, a="x"))[:2] == ("x", {})


@pytest.mark.parametrize("vain", "abcde")
def test_one_that_changes_nothing_that_is_found_is_left_out(vain: str) -> None:
    after, left_out, _ = chosen("abcde", lambda kept: without("abcde", kept, **{vain: vain}))
    assert (after, left_out) == (vain, {vain: USELESS})


@pytest.mark.parametrize(
    "brought", [fault("x", "/Other"), fault("x", "/World", "/Other"), fault("x", "/Worlds")]
)
def test_one_that_brings_a_fault_elsewhere_is_left_out(brought: Finding) -> None:
    def attempt(kept: frozenset[Site]) -> Attempt:
        return Attempt((brought,) if kept else (fault("a"),))

    best, left_out = most_helpful([site("a")], attempt)
    assert (best.after, left_out) == ((fault("a"),), {site("a"): WORSE})


GRAPH = "/turtlebot3_burger/ROS_Drive"
DELETION = Repair("", (RemovePrim(f"{GRAPH}/ros2_context"),))
OTHER = Repair("", (Activate("/turtlebot3_burger"),))


@pytest.mark.parametrize(
    ("prim", "fix", "waits"),
    [
        (GRAPH, None, True),
        ("/turtlebot3_burger", OTHER, True),
        ("/turtlebot3_burger", None, False),
        ("/World", OTHER, False),
        (GRAPH, DELETION, False),
    ],
)
def test_a_node_is_not_deleted_while_what_it_stands_in_waits_for_a_repair(
    prim: str, fix: Repair | None, *, waits: bool
) -> None:
    session = EditSession(correct_stage("02"), load_lab().platform)
    found = replace(fault("x", prim), fix=fix)
    errors = errors_by_prim([found], [DELETION, OTHER])
    assert deletes_what_waits(DELETION, errors, session) == waits


def test_without_repairs_nothing_is_tried() -> None:
    assert chosen("", lambda _: ["a"]) == ("a", {}, 1)
