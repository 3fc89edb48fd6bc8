"""The rubric: what is refused before anything is graded, and what a submission earns by it."""

from __future__ import annotations

import random
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import forking
import pytest
import quick_yaml
from grade_files import grade
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from other_labs import LAB, MINI

from lab3_usd.check.registry import all_rules
from lab3_usd.errors import SpecError
from lab3_usd.grade.rubric import Rubric, everything_asked, load_rubric
from lab3_usd.grade.scoring import Grade, ItemGrade, facts_of, grade_facts
from lab3_usd.model.finding import ChecklistItem, Finding, Requirement, StageResult
from lab3_usd.pipeline.results import unreadable_result

ASKED = everything_asked(LAB)
RUBRIC = load_rubric(MINI / "rubric.yaml", LAB)
SMALL = (MINI / "rubric.yaml").read_text(encoding="utf-8")


def result(number: str, wrong: Sequence[str] = (), **changes: Any) -> StageResult:
    """A stage that meets everything but the requirements with these ids."""
    items = tuple(replace(each, met=each.id not in wrong) for each in ASKED[number])
    stage = StageResult(f"work/{number}.usda", number, requirements=items)
    return replace(stage, **changes)


def class_of(wrong: Mapping[str, Sequence[str]] | None = None) -> list[StageResult]:
    return [result(number, (wrong or {}).get(number, ())) for number in LAB.checkpoints]


def everywhere(*wrong: str, since: str = "00") -> dict[str, Sequence[str]]:
    """The same faults in every stage from a checkpoint on."""
    return {number: wrong for number in LAB.checkpoints if number >= since}


def item(graded: Grade, name: str) -> ItemGrade:
    (found,) = [each for each in graded.items if each.id == name]
    return found


def made(tmp_path: Path, change: Any) -> Rubric:
    """A rubric like the one of the small lab, with a change made to its data."""
    data = quick_yaml.load(SMALL)
    change(data)
    path = tmp_path / "mine.yaml"
    path.write_text(quick_yaml.dump(data), encoding="utf-8")
    return load_rubric(path, LAB)


def only(**spec: Any) -> Any:
    """Change a rubric so that it has one item."""

    def change(data: dict[str, Any]) -> None:
        data["items"] = {"one": {"title": "One", "points": 10, **spec}}
        data["caps"] = []

    return change


def with_item(name: str, **spec: Any) -> Any:
    """Change one item of a rubric."""
    return lambda data: data["items"][name].update(spec)


def stages_with(*findings: Finding, number: str) -> list[StageResult]:
    """The right stages, with findings in one of them."""
    return [
        replace(stage, findings=findings) if stage.checkpoint == number else stage
        for stage in class_of()
    ]


def finding(rule: str, severity: Any = "error") -> Finding:
    return Finding(rule, "name", severity, "/", "what is wrong")


WIRE = "ROS_Clock/wire/ros2_publish_clock.execIn"
NODE = "ROS_Clock/node/ros2_publish_clock"


def test_everything_right_earns_everything() -> None:
    graded = grade(RUBRIC, class_of())
    assert (graded.earned, graded.possible, graded.percent) == (100.0, 100.0, 100.0)
    assert graded.lost == ()


def test_the_lab_knows_what_its_checkpoints_are_worth() -> None:
    points = dict.fromkeys((item.checkpoint for item in RUBRIC.items), 0.0)
    for item in RUBRIC.items:
        points[item.checkpoint] += item.points
    assert points == LAB.points


def test_nothing_handed_in_earns_nothing_of_everything() -> None:
    graded = grade(RUBRIC, [])
    assert (graded.earned, graded.possible, graded.percent) == (0.0, 100.0, 0.0)
    assert {each.state for each in graded.items} == {"missing"}


def test_one_fault_costs_its_share_of_one_item() -> None:
    graded = grade(RUBRIC, class_of({"01": [WIRE]}))
    clock = item(graded, "clock")
    assert clock.state == "part"
    assert clock.earned == round(10 * (1 - 0.1 - 1 / 12), 2)
    assert graded.earned == 90 + clock.earned
    assert [(each.item, each.requirement, each.points) for each in graded.lost] == [
        ("clock", WIRE, 1.83)
    ]


