"""Ground that moves carries no robot; ground that stays does, however it is held."""

from __future__ import annotations

import pytest
from scene_stages import (
    FLOOR,
    Change,
    built,
    define,
    findings_of,
    several,
    slab,
    switch,
    told,
    told_after,
    weld,
    with_api,
    without_api,
)

from lab3_usd.stage.compare.value_terms import applied_schemas

SLAB, BODY, KINEMATIC = "/World/Slab", "PhysicsRigidBodyAPI", "physics:kinematicEnabled"
FALLS = {
    "a plane": with_api(FLOOR, BODY),
    "what holds the plane": with_api("/Environment", BODY),
    "a slab": several(slab, with_api(SLAB, BODY)),
    "a plane on a joint that turns": several(
        with_api(FLOOR, BODY), weld("/World/hinge", "PhysicsRevoluteJoint", body1=FLOOR)
    ),
    "a plane on a joint that is off": several(
        with_api(FLOOR, BODY),
        weld("/World/anchor", body1=FLOOR),
        switch("/World/anchor", "physics:jointEnabled"),
    ),
    "a plane on a joint to nothing": several(
        with_api(FLOOR, BODY), weld("/World/anchor", body0="/World/Gone", body1=FLOOR)
    ),
    "a plane on another body": several(
        with_api(FLOOR, BODY),
        with_api("/World/ObservationCamera", BODY),
        weld("/World/anchor", body0="/World/ObservationCamera", body1=FLOOR),
    ),
    "a plane that says it is not kinematic": several(
        with_api(FLOOR, BODY), switch(FLOOR, KINEMATIC)
    ),
}


@pytest.mark.parametrize("checkpoint", ["00", "02"])
@pytest.mark.parametrize("change", FALLS.values(), ids=FALLS)
def test_a_ground_that_falls_is_no_ground(change: Change, checkpoint: str) -> None:
    stage = built(checkpoint)
    change(stage)
    (found,) = (finding for finding in findings_of(stage, checkpoint) if finding.rule == "S13")
    assert BODY in applied_schemas(stage.GetPrimAtPath(found.prim))
    assert found.unmet == ("Scene/ground",)


STAYS = {
    "a plane that collides by a prim above it": several(
        without_api(FLOOR, "PhysicsCollisionAPI"), with_api("/Environment", "PhysicsCollisionAPI")
    ),
    "a body without a switch on": several(
        with_api(FLOOR, BODY), switch(FLOOR, "physics:rigidBodyEnabled")
    ),
    "a kinematic body": several(with_api(FLOOR, BODY), switch(FLOOR, KINEMATIC, on=True)),
    "a kinematic slab": several(slab, with_api(SLAB, BODY), switch(SLAB, KINEMATIC, on=True)),
    "a switch without a body": switch(FLOOR, "physics:rigidBodyEnabled", on=True),
    "a body that is fixed": several(with_api(FLOOR, BODY), weld("/World/anchor", body1=FLOOR)),
    "a body that is fixed the other way round": several(
        with_api(FLOOR, BODY), weld("/World/anchor", body0=FLOOR)
    ),
    "a body that is fixed to a fixed one": several(
        with_api(FLOOR, BODY),
        with_api("/World/ObservationCamera", BODY),
        weld("/World/anchor", body0="/World/ObservationCamera", body1=FLOOR),
        weld("/World/more", body0="/World/ObservationCamera"),
    ),
    "a wall that falls": with_api("/Environment/Walls/East", BODY),
    "all walls": with_api("/Environment/Walls", BODY),
}


@pytest.mark.parametrize("change", STAYS.values(), ids=STAYS)
def test_a_ground_that_stays_carries_the_robot(change: Change) -> None:
    assert [each for each in told_after("02", change) if each[0] in ("S13", "S19")] == []


def test_a_second_ground_that_stays_is_enough() -> None:
    stage = built("00")
    several(
        with_api(FLOOR, BODY),
        define("/World/Plane", "Plane"),
        with_api("/World/Plane", "PhysicsCollisionAPI"),
    )(stage)
    assert told(stage, "00") == []
