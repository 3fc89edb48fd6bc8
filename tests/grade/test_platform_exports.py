"""The exports of platforms, with points filled in: whose they are, and which bytes change."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path
from typing import Any

import pytest
from class_pages import book_of, laid_out
from hypothesis import given
from hypothesis import strategies as st

from lab3_usd.errors import UsageError
from lab3_usd.grade.filled_export import Decision, FilledExport, decision_lines, fill_export
from lab3_usd.grade.text_table import filled_bytes, read_text_table

CANVAS = "Student,ID,SIS User ID,SIS Login ID,Section,Lab 3 (77)\n    Points Possible,,,,,100\n"
MOODLE = "Identifier,Full name,Email address,Status,Grade,Maximum grade,Feedback comments\n"
TEAMS = "Identifier,Full name,Status,Group,Grade,Maximum grade\n"
BRIGHTSPACE = (
    "OrgDefinedId,Username,Last Name,First Name,Email,"
    "Lab 3 Points Grade <Numeric MaxPoints:100 Weight:10>,End-of-Line Indicator\n"
)
BLACKBOARD = '"Last Name","First Name","Username","Student ID","Lab 3 [Total Pts: 100 Score] |5"\n'
ATTEMPT = "attempt_2026-11-20-10-22-33"
DAY = "Oct 10, 2025 1022 AM"


def class_of(tmp_path: Path, earned: dict[str, float], **settings: Any) -> dict[str, Any]:
    """The gradebook of a class: the points of each entry of a download."""
    place = laid_out(tmp_path / "class", earned)
    points = {name.rstrip("/"): value for name, value in earned.items()}
    return book_of(
        place,
        lambda submission: max(points.get(entry, 0) for entry in submission.entries),
        **settings,
    )


def export(
    tmp_path: Path, platform: str, text: str | bytes, book: dict[str, Any], **settings: Any
) -> FilledExport:
    path = tmp_path / "export.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return fill_export(platform, path, book, **settings)


def lines(result: FilledExport) -> list[str]:
    return result.data.decode().splitlines()


def outcomes(result: FilledExport) -> dict[str, str]:
    """What became of each row and of each submission without one."""
    return {decision.row or decision.submission: decision.outcome for decision in result.decisions}


def points_of(result: FilledExport) -> dict[str, str]:
    """The points that were filled in, by row."""
    return {
        decision.row: decision.after for decision in result.decisions if decision.after
    }  # fmt: skip


# ---- a number has a kind


def test_the_number_of_canvas_is_its_own_id_and_never_that_of_the_institution(
    tmp_path: Path,
) -> None:
    # The id of the user in content_zipper.rb, and that in the column ID of gradebook_exporter.rb.
    rows = '"Roe, Joe",5,77,jroe,A,\n"Doe, Jane",77,5,jdoe,A,\n'
    book = class_of(tmp_path, {"doejane_77_900_Lab3.zip": 80})
    found = export(tmp_path, "canvas", CANVAS + rows, book)
    assert points_of(found) == {"Doe, Jane (77)": "80.00"}
    alone = export(tmp_path, "canvas", CANVAS + '"Roe, Joe",5,77,jroe,A,\n', book)
    assert outcomes(alone) == {
        "Roe, Joe (5)": "without a submission",
        "77 (doejane)": "without a row",
    }


def test_the_group_77_of_moodle_is_not_participant_77(tmp_path: Path) -> None:
    # downloader.php: Group Name_GROUPID; gradingtable.php: the column Group of team submissions
    book = class_of(tmp_path, {"Team A_77_assignsubmission_file/": 80})
    rows = (
        "Participant 77,Sam Roe,Submitted,Team B,,100.00\n"
        "Participant 78,Ann Lee,Submitted,Team A,,100.00\n"
        "Participant 79,Bo Lee,Submitted,Team A,,100.00\n"
    )
    found = export(tmp_path, "moodle", TEAMS + rows, book)
    assert points_of(found) == {
        "Ann Lee (Participant 78)": "80.00",
        "Bo Lee (Participant 79)": "80.00",
    }
    single = "Participant 77,Sam Roe,,Submitted,,100.00,\n"
    (_, nobody) = export(tmp_path, "moodle", MOODLE + single, book).decisions
    assert (nobody.outcome, nobody.why) == (
        "without a row",
        "Sam Roe (Participant 77) has its Moodle number 77, but not its name or another id",
    )


def test_the_folder_number_of_brightspace_is_no_orgdefinedid(tmp_path: Path) -> None:
    book = class_of(tmp_path, {f"1001-7 - Jo Lee - {DAY}/": 80, f"1002-7 - Al Fox - {DAY}/": 60})
    rows = "#1001,#jroe,Roe,Sam,,,#\n#1002,#jlee,Lee,Jo,,,#\n"
    found = export(tmp_path, "brightspace", BRIGHTSPACE + rows, book)
    assert points_of(found) == {"Jo Lee (#1002)": "80.00"}
    assert outcomes(found)["1002 (Al Fox)"] == "without a row"


def test_an_orgdefinedid_in_a_name_of_brightspace_tells_namesakes_apart(tmp_path: Path) -> None:
    book = class_of(
        tmp_path,
        {f"11-7 - Jo Lee (1001234) - {DAY}/": 80, f"12-7 - Jo Lee (1005678) - {DAY}/": 60},
    )
    rows = "#1005678,#jo2,Lee,Jo,,,#\n#1001234,#jo1,Lee,Jo,,,#\n#1009999,#jo3,Lee,Jo,,,#\n"
    found = export(tmp_path, "brightspace", BRIGHTSPACE + rows, book)
    assert points_of(found) == {"Jo Lee (#1005678)": "60.00", "Jo Lee (#1001234)": "80.00"}


def test_an_orgdefinedid_whose_row_has_another_name_is_named_and_fills_nothing(
    tmp_path: Path,
) -> None:
    book = class_of(tmp_path, {f"11-7 - Jo Lee (1001234) - {DAY}/": 80})
    rows = "#1001234,#sroe,Roe,Sam,,,#\n#1001235,#jlee,Lee,Jo,,,#\n"
    found = export(tmp_path, "brightspace", BRIGHTSPACE + rows, book)
    assert points_of(found) == {}
    assert outcomes(found)["11 (Jo Lee)"] == "without a row"


def test_a_user_of_blackboard_with_an_underscore_is_whom_the_receipt_names(tmp_path: Path) -> None:
    # Public scripts (kwurst/bb-file-cleanup, CS270-grading-assistant) read `Name: ... (user)`
    class_of(
        tmp_path,
        {f"Lab 3_a_lens_{ATTEMPT}_a.zip": 80, f"Lab 3_a_bo_{ATTEMPT}_a.zip": 60},
    )  # fmt: skip
    text = "Name: Ann Lens (a_lens)\nAssignment: Lab 3\n"
    (tmp_path / "class" / f"Lab 3_a_lens_{ATTEMPT}.txt").write_text(text)
    book = book_of(tmp_path / "class", lambda one: 80 if "lens" in one.student else 60)
    rows = '"Lens","Real","lens","9",""\n"Lens","Ann","A_Lens","8",""\n"Bo","Al","a_bo","7",""\n'
    found = export(tmp_path, "blackboard", BLACKBOARD + rows, book)
    assert points_of(found) == {"Ann Lens (A_Lens)": "80.00", "Al Bo (a_bo)": "60.00"}


def test_without_a_receipt_a_user_with_an_underscore_is_left_to_a_person(tmp_path: Path) -> None:
    book = class_of(
        tmp_path, {f"Lab 3_a_lens_{ATTEMPT}_a.zip": 80, f"Lab 3_a_bo_{ATTEMPT}_a.zip": 60}
    )
    found = export(tmp_path, "blackboard", BLACKBOARD + '"Lens","Real","lens","9",""\n', book)
    assert outcomes(found)["Real Lens (lens)"] == "ambiguous"
    assert "may mean lens or a_lens" in found.decisions[0].why


@pytest.mark.parametrize(
    ("platform", "rows"),
    [
        ("canvas", CANVAS + '"Roe, Joe",5,,JOE@X.example,A,\n'),
        ("moodle", MOODLE + "Participant 5,Joe Roe,Joe@x.Example,,,100,\n"),
        ("brightspace", BRIGHTSPACE + "#5,#joe@x.example,Roe,Joe,other@x.example,,#\n"),
    ],
)
def test_addresses_are_compared_without_case(platform: str, rows: str, tmp_path: Path) -> None:
    book = class_of(tmp_path, {"submission_1/": 80})
    people = [{"name": "J. Roe", "ids": {"address": "joe@X.example"}}]
    book["students"][0] |= {"platform": "gradescope", "people": people}
    assert list(points_of(export(tmp_path, platform, rows, book)).values()) == ["80.00"]


def test_an_address_whose_row_has_another_student_id_is_named_and_fills_nothing(
    tmp_path: Path,
) -> None:
    book = class_of(tmp_path, {"submission_1/": 80})
    ids = {"student id": "9", "address": "joe@x.example"}
    book["students"][0] |= {"platform": "gradescope", "people": [{"name": "Joe Roe", "ids": ids}]}
    found = export(tmp_path, "canvas", CANVAS + '"Roe, Joe",5,8,joe@x.example,A,\n', book)
    assert [decision.outcome for decision in found.decisions] == [
        "without a submission", "without a row",
    ]  # fmt: skip
    assert found.decisions[1].why == (
        "Roe, Joe (5) has its address joe@x.example, but not its name or another id"
    )


def test_a_name_that_is_of_a_participant_and_of_a_group_is_left_to_a_person(
    tmp_path: Path,
) -> None:
    book = class_of(tmp_path, {"Jo Lee_77_assignsubmission_file/": 80})
    rows = (
        "Participant 77,Jo Lee,Submitted,Team B,,100.00\n"
        "Participant 78,Al Fox,Submitted,Jo Lee,,100.00\n"
    )
    found = export(tmp_path, "moodle", TEAMS + rows, book)
    assert [decision.outcome for decision in found.decisions] == [
        "ambiguous", "ambiguous", "without a row",
    ]  # fmt: skip
    assert found.decisions[0].why == "'Jo Lee' may mean Jo Lee (Participant 77) or Jo Lee"


def test_a_submission_without_an_id_of_the_export_goes_by_a_name_that_one_has(
    tmp_path: Path,
) -> None:
    book = class_of(tmp_path, {"Joe Roe_7_assignsubmission_file/": 80})
    rows = '"Roe, Joe",5,,jroe,A,\n"Doe, Jane",7,,jdoe,A,\n'
    assert points_of(export(tmp_path, "canvas", CANVAS + rows, book)) == {"Roe, Joe (5)": "80.00"}


@pytest.mark.parametrize(
    ("folder", "points"),
    [
        ("jroe/", ["80.00"]),
        ("Joe Roe/", ["80.00"]),
        ("roe, joe/", ["80.00"]),
        ("5/", []),
        ("9/", []),
        ("33/", []),
    ],
)
def test_a_plain_folder_is_called_by_login_or_name_and_a_number_has_no_kind(
    folder: str, points: list[str], tmp_path: Path
) -> None:
    book = class_of(tmp_path, {folder: 80, "other/": 1})
    rows = '"Roe, Joe",5,9,jroe,A,\n"Fox, Al",6,8,33,A,\n'
    assert list(points_of(export(tmp_path, "canvas", CANVAS + rows, book)).values()) == points


# ---- one to one


@pytest.mark.parametrize("second", ["Jo,Lee", "Lee,Jo", "jo,LEE", "J o,Lee"])
def test_a_submission_of_one_of_two_namesakes_fills_neither_and_names_both(
    second: str, tmp_path: Path
) -> None:
    book = class_of(tmp_path, {f"1-7 - Jo Lee - {DAY}/": 80, f"2-7 - Al Fox - {DAY}/": 60})
    first, last = second.split(",")
    rows = f"#1,#a,Lee,Jo,,,#\n#2,#b,{last},{first},,,#\n#3,#c,Fox,Al,,,#\n"
    found = export(tmp_path, "brightspace", BRIGHTSPACE + rows, book)
    assert points_of(found) == {"Al Fox (#3)": "60.00"}
    why = [decision.why for decision in found.decisions if decision.outcome == "ambiguous"]
    assert why == [f"1 may be of Jo Lee (#1) or {first} {last} (#2)"] * 2
    assert outcomes(found)["1 (Jo Lee)"] == "without a row"


def test_two_submissions_of_namesakes_for_one_row_fill_nothing(tmp_path: Path) -> None:
    book = class_of(tmp_path, {f"1-7 - Jo Lee - {DAY}/": 80, f"2-7 - Jo Lee - {DAY}/": 60})
    found = export(tmp_path, "brightspace", BRIGHTSPACE + "#1,#a,Lee,Jo,,,#\n", book)
    assert [decision.outcome for decision in found.decisions] == [
        "ambiguous", "without a row", "without a row",
    ]  # fmt: skip
    assert found.decisions[0].why == "may be of 1 or 2"


def test_namesakes_with_numbers_are_told_apart(tmp_path: Path) -> None:
    # Two Kim Min in one class of Canvas, and two of Moodle
    book = class_of(tmp_path, {"kimmin_5_900_a.zip": 80, "kimmin_6_901_a.zip": 60})
    rows = '"Kim, Min",6,,a,A,\n"Kim, Min",5,,b,A,\n"Kim, Min",4,,c,A,\n'
    found = export(tmp_path, "canvas", CANVAS + rows, book)
    assert points_of(found) == {"Kim, Min (6)": "60.00", "Kim, Min (5)": "80.00"}


def test_an_apostrophe_that_moodle_drops_and_an_accent_in_two_parts_change_no_name(
    tmp_path: Path,
) -> None:
    book = class_of(
        tmp_path,
        {
            "Ann OBrien_7_assignsubmission_file/": 80,
            "Zoe\u0308 van der Berg_8_assignsubmission_file/": 60,
        },
    )
    rows = "Participant 7,Ann O'Brien,,,,100,\nParticipant 8,Zoë van der Berg,,,,100,\n"
    assert list(points_of(export(tmp_path, "moodle", MOODLE + rows, book)).values()) == [
        "80.00", "60.00",
    ]  # fmt: skip


@pytest.mark.parametrize("number", [1, 2])
def test_files_that_may_be_of_one_or_of_two_people_fill_no_row(number: int, tmp_path: Path) -> None:
    # Both of leeanna (1), or of two who are called leeanna_1 (1 and 2).
    book = class_of(tmp_path, {"leeanna_1_1_1_Lab3.zip": 80, "leeanna_1_2_2_Lab3.zip": 60})
    rows = f'"Lee, Anna_1",{number},,al,A,\n'
    assert points_of(export(tmp_path, "canvas", CANVAS + rows, book)) == {}


def test_a_file_that_may_be_of_two_people_fills_the_row_of_number_and_name(tmp_path: Path) -> None:
    book = class_of(tmp_path, {"leeanna_1_2_3_Lab3.zip": 80})
    rows = '"Lee, Anna_1",2,,al,A,\n"Lee, Ann",1,,an,A,\n'
    assert points_of(export(tmp_path, "canvas", CANVAS + rows, book)) == {
        "Lee, Anna_1 (2)": "80.00"
    }


# ---- groups


def test_each_submitter_of_gradescope_gets_the_row(tmp_path: Path) -> None:
    # submission_metadata.yml: :submitters: with :name, :sid and :email
    laid_out(tmp_path / "class", ["submission_1/", "submission_2/"])
    (tmp_path / "class" / "submission_metadata.yml").write_text(
        "submission_1:\n  :submitters:\n"
        "  - {':name': Jo Lee, ':sid': '9', ':email': jo@x.example}\n"
        "  - {':name': Al Fox, ':sid': '', ':email': al@x.example}\n"
        "submission_2:\n  :submitters:\n  - {':name': Eve Roe, ':sid': '8'}\n"
    )
    book = book_of(tmp_path / "class", lambda one: 80 if "+" in one.student else 60)
    rows = '"Lee, Jo",1,9,jl,A,\n"Fox, Al",2,7,AL@x.example,A,\n"Roe, Eve",3,8,er,A,\n'
    found = export(tmp_path, "canvas", CANVAS + rows, book)
    assert points_of(found) == {
        "Lee, Jo (1)": "80.00", "Fox, Al (2)": "80.00", "Roe, Eve (3)": "60.00",
    }  # fmt: skip


def test_who_is_in_two_groups_is_in_doubt_and_the_other_members_are_not(tmp_path: Path) -> None:
    book = class_of(tmp_path, {"submission_1/": 80, "submission_2/": 60})
    jo, al, eve = ({"name": name, "ids": {}} for name in ("Jo Lee", "Al Fox", "Eve Roe"))
    for row, people in zip(book["students"], ([jo, al], [jo, eve]), strict=True):
        row |= {"platform": "gradescope", "people": people}
    rows = '"Lee, Jo",1,9,jl,A,\n"Fox, Al",2,7,al,A,\n"Roe, Eve",3,8,er,A,\n'
    found = export(tmp_path, "canvas", CANVAS + rows, book)
    assert points_of(found) == {"Fox, Al (2)": "80.00", "Roe, Eve (3)": "60.00"}
    assert outcomes(found)["Lee, Jo (1)"] == "ambiguous"


def test_of_a_group_of_canvas_the_representative_is_filled_and_named_as_such(
    tmp_path: Path,
) -> None:
    # content_zipper.rb: assignment.representatives, whose name is that of the group
    book = class_of(tmp_path, {"team_alpha_5_900_a.zip": 80})
    found = export(tmp_path, "canvas", CANVAS + '"Roe, Joe",5,,jroe,A,\n"Fox, Al",6,,af,A,\n', book)
    assert found.decisions == (
        Decision(
            "filled", "Roe, Joe (5)", "5 (team_alpha)", "", "80.00", "represents 'team_alpha'"
        ),
        Decision("without a submission", "Fox, Al (6)"),
    )


# ---- somebody's data


# The cell that is filled in is @@; all else is what platforms and teachers write.
UNTOUCHED: dict[str, tuple[str, str]] = {
    "canvas": (
        "doejane_5_900_a.zip",
        """\ufeffStudent,ID,SIS User ID,SIS Login ID,Section,Now,Lab 3 (77),Other (78),Final Score\r