def test_a_node_with_faults_is_one_blemish_and_each_requirement_its_share(tmp_path: Path) -> None:
    rubric = made(tmp_path, lambda data: data.update(blemish=0.25))
    both = grade(rubric, class_of({"01": [WIRE, NODE]}))
    assert item(both, "clock").earned == round(10 * (0.75 - 2 / 12), 2)
    elsewhere = "ROS_Clock/node/ros2_context"
    both = grade(rubric, class_of({"01": [WIRE, elsewhere]}))
    assert item(both, "clock").earned == round(10 * (0.5 - 2 / 12), 2)


def test_what_contradicts_the_title_takes_the_whole_item(tmp_path: Path) -> None:
    rubric = made(tmp_path, with_item("clock", breaks=["ROS_Clock/wire/*"]))
    graded = grade(rubric, class_of({"01": [NODE, WIRE]}))
    assert item(graded, "clock").state == "none"
    assert [(each.requirement, each.points) for each in graded.lost] == [(WIRE, 10.0), (NODE, 0.0)]


def test_a_fault_that_is_carried_along_costs_its_item_and_what_rests_on_it() -> None:
    drive = next(item for item in RUBRIC.items if item.id == "drive")
    rested = replace(drive, rests=("ROS_Clock/wire/*",))
    items = tuple(rested if item is drive else item for item in RUBRIC.items)
    carried = grade(replace(RUBRIC, items=items), class_of(everywhere(WIRE)))
    assert carried.possible == 100
    lost = {each.item: each.points for each in carried.lost}
    # A fifth of the drive, here, and the last item wholly stand on the clock, which has lost 0.183.
    assert lost == {"clock": 1.83, "drive": 0.49, "nav2": 0.1}
    assert sum(lost.values()) == pytest.approx(100 - carried.earned)


def test_a_fault_that_comes_later_costs_where_it_comes() -> None:
    graded = grade(RUBRIC, class_of(everywhere(WIRE, since="05")))
    assert [each.item for each in graded.lost] == ["nav2"]


def test_what_stands_on_an_item_that_earned_nothing_stays_in_the_total() -> None:
    odometry = [each.id for each in ASKED["04"] if each.group == "ROS_OdomTF"]
    blocked = grade(RUBRIC, class_of({"04": odometry}))
    tree = item(blocked, "tree")
    assert (tree.state, tree.earned, tree.possible) == ("none", 0.0, 10.0)
    assert [each.title for each in blocked.lost if each.item == "tree"] == [
        "depends on odometry, which earned nothing"
    ]
    one_left = grade(RUBRIC, class_of({"04": odometry[:1]}))
    assert item(one_left, "tree").state == "full"


def test_an_item_needs_something_of_what_its_checkpoint_adds(tmp_path: Path) -> None:
    stages = class_of()
    met = {each.id for each in ASKED["02"]}
    for number in ("03", "04", "05"):  # the stage of 02 handed in again
        lacks = [each.id for each in ASKED[number] if each.id not in met]
        stages[int(number)] = result(number, lacks)
    graded = grade(RUBRIC, stages)
    assert graded.earned == grade(RUBRIC, class_of()[:3]).earned == 35
    one = made(tmp_path, only(checkpoint="03", groups=["ROS_Drive"]))
    assert (
        grade(one, [result("03", [each.id for each in ASKED["03"] if each.id not in met])]).earned
        == 0
    )
    assert grade(one, class_of()).earned == 10


def test_an_error_that_fails_no_requirement_costs_the_item_of_its_part() -> None:
    script = replace(finding("N08"), costs=("ROS_Drive",))
    (lost,) = grade(RUBRIC, stages_with(script, number="02")).lost
    assert (lost.item, lost.points, lost.rule) == ("drive", 2.0, "N08")


