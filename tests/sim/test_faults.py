"""Each kind of fault is shown by a stage or a recording, and explained by a rule."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import cache
from typing import get_args

import pytest
from breaking import broken, correct_stage
from dry_runs import DRIVE, EXPECTED, SHORT, TO_THE_WALL, driven
from fault_stages import IMAGE_PRODUCT, MOTION, NAMES, STAGES
from golden import assert_golden_case
from linting import linted
from places import REPOSITORY
from scene_stages import CAMERA

from lab3_usd.check.explanations import EXPLAINED_BY
from lab3_usd.check.registry import all_rules
from lab3_usd.model.dry_run import Affine, about
from lab3_usd.model.fault import FaultKind
from lab3_usd.sim.execution.drive import Leg, Session, drive_of
from lab3_usd.sim.execution.recording import Message, Odometry, Pose, Recording
from lab3_usd.sim.judge.checks import CHECKS
from lab3_usd.sim.judge.expectations import RunFault, Trial
from lab3_usd.sim.judge.motion import odometry

KINDS: frozenset[FaultKind] = frozenset(get_args(FaultKind))


def sources() -> Iterator[str]:
    for path in sorted((REPOSITORY / "src" / "lab3_usd" / "sim").rglob("*.py")):
        yield path.read_text(encoding="utf-8")


IDS = {rule for pair in EXPLAINED_BY.values() for rule in pair if rule}


def test_each_kind_is_explained_by_a_rule() -> None:
    assert EXPLAINED_BY.keys() == KINDS
    assert set(all_rules()) >= IDS
    assert all(of_lab for of_lab, _ in EXPLAINED_BY.values())


LINTED = {kind: of_lint for kind, (_, of_lint) in EXPLAINED_BY.items() if of_lint}
OF_THE_LAB = "disconnected-frame"  # its stage has one tree, but not below the root of the lab


@pytest.mark.parametrize("kind", sorted(STAGES.keys() & LINTED.keys() - {OF_THE_LAB}))
def test_lint_finds_the_fault_that_its_rule_explains(kind: FaultKind) -> None:
    change, check = STAGES[kind]
    stage = correct_stage("02" if check in MOTION else "05")
    change(stage)
    assert LINTED[kind] in {finding.rule for finding in linted(stage).findings}


def test_what_it_does_wrong_again_has_the_rule_of_the_first_time() -> None:
    found = faults("wrong-distance")
    assert {EXPLAINED_BY[fault.kind][0] for check, fault in found if check == "again"} == {"P01"}


def test_the_dry_run_knows_no_rule() -> None:
    words = {word for text in sources() for word in re.findall(r"\w+", text)}
    assert words & {*all_rules(), *IDS} == set()


def faults_of(trial: Trial) -> list[tuple[str, RunFault]]:
    return [(name, fault) for name, look in CHECKS.items() for fault in look.faults(trial)]


def shown(faults: list[tuple[str, RunFault]]) -> set[tuple[str, FaultKind]]:
    return {(check, fault.kind) for check, fault in faults}


@cache
def faults(kind: FaultKind) -> list[tuple[str, RunFault]]:
    change, check = STAGES[kind]
    stage = correct_stage("02" if check in MOTION else "05")
    change(stage)
    takes_long = check in {*MOTION, "clock"}
    whole = TO_THE_WALL if kind == "wall-ahead" else DRIVE
    return faults_of(driven(stage, whole if takes_long else SHORT))


@pytest.mark.parametrize("kind", STAGES)
def test_a_stage_shows_its_kind_of_fault_in_the_words_that_were_kept(kind: FaultKind) -> None:
    assert (STAGES[kind][1], kind) in shown(faults(kind))
    assert_golden_case("dry-run-faults", kind, fault_text(faults(kind)))


def fault_text(found: list[tuple[str, RunFault]]) -> str:
    return "".join(
        f"{check} {fault.kind}{'' if fault.sure else ' (not sure)'}: {fault.message}\n"
        f"    {fault.prim} {fault.cause}".rstrip()
        + "\n"
        for check, fault in found
    )


def test_a_render_product_that_is_named_has_its_own_size() -> None:
    product = "/Render/Product"
    steps = [
        {"define": [product, "RenderProduct"]},
        {"targets": [f"{product}.camera", CAMERA]},
        {"declare": [f"{product}.resolution", "int2", [320, 200]]},
        {"targets": [f"{IMAGE_PRODUCT}.inputs:renderProductPrim", product]},
    ]
    trial = driven(broken("04", steps))
    (image, *_) = trial.recording.topic("/camera/image_raw")
    assert (image.data.width, image.data.height) == (320, 200)


def test_wheels_in_the_wrong_order_turn_an_arc_the_wrong_way() -> None:
    stage = broken("02", [{"swap": [f"{NAMES}.inputs:input0", f"{NAMES}.inputs:input1"]}])
    drive = drive_of("0.1,0.5,2", EXPECTED.limits)
    trial = driven(stage, drive)
    assert ("follows", "wrong-arc") in shown(faults_of(trial))


def odometry_faults(x: float, y: float, turned: float) -> list[RunFault]:
    """Judge what odometry reports of a robot that starts at (1, 2), looking along +Y.

    It goes 0.5 m ahead and turns by 0.2 rad to the left: to (1, 2.5), looking by pi/2 + 0.2.
    """
    poses = [
        Pose(0, 1.0, "idle", 1.0, 2.0, math.pi / 2),
        Pose(0, 2.0, "idle", 1.0, 2.5, math.pi / 2 + 0.2),
    ]
    orientation = Affine(about((0.0, 0.0, 1.0), turned)).quaternion()
    data = Odometry("base_footprint", (x, y, 0.0), orientation, (0.0,) * 3, (0.0,) * 3)
    message = Message("", 2.0, "odom", data, topic="/odom", at=2.0)
    run = Recording(2.0, [message], poses)
    return list(odometry(Trial(run, (Session((Leg("idle", 2.0),)),), EXPECTED)))


def test_odometry_is_held_against_the_way_of_the_robot() -> None:
    assert odometry_faults(0.5, 0.0, 0.2) == []
    assert odometry_faults(0.519, 0.0, 0.2) == []  # within 2 cm
    (fault,) = odometry_faults(0.0, 0.5, 0.2)
    assert fault.kind == "wrong-odometry-pose"
    assert fault.message == "odometry reports (0.00, 0.50), it went (0.50, 0.00)"
    assert odometry_faults(0.5, 0.021, 0.2) != []


def test_odometry_is_held_against_the_heading_of_the_robot() -> None:
    assert odometry_faults(0.5, 0.0, 0.2 + math.radians(1.9)) == []  # within 2 degrees
    (fault,) = odometry_faults(0.5, 0.0, 0.3)
    assert fault.kind == "wrong-odometry-pose"
    assert fault.message == "odometry reports 17 degrees, another angle than it turned"