,,,,,,Manual Posting,,\r
    Points Possible,,,,,,100.00,10.00,(read only)\r
"Roe, Joe",4,,"jroe", A ,=1+1,88.00,EX,55.1\r
"Doe, Jane",5,,jdoe,A,"say ""no"" to",@@,7,\r
"Fox, Al",6,,af,A,,EX,N/A,\r
"Kim, Min",7,,km,A,,N/A,N/A,\r
"Student, Test",8,,x,A,,,,\r
""",
    ),
    "canvas, names in two columns": (
        "doejane_5_900_a.zip",
        """LastName;FirstName;ID;SIS Login ID;Section;Lab 3 (77)
    Points Possible;;;;;100,00
Roe;Joe;4;jroe;A;88,00
Doe;Jane;5;jdoe;A;@@
""",
    ),
    "moodle": (
        "Jane Doe_5_assignsubmission_file_a.zip",
        """Identifier,Full name,Email address,Status,Grade,Maximum Grade,Feedback comments
"Participant 4","Joe Roe",j@x.example,-,88.00,100.00,"=well, done"
Participant 5,Jane Doe,d@x.example,Submitted,@@,100.00,- keep this
Participant 6,Al Fox,,,-,100.00,""",
    ),
    "brightspace": (
        f"9-7 - Jane Doe - {DAY} - a.zip",
        f"""{BRIGHTSPACE.replace(",End", ",Other Points Grade <Numeric MaxPoints:6>,End")}\