def test_an_error_about_another_part_takes_the_item_that_names_it(tmp_path: Path) -> None:
    rubric = made(tmp_path, with_item("drive", breaks=["Scene/error/S05"]))
    stages = stages_with(replace(finding("S05"), costs=("Scene",)), number="02")
    assert item(grade(rubric, stages), "drive").earned == 0
    assert item(grade(RUBRIC, stages), "drive").earned > 19
    with pytest.raises(SpecError, match="Scene/error/S99"):
        made(tmp_path, with_item("drive", breaks=["Scene/error/S99"]))


def test_an_error_of_no_part_costs_the_items_of_its_stage() -> None:
    lost = grade(RUBRIC, stages_with(finding("Z02"), number="04")).lost
    assert [(each.item, each.points) for each in lost] == [("odometry", 2.0), ("tree", 1.0)]


def test_an_error_that_fails_a_requirement_costs_it_once() -> None:
    stages = class_of({"01": [WIRE]})
    fault = replace(finding("W01"), unmet=(WIRE,), layer="work/clock.usda", line=12)
    stages[1] = replace(stages[1], findings=(fault,))
    (lost,) = grade(RUBRIC, stages).lost
    assert (lost.points, lost.rule, lost.place) == (1.83, "W01", "work/clock.usda:12")


def shown(rubric: Rubric, stages: Sequence[StageResult], number: str, **seen: str) -> Grade:
    """Grade with what a dry run shows of one stage."""
    facts = facts_of(stages, rubric.required)
    played = [
        replace(each, shown=dict(seen)) if each.checkpoint == number else each
        for each in facts.stages
    ]
    return grade_facts(rubric, replace(facts, stages=tuple(played)))


def test_what_the_dry_run_shows_to_be_wrong_takes_the_whole_item(tmp_path: Path) -> None:
    rubric = made(tmp_path, with_item("drive", dry_run=["follows"]))
    graded = shown(rubric, class_of(), "02", follows="does not move", clock="does not run")
    assert [each.id for each in graded.items if each.earned == 0] == ["drive"]
    assert graded.lost[0].title == "dry run: does not move"
    assert shown(rubric, class_of(), "02", rest="moves").earned == 100


def test_errors_in_files_beside_the_stages_cost_the_item_that_names_their_rules(
    tmp_path: Path,
) -> None:
    rubric = made(tmp_path, with_item("nav2", files=["M"], breaks=["M01"]))
    wrong = replace(finding("M06"), prim="maps/map.yaml")
    assert grade(rubric, class_of(), findings=[wrong]).earned == 99.5
    assert grade(rubric, class_of(), findings=[replace(wrong, rule="M01")]).earned == 95
    assert grade(rubric, class_of(), findings=[replace(wrong, rule="V01")]).earned == 100


def test_an_error_about_the_file_of_a_stage_costs_its_item() -> None:
    wrong = replace(finding("X02"), prim="work/03.usda")
    assert [each.item for each in grade(RUBRIC, class_of(), findings=[wrong]).lost] == ["scan"]


def test_a_missing_file_loses_its_points_and_blocks_nothing() -> None:
    graded = grade(RUBRIC, [each for each in class_of() if each.checkpoint != "04"])
    assert item(graded, "odometry").state == item(graded, "tree").state == "missing"
    assert (graded.earned, graded.possible) == (70.0, 100.0)


def test_an_unreadable_file_loses_its_points() -> None:
    stages = class_of()
    stages[1] = unreadable_result("work/01.usda", "01", "no stage")
    graded = grade(RUBRIC, stages)
    assert item(graded, "clock").state == "unreadable"
    assert graded.earned == 90.0


def test_of_two_files_for_a_checkpoint_the_worse_one_counts() -> None:
    second = result("01", [WIRE], path="work/copy.usda")
    graded = grade(RUBRIC, [*class_of(), second])
    assert graded.items == grade(RUBRIC, class_of({"01": [WIRE]})).items
    assert graded.lost[0].place == "work/copy.usda"


