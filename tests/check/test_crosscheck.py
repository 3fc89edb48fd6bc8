"""The rules and the robot of a dry run see the same faults, but for those that are explained."""

from __future__ import annotations

from two_judges import all_faults, crosscheck, known_rows, silent, unexplained, wrong

STEP, FIRST = 229, 3  # every so many of all faults, from so many on


def test_both_judges_agree_on_some_of_all_faults() -> None:
    found = list(crosscheck(STEP, FIRST))
    assert len(found) >= 3
    assert wrong(found) == []
    assert any(each.robot for each in found)


def test_an_edit_does_not_change_the_robot_in_silence() -> None:
    edit = silent(104)
    assert edit.changes
    assert unexplained([edit]) == []


def test_each_row_is_about_a_fault_and_each_fault_in_one_row_at_most() -> None:
    rows, names = known_rows(), [fault.name for fault in all_faults()]
    assert [row.title for row in rows if not any(map(row.holds, names))] == []
    assert [name for name in names if sum(row.holds(name) for row in rows) > 1] == []