#4,#jroe,Roe,=Joe,,88,6,#
#0005,#jdoe,Doe,Jane,,@@,,#
""",
    ),
    "blackboard": (
        f"Lab 3_jdoe_{ATTEMPT}_a.zip",
        """\
"Last Name","Username","Lab 3 [Total Pts: 100 Score] |5","All [Total Pts: up to 5 Score] |6"
"Roe","jroe","88.00","9"
"Doe","jdoe","@@",""
""",
    ),
}


@pytest.mark.parametrize("before", ["", "12.5"])
@pytest.mark.parametrize("name", UNTOUCHED)
def test_every_byte_stays_but_for_the_points(name: str, before: str, tmp_path: Path) -> None:
    # Canvas: a blank is sent as a change, a file without LastName, FirstName refused
    # (gradebook_importer.rb, row_has_student_headers?); Blackboard quotes every value.
    entry, text = UNTOUCHED[name]
    sign = "," if ";" in text else "."
    book = class_of(tmp_path, {entry: 72.5})
    found = export(
        tmp_path, name.partition(",")[0], text.replace("@@", before.replace(".", sign)), book
    )
    assert found.data.decode() == text.replace("@@", f"72{sign}50")
    assert [one.outcome for one in found.decisions if one.after] == [
        "changed" if before else "filled"
    ]


def test_a_cell_that_holds_a_decision_stays_where_there_is_a_submission_too(tmp_path: Path) -> None:
    # gradebook_exporter.rb: EX is excused, N/A not assigned
    book = class_of(tmp_path, {f"{name}_{name[-1]}_90_a.zip": 80 for name in ("a5", "b6", "c7")})
    rows = '"A, A",5,,a,A,EX\n"B, B",6,,b,A,N/A\n"C, C",7,,c,A,80\n'
    found = export(tmp_path, "canvas", CANVAS + rows, book)
    assert found.data.decode() == CANVAS + rows
    assert list(outcomes(found).values()) == ["kept", "kept", "unchanged"]


@pytest.mark.parametrize("pending", ["Needs Grading", "In Progress(12.00)"])
def test_what_waits_for_a_grade_at_blackboard_gets_one(pending: str, tmp_path: Path) -> None:
    book = class_of(tmp_path, {f"Lab 3_jdoe_{ATTEMPT}_a.zip": 80})
    found = export(
        tmp_path, "blackboard", BLACKBOARD + f'"Doe","Jane","jdoe","8","{pending}"\n', book
    )
    assert lines(found)[1] == '"Doe","Jane","jdoe","8","80.00"'


def test_what_the_program_failed_over_is_no_grade(tmp_path: Path) -> None:
    book = class_of(tmp_path, {"doejane_5_900_a.zip": 70})
    book["students"][0]["crashes"] = ["N08"]
    found = export(tmp_path, "canvas", CANVAS + '"Doe, Jane",5,,jdoe,A,\n', book)
    assert found.decisions[0].why == "graded: a rule failed (N08)"
    assert found.decisions[0].outcome == "for a person"


@pytest.mark.parametrize("status", ["empty", "unreadable", "timeout", "tool failed", "crashed"])
def test_a_status_that_is_no_grade_is_named_and_left_to_a_person(
    status: str, tmp_path: Path
) -> None:
    book = class_of(tmp_path, {"doejane_5_900_a.zip": 0})
    book["students"][0] |= {"status": status, "reason": "of this"}
    rows = '"Doe, Jane",5,,jdoe,A,\n'
    found = export(tmp_path, "canvas", CANVAS + rows, book)
    assert found.data.decode() == CANVAS + rows
    assert found.decisions == (
        Decision("for a person", "Doe, Jane (5)", "5 (doejane)", why=f"{status}: of this"),
    )


@pytest.mark.parametrize("words", ["adjusted by hand: mailed (+10 points)", "remark: mail it"])
def test_points_by_hand_are_filled_in_where_nothing_was_judged(words: str, tmp_path: Path) -> None:
    book = class_of(tmp_path, {"doejane_5_900_a.zip": 10})
    lost = {"item": "drive", "requirement": "", "title": words, "points": -10.0}
    row = '"Doe, Jane",5,,jdoe,A,'
    for place in ({"because": [words]}, {"lost": [lost]}):
        book["students"][0] |= {"status": "empty", "because": [], "lost": [], **place}
        found = export(tmp_path, "canvas", f"{CANVAS}{row}\n", book)
        is_given = words.startswith("adjusted")
        assert found.data.decode() == f"{CANVAS}{row}{'10.00' if is_given else ''}\n"
        assert found.decisions[0].outcome == ("filled" if is_given else "for a person")
        assert (found.decisions[0].why == "empty: points by hand") is is_given


def test_a_remark_goes_into_an_empty_field_and_is_no_formula(tmp_path: Path) -> None:
    # feedback/offline/importgradeslib.php: the comments are those of an editor
    book = class_of(tmp_path, {f"A_{n}_assignsubmission_file/": 80 for n in (5, 6)})
    for row in book["students"]:
        row["because"] = ["=late <script>", "at most 80 %"]
    rows = "Participant 5,A,,,,100,\nParticipant 6,A,,,,100,mine\n"
    assert lines(export(tmp_path, "moodle", MOODLE + rows, book))[1:] == [
        "Participant 5,A,,,80.00,100,'=late &lt;script&gt;<br>at most 80 %",
        "Participant 6,A,,,80.00,100,mine",
    ]


def test_a_table_with_tabs_is_an_xls_of_blackboard_in_utf_16(tmp_path: Path) -> None:
    book = class_of(tmp_path, {f"Lab 3_jdoe_{ATTEMPT}_a.zip": 80})
    text = BLACKBOARD.replace(",", "\t") + '"Doe"\t"Zoë"\t"jdoe"\t"8"\n'
    for codec, mark in (("utf-16-le", b"\xff\xfe"), ("utf-16-be", b"\xfe\xff")):
        found = export(tmp_path, "blackboard", mark + text.encode(codec), book)
        assert found.name == "blackboard.xls"
        assert found.data == mark + text.replace('"8"\n', '"8"\t"80.00"\n').encode(codec)


# ---- the column and its maximum


COLUMNS = {
    "canvas": (
        CANVAS.replace("possible", "").replace(",100\n", ",10\n") + '"Doe, Jane",5,,jdoe,A,\n',
        "doejane_5_900_a.zip",
    ),
    "moodle": (MOODLE + "Participant 5,Jane Doe,,,,10.00,\n", "Jane Doe_5_assignsubmission_file_a"),
    "brightspace": (
        BRIGHTSPACE.replace("MaxPoints:100", "MaxPoints:10") + "#5,#j,Doe,Jane,,,#\n",
        f"5-7 - Jane Doe - {DAY} - a.zip",
    ),
    "blackboard": (
        BLACKBOARD.replace("100 Score", "10 Score") + '"Doe","Jane","jdoe","5",""\n',
        f"Lab 3_jdoe_{ATTEMPT}_a.zip",
    ),
}


@pytest.mark.parametrize("platform", COLUMNS)
def test_another_maximum_is_refused_and_converted_on_demand(platform: str, tmp_path: Path) -> None:
    text, entry = COLUMNS[platform]
    book = class_of(tmp_path, {entry: 72.5})
    with pytest.raises(UsageError, match="has 10 points, the rubric 100; convert with --scale"):
        export(tmp_path, platform, text, book)
    assert list(points_of(export(tmp_path, platform, text, book, scale=True)).values()) == ["7.25"]


@pytest.mark.parametrize(
    ("platform", "text"),
    [
        ("canvas", 'Student,ID,Lab 3 (77)\n"Doe, Jane",5,\n'),
        ("canvas", CANVAS.replace(",100\n", ",0\n") + '"Doe, Jane",5,,,,\n'),
        ("brightspace", "Username,First Name,Last Name,Lab 3 Points Grade\n#j,Jane,Doe,\n"),
        ("moodle", MOODLE + "Participant 5,A,,,,100,\nParticipant 6,B,,,,10,\n"),
    ],
)
def test_a_maximum_that_is_not_known_is_refused(platform: str, text: str, tmp_path: Path) -> None:
    book = class_of(tmp_path, {"jane/": 80})
    with pytest.raises(UsageError, match="does not say how many points"):
        export(tmp_path, platform, text, book, scale=True)


@pytest.mark.parametrize(
    "heading",
    ["Lab 30 (77)", "Lab 3", "Lab 3b (77)", "Final Score", "Lab 3 (late) (77)", "Pre Lab 3 (77)"],
)
def test_a_column_of_another_title_is_not_taken_and_none_is_made(
    heading: str, tmp_path: Path
) -> None:
    book = class_of(tmp_path, {"doejane_5_900_a.zip": 80})
    text = CANVAS.replace("Lab 3 (77)", heading) + '"Doe, Jane",5,,jdoe,A,\n'
    with pytest.raises(UsageError, match=r"has no column 'Lab 3'; there .*--column"):
        export(tmp_path, "canvas", text, book)


@pytest.mark.parametrize("column", ["Lab 3 (78)", "second"])
def test_of_two_columns_one_is_named(column: str, tmp_path: Path) -> None:
    book = class_of(tmp_path, {"doejane_5_900_a.zip": 80})
    text = (
        "Student,ID,Lab 3 (77),Lab 3 (78),Second (79)\n    Points Possible,,100,100,100\n"
        '"Doe, Jane",5,,,\n'
    )
    with pytest.raises(UsageError, match=r"has the columns Lab 3 \(77\), Lab 3 \(78\)"):
        export(tmp_path, "canvas", text, book)
    found = export(tmp_path, "canvas", text, book, column=column)
    cells = {"Lab 3 (78)": ",80.00,", "second": ",,80.00"}
    assert lines(found)[2] == f'"Doe, Jane",5,{cells[column]}'


def test_a_column_of_blackboard_without_its_number_is_refused(tmp_path: Path) -> None:
    # und.teamdynamix.com 59084: without |ID Blackboard makes a column of text
    book = class_of(tmp_path, {f"Lab 3_jdoe_{ATTEMPT}_a.zip": 80})
    text = BLACKBOARD.replace(" |5", "") + '"Doe","Jane","jdoe","5",""\n'
    with pytest.raises(UsageError, match=r"lacks the \|number at its end"):
        export(tmp_path, "blackboard", text, book)


# ---- worksheets of Moodle in other languages


GERMAN = "ID;Vollständiger Name;E-Mail-Adresse;Status;Gruppe;Bewertung;Beste Bewertung;Kommentar\n"


def test_a_worksheet_in_another_language_is_read_by_order_and_shape(tmp_path: Path) -> None:
    book = class_of(tmp_path, {f"{name}_assignsubmission_file/": 72.5 for name in ("Jo Lee_7",)})
    rows = (
        "Teilnehmer/in7;Jo Lee;j@x.example;Abgegeben;;;100,00;gut\n"
        "Teilnehmer/in8;Al Fox;;;;88,00;100,00;\n"
    )
    found = export(tmp_path, "moodle", GERMAN + rows, book)
    assert found.data.decode() == GERMAN + rows.replace(";;;100,00;gut", ";;72,50;100,00;gut")


def test_a_group_in_a_worksheet_in_another_language_is_known_by_its_name(tmp_path: Path) -> None:
    book = class_of(tmp_path, {"Team A_7_assignsubmission_file/": 80})
    rows = "".join(
        f"Teilnehmer/in{number};{name};;Abgegeben;{team};;100,00;\n"
        for number, name, team in ((7, "Jo", "Team B"), (8, "Al", "Team A"), (9, "Bo", "Team A"))
    )
    found = export(tmp_path, "moodle", GERMAN + rows, book)
    assert points_of(found) == {"Al (Teilnehmer/in8)": "80,00", "Bo (Teilnehmer/in9)": "80,00"}


@pytest.mark.parametrize(
    ("head", "word", "entry"),
    [
        ("Identifier,Status,Grade,Maximum grade", "Participant ", "Participant"),
        ("ID,Status,Bewertung,Beste Bewertung", "Teilnehmer/in", "Teilnehmerin"),
    ],
)
def test_a_class_under_blind_marking_goes_by_its_numbers(
    head: str, word: str, entry: str, tmp_path: Path
) -> None:
    book = class_of(
        tmp_path, {f"{entry}_{n}_assignsubmission_file/": n for n in (77, 78)}
    )  # fmt: skip
    rows = f"{head}\n{word}78,Sent,,100.00\n{word}77,Sent,,100.00\n"
    assert lines(export(tmp_path, "moodle", rows, book))[1:] == [
        f"{word}78,Sent,78.00,100.00",
        f"{word}77,Sent,77.00,100.00",
    ]


@pytest.mark.parametrize(
    "text",
    [
        "Identifier,Full name,Grade,Scale\nParticipant 5,Jo,,bad good\n",
        "ID,Name,Note,Skala\nTeilnehmer/in5,Jo,,gut\n",
        "ID,Name,A,B,Note,Max\nTeilnehmer/in5,Jo,,5,,10\n",
    ],
)
def test_a_scale_or_a_worksheet_that_stays_open_is_refused(text: str, tmp_path: Path) -> None:
    book = class_of(tmp_path, {"Jo_5_assignsubmission_file/": 80})
    with pytest.raises(UsageError, match="has no grade with one maximum in every row"):
        export(tmp_path, "moodle", text, book)


# ---- a map


def mapped(tmp_path: Path, text: str, rows: str, book: dict[str, Any]) -> FilledExport:
    path = tmp_path / "map.csv"
    path.write_text(text)
    return export(tmp_path, "canvas", CANVAS + rows, book, given=path)


ROSTER = '"Roe, Joe",5,9,jroe,A,\n"Doe, Jane",9,5,jdoe,A,\n"Fox, Al",7,8,af,A,\n'


@pytest.mark.parametrize(
    ("text", "filled_in"),
    [
        ("submission,SIS User ID\nanon_x,5\n", ["Doe, Jane (9)"]),
        ("submission,ID\nanon_x,5\n", ["Roe, Joe (5)"]),
        ("submission,id\nanon_x,jroe\n", ["Roe, Joe (5)"]),
        ("submission,id\nanon_x_7_a.zip,Al Fox\n", ["Fox, Al (7)"]),
        ("submission,id\nanon_x,jroe\nanon_x,jdoe\n", ["Roe, Joe (5)", "Doe, Jane (9)"]),
        ("submission,id\nanon_x,jroe\nanon_x,JROE\n", ["Roe, Joe (5)"]),
        ("submission,id\nanon_x,nobody\n", []),
        ("submission,id\nanon_x,\n", []),
    ],
)
def test_a_map_says_whose_a_submission_is(text: str, filled_in: list[str], tmp_path: Path) -> None:
    book = class_of(tmp_path, {"anon_x_7_a.zip": 80})
    assert list(points_of(mapped(tmp_path, text, ROSTER, book))) == filled_in


def test_whom_canvas_hides_a_map_must_say(tmp_path: Path) -> None:
    found = export(tmp_path, "canvas", CANVAS, class_of(tmp_path, {"anon_x_7_a.zip": 80}))
    assert found.decisions == (
        Decision("without a row", "", "anon_x", why="the platform hides who this is: give --map"),
    )


def test_a_map_does_not_take_a_row_that_is_somebody_elses_too(tmp_path: Path) -> None:
    book = class_of(tmp_path, {"anon_x_7_a.zip": 80, "roejoe_5_8_a.zip": 60})
    found = mapped(tmp_path, "submission,ID\nanon_x,5\n", ROSTER, book)
    assert points_of(found) == {}
    assert outcomes(found)["Roe, Joe (5)"] == "ambiguous"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("submission,id\nnobody,5\n", "row 2: no submission is called 'nobody'"),
        ("submission,id\nanon_x,5\n", "'5' may be Roe, Joe.*; head the column"),
        ("name,id\nanon_x,5\n", "needs the columns submission and id"),
        ("", "needs the columns submission and id"),
    ],
)
def test_a_map_that_is_wrong_is_refused(text: str, fault: str, tmp_path: Path) -> None:
    book = class_of(tmp_path, {"anon_x_7_a.zip": 80})
    with pytest.raises(UsageError, match=fault):
        mapped(tmp_path, text, ROSTER, book)


CLASSROOM = '"identifier","github_username","github_id","name"\n'


def test_the_roster_of_github_classroom_names_the_students_of_clones(tmp_path: Path) -> None:
    # gh classroom clone student-repos writes SLUG-submissions/SLUG-USER
    book = class_of(tmp_path, {"lab-3-octo-cat/": 80, "lab-3-Hubot/": 60, "lab-3-cat/": 40})
    text = (
        CLASSROOM
        + '"jroe","hubot","1",""\n"Jane Doe","octo-cat","2",""\n"af","cat","3",""\n"x","","",""\n'
    )
    assert points_of(mapped(tmp_path, text, ROSTER, book)) == {
        "Roe, Joe (5)": "60.00", "Doe, Jane (9)": "80.00", "Fox, Al (7)": "40.00",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "fault"),
    [
        ('"jroe","cat","1",""\n"jdoe","octo-cat","2",""\n', "do not show where the users"),
        ('"jroe","other","1",""\n', "no common start"),
        ('"jroe","cat","1",""\n"jdoe","CAT","2",""\n', "names the user 'cat' twice"),
    ],
)
def test_clones_whose_users_are_not_clear_are_refused(
    rows: str, fault: str, tmp_path: Path
) -> None:
    book = class_of(tmp_path, {"lab-octo-cat/": 80})
    with pytest.raises(UsageError, match=fault):
        mapped(tmp_path, CLASSROOM + rows, ROSTER, book)


# ---- the table


def test_the_table_counts_every_row_and_submission_and_says_what_changes(tmp_path: Path) -> None:
    book = class_of(
        tmp_path,
        {"aa_1_90_a.zip": 80, "bb_2_91_a.zip": 60, "cc_3_92_a.zip": 40, "z_9_93_a.zip": 20,
         "ee_5_94_a.zip": 0, "\x1b[1mg_7_95_a.zip": 1},
    )  # fmt: skip
    (empty,) = (row for row in book["students"] if row["student"] == "5")
    empty |= {"status": "empty", "reason": "holds no stage"}
    rows = (
        '"A, A",1,,a,A,\n"B, B",2,,b,A,88.00\n"C, C",3,,c,A,40.00\n"D, D",4,,d,A,12\n'
        '"E, E",5,,e,A,\n"F, F",6,,f,A,\n"G, G",7,,g,A,EX\n'
    )
    found = export(tmp_path, "canvas", CANVAS + rows, book)
    assert list(decision_lines(found)) == [
        "Lab 3 (77): 100 points",
        "    1 filled in:",
        "        A, A (1)  80.00  1 (aa)",
        "    1 changed:",
        "        B, B (2)  88.00 -> 60.00  2 (bb)",
        "    1 left, with these points already:",
        "        C, C (3)  40.00  3 (cc)",
        "    1 left, since the cell holds a decision:",
        "        G, G (7)  EX  7 (\\x1b[1mg)  represents '\\x1b[1mg'",
        "    1 left for you to grade:",
        "        E, E (5)  5 (ee)  empty: holds no stage",
        "    0 left, since it is not clear whose they are",
        "    2 left, without a submission:",
        "        D, D (4)  12",
        "        F, F (6)",
        "    1 submissions without a row:",
        "        9 (z)  the export names nobody of this name or number",
    ]


# ---- files that are no exports


@pytest.mark.parametrize("text", ["", "\n", "a,b\n1,2\n"])
@pytest.mark.parametrize("platform", ["canvas", "moodle", "brightspace", "blackboard"])
def test_the_export_of_another_platform_is_refused(
    platform: str, text: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=f"not an export of {platform}|no grade with one maximum"):
        export(tmp_path, platform, text, class_of(tmp_path, {"jane/": 80}))


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"Student,ID,Mini (1)\n\xff", "is not a text table"),
        (b'Student,ID,Lab 3 (1)\n"Jo,1,\n', "line 2 opens a quote and no end"),
        (b"PK\x03\x04 sheet", "is a workbook; export it as comma-separated"),
        (b"\xff\xfea", "is not a text table"),
    ],
)
def test_an_export_that_cannot_be_read_is_refused(data: bytes, fault: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=fault):
        export(tmp_path, "canvas", data, class_of(tmp_path, {"jane/": 80}))


def test_an_export_that_is_not_there_or_too_large_is_refused(tmp_path: Path) -> None:
    book = class_of(tmp_path, {"jane/": 80})
    with pytest.raises(UsageError, match="cannot be read"):
        fill_export("canvas", tmp_path / "gone.csv", book)
    (tmp_path / "large.csv").touch()
    os.truncate(tmp_path / "large.csv", (64 << 20) + 1)
    with pytest.raises(UsageError, match="is larger than 64 MB"):
        fill_export("canvas", tmp_path / "large.csv", book)


def test_a_gradebook_that_does_not_say_whose_the_submissions_are_is_refused(
    tmp_path: Path,
) -> None:
    book = class_of(tmp_path, {"jane/": 80})
    del book["students"][0]["people"]
    with pytest.raises(UsageError, match="grade again with --resume"):
        export(tmp_path, "canvas", CANVAS, book)


def test_a_rubric_of_extra_points_alone_is_refused(tmp_path: Path) -> None:
    book = class_of(tmp_path, {"jane/": 80}, points=0)
    with pytest.raises(UsageError, match="no points to fill in"):
        export(tmp_path, "canvas", CANVAS, book, scale=True)


QUOTINGS = [csv.QUOTE_ALL, csv.QUOTE_MINIMAL]
CELLS = st.text(alphabet=list("ab,;\t\"' \r\n1é="), max_size=6)


@given(st.lists(st.lists(CELLS, min_size=2, max_size=4), min_size=1, max_size=5), st.data())
def test_a_table_is_read_as_python_reads_it_and_filled_cell_by_cell(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[str]], data: st.DataObject
) -> None:
    has_ends = any(end in cell for row in rows for cell in row for end in "\r\n")
    # Before 3.13 Python leaves ends of lines unquoted where its own are others.
    quoting = csv.QUOTE_ALL if has_ends else data.draw(st.sampled_from(QUOTINGS))
    end = data.draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = io.StringIO(newline="")
    csv.writer(text, quoting=quoting, lineterminator=end).writerows([["h", "i"], *rows])
    path = tmp_path_factory.getbasetemp() / "table.csv"
    path.write_bytes(text.getvalue().encode())
    table = read_text_table(path)
    assert [[cell.value for cell in row] for row in table.rows] == [["h", "i"], *rows]
    assert filled_bytes(table, {}) == path.read_bytes()
    row, value = data.draw(st.integers(1, len(rows))), data.draw(CELLS)
    path.write_bytes(filled_bytes(table, {(row, 1): value}))
    rows[row - 1][1] = value
    assert [[cell.value for cell in cells] for cells in read_text_table(path).rows][1:] == rows
