"""A finding that rests on what another one says is wrong is not reported."""

from __future__ import annotations

from lab3_usd.check.fold import fold
from lab3_usd.model.finding import Finding, Place, Severity

NODE, PORT = "/g/node", "inputs:port"


def finding(
    rule: str,
    prim: str = NODE,
    port: str | None = None,
    assumes: tuple[Place, ...] = (),
    covers: tuple[Place, ...] = (),
    severity: Severity = "error",
) -> Finding:
    return Finding(
        rule, rule, severity, prim, "wrong", property=port, assumes=assumes, covers=covers
    )


def rules_left(*findings: Finding) -> list[str]:
    return [left.rule for left in fold(findings)]


def test_what_rests_on_a_wrong_prim_goes() -> None:
    root = finding("N01", port=PORT)
    assert rules_left(finding("N02", "/g/other", assumes=((NODE, None),)), root) == ["N01"]


def test_what_rests_on_a_wrong_port_stays_beside_a_fault_of_another_port() -> None:
    rests = finding("P01", port=PORT, assumes=((NODE, PORT),))
    assert rules_left(rests, finding("P03", port="inputs:other")) == ["P01", "P03"]
    assert rules_left(rests, finding("P03", port=PORT)) == ["P03"]


def test_a_place_that_a_finding_covers_is_wrong_as_well() -> None:
    root = finding("W01", "/g/other", covers=((NODE, PORT),))
    assert rules_left(finding("P01", port=PORT, assumes=((NODE, PORT),)), root) == ["W01"]


def test_one_target_of_a_port_is_a_place_of_its_own() -> None:
    root = finding("T01", port=PORT, covers=((NODE, f"{PORT}[/gone]"),))
    gone, lost = (
        finding("R03", port=PORT, assumes=((NODE, f"{PORT}[{path}]"),))
        for path in ("/gone", "/lost")
    )
    assert rules_left(root, gone) == ["T01"]
    assert rules_left(root, lost) == ["T01", "R03"]


def test_what_lies_below_a_prim_is_a_place() -> None:
    rests = finding("S19", "/robot", assumes=(("/robot/", "xformOp:*"),))
    assert rules_left(rests, finding("U01", "/robot/wheel", "xformOp:scale")) == ["U01"]
    assert rules_left(rests, finding("U01", "/robot", "xformOp:scale")) == ["S19", "U01"]
    assert rules_left(rests, finding("U01", "/robot/wheel", "size")) == ["S19", "U01"]


def test_an_error_stays_beside_a_warning() -> None:
    rests = finding("W05", assumes=((NODE, None),))
    assert rules_left(rests, finding("N02", severity="warning")) == ["W05", "N02"]


def test_what_rests_on_a_finding_that_goes_itself_goes_too() -> None:
    root = finding("S01", "/robot")
    middle = finding("G01", "/robot/graph", assumes=(("/robot", None),))
    last = finding("T01", assumes=(("/robot/graph", None),))
    assert rules_left(last, middle, root) == ["S01"]


def test_of_findings_that_rest_on_each_other_the_first_stays() -> None:
    one, other = (finding(rule, assumes=((NODE, None),)) for rule in ("N02", "T12"))
    assert rules_left(one, other) == ["N02"]
    assert rules_left(one) == ["N02"]