IDS = sorted({each.id for found in ASKED.values() for each in found})
FAULTS = st.dictionaries(
    st.sampled_from(sorted(LAB.checkpoints)), st.lists(st.sampled_from(IDS), max_size=6), max_size=5
)


@given(faults=FAULTS, seed=st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_no_order_of_results_or_requirements_changes_a_grade(
    faults: dict[str, list[str]], seed: int
) -> None:
    order = random.Random(seed)  # noqa: S311 - no secret
    stages = class_of(faults)
    mixed = [
        replace(each, requirements=tuple(order.sample(each.requirements, len(each.requirements))))
        for each in order.sample(stages, len(stages))
    ]
    assert grade(RUBRIC, mixed) == grade(RUBRIC, stages)


@given(faults=FAULTS)
@settings(max_examples=40, deadline=None)
def test_a_grade_lies_between_nothing_and_everything(faults: dict[str, list[str]]) -> None:
    graded = grade(RUBRIC, class_of(faults))
    assert graded.percent is not None
    assert 0 <= graded.percent <= 100
    assert graded.possible == 100
    for each in graded.items:
        lost = sum(line.points for line in graded.lost if line.item == each.id)
        assert each.earned + lost == pytest.approx(each.possible)


@given(faults=FAULTS, data=st.data())
@settings(max_examples=60, deadline=None)
def test_repairing_any_fault_of_any_stage_never_lowers_the_grade(
    faults: dict[str, list[str]], data: Any
) -> None:
    repaired = {
        number: data.draw(st.lists(st.sampled_from(wrong), unique=True)) if wrong else wrong
        for number, wrong in faults.items()
    }
    before, after = grade(RUBRIC, class_of(faults)), grade(RUBRIC, class_of(repaired))
    assert after.earned >= before.earned
    assert after.percent is not None
    assert before.percent is not None
    assert after.percent >= before.percent


def test_an_item_without_partial_credit_is_all_or_nothing(tmp_path: Path) -> None:
    rubric = made(tmp_path, only(checkpoint="01", groups=["ROS_Clock"], partial=False))
    assert grade(rubric, class_of()).earned == 10.0
    assert grade(rubric, class_of({"01": [WIRE]})).earned == 0.0


def test_weights_say_how_much_a_kind_of_requirement_counts(tmp_path: Path) -> None:
    def change(data: dict[str, Any]) -> None:
        only(checkpoint="01", groups=["ROS_Clock"])(data)
        data["weights"] = {"wire": 3}

    # four nodes, five settings and three wires of weight three
    assert grade(made(tmp_path, change), class_of({"01": [WIRE]})).earned == round(
        10 * (0.9 - 3 / 18), 2
    )


def test_requirements_can_be_chosen_by_pattern(tmp_path: Path) -> None:
    rubric = made(tmp_path, only(checkpoint="01", requirements=["ROS_Clock/wire/*"]))
    assert [each.id for each in rubric.asked["one"]] == [
        each.id for each in ASKED["01"] if each.id.startswith("ROS_Clock/wire/")
    ]


def test_an_optional_item_adds_points_and_costs_none(tmp_path: Path) -> None:
    rubric = made(tmp_path, with_item("nav2", optional=True))
    assert rubric.points == 95
    assert grade(rubric, class_of()).percent == round(100 * 100 / 95, 2)
    assert grade(rubric, class_of()[:-1]).percent == 100.0


def test_what_an_optional_item_lost_still_counts_at_later_items(tmp_path: Path) -> None:
    rubric = made(tmp_path, with_item("clock", optional=True))
    graded = grade(rubric, class_of(everywhere(WIRE)))
    assert [each.item for each in graded.lost] == ["clock", "nav2"]


@pytest.mark.parametrize(("severity", "earned"), [("error", 5.0), ("warning", 10.0)])
def test_a_cap_limits_an_item_where_its_rule_finds_an_error(severity: str, earned: float) -> None:
    tree = item(grade(RUBRIC, stages_with(finding("T07", severity), number="04")), "tree")
    assert tree.earned == earned
    assert ("8.11" in tree.because) == (severity == "error")


def test_a_cap_without_items_limits_every_item_of_the_checkpoint(tmp_path: Path) -> None:
    cap = {"rules": ["T07"], "at_most": 0, "because": "no"}
    rubric = made(tmp_path, lambda data: data.update(caps=[cap]))
    graded = grade(rubric, stages_with(finding("T07"), number="04"))
    assert [each.id for each in graded.items if each.earned == 0] == ["odometry", "tree"]


CHANGED = ["U01", "U02", "U03", "U04", "U05"]


@pytest.mark.parametrize("rule", CHANGED)
@pytest.mark.parametrize("numbers", [["00"], ["03"], ["05"], sorted(LAB.checkpoints)])
def test_a_changed_robot_loses_the_item_of_the_starter_once(rule: str, numbers: list[str]) -> None:
    stages = [
        replace(each, findings=(finding(rule),)) if each.checkpoint in numbers else each
        for each in class_of()
    ]
    graded = grade(RUBRIC, stages)
    starter = item(graded, "starter")
    assert (starter.state, starter.earned, starter.possible) == ("none", 0.0, 5.0)
    assert "5.4" in starter.because
    assert (graded.earned, graded.possible) == (95.0, 100.0)


def test_a_changed_look_costs_nothing() -> None:
    stages = [replace(each, findings=(finding("U04", "warning"),)) for each in class_of()]
    assert grade(RUBRIC, stages).earned == 100.0


def test_the_rubric_knows_every_rule_that_finds_an_error_in_what_the_starter_brought() -> None:
    rules = [rule for rule in all_rules().values() if rule.scope == "starter"]
    errors = sorted(rule.id for rule in rules if rule.severity == "error")
    assert errors == CHANGED
    assert errors == sorted(RUBRIC.caps[1].rules)


@pytest.mark.parametrize(
    ("checkpoints", "earned"), [(["04"], 0.0), (["0[3-5]"], 0.0), (["03"], 10.0), ([], 10.0)]
)
def test_a_cap_may_say_in_whose_stages_an_error_counts(
    tmp_path: Path, checkpoints: list[str], earned: float
) -> None:
    def change(data: dict[str, Any]) -> None:
        only(checkpoint="01")(data)
        cap = {"rules": ["T07"], "checkpoints": checkpoints, "at_most": 0, "because": "no"}
        data["caps"] = [cap]

    stages = stages_with(finding("T07"), number="04")
    assert grade(made(tmp_path, change), stages).earned == earned


def test_a_late_submission_earns_at_most_its_share(tmp_path: Path) -> None:
    rubric = made(tmp_path, lambda data: data.update(late={"at_most": 0.8}))
    assert grade(rubric, class_of()).earned == 100.0
    late = grade(rubric, class_of(), late=True)
    assert (late.earned, late.because) == (80.0, ("late: at most 80%",))
    assert grade(rubric, class_of()[:4], late=True).earned == 65.0


def test_a_late_submission_with_less_than_all_points_and_more_than_its_share_has_its_share(
    tmp_path: Path,
) -> None:
    rubric = made(tmp_path, lambda data: data.update(late={"at_most": 0.6}))
    some = class_of()[:4]
    assert grade(rubric, some).earned == 65.0
    late = grade(rubric, some, late=True)
    assert (late.earned, late.because) == (60.0, ("late: at most 60%",))


@pytest.mark.parametrize(
    ("state", "found"),
    [
        ("met", ("full", 10.0, 10.0)),
        ("not met", ("none", 0.0, 10.0)),
        ("not shown", ("open", 0.0, 0.0)),
        ("person", ("open", 0.0, 0.0)),
    ],
)
def test_a_line_of_the_checklist_can_be_an_item(
    tmp_path: Path, state: Any, found: tuple[str, float, float]
) -> None:
    rubric = made(tmp_path, only(checklist="Nav2 reaches a goal"))
    line = ChecklistItem("Lab Check-Off", "Nav2 reaches a goal", state)
    graded = item(grade(rubric, [], [line]), "one")
    assert (graded.state, graded.earned, graded.possible) == found


def test_where_nothing_could_be_judged_there_is_no_percentage(tmp_path: Path) -> None:
    assert grade(made(tmp_path, only(checklist="Nav2 reaches a goal")), []).percent is None


def test_comments_and_order_of_keys_leave_a_rubric_the_same(tmp_path: Path) -> None:
    path = tmp_path / "same.yaml"
    path.write_text(f"# another comment\n{SMALL}", encoding="utf-8")
    assert load_rubric(path, LAB).digest == RUBRIC.digest
    assert made(tmp_path, only(checkpoint="01")).digest != RUBRIC.digest


def turned(data: dict[str, Any], name: str) -> None:
    """Turn round the order of the entries of a mapping or a list."""
    entries = data[name]
    data[name] = entries[::-1] if isinstance(entries, list) else dict(reversed(entries.items()))


def test_the_order_of_items_decides_who_pays_and_makes_another_rubric(tmp_path: Path) -> None:
    def change(data: dict[str, Any]) -> None:
        data["items"]["tree"].pop("needs")
        data["caps"] *= 2
        data["caps"][1] = {**data["caps"][1], "because": "another reason"}

    before = made(tmp_path, change)
    other = made(tmp_path, lambda data: (change(data), turned(data, "items")))
    stages = class_of(everywhere(WIRE))
    assert grade(before, stages).percent != grade(other, stages).percent
    assert before.digest != other.digest
    other = made(tmp_path, lambda data: (change(data), turned(data, "caps")))
    assert before.digest != other.digest


@pytest.mark.parametrize("name", ["weights", "late"])
def test_an_order_that_decides_nothing_leaves_a_rubric_the_same(tmp_path: Path, name: str) -> None:
    def change(data: dict[str, Any]) -> None:
        data["weights"] = {"wire": 2, "node": 3}
        data["late"] = {"at_most": 0.5, "students": ["ali", "jane"]}

    before = made(tmp_path, change)
    assert made(tmp_path, lambda data: (change(data), turned(data, name))).digest == before.digest


def renamed(data: dict[str, Any], name: str) -> None:
    """Call the first item of a rubric so."""
    data["items"] = {name: data["items"]["starter"]}
    data["caps"] = []


WRONG: dict[str, tuple[Any, str]] = {
    "unknown key": (lambda data: data.update(pionts=1), "pionts"),
    "no title": (lambda data: data.pop("title"), "title"),
    "no items": (lambda data: data.update(items={}), "items"),
    "items as a list": (lambda data: data.update(items=[]), "items"),
    "unknown key of an item": (only(checkpoint="01", worth=1), "worth"),
    "no points": (lambda data: data["items"]["clock"].pop("points"), "points"),
    "no points to earn": (only(checkpoint="01", points=0), "points"),
    "negative points": (only(checkpoint="01", points=-5), "points"),
    "points without end": (only(checkpoint="01", points=float("inf")), "points"),
    "points that are no number": (only(checkpoint="01", points=float("nan")), "points"),
    "more points than there can be": (only(checkpoint="01", points=1e308), "1e+308"),
    "points of hundreds of digits": (only(checkpoint="01", points=10**400), "points"),
    "points too small to see": (only(checkpoint="01", points=1e-300), "1e-300"),
    "points as text": (only(checkpoint="01", points="ten"), "points"),
    "points as yes": (only(checkpoint="01", points=True), "points"),
    "unknown checkpoint": (only(checkpoint="09"), "09"),
    "checkpoint as a number": (only(checkpoint=1), "is 1, expected text; put it in quotes"),
    "name of an item twice": (only(checkpoint="01", id="two"), "'id' is not known"),
    "points above the limit say it": (
        only(checkpoint="01", points=2e6),
        "one: 'points' is 2000000.0, expected a number from 0.001 to 1000000",
    ),
    "weights of nothing": (lambda data: data.update(weights=None), "'weights' is None"),
    "caps as a mapping": (lambda data: data.update(caps={"rules": ["T07"]}), "'caps' is {"),
    "cap with an unknown key": (lambda data: data["caps"][1].update(rule="T07"), "'rule' is not"),
    "neither checkpoint nor checklist": (only(), "checkpoint"),
    "checkpoint and checklist": (only(checkpoint="01", checklist="x"), "checklist"),
    "unknown line of the checklist": (only(checklist="Robot flies"), "Robot flies"),
    "unknown group": (only(checkpoint="01", groups=["ROS_Drive"]), "ROS_Drive"),
    "unknown requirement": (only(checkpoint="01", requirements=["ROS_Clock/x"]), "ROS_Clock/x"),
    "nothing in common": (
        only(checkpoint="01", groups=["ROS_Clock"], requirements=["Scene/*"]),
        "in common",
    ),
    "needs what comes later": (
        with_item("clock", needs=["drive"]),
        "only need items above it, so move 'drive' up",
    ),
    "needs itself": (with_item("clock", needs=["clock"]), "itself"),
    "needs nobody": (with_item("drive", needs=["clok"]), "clock"),
    "needs each other": (
        lambda data: (
            data["items"]["clock"].update(needs=["drive"]),
            data["items"]["drive"].update(needs=["clock"]),
        ),
        "only need items above it, so move 'drive' up",
    ),
    "item without a name": (lambda data: renamed(data, ""), "''"),
    "item of two lines": (lambda data: renamed(data, "a\nb"), "'a\\nb'"),
    "item called like a column": (lambda data: renamed(data, "percent"), "grades.csv"),
    "item called nearly like a column": (lambda data: renamed(data, "Remarks"), "grades.csv"),
    "unknown visibility": (only(checkpoint="01", visibility="never"), "never"),
    "partial as text": (only(checkpoint="01", partial="yes"), "partial"),
    "breaks by nothing that is asked": (
        only(checkpoint="01", breaks=["ROS_Drive/*"]),
        "ROS_Drive/*",
    ),
    "breaks by an unknown rule": (only(checkpoint="01", breaks=["T99"]), "T99"),
    "files of an unknown rule": (only(checkpoint="01", files=["T99"]), "T99"),
    "unknown check of the dry run": (only(checkpoint="01", dry_run=["drives"]), "drives"),
    "joints of a lab that commands none": (only(checkpoint="01", dry_run=["joints"]), "joints"),
    "blemish above everything": (lambda data: data.update(blemish=2), "blemish"),
    "no blemish": (lambda data: data.update(blemish=0), "blemish"),
    "again as text": (lambda data: data.update(again="all"), "again"),
    "unknown kind": (lambda data: data.update(weights={"wires": 1}), "wires"),
    "weight of everything": (lambda data: data.update(weights={"wire": 1e308}), "wire"),
    "weight of nothing": (lambda data: data.update(weights={"wire": 0}), "wire"),
    "cap of no rules": (lambda data: data["caps"][0].update(rules=[]), "'rules' is empty"),
    "cap of an unknown rule": (
        lambda data: data["caps"][0].update(rules=["T99"]),
        "T99",
    ),
    "cap of an unknown item": (lambda data: data["caps"][0].update(items=["tre"]), "tre"),
    "cap of an unknown checkpoint": (
        lambda data: data["caps"][0].update(checkpoints=["09"]),
        "'09'",
    ),
    "cap of a checkpoint as a number": (
        lambda data: data["caps"][0].update(checkpoints=[1]),
        "quotes",
    ),
    "cap above everything": (lambda data: data["caps"][0].update(at_most=50), "at_most"),
    "cap without a reason": (lambda data: data["caps"][0].pop("because"), "because"),
    "late above everything": (lambda data: data.update(late={"at_most": 1.1}), "at_most"),
    "late students as numbers": (
        lambda data: data.update(late={"students": ["ali", 1000]}),
        "'students': entry 2 is 1000, expected text; put it in quotes",
    ),
    "late with an unknown key": (lambda data: data.update(late={"penalty": 1}), "penalty"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_rubric_is_one_line_that_names_what_is_wrong(tmp_path: Path, case: str) -> None:
    change, named = WRONG[case]
    with pytest.raises(SpecError) as error:
        made(tmp_path, change)
    assert str(error.value).startswith("mine.yaml: ")
    assert named in str(error.value)
    assert "\n" not in str(error.value)


def test_of_a_misspelt_name_the_likely_one_is_offered_instead_of_all(tmp_path: Path) -> None:
    with pytest.raises(
        SpecError, match=r"'folows' is not known; did you mean follows\?, at [^,]+$"
    ):
        made(tmp_path, with_item("drive", dry_run=["folows"]))
    with pytest.raises(SpecError, match=r"'juggles' is not known; known are .*, follows, "):
        made(tmp_path, with_item("drive", dry_run=["juggles"]))


@pytest.mark.parametrize("text", ["", "- 1\n", "title: [", "!!python/object:os.system x\n"])
def test_a_file_that_is_no_rubric_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(SpecError, match=r"^mine\.yaml: "):
        load_rubric(path, LAB)


HEAD = "title: T\nitems:\n  one: {title: One, checkpoint: '01', points: "


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("title: " + "[" * 60 + "]" * 60, "line 1: is nested"),
        ("title: " + "[" * 100_000, "line 1: "),  # libyaml may refuse it first, in its own words
        ("title:\n" + "- " * 300 + "x\n", "line 2: is nested"),
        ("title: " + "{a: " * 400 + "}" * 400, "line 1: is nested"),
        ("# " + "x" * 1_000_000, "is larger than 1000000 bytes"),
        (f"{HEAD}{'9' * 5000}}}\n", "line 3: "),
        (f"{HEAD}2020-13-45}}\n", "line 3: '2020-13-45' cannot be read"),
        (f"{HEAD}!!bool maybe}}\n", "line 3: 'maybe' cannot be read"),
    ],
    ids=["flow", "flow without end", "blocks", "mappings", "size", "digits", "date", "bool"],
)
def test_no_text_brings_the_reading_of_a_rubric_down(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    reading = (
        "import sys\nfrom pathlib import Path\nfrom lab3_usd.errors import SpecError\n"
        "from lab3_usd.yaml_file import read_foreign_yaml\n"
        "try:\n    read_foreign_yaml(Path(sys.argv[1]))\n"
        "except SpecError as error:\n    print(error)\n"
    )
    # In a process of its own, which is the only one that a crash of the loader ends.
    command = [sys.executable, "-c", reading, str(path)]
    done = forking.run(command, check=True, capture_output=True, text=True)
    assert done.stdout.startswith(f"mine.yaml: {named}")
    assert done.stdout.count("\n") == 1
    assert len(done.stdout) < 300


def test_a_value_that_unfolds_without_end_is_refused_in_one_short_line(tmp_path: Path) -> None:
    lists = [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 10)]
    path = tmp_path / "mine.yaml"
    path.write_text(
        "title: T\nitems:\n  one: {title: One, checkpoint: '01', points: 1}\n"
        f"late: {{students: [{{a0: &a0 [x], {', '.join(lists)}}}]}}\n"
    )
    with pytest.raises(SpecError, match=r"^mine\.yaml: late: 'students'") as error:
        load_rubric(path, LAB)
    assert len(str(error.value).rpartition(", at ")[0]) < 300


def test_a_rubric_may_only_be_a_file(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="is not a file"):
        load_rubric(tmp_path, LAB)


def test_a_missing_rubric_is_named(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"gone\.yaml"):
        load_rubric(tmp_path / "gone.yaml", LAB)


def test_requirements_of_an_empty_stage_are_all_unmet() -> None:
    assert not any(each.met for found in ASKED.values() for each in found)
    assert isinstance(ASKED["04"][0], Requirement)
